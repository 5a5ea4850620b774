"""Loads, contacts that change slightly, and the readings that are adapted to them."""

import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fastmodel
from fastmodel.contact.interface import Reading
from fastmodel.contact.reader import KEPT, ArrayContact, transform_poses
from fastmodel.pressure.solvers import SHIFT, TILT, Load, join_constraints
from tests.support.cover_data import WTS, cells
from tests.support.scenes import add_body, make_spec

E = np.eye(3)


def make_load(vector, moment, directions=((0, 0, 1),), turns=()):
    return Load(
        vector=np.array(vector, dtype=float),
        moment=np.array(moment, dtype=float),
        directions=np.array(directions, dtype=float),
        turns=np.array(turns, dtype=float).reshape(-1, 3),
    )


VECTOR = np.array([1.0, -2.0, 2.0])


@pytest.mark.parametrize(
    ("slides", "rotates", "first", "count", "turns"),
    [
        ([], False, VECTOR, 1, 0),  # held by nothing that is known: along the force
        ([], True, VECTOR, 3, 2),
        ([[0, 0, 1]], False, [0, 0, 1], 1, 0),
        ([[0, 0, -1]], False, [0, 0, 1], 1, 0),  # against the axis of the joint
        ([[1, 0, 0], [0, 0, 1]], False, [1, 0, 2], 2, 0),
        ([[1, 0, 0], [1, 0, 1]], False, [1, 0, 2], 2, 0),  # inclined axes of the same plane
        (E, False, VECTOR, 3, 0),
        ([[0, 0, 1]], True, VECTOR, 3, 2),
        ([[2, 1, 0.3]], False, VECTOR, 1, 0),  # only 8.9 % of the force act along the joint: it is left out
    ],
)
def test_a_load_acts_along_the_directions_in_which_the_body_is_free(slides, rotates, first, count, turns):
    slides = np.array(slides, dtype=float).reshape(-1, 3)
    slides = slides / np.linalg.norm(slides, axis=1, keepdims=True) if len(slides) else slides
    load = Load.along_free_directions(VECTOR, np.array([0.1, 0.2, 0.3]), slides, rotates=rotates)
    assert load.directions.shape == (count, 3)
    assert load.turns.shape == (turns, 3)
    np.testing.assert_allclose(load.directions @ load.directions.T, np.eye(count), atol=1e-12)
    np.testing.assert_allclose(load.directions[0], np.array(first) / np.linalg.norm(first), atol=1e-12)
    assert load.force == pytest.approx(VECTOR @ load.directions[0])
    np.testing.assert_allclose(load.directions[1:] @ VECTOR, 0, atol=1e-12)
    if turns:
        np.testing.assert_allclose(load.turns, load.directions[1:])
    if len(slides) and not rotates and count == len(slides):
        free = load.directions.T @ load.directions  # the projection on the free directions
        if count > 1 or first is not VECTOR:
            np.testing.assert_allclose(slides @ free, slides, atol=1e-12)


@pytest.mark.parametrize(("share", "along"), [(0.19, False), (0.21, True)])
def test_a_joint_across_the_force_is_left_out(share, along):
    slide = np.array([[np.sqrt(1 - share**2), 0, share]])
    load = Load.along_free_directions(np.array([0, 0, 3.0]), np.zeros(3), slide, rotates=False)
    np.testing.assert_allclose(load.directions[0], slide[0] if along else [0, 0, 1])


def test_a_load_on_a_plate_has_its_centre_where_force_and_moments_say():
    for tilts in (False, True):
        load = Load.on_plate(4.0, np.array([0.02, -0.012]), tilts=tilts)
        np.testing.assert_allclose(load.centre, [5e-3, -3e-3, 0])
        np.testing.assert_allclose(load.moment, np.cross([5e-3, -3e-3, 0], [0, 0, 4.0]), atol=1e-15)
        assert (load.force, len(load.turns)) == (4.0, 2 * tilts)
    place = np.array([[5e-3, -3e-3, 0], [1e-3, 2e-3, 0], [7e-3, -9e-3, 0]])
    columns, target, slack = load.build_constraints(place, np.tile([0, 0, 1.0], (3, 1)), 0.5e-3)
    away = (place[:, :2] - [5e-3, -3e-3]) / 0.5e-3
    np.testing.assert_allclose(columns, np.column_stack([np.ones(3), away]), atol=1e-12)
    np.testing.assert_allclose(target, [4, 0, 0], atol=1e-12)
    assert slack.tolist() == [0, TILT, TILT]


