"""Tilted indenters: exact heights of rotated faces, cones and spheres, symmetry, primitives, and the largest tilt."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from meshes import Box, Cone, Cylinder, Nut, Prism, Roller, RoundedTip, Sphere, tilt_indenter
from meshes.indenters.shapes import spherical_gap
from meshes.tilt import MOST_TILT, TiltedIndenter

ANGLE = st.floats(-MOST_TILT, MOST_TILT)


@settings(max_examples=20)
@given(about_x=ANGLE, about_y=ANGLE, seed=st.integers(0, 1000))
@example(about_x=0.15625, about_y=0.0015, seed=0)
def test_the_face_of_a_box_is_the_rotated_plane(about_x, about_y, seed):
    shape = tilt_indenter(Box(size=(6e-3, 4e-3, 5e-3)), (about_x, about_y))
    turn = rotate(about_x, about_y)
    u, v = np.random.default_rng(seed).uniform(-0.999, 0.999, (2, 50)) * [[3e-3], [2e-3]]
    x, y, z = turn @ np.stack([u, v, np.zeros(50)])
    lowest = -np.abs(turn[2, :2]) @ [3e-3, 2e-3]
    assert shape.gap(x, y) == pytest.approx(z - lowest, abs=1e-9)
    assert np.isinf(shape.gap(*(turn @ [3.01e-3, 0.0, 0.0])[:2, None])).all()


@settings(max_examples=20)
@given(about_x=ANGLE, about_y=ANGLE)
def test_a_tilted_face_touches_at_height_zero_and_nowhere_below(about_x, about_y):
    for base in (
        Nut(across=13e-3, bore=8e-3),
        Cylinder(radius=3e-3),
        Prism(points=((0, 0), (8e-3, 1e-3), (2e-3, 6e-3))),
    ):
        shape = tilt_indenter(base, (about_x, about_y))
        if not isinstance(shape, TiltedIndenter):
            continue
        half = max(base.footprint)
        x, y = np.random.default_rng(0).uniform(-half, half, (2, 20_000))
        near = shape.lowest_point[:2] + np.random.default_rng(1).uniform(-1e-6, 1e-6, (200, 2))
        gap = shape.gap(np.append(x, near[:, 0]), np.append(y, near[:, 1]))
        # Corners whose heights differ by less than 5e-12 m count as equally low.
        assert -5e-12 <= np.min(gap) < 2e-6 * np.hypot(about_x, about_y) + 1e-12


def rotate(about_x, about_y):
    return Rotation.from_rotvec([about_x, about_y, 0.0]).as_matrix()


@settings(max_examples=8)
@given(about_x=ANGLE)
def test_the_flanks_of_a_cone_turn_by_the_tilt(about_x):
    flank = np.radians(20)
    shape = tilt_indenter(Cone(angle=np.pi - 2 * flank, radius=5e-3), (about_x, 0.0))
    y = np.array([-2e-3, 2e-3])
    expected = np.tan([flank - about_x, flank + about_x]) * 2e-3
    assert shape.gap(np.zeros(2), y) == pytest.approx(expected, abs=1e-9)


@settings(max_examples=8)
@given(about_x=ANGLE, about_y=ANGLE)
def test_the_end_of_a_rounded_tip_is_a_sphere_beside_the_axis(about_x, about_y):
    radius = 2e-3
    shape = tilt_indenter(RoundedTip(radius=radius), (about_x, about_y))
    centre = rotate(about_x, about_y) @ [0, 0, radius]
    x, y = np.random.default_rng(1).uniform(-0.5e-3, 0.5e-3, (2, 30))
    assert shape.gap(centre[0] + x, centre[1] + y) == pytest.approx(spherical_gap(radius, x, y), abs=1e-9)


@pytest.mark.parametrize(
    "base", [Box(size=(6e-3, 4e-3, 5e-3)), Roller(radius=3e-3, length=6e-3), Cylinder(radius=3e-3)]
)
def test_a_tilt_about_one_axis_keeps_the_mirror_plane_across_it(base):
    x, y = np.random.default_rng(2).uniform(-1.5e-3, 1.5e-3, (2, 200))
    about_x, about_y, both = (tilt_indenter(base, tilt) for tilt in ((0.05, 0.0), (0.0, 0.05), (0.05, 0.02)))
    assert about_x.mirror_symmetry == (True, False)
    assert about_y.mirror_symmetry == (False, True)
    assert both.mirror_symmetry == (False, False)
    assert about_x.gap(-x, y) == pytest.approx(about_x.gap(x, y), abs=1e-12)
    assert about_y.gap(x, -y) == pytest.approx(about_y.gap(x, y), abs=1e-12)
    assert (about_x.gap(x, np.abs(y)) >= about_x.gap(x, -np.abs(y))).all()  # the side of positive y is raised
    assert not about_x.is_flat
    assert not about_x.axisymmetric


def test_a_sphere_and_no_tilt_change_nothing_and_large_tilts_are_refused_in_words():
    ball, nut = Sphere(radius=3e-3), Nut(across=13e-3, bore=8e-3)
    assert tilt_indenter(ball, (0.1, -0.1)) is ball
    assert tilt_indenter(nut, (0.0, 0.0)) is nut
    with pytest.raises(ValueError, match="at most 10 degrees about either axis, not 12"):
        tilt_indenter(nut, (0.0, np.radians(12)))


@pytest.mark.parametrize("degrees", [20, 30])
@pytest.mark.parametrize("tilt", [5, 9])
def test_steep_cones_keep_their_surface(degrees, tilt):
    """The height over the tip is that of the lowest point of the rotated cone above (x, y): a quadratic equation."""
    half, about = np.radians(degrees / 2), np.radians(tilt)
    shape = tilt_indenter(Cone(angle=2 * half, radius=5e-3), (about, 0.0))
    x, y = np.meshgrid(np.linspace(-0.7e-3, 0.7e-3, 31), np.linspace(-0.7e-3, 0.7e-3, 31))
    # The axis is (0, -sin, cos); on the cone, the part of the position along the axis is its length times cos(half).
    s, c, k = -np.sin(about), np.cos(about), np.cos(half) ** 2
    a, b, d = c**2 - k, 2 * s * c * y, (s * y) ** 2 - k * (x**2 + y**2)
    root = np.sqrt(np.maximum(b**2 - 4 * a * d, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.sort([(-b - root) / (2 * a), (-b + root) / (2 * a)], axis=0)
    expected = np.where(roots[0] > 1e-9, roots[0], roots[1])
    gap = shape.gap(x, y)
    inside = (expected > 0) & (expected < 8e-3)
    assert inside.mean() > 0.5
    assert gap[inside] == pytest.approx(expected[inside], abs=1e-8)
