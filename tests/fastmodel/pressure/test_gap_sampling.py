import mujoco
import numpy as np
import pytest

from fastmodel import FastModelError
from fastmodel.pressure.gap import solid
from fastmodel.pressure.gap_sampling import sample
from meshes import Box, Cylinder, LetterH, Nut
from tests.support.gap_samples import GRID, standing

KINDS = {
    "sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, [4e-3, 0, 0]),
    "ellipsoid": (mujoco.mjtGeom.mjGEOM_ELLIPSOID, [3e-3, 5e-3, 7e-3]),
    "capsule": (mujoco.mjtGeom.mjGEOM_CAPSULE, [2e-3, 4e-3, 0]),
    "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, [3e-3, 5e-3, 0]),
    "box": (mujoco.mjtGeom.mjGEOM_BOX, [3e-3, 5e-3, 2e-3]),
    "mesh": (mujoco.mjtGeom.mjGEOM_MESH, [0, 0, 0]),
}


def model_of(kind, quaternion, rng):
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
def test_undersides_are_where_rays_from_below_hit(kind):
    rng = np.random.default_rng(4)
    for turn in ([1.0, 0, 0, 0], [np.sqrt(0.5), 0, np.sqrt(0.5), 0], *rng.normal(size=(4, 4))):
        model, data = model_of(kind, turn, rng)
        x, y = rng.uniform(-9e-3, 9e-3, (2, 150))
        found = solid(model, 0).lower(x, y, data.geom_xmat[0].reshape(3, 3), data.geom_xpos[0])
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


def test_height_fields_are_refused_by_name():
    spec = mujoco.MjSpec()
    spec.add_hfield(name="ground", nrow=3, ncol=3, size=[1, 1, 1, 1], userdata=[0.0] * 9)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", name="hills")
    with pytest.raises(FastModelError, match=r"'hills' is of type mjGEOM_HFIELD; .* take planes, spheres"):
        solid(spec.compile(), 0)


AREAS = {
    "box": (Box(size=(12e-3, 6e-3, 5e-3)), 72e-6),
    "circle": (Cylinder(radius=5e-3), np.pi * 25e-6),
    "nut": (Nut(across=13e-3, bore=8e-3), (np.sqrt(3) / 2 * 169 - np.pi * 16) * 1e-6),
    "h": (LetterH(size=(12e-3, 16e-3), bar=4e-3), 144e-6),
    "blade": (Box(size=(0.3e-3, 15e-3, 5e-3)), 4.5e-6),
}


@pytest.mark.parametrize("native", [False, True], ids=["numpy", "numba"])
@pytest.mark.parametrize("name", AREAS)
def test_covered_area_is_the_faces_own(name, native):
    """Parts that share an edge over one cell count once; a thin blade is not missed."""
    if native:
        pytest.importorskip("numba")
    indenter, area = AREAS[name]
    for yaw in (0.0, 0.3, np.pi / 4):
        found = sample(GRID, [standing(indenter, yaw=yaw)], [1e-3], native=native)
        tolerance = 0.45 if name == "blade" else 0.03  # a blade is 1.4 points wide
        assert found.coverage.sum() * GRID.edge[0] * GRID.edge[1] == pytest.approx(area, rel=tolerance)
        assert len(set(zip(found.row.tolist(), found.column.tolist(), strict=True))) == found.count


@pytest.mark.parametrize("name", AREAS)
def test_the_compiled_loop_sees_the_same(name):
    pytest.importorskip("numba")
    for yaw in (0.0, 0.7):
        body = standing(AREAS[name][0], yaw=yaw, edge=1e-4)
        plain, fast = (sample(GRID, [body], [1e-3], native=native) for native in (False, True))
        order = np.lexsort((plain.column, plain.row)), np.lexsort((fast.column, fast.row))
        assert plain.count == fast.count
        for field in ("row", "column", "coverage", "x", "y", "gap"):
            np.testing.assert_allclose(getattr(plain, field)[order[0]], getattr(fast, field)[order[1]], atol=1e-9)


def test_the_middle_of_a_covered_part_is_the_faces_middle():
    found = sample(GRID, [standing(Box(size=(7e-3, 5e-3, 5e-3)), yaw=0.5)], [1e-3])
    assert np.average(found.x, weights=found.coverage) == pytest.approx(0.7e-3, abs=2e-5)
    assert np.average(found.y, weights=found.coverage) == pytest.approx(-1.1e-3, abs=2e-5)
