"""The readers of the methods `cover` and `foundation`, from one simulation step to the next."""

import mujoco
import numpy as np
import pytest

import fastmodel
from tests.support.cover_data import parameters
from tests.support.scenes import add_body, make_spec

METHODS = ("cover", "foundation")


def find_misplaced(one, other):
    return 0.5 * np.abs(one - other).sum() / other.sum()


def build_pressed_ball(method):
    """A 10 mm ball on a slide along the normal, and its sensor."""
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", parameters(filter=None), contact=method)
    add_body(spec, "sphere", [10e-3], [0.4e-3, -0.3e-3, 10.05e-3], slides="z", mass=0.05)
    model = spec.compile()
    return sensor.bind(model), mujoco.MjData(model), model


@pytest.mark.parametrize("method", METHODS)
def test_a_slowly_rising_load_ends_in_the_same_forces_as_a_sudden_one(method):
    sensor, data, model = build_pressed_ball(method)
    for k in range(800):
        data.xfrc_applied[1, 2] = -0.2 * 50 ** min(1, k / 650)
        mujoco.mj_step(model, data)
        sensor.step(data)
    sudden = build_pressed_ball(method)[0]._reader.read(data)
    assert sudden.carried > 10
    assert find_misplaced(sensor.contact_forces(), sudden.contact_forces) < 1e-4


@pytest.mark.parametrize("method", METHODS)
def test_a_contact_is_solved_when_it_has_changed_and_when_it_has_come_to_rest(method):
    sensor, data, model = build_pressed_ball(method)
    reader = sensor._reader
    data.xfrc_applied[1, 2] = -2.0
    mujoco.mj_step(model, data, 800)
    solve, calls = reader._solver.solve, []
    reader._solver.solve = lambda *each: calls.append(each) or solve(*each)
    for load, solved in ((2.0, True), (2.0, False), (2.02, False), (2.02, True), (2.3, True), (2.3, False)):
        data.xfrc_applied[1, 2] = -load
        mujoco.mj_step(model, data, 300)
        before = len(calls)
        found = reader.read(data)
        assert (len(calls) > before) == solved
        assert found.carried == pytest.approx(load + 0.05 * 9.81, rel=1e-4)


GUIDED = {
    "cylinder": [(mujoco.mjtGeom.mjGEOM_CYLINDER, [5e-3, 1e-3, 0], 0.0)],
    "two balls": [(mujoco.mjtGeom.mjGEOM_SPHERE, [3e-3, 0, 0], y) for y in (-6e-3, 6e-3)],
}


def build_guided(geoms):
    """A tool moved by a mocap body, above an array on a slide, and the array's sensor."""
    spec = make_spec(gravity=np.zeros(3))
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
def test_the_tilt_of_a_guided_body_changes_its_forces(geoms):
    sensor, data, model = build_guided(geoms)
    reader = sensor._reader
    mujoco.mj_step(model, data, 300)
    level = reader.read(data)
    for tilt in (1e-3, 2e-3):
        data.mocap_quat[0] = [np.cos(tilt / 2), np.sin(tilt / 2), 0, 0]
        mujoco.mj_step(model, data, 100)
        found, anew = reader.read(data), build_guided(geoms)[0]._reader.read(data)
        assert find_misplaced(level.contact_forces, anew.contact_forces) > 5e-3
        assert find_misplaced(found.contact_forces, anew.contact_forces) < 1e-3
