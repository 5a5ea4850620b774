"""Which geoms can touch an array, against what MuJoCo collides; points on boxes; shapes that follow the model."""

import mujoco
import numpy as np
import pytest

from fastmodel.contact.bodies import (
    EVERY,
    Bodies,
    NameInModel,
    add_geoms,
    check_box,
    find_geoms,
    find_obstacles,
    number_geoms,
    sample_boxes,
)
from fastmodel.errors import LifeCycleError
from meshes import Box, Cylinder, Nut, RoundedTip, Sphere

HINGE = mujoco.mjtJoint.mjJNT_HINGE


def build_crowd(*, moving, filtered, masks):
    """A plate on a holder and balls that all overlap it: on its own body, its parent, its child, and beside it."""
    spec = mujoco.MjSpec()
    if not filtered:
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    spec.option.gravity[:] = 0

    def ball(body, name, **changes):
        body.add_geom(name=name, size=[0.01, 0, 0], pos=[0.001 * len(spec.geoms), 0, 0], mass=0.1, **changes)

    def add(parent, name, joint=True):
        body = parent.add_body(name=name)
        if joint:
            body.add_joint(type=HINGE, axis=[0, 0, 1])
        ball(body, name)
        return body

    ball(spec.worldbody, "world")
    base = add(spec.worldbody, "base", joint=moving)
    holder = add(base, "holder", joint=moving)
    array = holder.add_body(name="array")
    box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": [0.02, 0.02, 0.01], "mass": 0.1}
    array.add_geom(name="plate", contype=masks[0], conaffinity=masks[1], **box)
    add(array, "fixed", joint=False)
    child = add(array, "child")
    add(child, "grandchild")
    add(add(array, "welded", joint=False), "welded child")
    for name, contype, conaffinity in (("one", 1, 0), ("two", 0, 1), ("four", 4, 8), ("never", 0, 0), ("pair", 0, 0)):
        body = spec.worldbody.add_body(name=name)
        body.add_freejoint()
        ball(body, name, contype=contype, conaffinity=conaffinity)
    spec.add_pair(geomname1="pair", geomname2="plate")
    spec.add_pair(geomname1="plate", geomname2="fixed")
    add(spec.worldbody, "excluded")
    add(spec.worldbody, "excluded first")
    spec.add_exclude(bodyname1="array", bodyname2="excluded")
    spec.add_exclude(bodyname1="excluded first", bodyname2="array")
    spec.add_exclude(bodyname1="one", bodyname2="holder")
    return spec.compile()


@pytest.mark.parametrize("masks", [(EVERY, EVERY), (1, 0), (0, 4), (8, 0)])
@pytest.mark.parametrize(("moving", "filtered"), [(True, True), (True, False), (False, True)])
def test_geoms_without_a_reason_against_contact_are_those_that_mujoco_collides(moving, filtered, masks):
    model = build_crowd(moving=moving, filtered=filtered, masks=masks)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    plate = model.geom("plate").id
    pairs = data.contact.geom[(data.contact.geom == plate).any(axis=1)]
    collided = {model.geom(geom).name for geom in np.unique(pairs) if geom != plate}
    reasons = find_obstacles(model, np.array([plate]))
    free = {model.geom(geom).name for geom in (reasons == "").nonzero()[0]}
    assert free == collided
    assert len(collided) > 1
    known = {
        "never": "no bit of contype",
        "excluded": "an <exclude> names both",
        "excluded first": "an <exclude> names both",
        "plate": "no joint lies between",
    }
    if moving and filtered:
        known |= {"child": "no parent and child", "base": "no parent and child"}
    if masks == (EVERY, EVERY):
        for name, text in known.items():
            assert text in reasons[model.geom(name).id]


def test_geoms_are_found_and_numbered_by_name_and_suffix():
    spec = mujoco.MjSpec()
    for name in ("b", "a", "a_left", "c"):
        spec.worldbody.add_geom(name=name, size=[0.01, 0, 0])
    model = spec.compile()
    np.testing.assert_array_equal(find_geoms(model, ["c", "a"], "a"), [3, 1])
    np.testing.assert_array_equal(find_geoms(model, ["a"], NameInModel("a", "_left")), [2])
    np.testing.assert_array_equal(number_geoms(model, np.array([3, 1])), [-1, 1, -1, 0, -1])
    with pytest.raises(LifeCycleError, match="geom 'c_left' is not in this model"):
        find_geoms(model, ["a", "c"], NameInModel("a", "_left"))
    assert (NameInModel("x").suffix, NameInModel("x", "y") == "x") == ("", True)


@pytest.mark.parametrize(
    ("height", "contype", "conaffinity", "message"),
    [
        (0.0, 1, 1, "height"),
        (-1e-3, 1, 1, "height"),
        (np.inf, 1, 1, "height"),
        (1e-3, -1, 1, "contype"),
        (1e-3, EVERY + 1, 1, "contype"),
        (1e-3, 1, -1, "conaffinity"),
        (1e-3, 1, 0.5, "conaffinity"),
    ],
)
def test_heights_and_masks_out_of_range_are_refused(height, contype, conaffinity, message):
    with pytest.raises(ValueError, match=message):
        check_box(height, contype, conaffinity)
    check_box(1e-9, 0, EVERY)
    check_box(1e-3, EVERY, 0)


