"""Contacts that are carried along with their bodies: equal to a solution where they are."""

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel.contact.plate import Touching
from fastmodel.pressure.base_forces import BaseForces
from fastmodel.pressure.conjugate_gradient import CoverSolver, Settings
from fastmodel.pressure.gap import solid
from fastmodel.pressure.gap_sampling import Load, Shape, sample
from fastmodel.pressure.reused_contact import Held, Laid, _apart, _apart_loops
from fastmodel.pressure.winkler import foundation_forces
from meshes import Box, Cylinder, LetterH, Sphere
from tests.support.cover_data import WTS, cells, parameters
from tests.support.gap_samples import GRID, standing

CELLS = cells()
BASE = BaseForces(CELLS, GRID, WTS)
CELL = CELLS.cell[0]
NEXT = CELL * (1 - 1e-9)
DISC = Cylinder(radius=5e-3)
MOMENT = np.zeros(2)


def touching(shape, *, at=(0.3e-3, -0.4e-3), yaw=0.0, load=3.0, off=None, body=1):
    """A shape that presses at its middle, or so far off it where it is free to tilt."""
    moment = load * (np.array(at) + (0 if off is None else off))
    loads = (Load(force=load, moment=moment, tilts=off is not None),)
    return Touching(bodies=(body,), loads=loads, standing=(standing(shape, at=at, yaw=yaw, edge=0.125 * CELL),))


def held(touch, method="cover", *, native=False):
    samples = sample(GRID, touch.standing, [2e-3])
    if method == "foundation":
        forces, levels = foundation_forces(samples, touch.loads, 2e9 * CELL**2 * samples.coverage)
        return Held(touch, samples, Laid(forces, levels), GRID, None, reach=[2e-3], flat=True, native=native)
    found = CoverSolver(CELLS, GRID, Settings(tolerance=1e-9, steps=2000)).solve(samples, touch.loads)
    laid = Laid(found.forces, found.level, found.approach, found.on_cells, found.origin)
    return Held(touch, samples, laid, GRID, BASE, reach=[2e-3], flat=True, native=native)


def misplaced(one, other):
    return 0.5 * np.abs(one - other).sum() / other.sum()


@pytest.mark.parametrize("method", ["cover", "foundation"])
@pytest.mark.parametrize("shape", [Box(size=(12e-3, 7e-3, 5e-3)), LetterH(size=(12e-3, 16e-3), bar=4e-3)])
def test_slid_by_a_whole_cell_it_is_the_solution_there(shape, method):
    for way in ((NEXT, 0), (0, -NEXT)):
        there = touching(shape, at=(0.3e-3 + way[0], -0.4e-3 + way[1]), load=3.006)
        carried, solved = held(touching(shape), method).carry(there), held(there, method).reading
        np.testing.assert_allclose(carried.contact_forces, solved.contact_forces, atol=1e-7)
        assert carried.carried == pytest.approx(3.006)
        if method == "cover":
            np.testing.assert_allclose(carried.texel_forces, solved.texel_forces, atol=1e-7)


@pytest.mark.parametrize("shape", [Box(size=(12e-3, 7e-3, 5e-3)), DISC, Sphere(radius=5e-3)])
def test_between_cells_it_is_the_solution_there_up_to_what_cells_cost(shape):
    start = held(touching(shape))
    for way in ((0.5 * CELL, 0.0), (-0.3 * CELL, 0.7 * CELL)):
        there = touching(shape, at=(0.3e-3 + way[0], -0.4e-3 + way[1]))
        carried, solved = start.carry(there), held(there).reading
        assert carried.contact_forces.min() >= 0
        assert carried.contact_forces.sum() == pytest.approx(3)
        assert misplaced(carried.texel_forces, solved.texel_forces) < 0.02


