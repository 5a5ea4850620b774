"""Calibration of the fast model under load, and the range in which the fast model agrees with the finite elements.

Finite elements press a ball of one pitch radius over the middle of a texel, and beside it.  At finite strain, a stiff
foil on a soft layer stretches.  The foil's tension is fitted to the base pressure at every depth of that path, and the
fast model gets tables at these loads.  Then the fast model repeats the path, and the larger of its misplaced forces at
the two points gives the range.  Contacts on fewer cells than the fast model resolves are not counted, because it warns
of them, unless all contacts are so small.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fastmodel.surface import CoverCells
from fastmodel.validity import FEWEST_CELLS, Validity
from meshes import Cover, Sphere, TexelArray
from meshes.pose import Pose
from validation.derivation.cover_kernels import compliance_kernel, influence_kernel, tabulate_surface

if TYPE_CHECKING:
    from fastmodel.parameters import Parameters
    from fem_reference.indentation.ball_path import BallPath
    from fem_reference.linear_response.membrane_tension import Stretch, StretchedResponse
    from fem_reference.linear_response.point_spread import PointSpread

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[str], None]

#: Depths of the ball over the thickness of the cover, at finite and at small strain; and largest depth over the radius
#: of the ball [-].
_FINITE_DEPTHS, _SMALL_DEPTHS, _LARGEST_DEPTH = (
    (0.015, 0.03, 0.05, 0.08, 0.12, 0.2, 0.3, 0.4),
    (0.05, 0.1, 0.15, 0.18, 0.2, 0.22, 0.24, 0.27, 0.3),
    0.5,
)
#: Second point of the ball, off the grid of texels and of the fast model's cells: distance from the centre of a texel,
#: over the size of the texel [-].
_BESIDE = (0.3, 0.4)
#: Least part of the force that a fitted stretch must move to the right place at one depth; below it, the tables under
#: load are left out [-].
_USEFUL = 0.02
#: Fit of the stretch: bounds of the logarithms of tension, over thickness times mean shear modulus, and of length, over
#: thickness; their start; and settings of the minimiser [-].
_BOUNDS, _START = [(-7.0, 9.0), (-7.0, 3.0)], (-1.0, -2.0)
_MINIMISER: dict[str, Any] = {
    "method": "Nelder-Mead",
    "bounds": _BOUNDS,
    "options": {"xatol": 0.03, "fatol": 1e-4, "maxfev": 100},
}
#: Limits of the misplaced part of the force [-].
_LIMITS = (0.02, 0.05)


@dataclass(frozen=True, kw_only=True, eq=False)
class BallPresses:
    """A ball of one pitch radius that finite elements press on p points of an array to n depths.

    Attributes:
        radius: Radius of the ball [m].
        points: Positions of the ball's axis, shape (p, 2) [m].
        load: Forces on the ball, equal at all points, shape (n,) [N].
        texel_forces: Force on each texel, then the force outside the texels, shape (p, n, texels + 1) [N].
        path: The loading path at finite strain; None at small strain.
    """

    radius: float
    points: FloatArray
    load: FloatArray
    texel_forces: FloatArray
    path: BallPath | None


def press_ball_on_array(cover: Cover, array: TexelArray, progress: Progress | None) -> BallPresses:
    """Press a ball of one pitch radius by finite elements over the centre of the middle active texel, and beside it.

    Args:
        cover: A laterally wide cover.
        array: A flat array.
        progress: Called with a line of text before each step.

    Raises:
        ConvergenceError: If no depth converges.
    """
    from fem_reference.finite_strain.loading_path import LoadingPath
    from fem_reference.indentation.ball_path import press_ball
    from fem_reference.indentation.small_strain import solve_coarse

    radius = min(array.pitch)
    most = _LARGEST_DEPTH * radius
    shares = _SMALL_DEPTHS if cover.small_strain_only else _FINITE_DEPTHS
    deepest = min(shares[-1] * cover.thickness, most)
    depths = [share / shares[-1] * deepest for share in shares]
    points = _choose_points(array)
    if cover.small_strain_only:
        wanted = LoadingPath(cover=cover, indenter=Sphere(radius=radius), targets=tuple(depths), control="depth")
        found = solve_coarse(wanted, progress)
        poses = [Pose.planar(at=(float(x), float(y))) for x, y in points]
        return BallPresses(
            radius=radius,
            points=points,
            load=np.array([each.total_force for each in found]),
            texel_forces=np.array([[each.base_forces(array, pose) for each in found] for pose in poses]),
            path=None,
        )
    path = press_ball(cover, radius, depths, progress=progress)
    forces = [
        [
            load * np.append(base.texel_influence(array, point)[0], base.outside(array, point))
            for load, base in zip(path.load, path.base, strict=True)
        ]
        for point in points
    ]
    return BallPresses(radius=radius, points=points, load=path.load, texel_forces=np.array(forces), path=path)


def _choose_points(array: TexelArray) -> FloatArray:
    """Return the centre of the active texel nearest to the middle one, and a point off the grid, shape (2, 2) [m]."""
    centres = array.centres[:, :2]
    distance = np.linalg.norm(centres - centres[array.middle], axis=1)
    centre = centres[np.argmin(np.where(array.active, distance, math.inf))]
    return np.array([centre, centre + np.multiply(_BESIDE, array.texel_size)])


def add_stretch(
    cells: CoverCells, cover: Cover, array: TexelArray, spread: PointSpread, presses: BallPresses
) -> CoverCells:
    """Add tables under load to the fast model's cells, if the stretch of the cover's top moves much of the force.

    A depth at which the fitted stretch does not bring the base pressure nearer to that of the finite elements is left
    out.  The minimiser may stop at its largest number of evaluations; what counts is what remains misplaced.

    Args:
        cells: Compliance and influence of the cover without load.
        cover: A laterally wide cover.
        array: A flat array.
        spread: The point spread function of the cover without load.
        presses: The ball of one pitch radius.
    """
    from fem_reference.linear_response.membrane_tension import StretchedResponse

    if presses.path is None or len(cover.layers) == 1:
        return cells
    base = StretchedResponse.prepare(cover, spread.radius)
    stretches, gains = _fit_stretches(cover, base, presses.path)
    kept = [n for n, gain in enumerate(gains) if gain > 0]
    if max(gains) < _USEFUL:
        return cells
    reach, cell = len(cells.compliance) - 1, cells.cell
    surface = tabulate_surface(cover, reach, cell)
    top = StretchedResponse.prepare(cover, surface.regular.x)
    spreads = [
        base.remove_contact(presses.path.base[n], float(presses.path.contact_radius[n]), stretches[n]) for n in kept
    ]
    return dataclasses.replace(
        cells,
        loads=presses.load[kept],
        loaded_compliance=np.array(
            [compliance_kernel(top.stretch_compliance(surface, stretches[n]), reach, cell) for n in kept]
        ),
        loaded_influence=np.array([influence_kernel(array, each, cells.per_texel, cells.reach) for each in spreads]),
    )


def _fit_stretches(cover: Cover, response: StretchedResponse, path: BallPath) -> tuple[list[Stretch], list[float]]:
    """Fit the stretch at each of n depths of a path to the base pressure.

    Returns:
        The n stretches, and the part of the force that each moves to where the finite elements have it [-].
    """
    from scipy.optimize import minimize

    from fem_reference.linear_response.membrane_tension import Stretch

    radius = response.radius
    ring = np.pi * radius * np.gradient(radius)  # half the area of a ring, because misplaced force counts once
    yielding = sum(layer.thickness / layer.material.shear_modulus for layer in cover.layers)

    def read(logarithms: FloatArray) -> Stretch:
        tension, length = np.exp(logarithms) * cover.thickness
        return Stretch(tension=float(tension * cover.thickness / yielding), length=float(length))

    stretches: list[Stretch] = []
    gains: list[float] = []
    start = list(_START)
    for base, contact in zip(path.base, path.contact_radius, strict=True):
        wanted = base.pressure(radius)

        def misplace(
            logarithms: FloatArray | None, wanted: FloatArray = wanted, contact: float = float(contact)
        ) -> float:
            stretch = Stretch(tension=0.0, length=0.0) if logarithms is None else read(logarithms)
            return float(ring @ np.abs(response.spread_over_contact(stretch, contact) - wanted))

        fit = minimize(misplace, start, **_MINIMISER)
        gain = misplace(None) - float(fit.fun)
        if gain > 0:
            start = [float(value) for value in fit.x]
        stretches.append(read(fit.x))
        gains.append(gain)
    return stretches, gains


def measure_misplaced(found: FloatArray, wanted: FloatArray) -> float:
    """Compute the part of the force on wrong texels, from forces on texels and outside whose sum is the force [-]."""
    return float(np.abs(found - wanted).sum() / 2 / wanted.sum())


def state_range(parameters: Parameters, cover: Cover, spread: PointSpread, presses: BallPresses) -> Parameters:
    """Add tables under load, where they are useful, and the range of the fast model to its parameters.

    Args:
        parameters: Parameters of the fast model, with cells.
        cover: A laterally wide cover.
        spread: The point spread function of the cover without load.
        presses: The ball by finite elements.

    Raises:
        FastModelError: If the fast model cannot press the ball.
    """
    if not isinstance(parameters.surface, CoverCells):
        return parameters
    cells = add_stretch(parameters.surface, cover, parameters.array, spread, presses)
    parameters = dataclasses.replace(parameters, surface=cells)
    misplaced, depth, resolved = _repeat_presses(parameters, presses)
    if cells.loads is not None:
        tabulated = np.isin(presses.load, cells.loads)
        cells = dataclasses.replace(cells, load_depths=np.maximum.accumulate(depth.mean(axis=0)[tabulated]))
    if not resolved.any():
        # Under a foil every contact is small, but the foil spreads the force over many cells.
        resolved = np.ones_like(resolved)
    counted = resolved.any(axis=0)
    load, worst, deepest = (
        presses.load[counted],
        np.where(resolved, misplaced, 0.0).max(axis=0)[counted],
        np.where(resolved, depth, 0.0).max(axis=0)[counted],
    )
    limits = [_find_limit(load, worst, limit) for limit in _LIMITS]
    depths = [float(np.interp(limit, np.append(0.0, load), np.append(0.0, deepest))) for limit in limits]
    validity = Validity(
        ball_radius=presses.radius,
        load_2_percent=limits[0],
        load_5_percent=limits[1],
        depth_2_percent=depths[0],
        depth_5_percent=depths[1],
        largest_load=float(load[-1]),
        strain="small" if presses.path is None else "finite",
    )
    return dataclasses.replace(parameters, surface=cells, validity=validity)


def _repeat_presses(
    parameters: Parameters, presses: BallPresses
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Press the ball by the fast model on p points at n loads.

    Returns:
        The misplaced parts of the force, shape (p, n) [-]; the depths, shape (p, n) [m]; and whether the contact covers
        enough cells, shape (p, n).
    """
    from fastmodel import indent

    misplaced, depth = np.zeros((2, *presses.texel_forces.shape[:2]))
    resolved = np.zeros(misplaced.shape, dtype=bool)
    ball = Sphere(radius=presses.radius)
    for p, n in np.ndindex(misplaced.shape):
        x, y = presses.points[p].tolist()
        found = indent(parameters, ball, load=float(presses.load[n]), at=(x, y), method="cover")
        misplaced[p, n] = measure_misplaced(np.append(found.texel_forces, found.outside), presses.texel_forces[p, n])
        depth[p, n] = found.depth or 0.0
        resolved[p, n] = (found.fewest_cells or 0) >= FEWEST_CELLS
    return misplaced, depth, resolved


def _find_limit(load: FloatArray, misplaced: FloatArray, limit: float) -> float:
    """Return the load at which the misplaced part first exceeds a limit, interpolated linearly, or the largest load."""
    over = np.flatnonzero(misplaced > limit)
    if not over.size:
        return float(load[-1])
    first = int(over[0])
    if first == 0:
        return 0.0
    return float(np.interp(limit, misplaced[[first - 1, first]], load[[first - 1, first]]))
