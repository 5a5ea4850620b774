"""Sums over made-up contacts, one at a time with matrices of numpy: every side of a box, pulls, torques, both cones."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fastmodel.contact.forces import FRONT, press_boxes, press_plate, share_shear, sum_contacts

GEOMS, PARTS = 7, 3  # geoms 1, 3 and 4 are parts 2, 0 and 1 of an array; its first one is geom 3
OWN = np.array([-1, 2, -1, 0, 1, -1, -1, -1])
TURN, MIDDLE = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix(), np.array([0.02, -0.03, 0.05])


def draw_scene(seed, contacts, *, pyramidal):
    """Random poses of geoms, and contacts among them in random frames; the first contact bears no force."""
    random = np.random.default_rng(seed)
    turns, places = Rotation.random(GEOMS, random_state=seed).as_matrix(), random.uniform(-0.1, 0.1, (GEOMS, 3))
    frames = Rotation.random(contacts, random_state=seed + 1).as_matrix()
    pairs = np.array(list(itertools.permutations(range(GEOMS), 2)))
    geom = pairs[random.permutation(len(pairs))[:contacts]]
    dim = random.choice([1, 3, 4, 6], contacts)
    rows = np.where(dim == 1, 1, 2 * (dim - 1) if pyramidal else dim)
    address = np.concatenate([[0], np.cumsum(rows)[:-1]])
    forces = random.uniform(-0.2, 1, rows.sum())
    address[0] = -1
    friction, pos, dist = (
        random.uniform(0.2, 1, (contacts, 5)),
        random.uniform(-0.1, 0.1, (contacts, 3)),
        random.uniform(-1e-3, 0, contacts),
    )
    contact = geom, address, dim, frames.reshape(-1, 9), friction, pos, dist, forces, pyramidal
    return contact, turns, places, random


def decode(contact, k):
    """Force and torque of a contact in its own frame, from the definition of the cones."""
    _, address, dim, _, friction, _, _, forces, pyramidal = contact
    own, local = forces[address[k] :], np.zeros(6)
    if pyramidal and dim[k] > 1:
        edges = own[: 2 * (dim[k] - 1)].reshape(-1, 2)
        local[0] = edges.sum()
        local[1 : dim[k]] = friction[k, : dim[k] - 1] * (edges[:, 0] - edges[:, 1])
    else:
        local[: dim[k]] = own[: dim[k]]
    return local


def touches_front(normal, beside):
    """By the normal away from the box: the front, or the side towards which it leans most, if a neighbour is there."""
    if normal[2] >= FRONT:
        return True
    axis = 0 if abs(normal[0]) > abs(normal[1]) else 1
    return normal[2] > -abs(normal[axis]) and beside[2 * axis + (normal[axis] > 0)]


def add_up(contact, turns, places, neighbours):
    """The sums of `sum_contacts`."""
    geom, address, _, frame, _, pos, _, _, _ = contact
    axes = turns[3] @ TURN.T  # of the array, from its first geom
    origin = places[3] - axes @ MIDDLE
    pressed, fronts, wrench, beside = np.zeros((len(geom), 2)), np.zeros((PARTS, 3)), np.zeros(6), 0.0
    for k, side in itertools.product(range(len(geom)), range(2)):
        part = OWN[geom[k, side]]
        if address[k] < 0 or part < 0:
            continue
        local, base, sign = decode(contact, k), frame[k].reshape(3, 3), (-1, 1)[side]
        force, torque, box = sign * local[:3] @ base, sign * local[3:] @ base, turns[geom[k, side]]
        wrench += np.append(force @ axes, (np.cross(pos[k] - origin, force) + torque) @ axes)
        if touches_front(-sign * base[0] @ box, neighbours[part]):
            pressed[k, side] = -force @ box[:, 2]
            fronts[part] += force @ box
        else:
            beside -= force @ box[:, 2]
    return pressed, fronts, wrench, beside


@pytest.mark.parametrize(("seed", "pyramidal"), [(0, False), (1, True), (2, False)])
def test_sums_over_contacts_are_those_of_single_forces_and_torques(seed, pyramidal):
    contact, turns, places, random = draw_scene(seed, 30, pyramidal=pyramidal)
    neighbours = random.uniform(size=(PARTS, 4)) < 0.5
    expected = add_up(contact, turns, places, neighbours)
    found = sum_contacts(contact, turns.reshape(-1, 9), places, (OWN, neighbours, 3, TURN, MIDDLE))
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
    assert (expected[0] != 0).any(axis=0).all()
    assert expected[3] != 0


@pytest.mark.parametrize("x", [-0.8, -0.3, 0.0, 0.3, 0.8])
@pytest.mark.parametrize("y", [-0.8, -0.3, 0.0, 0.3, 0.8])
def test_a_contact_with_a_side_counts_for_the_front_where_a_neighbour_is(x, y):
    """A contact of one newton on a box, with its normal at any height; the four sides in turn have a neighbour."""
    for z in (-1.0, -0.79, -0.31, -0.1, 0.0, FRONT - 1e-9, FRONT, 1.0):
        if not (x or y or z):
            continue
        normal = np.array([x, y, z])
        frame = np.append(-normal, np.zeros(6))[None]  # the force points away from the first geom; the box is second
        contact = (
            np.array([[0, 3]]), np.array([0]), np.array([1]), frame, np.ones((1, 5)), np.zeros((1, 3)), np.zeros(1),
            np.array([1.0]), False,
        )  # fmt: skip
        for side in range(5):
            neighbours = np.zeros((PARTS, 4), dtype=bool)
            neighbours[0] = np.arange(4) == side
            pressed, fronts, _, beside = sum_contacts(
                contact, np.tile(np.eye(3).ravel(), (GEOMS, 1)), np.zeros((GEOMS, 3)),
                (OWN, neighbours, 3, np.eye(3), np.zeros(3)),
            )  # fmt: skip
            front = touches_front(normal, neighbours[0])
            assert pressed[0].tolist() == [0, z if front else 0]
            assert fronts[0].tolist() == ([-x, -y, -z] if front else [0, 0, 0])
            assert beside == (0 if front else z)


@pytest.mark.parametrize("seed", range(4))
def test_a_pulled_box_has_no_force_and_the_others_keep_the_sum(seed):
    """The fourth scene pulls in total, and all forces vanish."""
    contact, turns, places, _ = draw_scene(seed, 25, pyramidal=False)
    if seed == 3:
        contact[7][:] *= -1
    neighbours = np.ones((PARTS, 4), dtype=bool)
    forces, carried, sums = press_boxes(contact, turns.reshape(-1, 9), places, (OWN, neighbours, 3, TURN, MIDDLE))
    expected = add_up(contact, turns, places, neighbours)
    signed = -expected[1][:, 2]
    positive = np.maximum(signed, 0)
    kept = positive * max(signed.sum(), 0) / max(positive.sum(), 1e-300)
    np.testing.assert_allclose(forces, kept, atol=1e-12)
    assert carried == pytest.approx(signed.sum() + expected[3])
    np.testing.assert_allclose(sums[2], expected[2], atol=1e-12)


def test_forces_on_a_plate_are_summed_by_body_with_their_moments_and_depth():
    contact, turns, places, _ = draw_scene(9, 42, pyramidal=True)
    number = np.full(GEOMS + 1, -1)
    number[3] = 0  # the plate is geom 3 alone
    body_of_geom = np.array([5, 5, 2, 0, -1, 7, 2, -1])  # geoms 0 and 1 are one body, 4 has no known shape
    sides = np.zeros((1, 4), dtype=bool)
    bodies, sums, owner, points, place, found = press_plate(
        contact, turns.reshape(-1, 9), places, (number, sides, 3, TURN, MIDDLE), body_of_geom
    )
    axes = turns[3] @ TURN.T
    np.testing.assert_allclose(place, np.vstack([axes, places[3] - axes @ MIDDLE]), atol=1e-12)
    geom, pos, dist = contact[0], contact[5], contact[6]
    force = found[0].sum(axis=1)
    touching = force.nonzero()[0]
    assert len(touching) >= 4
    other = np.where(geom[:, 0] == 3, geom[:, 1], geom[:, 0])[touching]
    local = (pos[touching] - place[3]) @ axes
    np.testing.assert_allclose(points, np.column_stack([local[:, :2], force[touching]]), atol=1e-12)
    named = np.where(owner < 0, -1, np.append(bodies, -1)[owner])
    np.testing.assert_array_equal(named, body_of_geom[other])
    assert sorted(bodies) == sorted(set(body_of_geom[other]) - {-1})
    for body, row in zip(bodies, sums, strict=True):
        mine = body_of_geom[other] == body
        expected = [(points[mine, 2] * each).sum() for each in (1, points[mine, 0], points[mine, 1])]
        np.testing.assert_allclose(row, [*expected, -dist[touching][mine].min()], atol=1e-12)


@pytest.mark.parametrize("margin", [0.0, 1.5])
def test_shear_is_shared_in_proportion_to_pressure_and_the_margin_takes_its_part(margin):
    random = np.random.default_rng(3)
    fronts, axes = random.uniform(-1, 1, (2, 3)), Rotation.random(2, random_state=1).as_matrix()
    contact_forces, tangents = np.array([0.5, 0.0, 1.25, -0.25]), random.normal(size=(4, 2, 3))
    fronts[:, 2] = [-0.9, -0.6 - margin]  # 1.5 N on the fronts and on the texels, or twice as much on the fronts
    found = share_shear(fronts, axes, contact_forces, tangents)
    shear = sum(turn[:, :2] @ front[:2] for front, turn in zip(fronts, axes, strict=True))
    shares = np.maximum(contact_forces, 0) / (1.5 + margin)
    np.testing.assert_allclose(found, shares[:, None] * (tangents @ shear), atol=1e-12)


def test_pressure_that_exceeds_the_normal_forces_is_the_measure_of_the_shear():
    """The solver of the pressure lets sums differ a little; the shear is not enlarged."""
    found = share_shear(
        np.array([[0.3, 0.0, -1.0]]), np.eye(3)[None], np.array([1.5, 0.5]), np.tile(np.eye(3)[:2], (2, 1, 1))
    )
    np.testing.assert_allclose(found, [[0.3 * 0.75, 0], [0.3 * 0.25, 0]])