def test_the_way_to_the_base_knows_nothing_of_cells():
    """Cell forces that have slid by part of a cell arrive as through the influence at the places in between."""
    from scipy.special import erf

    start, part = held(touching(DISC)), np.array([0.3, -0.6])
    window = start._laid.on_cells(start._laid.forces)
    expected = window
    for axis, (low, count) in enumerate(zip(GRID.low[::-1], (14, 6), strict=True)):
        place = low + (start._laid.origin[axis] + np.arange(window.shape[axis]) + 0.5 + part[axis]) * CELL
        texel = WTS.image(WTS.centres[:, 1 - axis])[(slice(None), 0) if axis == 0 else (0, slice(None))]
        assert len(texel) == count
        apart, half = texel[:, None] - place, WTS.texel_size[0] / 2
        factor = 0.5 * (erf((half - apart) / (np.sqrt(2) * 1e-3)) + erf((half + apart) / (np.sqrt(2) * 1e-3)))
        expected = np.tensordot(factor, expected, (1, axis)).T if axis == 0 else np.tensordot(expected, factor, (0, 1))
    slid = touching(DISC, at=(0.3e-3 + part[1] * CELL, -0.4e-3 + part[0] * CELL))
    found = WTS.image(start.carry(slid).texel_forces)
    np.testing.assert_allclose(found, expected, atol=2e-3 * found.max())


def test_a_disc_leans_as_it_is_solved():
    start = held(touching(DISC, off=np.zeros(2)))
    for off in (np.array([0.1e-3, 0.0]), np.array([0.04e-3, -0.06e-3])):
        there = touching(DISC, off=off)
        carried, solved = start.carry(there), held(there).reading
        assert misplaced(carried.texel_forces, solved.texel_forces) < 0.1 * misplaced(
            start.reading.texel_forces, solved.texel_forces
        )


def test_what_it_carries_are_the_forces_and_moments_given():
    start = held(touching(DISC, off=np.zeros(2)))
    off = np.array([0.04e-3, -0.06e-3])
    seen = []
    start._read = lambda forces: seen.append(forces) or start.reading
    start.carry(touching(DISC, off=off, load=3.01))
    x, y = start.samples.x, start.samples.y
    np.testing.assert_allclose(
        [seen[0].sum(), seen[0] @ x, seen[0] @ y], 3.01 * np.array([1, 0.3e-3 + off[0], -0.4e-3 + off[1]]), rtol=1e-9
    )


@pytest.mark.parametrize("native", [False, True], ids=["numpy", "numba"])
def test_what_changes_more_is_solved(native):
    if native:
        pytest.importorskip("numba")
    box = Box(size=(12e-3, 7e-3, 5e-3))
    start = held(touching(box, off=np.zeros(2)), native=native)
    x, y = 0.3e-3, -0.4e-3
    assert start.carry(touching(box, off=np.zeros(2), at=(x + 0.5 * CELL, y))) is not None
    for other in (
        touching(box, off=np.zeros(2), at=(x + 1.2 * CELL, y)),
        touching(box, off=np.zeros(2), yaw=0.02),
        touching(box, off=np.zeros(2), load=3.1),
        touching(box, off=np.array([0.5e-3, 0])),
        touching(box, off=np.zeros(2), body=2),
    ):
        assert start.carry(other) is None
    edge = GRID.low[0] + 6.2e-3
    assert held(touching(box, at=(edge, y))).carry(touching(box, at=(edge - 0.5 * CELL, y))) is None


@pytest.mark.parametrize("native", [False, True], ids=["numpy", "numba"])
def test_round_bodies_may_turn_about_what_they_are_round_about(native):
    if native:
        pytest.importorskip("numba")
    for shape, same in ((DISC, True), (Sphere(radius=5e-3), True), (Box(size=(9e-3, 9e-3, 5e-3)), False)):
        carried = held(touching(shape), native=native).carry(touching(shape, yaw=0.3))
        assert (carried is not None) is same


def test_come_to_rest_elsewhere_it_is_solved_once():
    box = Box(size=(12e-3, 7e-3, 5e-3))
    start, there = held(touching(box)), touching(box, at=(0.5e-3, -0.4e-3))
    assert start.carry(there) is not None
    assert start.carry(there) is None
    start = held(there)
    assert all(start.carry(there) is not None for _ in range(3))


def pressed_ball(method):
    """A 10 mm ball on a slide along the normal, and its sensor."""
    spec = mujoco.MjSpec()
    spec.option.timestep = 1e-3
    fastmodel.recommend_options(spec)
    sensor = fastmodel.attach(spec, "world", parameters(filter=None), contact=method)
    ball = spec.worldbody.add_body(name="ball", pos=[0.4e-3, -0.3e-3, 10.05e-3])
    ball.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[10e-3, 0, 0], mass=0.05)
    model = spec.compile()
    return sensor.bind(model), mujoco.MjData(model), model


