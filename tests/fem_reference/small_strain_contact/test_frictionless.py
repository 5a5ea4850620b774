"""Contact of one indenter: first guesses, bounds, scaling, and the area of a flat face."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fem_reference.closed_form.contact import indent
from fem_reference.linear_response.surface_compliance import surface_compliance
from fem_reference.small_strain_contact.frictionless import bound_contact, solve_contact
from meshes import Cover, Cylinder, Layer, Sphere
from tests.support.rubber import make_rubber

SHARED = settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def surface(bonded):
    return surface_compliance(bonded(0.45), 30e-3)


@given(radius=st.floats(1e-3, 0.2), thickness=st.floats(1e-3, 5e-3))
def test_no_contact_of_a_ball_exceeds_the_circle_as_low_as_the_cover_is_thick(radius, thickness):
    bound, _ = bound_contact(Sphere(radius=radius), thickness)
    exact = radius if radius <= thickness else np.sqrt(2 * radius * thickness - thickness**2)
    assert exact * (1 - 1e-9) <= bound <= exact + 1.1e-4 * radius


@pytest.mark.slow
@SHARED
@given(load=st.floats(0.05, 5.0), factor=st.floats(1.5, 4.0))
def test_force_and_depth_of_a_flat_face_are_proportional(surface, load, factor):
    punch = Cylinder(radius=1.5e-3)
    one, more = (solve_contact(surface, punch, cells=24, load=value) for value in (load, factor * load))
    assert one.total_force == pytest.approx(load)
    assert more.depth == pytest.approx(factor * one.depth, rel=1e-6)
    assert more.area == pytest.approx(one.area) == pytest.approx(np.pi * 1.5e-3**2, rel=1e-3)


@SHARED
@given(depth=st.floats(0.05e-3, 0.5e-3))
def test_load_and_depth_control_find_the_same_contact(surface, depth):
    ball = Sphere(radius=4e-3)
    at_depth = solve_contact(surface, ball, cells=24, depth=depth)
    at_load = solve_contact(surface, ball, cells=24, load=at_depth.total_force)
    assert at_load.depth == pytest.approx(depth, rel=2e-3)
    assert at_depth.force.min() > 0


@pytest.mark.slow
@pytest.mark.parametrize(("modulus", "thickness", "radius"), [(20e6, 100e-6, 0.5e-3), (2e9, 50e-6, 3e-3)])
def test_a_contact_far_smaller_than_the_response_of_its_cover_is_exact(modulus, thickness, radius):
    """Against the integral equation; the cells are far smaller than the stretch and bending lengths of the skin."""
    layers = [(2e-3, 0.2e6, 0.49), (thickness, modulus, 0.38)]
    cover = Cover(
        layers=tuple(
            Layer(
                thickness=each,
                material=replace(make_rubber(ratio, "linear-elastic"), parameters={"youngs_modulus": young}),
            )
            for each, young, ratio in layers
        )
    )
    ball = Sphere(radius=radius)
    found = solve_contact(surface_compliance(cover, 20e-3), ball, cells=48, depth=0.1e-3)
    known = indent(cover, ball, depth=0.1e-3)
    assert found.total_force == pytest.approx(known.force, rel=1e-4)
    assert found.area == pytest.approx(np.pi * known.contact_radius**2, rel=0.05)
