"""Bodies free to tilt: the centre of pressure is that of MuJoCo's contacts, and readings follow the loads."""

from __future__ import annotations

import copy
import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fastmodel
from tests.support.cover_data import WTS, parameters
from tests.support.scenes import make_spec

KINDS = mujoco.mjtGeom
BODIES = {
    "box": [(KINDS.mjGEOM_BOX, [8e-3, 6e-3, 5e-3])],
    "blade": [(KINDS.mjGEOM_BOX, [9e-3, 1e-3, 6e-3])],
    "cylinder": [(KINDS.mjGEOM_CYLINDER, [6e-3, 8e-3, 0])],
    "cross": [(KINDS.mjGEOM_BOX, [9e-3, 3e-3, 3e-3]), (KINDS.mjGEOM_BOX, [3e-3, 9e-3, 3e-3])],
}
CELL = 0.85e-3
STEP = 2e-3
FAST = dataclasses.replace(fastmodel.WTS_0614_34, rate_hz=1 / STEP)


def build_tumbling(name, method, seed):
    """A free body in a random pose above an array, and its sensor."""
    random = np.random.default_rng(seed)
    spec = make_spec(timestep=STEP)
    sensor = fastmodel.attach(
        spec, spec.worldbody, parameters(filter=None, electronics=FAST), name="pad", contact=method, every=1
    )
    body = spec.worldbody.add_body(name="body", pos=[*random.uniform(-5e-3, 5e-3, 2), 15e-3])
    body.add_freejoint()
    body.quat = Rotation.random(rng=random).as_quat(scalar_first=True)
    for kind, size in BODIES[name]:
        body.add_geom(type=kind, size=size, mass=0.05, friction=[0.8, 0.01, 1e-4])
    model = spec.compile()
    model.dof_damping[:3], model.dof_damping[3:] = 1.0, 2e-4
    sensor.bind(model)
    return sensor, model, mujoco.MjData(model), random.normal(size=(2, 3))


def list_steps(name, method, seed, steps=250):
    """Yield sensor and state at every step in which the wobbling body presses by more than 0.1 N."""
    sensor, model, data, wobble = build_tumbling(name, method, seed)
    for k in range(steps):
        phase = 2 * np.pi * 2.3 * k * STEP
        torque = 3e-3 * (wobble[0] * np.sin(phase) + wobble[1] * np.cos(phase))
        data.xfrc_applied[-1] = [*(-40 * data.body("body").xpos[:2]), -3.0, *torque]
        mujoco.mj_step(model, data)
        sensor.step(data)
        if sensor.carried() > 0.1:
            yield sensor, model, data


def find_centre(model, data):
    """Centre of MuJoCo's contact forces on the front of the array, by `mj_contactForce` [m]."""
    plate, total, local = model.geom("pad/plate").id, np.zeros(3), np.zeros(6)
    for k, contact in enumerate(data.contact):
        if plate in contact.geom and abs(contact.frame[2]) > 0.1:
            mujoco.mj_contactForce(model, data, k, local)
            force = abs(local[:3] @ contact.frame.reshape(3, 3)[:, 2])
            total += force * np.append(contact.pos[:2], 1.0)
    return total[:2] / total[2], total[2]


@pytest.mark.parametrize("method", ["cover", pytest.param("foundation", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", BODIES)
def test_centre_of_pressure_is_that_of_mujocos_contacts(name, method):
    """Within a cell; what is missed is a field of the frame; the force is exact; texels show the same centre."""
    apart = []
    for sensor, model, data in list_steps(name, method, seed=5):
        frame, (centre, force) = sensor.frame(), find_centre(model, data)
        assert sensor.carried() == pytest.approx(force, rel=1e-9)
        found = np.array([frame.pressure_torque[1], -frame.pressure_torque[0]]) / force
        missed = np.array([frame.missed_torque[1], -frame.missed_torque[0]]) / force
        np.testing.assert_allclose(found + missed, centre, atol=2e-5)
        apart.append(np.abs(found - centre).max())
        shown = sensor.contact_forces() @ WTS.centres[:, :2]
        if abs(sensor.contact_forces().sum() / force - 1) < 1e-6:  # nothing beside the texels
            np.testing.assert_allclose(shown / force, found, atol=0.5 * WTS.pitch[0])
    assert len(apart) > 10
    assert np.mean(np.array(apart) > CELL) <= 0.01


@pytest.mark.parametrize(
    "name", [pytest.param("box", marks=pytest.mark.slow), "blade", pytest.param("cross", marks=pytest.mark.slow)]
)
def test_an_adapted_reading_equals_one_that_is_solved_anew(name):
    """A twin that forgets its last solution in every step differs by at most 1 % of the load."""
    apart, twin = [], None
    for sensor, _, data in list_steps(name, "cover", seed=7):
        twin = twin or copy.deepcopy(sensor._reader)
        twin._solved = None
        here, anew = sensor._reading, twin.read(data)
        assert here.carried == pytest.approx(anew.carried, rel=1e-9)
        apart.append(0.5 * np.abs(here.texel_forces - anew.texel_forces).sum() / anew.carried)
    assert np.median(apart) < 1e-3
    assert max(apart) < 1e-2


def test_a_centre_of_pressure_that_no_pressure_has_is_told():
    """A torque of the force times 30 mm, an arm beyond the body, is added to the contacts."""
    sensor, model, data, _ = build_tumbling("box", "cover", seed=1)
    reader = sensor._reader
    for _ in range(200):
        mujoco.mj_step(model, data)
        sensor.step(data)
    found = reader.find_contact

    def pull(state):
        contact, sums = found(state)
        for load in contact.loads:
            load.moment[:] += 30e-3 * load.force
        return contact, sums

    reader.find_contact = pull
    mujoco.mj_step(model, data)
    with pytest.warns(fastmodel.RangeWarning, match="centre of pressure lies .* mm from"):
        sensor.step(data)


@pytest.mark.parametrize("method", ["cover", "foundation"])
def test_a_body_between_the_sampled_points_is_read_again_and_again(method):
    """A ball of 0.05 mm lies over no sampled point of a cell; its force acts at its contact points."""
    spec = make_spec(timestep=STEP)
    sensor = fastmodel.attach(spec, spec.worldbody, parameters(filter=None, electronics=FAST), contact=method, every=1)
    for name, radius, x in (("small", 5e-5, 5e-3), ("large", 4e-3, -5e-3)):
        body = spec.worldbody.add_body(name=name, pos=[x + 0.2125e-3, 0.1e-3, 0.99 * radius])
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1], damping=20)
        body.add_geom(type=KINDS.mjGEOM_SPHERE, size=[radius, 0, 0], mass=0.05)
    model = spec.compile()
    sensor.bind(model)
    data = mujoco.MjData(model)
    for k in range(100):
        data.xfrc_applied[1:, 2] = -1e-3 * k
        mujoco.mj_step(model, data)
        sensor.step(data)
    assert sensor.carried() == pytest.approx(2 * (0.05 * 9.81 + 0.099), rel=1e-2)
    np.testing.assert_allclose(sensor.frame().pressure_torque[:2], sensor.frame().net_torque[:2], atol=5e-5)
