"""Texels in the world, their picture in a viewer, one name for one quantity, and what must not reach an array."""

import dataclasses
import warnings

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fastmodel
from fastmodel import OptionWarning
from fastmodel.errors import LifeCycleError
from meshes import TexelArray
from tests.support.cover_data import WTS, parameters
from tests.support.scenes import add_body, bind, make_spec, run

TURN = Rotation.from_euler("xyz", [0.4, -0.3, 1.1])
PLACE = Rotation.from_euler("xyz", [0.1, 0.2, -0.5])


def build(array=WTS):
    """A finger with an array, turned twice: spec, sensor, and pose of the array."""
    spec = make_spec()
    spec.worldbody.add_body(name="finger", pos=[0.1, 0.2, 0.3], quat=TURN.as_quat(scalar_first=True).tolist())
    quaternion = PLACE.as_quat(scalar_first=True)
    settings = parameters(array, filter=None)
    sensor = fastmodel.attach(spec, "finger", settings, position=(0.01, 0.02, 0.03), quaternion=quaternion)
    return spec, sensor, TURN * PLACE, np.array([0.1, 0.2, 0.3]) + TURN.apply([0.01, 0.02, 0.03])


def bend(radius=0.02):
    """A row of texels along x, bent about y."""
    angle = 3.5e-3 / radius * np.arange(-2.5, 3)
    normals = np.stack([np.sin(angle), np.zeros(6), np.cos(angle)], axis=1)
    flat = TexelArray.grid(1, 6, WTS.pitch)
    return dataclasses.replace(flat, centres=radius * (normals - [0, 0, 1]), normals=normals)


@pytest.mark.parametrize("array", [WTS, bend()], ids=["flat", "bent"])
def test_places_of_the_texels_follow_the_body(array):
    spec, sensor, turn, origin = build(array)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    positions, normals, frames = bind(sensor, model).texel_poses(data)
    np.testing.assert_allclose(positions, origin + turn.apply(array.centres.copy()), atol=1e-12)
    np.testing.assert_allclose(normals, turn.apply(array.normals.copy()), atol=1e-12)
    np.testing.assert_allclose(frames[:, :, 2], normals, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1)
    along_x = turn.apply([1, 0, 0]) if array is WTS else turn.apply(np.gradient(array.centres, axis=0))
    assert (np.sum(frames[:, :, 0] * along_x, axis=1) > 0.99 * np.linalg.norm(along_x, axis=-1)).all()


def test_places_are_found_in_a_copy_with_a_prefix_and_missed_in_a_model_without_the_site():
    child, sensor, turn, origin = build()
    parent = make_spec()
    parent.attach(child, prefix="l_", suffix="_1", frame=parent.worldbody.add_frame(pos=[0, 0, 1]))
    model = parent.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    positions = bind(sensor.twin(prefix="l_", suffix="_1"), model).texel_poses(data).positions
    np.testing.assert_allclose(positions, origin + turn.apply(WTS.centres.copy()) + [0, 0, 1], atol=1e-12)
    parent.delete(parent.site("l_sensor/origin_1"))
    model = parent.compile()
    with pytest.raises(LifeCycleError, match=r"no site 'l_sensor/origin_1', .*; attach the array anew"):
        bind(sensor.twin(prefix="l_", suffix="_1"), model).texel_poses(mujoco.MjData(model))


