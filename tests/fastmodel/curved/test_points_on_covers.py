"""Contacts with a curved cover whose places, normals and forces were changed to known ones."""

import dataclasses

import mujoco
import numpy as np
import pytest

from fastmodel.contact.mesh import MeshContact
from tests.support.cover_data import dome_parameters, make_dome
from tests.support.scenes import make_spec

DOME = dataclasses.replace(make_dome(), influence=np.random.default_rng(2).uniform(0, 0.5, (4, 289)))
ARRAY = dome_parameters(DOME).array
METHOD = MeshContact(surface=DOME)
#: Places of contacts as indices of points of the dome, force along the normal there [N], and lean of the contact's
#: normal about a tangent [rad].
TOUCHES = [(40, 0.7, 0.4), (150, 1.1, -0.7), (231, 0.4, 0.0)]


def touch(separate):
    """Three balls of one body, or of one each, that press on the dome; model and data."""
    spec = make_spec(gravity=[0, 0, -30])
    METHOD.attach(spec.worldbody.add_frame(), ARRAY, "pad")
    body = None
    for x, y in ((-3e-3, 1e-3), (3e-3, 2e-3), (0.5e-3, -3e-3)):
        if body is None or separate:
            body = spec.worldbody.add_body()
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
        height = np.sqrt(11e-3**2 - x**2 - y**2) - 0.05e-3
        body.add_geom(size=[1e-3, 0, 0], pos=[x, y, height], mass=0.1)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    assert sorted(data.contact.geom.max(axis=1)) == [1, 2, 3]
    return model, data


def set_contacts(data, touches):
    """Place the contacts with the three balls beside points of the dome; positions and forces along their normals."""
    places, forces = np.zeros((3, 3)), np.zeros((3, 3))
    for k, (point, force, lean) in enumerate(touches):
        contact = int((data.contact.geom.max(axis=1) == k + 1).argmax())
        up = DOME.normals[point]
        tangent = np.cross(up, [0, 1.0, 0]) / np.linalg.norm(np.cross(up, [0, 1.0, 0]))
        normal = np.cos(lean) * up + np.sin(lean) * tangent
        places[k] = DOME.points[point] + 0.1e-3 * tangent - 0.05e-3 * up
        forces[k] = force * normal
        sign = 1 if data.contact.geom[contact, 0] == 0 else -1
        axes = sign * np.stack([normal, np.cross(normal, tangent), tangent])
        data.contact.pos[contact], data.contact.frame[contact] = places[k], axes.ravel()
        data.efc_force[data.contact.efc_address[contact] + np.arange(3)] = [force, 0.2, -0.3]
    return places, forces


def add_points(touches, forces):
    """Contact forces and texel forces under the parts of some forces along the normals of the points below."""
    texels, base = np.zeros(4), np.zeros(4)
    for (point, *_), force in zip(touches, forces, strict=True):
        pressing = max(force @ DOME.normals[point], 0)
        over = ARRAY.centres + DOME.thickness * ARRAY.normals
        texels[np.linalg.norm(over - DOME.points[point], axis=1).argmin()] += pressing
        base += DOME.influence[:, point] * pressing
    return texels, base


def test_points_press_along_the_normals_of_the_cover_below():
    """Friction does not count; the total force is the sum of the lengths of the pressing forces."""
    model, data = touch(separate=False)
    model.geom_type[1:] = mujoco.mjtGeom.mjGEOM_SDF
    places, forces = set_contacts(data, TOUCHES)
    reading = METHOD.bind(model, ARRAY, "pad").read(data)
    texels, base = add_points(TOUCHES, forces)
    np.testing.assert_allclose(reading.contact_forces, texels, atol=1e-12)
    np.testing.assert_allclose(reading.texel_forces, base, atol=1e-12)
    assert reading.carried == pytest.approx(2.2)
    torque = -np.cross(places, forces).sum(axis=0)
    np.testing.assert_allclose(reading.torques, [*torque, 0, 0, 0], atol=1e-12)
    assert (reading.fewest_cells, reading.approach, reading.wrench, reading.tangential) == (None, None, None, None)


