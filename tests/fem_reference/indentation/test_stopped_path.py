"""Paths that stop early return what they reached."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from fem_reference import IncompletePathError, press_path
from fem_reference.errors import ConvergenceError, PathConvergenceError, TooShallowError
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation.layered import LayerPress
from meshes import Cone, Cylinder, Sphere
from tests.support.rubber import make_cover


def solve_as_far(path, solve, *, finer=0, as_far=True):
    """Follow a path with a made-up solver, which gets the path and the number of refinements of the grids."""

    class MadeUp(LayerPress):
        def solve(self, part, refinement):
            return solve(part, refinement)

        def count_refinements(self, _path):
            return finer

    return MadeUp(place=None, as_far=as_far).solve_as_far(path)


@pytest.mark.bench  # quick tests have a made-up solver
@pytest.mark.slow
def test_a_path_that_stops_returns_its_results(wts):
    with pytest.raises(IncompletePathError, match="of the thickness") as stopped:
        press_path(make_cover(0.5), wts, Cone(angle=2.0, radius=2e-3), loads=[0.1, 100.0])
    first, last = stopped.value.reached
    assert first.total_force == 0.1
    assert 0.1 < last.total_force < 100.0
    for each in (first, last):
        assert each.texel_forces.sum() + each.outside == pytest.approx(each.total_force, rel=2e-3)
    assert "\n" not in str(stopped.value)


@pytest.mark.parametrize(
    ("control", "last"), [("load", (0.75 * 4.0, 0.6 * 2.0, 0.4 * 2.0)), ("depth", (0.97 * 3.0, 0.9 * 1.0, 0.75 * 1.0))]
)
def test_less_is_tried_until_all_grids_converge(control, last):
    """What a failed attempt reached, in newtons and metres, limits the next one; smaller targets are kept."""
    path = LoadingPath(
        cover=make_cover(0.45), indenter=Sphere(radius=1e-3), targets=(0.1, 9.0), control=control, friction=0.0
    )
    tried = []

    def solve(part, _refinement):
        tried.append(part.targets)
        if len(tried) == 4:
            return [SimpleNamespace(total_force=part.targets[-1], depth=1e-3)]
        first = len(tried) == 1
        raise PathConvergenceError("stopped", cause="too far", load=4.0 if first else 2.0, depth=3.0 if first else 1.0)

    with pytest.raises(IncompletePathError, match="too far; press less"):
        solve_as_far(path, solve)
    assert tried[0] == (0.1, 9.0)
    for part, value in zip(tried[1:], last, strict=True):
        assert part == pytest.approx((0.1, value))


@pytest.mark.parametrize(("control", "told"), [("load", "about 4 N of the 9 N"), ("depth", "about 3 mm of the 9 mm")])
def test_without_a_part_less_is_not_tried_and_the_message_says_how_far_one_grid_came(control, told):
    targets, tried = (9.0,) if control == "load" else (9e-3,), []
    path = LoadingPath(cover=make_cover(0.45), indenter=Sphere(radius=1e-3), targets=targets, control=control)

    def solve(part, _refinement):
        tried.append(part.targets)
        raise PathConvergenceError("stopped", cause="too far", load=4.0, depth=3e-3)

    with pytest.raises(IncompletePathError, match=told):
        solve_as_far(path, solve, as_far=False)
    assert tried == [targets]


@pytest.mark.parametrize(("reached", "tried"), [(0.95, True), (0.5, False)])
def test_finer_grids_are_tried_where_a_path_stops_shortly_before_its_target(reached, tried):
    asked = []

    def solve(path, refinement):
        if refinement == 0:
            raise PathConvergenceError("stopped", cause="stopped", load=1.0, depth=reached * path.targets[-1])
        asked.append(path)
        return ["all of it"]

    path = LoadingPath(cover=make_cover(0.45), indenter=Sphere(radius=5e-3), targets=(1e-3,), control="depth")
    if tried:
        assert solve_as_far(path, solve, finer=1) == ["all of it"]
    else:
        with pytest.raises(IncompletePathError):
            solve_as_far(path, solve, finer=1)
    assert len(asked) == tried


@pytest.mark.parametrize(
    ("model", "error"),
    [
        ("linear-elastic", ConvergenceError("the contact did not settle")),
        ("neo-hookean", TooShallowError("nothing touches on cells of 0.1 mm; press deeper")),
    ],
)
def test_where_less_load_is_no_remedy_it_is_neither_tried_nor_advised(model, error):
    path = LoadingPath(
        cover=make_cover(0.45, model), indenter=Cylinder(radius=1e-3), targets=(0.1, 0.2), control="load"
    )
    tried = []

    def solve(part, _refinement):
        tried.append(part.targets)
        raise error

    with pytest.raises(IncompletePathError, match=f"reached no load of the 0.2 N asked for: {error}$"):
        solve_as_far(path, solve)
    assert tried == [(0.1, 0.2)]
