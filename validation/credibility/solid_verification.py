"""Verification of the elements of solid covers: on a shell with a closed form, and on a finer mesh of the cover."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fem_reference.closed_form.cylinder import ArcLoad, CylinderLayer
from fem_reference.curved_cover import texel_responses
from meshes import Material, SolidCover, TexelArray
from meshes.array_types import FloatArray
from meshes.solids import SolidMesh, sweep
from meshes.solids.swept import cylinder_surface
from validation.campaign.case import Case
from validation.campaign.results import CaseResult
from validation.credibility.code_verification import Check
from validation.curved.press import press_case
from validation.sensor_file import SensorDescription

#: Radius of the core of the checked shell over its thickness, half its length over the thickness, and half the width
#: of the load over the thickness [-].
_CORE, _HALF_LENGTH, _LOAD = 3.0, 6.0, 1.25
#: Element sizes over the thickness and layers of elements of the three meshes of the shell.
_SHELL_MESHES = ((0.8, 3), (0.55, 4), (0.4, 5))
#: Largest accepted error of texel forces on the shell over the load, and least order [-].
_SHELL_ERROR, _SHELL_ORDER = 5e-3, 1.0
#: Least order of the reference against a finer mesh: that of the contact pressure at a sharp edge [-].
_LEAST_ORDER = 0.7


def check_shell(material: Material, thickness: float) -> Check:
    """Compare the texel forces of a layer on a cylinder under a narrow pressure with the closed form.

    Args:
        material: Material of the layer.
        thickness: Thickness of the layer [m].
    """
    core, length = _CORE * thickness, 2 * _HALF_LENGTH * thickness
    angle, half_width = 2 * np.pi / 3, _LOAD * thickness / (core + thickness)
    pitch = thickness / core
    at = pitch * np.arange(-2, 3)
    normals = np.stack([np.sin(at), 0 * at, np.cos(at)], axis=1)
    size = (2 * core * float(np.sin(0.4 * pitch)), thickness)
    texels = TexelArray(
        centres=core * normals, normals=normals, texel_size=size, pitch=size, rows=1, columns=len(at),
        active=np.ones(len(at), dtype=bool),
    )  # fmt: skip

    def press(turn: FloatArray) -> FloatArray:
        return np.asarray(np.cos(np.pi / 2 * np.minimum(np.abs(turn) / half_width, 1)) ** 2)

    load = half_width * (core + thickness)
    edges = np.stack([at - 0.4 * pitch, at + 0.4 * pitch], axis=1)
    layer = CylinderLayer(core_radius=core, thickness=thickness, material=material)
    exact = layer.respond(ArcLoad(pressure=press, half_width=half_width)).texel_forces(edges)
    errors = []
    for elements, layers in _SHELL_MESHES:
        mesh = sweep(cylinder_surface(core, angle, length, elements * thickness), thickness, layers=layers)
        response = texel_responses(mesh, texels, material)
        top = response.finest.top.nodes
        found = response.under_pressure(press(np.arctan2(top[:, 0], top[:, 2]))) / size[1]
        errors.append(float(np.abs(found - exact).max()) / load)
    return Check(
        name="texel forces of a layer on a cylinder of three times its thickness under a narrow pressure, "
        "quadratic hexahedra; error over the load",
        exact="Fourier series of a bonded layer on a cylinder, plane strain",
        sizes=tuple(elements / _SHELL_MESHES[0][0] for elements, _ in _SHELL_MESHES),
        errors=tuple(errors),
        result=errors[-1],
        least_order=_SHELL_ORDER,
        tolerance=_SHELL_ERROR,
    )


def check_finer_mesh(
    sensor: SensorDescription, meshes: tuple[SolidMesh, ...], results: Sequence[CaseResult]
) -> list[Check]:
    """Compare a case on each mesh of the reference with the same case on a finer mesh; empty if there is none.

    The case with the smallest contact is taken, of those with a round indenter and of the others: edges converge more
    slowly.

    Args:
        sensor: A sensor with a curved cover.
        meshes: Meshes of the cover, coarsest first.
        results: The scored cases.

    Raises:
        ValueError: If the cover cannot be meshed more finely.
    """
    cover = sensor.cover
    if not isinstance(cover, SolidCover) or cover.refine is None:
        raise ValueError("there is none, because the mesh of this cover was given or made of tetrahedra")
    if len(meshes) == 1:
        return []
    finer = cover.refine(cover.thickness)
    kinds = ([each for each in results if each.case.indenter.axisymmetric == wanted] for wanted in (True, False))
    chosen = [min(each, key=lambda result: result.reference.contact_area) for each in kinds if each]
    out = []
    for result in chosen:
        case = result.case
        exact = _press_alone(sensor, finer, case)
        peak = float(np.abs(exact).max())
        errors = [float(np.abs(_press_alone(sensor, mesh, case) - exact).max()) / peak for mesh in meshes]
        sizes = [float(len(mesh.cells)) ** (-1 / 3) for mesh in meshes]
        out.append(
            Check(
                name=f"any texel force of the case “{case.name}”, over the largest one; three meshes of the reference",
                exact=f"no closed form: the same press on a finer mesh of {len(finer.cells)} elements",
                sizes=tuple(each / sizes[0] for each in sizes),
                errors=tuple(errors),
                result=errors[-1],
                least_order=_LEAST_ORDER,
                tolerance=max(result.reference.error_estimate["texel_forces"], 0.0),
            )
        )
    return out


def _press_alone(sensor: SensorDescription, mesh: SolidMesh, case: Case) -> FloatArray:
    """Compute the texel forces of a case on one mesh, shape (n,) [N]."""
    return press_case(sensor, (mesh,), case).texel_forces
