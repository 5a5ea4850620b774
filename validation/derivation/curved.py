"""Derive the fast model of a curved cover from the reference: compliance of its surface and forces on its texels."""

from __future__ import annotations

import numpy as np

from fastmodel.curved.cover import CurvedCover
from fem_reference import result_store
from fem_reference.curved_cover import texel_responses
from fem_reference.curved_cover.contact import NormalCompliance
from fem_reference.curved_cover.responses import build_solid
from meshes import Material, TexelArray
from meshes.array_types import FloatArray
from meshes.solids.quality import compute_volume, measure_area
from meshes.solids.solid_mesh import SolidMesh


def derive_curved_cover(mesh: SolidMesh, texels: TexelArray, material: Material) -> CurvedCover:
    """Compute the arrays of the fast model on the nodes of the top of one mesh, or read them from the store.

    The cost is one solution per node of the top and per texel.

    Args:
        mesh: Mesh of the cover; its top is the surface on which the fast model solves contact.
        texels: Texels on the base of the mesh.
        material: Material; hyperelastic materials are linearised at zero load.

    Raises:
        ValueError: If the mesh cannot be used or a texel is not on its base.
    """
    responses = texel_responses(mesh, texels, material)

    def compute() -> dict[str, FloatArray]:
        compliance = NormalCompliance(build_solid(mesh, material))
        nodes = np.flatnonzero(compliance.bearing)
        rows = compliance.rows(nodes)[:, nodes]
        return {"nodes": nodes.astype(float), "compliance": (rows + rows.T) / 2}

    found = result_store.fetch("curved-compliance", {"mesh": mesh.digest, "material": material}, compute)
    nodes, top = found["nodes"].astype(np.int64), responses.finest.top
    return CurvedCover(
        points=top.nodes[nodes],
        normals=top.normals[nodes],
        influence=responses.finest.normal_influence[:, nodes] * texels.active[:, None],
        compliance=found["compliance"],
        thickness=compute_volume(mesh) / measure_area(mesh, "base"),
    )
