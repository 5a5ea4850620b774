"""Readings on bent and curved arrays: those that are adapted to slight changes, and their torques."""

import dataclasses

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel.contact.mesh import MeshContact
from meshes import TexelArray
from tests.support.bent_array import bent_array
from tests.support.cover_data import cells, dome_parameters, make_dome
from tests.support.scenes import add_body, make_spec

BENT, DOME = bent_array(), make_dome()
DOME_ARRAY = dome_parameters(DOME).array
CELLS = cells(TexelArray.grid(3, 3, 3.4e-3), per_texel=4, reach=6)
METHODS = {
    "foundation": (fastmodel.Foundation(modulus=5e8), BENT, CELLS, 0.0),
    "cover": (fastmodel.CoverContact(tolerance=1e-6), BENT, CELLS, 0.0),
    "curved": (MeshContact(surface=DOME), DOME_ARRAY, DOME, 10e-3),
}


def press(name, *, free):
    """A block that rests on the top, free or on slides along two axes; two readers, model and data."""
    contact, array, surface, top = METHODS[name]
    spec = make_spec(gravity=[0.3, 0.2, -9.8])
    contact.attach(spec.worldbody.add_frame(), array, "pad")
    joints = {"free": True} if free else {"slides": "yz", "damping": 1.0}
    shape = ("box", [3e-3, 2.5e-3, 2e-3]) if free else ("sphere", [5e-3])
    add_body(spec, *shape, [0.3e-3, 0.4e-3, top + shape[1][-1]], mass=0.2, **joints)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 25)
    return [contact.bind(model, array, "pad", surface=surface) for _ in range(2)], data, array


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("name", METHODS)
def test_a_reading_that_is_adapted_equals_one_that_is_solved(name, free):
    (kept, fresh), data, _ = press(name, free=free)
    first = kept.read(data)
    assert first.carried > 0.5
    data.efc_force[:] *= np.random.default_rng(5).uniform(1.003, 1.007, len(data.efc_force))
    found, exact = kept.read(data), fresh.read(data)
    assert kept.get_state()["change"] > 0  # since a contact was last solved
    assert fresh.get_state()["change"] == 0
    for one, other, before in (
        (found.contact_forces, exact.contact_forces, first.contact_forces),
        (found.texel_forces, exact.texel_forces, first.texel_forces),
    ):
        changed = np.abs(other - before).sum()
        assert changed > 1e-3
        assert np.abs(one - other).sum() < 0.5 * changed
    assert found.carried == pytest.approx(exact.carried, rel=2e-4)
    whole = [each.torques[:3] + each.torques[3:] for each in (found, exact)]
    if free:  # the pressure and what it lacks have the torque of the contacts about the axes of free turns
        np.testing.assert_allclose(*whole, atol=2e-2 * np.abs(whole[1]).max())
    else:
        np.testing.assert_array_equal(found.torques[3:], 0)


@pytest.mark.parametrize("name", METHODS)
def test_given_forces_on_texels_have_their_torque_and_reach_the_base(name):
    (reader, _), _, array = press(name, free=False)
    forces = np.linspace(0.1, 0.5, array.count)
    reading = reader.at_rest(forces)
    torque = -sum(np.cross(c, force * n) for c, n, force in zip(array.centres, array.normals, forces, strict=True))
    np.testing.assert_allclose(reading.torques, [*torque, 0, 0, 0], atol=1e-15)
    assert reading.carried == pytest.approx(forces.sum())
    np.testing.assert_array_equal(reading.contact_forces, forces)
    if name == "curved":  # at the point of the top over each texel
        expected = np.zeros(4)
        for centre, normal, force in zip(array.centres, array.normals, forces, strict=True):
            over = centre + DOME.thickness * normal
            nearest = np.linalg.norm(DOME.points - over, axis=1).argmin()
            expected += force * DOME.influence[:, nearest]
        np.testing.assert_allclose(reading.texel_forces, expected)


def test_points_of_a_curved_cover_stand_for_its_top_in_a_turned_frame():
    contact, quaternion = METHODS["curved"][0], [0.8, 0.4, -0.2, 0.4]
    spec = mujoco.MjSpec()
    contact.attach(spec.worldbody.add_frame(pos=[0.1, 0.2, 0.3], quat=quaternion), DOME_ARRAY, "pad")
    spec.worldbody.add_site(name="there", pos=[0.1, 0.2, 0.3], quat=quaternion)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points, normals = contact.sample_top(model, data, np.array([0]), DOME_ARRAY)
    axes = data.site("there").xmat.reshape(3, 3)
    np.testing.assert_allclose(points, DOME.points @ axes.T + [0.1, 0.2, 0.3], atol=1e-8)
    np.testing.assert_allclose(normals, DOME.normals @ axes.T, atol=1e-7)
    assert (model.geom_contype[0], model.geom_conaffinity[0]) == (contact.contype, contact.conaffinity)
    assert contact.pressed_points is DOME
    assert contact.find_start(DOME_ARRAY, (0, 0), 1.0) == DOME.points[:, 2].max()
    changed = dataclasses.replace(contact, contype=2, conaffinity=4)
    spec = mujoco.MjSpec()
    changed.attach(spec.worldbody.add_frame(), DOME_ARRAY, "pad")
    assert (spec.geoms[0].contype, spec.geoms[0].conaffinity) == (2, 4)


@pytest.mark.parametrize(
    ("at", "reach", "height"),
    [((0, 0), 1e-3, 0.0), ((0, 3.4e-3), 1e-3, -8.5e-3 * (1 - np.cos(0.4))), ((0, 3.4e-3), 9e-3, 0.0)],
)
def test_a_body_starts_above_the_highest_texel_under_it(at, reach, height):
    """Not below the origin, and on an array that is not flat a pitch higher."""
    start = fastmodel.Foundation().find_start(BENT, at, reach)
    assert start == pytest.approx(max(height, 0) + 3.4e-3)
    lifted = dataclasses.replace(BENT, centres=np.add(BENT.centres, [0, 0, 5e-3]))
    assert fastmodel.Foundation().find_start(lifted, at, reach) == pytest.approx(
        (height if height and reach < 2e-3 else 0) + 5e-3 + 3.4e-3
    )
    assert fastmodel.Foundation().find_start(TexelArray.grid(3, 3, 3e-3), at, reach) == 0