@pytest.mark.parametrize(
    ("inset", "spacing", "counts"),
    [(0.0, 1e-3, (4, 6)), (0.5e-3, 1e-3, (3, 5)), (0.0, 1.1e-3, (4, 6)), (0.0, 0.9e-3, (5, 7)), (5e-3, 1e-3, (1, 1))],
)
def test_points_divide_the_faces_of_boxes_evenly(inset, spacing, counts):
    """Two turned boxes of 4 mm x 6 mm; an inset beyond the middle leaves one point."""
    spec = mujoco.MjSpec()
    turn = [0.8, 0.2, -0.4, 0.4]
    for place in ([0.1, 0.2, 0.3], [0, 0, 0.1]):
        box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": [2e-3, 3e-3, 0.5e-3]}
        spec.worldbody.add_geom(pos=place, quat=turn, **box)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points, normals = sample_boxes(model, data, np.array([1, 0]), inset=inset, spacing=spacing)
    assert len(points) == 2 * counts[0] * counts[1]
    axes = data.geom_xmat[0].reshape(3, 3)
    np.testing.assert_allclose(normals, np.tile(axes[:, 2], (len(points), 1)))
    for part, geom in zip(np.split(points, 2), (1, 0), strict=True):
        local = (part - data.geom_xpos[geom]) @ axes
        np.testing.assert_allclose(local[:, 2], 0.5e-3, atol=1e-15)
        for axis, (half, count) in enumerate(zip((2e-3, 3e-3), counts, strict=True)):
            width = 2 * max(half - inset, 0)
            expected = (np.arange(count) + 0.5) / count * width - width / 2
            np.testing.assert_allclose(np.unique(local[:, axis].round(12)), expected, atol=1e-12)


@pytest.mark.parametrize(("boxes", "spacing", "each"), [(1, 1e-5, 1600), (2, 1e-3 / 16, 1), (2, 1e-3 / 15, 900)])
def test_points_on_many_boxes_are_limited(boxes, spacing, each):
    """40 along a side; 2000 points at most on several boxes, which otherwise have one each."""
    spec = mujoco.MjSpec()
    for _ in range(boxes):
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[1e-3, 1e-3, 1e-3])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points, _ = sample_boxes(model, data, np.arange(boxes), inset=0.0, spacing=spacing)
    assert len(points) == boxes * each


def build_bodies():
    """A plate, a tool of two geoms and a mesh on a slide, a height field, and a ball that collides with nothing."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(name="plate", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.01, 0.01, 0.001])
    spec.add_mesh(name="tetra", uservert=[0, 0, 0, 1e-2, 0, 0, 0, 1e-2, 0, 0, 0, 1e-2])
    spec.add_hfield(name="ground", nrow=3, ncol=3, size=[1, 1, 1, 1], userdata=[0.0] * 9)
    tool = spec.worldbody.add_body(name="tool")
    tool.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    tool.add_geom(name="ball", size=[2e-3, 0, 0])
    tool.add_geom(name="ghost", size=[1e-3, 0, 0], contype=0, conaffinity=0)
    tip = tool.add_body(name="tip")
    tip.add_geom(name="mesh", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="tetra")
    hill = spec.worldbody.add_body(name="hill")
    hill.add_freejoint()
    hill.add_geom(name="hill", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", mass=1)
    return spec.compile()


def test_shapes_of_bodies_follow_the_model():
    model = build_bodies()
    plate, ball, ghost, mesh, hill = (model.geom(name).id for name in ("plate", "ball", "ghost", "mesh", "hill"))
    bodies, tool = Bodies(model, np.array([plate]), "pad", 1e-4), model.body("tool").id
    assert bodies.of_geom[[plate, ball, ghost, mesh, hill, -1]].tolist() == [0, tool, tool, tool, -1, -1]
    bodies.find_shapes()
    geoms, shape = bodies.find_shape(tool)
    assert geoms.tolist() == sorted([ball, mesh])  # the tip has no joint of its own, and the ghost never touches
    assert shape.edge == 1e-4
    assert len(shape.kinds) == 2
    bodies.follow_changes()
    bodies.follow_meshes()
    assert bodies.find_shape(tool)[1] is shape
    model.geom_contype[ghost] = 1
    bodies.follow_changes()
    assert bodies.find_shape(tool)[0].tolist() == sorted([ball, ghost, mesh])
    before = bodies.find_shape(tool)[1]
    model.mesh_vert[0] *= 1.5
    bodies.follow_meshes()
    assert bodies.find_shape(tool)[1] is not before
    model.geom_size[ball, 0] = 5e-3
    bodies.follow_changes()
    assert 5e-3 in bodies.find_shape(tool)[1].sizes
    model.geom_size[plate, 0] = 0.02
    with pytest.raises(LifeCycleError, match="'pad' have another size"):
        bodies.check_size()


@pytest.mark.parametrize("shape", [Sphere(radius=3e-3), Box(size=(2e-3, 3e-3, 4e-3)), Cylinder(radius=2e-3)])
def test_the_parts_of_an_indenter_become_geoms_without_mass(shape):
    assert_like(shape)
    assert_like(Nut(across=13e-3, bore=8e-3))
    assert_like(RoundedTip())


def assert_like(indenter):
    spec = mujoco.MjSpec()
    add_geoms(spec, spec.worldbody.add_body(mass=1, inertia=[1, 1, 1]), indenter, name="tool")
    model, parts = spec.compile(), indenter.primitives()
    assert model.ngeom == len(parts)
    assert model.body_mass[1] == 1
    for geom, part in enumerate(parts):
        kind = mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
        assert kind == ("mesh" if part.vertices else part.kind)
        if not part.vertices:
            np.testing.assert_allclose(model.geom_size[geom, : len(part.size)], part.size)
            np.testing.assert_allclose(model.geom_pos[geom], part.position)
            np.testing.assert_allclose(model.geom_quat[geom], part.quaternion, atol=1e-12)
