import mujoco
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, Delaunay

from fastmodel.contact.boxes import AreaTexels, BoxTexels, _measure_polygon
from meshes import TexelArray
from tests.support.scenes import make_spec

ARRAY = TexelArray.grid(6, 6, 3e-3)

points = st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=3, max_size=12)


@given(points)
def test_area_and_centroid_of_a_polygon_equal_those_of_scipys_triangles(corners):
    corners = np.array(corners)
    assume(np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[1] > 1e-3)
    area, x, y = _measure_polygon(corners)
    assert area == pytest.approx(ConvexHull(corners).volume, rel=1e-9)
    parts = corners[Delaunay(corners).simplices]
    weights = np.abs(np.linalg.det(parts[:, 1:] - parts[:, :1]))
    np.testing.assert_allclose([x, y], weights @ parts.mean(axis=1) / weights.sum(), atol=1e-6)
    # points on a line have no area
    assert _measure_polygon(np.array([[0.0, 0], [1, 1], [2, 2]])) == (0.0, 1.0, 1.0)
    assert _measure_polygon(np.array([[0.0, 0], [2, 0]])) == (0.0, 1.0, 0.0)


def block_readings(tilts):
    """Readings of a 10 mm block with its weight off its middle, on a slide or free, by number and by area."""
    readings = []
    for method in (BoxTexels(), AreaTexels()):
        spec = make_spec()
        method.attach(spec.worldbody.add_frame(), ARRAY, "a")
        body = spec.worldbody.add_body(pos=[0.4e-3, -0.7e-3, 5e-3])
        body.add_joint(type=mujoco.mjtJoint.mjJNT_FREE if tilts else mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[5e-3, 5e-3, 5e-3], mass=0.0)
        body.mass, body.explicitinertial, body.inertia, body.ipos = 0.2, True, [1e-5] * 3, [1e-3, 0.5e-3, 0]
        model = spec.compile()
        data = mujoco.MjData(model)
        reader = method.bind(model, ARRAY, "a")
        mujoco.mj_step(model, data, 500)
        readings.append(reader.read(data))
    return readings


@pytest.mark.parametrize("tilts", [False, True])
def test_redistribution_keeps_the_weight_and_the_moments_of_a_free_body(tilts):
    by_number, by_area = block_readings(tilts)
    assert by_area.carried == pytest.approx(by_number.carried, rel=1e-9)
    assert by_area.carried == pytest.approx(0.2 * 9.81, rel=1e-3)
    assert np.abs(by_area.contact_forces - by_number.contact_forces).max() > 0.01
    centre = by_area.contact_forces @ ARRAY.centres[:, :2] / by_area.carried
    # Forces act at texel centres here, so that the centre of pressure is known to a fraction of a texel only.
    expected = np.array([0.4e-3, -0.7e-3]) + (np.array([1e-3, 0.5e-3]) if tilts else 0.0)
    np.testing.assert_allclose(centre, expected, atol=0.4e-3)
