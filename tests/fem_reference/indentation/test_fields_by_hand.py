"""Fields in a cover that are mirrored, moved and turned, against transformations that are written out."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from fem_reference.fields.cover_fields import CoverFields
from meshes.pose import Pose

#: Corners of one element in the quarter x, y > 0, in the order of VTK.
CORNERS = np.array([(i, j, k) for k in (0, 1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)


def make_fields(*, axisymmetric=False):
    rng = np.random.default_rng(4)
    stress = rng.standard_normal((8, 3, 3))
    return CoverFields(
        position=CORNERS * [2.0, 3.0, 0.5] + [0.1, 0.2, 0.0], displacement=rng.standard_normal((8, 3)),
        stress=stress + stress.swapaxes(1, 2), cells=np.arange(8)[None], layer=np.array([3]), axisymmetric=axisymmetric,
        error=0.03,
    )  # fmt: skip


@pytest.mark.parametrize("symmetric", list(product((False, True), repeat=2)))
def test_mirror_images_of_fields_are_elements_of_their_own(symmetric):
    """The component across a plane changes its sign, and a stress once for each of its indices."""
    fields = make_fields()
    whole = fields.unfold(symmetric)
    images = [np.ones(3)]
    for axis in range(2):
        if symmetric[axis]:
            images += [each * np.where(np.arange(3) == axis, -1.0, 1.0) for each in images]
    assert len(whole.position) == 8 * len(images)
    assert whole.cells.shape == (len(images), 8)
    assert (whole.layer == 3).all()
    for part, sign in enumerate(images):
        rows = slice(8 * part, 8 * part + 8)
        np.testing.assert_array_equal(whole.position[rows], fields.position * sign)
        np.testing.assert_array_equal(whole.displacement[rows], fields.displacement * sign)
        for i, j in product(range(3), repeat=2):
            np.testing.assert_array_equal(whole.stress[rows, i, j], fields.stress[:, i, j] * sign[i] * sign[j])
        # The corners of every image are in the same order, from its lowest one.
        cell = whole.position[whole.cells[part]]
        np.testing.assert_allclose(cell - cell[0], CORNERS * [2.0, 3.0, 0.5], atol=1e-12)
        assert sorted(whole.cells[part]) == list(range(8 * part, 8 * part + 8))


def test_fields_move_and_turn_with_the_indenter():
    pose, fields = Pose.planar(at=(0.4, -0.7), yaw=0.6), make_fields()
    moved = fields.to_array(pose)
    c, s = np.cos(0.6), np.sin(0.6)
    x, y, z = fields.position.T
    np.testing.assert_allclose(moved.position, np.column_stack([c * x - s * y + 0.4, s * x + c * y - 0.7, z]))
    u, v, w = fields.displacement.T
    np.testing.assert_allclose(moved.displacement, np.column_stack([c * u - s * v, s * u + c * v, w]))
    along = np.array([c, s, 0.0])
    for first, second in product((along, np.array([-s, c, 0.0]), np.array([0, 0, 1.0])), repeat=2):
        i, j = (int(np.argmax(np.abs(each @ [[c, -s, 0], [s, c, 0], [0, 0, 1]]))) for each in (first, second))
        np.testing.assert_allclose(np.einsum("i,nij,j->n", first, moved.stress, second), fields.stress[:, i, j])
    np.testing.assert_allclose(moved.von_mises, fields.von_mises)
    assert moved.error == 0.03


def test_a_half_plane_around_the_axis_is_moved_and_not_turned():
    fields = make_fields(axisymmetric=True)
    moved = fields.to_array(Pose.planar(at=(0.4, -0.7), yaw=0.6))
    np.testing.assert_allclose(moved.position, fields.position + np.array([0.4, -0.7, 0.0]))
    np.testing.assert_allclose(moved.displacement, fields.displacement)
    np.testing.assert_allclose(moved.stress, fields.stress)
