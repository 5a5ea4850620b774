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


@pytest.mark.parametrize("kind", KINDS)
def test_lines_enter_solids_where_mujocos_rays_hit_them(kind):
    """Upright ones over cells, as the gap is sampled, and any ones, as it is measured over a mesh."""
    rng = np.random.default_rng(4)
    for turn in ([1.0, 0, 0, 0], [np.sqrt(0.5), 0, np.sqrt(0.5), 0], *rng.normal(size=(4, 4))):
        model, data = build_model(kind, turn, rng)
        solid, rotation, position = describe_solid(model, 0), data.geom_xmat[0].reshape(3, 3), data.geom_xpos[0]
        body = PosedBody(shape=BodyShape.of([solid]), rotation=rotation[None], position=position[None])
        along = rng.normal(size=(150, 3))
        along[:75] = [0, 0, 1]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        points = position + rng.uniform(-7e-3, 7e-3, (150, 3)) - along
        hit = np.zeros(1, dtype=np.int32)
        rays = [mujoco.mj_ray(model, data, *line, None, 1, -1, hit, None) for line in zip(points, along, strict=True)]
        rays, found = np.array(rays), body.measure_gaps(points, along)
        assert (rays >= 0).sum() > 10
        np.testing.assert_array_equal(np.isfinite(found), rays >= 0)
        np.testing.assert_allclose(found[rays >= 0], rays[rays >= 0], atol=1e-7)
        x, y = points[:75, 0].copy(), points[:75, 1]
        bottom, top = np.empty(75), np.empty(75)
        faces = _transform_faces(solid.planes, rotation, position)
        for k in range(75):
            _cross_solid(
                (body.shape.arrays, 0.0, body.rotation, body.position), 0, faces, (x, y[k], k, k + 1), bottom, top
            )
        heights = np.where((-np.inf < bottom) & (bottom <= top), bottom, np.inf)
        np.testing.assert_allclose(found[:75] + points[:75, 2], heights, atol=1e-12)


def test_a_body_behind_a_point_is_not_met_and_one_around_it_is_negative():
    model, _ = build_model("sphere", [1, 0, 0, 0], np.random.default_rng(0))
    ball = PosedBody(
        shape=BodyShape.of([describe_solid(model, 0)]), rotation=np.eye(3)[None], position=np.zeros((1, 3))
    )
    points, up = np.array([[0, 0, 6e-3], [0, 0, 1e-3], [3e-3, 0, -5e-3]]), np.tile([0.0, 0, 1], (3, 1))
    np.testing.assert_allclose(ball.measure_gaps(points, up), [np.inf, -5e-3, 5e-3 - np.sqrt(7e-6)], rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_bounding_boxes_are_those_of_mujoco_and_hold_the_enlarged_solid(kind):
    model, _ = build_model(kind, [1, 0, 0, 0], np.random.default_rng(0))
    plain, enlarged = describe_solid(model, 0), describe_solid(model, 0, edge=1e-4)
    np.testing.assert_allclose([*plain.centre, *plain.half], model.geom_aabb[0], rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(enlarged.centre, plain.centre)
    np.testing.assert_allclose(enlarged.half, plain.half + 1e-4)
    np.testing.assert_allclose(enlarged.planes[:, 3], plain.planes[:, 3] + 1e-4)


def test_height_fields_are_refused_by_name():
    spec = mujoco.MjSpec()
    spec.add_hfield(name="ground", nrow=3, ncol=3, size=[1, 1, 1, 1], userdata=[0.0] * 9)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", name="hills")
    with pytest.raises(FastModelError, match=r"'hills' \(id 0\) of body 'world' is of type mjGEOM_HFIELD"):
        describe_solid(spec.compile(), 0)
