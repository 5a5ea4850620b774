"""The rounded surface of an indenter: derivatives, poses, slopes, load scale."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.finite_strain.indenter_surface import IndenterSurface
from meshes import Box, Cylinder, Sphere
from meshes.pose import Pose

SHAPES = (Sphere(radius=4.0), Cylinder(radius=1.0), Box(size=(3.0, 1.0, 5.0)))
POSE = Pose.planar(at=(0.3, -0.2), yaw=0.5)


def draw_points(count=200):
    return np.random.default_rng(1).uniform(-1.5, 1.5, (2, count))


@settings(max_examples=30, deadline=None)
@given(shape=st.sampled_from(SHAPES), yaw=st.floats(-4, 4), x=st.floats(-1.4, 1.4), y=st.floats(-1.4, 1.4))
def test_slope_is_the_derivative_of_the_height(shape, yaw, x, y):
    surface = IndenterSurface(indenter=shape, fillet=0.4, pose=Pose.planar(at=(0.3, -0.2), yaw=yaw))
    x, y, h = np.array([x]), np.array([y]), 1e-4
    slope = [
        (surface.height(x + h, y) - surface.height(x - h, y)) / (2 * h),
        (surface.height(x, y + h) - surface.height(x, y - h)) / (2 * h),
    ]
    # The differences of `evaluate` are taken over 4e-3, in which curvature up to 1 / fillet changes the slope.
    assert surface.evaluate(x, y).slope[0] == pytest.approx(np.concatenate(slope), abs=0.02)


def test_curvature_is_the_derivative_of_the_slope():
    posed = IndenterSurface(indenter=SHAPES[2], fillet=0.4, pose=POSE)
    (x, y), h = draw_points(), 1e-4
    bend = np.stack(
        [
            (posed.evaluate(x + h, y).slope - posed.evaluate(x - h, y).slope) / (2 * h),
            (posed.evaluate(x, y + h).slope - posed.evaluate(x, y - h).slope) / (2 * h),
        ],
        axis=-1,
    )
    assert np.median(np.abs(posed.evaluate(x, y).curvature - bend)) < 1e-3


def test_a_pose_moves_and_turns_the_surface():
    here = IndenterSurface(indenter=SHAPES[2], fillet=0.4)
    there = IndenterSurface(indenter=SHAPES[2], fillet=0.4, pose=POSE)
    x, y = draw_points()
    assert there.height(*POSE.to_array(x, y)) == pytest.approx(here.height(x, y), abs=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_surface_rises_by_a_slope_of_2_5_and_no_more(shape):
    x, y = 4 * draw_points(2000)
    slope = IndenterSurface(indenter=shape, fillet=0.4).evaluate(x, y).slope
    assert np.linalg.norm(slope, axis=-1).max() == pytest.approx(2.5, rel=1e-6)


def test_the_middle_of_a_face_stays_flat_and_its_edge_is_rounded():
    surface = IndenterSurface(indenter=Cylinder(radius=1.0), fillet=0.2)
    x = np.array([0.0, 0.79, 0.81, 1.0])
    height = surface.height(x, np.zeros(4))
    assert (height[:2] == 0).all()
    assert 0 < height[2] < height[3] < 0.2
