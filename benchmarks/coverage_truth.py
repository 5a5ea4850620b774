"""Independent truths for random presses at small strain, for `estimate_coverage.py`.

Truths are independent of the code under test (`fem_reference.closed_form`): exact contacts of bodies of revolution
without friction and without slip, ring elements with Coulomb friction, boundary elements for flat faces, also tilted
and partly lifted, and rollers, and uniaxial stress in pads.  Faces near the sides of a pad are compared with solid
elements of the whole pad, whose nodes under the face are prescribed.  Each has an error of its own, the change by the
last refinement.  At finite strain the truth is a finer grid of the same code, which the study lists apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from fem_reference import press
from fem_reference.closed_form import LayerContact, indent
from fem_reference.grid_convergence import pool_errors
from meshes import Box, Cover, Cylinder, FlatPunch, Indenter, Nut, Roller, TexelArray, TriangleMesh, tilt_indenter
from meshes.array_types import FloatArray
from meshes.pose import Pose
from tests.exact.active_set import solve_active_set
from tests.exact.boundary import PressedCells, measure_areas, pressed_shape, tabulate_excess
from tests.exact.no_slip import stuck_punch, stuck_shape
from tests.exact.outline import assemble_compliance, press_face, split_face
from tests.exact.rings import RingContact, press_with_friction
from tests.exact.stuck_face import FACE_GRIDS
from tests.exact.stuck_face import press_face as press_solid

#: Cells of the boundary elements on the successive grids: rectangles and nuts, other faces, and rollers [-].
BOX_CELLS, FACE_CELLS, ROLLER_CELLS = (8, 12, 18, 27), (6, 9, 14, 21), (15, 22, 33)
#: Second extrapolation: the error of the first falls by 3.6 with each finer grid, so that 1 / 2.6 of the last change is
#: left.  With a fifth grid it falls by 3.6 to 3.9 on rectangles, 3.9 on an L, 4.2 on an H and 4.9 on a nut.  A sixth of
#: the change is taken as the error; that is 1.9 (nut), 3.3 (H) and more than 4 times (L, rectangle) the true one.
SECOND, SHARE = 2.6, 6.0
#: Range of the order of convergence of a force under a sharp edge [-].
ORDERS = (1.3, 3.0)
#: Largest radius of a growing contact without slip over the thickness of the thinnest layer [-].
WIDEST = 8.0
#: Increments of a contact without slip on the two grids, and coarser step of the integrals under a flat punch [-].
INCREMENTS, COARSE_STEP = (16, 32), 0.2
#: Rings of a contact with friction, of a curved indenter and of a flat punch, and relative error of the area that two
#: curved contacts share: the last ring is only partly in contact [-].
RINGS, PUNCH_RINGS, RING_EDGE = (64, 96), (16, 24), 1e-3
#: Error of texel forces by quadrature of a known pressure on the base, as a share of its values [-].
ROUNDING = 3e-6
#: Shift of points into a tilted face, over its size, so that they lie on it after the tilt [-].
INSIDE = 1e-4
#: Tensile force under a face over its force, above which the face would lift [-].
LIFTS = 1e-4
#: Error of a solution on solid elements over the change from the grid before, whose elements at edges are twice as wide
#: and whose layers of elements are 1.3 to 1.5 times as thick [-].
FIRST_ORDER = 2.0
#: Wanted accuracy with which the finest grids are solved, just above the smallest one that `press` accepts [-].
FINEST = 1.01e-4
#: Source of a truth that is a finer grid of the code under test.
SAME_CODE = "finer grid of the same code"
#: Quantities that have an error estimate.
QUANTITIES = ("total_force", "depth", "peak_texel", "contact_area")


@dataclass(frozen=True, eq=False)
class Truth:
    """Independent result of a press at a depth.

    Attributes:
        values: Total force [N], depth [m] and contact area [m2] by name.
        texel_forces: Force on each of n texels, shape (n,) [N].
        error: Relative error of each of `QUANTITIES`, by its own refinement [-].
        source: How it was computed.
        texel_errors: Errors of the texel forces, shape (n,) [N].
    """

    values: dict[str, float]
    texel_forces: FloatArray
    error: dict[str, float]
    source: str
    texel_errors: FloatArray


def solve_truth(  # noqa: PLR0911 -- one for each kind of truth
    cover: Cover,
    array: TexelArray,
    indenter: Indenter,
    depth: float,
    *,
    pose: Pose,
    friction: float,
    tilt: tuple[float, float] = (0.0, 0.0),
) -> Truth:
    """Compute the truth of a press at a depth.

    Raises:
        ValueError: If there is no independent truth for this contact.
        RuntimeError: If a boundary-element contact does not converge.
    """
    if not cover.small_strain_only:
        return refine_press(cover, array, indenter, depth, pose)
    if cover.size is not None and isinstance(indenter, Box) and indenter.footprint[0] > cover.size[0] / 2:
        return squeeze_pad(cover, array, indenter, depth, pose=pose, friction=friction)
    if any(tilt):
        counts = BOX_CELLS if isinstance(indenter, Box | Nut) else FACE_CELLS
        tilted = [press_tilted(cover, indenter, tilt, depth, n) for n in counts]
        full = all(each.pressure.min() > 0 for each in tilted)
        # The edge of a face that lifts crosses cells, so that nothing is extrapolated.
        truth = _refine_cells(tilted, array, pose, counts if full else None)
        projection = tilt[0] ** 2 + tilt[1] ** 2  # the face is taken as wide as without tilt
        return replace(truth, error={name: value + projection for name, value in truth.error.items()})
    if cover.size is not None and isinstance(indenter, FlatPunch) and not indenter.axisymmetric:
        return press_pad(cover, array, indenter, depth, pose=pose, friction=friction)
    wide = replace(cover, size=None)
    if indenter.axisymmetric and friction and np.isfinite(friction):
        counts = PUNCH_RINGS if indenter.is_flat else RINGS
        rings = [press_with_friction(wide, indenter, depth, friction, rings=count) for count in counts]
        return _refine_rings(rings, array, pose, flat=indenter.is_flat)
    if indenter.axisymmetric:
        solve = _solve_free if not friction else _solve_stuck
        return _refine_round(solve(wide, indenter, depth), array, pose, "closed form" if not friction else "no slip")
    if friction:
        raise ValueError("no independent truth with friction under this shape")
    if isinstance(indenter, FlatPunch):
        cells = BOX_CELLS if isinstance(indenter, Box | Nut) else FACE_CELLS
        faces = [press_face(wide, indenter, depth, cells=n) for n in cells]
        return _refine_cells(faces, array, pose, cells)
    if isinstance(indenter, Roller | TriangleMesh):
        rolled = [pressed_shape(wide, indenter, depth, cells=n) for n in ROLLER_CELLS]
        return _refine_cells(rolled, array, pose, None)
    raise ValueError(f"no independent truth for {type(indenter).__name__}")


def squeeze_pad(cover: Cover, array: TexelArray, plate: Box, depth: float, *, pose: Pose, friction: float) -> Truth:
    """Squeeze a pad of one layer under a wider plate that slides on both faces, or at Poisson ratio 0: exact.

    The stress is uniaxial, F = E A depth / h, and each texel carries its part of the area.

    Raises:
        ValueError: If the state is not uniaxial, or the plate is not wider than the pad.
    """
    assert cover.size is not None
    (layer,), size = cover.layers, np.array(cover.size)
    free = cover.base == "sliding" and not friction
    if (
        not (free or layer.material.poisson_ratio == 0)
        or pose.yaw
        or not all(half - abs(at) >= side / 2 for half, at, side in zip(plate.footprint, pose.at, size, strict=True))
    ):
        raise ValueError("the stress under the plate is not uniaxial")
    stress = layer.material.youngs_modulus * depth / cover.thickness
    half, centre = np.array(array.texel_size) / 2, array.centres[:, :2]
    sides = np.minimum(centre + half, size / 2) - np.maximum(centre - half, -size / 2)
    area = float(np.prod(size))
    texels = stress * np.maximum(sides, 0).prod(axis=1)
    return _make_truth("uniaxial stress", [stress * area, depth, area], texels, [ROUNDING] * 4)


def press_pad(cover: Cover, array: TexelArray, face: FlatPunch, depth: float, *, pose: Pose, friction: float) -> Truth:
    """Press a face into a pad of limited size, without friction or without slip, by solid elements of the whole pad.

    Raises:
        ValueError: If a part of the face would lift.
    """
    grids = FACE_GRIDS if isinstance(face, Box) else FACE_GRIDS[:2]
    pairs = [press_solid(cover, face, pose, grid)[int(friction > 0)] for grid in grids]
    if max(tension for _, tension in pairs) > LIFTS:
        raise ValueError("a part of the face would lift")
    forces = [depth * np.array([each.total_force, *each.base.forces(array, pose)[:-1]]) for each, _ in pairs]
    peak = int(np.argmax(np.abs(forces[-1][1:]))) + 1
    change = FIRST_ORDER * np.abs(forces[-1][[0, 0, peak]] / forces[-2][[0, 0, peak]] - 1)
    area = float(_measure_face(face))
    moved = FIRST_ORDER * np.abs(forces[-1] - forces[-2])[1:]
    return _make_truth("solid elements", [forces[-1][0], depth, area], forces[-1][1:], [*change, ROUNDING], moved)


def _measure_face(face: FlatPunch) -> float:
    return float(measure_areas(split_face(face, FACE_CELLS[-1], max(face.footprint))).sum())


def press_tilted(cover: Cover, box: Indenter, tilt: tuple[float, float], depth: float, cells: int) -> PressedCells:
    """Press a slightly tilted flat face, a part of which may lift, by boundary elements."""
    corners = split_face(box, cells, 7.2 * cover.thickness / cells)
    tilted = tilt_indenter(box, tilt)
    wanted = depth - tilted.gap(*((1 - INSIDE) * corners.mean(axis=1)).T)
    pressure = solve_active_set(assemble_compliance(tabulate_excess(cover), corners), wanted)
    area = float(measure_areas(corners)[pressure > 0].sum())
    return PressedCells(cover=cover, depth=depth, corners=corners, pressure=pressure, contact_area=area)


def refine_press(cover: Cover, array: TexelArray, indenter: Indenter, depth: float, pose: Pose) -> Truth:
    """Compute the truth at finite strain: the finest grids of the same code, for want of another one.

    Its error is the estimate of these grids, or half of the change from the coarse ones where that is smaller.
    """
    found, before = (
        press(cover, array, indenter, depth=depth, pose=pose, accuracy=accuracy) for accuracy in (FINEST, 0.999)
    )
    peak = int(np.argmax(np.abs(found.texel_forces)))
    force = before.total_force / found.total_force - 1
    texel = float(before.texel_forces[peak] / found.texel_forces[peak]) - 1
    change = zip(QUANTITIES, (force, force, texel, before.contact_area / found.contact_area - 1), strict=True)
    errors = [min(found.error_estimate[name] or math.inf, abs(value) / 2) for name, value in change]
    values, own = [found.total_force, depth, found.contact_area], found.texel_errors
    moved = 0.0 if own is None else np.minimum(own, np.abs(found.texel_forces - before.texel_forces) / 2)
    return _make_truth(SAME_CODE, values, found.texel_forces, errors, moved)


def _make_truth(
    source: str,
    values: Sequence[float],
    texel_forces: FloatArray,
    errors: Sequence[float],
    changes: FloatArray | float = 0.0,
) -> Truth:
    """Make a truth of its force, depth and area, and of the relative errors of `QUANTITIES`.

    Each texel has at least the relative error of the peak, and its own change between the last two grids [N].
    """
    named = dict(zip(("total_force", "depth", "contact_area"), map(float, values), strict=True))
    relative = dict(zip(QUANTITIES, map(float, errors), strict=True))
    own = np.maximum(
        pool_errors(np.broadcast_to(changes, texel_forces.shape), texel_forces),
        relative["peak_texel"] * np.abs(texel_forces),
    )
    return Truth(named, texel_forces, relative, source, own)


def _solve_free(cover: Cover, indenter: Indenter, depth: float) -> tuple[LayerContact, LayerContact]:
    """Solve a contact of revolution without friction with two numbers of Gauss points."""
    found = indent(cover, indenter, depth=depth)
    return indent(cover, indenter, depth=depth, nodes=round(0.7 * found.phi.shape[1])), found


def _solve_stuck(cover: Cover, indenter: Indenter, depth: float) -> tuple[LayerContact, LayerContact]:
    """Solve a contact of revolution without slip with two numbers of increments."""
    if isinstance(indenter, Cylinder):
        coarse = stuck_punch(cover, indenter.radius, step=COARSE_STEP)
        return coarse.press(depth), stuck_punch(cover, indenter.radius).press(depth)
    first = indent(cover, indenter, depth=depth).contact_radius
    if first > WIDEST * min(layer.thickness for layer in cover.layers):
        raise ValueError("the integral equations without slip take hours for contacts that wide")

    def gap(r: FloatArray) -> FloatArray:
        return indenter.gap(r, np.zeros_like(r))

    def solve(radius: float, steps: int) -> LayerContact:
        return stuck_shape(cover, gap, radius, steps=steps)

    radius = find_root(lambda a: solve(a, 8).depth / depth, first)
    radius = find_root(lambda a: solve(a, INCREMENTS[-1]).depth / depth, radius)
    coarse, fine = (solve(radius, steps) for steps in INCREMENTS)
    return coarse, fine


def find_root(ratio: Callable[[float], float], start: float) -> float:
    """Find where a ratio is 1 by secants of its logarithm over that of its argument.

    Args:
        ratio: Ascending function [-].
        start: First argument.

    Raises:
        RuntimeError: If twelve steps are not enough.
    """
    x = np.log([start, 1.02 * start])
    y = [float(np.log(ratio(float(np.exp(each))))) for each in x]
    for _ in range(12):
        if abs(y[1]) < 1e-6:
            return float(np.exp(x[1]))
        x = np.array([x[1], x[1] - y[1] * (x[1] - x[0]) / (y[1] - y[0])])
        y = [y[1], float(np.log(ratio(float(np.exp(x[1])))))]
    raise RuntimeError("the contact radius was not found")


def _refine_round(pair: tuple[LayerContact, LayerContact], array: TexelArray, pose: Pose, source: str) -> Truth:
    """Compute the truth from two solutions of a contact of revolution."""
    coarse, fine = pair
    forces = [each.texel_forces(array, pose.at) for each in pair]
    peak = int(np.argmax(np.abs(forces[1])))
    force, depth = abs(coarse.force / fine.force - 1), abs(coarse.depth / fine.depth - 1)
    area = 2 * abs(coarse.contact_radius / fine.contact_radius - 1)
    if source == "no slip":
        # Both have one contact radius: an error of the depth is one of the area too.
        force, area = force + 2 * depth, 2 * depth
    # A closed form states its own error.
    errors = max(ROUNDING, fine.error) + np.array([force, depth, abs(forces[0][peak] / forces[1][peak] - 1), area])
    values = [fine.force, fine.depth, np.pi * fine.contact_radius**2]
    return _make_truth(source, values, forces[1], errors, np.abs(forces[1] - forces[0]))


def _refine_rings(rings: list[RingContact], array: TexelArray, pose: Pose, *, flat: bool) -> Truth:
    """Compute the truth from ring elements of two widths; a flat punch converges with order 2."""
    table = np.array(
        [[each.force, np.pi * each.contact_radius**2, *each.texel_forces(array, pose.at)] for each in rings]
    )
    change = np.abs(table[1] - table[0])
    last = table[1] + (table[1] - table[0]) / ((PUNCH_RINGS[1] / PUNCH_RINGS[0]) ** 2 - 1) if flat else table[1]
    peak = 2 + int(np.argmax(np.abs(last[2:])))
    error = change / np.abs(last) / (4 if flat else 1) + ROUNDING
    errors = error[[0, 0, peak, 1]] + [0, 0, 0, 0.0 if flat else RING_EDGE]
    moved = change[2:] / (4 if flat else 1)
    return _make_truth("ring elements", [last[0], rings[1].depth, last[1]], last[2:], errors, moved)


def extrapolate(table: FloatArray, cells: Sequence[int]) -> FloatArray:
    """Extrapolate columns of values on three grids with the order of convergence of the first column, shape (n,)."""
    sizes = 1 / np.array(cells, dtype=float)

    def miss(order: float) -> float:
        h = sizes**order
        return float((table[1, 0] - table[0, 0]) * (h[1] - h[2]) - (table[2, 0] - table[1, 0]) * (h[0] - h[1]))

    order = brentq(miss, *ORDERS) if miss(ORDERS[0]) * miss(ORDERS[1]) < 0 else 2.0
    return np.asarray(table[2] + (table[2] - table[1]) / ((sizes[1] / sizes[2]) ** order - 1))


def _refine_cells(solved: list[PressedCells], array: TexelArray, pose: Pose, cells: tuple[int, ...] | None) -> Truth:
    """Compute the truth from boundary elements on successive grids; extrapolate if `cells` is given.

    Each three grids give the order of convergence of the force, and one extrapolation of all values.
    """
    forces = [each.texel_forces(array, pose) for each in solved]
    table = np.array(
        [[each.total_force, each.contact_area, *texels] for each, texels in zip(solved, forces, strict=True)]
    )
    if cells is None:
        last = table[-1]
        change = np.maximum(np.abs(table[-1] - table[-2]), np.abs(table[-2] - table[-3]) / 4)
    else:
        refined = [extrapolate(table[i : i + 3], cells[i : i + 3]) for i in range(len(cells) - 2)]
        change = np.abs(refined[-1] - refined[-2])
        last = refined[-1] + (refined[-1] - refined[-2]) / SECOND
        change /= SHARE
        last[1] = table[-1, 1]
        change[1] = abs(table[-1, 1] - table[-2, 1])
    peak = 2 + int(np.argmax(np.abs(last[2:])))
    relative = change / np.maximum(np.abs(last), np.finfo(float).tiny) + ROUNDING
    values = [last[0], solved[-1].depth, last[1]]
    return _make_truth("boundary elements", values, last[2:], relative[[0, 0, peak, 1]], change[2:])
