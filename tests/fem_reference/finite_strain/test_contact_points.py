"""Contact points: sums, mirror images and rings, and the pressure of Hertz from a solved contact."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference import closed_form
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.contact import divide_rings, unfold_points
from fem_reference.finite_strain.loading_path import LoadingPath
from meshes import Sphere
from tests.support.rubber import make_cover


@given(seed=st.integers(0, 10**6), symmetric=st.tuples(st.booleans(), st.booleans()))
def test_mirror_images_multiply_the_force_and_cancel_what_is_odd(seed, symmetric):
    points = np.random.default_rng(seed).uniform(0.1, 1, (7, 5))
    whole = unfold_points(points, symmetric)
    multiple = (1 + symmetric[0]) * (1 + symmetric[1])
    assert whole[:, 2].sum() == pytest.approx(multiple * points[:, 2].sum())
    for axis in range(2):
        expected = 0.0 if symmetric[axis] else multiple * points[:, 3 + axis].sum()
        assert whole[:, 3 + axis].sum() == pytest.approx(expected)
        # What a mirror image keeps: shear that points away from the plane.
        moment = whole[:, axis] @ whole[:, 3 + axis]
        assert moment == pytest.approx(multiple * points[:, axis] @ points[:, 3 + axis])


def test_rings_keep_force_radius_and_radial_friction():
    rings = np.array([[1.0, 3.0, -0.5], [2.0, 1.0, 0.25], [4.0, 2.0, 0.0]])
    points = divide_rings(rings)
    x, y, force, *shear = points.T
    assert force.sum() == pytest.approx(rings[:, 1].sum())
    assert force @ np.column_stack([x, y]) == pytest.approx([0, 0], abs=1e-12)
    assert force @ (x**2) == pytest.approx(rings[:, 1] @ rings[:, 0] ** 2 / 2)
    radial = (x * shear[0] + y * shear[1]) / np.hypot(x, y)
    assert radial.reshape(3, -1).sum(axis=1) == pytest.approx(rings[:, 2])
    assert x * shear[1] == pytest.approx(y * shear[0])


@pytest.mark.slow
def test_the_pressure_under_a_ball_on_a_thick_cover_is_that_of_hertz():
    cover, radius = make_cover(0.3, "linear-elastic", thickness=20e-3), 4e-3
    hertz = closed_form.hertz(cover.layers[0], radius, 0.02)
    path = LoadingPath(cover=cover, indenter=Sphere(radius=radius), targets=(0.02,), control="load", load_scale=1e-3)
    state = press_axisymmetric(
        path, elements_per_thickness=4, contact_radius=hertz.contact_radius, fillet=1e-4, reach=0.1
    )[0][0]
    r, force, friction = state.rings.T
    assert force.sum() / 1e-3 == pytest.approx(0.02, rel=1e-6)
    assert (friction == 0).all()
    share = force / force.sum()
    # p0 sqrt(1 - r^2 / a^2): the mean of r^2 is 2/5 a^2, that of r 3 pi / 16 a; equal pressure would give 1/2 and 2/3.
    assert share @ r**2 == pytest.approx(0.4 * hertz.contact_radius**2, rel=0.02)
    assert share @ r == pytest.approx(3 * np.pi / 16 * hertz.contact_radius, rel=0.01)
    assert state.energy / 1e-6 == pytest.approx(0.4 * 0.02 * hertz.depth, rel=0.02)
