import mujoco
import numpy as np
import pytest

from fastmodel.contact.boxes import BoxTexels
from meshes import TexelArray
from tests.support.quaternions import make_z_rotation, multiply
from tests.support.scenes import add_body

ARRAY = TexelArray.grid(4, 5, 10e-3)


def scene(cone, condim, tilt=(1.0, 0.0, 0.0, 0.0), seed=0):
    """Several free objects dropped on an array, some sliding, some rolling."""
    rng = np.random.default_rng(seed)
    spec = mujoco.MjSpec()
    spec.option.cone = cone
    spec.option.timestep = 1e-3
    BoxTexels().attach(spec.worldbody.add_frame(quat=tilt), ARRAY, "a")
    rough = {"density": 4000, "condim": condim, "friction": [0.6, 0.01, 0.001]}
    for k in range(6):
        place = [((k % 3) - 1) * 14e-3, (k // 3 - 0.5) * 16e-3, 7e-3]
        kind = ("sphere", "box", "ellipsoid")[k % 3]
        add_body(spec, kind, [4e-3, 5e-3, 3e-3], place, free=True, quat=rng.normal(size=4), **rough)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[:] = rng.normal(size=model.nv) * 0.05
    return model, data


def add_contact_by_contact(model, data):
    """Sum of `mj_contactForce` over the contacts of each box, one at a time: the slow oracle."""
    texel = {model.geom(f"a/texel{i}").id: i for i in range(ARRAY.count)}
    total, force = np.zeros(ARRAY.count), np.zeros(6)
    for k in range(data.ncon):
        mujoco.mj_contactForce(model, data, k, force)
        world = data.contact[k].frame.reshape(3, 3).T @ force[:3]
        for geom, sign in zip(data.contact[k].geom, (1, -1), strict=True):
            if geom in texel:
                total[texel[geom]] += sign * world @ data.geom_xmat[geom].reshape(3, 3)[:, 2]
    return total


@pytest.mark.parametrize("cone", [mujoco.mjtCone.mjCONE_PYRAMIDAL, mujoco.mjtCone.mjCONE_ELLIPTIC])
@pytest.mark.parametrize("condim", [1, 3, 4, 6])
def test_box_forces_equal_mujocos_contact_forces(cone, condim):
    tilt = multiply(np.array([np.cos(0.1), np.sin(0.1), 0, 0]), make_z_rotation(0.4))
    model, data = scene(cone, condim, tilt)
    reader = BoxTexels().bind(model, ARRAY, "a")
    touched = 0
    for _ in range(60):
        mujoco.mj_step(model, data)
        expected = add_contact_by_contact(model, data)
        touched += np.count_nonzero(expected)
        reading = reader.read(data)
        forces = reading.contact_forces
        assert np.all(forces >= 0)
        assert reading.carried == pytest.approx(expected.sum(), rel=1e-12)
        if expected.min() >= 0:
            assert np.allclose(forces, expected, rtol=1e-12, atol=1e-15)
    assert touched > 50


def test_no_contact_is_zero_and_boxes_weigh_nothing():
    spec = mujoco.MjSpec()
    BoxTexels().attach(spec.worldbody.add_frame(), ARRAY, "a")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    assert np.array_equal(BoxTexels().bind(model, ARRAY, "a").read(data).contact_forces, np.zeros(20))
    assert model.body_mass.sum() == 0


def test_a_box_lifted_by_its_side_reads_zero_and_the_balance_stays():
    """A thin blade dragged along between boxes with high friction: signed sums go negative, readings do not."""
    spec = mujoco.MjSpec()
    spec.option.timestep = 1e-3
    BoxTexels().attach(spec.worldbody.add_frame(), ARRAY, "a")
    pose = {"pos": [1e-3, 2e-3, 3e-3], "quat": make_z_rotation(0.7)}
    add_body(spec, "box", [0.3e-3, 4e-3, 3e-3], **pose, slides="xyz", mass=0.2, friction=[2.0, 0, 0])
    model = spec.compile()
    data, lifted = mujoco.MjData(model), 0
    reader = BoxTexels().bind(model, ARRAY, "a")
    for step in range(1500):
        data.qfrc_applied[:3] = [3 * np.sin(step / 40), 3 * np.cos(step / 60), 0]
        mujoco.mj_step(model, data)
        signed, forces = add_contact_by_contact(model, data), reader.read(data).contact_forces
        lifted += signed.min() < -1e-6
        assert np.all(forces >= 0)
        assert forces.sum() == pytest.approx(max(signed.sum(), 0), abs=1e-12)
    assert lifted > 0


def test_one_reader_reads_several_states_of_a_model():
    model, data = scene(mujoco.mjtCone.mjCONE_ELLIPTIC, 3)
    other, turned = mujoco.MjData(model), multiply(np.array([np.cos(0.2), np.sin(0.2), 0, 0]), make_z_rotation(0.4))
    texels = [model.geom(f"a/texel{i}").id for i in range(ARRAY.count)]
    # the boxes lean in the other state; without this MuJoCo would go by the turns they were compiled with
    model.geom_sameframe[texels] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    reader = BoxTexels().bind(model, ARRAY, "a")
    touched = 0
    for _ in range(30):
        for state, turn in ((data, (1.0, 0.0, 0.0, 0.0)), (other, turned)):
            model.geom_quat[texels] = turn
            mujoco.mj_step(model, state)
            expected = add_contact_by_contact(model, state)
            reading = reader.read(state)
            touched += state is other and np.count_nonzero(expected)
            assert reading.carried == pytest.approx(max(expected.sum(), 0), rel=1e-12)
            if expected.min() >= 0:
                np.testing.assert_allclose(reading.contact_forces, expected, rtol=1e-12, atol=1e-15)
    assert touched > 20
