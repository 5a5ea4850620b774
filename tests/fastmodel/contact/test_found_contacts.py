"""Loads, poses and contact points that readers find on turned arrays, against sums of `mj_contactForce`."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fastmodel import Foundation
from fastmodel.contact.mesh import MeshContact
from tests.support.bent_array import bent_array
from tests.support.cover_data import dome_parameters, make_dome
from tests.support.scenes import make_spec

TURN, PLACE = Rotation.from_rotvec([0.3, -0.5, 0.9]), np.array([0.1, -0.2, 0.3])
BENT, DOME = bent_array(), make_dome()
PITCH = 3.4e-3
#: Method, array, and for each of three bodies its kind, its size and the place of its lowest point.
CASES = {
    "panels": (
        Foundation(modulus=5e8),
        BENT,
        [
            ("box", [3e-3, 4e-3, 1e-3], [0.2e-3, 0.4e-3, -0.1e-3]),
            ("sphere", [2e-3], [-2e-3, -4.2e-3, -1.9e-3]),
            ("capsule", [1e-3, 3e-3], [4.9e-3, 3.2e-3, -1.0e-3]),
        ],
    ),
    "curved": (
        MeshContact(surface=DOME),
        dome_parameters(DOME).array,
        [
            ("box", [3e-3, 4e-3, 1e-3], [0.2e-3, 0.4e-3, 9.9e-3]),
            ("sphere", [2e-3], [-3e-3, -4.2e-3, 7.9e-3]),
            ("capsule", [1e-3, 3e-3], [4.9e-3, 2.2e-3, 7.8e-3]),
        ],
    ),
}
JOINTS = ("free", "slide", "none")


def build(method, array, bodies, *, floating):
    """Bodies that overlap a turned array: a free one, one on a slide, and one that does not move; model and data."""
    spec = make_spec(gravity=[0, 0, 0])
    quaternion = TURN.as_quat(scalar_first=True).tolist()
    holder = spec.worldbody.add_body(pos=PLACE, quat=quaternion)
    if floating:
        holder.add_freejoint()
    holder.add_geom(size=[1e-3, 0, 0], pos=[0, 0, -0.1], mass=1, contype=0, conaffinity=0)
    method.attach(holder.add_frame(), array, "pad")
    for (kind, size, place), joint in zip(bodies, JOINTS, strict=True):
        middle = np.add(place, [0, 0, size[-1] if kind != "capsule" else size[0]])
        turn = TURN * Rotation.from_rotvec([0, np.pi / 2 * (kind == "capsule"), 0.2 * (kind == "box")])
        body = spec.worldbody.add_body(pos=TURN.apply(middle) + PLACE, quat=turn.as_quat(scalar_first=True).tolist())
        if joint == "free":
            body.add_freejoint()
        if joint == "slide":
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0.6, 0.8])
        shape = getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")
        body.add_geom(type=shape, size=[*size, 0, 0][:3], mass=0.1, condim=3, conaffinity=0)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    random = np.random.default_rng(1)
    for contact in range(data.ncon):
        first = data.contact.efc_address[contact]
        data.efc_force[first : first + 3] = [random.uniform(0.5, 1), *random.uniform(-0.3, 0.3, 2)]
    return model, data


def list_contacts(model, data):
    """Body, part of the array, normal away from it, force on the body, both parts, place and depth of each contact."""
    found, local, name = [], np.zeros(6), mujoco.mjtObj.mjOBJ_GEOM
    for k, contact in enumerate(data.contact):
        names = [mujoco.mj_id2name(model, name, geom) or "" for geom in contact.geom]
        own = [each.startswith("pad/") for each in names].index(True)
        mujoco.mj_contactForce(model, data, k, local)
        axes = TURN.inv().apply(contact.frame.reshape(3, 3)) * (1 if own == 0 else -1)
        part = int(names[own].removeprefix("pad/plate") or 0)
        body = int(model.body_weldid[model.geom_bodyid[contact.geom[1 - own]]])  # 0 for one that does not move
        place = TURN.inv().apply(contact.pos - PLACE)
        found.append((body, part, axes[0], local[0] * axes[0], local[1:3] @ axes[1:], place, -contact.dist))
    return found


#: Half edges of a panel of one row of three texels, less half a cell.
LIMITS = np.array([1.5 * PITCH, 0.5 * PITCH]) - PITCH / 8


def sum_up(name, array, contacts):
    """Force, moment and depth of each body, its contact points as rows, and the force beside the front."""
    loads, depths, rows, beside = {}, {}, [], 0.0
    for body, part, outward, pressure, friction, place, depth in contacts:
        up, force = array.normals[3 * part], pressure
        if name == "curved":
            up = DOME.normals[np.linalg.norm(DOME.points - place, axis=1).argmin()]
        else:
            force = pressure + friction @ up * up
        depths[body] = max(depths.get(body, 0), depth)
        if outward @ up < (0.1 if name == "panels" else 0):
            beside += force @ up
            continue
        loads[body] = loads.get(body, 0) + np.array([force, np.cross(place, force)])
        row = [*place, *pressure]
        if name == "panels":
            away = place - array.centres[3 * part + 1]
            x, y = np.clip([away[0], away @ np.cross(up, [1.0, 0, 0])], -LIMITS, LIMITS)
            row = [x, y + (part - 1) * PITCH, force @ up]
        rows.append((body, row))
    return loads, depths, rows, beside


@pytest.mark.parametrize("floating", [True, False])
@pytest.mark.parametrize("name", CASES)
def test_loads_are_the_sums_of_pressing_forces_and_of_their_moments(name, floating):
    """On panels friction counts by its part along the normal of the panel, on a curved cover not at all."""
    method, array, bodies = CASES[name]
    model, data = build(method, array, bodies, floating=floating)
    contact, _ = method.bind(model, array, "pad").find_contact(data)
    loads, depths, rows, beside = sum_up(name, array, list_contacts(model, data))
    assert sorted(contact.bodies) == sorted(loads)
    assert len(loads) == 2 + floating  # nothing collides with what cannot move against it
    for body, load, pose in zip(contact.bodies, contact.loads, contact.poses, strict=True):
        np.testing.assert_allclose([load.vector, load.moment], loads[body], atol=1e-12)
        assert pose.depth == pytest.approx(depths[body])
        geom = model.ngeom - 1 if body == 0 else int(model.body_geomadr[body])
        axes = TURN.inv().as_matrix() @ data.geom_xmat[geom].reshape(3, 3)
        np.testing.assert_allclose(pose.rotation[0], axes, atol=1e-12)
        np.testing.assert_allclose(pose.position[0], TURN.inv().apply(data.geom_xpos[geom] - PLACE), atol=1e-12)
        slides = not floating and model.jnt_type[model.body_jntadr[body]] == mujoco.mjtJoint.mjJNT_SLIDE
        assert (len(load.directions), len(load.turns)) == ((1, 0) if slides else (3, 2))
        if slides:
            along = np.array([0, 0.6, 0.8])
            np.testing.assert_allclose(load.directions, [along * np.sign(along @ load.vector)], atol=1e-12)
    np.testing.assert_array_equal(np.array(contact.bodies)[contact.owner], [body for body, _ in rows])
    np.testing.assert_allclose(contact.touches, [row for _, row in rows], atol=1e-9)
    assert not len(contact.points)
    assert contact.beside == pytest.approx(beside if name == "panels" else 0)