def test_forces_across_and_moments_may_be_missed_by_their_slacks():
    load = make_load([1, 0, 3], [0, 0, 0], directions=[[0, 0, 1], [1, 0, 0], [0, 1, 0]], turns=[[0, 1, 0]])
    place = np.random.default_rng(0).uniform(-1, 1, (5, 3))
    _, target, slack = load.build_constraints(place, np.tile([0, 0, 1.0], (5, 1)), 1.0)
    assert slack.tolist() == [0, SHIFT, SHIFT, TILT]
    np.testing.assert_allclose(target[:3], [3, 1, 0])


def test_constraints_of_several_bodies_stand_side_by_side():
    random = np.random.default_rng(1)
    place, normal = random.uniform(-1, 1, (6, 3)), np.tile([0, 0, 1.0], (6, 1))
    loads = [Load.on_plate(2.0, np.array([0.3, 0.1]), tilts=True), Load.on_plate(3.0, np.array([0, 0.4]), tilts=False)]
    owner = np.array([1, 0, 0, 1, -1, 0])
    (columns, target, slack), first = join_constraints(loads, owner, place, normal, 0.1, 7.0)
    assert first == [0, 3]
    expected, parts = np.zeros((6, 4)), []
    for body, load in enumerate(loads):
        own = (owner == body).nonzero()[0]
        part, *rest = load.build_constraints(place[own], normal[own], 0.1)
        expected[np.ix_(own, range(*((0, 3), (3, 4))[body]))] = part
        parts.append(rest)
    np.testing.assert_allclose(columns, expected)
    np.testing.assert_allclose(target, np.concatenate([each[0] for each in parts]))
    assert slack.tolist() == [0, 7 * TILT, 7 * TILT, 0]
    alone, at = join_constraints(loads[:1], np.zeros(6, dtype=int), place, normal, 0.1, 7.0)
    np.testing.assert_allclose(alone[0], loads[0].build_constraints(place, normal, 0.1)[0])
    assert (alone[2].tolist(), at) == ([0, 7 * TILT, 7 * TILT], [0])


def test_changes_of_a_load_are_those_of_force_and_moments_about_a_point():
    before = make_load([0, 1, 4], [0.1, 0.2, 0.3], turns=[[1, 0, 0], [0, 0.6, 0.8]])
    after = make_load([1, 3, 5], [0.4, 0.1, 0.9], turns=before.turns)
    centre = np.array([0.5, -1.0, 2.0])
    moment = (after.moment - np.cross(centre, after.vector)) - (before.moment - np.cross(centre, before.vector))
    expected = [1.0, *(before.turns @ moment / 0.25)]
    np.testing.assert_allclose(after.find_change(before, centre, 0.25), expected)
    held = make_load([0, 1, 4], [9, 9, 9])
    np.testing.assert_allclose(held.find_change(make_load([0, 0, 1], [1, 2, 3]), centre, 0.25), [3.0])
    missed = -before.turns.T @ before.turns @ (before.moment + np.array([1.0, -2, 3]))
    np.testing.assert_allclose(before.find_missed_torque(np.array([1.0, -2, 3])), missed)


def make_contact(points, width=3):
    return ArrayContact(
        bodies=(4, 7, 9),
        loads=tuple(make_load([0, 0, k], [0, 0, 0]) for k in (1, 2, 3)),
        poses=("a", "b", "c"),
        owner=np.array([2, 0, 1, 2, 0]),
        touches=np.arange(5 * width, dtype=float).reshape(5, width),
        points=np.array(points, dtype=float).reshape(-1, width),
        beside=0.5,
    )


def test_bodies_that_are_left_out_press_at_their_contact_points():
    contact = make_contact([[70, 80, 90]])
    found = contact.select([2, 0])
    assert found.bodies == (9, 4)
    assert found.poses == ("c", "a")
    assert [load.force for load in found.loads] == [3, 1]
    assert found.owner.tolist() == [0, 1, 0, 1]
    np.testing.assert_array_equal(found.touches, contact.touches[[0, 1, 3, 4]])
    np.testing.assert_array_equal(found.points, [[70, 80, 90], contact.touches[2]])
    assert found.beside == 0.5


