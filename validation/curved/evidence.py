"""Evidence beside the scores of a curved cover: verification, groups of cases, and their range."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Sequence

import numpy as np

from fem_reference import ConvergenceError
from fem_reference.closed_form.cylinder import ArcLoad, CylinderLayer
from fem_reference.curved_cover import texel_responses
from meshes import Material, TexelArray
from meshes.array_types import FloatArray
from meshes.solids import SolidMesh, sweep
from meshes.solids.swept import cylinder_surface
from validation.campaign.case import Case
from validation.campaign.pooling import Pooled
from validation.campaign.results import CampaignResult, CaseResult
from validation.credibility.code_verification import Check
from validation.credibility.evidence import Evidence, pool_groups
from validation.curved.reference import press_case
from validation.sensor_file import SensorDescription

#: Sections of the report on flat covers that have no meaning here.
_LEFT_OUT = (
    "Input uncertainty is not propagated: each changed input needs a new mesh and new responses of all texels.",
    "The error is not divided into stages; the row “gaussian” of the table of models shows the spread to the texels.",
    "Published models are not scored: they are stated for planar arrays.",
    "Recordings are not scored: none of a curved array under known loads is public.",
    "Nothing is compared with the solution of a laterally wide layer: a curved cover is none.",
)
#: Radius of the core of the checked shell over its thickness, half its length over the thickness, and half the width
#: of the load over the thickness [-].
_CORE, _HALF_LENGTH, _LOAD = 3.0, 6.0, 1.25
#: Element sizes over the thickness and layers of elements of the three meshes of the shell.
_SHELL_MESHES = ((0.8, 3), (0.55, 4), (0.4, 5))
#: Largest accepted error of texel forces on the shell over the load, and least order [-].
_SHELL_ERROR, _SHELL_ORDER = 5e-3, 1.0
#: Least order of the reference against a finer mesh: that of the contact pressure at a sharp edge [-].
_LEAST_ORDER = 0.7
#: Angle from the normal above which a direction counts as oblique [rad], depth over the thickness that divides two
#: groups of cases [-].
_OBLIQUE, _DEEP = math.radians(10), 0.08


def gather_curved_evidence(
    sensor: SensorDescription,
    meshes: tuple[SolidMesh, ...],
    result: CampaignResult,
    progress: Callable[[str], None] | None = None,
) -> Evidence:
    """Verify the elements on a shell with a closed form and on a finer mesh of the cover, and group the cases.

    What fails is named in the result and costs nothing else.  After an interruption nothing is solved.

    Args:
        sensor: A sensor with a curved cover.
        meshes: Meshes of the cover, coarsest first.
        result: The scores.
        progress: Called with the name of each part.
    """
    tell = progress or (lambda _: None)
    checks, failed = [], []
    if result.interrupted:
        failed.append("interrupted: codes are not verified")
    else:
        tell("verification of the elements on a shell")
        material = sensor.cover.layers[0].material
        try:
            checks.append(check_shell(material, sensor.cover.thickness))
        except (ConvergenceError, ValueError) as error:
            failed.append(f"verification on a shell: {error}")
        tell("verification on a finer mesh")
        try:
            checks += check_finer_mesh(sensor, meshes, result.cases)
        except (ConvergenceError, ValueError) as error:
            failed.append(f"verification on a finer mesh: {error}")
        if sensor.body is None or sensor.body.refine is None:
            failed.append("no finer mesh: the mesh of this cover was given or made of tetrahedra")
    return Evidence(
        checks=tuple(checks),
        convergence=(),
        inputs={},
        errors=(),
        stages=None,
        groups=group_curved_errors(sensor, result.cases),
        domain=describe_curved_domain(sensor, result.cases),
        failed=tuple(failed),
        left_out=_LEFT_OUT,
    )


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
    """
    if sensor.body is None or sensor.body.refine is None or len(meshes) == 1:
        return []
    finer = sensor.body.refine(sensor.body.thickness)
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


def group_curved_errors(
    sensor: SensorDescription, results: Sequence[CaseResult]
) -> dict[str, dict[str, dict[str, Pooled]]]:
    """Pool the errors of the fast model by shape, direction and depth."""
    groups: dict[str, dict[str, list[CaseResult]]] = {
        name: defaultdict(list) for name in ("shape", "direction", "depth")
    }
    for result in results:
        groups["shape"][result.case.shape.split(":")[0]].append(result)
        oblique = measure_obliquity(result) > _OBLIQUE
        groups["direction"]["oblique" if oblique else "along the normal"].append(result)
        deep = result.reference.depth > _DEEP * sensor.cover.thickness
        side = "above" if deep else "up to"
        groups["depth"][f"{side} {100 * _DEEP:g} % of the thickness"].append(result)
    return pool_groups(groups)


def measure_obliquity(result: CaseResult) -> float:
    """Return the angle between the motion of the indenter and the normal of the cover where it is placed [rad]."""
    pose, top = result.case.pose, result.reference.found.top
    normal = top.normals[int(np.argmin(np.linalg.norm(top.nodes - pose.position, axis=1)))]
    return float(np.arccos(np.clip(-normal @ pose.towards, -1.0, 1.0)))


def describe_curved_domain(sensor: SensorDescription, results: Sequence[CaseResult]) -> dict[str, tuple[float, float]]:
    """Return the range of loads, depths over thickness, contact areas and directions that the cases cover."""
    ranges = {
        "load_N": [each.case.load for each in results],
        "depth_over_thickness": [each.reference.depth / sensor.cover.thickness for each in results],
        "contact_area_m2": [each.reference.contact_area for each in results],
        "obliquity_rad": [measure_obliquity(each) for each in results],
    }
    return {name: (min(values), max(values)) for name, values in ranges.items()}
