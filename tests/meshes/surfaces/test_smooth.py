"""Smooth surfaces through the corners of triangles, against the bodies that were tessellated."""

from itertools import product

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from meshes.surfaces.smooth import measure_flat, smooth_surface
from meshes.surfaces.triangles import check_closed, merge_corners

SEMI_AXES = np.array([8e-3, 12e-3, 6e-3])


def make_rounded_box():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=2e-3).vertices
    corners = [ball + corner for corner in product((-5e-3, 5e-3), (-9e-3, 9e-3), (-1e-3, 1e-3))]
    return trimesh.convex.convex_hull(np.concatenate(corners))


def off_ellipsoid(points):
    share = np.linalg.norm(points / SEMI_AXES, axis=1)
    return (share - 1) * share / np.linalg.norm(points / SEMI_AXES**2, axis=1)


def off_capsule(points):
    beyond = np.maximum(np.abs(points[:, 2]) - 6e-3, 0)
    return np.hypot(np.hypot(points[:, 0], points[:, 1]), beyond) - 6e-3


def off_cylinder(points):
    away = np.hypot(points[:, 0], points[:, 1]) - 6e-3
    return np.where(np.isclose(np.abs(points[:, 2]), 10e-3), np.maximum(away, 0), away)


def off_sphere(points):
    return np.linalg.norm(points, axis=1) - 8e-3


#: Body, its signed distance, and how many times nearer the smooth surface is, in 95 % of the places.
BODIES = {
    "sphere of 80": (trimesh.creation.icosphere(subdivisions=1, radius=8e-3), off_sphere, 20),
    "sphere of 320": (trimesh.creation.icosphere(subdivisions=2, radius=8e-3), off_sphere, 10),
    "ellipsoid": (trimesh.creation.icosphere(subdivisions=2).apply_scale(SEMI_AXES), off_ellipsoid, 5),
    "torus": (
        trimesh.creation.torus(10e-3, 4e-3, major_sections=24, minor_sections=14),
        lambda p: np.hypot(np.hypot(p[:, 0], p[:, 1]) - 10e-3, p[:, 2]) - 4e-3, 3,
    ),
    "capsule": (trimesh.creation.capsule(height=12e-3, radius=6e-3, count=[16, 16]), off_capsule, 8),
    "cylinder": (trimesh.creation.cylinder(6e-3, 20e-3, sections=24), off_cylinder, 8),
    "rounded box": (
        make_rounded_box(),
        lambda p: np.linalg.norm(np.maximum(np.abs(p) - [5e-3, 9e-3, 1e-3], 0), axis=1) - 2e-3, 1.0,
    ),
}  # fmt: skip
#: Those of a few triangles.
FEW = {"sphere of 80", "cylinder", "rounded box"}


def sample(triangles, distance):
    return np.abs(distance(np.concatenate([triangles.mean(axis=1), triangles[:, :2].mean(axis=1)])))


@pytest.mark.parametrize(
    "name", [name if name in FEW else pytest.param(name, marks=pytest.mark.slow) for name in BODIES]
)
def test_the_smooth_surface_is_nearer_to_the_body_than_its_facets_and_states_its_error(name):
    body, distance, nearer = BODIES[name]
    given = np.array(body.triangles)
    smooth, sag, error = smooth_surface(given, 1e-5)
    check_closed(smooth, name)
    facets, now = sample(given, distance), sample(smooth, distance)
    assert np.quantile(now, 0.95) < facets.max() / nearer
    assert np.quantile(now, 0.9) < error
    assert 0.5 * facets.max() < sag < 2 * facets.max()
    kept, sag_of_kept, error_of_kept = smooth_surface(given, 1e-5, crease=0.0)
    np.testing.assert_array_equal(kept, given[: len(kept)])
    assert sag_of_kept == error_of_kept == pytest.approx(sag)


def test_flat_faces_and_sharp_edges_stay():
    box = np.array(trimesh.creation.box((10e-3, 20e-3, 5e-3)).triangles)
    smooth, sag, error = smooth_surface(box, 1e-6)
    np.testing.assert_array_equal(np.sort(smooth.ravel()), np.sort(box.ravel()))
    assert sag == error == 0
    points, faces = merge_corners(box)
    assert sorted(set(np.round(1e6 * measure_flat(points, faces), 9))) == [50, 100, 200]
    can = np.array(trimesh.creation.cylinder(6e-3, 20e-3, sections=24).triangles)
    smooth = smooth_surface(can, 1e-5)[0]
    ends = smooth[np.isclose(np.abs(smooth[..., 2]), 10e-3).all(axis=1)]
    area = np.linalg.norm(np.cross(ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(2 * np.pi * 6e-3**2, rel=2e-3)  # the polygons: 1.1 % less
    assert np.ptp(smooth[..., 2]) == pytest.approx(20e-3)


def test_the_result_turns_with_the_surface_and_does_not_depend_on_the_order_of_its_triangles():
    given = np.array(BODIES["ellipsoid"][0].triangles)
    smooth, sag, error = smooth_surface(given, 2e-5)
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    order = np.random.default_rng(1).permutation(len(given))
    other = smooth_surface((given @ turn.T)[order], 2e-5)
    assert other[1:] == pytest.approx((sag, error))
    assert len(other[0]) == len(smooth)
    middle = np.sort(np.linalg.norm(smooth.mean(axis=1), axis=1))
    np.testing.assert_allclose(np.sort(np.linalg.norm(other[0].mean(axis=1), axis=1)), middle, rtol=1e-9)
