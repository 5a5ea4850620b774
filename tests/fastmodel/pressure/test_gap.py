import mujoco
import numpy as np
import pytest

from fastmodel import FastModelError
from fastmodel.pressure.gap import BodyShape, PosedBody, describe_solid
from fastmodel.pressure.gap_kernels import _cross_solid, _transform_faces

KINDS = {
    "sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, [4e-3, 0, 0]),
    "ellipsoid": (mujoco.mjtGeom.mjGEOM_ELLIPSOID, [3e-3, 5e-3, 7e-3]),
    "capsule": (mujoco.mjtGeom.mjGEOM_CAPSULE, [2e-3, 4e-3, 0]),
    "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, [3e-3, 5e-3, 0]),
    "box": (mujoco.mjtGeom.mjGEOM_BOX, [3e-3, 5e-3, 2e-3]),
    "mesh": (mujoco.mjtGeom.mjGEOM_MESH, [0, 0, 0]),
}


def build_model(kind, quaternion, rng):
    spec = mujoco.MjSpec()
    geom, size = KINDS[kind]
    if kind == "mesh":
        spec.add_mesh(name="hull", uservert=(rng.normal(size=(20, 3)) * 3e-3).ravel().tolist())
    spec.worldbody.add_geom(
        type=geom, size=size, pos=[1e-3, -2e-3, 8e-3], quat=quaternion, meshname="hull" if kind == "mesh" else ""
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def find_heights(solid, rotation, position, x, y):
    """Heights of the solid's lower surface at places, inf where there is none: along rows, and along single lines."""
    shape = BodyShape.of([solid])
    bottom, top = np.empty(len(x)), np.empty(len(x))
    faces = _transform_faces(solid.planes, rotation, position)
    for k in range(len(x)):
        body = (shape.arrays, 0.0, rotation[None], position[None])
        _cross_solid(body, 0, faces, (x, y[k], k, k + 1), bottom, top)
    points, up = np.column_stack([x, y, np.full(len(x), -1.0)]), np.tile([0.0, 0, 1], (len(x), 1))
    alone = PosedBody(shape=shape, rotation=rotation[None], position=position[None]).measure_gaps(points, up) - 1
    return np.where((-np.inf < bottom) & (bottom <= top), bottom, np.inf), alone


@pytest.mark.parametrize("kind", KINDS)
def test_lower_surfaces_lie_where_rays_from_below_hit(kind):
    rng = np.random.default_rng(4)
    for turn in ([1.0, 0, 0, 0], [np.sqrt(0.5), 0, np.sqrt(0.5), 0], *rng.normal(size=(4, 4))):
        model, data = build_model(kind, turn, rng)
        x, y = rng.uniform(-9e-3, 9e-3, (2, 150))
        solid, rotation = describe_solid(model, 0), data.geom_xmat[0].reshape(3, 3)
        found, alone = find_heights(solid, rotation, data.geom_xpos[0], x, y)
        np.testing.assert_allclose(alone, found, atol=1e-12)
        hit = np.zeros(1, dtype=np.int32)
        rays = np.array(
            [
                mujoco.mj_ray(model, data, np.array([a, b, -1.0]), np.array([0, 0, 1.0]), None, 1, -1, hit, None)
                for a, b in zip(x, y, strict=True)
            ]
        )
        struck = rays >= 0
        assert struck.sum() > 5
        np.testing.assert_array_equal(np.isfinite(found), struck)
        np.testing.assert_allclose(found[struck], rays[struck] - 1, atol=1e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_bounding_boxes_are_those_of_mujoco_and_hold_the_enlarged_solid(kind):
    model, _ = build_model(kind, [1, 0, 0, 0], np.random.default_rng(0))
    plain, enlarged = describe_solid(model, 0), describe_solid(model, 0, edge=1e-4)
    np.testing.assert_allclose([*plain.centre, *plain.half], model.geom_aabb[0], rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(enlarged.centre, plain.centre)
    np.testing.assert_allclose(enlarged.half, plain.half + 1e-4)
    np.testing.assert_allclose(enlarged.planes[:, 3], plain.planes[:, 3] + 1e-4)


def test_planes_that_equal_meshes_share_cannot_be_changed():
    model, _ = build_model("mesh", [1, 0, 0, 0], np.random.default_rng(0))
    one, other = describe_solid(model, 0), describe_solid(model, 0)
    assert np.shares_memory(one.planes, other.planes)
    with pytest.raises(ValueError, match="read-only"):
        one.planes[0, 3] += 1e-3


def test_height_fields_are_refused_by_name():
    spec = mujoco.MjSpec()
    spec.add_hfield(name="ground", nrow=3, ncol=3, size=[1, 1, 1, 1], userdata=[0.0] * 9)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", name="hills")
    with pytest.raises(FastModelError, match=r"'hills' \(id 0\) of body 'world' is of type mjGEOM_HFIELD"):
        describe_solid(spec.compile(), 0)
