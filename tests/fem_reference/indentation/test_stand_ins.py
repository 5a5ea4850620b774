"""Loads on the base, balls on one grid, curved bodies on the coarsest cells, and paths that stop, with stand-ins."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import erf

from fem_reference.errors import ConvergenceError, IncompletePathError, PathConvergenceError
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import ball_path, small_strain
from fem_reference.indentation.ball_path import press_ball
from fem_reference.indentation.finite_strain import choose_fillet
from fem_reference.indentation.grid_solution import BaseSum, GridSolution, GridStudy, RadialBase
from fem_reference.indentation.layered import LayerPress, state_assumptions
from fem_reference.linear_response.point_spread import PointSpread
from fem_reference.linear_response.surface_compliance import choose_reach
from meshes import Cone, Sphere, TexelArray
from meshes.pose import Place, Pose
from tests.support.indentations import FixedBase
from tests.support.rubber import make_cover

WIDTH, COVER = 1.3e-3, make_cover(0.45)
ARRAY = TexelArray.grid(2, 3, (2.4e-3, 1.8e-3), texel_size=(2.2e-3, 1.5e-3), active=np.arange(6) != 1)
PLACE = Place(array=ARRAY, pose=Pose.planar(at=(0.7e-3, -0.4e-3), yaw=0.3))


def bell():
    """The pressure exp(-(r / width)^2) / (pi width^2) per force, whose integrals are products of error functions."""
    radius = np.linspace(0, 9 * WIDTH, 500)
    pressure = np.exp(-((radius / WIDTH) ** 2)) / (np.pi * WIDTH**2)
    return PointSpread(radius=radius, pressure_per_force=pressure, reaction=1.0, thickness=2e-3)


def test_a_load_around_the_axis_is_felt_at_the_place_of_the_axis():
    base = RadialBase(spread=bell(), force=2.5)
    shares = np.where(ARRAY.active, 2.5, 0.0)
    for axis, at in enumerate(PLACE.pose.at):
        ends = [(ARRAY.centres[:, axis] + sign * ARRAY.texel_size[axis] / 2 - at) / WIDTH for sign in (1, -1)]
        shares *= (erf(ends[0]) - erf(ends[1])) / 2
    found = base.forces(ARRAY, PLACE.pose)
    np.testing.assert_allclose(found, [*shares, 2.5 - shares.sum()], atol=1e-5)
    # A load whose response is not computed from one per point has no error of its own.
    assert base.estimate_error(PLACE, 2, 0.4) == 0.0
    assert (base.texel_errors(PLACE, found) == np.zeros(7)).all()


class Unsure(FixedBase):
    """A base whose response has errors of a hundredth and a tenth of the shares."""

    def texel_errors(self, _place, shares):
        return 0.1 * shares


def test_a_sum_of_loads_has_the_error_of_the_load_that_it_is_like():
    one = Unsure(values=np.array([1.0, 2.0]), error=lambda _place, texel, share: 0.01 * share + texel)
    other = FixedBase(values=np.array([0.5, -4.0]))
    parts = ((2.0, one), (-0.5, other))
    plain, unsure = BaseSum(parts=parts), BaseSum(parts=parts, like=one)
    for each in (plain, unsure):
        assert each.forces(ARRAY, PLACE.pose) == pytest.approx([1.75, 6.0])
    assert (plain.estimate_error(PLACE, 3, 0.4), unsure.estimate_error(PLACE, 3, 0.4)) == (0.0, pytest.approx(3.004))
    shares = np.array([0.2, 0.8])
    assert plain.texel_errors(PLACE, shares).tolist() == [0.0, 0.0]
    assert unsure.texel_errors(PLACE, shares) == pytest.approx([0.02, 0.08])


def solution(depth, *, force=None, area=1e-6, size=1.0):
    return GridSolution(
        size=size, total_force=1e4 * depth if force is None else force, depth=depth, area=area,
        contact=np.zeros((1, 3)), base=RadialBase(spread=bell(), force=1.0), energy=0.0,
    )  # fmt: skip


def test_a_quantity_that_is_zero_has_no_error():
    grids = [solution(1e-4, force=force, size=size) for force, size in ((0.2, 4.0), (0.1, 2.0), (0.0, 1.0))]
    assert GridStudy(solutions=[], least_error=0.1).estimate_error(grids, lambda each: each.total_force) == 0.0
    grids[2] = solution(1e-4, force=-0.05)
    assert GridStudy(solutions=[]).estimate_error(grids, lambda each: each.total_force) > 0


@pytest.mark.parametrize(
    "attempts",
    [
        (1.0, [3], 3),
        (0.45e-3, [3, 2], 2),
        (0.3e-3, [3, 2], 2),
        (0.29e-3, [3, 1], 1),
        (0.09e-3, [3], 0),
    ],
)
@pytest.mark.parametrize("ball", [(4e-3, np.sqrt(4e-3 * 0.5e-3)), (0.6e-3, 0.8 * 0.6e-3)])
def test_a_ball_is_pressed_as_deep_as_its_first_attempt_came(monkeypatch, tmp_path, ball, attempts):
    """Depths of 0.1, 0.3 and 0.5 mm on four elements; the mesh is that for the last depth."""
    (radius, width), (reached, tried, found), calls = ball, attempts, []

    def press(path, **options):
        calls.append((path, options))
        if path.targets[-1] > reached:
            raise PathConvergenceError("stopped", cause="stopped", depth=reached)
        return [solution(each, area=np.pi * (10 * each) ** 2) for each in path.targets], None

    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    monkeypatch.setattr(ball_path, "press_axisymmetric", press)
    depths = [0.1e-3, 0.3e-3, 0.5e-3]
    if not found:
        with pytest.raises(PathConvergenceError, match="stopped"):
            press_ball(COVER, radius, depths)
    else:
        path = press_ball(COVER, radius, depths)
        assert path.radius == radius
        assert path.depth.tolist() == depths[:found]
        assert path.load == pytest.approx(1e4 * np.array(depths[:found]))
        assert path.contact_radius == pytest.approx(10 * np.array(depths[:found]))
        assert len(path.base) == found
    assert [len(path.targets) for path, _ in calls] == tried
    path, options = calls[0]
    assert (path.indenter, path.cover, path.control) == (Sphere(radius=radius), COVER, "depth")
    assert options["elements_per_thickness"] == 4
    assert options["contact_radius"] == pytest.approx(width)
    assert options["reach"] == pytest.approx(choose_reach(COVER, width))
    assert options["fillet"] == choose_fillet(2e-3, Sphere(radius=radius))


def test_a_coarse_solution_is_that_of_the_coarsest_grid(monkeypatch):
    monkeypatch.setattr(small_strain, "CELLS", (16, 32, 48))
    monkeypatch.setattr(small_strain, "point_spread", lambda *_, **__: "response")
    cover = make_cover(0.3, "linear-elastic")
    path = LoadingPath(cover=cover, indenter=Sphere(radius=4e-3), targets=(0.05e-3, 0.11e-3), control="depth")
    found = small_strain.solve_coarse(path, None)
    assert [each.depth for each in found] == [0.05e-3, 0.11e-3]
    for each, depth in zip(found, path.targets, strict=True):
        patch = small_strain.press_cells(replace(path, targets=(depth,)), None, None, 16)
        assert each.total_force == pytest.approx(patch.force.sum())
        assert each.size == pytest.approx(np.sqrt(patch.cell[0] * patch.cell[1]))
        assert each.base.response == "response"


class Stops(LayerPress):
    """A press whose path stops as told, for each number of refinements."""

    def solve(self, path, refinement):
        TRIED.append((path.targets, refinement))
        raise ERRORS[min(len(TRIED), len(ERRORS)) - 1]

    def count_refinements(self, _path):
        return 2


TRIED: list[tuple[tuple[float, ...], int]] = []
ERRORS: list[Exception] = []


def stop(*errors, control="depth", targets=(0.5e-3, 1e-3), indenter=None, refinement=0):
    TRIED.clear()
    ERRORS[:] = errors
    path = LoadingPath(cover=COVER, indenter=indenter or Sphere(radius=5e-3), targets=targets, control=control)
    with pytest.raises(IncompletePathError) as told:
        Stops(place=PLACE).solve_as_far(path, refinement)
    return str(told.value)


def test_a_finer_grid_that_stops_too_leaves_the_message_of_the_first_ones():
    first = PathConvergenceError("first", cause="first cause", load=1.0, depth=0.95e-3)
    text = stop(first, ConvergenceError("second"), refinement=1)
    assert "first cause" in text
    assert "one grid reached about 0.95 mm of the 1 mm asked for" in text
    assert [refinement for _, refinement in TRIED] == [1, 2, 1, 1, 1, 1]
    # 97 % of what was reached; then, without a depth that is known, a fifth of the first target.
    kept = [(0.5e-3, 0.97 * 0.95e-3), (0.1e-3,)]
    assert [targets for targets, _ in TRIED[2:4]] == [pytest.approx(each) for each in kept]


@pytest.mark.parametrize(
    ("control", "reached", "finer"),
    [
        ("depth", 0.89, False),
        ("depth", 0.91, True),
        ("load", 0.69, False),
        ("load", 0.71, True),
    ],
)
def test_finer_grids_are_tried_from_nine_tenths_of_a_depth_or_seven_of_a_load(control, reached, finer):
    error = PathConvergenceError("stopped", cause="stopped", **{control: reached * 2e-3})
    stop(error, control=control, targets=(2e-3,))
    assert [refinement for _, refinement in TRIED][:2] == [0, 1 if finer else 0]


@pytest.mark.parametrize("indenter", [Cone(radius=1e-3, angle=2.0), Sphere(radius=5e-3)])
def test_a_path_that_reached_nothing_is_tried_to_a_fifth_of_its_first_target(indenter):
    text = stop(PathConvergenceError("stopped", cause="no step"), indenter=indenter, control="load", targets=(0.4, 2.0))
    assert text.startswith("reached no load of the 2 N asked for: no step")
    assert TRIED[1][0] == pytest.approx((0.08,))


@pytest.mark.parametrize(("facets", "told"), [(12.3e-6, True), (0.0, False)])
def test_facets_are_stated_with_their_part_of_the_depth(facets, told):
    indenter = SimpleNamespace(measure_facets=lambda depth: facets if depth == 0.3e-3 else np.nan)
    found = state_assumptions(COVER, indenter, 0.3e-3)
    assert ("facets" in found) is told
    if told:
        assert found["facets"].startswith("pressed as they are, up to 0.012 mm (4.1% of the depth) from the smooth")
