"""Flat faces without slip: the mesh of a cover with free sides, and its scale."""

from __future__ import annotations

import pytest

from fem_reference.small_strain_contact.no_slip import FaceGrid, press_face
from meshes import Box, Cylinder
from meshes.pose import Pose
from tests.support.rubber import make_cover

GRID = FaceGrid(through=2, edge=0.5, growth=0.8, across=2)


def press(at=(0.0, 0.0), *, scale=1.0, face=Box, thickness=2e-3):
    """Press a face on a cover of 8 x 6 mm with free sides, all lengths times a factor."""
    cover = make_cover(0.45, "linear-elastic", thickness=scale * thickness, size=(scale * 8e-3, scale * 6e-3))
    shape = Box(size=(scale * 3e-3, scale * 2e-3, 5e-3)) if face is Box else Cylinder(radius=scale * 1.5e-3)
    return press_face(cover, shape, Pose.planar(at=(scale * at[0], scale * at[1])), GRID)


@pytest.mark.parametrize("face", [Box, Cylinder])
def test_the_stiffness_of_a_cover_with_free_sides_is_proportional_to_its_size(face):
    for (small, _), (large, _) in zip(press(face=face), press(scale=1000.0, face=face), strict=True):
        assert large.total_force == pytest.approx(1000 * small.total_force, rel=1e-9)
        assert large.contact[:, :2] == pytest.approx(1000 * small.contact[:, :2], rel=1e-9, abs=1e-9)
        assert large.base.pressure == pytest.approx(small.base.pressure / 1000, rel=1e-6, abs=1e-9 * large.total_force)
        assert large.base.x == pytest.approx(1000 * small.base.x)
        assert (large.base.x[0], large.base.x[-1]) == pytest.approx((-4.0, 4.0))  # the sides of the cover