@pytest.mark.parametrize(("lean", "counts"), [(1.5, True), (1.64, False), (np.pi, False)])
def test_a_contact_whose_normal_points_behind_the_cover_does_not_press(lean, counts):
    model, data = touch(separate=False)
    model.geom_type[1:] = mujoco.mjtGeom.mjGEOM_SDF
    touches = [*TOUCHES[:2], (231, 0.4, lean)]
    _, forces = set_contacts(data, touches)
    reading = METHOD.bind(model, ARRAY, "pad").read(data)
    texels, base = add_points(touches[: 2 + counts], forces[: 2 + counts])
    np.testing.assert_allclose(reading.contact_forces, texels, atol=1e-12)
    np.testing.assert_allclose(reading.texel_forces, base, atol=1e-12)
    assert reading.carried == pytest.approx(1.8 + 0.4 * counts)


def test_points_press_beside_bodies_of_known_shape():
    """Of three bodies one is known; what it adds is what it presses alone."""
    model, data = touch(separate=True)
    known = data.efc_force.copy()
    model.geom_type[1:3] = mujoco.mjtGeom.mjGEOM_SDF
    third = data.contact.efc_address[(data.contact.geom.max(axis=1) == 3).argmax()] + np.arange(3)
    pose = data.contact.pos.copy(), data.contact.frame.copy()
    _, forces = set_contacts(data, TOUCHES)
    contact = int((data.contact.geom.max(axis=1) == 3).argmax())
    data.contact.pos[contact], data.contact.frame[contact] = pose[0][contact], pose[1][contact]
    data.efc_force[third] = known[third]
    both = METHOD.bind(model, ARRAY, "pad").read(data)
    data.efc_force[:] = 0
    data.efc_force[third] = known[third]
    alone = METHOD.bind(model, ARRAY, "pad").read(data)
    texels, base = add_points(TOUCHES[:2], forces[:2])
    assert alone.contact_forces.sum() > 0.1
    np.testing.assert_allclose(both.contact_forces, alone.contact_forces + texels, atol=1e-9)
    np.testing.assert_allclose(both.texel_forces, alone.texel_forces + base, atol=1e-9)
    assert both.carried == pytest.approx(alone.carried + 1.8)
    assert both.fewest_cells == alone.fewest_cells
    assert both.fewest_cells > 20
    # the guide bears what acts across the slide; of the force along it nothing is lost
    assert alone.carried == pytest.approx(known[third[0]] * abs(pose[1][contact].reshape(3, 3)[0, 2]), rel=1e-9)
    matrix = METHOD.bind(model, ARRAY, "pad").at_rest(np.zeros(4))
    assert not matrix.texel_forces.any()


def test_a_body_that_no_normal_of_the_cover_meets_presses_at_its_contact_point():
    model, data = touch(separate=True)
    _, forces = set_contacts(data, TOUCHES)
    data.efc_force[:] = 0
    contact = int((data.contact.geom.max(axis=1) == 2).argmax())
    data.efc_force[data.contact.efc_address[contact]] = TOUCHES[1][1]
    data.geom_xpos[2] += [0.5, 0, 0]
    reading = METHOD.bind(model, ARRAY, "pad").read(data)
    texels, base = add_points(TOUCHES[1:2], forces[1:2])
    np.testing.assert_allclose(reading.contact_forces, texels, atol=1e-12)
    np.testing.assert_allclose(reading.texel_forces, base, atol=1e-12)
    assert reading.carried == pytest.approx(TOUCHES[1][1])


def test_forces_that_are_no_numbers_are_refused_with_geom_and_time():
    model, data = touch(separate=False)
    data.efc_force[1], data.time = np.nan, 0.25
    with pytest.raises(ValueError, match=r"contact forces on geom 'pad/plate' are not finite at t = 0\.25 s"):
        METHOD.bind(model, ARRAY, "pad").read(data)
    data.efc_force[:] = 0
    nothing = METHOD.bind(model, ARRAY, "pad").read(data)
    assert (nothing.carried, nothing.contact_forces.tolist(), nothing.texel_forces.tolist()) == (0, [0] * 4, [0] * 4)
