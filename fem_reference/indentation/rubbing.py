"""Solve indentations with friction at small strain, on the cells of the contact without friction.

Under a flat face the contact grows in proportion to the load, so that one step suffices, and results are extrapolated
to cells of size zero.  A curved indenter is followed in steps from first touch.  The ratio of the contacts with and
without friction on the same cells corrects the accurate contact without friction.

On a cover of limited size the additional compliance of its sides contains shear, and so does the response of its base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from fem_reference import result_store
from fem_reference.errors import UnsupportedError
from fem_reference.finite_strain.loading_path import LoadingPath, Progress, report
from fem_reference.indentation import small_strain
from fem_reference.indentation.grid_solution import GridSolution, GridStudy, correct_solution, scale_to_target
from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.linear_response.surface_compliance import decay_length, membrane_length
from fem_reference.linear_response.vector_compliance import VectorCompliance, spread_shear
from fem_reference.small_strain_contact.free_edges import SideEdges, find_mirror_planes
from fem_reference.small_strain_contact.friction_cells import (
    WIDER,
    RubbingContact,
    RubbingState,
    VectorOperator,
    is_cut_off,
)
from fem_reference.small_strain_contact.frictionless import (
    CellGrid,
    ContactPatch,
    Face,
    bound_contact,
    choose_counts,
    measure_area,
)
from meshes.pose import Place, Pose

#: Number of cells across the contact of a curved indenter on all grids [-].  Three neighbouring grids give a result and
#: its error.
GRIDS = (32, 48, 64, 96, 144)
#: Steps from first touch per cell across the contact, with slip and without [-].  Cells that stick keep the error of
#: every step, and cells that slip do not.
_STEPS = (0.5, 1.0)
#: Half width of the cells under a curved indenter, over that of the contact without friction [-].
_MARGIN = 1.12
#: Smallest estimated relative error with slip or under a curved indenter, due to the tolerance of the slip [-].
_LEAST_ERROR = 5e-4

#: Decay length of the stretch of a stiff top over that of the response above which sides are not solved [-]; they are
#: surrounded by 6 to 8 decay lengths of the response.
_STRETCHED = 2.0
#: Membrane length over thickness above which a face separates from a stiff foil [-].  The edge of its contact jumps by
#: whole cells, so that results are not extrapolated; a face then has the cells of a curved indenter.
_FOIL = 4.0

_tabulate = lru_cache(maxsize=4)(VectorCompliance.tabulate)


def study_path(path: LoadingPath, place: Place | None, progress: Progress, refinement: int = 0) -> GridStudy:
    """Solve a loading path with friction at small strain on three grids, or read the solutions from the result store.

    Args:
        path: Cover, indenter, friction, and target loads or depths.
        place: Array, and pose of the indenter.  Required on a cover of limited size, where every pose is solved.
        progress: Called with a line of text before each solve.
        refinement: Number of grids that are skipped at the coarse end and added at the fine end [-].

    Returns:
        For each target the solutions on the three grids, coarsest first, and how they converge.

    Raises:
        ConvergenceError: If contact and slip are not found.
        UnsupportedError: If the shear would move the cover, or reaches farther than the surroundings of its sides.
    """
    cover, indenter, finest = path.cover, path.indenter, refinement + 3
    _check_shear(path, place)
    response, least = small_strain.respond(cover, place, progress), small_strain.least_error(cover)
    if isinstance(response, PointSpread):
        shear = spread_shear(cover)
        response = replace(response, shear=shear, coarse=tuple(replace(each, shear=shear) for each in response.coarse))
    build = partial(small_strain.build_solution, indenter=indenter, response=response)
    if indenter.is_flat:
        part = replace(path, targets=(cover.thickness,), control="depth")
        foil = membrane_length(cover) > _FOIL * cover.thickness
        grids = (GRIDS if foil else small_strain.CELLS)[refinement:finest]
        faces = [build(_press(part, place, progress, (cells, 1))[-1]) for cells in grids]
        solutions = [[scale_to_target(each, target, path.control) for each in faces] for target in path.targets]
        least = least if np.isinf(path.friction) else max(least, _LEAST_ERROR)
        return GridStudy(solutions=solutions, most_order=1.0, extrapolate=not foil, least_error=least)

    accurate = small_strain.study_path(path, place, progress)

    def correct(target: float, smooth: GridSolution) -> list[GridSolution]:
        """Multiply the accurate solution without friction at a target by the effect of friction on each grid."""
        part, out = replace(path, targets=(target,)), []
        for cells in GRIDS[refinement:finest]:
            steps = int(cells * _STEPS[int(np.isinf(path.friction))])
            baseline, full = map(build, _press(part, place, progress, (cells, steps), smooth))
            share = target / baseline.total_force if path.control == "load" else 1.0
            out.append(correct_solution(smooth, baseline=baseline, full=full, control=path.control, share=share))
        return out

    return GridStudy(
        solutions=[
            correct(*each) for each in zip(path.targets, (each[-1] for each in accurate.solutions), strict=True)
        ],
        least_error=max(least, _LEAST_ERROR),
        least_area_error=least_area_error(path, refinement),
        accurate=accurate,
    )


def _check_shear(path: LoadingPath, place: Place | None) -> None:
    """Refuse friction on covers whose shear is not resolved; see `study_path`."""
    cover, indenter = path.cover, path.indenter
    pose = Pose() if cover.size is None else small_strain.require_place(place).pose
    if cover.base == "sliding" and not all(find_mirror_planes(indenter, pose)):
        raise UnsupportedError(
            "a cover that slides on its base moves away under friction, unless the press mirrors in both middle "
            "planes; bond its base, or press without friction",
            "friction",
        )
    wide = replace(cover, size=None)
    if cover.size is not None and membrane_length(wide) > _STRETCHED * decay_length(wide):
        raise UnsupportedError(
            "the top layer is so stiff that friction stretches it up to the sides of the cover; leave out the size of "
            "the cover, or press without friction",
            "friction",
        )


def least_area_error(path: LoadingPath, refinement: int) -> float:
    """Return the smallest estimated relative error of a contact area, whose edge is known to a third of a cell [-]."""
    return 0.0 if path.indenter.is_flat else 1 / GRIDS[refinement + 2]


def _press(
    path: LoadingPath,
    place: Place | None,
    progress: Progress,
    grid: tuple[int, int],
    smooth: GridSolution | None = None,
) -> Sequence[ContactPatch]:
    """Solve a path with one target on one grid, or read it from the result store.

    Args:
        path: Cover, indenter, friction and target.
        place: Array, and pose of the indenter.
        progress: Called with a line of text before each solve.
        grid: Number of cells across the contact, and of steps.
        smooth: Accurate solution without friction; None under a flat face.

    Returns:
        Contacts without and with friction; with friction alone under a flat face.
    """
    cover = path.cover

    def compute() -> list[ContactPatch]:
        report(progress, f"contact with friction on {grid[0]} x {grid[0]} cells or more, in {grid[1]} steps")
        return _solve(path, place, grid, smooth)

    inputs = {"cover": cover, "indenter": path.indenter, path.control: path.targets[0], "friction": path.friction}
    if cover.size is not None:
        inputs["pose"] = small_strain.require_place(place).pose
    return result_store.fetch("contact-with-friction", inputs | {"grid": grid}, compute)


def _solve(
    path: LoadingPath, place: Place | None, grid: tuple[int, int], smooth: GridSolution | None, wider: float = 1.0
) -> list[ContactPatch]:
    """Solve a path with one target on one grid, see `_press`; on wider cells if the contact reaches their edge."""
    cover, indenter = path.cover, path.indenter
    most = np.array(bound_contact(indenter, cover.thickness))
    layer = _tabulate(replace(cover, size=None), max(3.0 * float(np.hypot(*most)), 4 * decay_length(cover)))
    low, high = -most, most
    if smooth is not None:
        ends = [pick(smooth.contact[:, :2], axis=0) for pick in (np.min, np.max)]
        middle, half = (ends[0] + ends[1]) / 2, wider * (_MARGIN * (ends[1] - ends[0]) / 2 + smooth.size)
        low, high = np.maximum(middle - half, low), np.minimum(middle + half, high)
    window, measure_gap, sides = ((low + high) / 2, (high - low) / 2), indenter.gap, None
    if cover.size is not None:
        half = np.maximum(np.abs(low), np.abs(high))
        pose = small_strain.require_place(place).pose
        sides = SideEdges(cover=cover, indenter=indenter, pose=pose, half=half, components=3)
        measure_gap, window = sides.gap, sides.window if indenter.is_flat else window
    face = Face.measure(measure_gap, *window) if indenter.is_flat else None
    if face is not None:
        window = face.middle, face.half
    cells = CellGrid.span(*window, choose_counts(window[1], face, np.inf, grid[0]))
    if face is not None:
        cells = cells.match_area(measure_gap, face)
    gap, x, y = measure_gap(*cells.unscaled), cells.x, cells.y
    added = None if sides is None else sides.add_compliance(x.ravel(), y.ravel())
    contact = RubbingContact(
        gap=lambda travel: gap - travel,
        motion=np.stack([np.ones_like(x), np.zeros_like(x), np.zeros_like(x)]),
        compliance=VectorOperator(layer, x.shape, cells.cell, added),
        area=cells.area,
        friction=path.friction,
    )

    def describe(state: RubbingState) -> ContactPatch:
        """Describe a state as forces on the cells in contact."""
        kept = state.traction[0] > 0
        force, place = state.traction[:, kept] * cells.area, (x[kept], y[kept])
        if sides is not None:
            place = sides.clip_to_cover(*place)
        return ContactPatch(
            x=place[0], y=place[1], force=force[0], shear=force[1:], cell=cells.cell, depth=state.travel,
            area=measure_area(state.traction[0], np.isfinite(gap), cells.cell),
            shear_work=float((force[1:] * state.moved[1:, kept]).sum()),
        )  # fmt: skip

    if smooth is None:
        free = small_strain.press_cells(path, place, None, grid[0])
        edges = [
            np.append(axis - edge / 2, axis[-1] + edge / 2)
            for axis, edge in zip((x[:, 0], y[0]), cells.cell, strict=True)
        ]
        first = np.histogram2d(free.x, free.y, edges)[0] > 0
        return [describe(contact.follow(0.0, path.targets[0], 1, first=first))]
    slides = replace(contact, friction=0.0).follow(0.0, smooth.depth, 1)
    load = contact.measure_load(slides) if path.control == "load" else None
    full = contact.follow(0.0, smooth.depth, grid[1], load)
    if is_cut_off(full.touching, low > -most, high < most):
        return _solve(path, place, grid, smooth, wider * WIDER)
    return [describe(slides), describe(full)]
