"""Contact at the points of a surface: Coulomb's law at every point, and derivatives."""

from __future__ import annotations

import numpy as np
import pytest
import skfem

from fem_reference.elements.taylor_hood import prepare_elements
from fem_reference.finite_strain import contact as surface_contact
from fem_reference.finite_strain.contact import NormalContact, SurfaceContact, TopPoints
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from meshes import Box
from tests.support.rubber import make_solid


def block(friction):
    """The top of a small block under a flat face that is wider than it."""
    elements = prepare_elements(skfem.MeshHex().refined(1))
    surface = IndenterSurface(indenter=Box(size=(10.0, 10.0, 1.0)), fillet=0.1)
    return elements, SurfaceContact(elements, 1.0, surface, penalty=50.0, friction=friction)


def test_without_slip_the_tangent_is_the_derivative_of_the_force():
    elements, contact = block(np.inf)
    rng = np.random.default_rng(1)
    size = elements.displacements + elements.pressures
    state, way = 1e-2 * rng.standard_normal(size), rng.standard_normal(size)
    depth, step = 0.2, 1e-6
    found = contact.evaluate(state, depth)
    ahead, behind = (contact.evaluate(state + sign * step * way, depth) for sign in (1, -1))
    change = (ahead.force - behind.force) / (2 * step)
    assert change == pytest.approx(found.tangent @ way, abs=1e-6 * np.abs(change).max())
    deeper, higher = (contact.evaluate(state, depth + sign * step) for sign in (1, -1))
    assert (deeper.force - higher.force) / (2 * step) == pytest.approx(
        found.depth_force, abs=1e-6 * np.abs(found.depth_force).max()
    )
    assert (deeper.total - higher.total) / (2 * step) == pytest.approx(found.stiffness, rel=1e-6)


@pytest.mark.parametrize("friction", [0.05, 0.4])
def test_no_traction_leaves_the_cone_and_sliding_points_lie_on_it(friction):
    elements, contact = block(friction)
    state = np.zeros(elements.displacements + elements.pressures)
    moved = state[: elements.displacements].reshape(-1, 3)
    moved[:, 0] = 12 * elements.nodes[:, 0]  # stretched along x: points far from x = 0 slide
    assert contact.update_cone(contact.evaluate(state, 0.2)) == pytest.approx(1)
    touch = contact.evaluate(state, 0.2)
    assert contact.update_cone(touch) == 0
    drag, limit = np.linalg.norm(touch.traction, axis=-1), friction * touch.pressure
    assert (drag <= limit * (1 + 1e-12)).all()
    slid = surface_contact.TANGENTIAL_PENALTY * touch.position[..., 0] * 12 / 13 > friction * 0.2
    assert (slid == ~touch.sticking).all()
    assert slid.any()
    assert drag[slid] == pytest.approx(limit[slid])
    assert (touch.traction[..., 0] >= 0).all(), "friction must hold back: the residual pulls against the slip"
    assert np.abs(touch.traction[..., 1:]).max() == 0


def test_a_point_that_sticks_is_pulled_back_to_where_it_stuck():
    elements, contact = block(np.inf)
    state = np.zeros(elements.displacements + elements.pressures)
    state[: elements.displacements].reshape(-1, 3)[:, 0] = 0.1
    first = contact.evaluate(state, 0.2)
    contact.record_slip(first)
    again = contact.evaluate(state, 0.2)
    assert again.traction == pytest.approx(2 * first.traction)  # held where it stuck: pulled back to there
    moved = state[: elements.displacements].reshape(-1, 3)
    moved[:, 0] = 0
    assert contact.evaluate(state, 0.2).traction == pytest.approx(first.traction)


def test_pressures_along_normals_hold_back_a_surface_of_any_slope():
    """Displacements along a slanted top change no gap, one along the normal changes it, and the pressure acts along it.

    Gaps and overlaps are lengths along the normal over its vertical component, areas are those across the motion, so
    that the vertical force is the sum of penalty, overlap and area, and the horizontal one follows from the slope.
    """
    elements = prepare_elements(skfem.MeshHex().refined(1))
    surface = IndenterSurface(indenter=Box(size=(10.0, 10.0, 1.0)), fillet=0.1)
    points = TopPoints.on_plane(elements, 1.0)
    normal, gap, depth = np.array([0.48, -0.36, 0.8]), 0.05, 0.2
    contact = NormalContact(
        lambda depth: np.full(points.weight.shape, gap - depth),
        np.broadcast_to(normal, points.position.shape),
        elements, 1.0, surface, penalty=50.0, points=points,
    )  # fmt: skip

    def press(displacement):
        state = np.zeros(elements.displacements + elements.pressures)
        state[: elements.displacements].reshape(-1, 3)[:] = displacement
        return contact.evaluate(state, depth)

    for along, out in ((0.0, 0.0), (0.3, 0.0), (0.3, 0.04), (-0.2, -0.07)):
        found = press(along * np.array([0.6, 0.8, 0.0]) + out * normal)
        overlap = depth - gap + out / 0.8
        assert found.gap == pytest.approx(np.full_like(points.weight, -overlap))
        assert found.total == pytest.approx(50.0 * overlap * points.weight.sum())
        forces = found.force[: elements.displacements].reshape(-1, 3).sum(axis=0)
        assert forces == pytest.approx(50.0 * overlap * points.weight.sum() * normal / 0.8)
    assert press(-0.5 * normal).total == 0


