"""Bodies of triangles."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from meshes import Sphere, TriangleMesh, read_stl, tilt_indenter
from tests.support.sampled_shapes import is_flat_where_sampled, is_symmetric_where_sampled


@pytest.mark.parametrize(
    ("name", "symmetric"), [("sphere", False), ("two-balls", False), ("pyramid", True), ("cup", True)]
)
def test_flatness_and_mirror_symmetry_of_a_body_from_a_file_hold_for_its_gap(write_stl, name, symmetric):
    """Rounding in the file moves the edge of the sphere, so that its symmetry is not claimed."""
    body = read_stl(write_stl(name))
    assert isinstance(body, TriangleMesh)
    assert body.is_flat == is_flat_where_sampled(body)
    assert body.mirror_symmetry == (symmetric, symmetric)
    assert not symmetric or is_symmetric_where_sampled(body) == (True, True)


def test_triangles_on_a_plane_are_flat_and_a_raised_corner_is_not():
    corners = trimesh.creation.box((4e-3, 6e-3, 2e-3)).triangles + np.array([0, 0, 1e-3])
    assert TriangleMesh(triangles=corners).is_flat
    on_one_edge = (corners[..., 2] == 0) & (corners[..., 0] > 0)
    corners[on_one_edge] += [0, 0, 1e-6]
    assert not TriangleMesh(triangles=corners).is_flat


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t[:, :2], "shape"),
        (lambda t: t * np.nan, "finite"),
        (lambda t: t[:, ::-1], "face inwards"),
        (lambda t: t + np.array([0, 0, 1e-3]), "stand at z = 0"),
        (lambda t: t + np.array([1, 0, 0]), "axis"),
    ],
)
def test_triangles_that_are_no_body_on_the_axis_are_refused(write_stl, change, message):
    triangles = read_stl(write_stl("pyramid")).triangles
    with pytest.raises(ValueError, match=message):
        TriangleMesh(triangles=change(triangles))


@pytest.mark.parametrize("divisions", [2, 3, 4])
def test_the_deviation_of_facets_is_that_of_the_ball_which_they_stand_for_also_if_it_is_tilted(divisions):
    mesh = trimesh.creation.icosphere(divisions, 5e-3)
    body = TriangleMesh(triangles=mesh.triangles - [0, 0, mesh.bounds[0, 2]])
    middles = np.linalg.norm(mesh.triangles_center, axis=1)
    assert body.measure_facets(10e-3) == pytest.approx(5e-3 - middles.min(), rel=0.6)
    assert Sphere(radius=5e-3).measure_facets(1e-3) == 0
    # a ball of which one half is stretched, tilted by its rotation and by the corners of its triangles
    corners = mesh.triangles * np.where(mesh.triangles[..., :1] > 0, [2.5, 1, 1], 1) - [0, 0, mesh.bounds[0, 2]]
    turned = corners @ Rotation.from_rotvec([0.0, 0.15, 0.0]).as_matrix().T
    turned -= [0, 0, turned[..., 2].min()]
    tilted = tilt_indenter(TriangleMesh(triangles=corners), (0.0, 0.15))
    assert tilted.measure_facets(1e-3) == pytest.approx(TriangleMesh(triangles=turned).measure_facets(1e-3), rel=1e-3)
