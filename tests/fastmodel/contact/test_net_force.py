"""Net force and torque of an array equal the sums of MuJoCo's own contact forces, for every contact method."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import Butterworth, Parameters
from fastmodel.contact.forces import BY_GEOM, SHARED
from meshes import TexelArray
from tests.support.bent_array import bent_array
from tests.support.scenes import add_body, make_spec, simulate

# Many methods and rates are tried here that a user is warned of.
pytestmark = pytest.mark.filterwarnings("ignore::fastmodel.OptionWarning", "ignore::fastmodel.RangeWarning")

POSITION, QUATERNION = (0.01, 0.02, 0.03), (1.0, 0.05, -0.04, 0.6)
FLAT = fastmodel.load("wts-0614-34")
METHODS = ("cover", "foundation", "boxes")


def drop_bodies(parameters: Parameters, method: str, cone: mujoco.mjtCone):
    """A tilted array on a tilted hand, onto which a box and a ball fall that turn, roll and slide off its edge."""
    spec = make_spec(timestep=2e-3, cone=cone)
    turn = [1, 0.08, 0.1, 0.05]
    hand = spec.worldbody.add_body(name="hand", pos=[0.1, 0.2, 0.3], quat=turn)
    sensor = fastmodel.attach(
        spec, hand, parameters, name="pad", position=POSITION, quaternion=QUATERNION, contact=method, every=1
    )
    hand.add_site(name="origin", pos=POSITION, quat=QUATERNION)
    rough = {"density": 30000, "condim": 6, "friction": [0.7, 0.02, 0.01]}
    for kind, size, beside in (("box", [6e-3, 5e-3, 4e-3], -6e-3), ("sphere", [4e-3], 9e-3)):
        add_body(spec, kind, size, [0.114, 0.216 + beside, 0.345], free=True, **rough)
    model = spec.compile()
    return sensor, model, mujoco.MjData(model)


def sum_contacts(model, data):
    """Force on the geoms of the array, and torque about its origin, in its frame, by `mj_contactForce`."""
    site = model.site("origin").id
    axes, origin = data.site_xmat[site].reshape(3, 3), data.site_xpos[site]
    total, local = np.zeros(6), np.zeros(6)
    for k in range(data.ncon):
        contact = data.contact[k]
        mujoco.mj_contactForce(model, data, k, local)
        for geom, sign in ((contact.geom1, -1), (contact.geom2, 1)):
            if model.geom(geom).name.startswith("pad/"):
                force = sign * contact.frame.reshape(3, 3).T @ local[:3]
                torque = sign * contact.frame.reshape(3, 3).T @ local[3:]
                total += np.append(axes.T @ force, axes.T @ (torque + np.cross(contact.pos - origin, force)))
    return total


@pytest.mark.parametrize(
    ("bent", "cone"),
    [(False, mujoco.mjtCone.mjCONE_ELLIPTIC), (True, mujoco.mjtCone.mjCONE_PYRAMIDAL)],
    ids=["flat", "bent"],
)
@pytest.mark.parametrize("method", METHODS)
def test_net_force_and_torque_are_the_sums_of_mujocos_contact_forces(method, bent, cone):
    parameters = dataclasses.replace(FLAT, array=bent_array(), tables={}) if bent else FLAT
    parameters = dataclasses.replace(parameters, electronics=dataclasses.replace(parameters.electronics, rate_hz=500.0))
    sensor, model, data = drop_bodies(parameters, method, cone)
    sensor.bind(model)
    touched, largest = 0, np.zeros(6)
    for _ in range(120):
        mujoco.mj_step(model, data)
        expected = sum_contacts(model, data)
        made = sensor.step(data)
        touched += bool(expected.any())
        largest = np.maximum(largest, np.abs(expected))
        if made:
            frame = sensor.frame()
            np.testing.assert_allclose(np.append(frame.net_force, frame.net_torque), expected, rtol=0, atol=1e-9)
    assert touched > 15
    assert (largest > [0.1, 0.1, 0.5, 1e-4, 1e-4, 1e-5]).all()


def slide_box(method, *, filtered=None, push=0.6, array=None, rate=500.0, quaternion=(1, 0, 0, 0)):
    """A box of 1 N on the middle of an array, pushed along -x and half as strongly along y against friction."""
    electronics = dataclasses.replace(FLAT.electronics, rate_hz=rate)  # by default a frame in every step
    parameters = dataclasses.replace(FLAT, filter=filtered, electronics=electronics)
    if array is not None:
        parameters = dataclasses.replace(parameters, array=array, tables={})
    spec = make_spec(timestep=2e-3)
    sensor = fastmodel.attach(spec, "world", parameters, contact=method, every=1, quaternion=quaternion)
    half, friction = [6e-3, 8e-3, 4e-3], [2, 0.005, 0.0001]
    add_body(spec, "box", half, [0, 0, 4e-3], free=True, mass=1.0 / 9.81, friction=friction)

    def pull(data):
        data.xfrc_applied[1, :2] = -push, push / 2

    model, data = simulate(spec, sensor, 300, pull)
    return sensor, sum_front(model, data)


def sum_front(model, data):
    local, total = np.zeros(6), np.zeros(3)
    for k in range(data.ncon):
        mujoco.mj_contactForce(model, data, k, local)
        sign = 1 if model.geom(data.contact[k].geom2).name.startswith("sensor/") else -1
        total += sign * data.contact[k].frame.reshape(3, 3).T @ local[:3]
    return total


@pytest.mark.parametrize("method", METHODS)
def test_tangential_forces_add_up_to_the_friction(method):
    sensor, expected = slide_box(method)
    frame = sensor.frame()
    assert expected == pytest.approx([-0.6, 0.3, -1.0], abs=0.02)
    np.testing.assert_allclose(frame.net_force, expected, atol=1e-9)
    np.testing.assert_allclose(frame.tangential.sum(axis=0), expected[:2], atol=1e-6)
    loaded = sensor.contact_forces() > 0
    assert not frame.tangential[~loaded].any()
    if method in {"cover", "foundation"}:
        assert frame.tangential_source == SHARED
        shares = sensor.contact_forces() / sensor.contact_forces().sum()
        np.testing.assert_allclose(frame.tangential, np.outer(shares, expected[:2]), atol=1e-6)
    else:
        assert frame.tangential_source == BY_GEOM
        assert np.count_nonzero(frame.tangential[:, 0] < 0) >= 4


def test_shear_is_given_along_the_tangents_of_an_array_that_is_turned_on_its_body():
    sensor, expected = slide_box("cover", quaternion=(np.sqrt(0.5), 0, 0, np.sqrt(0.5)))
    turned = [expected[1], -expected[0]]
    np.testing.assert_allclose(sensor.frame().tangential.sum(axis=0), turned, atol=1e-6)


def test_shear_on_the_margin_and_on_masked_texels_is_on_no_texel():
    """The box is wider than the array, so that a part of it stands on the margin; one of four texels is masked."""
    active = np.ones(4, dtype=bool)
    active[0] = False
    sensor, expected = slide_box("cover", array=TexelArray.grid(2, 2, FLAT.array.pitch, active=active))
    frame = sensor.frame()
    np.testing.assert_allclose(frame.net_force, expected, atol=1e-9)
    shares = sensor.contact_forces() / sensor.carried()
    assert shares.sum() < 0.9
    shares[0] = 0
    np.testing.assert_allclose(frame.tangential, np.outer(shares, expected[:2]), atol=1e-3)
    sensor, _ = slide_box("boxes", array=TexelArray.grid(2, 2, FLAT.array.pitch, active=active))
    assert not sensor.frame().tangential[0].any()
    assert sensor.frame().tangential[2].any()


def test_net_force_is_filtered_as_the_texel_forces_are():
    sensor, _ = slide_box("boxes", filtered=Butterworth(cutoff_hz=5.0, order=2), rate=50.0)
    frame = sensor.frame()
    assert -frame.net_force[2] == pytest.approx(frame.texel_forces.sum() + sensor.outside(), abs=1e-12)
    # forces that act all the time are those at which the sensor starts
    sensor.reset(np.full(84, 0.01))
    frame = sensor.frame()
    assert frame.net_force == pytest.approx([0, 0, -0.84])
    np.testing.assert_allclose(frame.net_torque, 0, atol=1e-12)
    assert not frame.tangential.any()
    sensor.reset(np.eye(84)[5])
    expected = np.cross(FLAT.array.centres[5], -FLAT.array.normals[5])
    np.testing.assert_allclose(sensor.frame().net_torque, expected, atol=1e-12)


@pytest.mark.parametrize("contact", ["cover", "foundation"])
def test_given_forces_have_the_torque_of_their_places(contact):
    """Of 0.3 N on one texel and 1 N on another; the cover lacks nothing of it."""
    sensor, _ = slide_box(contact)
    forces = np.eye(84)[5] + 0.3 * np.eye(84)[70]
    sensor.reset(forces)
    expected = np.cross(FLAT.array.centres, -FLAT.array.normals).T @ forces
    np.testing.assert_allclose(sensor.frame().pressure_torque, expected, atol=1e-12)


def test_pressures_are_forces_over_the_sensitive_area():
    sensor, _ = slide_box("cover")
    frame = sensor.frame()
    np.testing.assert_allclose(frame.pressures, frame.texel_forces / 3.4e-3**2)
    narrow = TexelArray.grid(4, 4, FLAT.array.pitch, texel_size=(3e-3, 2e-3))
    sensor, _ = slide_box("boxes", array=narrow)
    np.testing.assert_allclose(sensor.frame().pressures, sensor.frame().texel_forces / 6e-6)
    assert sensor.frame().pressures.max() > 1e3


@pytest.mark.parametrize("method", METHODS)
def test_a_push_against_the_side_of_the_array_is_in_the_net_force_alone(method):
    spec = make_spec(timestep=2e-3, gravity=[0, 0, 0])
    electronics = dataclasses.replace(FLAT.electronics, rate_hz=500.0)
    sensor = fastmodel.attach(spec, "world", dataclasses.replace(FLAT, electronics=electronics), contact=method)
    edge = 3.4e-3 * (3 if method == "boxes" else 4)  # the plate has a margin of one pitch
    add_body(spec, "box", [5e-3, 5e-3, 0.5e-3], [edge + 5e-3, 0, -1e-3], slides="x", mass=0.2)

    def push(data):
        data.xfrc_applied[1, 0] = -2.0

    simulate(spec, sensor, 300, push)
    frame = sensor.frame()
    assert frame.net_force == pytest.approx([-2, 0, 0], abs=0.01)
    assert frame.net_torque[1] == pytest.approx(2e-3, rel=0.1)  # 2 N, 1 mm below the front
    assert not frame.tangential.any()
    assert not frame.texel_forces.any()
