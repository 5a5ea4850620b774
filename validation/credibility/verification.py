"""Verification of codes and of solutions, with observed orders of accuracy.

The solvers are compared with closed forms on several grids, and with a finer mesh of a solid cover.  Every check runs
when the report is made, on the cover of the sensor, and every error is computed anew.  The observed order p is the
slope of the logarithm of the error over that of the element size, by least squares.  The solutions of the cases are
listed on three grids, each with its observed order and its estimated error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from scipy.optimize import brentq

from fem_reference.closed_form.cylinder import CylinderLayer
from fem_reference.curved_cover import texel_responses
from meshes import Cover, Cylinder, Layer, Material, SolidCover, Sphere, TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Place, Pose
from meshes.solids import SolidMesh, sweep
from meshes.solids.covers import take_meshes
from meshes.solids.swept import cylinder_surface
from validation.campaign.reference_press import press_reference
from validation.campaign.results import CaseResult
from validation.results import Column, Number, Result, result_model

if TYPE_CHECKING:
    from fem_reference.indentation.grid_solution import GridSolution

#: Wave numbers times the thickness at which the surface compliance is compared [-].
_WAVE_NUMBERS = np.geomspace(0.2, 4.0, 25)
#: Number of elements through each layer on the three meshes for the surface compliance [-].
_WAVE_ELEMENTS = (4, 8, 16)
#: Depth of the contact checks over the thickness of the cover [-].
_DEPTH = 0.05
#: Radius of the cylinder of the contact checks over the thickness of the cover [-].
_CYLINDER = 1.0
#: Radius of the ball of the contact checks over the thickness of the cover [-].
_BALL = 2.0
#: Number of elements through half the height of the bonded disk on the three meshes [-].
_DISK_ELEMENTS = (4, 6, 9)
#: Radius of the bonded disk over half its height [-].
_DISK_RADIUS = 4.0
#: Exact mean stress over strain and Young's modulus of this disk, by the series in `tests/exact/disk_series.py` [-].
_DISK_MODULUS = 2.9551964691492367


@result_model
class Check(Result):
    """Errors of one solver against one closed-form solution on several grids.

    Attributes:
        name: Compared quantity and solver.
        exact: The closed-form solution and its source.
        sizes: Element sizes of the grids over that of the coarsest, coarsest first [-].
        errors: Relative error on each grid [-].
        result: Relative error of the result that the solver returns, which may be extrapolated [-].
        least_order: Least order of accuracy that the method should show [-].
        tolerance: Largest accepted error of the result [-].
    """

    name: Annotated[str, Column(heading="what", small="against: {0.exact}")]
    exact: str
    sizes: tuple[float, ...]
    errors: Annotated[
        tuple[Number, ...], Column(heading="", unit="%", factor=100, digits=2, parts=("coarse", "middle", "fine"))
    ]
    result: Annotated[
        Number,
        Column(heading="error of the result", unit="%", factor=100, digits=2, small="limit {0.tolerance:.3g}"),
    ]
    least_order: float
    tolerance: Number
    printed: ClassVar[Mapping[str, Column]] = {
        "order": Column(heading="observed order", digits=2, small="at least {0.least_order:g}"),
        "passed": Column(heading="", words={True: "passed", False: "failed"}, alarms=(False,)),
    }
    computed = (("observed_order", "order"), ("passed", "passed"))

    @property
    def order(self) -> float:
        """Observed order of accuracy [-]; NaN if an error is zero."""
        if min(self.errors) <= 0:
            return float("nan")
        return float(np.polyfit(np.log(self.sizes), np.log(self.errors), 1)[0])

    @property
    def passed(self) -> bool:
        """Whether the result is accurate, and the error converges as expected or is within the tolerance."""
        falls = self.order >= self.least_order or max(self.errors) < self.tolerance
        return bool(self.result <= self.tolerance and falls)


def verify_code(cover: Cover, array: TexelArray) -> tuple[Check, ...]:
    """Run all checks on a laterally wide cover.

    Args:
        cover: The cover; its layers have their linear elastic properties at zero load.
        array: Array whose texels are used in the last check.

    Raises:
        ValueError: If the cover has free side edges.
        ConvergenceError: If a solver does not converge.
    """
    return (
        check_surface_compliance(cover),
        check_point_load(cover),
        *check_contact(cover, array),
        check_bonded_disk(),
    )


def check_surface_compliance(cover: Cover) -> Check:
    """Compare the elements through the thickness with the exact compliance of the top under waves of pressure."""
    from fem_reference.closed_form.layer import transfer
    from fem_reference.linear_response.surface_compliance import solve_waves

    k = _WAVE_NUMBERS / cover.thickness
    exact = transfer(cover, k).compliance
    errors = [
        float(np.abs(solve_waves(cover, k, elements_per_layer=count).compliance / exact - 1).max())
        for count in _WAVE_ELEMENTS
    ]
    finest = float(np.abs(solve_waves(cover, k).compliance / exact - 1).max())
    return Check(
        name="compliance of the top under waves of pressure, quadratic elements through the thickness",
        exact="layer equations by transfer matrices",
        sizes=_relative(1 / np.array(_WAVE_ELEMENTS)),
        errors=tuple(errors),
        result=finest,
        least_order=2.0,
        tolerance=1e-3,
    )


def check_point_load(cover: Cover) -> Check:
    """Compare the axisymmetric elements with the exact pressure on the base under a point load."""
    from fem_reference.closed_form.layer import point_response
    from fem_reference.linear_response.axisymmetric import point_spread

    spread = point_spread(cover)
    radius = np.linspace(0, 6 * cover.thickness, 200)
    exact = point_response(cover, radius)
    errors = [float(np.abs(each.pressure(radius) - exact).max() / exact.max()) for each in (*spread.coarse, spread)]
    return Check(
        name="pressure on the base under a point load, axisymmetric elements",
        exact="Hankel transform of the layer solution",
        sizes=_relative(np.array(spread.sizes)),
        errors=tuple(errors),
        result=errors[-1],
        least_order=1.0,
        tolerance=5e-3,
    )


def check_contact(cover: Cover, array: TexelArray) -> list[Check]:
    """Compare forces under a flat cylinder and a ball at small strain with integral equations.

    The total force and the largest texel force are compared.  On covers with a stiff top layer the contact may require
    tension, which the closed form does not solve; its checks are omitted then.
    """
    from fem_reference.closed_form.contact import indent
    from fem_reference.finite_strain.loading_path import LoadingPath
    from fem_reference.indentation.small_strain import study_path

    depth = _DEPTH * cover.thickness
    place = Place(array=array, pose=Pose.planar(at=(0.21 * array.pitch[0], -0.32 * array.pitch[1]), yaw=0.0))
    out = []
    for name, indenter, order in (
        ("flat cylinder", Cylinder(radius=_CYLINDER * cover.thickness), 0.7),
        ("ball", Sphere(radius=_BALL * cover.thickness), 1.0),
    ):
        try:
            exact = indent(cover, indenter, depth=depth)
        except ValueError:
            continue
        texels = exact.texel_forces(array, place.pose.at)
        peak = int(np.argmax(texels))
        study = study_path(LoadingPath(cover=cover, indenter=indenter, targets=(depth,), control="depth"), place, None)
        quantities: tuple[tuple[str, float, Callable[[GridSolution], float]], ...] = (
            ("force", exact.force, attrgetter("total_force")),
            ("largest texel force", float(texels[peak]), partial(_take_texel, place, peak)),
        )
        for what, value, quantity in quantities:
            grids = study.solutions[0]
            out.append(
                Check(
                    name=f"{what} under a {name} at {100 * _DEPTH:g} % of the thickness, cells of the contact",
                    exact="integral equation of the contact with a layer",
                    sizes=_relative([each.size for each in grids]),
                    errors=tuple(abs(quantity(each) / value - 1) for each in grids),
                    result=abs(float(study.combine(grids, quantity)) / value - 1),
                    least_order=order,
                    tolerance=3e-3,
                )
            )
    return out


def _take_texel(place: Place, texel: int, solution: GridSolution) -> float:
    """Return the force on the texel with index `texel` in a solution [N]."""
    return float(solution.base.forces(place.array, place.pose)[texel])


def check_bonded_disk() -> Check:
    """Compare the finite-strain elements with the exact stiffness of a bonded incompressible disk at small strain."""
    # The apparent modulus, force over area and strain, is divided by Young's modulus.  In units of the shear modulus,
    # Young's modulus of an incompressible material is 3.
    errors = [
        abs(compress_disk(_DISK_RADIUS, count) / (np.pi * _DISK_RADIUS**2) / 3 / _DISK_MODULUS - 1)
        for count in _DISK_ELEMENTS
    ]
    return Check(
        name="stiffness of a disk bonded to two plates, finite-strain elements at a small strain",
        exact="Papkovich-Fadle series",
        sizes=_relative(1 / np.array(_DISK_ELEMENTS)),
        errors=tuple(errors),
        result=errors[-1],
        least_order=0.7,
        tolerance=1e-2,
    )


def compress_disk(radius: float, count: int) -> float:
    """Compute the force per strain of an incompressible disk between bonded plates, per shear modulus [half heights].

    Args:
        radius: Radius of the disk over half its height [-].
        count: Number of elements through half the height [-].
    """
    from fem_reference.elements.taylor_hood import prepare_elements
    from fem_reference.finite_strain.hyperelastic import Solid
    from fem_reference.finite_strain.loading_path import Units
    from fem_reference.linear_response.axisymmetric import mesh_cover
    from fem_reference.sparse_solver import ConstrainedSystem

    rubber = Material(name="incompressible", model="neo-hookean", parameters={"shear_modulus": 1e6}, poisson_ratio=0.5)
    half = Cover(layers=(Layer(thickness=1.0, material=rubber),))
    mesh, _ = mesh_cover(half, count, np.linspace(0, radius, max(2, round(radius * count)) + 1))
    solid = Solid.from_cover(prepare_elements(mesh, axisymmetric=True), half, Units.of(half))
    r, z = solid.elements.nodes.T
    top, middle, axis = (np.flatnonzero(each) for each in np.isclose((z, z, r), [[1], [0], [0]], atol=1e-9))
    fixed = np.unique(np.concatenate([2 * axis, 2 * top, 2 * top + 1, 2 * middle + 1]))
    system = ConstrainedSystem(fixed).factorise(solid.linearise_at_rest().stiffness)
    load = np.zeros(solid.elements.displacements + solid.elements.pressures)
    moved = system.solve(load, np.where(np.isin(fixed, 2 * top + 1), -1.0, 0.0))
    return -float(system.reaction(moved, load)[2 * top + 1].sum())


def _relative(sizes: FloatArray | Sequence[float]) -> tuple[float, ...]:
    """Divide the element sizes of several meshes by that of the first, coarsest mesh."""
    values = np.asarray(sizes, dtype=float)
    return tuple((values / values[0]).tolist())


#: Radius of the core of the checked shell over the thickness of the shell [-].
_CORE = 3.0
#: Half the length of the shell over its thickness [-].
_HALF_LENGTH = 6.0
#: Half the width of the strip that is loaded on the shell, over the thickness [-].
_LOAD = 1.25
#: Element size over the thickness, and number of layers of elements, of each of the three meshes of the shell [-].
_SHELL_MESHES = ((0.8, 3), (0.55, 4), (0.4, 5))
#: Largest accepted error of a texel force on the shell over the load [-].
_SHELL_ERROR = 5e-3
#: Smallest accepted order of convergence of the texel forces on the shell [-].
_SHELL_ORDER = 1.0
#: Smallest accepted order of convergence of the reference against a finer mesh [-]; that of the contact pressure at a
#: sharp edge.
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
    exact = layer.press(edges, press, half_width)
    errors = []
    for elements, layers in _SHELL_MESHES:
        mesh = sweep(cylinder_surface(core, angle, length, elements * thickness), thickness, layers=layers)
        response = texel_responses([mesh], texels, material)
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
    cover: SolidCover, array: TexelArray, meshes: tuple[SolidMesh, ...], results: Sequence[CaseResult], friction: float
) -> list[Check]:
    """Compare a case on each mesh of the reference with the same case on a finer mesh; empty without a finer mesh.

    Two cases are used: those with the smallest contact among round indenters and among the others, because edges
    converge more slowly.

    Args:
        cover: The cover.
        array: The texels on its base.
        meshes: Meshes of the cover, coarsest first.
        results: The scored cases.
        friction: Coefficient of friction of the cases [-].

    Raises:
        ValueError: If the cover cannot be meshed more finely.
    """
    if cover.refine is None:
        raise ValueError("there is none, because the mesh of this cover was given or made of tetrahedra")
    if len(meshes) == 1:
        return []
    finer = cover.refine(cover.thicknesses)
    kinds = ([each for each in results if each.case.indenter.axisymmetric == wanted] for wanted in (True, False))
    out = []
    for result in (min(each, key=lambda result: result.reference.contact_area) for each in kinds if each):
        alone = (take_meshes((mesh,), cover.layers) for mesh in (finer, *meshes))
        exact, *found = (press_reference(each, array, result.case, friction=friction).texel_forces for each in alone)
        errors = tuple(float(np.abs(each - exact).max() / np.abs(exact).max()) for each in found)
        name = result.case.name
        out.append(
            Check(
                name=f"any texel force of the case “{name}”, over the largest one; three meshes of the reference",
                exact=f"no closed form: the same press on a finer mesh of {len(finer.cells)} elements",
                sizes=_relative([len(mesh.cells) ** (-1 / 3) for mesh in meshes]),
                errors=errors,
                result=errors[-1],
                least_order=_LEAST_ORDER,
                tolerance=max(result.reference.error_estimate["peak_texel"], 0.0),
            )
        )
    return out


#: Quantities of the table of solution verification, with the printed unit and the factor from SI units to this unit.
_QUANTITIES = {"depth": ("µm", 1e6), "peak_texel": ("mN", 1e3), "contact_area": ("mm²", 1e6)}
#: Smallest and largest observed order of convergence that is searched for [-].
_ORDERS = (0.05, 10.0)
#: Number of grids from which an order of convergence can be observed [-].
_GRIDS = 3


@result_model
class Convergence(Result):
    """Values of one quantity of one case on three grids, with the observed order of convergence.

    Attributes:
        case: Name of the case.
        quantity: Name of the quantity.
        unit: Unit of the printed values.
        factor: Factor from SI units to the unit of the printed values [-].
        values: The quantity on the three grids, coarsest first, in SI units.
        result: The value of the result, which may be extrapolated or corrected; NaN if not known.
        order: Observed order of convergence [-]; NaN if the values do not converge monotonically.
        estimate: Estimated relative error of the result (grid convergence index or the like) [-].
    """

    case: Annotated[str, Column(heading="case and quantity", small="{0.quantity} [{0.unit}]")]
    quantity: str
    unit: str
    factor: float
    values: Annotated[
        tuple[Number, ...], Column(heading="", digits=5, parts=("coarse", "middle", "fine"), factor_field="factor")
    ]
    result: Annotated[Number, Column(heading="result", digits=5, factor_field="factor")]
    order: Annotated[Number, Column(heading="observed order", digits=2)]
    estimate: Annotated[Number, Column(heading="estimated error", unit="%", factor=100, digits=2)]


def verify_solutions(results: Sequence[CaseResult]) -> tuple[Convergence, ...]:
    """List the quantities of the reference in every case on three grids.

    Args:
        results: The cases.
    """
    out = []
    for result in results:
        reference = result.reference
        grids = reference.grid_values or {}
        for name, (unit, factor) in _QUANTITIES.items():
            if len(grids.get(name, ())) != _GRIDS:
                continue
            found = {
                "depth": reference.depth,
                "peak_texel": float(reference.texel_forces.max()),
                "contact_area": reference.contact_area,
            }
            out.append(
                Convergence(
                    case=result.case.name,
                    quantity=name.replace("_", " "),
                    unit=unit,
                    factor=factor,
                    values=grids[name],
                    result=found[name],
                    order=observe_order(grids[name], grids["size"]),
                    estimate=reference.error_estimate[name],
                )
            )
    return tuple(out)


def observe_order(values: Sequence[float], sizes: Sequence[float]) -> float:
    """Return the observed order of convergence of three values [-].

    The order p solves (f1 - f2) / (f2 - f3) = (h1^p - h2^p) / (h2^p - h3^p) (Celik et al. 2008).

    Args:
        values: Values on three grids, coarsest first.
        sizes: Element sizes of the grids, descending.

    Returns:
        The order; NaN if the values do not converge monotonically, or if the order is outside 0.05..10.
    """
    coarse, fine = values[0] - values[1], values[1] - values[2]
    if coarse * fine <= 0:
        return math.nan

    def miss(order: float) -> float:
        first, second, third = (float((size / sizes[0]) ** order) for size in sizes)
        return (first - second) / (second - third) - coarse / fine

    if miss(_ORDERS[0]) * miss(_ORDERS[1]) > 0:
        return math.nan
    return float(brentq(miss, *_ORDERS))
