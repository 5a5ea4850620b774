"""Contact with friction on few cells: springs with known forces, events one by one, and projection sweeps."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from fem_reference.linear_response.vector_compliance import VectorCompliance
from fem_reference.small_strain_contact.friction_cells import RubbingContact, SlipAxes, VectorOperator, is_cut_off
from tests.support.rubber import stack_layers

COVER = stack_layers((1e-3, 1e6, 0.2))


class Matrix:
    """Compliance of few cells by a matrix over components and cells, the component first."""

    def __init__(self, matrix):
        self.matrix, count = matrix, len(matrix) // 3
        self.own = float(np.diag(matrix)[count:].mean())

    def displace(self, traction):
        return (self.matrix @ traction.ravel()).reshape(traction.shape)

    def precondition(self, residual):
        return residual / np.diag(self.matrix).reshape(residual.shape) * self.matrix.max()


def couple(count, seed, share=0.25):
    """A positive definite compliance of cells that move one another."""
    loose = np.random.default_rng(seed).uniform(-1, 1, (3 * count, 3 * count))
    stiff = np.repeat([2.0, 1.4, 1.4], count)
    return np.diag(stiff) + share * (loose + loose.T) / np.sqrt(count)


def springs(normal, tangential, count):
    return Matrix(np.diag(np.repeat([normal, tangential, tangential], count)))


def chain(state):
    """The states from the first step on."""
    out = []
    while state.before is not None:
        out.append(state)
        state = state.before
    return out[::-1]


#: Heights over a touch, and motion of six cells on springs; the last one is beyond the indenter.
HEIGHT = np.array([[0.0, 0.1, 0.2], [0.9, 0.3, np.inf]])
MOTION = np.array([
    [[1.0, 0.8, 0.6], [1.0, 0.9, 1.0]],
    [[0.1, 0.6, -0.64], [0.0, 0.0, 0.0]],
    [[-0.2, 0.0, 0.48], [0.0, -0.1, 0.0]],
])  # fmt: skip
NORMAL, TANGENTIAL, TOUCH = 0.5, 0.4, 2.0


def press_springs(friction, steps=4, load=None, depth=0.7):
    contact = RubbingContact(
        gap=lambda travel: HEIGHT - (travel - TOUCH) * MOTION[0],
        motion=MOTION,
        compliance=springs(NORMAL, TANGENTIAL, 6),
        area=3.0,
        friction=friction,
    )
    return contact, contact.follow(TOUCH, depth, steps, load)


def expect_springs(depth, friction):
    """Pressure and shear of independent springs, which stick or slide from their first touch on."""
    overlap = np.maximum(depth * MOTION[0] - HEIGHT, 0.0)
    pressure, shear = overlap / NORMAL, overlap / MOTION[0] * MOTION[1:] / TANGENTIAL
    size = np.maximum(np.hypot(*shear), 1e-200)
    return np.concatenate([pressure[None], shear * np.minimum(1.0, np.minimum(friction, 1e9) * pressure / size)])


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.3, 0.6, np.inf])
@pytest.mark.parametrize("steps", [1, 4])
def test_springs_bear_what_their_overlap_says(friction, steps):
    _, state = press_springs(friction, steps)
    for each in chain(state):
        exact = expect_springs(each.travel - TOUCH, friction)
        np.testing.assert_allclose(each.traction, exact, atol=1.1e-3 * exact.max())
        np.testing.assert_array_equal(each.touching, exact[0] > 0)
        np.testing.assert_allclose(
            each.moved, exact * np.array([NORMAL, TANGENTIAL, TANGENTIAL])[:, None, None], atol=1e-3
        )
        with np.errstate(invalid="ignore"):
            first = -(TOUCH + HEIGHT / MOTION[0]) * MOTION[1:]
        sticks = (exact[0] > 0) & (np.hypot(*exact[1:]) < min(friction, 1e9) * exact[0])
        np.testing.assert_allclose(each.record[:, sticks], first[:, sticks], atol=1e-6)
        slid = each.touching & ~sticks
        np.testing.assert_allclose(
            each.record[:, slid], (each.moved[1:] - each.travel * MOTION[1:])[:, slid], atol=1e-9
        )


def test_the_travel_grows_with_the_square_of_the_steps_from_first_touch():
    _, state = press_springs(0.3, 5)
    assert [each.travel for each in chain(state)] == pytest.approx([TOUCH + 0.7 * (n / 5) ** 2 for n in range(1, 6)])


@pytest.mark.parametrize("friction", [0.05, np.inf])
@pytest.mark.parametrize("depth", [0.09, 0.35, 0.7, 1.1])
def test_a_load_leads_to_the_depth_that_bears_it(friction, depth):
    exact = expect_springs(depth, friction)
    load = 3.0 * (exact * MOTION).sum()
    contact, state = press_springs(friction, load=load)
    assert contact.measure_load(state) == pytest.approx(load, rel=2e-3)
    assert state.travel - TOUCH == pytest.approx(depth, rel=2e-3)
    np.testing.assert_allclose(state.traction, exact, atol=3e-3 * exact.max())


@pytest.mark.parametrize(("friction", "accuracy"), [(0.0, 1e-5), (50.0, 3e-3), (np.inf, 1e-5)])
def test_a_cell_is_held_where_it_touched_at_the_time_of_its_touch(friction, accuracy):
    """The first cell moves the second one before it touches, evenly over several steps; the third one stays open."""
    count, depth, matrix = 3, 1.0, couple(3, 5)
    motion = np.array([[1.0, 0.8, 0.9], [0.1, 0.3, 0.0], [-0.1, 0.2, 0.3]])
    height = np.array([0.0, 0.35, 4.0])
    contact = RubbingContact(
        gap=lambda travel: (height - travel * motion[0])[:, None],
        motion=motion[..., None],
        compliance=Matrix(matrix),
        area=1.0,
        friction=friction,
    )
    state = contact.follow(0.0, depth, 4)
    held = [0] if friction == 0 else [0, 1, 2]
    first, second = ([count * k + cell for k in held] for cell in (0, 1))
    rate = matrix[:, first] @ np.linalg.solve(matrix[np.ix_(first, first)], motion[held, 0])
    touch = height[1] / (motion[0, 1] - rate[1])
    assert 0.25 < touch < 0.56  # in the third step of four, after two at the same rate
    start = rate[[count + 1, 2 * count + 1]] * touch - touch * motion[1:, 1]
    both = first + second
    wanted = np.array([*motion[held, 0], motion[0, 1] - height[1], *(start + motion[1:, 1])])[: len(both)]
    exact = np.zeros(3 * count)
    exact[both] = np.linalg.solve(matrix[np.ix_(both, both)], wanted)
    assert exact[0] > 0 < exact[1]
    np.testing.assert_allclose(state.traction.ravel(), exact, atol=accuracy * exact.max())
    assert state.touching.ravel().tolist() == [True, True, False]
    if friction > 0:
        np.testing.assert_allclose(state.record[:, 1, 0], start, atol=1e-3 * np.abs(start).max())


def sweep(matrix, goal, friction, sweeps=400):
    """Solve one step of a contact with friction by projections of one cell after the other (Moreau 1988)."""
    count = len(matrix) // 3
    traction = np.zeros(3 * count)
    for _ in range(sweeps):
        for cell in range(count):
            first, second = count + cell, 2 * count + cell
            traction[cell] = max(0.0, traction[cell] + (goal[cell] - matrix[cell] @ traction) / matrix[cell, cell])
            trial = traction[[first, second]] + (goal - matrix @ traction)[[first, second]] / 2.0
            limit, size = friction * traction[cell], np.linalg.norm(trial)
            traction[[first, second]] = trial * (limit / size if size > limit else 1.0)
    return traction


@pytest.mark.parametrize("friction", [pytest.param(0.1, marks=pytest.mark.slow), 0.25, 0.5])
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_cells_stick_and_slide_as_projection_sweeps_say(friction, seed):
    """The overlap of each cell grows at its own changing rate, so that cells slide on, turn, and stick again."""
    count, steps, matrix, rng = 6, 4, couple(6, seed, 0.4), np.random.default_rng(seed)
    motion = np.concatenate([np.ones((1, count)), rng.uniform(-0.7, 0.7, (2, count))])
    bend = rng.uniform(-0.45, 0.45, count)

    def overlap(travel):
        return travel * (1 + bend * travel)

    contact = RubbingContact(
        gap=lambda travel: -overlap(travel).reshape(2, 3),
        motion=motion.reshape(3, 2, 3),
        compliance=Matrix(matrix),
        area=1.0,
        friction=friction,
    )
    record, stuck, slid = np.zeros((2, count)), 0, 0
    for each in chain(contact.follow(0.0, 1.0, steps, first=np.ones((2, 3), dtype=bool))):
        goal = np.concatenate([overlap(each.travel), (record + each.travel * motion[1:]).ravel()])
        exact = sweep(matrix, goal, friction)
        np.testing.assert_allclose(each.traction.ravel(), exact, atol=4e-3 * exact.max())
        moved = (matrix @ exact).reshape(3, count)
        pressure, *shear = exact.reshape(3, count)
        slides = np.hypot(*shear) > friction * pressure * (1 - 1e-6)
        slip = moved[1:] - each.travel * motion[1:] - record
        assert (np.sum(slip * shear, axis=0)[slides] <= 1e-9).all()
        record = np.where(slides, record + slip, record)
        np.testing.assert_allclose(each.record.reshape(2, count), record, atol=1e-2)
        stuck, slid = stuck + (~slides & (pressure > 0)).sum(), slid + slides.sum()
    assert slid > 0
    assert stuck > 0 or friction < 0.5


def test_axes_turn_to_the_shear_and_soften_across_it():
    rng = np.random.default_rng(3)
    shear, values, softness = rng.normal(size=(2, 2, 3)), rng.normal(size=(3, 2, 3)), rng.uniform(0, 5, (2, 3))
    shear[:, 1, 2] = 0.0
    axes = SlipAxes.of(springs(0.7, 0.7, 6), shear, softness)
    turned = axes.turn_to(np.concatenate([values[:1], shear]))
    np.testing.assert_allclose(turned, [values[0], np.hypot(*shear), 0 * softness], atol=1e-12)
    np.testing.assert_allclose(axes.turn_from(axes.turn_to(values)), values, atol=1e-12)
    np.testing.assert_allclose(axes.turn_to(values)[:, 1, 2], values[:, 1, 2])
    moved = axes.displace(values)
    np.testing.assert_allclose(moved, values * [0.7 + 0 * softness, 0.7 + 0 * softness, 0.7 + softness])
    # On equal springs the preconditioner is the inverse, up to a factor.
    np.testing.assert_allclose(axes.precondition(moved), values * 0.7, atol=1e-12)


@pytest.mark.parametrize("base", ["bonded", "sliding"])
@pytest.mark.parametrize(
    "shape", [(4, 3), pytest.param((2, 5), marks=pytest.mark.slow), pytest.param((1, 1), marks=pytest.mark.slow)]
)
def test_cells_move_by_the_sum_over_all_pairs(base, shape):
    layer, cell = VectorCompliance.tabulate(replace(COVER, base=base), 4e-3), (0.3e-3, 0.5e-3)
    i, j = np.indices(shape)
    x, y = i.ravel() * cell[0], j.ravel() * cell[1]
    pairs = layer.average_over_cells(x[:, None] - x, y[:, None] - y, *cell)
    traction = np.random.default_rng(0).normal(size=(3, *shape))
    exact = np.einsum("abpq,bq->ap", pairs, traction.reshape(3, -1)).reshape(3, *shape)
    operator = VectorOperator(layer, shape, cell)
    np.testing.assert_allclose(operator.displace(traction), exact, atol=1e-10 * np.abs(exact).max())
    assert operator.own == pytest.approx((pairs[1, 1, 0, 0] + pairs[2, 2, 0, 0]) / 2)
    # More compliance is told forces, and adds displacements.
    added = VectorOperator(layer, shape, cell, lambda force: 1e-3 * force[::-1]).displace(traction)
    np.testing.assert_allclose(added - exact, 1e-3 * 0.15e-6 * traction[::-1], atol=1e-10 * np.abs(exact).max())
    if shape == (1, 1):
        # One cell has one wave: the preconditioner is the inverse, over its largest value.
        least = np.linalg.eigvalsh(pairs[..., 0, 0]).min()
        np.testing.assert_allclose(operator.precondition(exact), least * traction, rtol=1e-9)


def test_a_preconditioner_is_positive_definite():
    operator = VectorOperator(VectorCompliance.tabulate(COVER, 4e-3), (6, 4), (0.2e-3, 0.3e-3))
    one, other = np.random.default_rng(1).normal(size=(2, 3, 6, 4))
    assert (one * operator.precondition(other)).sum() == pytest.approx((other * operator.precondition(one)).sum())
    assert (one * operator.precondition(one)).sum() > 0
    # The residual of cells that all move alike is nearly undone.
    moved = operator.displace(one)
    again = operator.precondition(moved)
    assert np.vdot(again, one) > 0.6 * np.linalg.norm(again) * np.linalg.norm(one)


@pytest.mark.parametrize("cell", [(0, 2), (4, 2), (2, 0), (2, 3), (2, 2), (1, 1)])
def test_a_contact_is_cut_off_at_edges_beyond_which_there_may_be_more(cell):
    touching = np.zeros((5, 4), dtype=bool)
    touching[2, 2] = touching[cell] = True
    at = {"below": (cell[0] == 0, cell[1] == 0), "above": (cell[0] == 4, cell[1] == 3)}
    for below in product((False, True), repeat=2):
        for above in product((False, True), repeat=2):
            expected = any(a and b for a, b in zip((*at["below"], *at["above"]), (*below, *above), strict=True))
            assert is_cut_off(touching, np.array(below), np.array(above)) is expected
