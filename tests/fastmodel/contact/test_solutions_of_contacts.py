"""Contacts compared with the solved one, and readings against solutions over all cells of the grid."""

import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fastmodel import CoverContact, Foundation
from fastmodel.contact.interface import Reading
from fastmodel.contact.reader import ArrayContact, Solved
from fastmodel.pressure.cell_grid import lay_out
from fastmodel.pressure.gap import BodyShape, PosedBody, Solid
from fastmodel.pressure.gap_kernels import ELLIPSOID
from fastmodel.pressure.solvers import CoverSolver, FoundationSolver, Load
from meshes import TexelArray
from tests.support.bent_array import bent_array
from tests.support.cover_data import WTS, cells
from tests.support.scenes import make_spec

EDGE = 0.7e-3
UP = np.array([[0.0, 0, 1]])
TURNS = np.array([[1.0, 0, 0], [0, 0.6, 0.8]])
CENTRES = np.array([[1e-3, 2e-3, 0.1e-3], [-3e-3, 4e-3, 0.2e-3]])
SIZES, DEPTH = (2e-3, 5e-3), 0.03e-3
SHAPE = BodyShape.of([Solid(ELLIPSOID, np.array([1e-3, 2e-3, 3e-3]), np.zeros((0, 4)), np.zeros(3), np.ones(3))])


def make_load(force, moment, turns):
    return Load(vector=np.array([0.1, 0.2, force]), moment=np.array(moment), directions=UP, turns=turns)


def make_solved(kept=(0, 1), points=()):
    """Of a guided body and one that is free to turn about two axes; with four modes."""
    random = np.random.default_rng(4)
    poses = tuple(
        PosedBody(
            shape=SHAPE, rotation=Rotation.random(1, random_state=k).as_matrix(), position=CENTRES[k : k + 1] * 1.5
        )
        for k in range(2)
    )
    loads = make_load(2.0, [1e-3, 2e-3, 3e-3], TURNS[:0]), make_load(3.0, [4e-3, -1e-3, 2e-3], TURNS)
    contact = ArrayContact(
        bodies=(4, 7),
        loads=loads,
        poses=poses,
        owner=np.zeros(0, dtype=int),
        touches=np.zeros((0, 3)),
        points=np.array(points, dtype=float).reshape(-1, 3),
        beside=0.0,
    )
    return Solved(
        contact=contact,
        kept=kept,
        reading=Reading(np.zeros(1), None, 5.0),
        modes=np.zeros((4, 1)),
        torques=np.zeros((4, 6)),
        layout=(),
        weights=random.uniform(0.2, 0.6, (4, 4)),
        centres=CENTRES,
        largest=np.array([1.0, 2.0, 0.7, 0.4]),
        depth=DEPTH,
        sizes=SIZES,
    )


def move(pose, number, shift, turn):
    """Turn a pose about the centre of its pressure, and shift it."""
    about = Rotation.from_rotvec(turn).as_matrix()
    place = (pose.position - CENTRES[number]) @ about.T + CENTRES[number] + shift
    return dataclasses.replace(pose, rotation=about @ pose.rotation, position=place)


@pytest.mark.parametrize(
    ("number", "shift", "turn", "moved"),
    [
        (0, (3e-6, 4e-6, 9e-6), (0, 0, 0), 5e-6 / SIZES[0]),
        (1, (3e-6, 4e-6, 9e-6), (0, 0, 0), 5e-6 / SIZES[1]),
        (0, (0, 0, 0), (0, 0, -2e-4), 2e-4),
        (1, (0, 3e-6, 0), (0, 0, 2e-4), 2e-4 + 3e-6 / SIZES[1]),
        (0, (0, 0, 0), (3e-5, 4e-5, 0), 5e-5 * SIZES[0] / DEPTH),
        (1, (0, 0, 0), (3e-5, -4e-5, 0), 0.05 * 5e-5 * SIZES[1] / DEPTH),
        (1, (3e-6, 0, 0), (3e-5, -4e-5, 1e-3), 1e-3 + 3e-6 / SIZES[1]),
    ],
)
def test_motions_count_ten_times_by_path_turn_and_tilt(number, shift, turn, moved):
    """A tilt counts by the change of the gap, and a twentieth of that for a body whose moments determine it."""
    solved = make_solved()
    poses = [*solved.contact.poses]
    poses[number] = move(poses[number], number, np.array(shift), turn)
    weights, missed, change = solved.compare(dataclasses.replace(solved.contact, poses=tuple(poses)), EDGE)
    assert change == pytest.approx(10 * moved, rel=1e-3)
    assert not weights.any()
    np.testing.assert_array_equal(missed, 0)


