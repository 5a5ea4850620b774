"""Derive the fast model of a curved cover from the reference: compliance of its surface and forces on its texels."""

from __future__ import annotations

import numpy as np

from fastmodel.surface import CoverPoints
from fem_reference import result_store
from fem_reference.curved_cover import texel_responses
from fem_reference.curved_cover.contact import TopCompliance
from fem_reference.curved_cover.pressure_shapes import spread_hats
from fem_reference.curved_cover.responses import build_solid, find_top
from meshes import Material, TexelArray
from meshes.array_types import FloatArray
from meshes.solids.solid_mesh import SolidMesh, compute_volume, measure_area

#: Largest number of nodes of the top, including midpoints of edges, for the derivation of the fast model [-].  One
#: solution per node is needed, and the compliance between all pairs of nodes is stored.
MOST_NODES = 5000
#: Reason why a solid cover has no fast model of contact, for messages.
TOO_FINE = "the meshes of this cover are too fine for the fast model"


def choose_mesh(meshes: tuple[SolidMesh, ...]) -> SolidMesh | None:
    """Choose the mesh for the fast model: the second of three, or a coarser one; None if all are too large.

    Args:
        meshes: Meshes of the cover, coarsest first.
    """
    return next(
        (mesh for mesh in reversed(meshes[: 1 + len(meshes) // 2]) if len(find_top(mesh).nodes) <= MOST_NODES), None
    )


def derive_points(mesh: SolidMesh, texels: TexelArray, material: Material) -> CoverPoints:
    """Compute the arrays of the fast model on the nodes of the top of one mesh, or read them from the store.

    The forces of the fast model are the pressure shapes of the reference (`pressure_shapes`), one around each node of
    the top.  The cost is one solution per node of the top and per texel.

    Args:
        mesh: Mesh of the cover; the fast model solves the contact on its top.
        texels: Texels on the base of the mesh.
        material: Material; hyperelastic materials are linearised at zero load.

    Raises:
        ValueError: If the mesh cannot be used or a texel is not on its base.
    """
    responses = texel_responses([mesh], texels, material)
    top = responses.finest.top
    kept = np.flatnonzero(~np.isin(top.index, mesh.base))  # bonded nodes at the edge of the top do not yield
    hats = spread_hats(top)[:, kept]

    def compute() -> dict[str, FloatArray]:
        compliance = TopCompliance(build_solid(mesh, material))
        rows = hats.T @ (hats.T @ compliance.rows(np.arange(len(top.nodes)))).T
        return {"compliance": (rows + rows.T) / 2}

    inputs = {"mesh": mesh.digest, "material": material, "code": result_store.hash_file(__file__)}
    found = result_store.fetch("curved-hat-compliance", inputs, compute)
    return CoverPoints(
        points=top.nodes[kept],
        normals=top.normals[kept],
        influence=(responses.finest.normal_influence @ hats) * texels.active[:, None],
        compliance=found["compliance"],
        thickness=compute_volume(mesh) / measure_area(mesh, "base"),
    )
