import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fastmodel.pressure.gap import sample_gap
from fastmodel.pressure.solvers import FoundationSolver, Load
from meshes import Box, Sphere
from tests.support.posed_bodies import GRID, pose_body

MODULUS = 2e9
SOLVER = FoundationSolver(GRID, MODULUS)


def test_forces_and_moments_are_those_of_the_load():
    samples = sample_gap(GRID, [pose_body(Sphere(radius=5e-3), at=(1e-3, 2e-3))], [2e-3])
    for tilts in (False, True):
        moment = 2.0 * np.array([1.1e-3, 2.05e-3])
        found = SOLVER.solve(samples, [Load.on_plate(force=2.0, moment=moment, tilts=tilts)])
        assert found.forces.min() >= 0
        assert found.forces.sum() == pytest.approx(2.0)
        if tilts:
            np.testing.assert_allclose([found.forces @ samples.x, found.forces @ samples.y], moment, atol=2e-5)
        else:
            np.testing.assert_array_equal(found.forces > 0, samples.gap < found.surface)


@settings(max_examples=20, deadline=None)
@given(force=st.floats(0.1, 10.0), radius=st.floats(4e-3, 9e-3))
def test_a_sphere_sinks_as_in_closed_form(force, radius):
    """Force on a paraboloid: pi R k d^2, so the depth is sqrt(F / (pi R k)) (Johnson, Contact Mechanics, 4.3)."""
    samples = sample_gap(GRID, [pose_body(Sphere(radius=radius), at=(0, 0))], [2e-3])
    found = SOLVER.solve(samples, [Load.on_plate(force=force, moment=np.zeros(2), tilts=False)])
    depth = np.sqrt(force / (np.pi * radius * MODULUS))
    cell = GRID.edge[0] ** 2 / radius  # largest difference of height along a cell
    assert abs(found.surface[0] - depth) < cell


@settings(max_examples=20, deadline=None)
@given(force=st.floats(0.1, 10.0), x=st.floats(-0.8e-3, 0.8e-3), y=st.floats(-0.8e-3, 0.8e-3))
def test_pressure_under_a_flat_face_is_linear_in_place(force, x, y):
    """If the load acts within the core of the face, all cells touch and the pressure is F / A + M x / I."""
    samples = sample_gap(GRID, [pose_body(Box(size=(10.2e-3, 10.2e-3, 5e-3)), at=(0.0, 0.0))], [1e-3])
    found = SOLVER.solve(samples, [Load.on_plate(force=force, moment=force * np.array([x, y]), tilts=True)])
    inertia = [(samples.coverage * each**2).sum() for each in (samples.x, samples.y)]
    pressure = 1 / samples.coverage.sum() + x * samples.x / inertia[0] + y * samples.y / inertia[1]
    np.testing.assert_allclose(found.forces, force * pressure * samples.coverage, atol=1e-6 * force)
