"""What the grids of a loading path get and return, with presses that are made up and recorded."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.errors import PathConvergenceError
from fem_reference.finite_strain.block_path import NodalBase
from fem_reference.finite_strain.contact_problem import OVERLAP
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import finite_strain
from fem_reference.indentation.finite_strain import choose_fillet, pair_grids
from fem_reference.indentation.grid_solution import GridSolution, GridStudy
from fem_reference.linear_response.surface_compliance import choose_reach, choose_solid_reach
from meshes import Box, Cylinder, Roller, Sphere, TexelArray
from meshes.pose import Place, Pose
from tests.support.rubber import make_cover, stack_layers

BALL, DISK, FACE = Sphere(radius=4e-3), Cylinder(radius=2.5e-3), Box(size=(6e-3, 4e-3, 4e-3))
ROLLER = Roller(radius=4e-3, length=6e-3)
COVER, BOUNDED = make_cover(0.45), make_cover(0.45, size=(16e-3, 12e-3))
#: Points of the small-strain contact: 0.5 mm along x and 1.2 mm along y from the axis at most.
CONTACT = np.array([[0.3e-3, -1.2e-3, 1.0], [-0.5e-3, 0.4e-3, 1.0]])
DEPTHS = (0.2e-3, 0.4e-3)


def make_solution(force, depth, size=1.0):
    nodes = np.linspace(0, 1e-3, 5)
    base = NodalBase(x=nodes, y=nodes, pressure=np.ones((5, 5)))
    return GridSolution(
        size=size, total_force=force, depth=depth, area=1e-6, contact=CONTACT, base=base, energy=force * depth / 2
    )


class Presses:
    """Made-up presses that note what they are asked; forces are 10 N/mm on each grid."""

    def __init__(self, monkeypatch, folder, depths=DEPTHS):
        self.calls, self.blocks, self.places, self.least_fillet = [], [], [], 0.0
        coarse, middle, fine = (1.02, 2), (1.01, 3), (1.0, 4)
        self.accurate = GridStudy(
            solutions=[
                [
                    replace(make_solution(1e4 * d, more * d, 1 / n), contact=n / 2 * CONTACT)
                    for more, n in (coarse, middle, fine)
                ]
                for d in depths
            ]
        )
        monkeypatch.setenv("SOFTCOVER_STORE", str(folder))
        module = "fem_reference.indentation"
        monkeypatch.setattr(f"{module}.small_strain.study_path", self.solve_accurately)
        monkeypatch.setattr(f"{module}.small_strain.estimate_contact", lambda *_: CONTACT)
        monkeypatch.setattr(f"{module}.finite_strain.press_axisymmetric", self.press)
        monkeypatch.setattr(f"{module}.finite_strain.press_paired", self.press_paired)
        for name in ("lay_out_block", "lay_out_cover"):
            monkeypatch.setattr(f"{module}.finite_strain.{name}", self.lay_out(name))

    def solve_accurately(self, _path, place, _progress):
        self.places.append(place)
        return self.accurate

    def lay_out(self, name):
        def lay_out(_path, *others, **options):
            self.blocks.append(SimpleNamespace(name=name, others=others, **options))
            return len(self.blocks) - 1

        return lay_out

    def press(self, path, *, progress, **options):
        self.calls.append(SimpleNamespace(path=path, **options))
        progress("solves")
        if options["fillet"] < self.least_fillet:
            error = PathConvergenceError("stopped", cause="too far")
            error.solved = self.stopped_at
            raise error
        states = [make_solution(1e4 * target, target, 1 / options["elements_per_thickness"]) for target in path.targets]
        return states, f"solved {len(self.calls)}"

    def press_paired(self, path, block, approaches, *, progress, **options):
        self.calls.append(SimpleNamespace(path=path, block=block, approaches=approaches, **options))
        progress("solves")
        states = [make_solution(1e4 * target, target) for target in path.targets]
        return states, states, f"coarser {len(self.calls)}"


@pytest.fixture
def presses(monkeypatch, tmp_path):
    return Presses(monkeypatch, tmp_path)


def make_path(indenter, cover=COVER, **options):
    return LoadingPath(cover=cover, indenter=indenter, targets=DEPTHS, control="depth", **options)


def study(path, lines=None, at=(0.0, 0.0), **options):
    place = Place(array=TexelArray.grid(2, 2, pitch=3e-3), pose=Pose.planar(at=at))
    tell = (lambda _: None) if lines is None else lines.append
    return finite_strain.study_path(path, place, tell, **options)


@pytest.mark.parametrize(("refinement", "counts"), [(0, (6, 9, 13)), (1, (9, 13, 19)), (2, (13, 19, 28))])
def test_a_ball_is_solved_on_three_grids_whose_edges_scale_with_the_elements(presses, refinement, counts):
    """Its own edges are those of 13 elements, a twentieth of the thickness of 2 mm, on every refinement."""
    lines = []
    start = SimpleNamespace(name="start")
    found = study(make_path(BALL, friction=0.3, fields=True), lines, refinement=refinement, start=start)
    radius = float(np.hypot(0.3e-3, 1.2e-3))  # of the farther one of the points
    assert [each.elements_per_thickness for each in presses.calls] == list(counts)
    assert [each.fillet for each in presses.calls] == pytest.approx([0.1e-3 * 13 / count for count in counts])
    for each in presses.calls:
        assert (each.contact_radius, each.reach) == pytest.approx((radius, choose_reach(COVER, radius)))
    assert {each.approach for each in presses.calls} == {0.0}
    assert [each.coarse for each in presses.calls] == [start, "solved 1", "solved 2"]
    assert [each.path.fields for each in presses.calls] == [False, False, True]
    assert [(each.path.friction, each.path.load_scale) for each in presses.calls] == [(0.3, 1.0)] * 3
    assert lines == [f"{count} elements through the cover: solves" for count in counts]
    assert [[each.size for each in grids] for grids in found.solutions] == [[pytest.approx(1 / n) for n in counts]] * 2
    assert [grids[0].depth for grids in found.solutions] == list(DEPTHS)
    assert (found.accurate, found.assumptions, presses.places) == (None, {}, [])
    study(make_path(BALL, friction=0.3, fields=True), refinement=refinement)
    assert len(presses.calls) == 3  # the store knows them


def test_a_ball_on_covers_of_small_strain_alone_is_solved_at_small_strain(presses):
    study(make_path(BALL, make_cover(0.45, "linear-elastic"), friction=0.3))
    assert {each.path.load_scale for each in presses.calls} == {1e-3}


def test_a_disk_is_solved_with_and_without_finite_strain_at_its_depth(presses):
    start = SimpleNamespace(name="start")
    found = study(make_path(DISK, fields=True), start=start)
    fillet = choose_fillet(2e-3, DISK, DEPTHS[-1])
    assert [each.elements_per_thickness for each in presses.calls] == [6, 9, 13] * 2
    assert [each.path.load_scale for each in presses.calls] == [1e-3] * 3 + [1.0] * 3
    assert [each.coarse for each in presses.calls] == [None, "solved 1", "solved 2", start, "solved 4", "solved 5"]
    assert [each.path.fields for each in presses.calls] == [False, False, True] * 2
    assert {each.approach for each in presses.calls} == {DEPTHS[-1]}
    assert {each.contact_radius for each in presses.calls} == {2.5e-3}
    # The wider edge is asked of the store first; this one had none, and nothing was computed with it.
    assert presses.calls[2].fillet == pytest.approx(fillet)
    assert found.accurate is presses.accurate
    assert presses.places == [None]
    assert set(found.assumptions) == {"edge", "contact"}
    assert f"rounded with {1e3 * fillet:.3g} mm" in found.assumptions["edge"]


def test_an_edge_that_is_too_sharp_to_converge_is_widened_once(presses):
    wider = choose_fillet(2e-3, DISK, 0.6 * 2e-3)
    presses.least_fillet, presses.stopped_at = wider * 0.99, SimpleNamespace(coarse="a coarser grid")
    lines = []
    found = study(make_path(DISK), lines)
    assert any("edge rounded with 0.24 mm: no convergence with a sharper one" in line for line in lines)
    assert "rounded with 0.24 mm" in found.assumptions["edge"]
    count = len(presses.calls)
    assert presses.calls[-1].fillet == pytest.approx(wider)
    presses.least_fillet = 0.0
    assert "rounded with 0.24 mm" in study(make_path(DISK)).assumptions["edge"]
    assert len(presses.calls) == count  # the store knows those with the wider edge


@pytest.mark.parametrize(
    ("stopped_at", "depth"),
    [(None, DEPTHS[-1]), (SimpleNamespace(coarse=None), DEPTHS[-1]), (SimpleNamespace(coarse="one"), 1.3e-3)],
    ids=["nowhere", "on the coarsest grid", "with the widest edge"],
)
def test_an_edge_is_not_widened_where_that_is_no_remedy(monkeypatch, tmp_path, stopped_at, depth):
    presses = Presses(monkeypatch, tmp_path, (0.2e-3, depth))
    presses.least_fillet, presses.stopped_at = 1.0, stopped_at
    with pytest.raises(PathConvergenceError, match="stopped"):
        study(replace(make_path(DISK), targets=(0.2e-3, depth)))
    assert len(presses.calls) == 1


def test_a_box_is_solved_in_pairs_on_three_grids(presses):
    lines = []
    found = study(make_path(FACE, fields=True), lines)
    assert [each.elements_per_thickness for each in presses.calls] == [2, 3, 4]
    assert [each.coarser for each in presses.calls] == [None, "coarser 1", "coarser 2"]
    assert [each.path.fields for each in presses.calls] == [False, False, True]
    assert [each.block for each in presses.calls] == [0, 1, 2]
    assert [each.approaches for each in presses.calls] == [pytest.approx(DEPTHS)] * 3
    assert {each.name for each in presses.blocks} == {"lay_out_block"}
    assert [each.fillet for each in presses.blocks] == pytest.approx([0.4e-3 * 4 / n for n in (2, 3, 4)])
    assert {each.contact_half for each in presses.blocks} == {(3e-3, 2e-3)}
    assert {each.reach for each in presses.blocks} == {choose_solid_reach(COVER)}
    assert lines == [f"{count} elements through the cover: solves" for count in (2, 3, 4)]
    assert [each.size for each in found.solutions[0]] == pytest.approx([1 / 2, 1 / 3, 1 / 4])
    assert "rounded with 0.4 mm" in found.assumptions["edge"]
    assert presses.places == [None]


def test_the_fine_elements_lie_in_the_contact_of_a_roller_and_in_the_corners_of_a_face(presses):
    study(make_path(ROLLER))
    assert presses.blocks[0].contact_half == pytest.approx((0.5e-3, 1.2e-3))
    study(make_path(ROLLER, BOUNDED), at=(1e-3, 0.0))
    study(make_path(FACE, BOUNDED), at=(1e-3, 0.0))
    for each, points in (
        (presses.blocks[3], CONTACT[:, :2]),
        (presses.blocks[6], [[3, 2], [3, -2], [-3, 2], [-3, -2]]),
    ):
        pose, contact = each.others
        assert (each.name, pose.at) == ("lay_out_cover", (1e-3, 0.0))
        scale = 1 if points is CONTACT or len(points) == 2 else 1e-3
        assert contact == pytest.approx(scale * np.array(points))
        assert each.elements_per_thickness == 2
    assert presses.blocks[6].fillet == pytest.approx(2 * 0.4e-3)
    assert [place and place.pose.at for place in presses.places] == [None, (1e-3, 0.0), (1e-3, 0.0)]


@pytest.mark.parametrize(
    ("path", "rubbing", "expected"),
    [
        (make_path(BALL, friction=0.0), False, (1.0, 0.0, 0.0)),
        (make_path(BALL, friction=0.3), False, (1.0, 0.015, 0.0)),
        (make_path(DISK, friction=0.0), False, (2.0, 0.0, 0.0)),
        (make_path(DISK, friction=np.inf), False, (1.0, 0.015, 0.0)),
        (make_path(DISK, friction=np.inf), True, (2.0, 0.003, 0.0)),
        (make_path(BALL, friction=np.inf), True, (2.0, 0.003, 0.0)),
        (make_path(FACE, friction=0.0), False, (2.0, 0.0, 0.0)),
        (make_path(FACE, friction=0.3), False, (1.0, 0.015, 2.0)),
        (make_path(FACE, BOUNDED, friction=0.3), False, (1.0, 0.015, 2.0)),
        (make_path(FACE, friction=np.inf), True, (2.0, 0.003, 0.0)),
    ],
)  # fmt: skip
def test_error_estimates_assume_what_the_solution_leaves_of_friction_and_edges(presses, path, rubbing, expected):
    known = GridStudy(solutions=presses.accurate.solutions) if rubbing else None
    found = study(path, rubbing=known)
    assert (found.least_order, found.least_error, found.edge_safety) == expected
    assert (found.least_overlap, found.warnings) == (OVERLAP, ())
    if rubbing:
        assert (found.accurate, presses.places) == (known, [])
        assert {each.path.baseline_friction for each in presses.calls} == {path.friction}


def test_a_stiff_top_that_reaches_the_boundary_is_told_on_wide_covers_alone(presses):
    layers = ((2e-3, 1e4, 0.45), (0.1e-3, 70e9, 0.3))
    for options, count in (({}, 1), ({"size": (16e-3, 12e-3)}, 0)):
        assert len(study(make_path(FACE, stack_layers(*layers, **options), friction=0.3)).warnings) == count


@pytest.mark.parametrize(
    ("base", "at", "size", "refused"),
    [
        ("sliding", (1e-3, 0.0), (16e-3, 12e-3), True), ("sliding", (0.0, 1e-3), (16e-3, 12e-3), True),
        ("sliding", (0.0, 0.0), (16e-3, 12e-3), False), ("bonded", (1e-3, 0.0), (16e-3, 12e-3), False),
        ("sliding", (1e-3, 0.0), None, False),
    ],
)  # fmt: skip
def test_a_cover_that_could_slide_away_is_refused_before_anything_is_solved(presses, base, at, size, refused):
    path = make_path(FACE, make_cover(0.45, base=base, size=size))
    if not refused:
        assert study(path, at=at)
        return
    with pytest.raises(ValueError, match="slides on its base stays where it is only under a shape that mirrors"):
        study(path, at=at)
    assert not presses.places + presses.calls


def test_solutions_are_sorted_by_kind_target_and_grid():
    solved = [[[f"{kind} {target} {grid}" for target in "ab"] for kind in ("baseline", "full")] for grid in (2, 3, 4)]
    baseline, full = pair_grids(solved)
    assert baseline == [[f"baseline {target} {grid}" for grid in (2, 3, 4)] for target in "ab"]
    assert full == [[f"full {target} {grid}" for grid in (2, 3, 4)] for target in "ab"]
