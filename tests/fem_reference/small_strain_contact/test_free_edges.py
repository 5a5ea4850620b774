"""The outline of a cover of limited size, seen from an indenter."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference.small_strain_contact.free_edges import SideEdges
from meshes import Box, Sphere
from meshes.pose import Pose

SIZE = (10e-3, 6e-3)


def make_sides(bonded, indenter, at, yaw, *, half=(1e-3, 1e-3), size=SIZE):
    pose = Pose.planar(at=at, yaw=yaw)
    return SideEdges(cover=bonded(0.4, size=size), indenter=indenter, pose=pose, half=np.array(half))


def test_the_window_of_a_flat_face_is_its_part_on_the_cover(bonded):
    box = Box(size=(4e-3, 2e-3, 5e-3))
    middle, half = make_sides(bonded, box, (4e-3, 0.0), 0.0, half=box.footprint).window
    assert middle == pytest.approx([-0.5e-3, 0.0])  # from 2 mm to the side at 5 mm, around an axis at 4 mm
    assert half == pytest.approx([1.5e-3, 1e-3])
    middle, half = make_sides(bonded, box, (4e-3, 0.0), 0.2, half=box.footprint).window
    assert (middle == 0).all()
    assert half == pytest.approx(box.footprint)


def test_far_sides_add_nothing(bonded):
    sides = make_sides(bonded, Sphere(radius=2e-3), (0.0, 0.0), 0.0, size=(60e-3, 60e-3))
    assert not sides.near
    assert (sides.add_compliance(np.zeros(3), np.zeros(3))(np.ones(3)) == 0).all()
    assert make_sides(bonded, Sphere(radius=2e-3), (0.0, 0.0), 0.0).near
