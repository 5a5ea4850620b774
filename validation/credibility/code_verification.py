"""Code verification: the solvers against closed-form solutions on several grids, with observed orders of accuracy.

Every check runs when the report is made, on the cover of the sensor, and every error is computed anew.  The observed
order p is the slope of the logarithm of the error over that of the element size, by least squares.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from meshes import Cover, Cylinder, Material, Sphere, TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Place, Pose
from validation.results import Column, Number, Result, result_model

if TYPE_CHECKING:
    from fem_reference.indentation.grid_solution import GridSolution

#: Wave numbers times the thickness at which the surface compliance is compared [-], and elements through a layer.
_WAVE_NUMBERS, _WAVE_ELEMENTS = np.geomspace(0.2, 4.0, 25), (4, 8, 16)
#: Depth of the contact checks over the thickness; radius of the cylinder and of the ball over the thickness [-].
_DEPTH, _CYLINDER, _BALL = 0.05, 1.0, 2.0
#: Elements through half the height of the bonded disk, its compression, and its radius over half its height [-].
_DISK_ELEMENTS, _STRAIN, _DISK_RADIUS = (4, 6, 9), 1e-4, 4.0


@result_model
class Check(Result):
    """One solver against one closed-form solution.

    Attributes:
        name: What is compared.
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
        """Whether the result is accurate, and the error falls as it should or is at the level of the tolerance."""
        falls = self.order >= self.least_order or max(self.errors) < self.tolerance
        return bool(self.result <= self.tolerance and falls)


def verify_code(cover: Cover, array: TexelArray) -> tuple[Check, ...]:
    """Run all checks on a laterally wide cover.

    Args:
        cover: The cover; its layers have their linear elastic properties at zero load.
        array: The array, whose texels the last check integrates over.

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
    from fem_reference.linear_response.point_spread import point_spread

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

    Compared are the total force and the largest texel force.  On covers with a stiff top layer an indenter may have to
    pull, which the closed form does not solve; its checks are left out then.
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
    """Return the force on one texel in a solution [N]."""
    return float(solution.base_forces(place.array, place.pose)[texel])


def check_bonded_disk() -> Check:
    """Compare the finite-strain elements with the exact stiffness of a bonded incompressible disk at small strain."""
    from fem_reference.closed_form.disk import bonded_disk
    from fem_reference.finite_strain.bonded_disk import Disk

    rubber = Material(name="incompressible", model="neo-hookean", parameters={"shear_modulus": 1e6}, poisson_ratio=0.5)
    exact = bonded_disk(_DISK_RADIUS / 4)
    errors = []
    for count in _DISK_ELEMENTS:
        reached = Disk.mesh(rubber, _DISK_RADIUS, count).compress([_STRAIN])[-1]
        # force over area and strain, in units of the shear modulus, over Young's modulus, which is 3
        stiffness = reached.load / (np.pi * _DISK_RADIUS**2) / _STRAIN / 3
        errors.append(abs(stiffness / exact - 1))
    return Check(
        name="stiffness of a disk bonded to two plates, finite-strain elements at a small strain",
        exact="Papkovich-Fadle series",
        sizes=_relative(1 / np.array(_DISK_ELEMENTS)),
        errors=tuple(errors),
        result=errors[-1],
        least_order=0.7,
        tolerance=1e-2,
    )


def _relative(sizes: FloatArray | Sequence[float]) -> tuple[float, ...]:
    """Divide element sizes by the largest."""
    values = np.asarray(sizes, dtype=float)
    return tuple((values / values[0]).tolist())