@pytest.mark.parametrize(("pressure", "factor"), [(0.0, 1.0), (9.0, 1.0), (25.0, 2.5)])
def test_the_penalty_grows_with_pressures_above_ten_moduli_unless_there_is_friction(pressure, factor):
    for friction, expected in ((0.0, factor), (0.3, 1.0)):
        elements, contact = block(friction)
        state = np.zeros(elements.displacements + elements.pressures)
        plain = contact.evaluate(state, 0.2).total
        contact.stiffen(60.0)
        contact.stiffen(pressure)
        assert contact.evaluate(state, 0.2).total == pytest.approx(expected * plain)


@pytest.mark.parametrize(
    ("gaps", "ahead"),
    [
        ((0.05, 0.02), 0.02 / 0.3),  # the gap closes by 0.3 per depth
        ((0.05, 0.049), 0.2),  # no more than twice the last step
        ((0.05, 0.06), 0.0),  # it opens
    ],
)
def test_a_point_first_touches_where_its_motion_leads(gaps, ahead):
    """A flat indenter at the depths 0.1, 0.2 and 0.3; the top moves along x by 0, 0.03 and 0.07 meanwhile."""
    elements, contact = block(np.inf)

    def move(depth, along, gap):
        state = np.zeros(elements.displacements + elements.pressures)
        state[: elements.displacements].reshape(-1, 3)[:] = [along, 0.0, -gap - depth]
        return contact.evaluate(state, depth)

    for depth, along, gap in ((0.1, 0.0, gaps[0]), (0.2, 0.03, gaps[1])):
        found = move(depth, along, gap)
        assert found.gap == pytest.approx(np.full_like(found.gap, gap))
        contact.record_slip(found)
    touched = move(0.3, 0.07, -0.05)
    predicted = 0.03 + ahead * 0.03 / 0.1
    normal = touched.pressure / 0.05
    assert touched.traction[..., 0] == pytest.approx(normal * (0.07 - predicted))
    assert np.abs(touched.traction[..., 1:]).max() < 1e-12


def test_pressures_are_predicted_from_a_gap_that_is_linear():
    """Under a flat face the gap is linear, so that the prediction is exact; tension is none."""
    elements, contact = block(0.0)
    rng, size = np.random.default_rng(5), elements.displacements + elements.pressures
    one, other = 0.05 * rng.standard_normal((2, size))
    contact.augment(3.0 * rng.standard_normal(contact.weight.shape))
    before = contact.evaluate(one, 0.1)
    for depth in (0.02, 0.25):
        expected = contact.evaluate(other, depth).pressure
        assert 0 < (expected > 0).mean() <= 1
        assert contact.predict_pressure(before, other, depth) == pytest.approx(expected)


@pytest.mark.parametrize("kind", ["block", "ring"])
def test_volumes_are_predicted_to_first_order(kind):
    """An even stretch of 1.1, 0.9 and 1.2 that changes by 0.01, 0.02 and -0.03; a ring stretches evenly around."""
    solid = make_solid(kind, direct=3.0)
    elements = solid.elements
    stretch, change = np.array([1.1, 0.9, 1.2]), np.array([0.01, 0.02, -0.03])
    if kind == "ring":
        stretch, change = stretch[:2], change[:2]

    def extend(factors):
        state = np.zeros(elements.displacements + elements.pressures)
        state[: elements.displacements] = (elements.nodes * (factors - 1)).ravel()
        return state

    found = solid.predict_volume(extend(stretch), extend(stretch + change))
    # Around the axis the hoop stretches as the radius does.
    factors, more = (np.append(each, each[0]) if kind == "ring" else each for each in (stretch, change))
    exact = factors.prod() * (1 + (more / factors).sum()) - 1
    assert found == pytest.approx(np.full(elements.weight.shape, exact))
    assert make_solid(kind).predict_volume(extend(stretch), extend(stretch)) is None
