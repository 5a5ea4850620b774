"""The models of MuJoCo's own sensors agree with the sensors."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from meshes import TexelArray
from validation.published.models import PUBLISHED
from validation.published.scene import Contacts

#: Half edge lengths of 14 x 6 texels of 3.4 mm.
WIDTH, HEIGHT = 10.2e-3, 23.8e-3


def test_touch_grid_bins_as_the_plugin_does(scene):
    mujoco.mj_loadPluginLibrary(str(next(Path(mujoco.__file__).parent.glob("plugin/*sensor*"))))
    fov_x = np.degrees(np.arctan(WIDTH / HEIGHT))
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><extension><plugin plugin="mujoco.sensor.touch_grid"/></extension><worldbody>
      <body><geom type="box" size="{WIDTH} {HEIGHT} 0.001" pos="0 0 -0.001"/>
        <site name="eye" pos="0 0 {-HEIGHT}" euler="180 0 0"/></body>
      <body pos="0.0011 0.0023 0.005"><joint type="slide" axis="0 0 1"/>
        <geom type="box" size="0.005 0.009 0.005" euler="0 0 30" mass="0.5" condim="1"/></body></worldbody>
    <sensor><plugin plugin="mujoco.sensor.touch_grid" objtype="site" objname="eye"><config key="size" value="6 14"/>
      <config key="fov" value="{fov_x} 45"/><config key="gamma" value="0"/><config key="nchannel" value="1"/>
    </plugin></sensor></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=200)
    forces = np.array([contact_force(model, data, k) for k in range(data.ncon)])
    points, count = np.array(data.contact.pos), data.ncon
    assert count >= 4
    contacts = Contacts(points, np.tile([0.0, 0, 1], (count, 1)), forces, np.zeros(count, int), np.zeros(count))
    pad = dataclasses.replace(scene, array=TexelArray.grid(14, 6, 3.4e-3), plate=contacts)
    found = PUBLISHED["touch-grid"].predict(pad, field_of_view=45.0).texels.reshape(14, 6)
    # the site looks along its -z, turned about x, so that its y points along the array's -y
    np.testing.assert_allclose(found, np.abs(data.sensordata.reshape(14, 6))[::-1], atol=1e-9)
    assert found.sum() == pytest.approx(forces.sum())


def test_tactile_sensor_reads_the_rigid_penetration(scene):
    taxels = [(-2e-3, 0, 0), (1e-3, 1e-3, 0), (0, 1.5e-3, 0), (3e-3, -2e-3, 0), (0, 0, -3e-3)]
    text = " ".join(str(value) for taxel in taxels for value in taxel)
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><asset><mesh name="taxels" vertex="{text}"/></asset><worldbody>
      <body><geom type="box" size="{WIDTH} {HEIGHT} 0.001" pos="0 0 -0.001"/>
        <geom name="taxels" type="mesh" mesh="taxels" contype="0" conaffinity="0"/></body>
      <body pos="0.0005 0.0005 0.0098"><freejoint/><geom type="sphere" size="0.01"/></body></worldbody>
    <sensor><tactile geom="taxels" mesh="taxels"/></sensor></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    sensed = data.sensordata[:4]
    places = np.array(taxels)[:4]
    array = dataclasses.replace(
        TexelArray.grid(2, 2, 1e-3), centres=places, normals=np.tile([0.0, 0, 1], (4, 1)), pitch=(1e-3, 1e-3)
    )
    gaps = ((places[:, :2] - 0.5e-3) ** 2).sum(axis=1) / 0.02
    contacts = scene.contacts._replace(depths=-np.array(data.contact.dist))
    seen = dataclasses.replace(scene, array=array, contacts=contacts, texel_gaps=gaps)
    found = PUBLISHED["mujoco-tactile"].predict(seen, depth_factor=1.0).texels
    assert np.count_nonzero(sensed) == 2
    np.testing.assert_allclose(found, scene.load * sensed / sensed.sum(), atol=5e-3)


def contact_force(model, data, k):
    force = np.zeros(6)
    mujoco.mj_contactForce(model, data, k, force)
    return force[0]
