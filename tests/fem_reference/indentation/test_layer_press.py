"""Presses into layers with made-up solutions: finer grids, sides that are added, fields, warnings, and statements."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from fem_reference.errors import IncompletePathError, PiercedError, UnsupportedError
from fem_reference.fields.cover_fields import CoverFields
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import finite_strain, layered, rubbing, small_strain
from fem_reference.indentation.grid_solution import GridSolution, GridStudy
from fem_reference.indentation.layered import LayerPress, press_layers, state_assumptions, study_nonlinear
from fem_reference.indentation.result import PressProblem, state_missed_accuracy
from meshes import Box, Cone, Cylinder, Sphere, TexelArray
from meshes.pose import Place, Pose
from tests.support.indentations import FixedBase
from tests.support.rubber import make_cover, stack_layers

BALL, PIN = Sphere(radius=4e-3), Cylinder(radius=1e-3)
ARRAY = TexelArray.grid(1, 2, 2e-3)
PLACE = Place(array=ARRAY, pose=Pose())
RUBBER, LINEAR = make_cover(0.45), make_cover(0.45, "linear-elastic")


def solve(force, depth, shares, area=1e-6, size=1.0):
    """A made-up solution on one grid, whose texel forces are shares of its force."""
    base = FixedBase(values=force * np.array(shares))
    contact = np.array([[0.0, 0.0, force]])
    return GridSolution(
        size=size, total_force=force, depth=depth, area=area, contact=contact, base=base, energy=0.4 * force * depth
    )


def refine(solution):
    """Three grids, of which only the finest one has this solution."""
    coarse = [solve(n * solution.total_force, 1.5 * solution.depth, (0.2, 0.1, 0.7), 3e-6, size=n) for n in (4, 2)]
    return [*coarse, solution]


def make_path(cover=LINEAR, indenter=BALL, targets=(1e-4,), control="depth", **options):
    return LoadingPath(cover=cover, indenter=indenter, targets=targets, control=control, **options)


class MadeUp(LayerPress):
    """A press whose errors on each grid are given; a string stops the path there."""

    def __init__(self, errors, told):
        super().__init__(place=PLACE, progress=told.append)
        object.__setattr__(self, "errors", errors)

    def count_refinements(self, _path):
        return len(self.errors) - 1

    def solve_as_far(self, _path, refinement=0):
        found = self.errors[refinement]
        if isinstance(found, str):
            raise IncompletePathError(found, [])
        return [Stated(error_estimate=each, number=refinement) for each in found]


@dataclass(frozen=True)
class Stated:
    """A result with estimated errors and warnings."""

    error_estimate: dict
    number: int
    warnings: tuple = ("known before",)


def wish(*values):
    return [{"total_force": value, "peak_texel": value / 2} for value in values]


@pytest.mark.parametrize(
    ("errors", "accuracy", "number", "missed", "lines"),
    [
        ([wish(0.02, 0.01), wish(0.005)], 0.02, 0, 0, 0),
        ([wish(0.02, 0.03), wish(0.009, 0.011), wish(0.001)], 0.0115, 1, 0, 1),
        ([wish(0.02), wish(0.04), wish(0.03)], 0.01, 0, 1, 2),
        ([wish(0.05), wish(0.02), wish(0.02)], 0.01, 1, 1, 2),
        ([wish(0.02), "stopped", wish(0.001)], 0.01, 0, 1, 1),
    ],
)
def test_grids_are_added_until_the_largest_error_of_all_targets_is_small_enough(
    errors, accuracy, number, missed, lines
):
    told = []
    results = MadeUp(errors, told).refine(make_path(), accuracy)
    assert {each.number for each in results} == {number}
    assert len(told) == lines
    for each in results:
        assert len(each.warnings) == 1 + missed
    if told:
        largest = max(each["total_force"] for each in errors[0])
        assert told[0] == f"estimated error {100 * largest:.3g} %, {100 * accuracy:.3g} % wanted: a finer grid is added"


def test_a_path_that_no_grid_solves_is_not_refined():
    with pytest.raises(IncompletePathError, match="stopped"):
        MadeUp(["stopped", wish(0.001)], []).refine(make_path(), 0.01)


def test_a_missed_accuracy_is_stated_with_the_errors_that_miss_it():
    errors = {"total_force": 0.02, "depth": 0.01, "peak_texel": 0.0123}
    found = state_missed_accuracy(Stated(error_estimate=errors, number=0), 0.01)
    said = "1 % wanted, but the feasible grids reach total force 2 %, peak texel 1.23 %"
    assert found.warnings == ("known before", said)
    fine = Stated(error_estimate={"total_force": 0.01}, number=0)
    assert state_missed_accuracy(fine, 0.01) is fine


@pytest.mark.parametrize(
    ("path", "most"),
    [
        (make_path(), len(small_strain.CELLS) - 3),
        (make_path(friction=0.3), len(rubbing.GRIDS) - 3),
        (make_path(RUBBER), len(finite_strain.GRIDS) - 3),
        (make_path(replace(RUBBER, size=(9e-3, 9e-3))), 0),
    ],
)
def test_grids_can_be_refined_as_often_as_there_are_finer_ones(path, most, monkeypatch):
    monkeypatch.setattr(layered, "is_far_from_sides", lambda *_: False)
    assert LayerPress(place=PLACE).count_refinements(path) == most


def test_far_sides_do_not_hinder_finer_grids(monkeypatch):
    monkeypatch.setattr(layered, "is_far_from_sides", lambda *_: True)
    path = make_path(replace(RUBBER, size=(90e-3, 90e-3)))
    assert LayerPress(place=PLACE).count_refinements(path) == len(finite_strain.GRIDS) - 3


def test_sides_are_added_to_finite_strain_and_what_they_change_together_is_an_error(monkeypatch):
    """Force per depth and shares of the texels: each effect multiplies or is added."""
    cover = replace(RUBBER, size=(6e-3, 6e-3))
    wide = GridStudy(solutions=[[solve(4.0, 1e-3, (0.5, 0.3, 0.2))] * 3], assumptions={"strain": "finite"})
    plain = GridStudy(solutions=[refine(solve(3.0, 1e-3, (0.5, 0.25, 0.25)))])
    edged = GridStudy(solutions=[refine(solve(2.4, 1e-3, (0.6, 0.2, 0.2)))])
    monkeypatch.setattr(layered, "study_nonlinear", lambda path, *_: wide if path.cover.size is None else None)
    monkeypatch.setattr(small_strain, "study_path", lambda path, *_: plain if path.cover.size is None else edged)
    monkeypatch.setattr(layered, "is_far_from_sides", lambda *_: False)
    path = make_path(cover, targets=(1e-3,))
    found = layered.superpose_sides(path, PLACE, None)
    for each in found.solutions[0]:
        assert each.total_force == pytest.approx(2.4 * 4.0 / 3.0)
        assert each.depth == pytest.approx(1e-3)
        assert each.base.forces(ARRAY, Pose()) == pytest.approx(3.2 * np.array([0.6, 0.25, 0.15]))
    together = max(0.1 * 0.2, (3.0 / 2.4 - 1) * 1e-3 / cover.thickness)
    assert found.least_error == pytest.approx(together)
    assert found.accurate is edged
    assert found.assumptions["strain"] == "finite"
    assert "what they change in finite strain" in found.assumptions["sides"]
    # The product of two large effects on the texels exceeds that of the depth.
    moved = GridStudy(solutions=[refine(solve(2.4, 1e-3, (0.9, 0.0, 0.1)))])
    far = GridStudy(solutions=[refine(solve(4.0, 1e-3, (0.1, 0.6, 0.3)))])
    monkeypatch.setattr(layered, "study_nonlinear", lambda *_: far)
    monkeypatch.setattr(small_strain, "study_path", lambda path, *_: plain if path.cover.size is None else moved)
    assert layered.superpose_sides(path, PLACE, None).least_error == pytest.approx((0.4 + 0.35 + 0.05) * 0.8)


def test_far_sides_are_not_superposed(monkeypatch):
    monkeypatch.setattr(layered, "is_far_from_sides", lambda *_: True)
    monkeypatch.setattr(layered, "study_nonlinear", lambda *arguments: arguments)
    path = make_path(replace(RUBBER, size=(90e-3, 90e-3)))
    assert layered.superpose_sides(path, PLACE, None, 2) == (path, PLACE, None, 2)


def test_a_face_beside_sides_is_extrapolated_before_it_is_added(monkeypatch):
    cover = replace(RUBBER, size=(6e-3, 6e-3))
    share = (0.5, 0.3, 0.2)

    def converge(last):
        """Forces that approach `last` in proportion to the size of the elements."""
        return GridStudy(solutions=[[solve(last * (1 + 0.1 * size), 1e-3, share, size=size) for size in (4, 2, 1)]])

    wide = GridStudy(solutions=[[solve(4.0, 1e-3, share)] * 3])
    monkeypatch.setattr(layered, "study_nonlinear", lambda *_: wide)
    monkeypatch.setattr(small_strain, "study_path", lambda path, *_: converge(3.0 if path.cover.size is None else 2.4))
    monkeypatch.setattr(layered, "is_far_from_sides", lambda *_: False)
    found = layered.superpose_sides(make_path(cover, PIN, (1e-3,)), PLACE, None)
    assert found.solutions[0][-1].total_force == pytest.approx(2.4 * 4.0 / 3.0)
    assert found.least_error == pytest.approx(0.25 * 0.5)


@pytest.mark.parametrize(
    ("path", "solver", "rubs"),
    [
        (make_path(friction=0.2), "rubbing", False),
        (make_path(RUBBER, friction=0.2), "finite", True),
        (make_path(RUBBER), "finite", False),
        (make_path(replace(RUBBER, size=(9e-3, 9e-3)), friction=0.2), "finite", False),
    ],
)
@pytest.mark.parametrize("depth", [1e-3, 2e-3])
def test_friction_and_strain_choose_the_solver(path, solver, rubs, depth, monkeypatch):
    study = GridStudy(solutions=[[solve(1.0, depth, (0.5, 0.3, 0.2))] * 3])
    monkeypatch.setattr(layered, "is_far_from_sides", lambda *_: False)
    monkeypatch.setattr(rubbing, "study_path", lambda *_: study)
    monkeypatch.setattr(finite_strain, "study_path", lambda *given, start: ("finite", *given, start))
    found = study_nonlinear(path, PLACE, None, 1, start="start")
    if solver == "rubbing":
        assert found is study
    else:
        # Rubber bears loads at which the linear solution would pierce the cover.
        helped = study if rubs and depth < path.cover.thickness else None
        assert found == ("finite", path, PLACE, None, 1, helped, "start")


def test_sides_that_are_far_are_left_out_with_their_error(monkeypatch):
    seen = []
    monkeypatch.setattr(layered, "is_far_from_sides", lambda path, *_: path.cover.size is not None)
    monkeypatch.setattr(
        finite_strain, "study_path", lambda path, *_, start: seen.append((path, start)) or GridStudy(solutions=[])
    )
    found = study_nonlinear(make_path(replace(RUBBER, size=(90e-3, 90e-3))), PLACE, None, start="start")
    assert seen == [(make_path(RUBBER), "start")]
    assert found.least_error == 1e-3
    assert found.assumptions["sides"] == "too far from the contact to matter"


def put_contact(at, half, monkeypatch):
    monkeypatch.setattr(small_strain, "estimate_contact", lambda path, *_: seen.append(path) or np.array(half)[None])
    seen = []
    return Place(array=ARRAY, pose=Pose.planar(at=at)), seen


@pytest.mark.parametrize(("base", "gap"), [("bonded", 4.0), ("sliding", 15.0)])
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_sides_are_far_beyond_a_multiple_of_the_decay_length(base, gap, share, monkeypatch):
    """A contact whose farthest point is 0.5 mm from an axis at (2, -1) mm."""
    place, seen = put_contact((2e-3, -1e-3), (0.3e-3, 0.4e-3), monkeypatch)
    edge = 2 * (2e-3 + 0.5e-3 + share * gap * RUBBER.thickness)
    cover = replace(RUBBER, base=base, size=(edge, edge + 1e-3))
    assert layered.is_far_from_sides(make_path(cover), place) is (share > 1)
    assert seen[0].cover.size is None
    assert not layered.is_far_from_sides(make_path(cover, fields=True), place)
    assert not layered.is_far_from_sides(make_path(replace(cover, size=None)), place)


def test_friction_stretches_a_stiff_top_to_farther_sides(monkeypatch):
    place, _ = put_contact((0.0, 0.0), (0.3e-3, 0.4e-3), monkeypatch)
    cover = stack_layers((2e-3, 1e5, 0.45), (0.05e-3, 5e8, 0.4), size=(60e-3, 60e-3))
    assert layered.is_far_from_sides(make_path(cover), place)
    assert not layered.is_far_from_sides(make_path(cover, friction=0.2), place)


def press_problem(**options):
    known = {"array": ARRAY, "indenter": BALL, "pose": Pose(), "targets": (1e-4,), "control": "depth"}
    return PressProblem(**(known | options))


@pytest.mark.parametrize(
    ("cover", "options", "kind", "words"),
    [
        (LINEAR, {"strain": "finite"}, UnsupportedError, "solved at small strain"),
        (RUBBER, {"strain": "small"}, UnsupportedError, "solved at finite strain"),
        (
            LINEAR,
            {"targets": (1e-3, 2e-3)},
            PiercedError,
            "at a depth of 2 mm the indenter would pierce.*thickness, 2 mm",
        ),
        (LINEAR, {"pose": Pose(direction=(0.6, 0.0, -0.8))}, UnsupportedError, "pressed along -z, not along"),
        (
            replace(LINEAR, size=(6e-3, 8e-3)),
            {"pose": Pose.planar(at=(1e-3, 4.01e-3))},
            ValueError,
            r"axis at \(1, 4.01\) mm stands beside the cover, which measures 6 x 8 mm",
        ),
        (LINEAR, {"accuracy": 0.9e-4}, UnsupportedError, "the smallest error that is stated here is 0.01%"),
        (LINEAR, {"accuracy": 5e-3, "friction": 0.2}, UnsupportedError, "stated here is 0.69%"),
    ],
)
def test_presses_that_layers_do_not_take_are_refused(cover, options, kind, words):
    with pytest.raises(kind, match=words):
        press_layers(cover, press_problem(**options))


def test_a_load_that_pierces_is_refused_with_the_largest_one(monkeypatch):
    seen = []

    def study(path, place, progress, refinement=0):
        seen.append(path)
        deep = path.control == "load"
        return GridStudy(solutions=[[solve(7.0, 2.4e-3 if deep else 1.9e-3, (0.5, 0.3, 0.2))] * 3])

    monkeypatch.setattr(small_strain, "study_path", study)
    with pytest.raises(PiercedError, match=r"9 N would pierce the cover \(2.4 mm deep, the cover has 2 mm\).*most 7 N"):
        LayerPress(place=PLACE).solve(make_path(targets=(9.0,), control="load"), 0)
    assert (seen[1].targets, seen[1].control) == ((pytest.approx(0.98 * 2e-3),), "depth")


@pytest.mark.parametrize(
    ("cover", "indenter", "depth", "friction", "told"),
    [
        (LINEAR, BALL, 0.6e-3, 0.0, {"strain": "small", "friction": "frictionless", "base": "bonded"}),
        (RUBBER, BALL, 0.9e-3, 0.25, {"strain": "finite", "friction": "Coulomb, coefficient 0.25", "base": "bonded"}),
        (
            replace(LINEAR, base="sliding", size=(6e-3, 8.5e-3)),
            Cone(radius=1e-3, angle=2.0),
            0.61e-3,
            np.inf,
            {
                "strain": "small",
                "friction": "no slip",
                "base": "sliding",
                "sides": "free, 6 x 8.5 mm, touched on top only",
                "range": "indented to 30% of the thickness: more than small strain is meant for",
            },
        ),
    ],
)
def test_assumptions_say_strain_friction_base_sides_and_range(cover, indenter, depth, friction, told):
    assert state_assumptions(cover, indenter, depth, friction) == told


def test_von_mises_stress_is_that_of_simple_states_and_scales():
    """Tension, shear, pressure alone, and a plane state, from the differences of the principal stresses."""
    stress = np.zeros((4, 3, 3))
    stress[0, 0, 0] = -3.0
    stress[1, 0, 2] = stress[1, 2, 0] = 2.0
    stress[2] = 5.0 * np.eye(3)
    stress[3] = np.diag([1.0, -2.0, 4.0])
    fields = CoverFields(
        position=np.zeros((4, 3)), displacement=np.ones((4, 3)), stress=stress, cells=np.zeros((1, 4), int),
        layer=np.zeros(1, int), axisymmetric=True,
    )  # fmt: skip
    plane = np.sqrt((3.0**2 + 6.0**2 + 3.0**2) / 2)
    assert fields.von_mises == pytest.approx([3.0, 2 * np.sqrt(3), 0.0, plane])
    scaled = fields.scale(2.0, 3.0)
    assert scaled.von_mises == pytest.approx(3 * fields.von_mises)
    assert (scaled.displacement == 2.0).all()


def on_grids(solution):
    """The same solution on three grids."""
    return [replace(solution, size=size) for size in (4.0, 2.0, 1.0)]


@pytest.mark.parametrize(("control", "share"), [("load", 1.25), ("depth", 1.0)])
def test_fields_are_scaled_to_the_force_and_state_how_far_the_top_is_off_the_face(control, share, monkeypatch):
    """A sliding column under even pressure sinks by force H / (E A); the depth of the solution differs by a share."""
    size, force = (3e-3, 2e-3), 0.03
    cover = stack_layers((2e-3, 1e6, 0.3), size=size, base="sliding")
    sunk = force * 2e-3 / (1e6 * size[0] * size[1])
    axes = [(np.arange(n) + 0.5) / n * edge - edge / 2 for n, edge in zip((24, 16), size, strict=True)]
    x, y = (each.ravel() for each in np.meshgrid(*axes, indexing="ij"))
    contact = np.column_stack([x, y, np.full(x.size, force / x.size)])
    one = replace(solve(force, share * sunk, (0.5, 0.3, 0.2), area=6e-6), contact=contact)
    monkeypatch.setattr(small_strain, "study_path", lambda *_: GridStudy(solutions=[refine(one)]))
    target = force if control == "load" else share * sunk
    path = make_path(cover, Box(size=(4e-3, 4e-3, 1e-3)), (target,), control, fields=True)
    (found,) = LayerPress(place=PLACE).solve(path, 0)
    assert found.fields.error == pytest.approx(1 - 1 / share, abs=0.02)
    assert f"is {found.fields.error:.2%} of the depth off the indenter" in found.assumptions["fields"]
    top = found.fields.position[:, 2] > 2e-3 - 1e-9
    assert found.fields.displacement[top, 2] == pytest.approx(-sunk, rel=0.02)
    assert found.contact_forces.sum(axis=0) == pytest.approx([0, 0, -force])
    assert found.contact_points[:, 2] == pytest.approx(2e-3 - share * sunk)
    assert (found.total_force, found.depth) == (pytest.approx(force), pytest.approx(share * sunk))
    assert found.energy == pytest.approx(0.4 * force * share * sunk)
    assert found.texel_forces == pytest.approx([0.5 * force, 0.3 * force])
    assert (found.outside, found.balance) == (pytest.approx(0.2 * force), pytest.approx(0.0, abs=1e-12))
    assert found.error_estimate["total_force" if control == "load" else "depth"] == 0.0
    assert found.grid_values["total_force"] == pytest.approx((4 * force, 2 * force, force))
    assert found.grid_values["peak_texel"] == pytest.approx((0.8 * force, 0.4 * force, 0.5 * force))
    assert found.grid_values["depth"] == pytest.approx((1.5 * share * sunk, 1.5 * share * sunk, share * sunk))
    assert found.grid_values["contact_area"] == pytest.approx((3e-6, 3e-6, 6e-6))
    assert found.grid_values["size"] == (4, 2, 1.0)
    assert found.contact_area == pytest.approx(6e-6)
    assert found.error_estimate["contact_area"] == pytest.approx(2 * 3e-6 / 6e-6)


def place_top(points, indenter, depth, misses):
    """Fields of points of a top that is off an indenter by known lengths, once moved 0.2 mm aside, and of the base."""
    rows = len(points)
    moved = np.tile([0.2e-3, 0.0, 0.0], (rows, 1))
    moved[:, 2] = indenter.gap(points[:, 0] + 0.2e-3, points[:, 1]) - depth + np.array(misses)
    base = np.column_stack([points, np.zeros(rows)])
    return CoverFields(
        position=np.concatenate([base + np.array([0, 0, 2e-3]), base]),
        displacement=np.concatenate([moved, np.ones((rows, 3))]),
        stress=np.zeros((2 * rows, 3, 3)), cells=np.zeros((1, 4), int), layer=np.zeros(1, int), axisymmetric=True,
    )  # fmt: skip


@pytest.mark.parametrize("axisymmetric", [True, False])
def test_the_worst_point_of_the_touched_top_counts_where_the_cover_went(axisymmetric, monkeypatch):
    """Contact to 1 mm from the axis, or within half a diagonal of its points; farther points are off by far more."""
    depth, points = 0.3e-3, np.array([[-0.2e-3, 0.0], [0.3e-3, 0.0], [0.79e-3, 0.0], [0.81e-3, 0.0], [3e-3, 0.0]])
    misses = [2e-6, -9e-6, 6e-6, 0.1e-3, 0.2e-3]
    contact = np.array([[0.0, 0.0, 1.0], [1.0e-3, 0.0, 1.0], [0.0, 0.0, 0.0]])
    pose = Pose.planar(at=(0.5e-3, -0.4e-3), yaw=0.0 if axisymmetric else 0.6)
    # Half a diagonal of 1.1 mm: a square for each of two points, at 0 and at 1 mm; the last one bears nothing.
    area = 2 * 2 * (0.7e-3) ** 2 if not axisymmetric else 1e-6
    if not axisymmetric:
        points[2:4, 0] = [1.49e-3, 1.51e-3]
    fields = replace(place_top(points, BALL, depth, misses), axisymmetric=axisymmetric)
    one = replace(solve(2.0, depth, (0.5, 0.3, 0.2), area=area), contact=contact, fields=fields)
    study = GridStudy(solutions=[on_grids(one)])
    monkeypatch.setattr(layered, "study_nonlinear", lambda *_, **__: study)
    press = LayerPress(place=Place(array=ARRAY, pose=pose))
    (found,) = press.solve(make_path(RUBBER, targets=(depth,), fields=True), 0)
    assert found.fields.error == pytest.approx(9e-6 / depth, rel=1e-6)
    assert "worst point the touched surface is 3.00% of the depth" in found.assumptions["fields"]
    assert found.fields.position[0, :2] == pytest.approx(np.array(pose.to_array(*points[0])))


def test_forces_on_the_base_that_miss_the_load_are_warned_of(monkeypatch):
    for missing, told in ((0.0009, False), (0.0011, True)):
        one = solve(2.0, 1e-4, (0.5, 0.3, 0.2 - missing))
        monkeypatch.setattr(small_strain, "study_path", lambda *_, one=one: GridStudy(solutions=[on_grids(one)]))
        (found,) = LayerPress(place=PLACE).solve(make_path(targets=(2.0,), control="load"), 0)
        assert found.balance == pytest.approx(-missing)
        assert any("the forces on the base differ from the load by -0.11%" in each for each in found.warnings) is told
        assert found.error_estimate["peak_texel"] == pytest.approx(missing)
        assert found.texel_errors[0] == pytest.approx(missing * 1.0, rel=1e-6)
        assert found.base_force == pytest.approx([0, 0, -2.0 * (1 - missing)])
        assert found.unmeasured == pytest.approx([0, 0, -2.0 * (0.2 - missing)])


@pytest.mark.parametrize(
    ("path", "superposed", "solver"),
    [
        (make_path(), True, "small"),
        (make_path(replace(LINEAR, size=(9e-3, 8e-3))), True, "small"),
        (make_path(friction=0.2), False, "full"),
        (make_path(RUBBER), True, "full"),
        (make_path(replace(RUBBER, size=(9e-3, 8e-3))), False, "full"),
        (make_path(replace(RUBBER, size=(9e-3, 8e-3))), True, "superposed"),
        (make_path(replace(RUBBER, size=(9e-3, 8e-3)), friction=0.2), True, "full"),
    ],
)
def test_sides_are_superposed_on_request_at_finite_strain_without_friction(path, superposed, solver, monkeypatch):
    asked = []

    def note(name):
        def study(given, place, progress, refinement, **options):
            asked.append((name, given, place, progress, refinement, options))
            return GridStudy(solutions=[on_grids(solve(1.0, 1e-4, (0.5, 0.3, 0.2)))])

        return study

    monkeypatch.setattr(small_strain, "study_path", note("small"))
    monkeypatch.setattr(layered, "study_nonlinear", note("full"))
    monkeypatch.setattr(layered, "superpose_sides", note("superposed"))
    (found,) = LayerPress(place=PLACE, superposed=superposed, start="start").solve(path, 2)
    options = {"start": "start"} if solver == "full" else {}
    assert asked == [(solver, path, PLACE, None, 2, options)]
    assert found.total_force == 1.0
