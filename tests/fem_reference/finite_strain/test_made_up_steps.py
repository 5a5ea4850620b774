"""Loading paths whose steps succeed or fail as prescribed: viscous motion, first steps, augmentation, and guesses."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.errors import ConvergenceError, PathConvergenceError
from fem_reference.finite_strain.contact_problem import ContactEquilibrium, ContactProblem, Guess, SolvedPath
from fem_reference.finite_strain.loading_path import Units
from tests.support.rubber import make_solid


class Surface:
    """A contact that records its calls."""

    def __init__(self, friction=0.0):
        self.friction, self.weight, self.told = friction, np.ones(2), []

    def augment(self, pressure):
        self.told.append(("augment", float(pressure.max())))

    def stiffen(self, pressure):
        self.told.append(("stiffen", pressure))

    def record_slip(self, contact):
        self.told.append(("record", contact.pressure.max()))


class Steps(ContactProblem):
    """A problem whose solutions are given: `answer` takes depth, load, drag and tolerance."""

    def __init__(self, answer, *, friction=0.0, overlap=1e-3, friction_steps=4):
        solid = SimpleNamespace(elements=SimpleNamespace(displacements=3, pressures=1))
        super().__init__(
            solid=solid, contact=Surface(friction), constrained=np.zeros(0, int), units=Units(length=2e-3, stress=1e6),
            overlap=overlap, friction_steps=friction_steps,
        )  # fmt: skip
        object.__setattr__(self, "asked", [])
        object.__setattr__(self, "answer", answer)

    def _solve(self, state, depth, load, used, *, tolerance, near=None, drag=0.0):
        call = SimpleNamespace(
            state=state, depth=depth, load=load, used=used, tolerance=tolerance, near=near, drag=drag
        )
        self.asked.append(call)
        found = self.answer(call)
        if found is None:
            raise ConvergenceError("made to fail")
        depth = found.get("depth", depth)
        contact = SimpleNamespace(
            overlap=found.get("overlap", 0.0), pressure=np.full(2, found.get("pressure", 5.0)), total=0.0
        )
        return ContactEquilibrium(
            state=state + 1, depth=depth, load=10 * depth if load is None else load, contact=contact,
            reaction=np.zeros(4), iterations=used + found.get("iterations", 2),
        )  # fmt: skip


def follow(problem, target=0.4, *, control="depth", first=0.02, **options):
    return problem.follow([target], control=control, first=first, **options)[0]


GUESS = Guess(state=np.full(4, 7000.0), depth=0.38, contact_pressure=3.0)


def test_a_guess_that_fails_creeps_with_a_drag_that_falls_to_none():
    """The drag begins at 1000, falls to a fifth after each step that moves, and is left out below 1."""
    problem = Steps(lambda call: None if call.drag == 0 and len(problem.asked) == 1 else {})
    found = follow(problem, guesses=[GUESS])
    drags = [call.drag for call in problem.asked]
    assert drags[:8] == pytest.approx([0.0, 1000.0, 200.0, 40.0, 8.0, 1.6, 0.32, 0.0])
    # Each step begins where the last one came to rest, at the depth of the target.
    assert [call.state[0] for call in problem.asked[:4]] == [7000.0, 7000.0, 7001.0, 7002.0]
    assert {call.depth for call in problem.asked[:8]} == {0.4}
    assert [call.used for call in problem.asked[:4]] == [0, 0, 2, 4]
    assert problem.contact.told[:2] == [("augment", 0.0), ("stiffen", 3.0)]
    assert found.depth == 0.4


def test_a_step_of_the_motion_that_fails_gets_more_drag():
    fails = {0, 2, 3}
    problem = Steps(lambda _call: None if len(problem.asked) - 1 in fails else {})
    follow(problem, guesses=[GUESS])
    drags = [call.drag for call in problem.asked]
    assert drags[:6] == pytest.approx([0.0, 1000.0, 200.0, 1000.0, 5000.0, 1000.0])


def test_a_motion_at_rest_ends_at_once():
    """A step without an iteration has not moved, so that the next one has no drag."""
    problem = Steps(lambda call: None if len(problem.asked) == 1 else {"iterations": 0 if call.drag else 1})
    follow(problem, guesses=[GUESS])
    assert [call.drag for call in problem.asked][:3] == [0.0, 1000.0, 0.0]


@pytest.mark.parametrize(("friction", "tries"), [(0.0, 25), (0.3, 1)])
def test_a_motion_without_rest_is_given_up_and_friction_never_creeps(friction, tries):
    """The path then begins from the undeformed state, whose unknowns are zero."""
    problem = Steps(lambda call: {} if call.state[0] < 7000 else None, friction=friction)
    follow(problem, guesses=[GUESS])
    assert sum(call.state[0] == 7000 for call in problem.asked) == tries
    rest = problem.asked[tries]
    assert (rest.state == 0).all()
    assert (rest.depth, rest.load, rest.near) == (0.02, None, None)


@pytest.mark.parametrize(("most", "depth"), [(1.0, 0.02), (0.011, 0.01), (0.0026, 0.0025)])
def test_a_first_step_is_halved_until_it_converges(most, depth):
    problem = Steps(lambda call: {} if call.depth <= most or call.state[0] > 0 else None)
    follow(problem)
    first = next(call for call in problem.asked if call.state[0] > 0 or call.depth == depth)
    assert first.depth == pytest.approx(depth)
    tried = [call.depth for call in problem.asked[: problem.asked.index(first) + 1]]
    assert tried == pytest.approx([0.02 / 2**k for k in range(len(tried))])


@pytest.mark.parametrize(("control", "tried"), [("depth", (0.04, 0.08)), ("load", (0.04, 0.08, 0.16, 0.32))])
def test_a_first_step_that_no_halving_helps_is_doubled_up_to_the_target(control, tried):
    """Twelve steps down to 0.02 / 2048 and four up; none is deeper than a target depth."""
    problem = Steps(lambda _call: None)
    with pytest.raises(PathConvergenceError, match=r"no convergence even at a depth of 1.95e-05 mm") as stopped:
        follow(problem, 0.15, control=control)
    depths = [call.depth for call in problem.asked]
    assert depths == pytest.approx([*(0.02 / 2**k for k in range(12)), *tried])
    assert {call.tolerance for call in problem.asked} == {1e-3}
    assert stopped.value.cause in str(stopped.value)


def test_with_friction_the_first_step_is_a_part_of_the_target():
    problem = Steps(lambda _call: {}, friction=0.3, friction_steps=16)
    follow(problem, 0.16)
    assert problem.asked[0].depth == pytest.approx(0.01)  # 0.02 is more than a sixteenth
    load = Steps(lambda _call: {}, friction=0.3, friction_steps=16)
    follow(load, 1.0, control="load")  # ten per depth: 0.005 bears 0.05
    assert [call.depth for call in load.asked if call.load is None][:3] == [0.02, 0.01, 0.005]


def test_the_penetration_at_a_target_is_reduced_until_it_is_small():
    """It falls to a third with each augmentation, each of which adds the pressure that was found."""
    overlaps = iter([0.1 * 0.4, 0.03 * 0.4, 0.01 * 0.4, 0.5e-3 * 0.4, 0.5e-3 * 0.4])
    pressures = iter([5.0, 6.0, 7.0, 8.0, 9.0])
    problem = Steps(lambda _call: {"overlap": next(overlaps), "pressure": next(pressures)})
    found = follow(problem, guesses=[GUESS])
    augmented = [value for name, value in problem.contact.told if name == "augment"]
    assert augmented == [0.0, 5.0, 6.0, 7.0]
    assert [call.tolerance for call in problem.asked] == [1e-3] * 4 + [1e-6]
    assert found.contact.overlap == pytest.approx(0.5e-3 * 0.4)
    assert found.before_augmentation.contact.overlap == pytest.approx(0.04)
    assert found.penalty_solution is found.before_augmentation
    assert found.before_augmentation.penalty_solution is found.before_augmentation


def test_an_augmentation_that_fails_is_taken_back():
    """Near the goal no viscous motion is tried; the pressure of the last solution that worked is added again."""
    overlaps = iter([3e-3 * 0.4, 2e-3 * 0.4, None, 2e-3 * 0.4])

    def answer(_call):
        overlap = next(overlaps)
        return None if overlap is None else {"overlap": overlap, "pressure": 1e3 * overlap}

    problem = Steps(answer)
    found = follow(problem, guesses=[GUESS])
    augmented = [value for name, value in problem.contact.told if name == "augment"]
    assert augmented == pytest.approx([0.0, 1.2, 0.8, 1.2])
    assert found.contact.overlap == pytest.approx(0.8e-3)
    assert [call.drag for call in problem.asked] == [0.0] * 4


def test_at_most_six_augmentations_are_made():
    problem = Steps(lambda _call: {"overlap": 2e-3})
    follow(problem, guesses=[GUESS])
    assert [call.tolerance for call in problem.asked] == [1e-3] * 7 + [1e-6]


def test_steps_to_a_target_begin_at_the_first_guess_between_that_converges():
    """Guesses beyond the target are left out, and the first step is a quarter of what is left."""
    between = [
        Guess(state=np.full(4, 100.0 + k), depth=depth, load=10 * depth) for k, depth in enumerate((0.5, 0.3, 0.2))
    ]
    problem = Steps(lambda call: None if call.state[0] == 101.0 or call.drag else {})
    follow(problem, between=between)
    begun = [call for call in problem.asked if call.drag == 0 and call.tolerance == 1e-3]
    assert [call.state[0] for call in begun[:2]] == [101.0, 102.0]
    assert begun[1].depth == 0.2
    assert begun[2].depth == pytest.approx(0.2 + 0.25 * 0.2)


def made_up_path(loads, elements, *, targets=(), coarse=None):
    """Equilibria with given loads, ten per depth, whose unknowns are all the load."""

    def reach(load):
        contact = SimpleNamespace(pressure=np.array([0.5 * load, 2 * load]))
        state = np.full(elements.displacements + elements.pressures, load)
        return ContactEquilibrium(
            state=state, depth=load / 10, load=load, contact=contact, reaction=0 * state, iterations=1
        )

    return SolvedPath(
        elements=elements, equilibria=[reach(load) for load in targets], steps=[reach(load) for load in loads],
        coarse=coarse,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("loads", "targets", "coarser", "expected"),
    [
        # Of a path that ended: those nearest to 80, 60, 40 and 20 % of the last target, each once.
        ([1.0, 2.1, 4.2, 5.0, 6.1, 7.9], (10.0,), None, [7.9, 6.1, 4.2, 2.1]),
        ([2.0, 7.0, 9.0], (5.0, 10.0), None, [7.0, 2.0]),
        # Of one that stopped: those of 95, 90 and 88 % of the largest load as well.
        ([2.0, 4.0, 6.0, 8.0, 8.8, 9.1, 9.5, 10.0], (), None, [9.5, 9.1, 8.8, 8.0, 6.0, 4.0, 2.0]),
        # Loads below the first step are taken from the coarser mesh.
        ([5.0, 8.1], (10.0,), [1.0, 2.2, 4.1, 9.0], [8.1, 5.0, 4.1, 2.2]),
        ([], (10.0,), [2.0, 8.0], [8.0, 2.0]),
        ([], (), None, []),
    ],
)
def test_a_few_steps_of_a_path_start_the_next_mesh(loads, targets, coarser, expected):
    elements = make_solid("ring").elements
    coarse = None if coarser is None else made_up_path(coarser, elements)
    path = made_up_path(loads, elements, targets=targets, coarse=coarse)
    found = path.transfer_steps(elements)
    assert [guess.load for guess in found] == pytest.approx(expected)
    for guess in found:
        assert guess.depth == pytest.approx(guess.load / 10)
        assert guess.contact_pressure == pytest.approx(2 * guess.load)
        np.testing.assert_allclose(guess.state, guess.load, rtol=1e-12)
    assert [guess.load for guess in path.transfer_guesses(elements)] == list(targets)


@pytest.mark.parametrize(
    ("friction", "depths"),
    [
        # Steps of many iterations do not grow, except with friction, up to a fourth of the target.
        (0.0, [0.02 * n for n in range(1, 20)] + [0.4]),
        (0.3, [0.02, 0.04, 0.076, 0.1408, 0.2408, 0.3408, 0.4]),
    ],
)
def test_steps_with_friction_grow_up_to_a_part_of_the_target(friction, depths):
    problem = Steps(lambda _call: {"iterations": 20}, friction=friction)
    told, recorded = [], []
    found = follow(problem, progress=told.append, record=recorded.append)
    assert [call.depth for call in problem.asked if call.tolerance == 1e-3] == pytest.approx(depths)
    assert [each.depth for each in recorded] == pytest.approx(depths[1:])
    # Two millimetres and four newtons per unit, ten units of force per depth.
    assert told == [f"{40 * d:.3g} N at {2 * d:.3g} mm" for d in (*depths[1:], 0.4)]
    assert found.depth == 0.4


def test_each_step_starts_on_the_line_through_the_last_two_equilibria():
    """Unknowns rise by one per solution; the depth is a tenth of the load."""
    problem = Steps(lambda call: {} if call.load is None else {"depth": call.load / 10})
    follow(problem, 2.0, control="load")
    steps = [call for call in problem.asked if call.load is not None and call.tolerance == 1e-3]
    loads = [0.4, 0.76, 1.408, 2.0]
    assert [call.load for call in steps] == pytest.approx(loads)
    assert (steps[0].depth, steps[0].state[0]) == pytest.approx((0.02, 1.0))
    last = [(0.2, 1.0), (0.4, 2.0)]
    for call, load in zip(steps[1:], loads[1:], strict=True):
        (one, x), (two, y) = last
        ahead = (load - two) / (two - one)
        assert (call.depth, call.state[0]) == pytest.approx((load / 10, y + ahead * (y - x)))
        assert call.near.load == pytest.approx(two)
        last = [(two, y), (load, call.state[0] + 1)]


def test_a_small_step_that_fails_moves_viscously():
    """Beyond a depth of 0.3 nothing converges without drag: steps of a sixty-fourth or less get some."""
    problem = Steps(lambda call: {} if call.depth <= 0.3 or call.drag else None)
    with pytest.raises(PathConvergenceError, match="the cover does not come to rest"):
        follow(problem)
    moving = [call for call in problem.asked if call.drag]
    still = [call for call in problem.asked if not call.drag and call.depth > 0.3]
    assert moving
    assert max(call.depth / 0.3 for call in moving) < 1 + 1.01 / 64
    plain = {call.depth for call in still} - {call.depth for call in moving}
    assert min(plain) > min(call.depth for call in moving)


@pytest.mark.parametrize(("target", "scale", "refused"), [(0.97, 1.0, False), (0.99, 1.0, True), (0.99, 0.5, False)])
def test_a_path_ends_before_the_cover_vanishes_unless_it_is_scaled(target, scale, refused):
    problem = Steps(lambda _call: {})
    object.__setattr__(problem, "load_scale", scale)
    told = []
    if not refused:
        assert follow(problem, target, progress=told.append).depth == target
        assert told[-1] == f"{40 * target / scale:.3g} N at {2 * target / scale:.3g} mm"
        return
    with pytest.raises(PathConvergenceError, match=r"beyond 3\d.\d N at 1.9\d mm: the indenter would touch") as stopped:
        follow(problem, target)
    depth = stopped.value.depth / 2e-3
    assert 0.97 < depth < 0.98
    assert stopped.value.load == pytest.approx(40 * depth)