@pytest.mark.parametrize("method", ["cover", "foundation"])
def test_a_load_that_rises_slowly_is_laid_out_as_if_it_came_at_once(method):
    sensor, data, model = pressed_ball(method)
    for k in range(800):
        data.xfrc_applied[1, 2] = -0.2 * 50 ** min(1, k / 650)
        mujoco.mj_step(model, data)
        sensor.step(data)
    at_once = pressed_ball(method)[0]._running._reader.read(data)
    assert at_once.carried > 10
    assert misplaced(sensor.contact_forces(), at_once.contact_forces) < 1e-4


GUIDED = {
    "cylinder": [(mujoco.mjtGeom.mjGEOM_CYLINDER, [5e-3, 1e-3, 0], 0.0)],
    "two balls": [(mujoco.mjtGeom.mjGEOM_SPHERE, [3e-3, 0, 0], y) for y in (-6e-3, 6e-3)],
}


def guided(geoms):
    """A tool that goes where it is put, above an array on a slide, and the array's sensor."""
    spec = mujoco.MjSpec()
    spec.option.timestep = 1e-3
    spec.option.gravity = np.zeros(3)
    fastmodel.recommend_options(spec)
    table = spec.worldbody.add_body(name="table")
    table.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1], damping=20)
    table.mass, table.explicitinertial, table.inertia = 0.5, True, [1e-4] * 3
    sensor = fastmodel.attach(spec, "table", parameters(filter=None), contact="cover", every=1)
    tool = spec.worldbody.add_body(name="tool", pos=[0.3e-3, -0.4e-3, 0.5e-3], mocap=True)
    for kind, size, y in geoms:
        tool.add_geom(type=kind, size=size, pos=[0, y, size[1] or size[0]])
    model = spec.compile()
    data = mujoco.MjData(model)
    data.xfrc_applied[1, 2] = 3.0
    return sensor.bind(model), data, model


@pytest.mark.parametrize("geoms", GUIDED.values(), ids=GUIDED)
def test_a_guided_tilt_is_solved(geoms):
    sensor, data, model = guided(geoms)
    reader = sensor._running._reader
    mujoco.mj_step(model, data, 300)
    level = reader.read(data)
    for tilt in (1e-3, 2e-3):
        data.mocap_quat[0] = [np.cos(tilt / 2), np.sin(tilt / 2), 0, 0]
        mujoco.mj_step(model, data, 100)
        found, anew = reader.read(data), guided(geoms)[0]._running._reader.read(data)
        assert misplaced(level.contact_forces, anew.contact_forces) > 5e-3
        assert misplaced(found.contact_forces, anew.contact_forces) < 1e-3


def test_levers_reach_to_the_farthest_corner_of_a_hull():
    spec = mujoco.MjSpec()
    spec.add_mesh(name="wedge", uservert=[0, 0, 0, 9e-3, 0, 0, 0, 5e-3, 0, 0, 0, 7e-3])
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="wedge")
    model = spec.compile()
    corners = np.abs(model.mesh_vert).max(axis=0)
    assert (corners > 1.1 * model.geom_aabb[0, 3:]).any()
    np.testing.assert_allclose(Shape(solids=(solid(model, 0),)).extents[0, :3], corners, rtol=1e-5)


def test_loops_and_numpy_find_the_same_moves():
    rng = np.random.default_rng(7)
    for flat in (True, False):
        (was, now), (here, there) = rng.normal(size=(2, 4, 3, 3)), rng.normal(size=(2, 4, 3))
        given = was, here, now, there, rng.uniform(size=(4, 4)), rng.normal(size=3), flat
        np.testing.assert_allclose(_apart(*given), _apart_loops(*given))


def test_the_compiled_loop_moves_the_same():
    pytest.importorskip("numba")
    plain, fast = (held(touching(DISC), native=native) for native in (False, True))
    there = touching(DISC, at=(0.5e-3, -0.7e-3))
    one, other = plain.carry(there), fast.carry(there)
    np.testing.assert_allclose(one.contact_forces, other.contact_forces, atol=1e-12)
    np.testing.assert_allclose(one.texel_forces, other.texel_forces, atol=1e-12)