def test_changes_of_loads_weigh_the_modes_and_lack_torques_of_free_bodies():
    solved = make_solved()
    loads = make_load(2.01, [1.1e-3, 2.5e-3, 3e-3], TURNS[:0]), make_load(2.98, [4.2e-3, -1.3e-3, 2.1e-3], TURNS)
    weights, missed, change = solved.compare(dataclasses.replace(solved.contact, loads=loads), EDGE)
    moment = np.array([0.2e-3, -0.3e-3, 0.1e-3])
    changes = [0.01, -0.02, *(TURNS @ (moment - np.cross(CENTRES[1], [0, 0, -0.02])) / EDGE)]
    expected = solved.weights @ changes
    np.testing.assert_allclose(weights, expected, rtol=1e-9)
    np.testing.assert_allclose(missed, -TURNS.T @ TURNS @ moment, atol=1e-15)
    assert change == pytest.approx(np.abs(expected) @ solved.largest)


def list_bodies(solved, names):
    """A contact with some bodies, of which 9 is a third one with a contact point of 0.3 N."""
    known = dict(zip((4, 7), zip(solved.contact.loads, solved.contact.poses, strict=True), strict=True))
    known[9] = known[4]
    touches = np.array([[1e-3, 2e-3, 0.3]])[: 9 in names]
    return dataclasses.replace(
        solved.contact,
        bodies=tuple(names),
        loads=tuple(known[each][0] for each in names),
        poses=tuple(known[each][1] for each in names),
        owner=np.array([list(names).index(9)] if 9 in names else [], dtype=int),
        touches=touches,
        points=np.zeros((0, 3)),
    )


@pytest.mark.parametrize(
    ("kept", "points", "names", "same"),
    [
        ((0, 1), (), (4, 7), True),
        ((0, 1), (), (7, 4), False),
        ((0, 1), (), (4,), False),
        ((0, 1), (), (4, 7, 9), False),  # 9 was not there
        ((0, 2), [[1e-3, 2e-3, 0.3]], (4, 9, 7), True),  # 9 was a point force
        ((1, 2), [[1e-3, 2e-3, 0.3]], (9, 4, 7), True),
        ((1, 2), [[1e-3, 2e-3, 0.4]], (9, 4, 7), False),
        ((0, 2), [[1e-3, 2e-3, 0.3]], (4, 7), False),
        ((0, 1), [[1e-3, 2e-3, 0.3]], (4, 7, 9), True),
    ],
)
def test_bodies_that_were_left_out_are_compared_as_point_forces(kept, points, names, same):
    solved = make_solved(kept, points)
    weights, missed, change = solved.compare(list_bodies(solved, names), EDGE)
    assert (change == np.inf) == (not same)
    if same:
        assert change == pytest.approx(0, abs=1e-9)
        assert weights.shape == (4,)
    else:
        assert weights.shape == (0,)
    assert not missed.any()


SCENES = {
    "a large ball": [[("sphere", [25e-3], [0.4e-3, 0.3e-3, 0])]],
    "two balls of one body": [[("sphere", [6e-3], [-6e-3, 1e-3, 0]), ("sphere", [4e-3], [5e-3, -2e-3, 0.1e-3])]],
    "a ball and a block": [[("sphere", [9e-3], [-6e-3, 4e-3, 0])], [("box", [2e-3, 3e-3, 4e-3], [5e-3, -6e-3, 0])]],
}
METHODS = {"foundation": Foundation(modulus=3e7), "cover": CoverContact(tolerance=1e-7, steps=500)}