@pytest.mark.parametrize(
    ("change", "equal"),
    [
        ([0, 0, 0], True),
        ([0.9e-8, 0, 0], True),
        ([0, -1.1e-8, 0], False),  # places may differ by 1e-5 of a length of 1 mm
        ([0, 0, 0.9e-5 * 6], True),  # and forces by 1e-5 of their sum
        ([0, 0, -1.1e-5 * 6], False),
    ],
)
@pytest.mark.parametrize("wide", [False, True])
def test_point_forces_are_equal_within_small_shares_of_length_and_force(wide, change, equal):
    rows = [[1e-3, 2e-3, 4.0], [3e-3, 1e-3, -2.0]]
    if wide:
        rows = [[x, y, 0, 0, 0, force] for x, y, force in rows]
        change = [*change[:2], 0, 0, 0, change[2]]
    width = len(rows[0])
    contact = make_contact(rows, width)
    moved = make_contact(np.array(rows) + np.array([np.zeros(width), change]), width)
    assert moved.has_points_of(contact, 1e-3) == equal
    assert not make_contact(rows[:1], width).has_points_of(contact, 1e-3)
    assert make_contact([], width).has_points_of(make_contact([], width), 1e-3)
    assert not make_contact([], width).has_points_of(contact, 1e-3)


def test_values_of_a_reading_change_by_their_own_parts():
    reading = Reading(np.array([1.0, 2.0]), np.array([3.0, 4.0]), 5.0, torques=np.arange(6.0))
    changed = reading.change(np.array([0.1, 0.2, 0.3, 0.4, 0.5]), np.ones(6))
    np.testing.assert_allclose(changed.contact_forces, [1.1, 2.2])
    np.testing.assert_allclose(changed.texel_forces, [3.3, 4.4])
    assert changed.carried == 5.5
    np.testing.assert_allclose(changed.torques, np.arange(6.0) + 1)
    bare = Reading(np.array([1.0, 2.0]), None, 5.0).change(np.array([0.1, 0.2, 0.5]), np.ones(6))
    np.testing.assert_allclose(bare.contact_forces, [1.1, 2.2])
    assert (bare.texel_forces, bare.torques, bare.carried) == (None, None, 5.5)


def test_poses_are_seen_from_the_array():
    turns = Rotation.random(4, random_state=3).as_matrix()
    places, axes, origin = np.random.default_rng(2).uniform(-1, 1, (4, 3)), turns[3], np.array([0.3, -0.2, 0.5])
    rotation, position = transform_poses(np.array([2, 0]), turns.reshape(-1, 9), places, np.vstack([axes, origin]))
    for k, geom in enumerate((2, 0)):
        np.testing.assert_allclose(rotation[k], axes.T @ turns[geom], atol=1e-12)
        np.testing.assert_allclose(position[k], axes.T @ (places[geom] - origin), atol=1e-12)


def build(contact, *, free):
    """Two blocks on a plate on a turned holder, which stand still or slide on guides; reader, model and data."""
    turn = Rotation.from_rotvec([0.2, -0.1, 0.4])
    spec = make_spec(timestep=2e-3, gravity=turn.apply([0.4, 0.3, -9.0]).tolist())
    holder = spec.worldbody.add_body(pos=[0.1, 0.2, 0.3], quat=turn.as_quat(scalar_first=True).tolist())
    contact.attach(holder.add_frame(), WTS, "pad")
    for x, mass in ((-5e-3, 0.1), (5e-3, 0.3)):
        joints = {} if free else {"slides": "z"}
        body = add_body(
            spec, "box", [3e-3, 4e-3, 3e-3], [x, 1e-3, 3e-3], parent=holder if not free else None, mass=mass, **joints
        )
        if free:
            body.pos = np.add(turn.apply([x, 1e-3, 3e-3]), [0.1, 0.2, 0.3])
            body.quat = turn.as_quat(scalar_first=True)
            body.add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 60)
    return model, data


