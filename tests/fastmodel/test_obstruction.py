"""Points on the outer faces of an array's geoms."""

import mujoco
import numpy as np
import pytest

from fastmodel.contact.bodies import sample_boxes


@pytest.fixture
def geoms():
    """Boxes of 4 x 2 x 1 mm on a turned body, and their ids."""

    def build(count):
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(pos=[0.1, 0.2, 0.3], quat=[0.5, 0.5, 0.5, 0.5])
        for number in range(count):
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[2e-3, 1e-3, 0.5e-3], pos=[5e-3 * number, 0, 0])
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        return model, data, np.arange(count)

    return build


def test_points_are_the_centres_of_equal_parts_of_the_top(geoms):
    model, data, ids = geoms(2)
    points, normals = sample_boxes(model, data, ids, inset=0.2e-3, spacing=0.9e-3)
    turn = data.geom_xmat[0].reshape(3, 3)
    np.testing.assert_allclose(normals, np.tile(turn[:, 2], (len(points), 1)), atol=1e-12)
    local = (points - data.geom_xpos[0]) @ turn
    x, y = np.meshgrid(1.8e-3 * np.array([-0.75, -0.25, 0.25, 0.75]), 0.8e-3 * np.array([-0.5, 0.5]))
    first = np.column_stack([x.ravel(), y.ravel(), np.full(8, 0.5e-3)])
    np.testing.assert_allclose(local, np.concatenate([first, first + np.array([5e-3, 0, 0])]), atol=1e-12)


@pytest.mark.parametrize(("count", "each"), [(250, 8), (251, 1), (1, 40 * 40)])
def test_one_point_stands_for_each_of_many_geoms_above_two_thousand_points(geoms, count, each):
    spacing = 0.9e-3 if count > 1 else 1e-6
    points, _ = sample_boxes(*geoms(count), inset=0.2e-3, spacing=spacing)
    assert len(points) == count * each