def press(method, array, scene, depth):
    """Bodies on slides, all of which reach the same depth below the top."""
    spec = make_spec(gravity=[0, 0, -30])
    method.attach(spec.worldbody.add_frame(), array, "pad")
    for geoms in scene:
        body = spec.worldbody.add_body()
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
        for kind, size, (x, y, z) in geoms:
            shape = {"type": getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"), "size": [*size, 0, 0][:3]}
            body.add_geom(pos=[x, y, z + size[-1] - depth], mass=0.1, condim=1, **shape)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    return model, data


def solve(name, reader, array, contact):
    """The solution over all cells under the bodies, by a solver of its own."""
    if name == "foundation":
        grid = lay_out(array, Foundation().plate.count_pitches(array), 4)
        solver = FoundationSolver(grid, 3e7, [grid.build_base_forces(cells(), array)])
    else:
        grid = lay_out(array, CoverContact().plate.count_pitches(array), 4, max(cells().compliance.shape))
        bases = [grid.build_base_forces(cells(), array)]
        solver = CoverSolver(cells(), grid, tolerance=1e-8, steps=2000, bases=bases)
    samples = reader.sample_gap(contact, [np.inf] * len(contact.bodies))
    solution = solver.solve(samples, contact.loads)
    contact_forces = grid.sum_on_texels(samples.row, samples.column, solution.forces)
    return samples, solution, contact_forces, solver.find_base_forces(solution.window, solution.origin)


@pytest.mark.parametrize(("scene", "bent"), [*((each, False) for each in SCENES), ("a large ball", True)])
@pytest.mark.parametrize("name", METHODS)
def test_the_cells_that_a_reading_takes_are_enough(name, scene, bent):
    """Cells are sampled up to a height that grows with the contact; the solution over all of them is the same."""
    array, method = bent_array() if bent else WTS, METHODS[name]
    model, data = press(method, array, SCENES[scene], 0.2e-3)
    reader = method.bind(model, array, "pad", surface=cells())
    reading, (contact, _) = reader.read(data), reader.find_contact(data)
    samples, solution, contact_forces, texel_forces = solve(name, reader, array, contact)
    load = solution.forces.sum()
    assert load > 0.3
    np.testing.assert_allclose(reading.contact_forces, contact_forces, atol=1e-5 * load)
    np.testing.assert_allclose(reading.texel_forces, texel_forces, atol=1e-5 * load)
    assert reading.carried == pytest.approx(load)
    torque = -np.cross(samples.place, solution.forces[:, None] * samples.normal).sum(axis=0)
    np.testing.assert_allclose(reading.torques, [*torque, 0, 0, 0], atol=1e-7 * load)
    pressed = np.bincount(samples.body, solution.forces > 0)
    assert abs(reading.fewest_cells - pressed.min()) <= 1
    if name == "cover" and not bent:
        np.testing.assert_allclose(reading.approach, solution.approach, rtol=1e-4)
    else:
        assert reading.approach is None


def test_a_second_reading_of_a_larger_contact_takes_more_cells():
    """A ball sinks deeper from reading to reading, and comes up again."""
    for name, method in METHODS.items():
        model, data = press(method, WTS, SCENES["a large ball"], 0.02e-3)
        reader, forces = method.bind(model, WTS, "pad", surface=cells()), data.efc_force.copy()
        for factor in (1.0, 5.0, 20.0, 0.5):
            data.efc_force[:] = factor * forces
            reading = reader.read(data)
            _, solution, contact_forces, _ = solve(name, reader, WTS, reader.find_contact(data)[0])
            np.testing.assert_allclose(reading.contact_forces, contact_forces, atol=2e-5 * solution.forces.sum())


def test_a_plate_with_a_part_of_the_texels_masked_reads_the_others():
    array = TexelArray.grid(14, 6, 3.4e-3, active=np.arange(84) % 3 != 1)
    model, data = press(METHODS["foundation"], array, SCENES["a large ball"], 0.1e-3)
    found, whole = (METHODS["foundation"].bind(model, each, "pad", surface=cells()).read(data) for each in (array, WTS))
    np.testing.assert_allclose(found.texel_forces, whole.texel_forces * array.active, atol=1e-12)
    np.testing.assert_allclose(found.contact_forces, whole.contact_forces, atol=1e-12)