def press():
    """A ball of 2 N on the texel with index 32, beside a masked texel; sensor, model and data."""
    array = dataclasses.replace(WTS, active=np.arange(84) != 0)
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", parameters(array, filter=None))
    add_body(spec, "sphere", [5e-3], [*array.centres[32, :2], 5e-3], slides="z", mass=0.2, damping=1.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    bind(sensor, model)
    run(sensor, model, data, 300)
    return sensor, model, data


def test_texels_are_drawn_where_they_are_as_bright_as_they_are_pressed():
    sensor, model, data = press()
    scene = mujoco.MjvScene(model, maxgeom=200)
    sensor.draw(scene, data, white=1.0)
    assert scene.ngeom == 83  # all but the masked texel
    forces = np.clip(sensor.texel_forces(), 0, 1)[1:]
    assert [geom.rgba[0] for geom in scene.geoms[:83]] == pytest.approx(forces, abs=1e-6)
    assert forces.argmax() == 31
    np.testing.assert_allclose([geom.pos[:2] for geom in scene.geoms[:83]], WTS.centres[1:, :2], atol=1e-7)
    assert all(0 < geom.pos[2] - geom.size[2] < 1e-3 for geom in scene.geoms[:83])
    small = mujoco.MjvScene(model, maxgeom=10)
    sensor.draw(small, data)
    assert small.ngeom == 10


def test_drawn_texels_are_turned_tiles_with_gaps_and_white_from_half_a_newton():
    spec, sensor, _, _ = build(bend())
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bind(sensor, model)
    sensor.reset(np.linspace(0.1, 1.6, 6))
    scene = mujoco.MjvScene(model, maxgeom=20)
    sensor.draw(scene, data)
    forces, poses = sensor.texel_forces(), sensor.texel_poses(data)
    assert forces.min() < 0.4
    assert forces.max() > 0.6
    for k, geom in enumerate(scene.geoms[:6]):
        np.testing.assert_allclose(geom.rgba, [*[min(2 * forces[k], 1)] * 3, 1], atol=1e-6)
        np.testing.assert_allclose(np.reshape(geom.mat, (3, 3)), poses.frames[k], atol=1e-6)
        gaps = 2 * geom.size[:2] / np.array(sensor.parameters.array.texel_size)
        assert gaps == pytest.approx([0.9, 0.9], rel=1e-5)
        assert 0 < geom.size[2] < 2e-4
        np.testing.assert_allclose(geom.pos - poses.positions[k], 2e-4 * poses.normals[k], atol=1e-7)


def test_a_quantity_has_one_name_on_sensor_and_frame():
    sensor, *_ = press()
    frame = sensor.frame()
    assert np.array_equal(sensor.texel_forces(), frame.texel_forces)
    assert np.array_equal(sensor.pressures(), frame.pressures)
    assert sensor.outside() == frame.outside
    assert frame.texel_forces.sum() + frame.outside == pytest.approx(0.2 * 9.81, rel=1e-3)
    sensor.reset(np.where(np.arange(84) == 5, 1.0, 0.0))  # at a corner
    assert sensor.outside() == sensor.frame().outside > 0.05


def test_a_frame_without_a_step_is_told_at_the_second_call():
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", parameters(filter=None))
    bind(sensor, spec.compile())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not sensor.frame().image.any()
        sensor.texel_forces()
    with pytest.warns(OptionWarning, match=r"'sensor': the frame is that of the unloaded array: step\(data\) was"):
        sensor.frame()
    sensor.reset(0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert sensor.frame().texel_forces.any()
        assert sensor.frame().texel_forces.any()


@pytest.mark.parametrize("contact", ["cover", "boxes"])
def test_default_settings_of_the_body_do_not_reach_the_array(contact):
    spec = mujoco.MjSpec.from_string("""
    <mujoco>
      <default><default class="rubber"><geom friction="3 0 0" margin="0.01" condim="1"/></default></default>
      <worldbody>
        <body name="arm" childclass="rubber"><body name="finger"><geom name="pad" size="0.01"/></body></body>
      </worldbody>
    </mujoco>""")
    finger = spec.body("finger")
    fastmodel.attach(spec, "finger", parameters(), contact=contact)
    finger.add_geom(name="later", size=[0.01, 0, 0])
    model = spec.compile()
    own = [geom for geom in range(model.ngeom) if model.geom(geom).name.startswith("sensor/")]
    assert (model.geom_margin[own] == 0).all()
    assert (model.geom_condim[own] == 3).all()
    np.testing.assert_allclose(model.geom_friction[own, 0], 1)
    np.testing.assert_allclose(model.geom_friction[[model.geom("pad").id, model.geom("later").id], 0], 3)