METHODS = {"cover": fastmodel.CoverContact(tolerance=1e-6), "foundation": fastmodel.Foundation(modulus=1e9)}


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("name", METHODS)
def test_a_reading_that_is_adapted_equals_one_that_is_solved(name, free):
    """Forces of single contacts change by half a percent or less, so that loads and moments of both bodies change."""
    contact, random = METHODS[name], np.random.default_rng(5)
    model, data = build(contact, free=free)
    kept, fresh = (contact.bind(model, WTS, "pad", surface=cells()) for _ in range(2))
    first = kept.read(data)
    data.efc_force[:] *= random.uniform(0.995, 1.005, len(data.efc_force))
    found, exact = kept.read(data), fresh.read(data)
    assert kept.get_state()["change"] > 0  # since a contact was last solved
    assert fresh.get_state()["change"] == 0
    changed = np.abs(exact.contact_forces - first.contact_forces).sum()
    assert changed > 0.001
    assert np.abs(found.contact_forces - exact.contact_forces).sum() < 0.15 * changed
    changed = np.abs(exact.texel_forces - first.texel_forces).sum()
    assert np.abs(found.texel_forces - exact.texel_forces).sum() < 0.15 * changed
    assert found.carried == pytest.approx(exact.carried, rel=1e-6)
    np.testing.assert_allclose(found.wrench, exact.wrench, atol=1e-12)
    np.testing.assert_allclose(
        found.torques[:3], exact.torques[:3], atol=0.1 * np.ptp(exact.torques[:3] - first.torques[:3])
    )
    # what the pressure lacks of the torque of free bodies: both together are the torque of the contacts
    if free:
        sums = found.torques[:3] + found.torques[3:]
        np.testing.assert_allclose(sums, exact.torques[:3] + exact.torques[3:], atol=1e-9)
    else:
        np.testing.assert_array_equal(found.torques[3:], 0)


def test_a_contact_is_compared_by_loads_slides_turns_and_tilts():
    contact = METHODS["cover"]
    model, data = build(contact, free=False)
    reader = contact.bind(model, WTS, "pad", surface=cells())
    reader.read(data)
    solved, edge = reader._solved, reader._length
    last = solved.contact
    same = solved.compare(last, edge)
    np.testing.assert_allclose(same[0], 0, atol=1e-12)
    assert same[2] < 1e-12

    def change(number=1, *, scale=1.0, shift=(0, 0, 0), turn=(0, 0, 0)):
        pose, load = last.poses[number], last.loads[number]
        about = Rotation.from_rotvec(turn).as_matrix()
        centre = solved.centres[number]
        moved = dataclasses.replace(
            pose,
            rotation=about @ pose.rotation,
            position=(pose.position - centre) @ about.T + centre + np.array(shift),
        )
        loads = [*last.loads]
        loads[number] = dataclasses.replace(load, vector=scale * load.vector, moment=scale * load.moment)
        poses = [*last.poses]
        poses[number] = moved
        return solved.compare(dataclasses.replace(last, loads=tuple(loads), poses=tuple(poses)), edge)

    assert change(scale=1.02)[2] == pytest.approx(0.02, rel=1e-6)
    weights = change(scale=1.02)[0]
    assert weights == pytest.approx([0, 0.02], abs=1e-9)
    size = solved.sizes[1]
    assert change(shift=(2e-6, -1e-6, 5e-6))[2] == pytest.approx(10 * np.hypot(2e-6, 1e-6) / size, rel=1e-6)
    assert change(turn=(0, 0, 1e-4))[2] == pytest.approx(1e-3, rel=1e-4)
    assert change(turn=(1e-6, 0, 0))[2] == pytest.approx(10 * 1e-6 * size / solved.depth, rel=1e-3)
    assert change(shift=(2e-6, 0, 0), turn=(0, 0, 1e-4))[2] == pytest.approx(10 * (2e-6 / size + 1e-4), rel=1e-3)
    assert change(scale=1.05, shift=(1e-7, 0, 0))[2] == pytest.approx(0.05, rel=1e-6)
    swapped = dataclasses.replace(last, bodies=last.bodies[::-1])
    assert solved.compare(swapped, edge)[2] == np.inf
    pressed = dataclasses.replace(last, points=np.array([[0, 0, 1.0]]))
    assert solved.compare(pressed, edge)[2] == np.inf
    assert KEPT < 0.05  # which is solved anew
