"""Mixed elements at finite strain: force and tangent as derivatives, the undeformed state, threads, inversion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.elements.taylor_hood import assemble_linear
from fem_reference.finite_strain.hyperelastic import InvertedElementError
from fem_reference.finite_strain.loading_path import Units
from tests.support.rubber import count_unknowns, draw_state, make_cover, make_solid


@pytest.mark.parametrize("direct", [0.0, 2.0])
@pytest.mark.parametrize("nu", [0.3, 0.5])
@pytest.mark.parametrize("kind", ["ring", "block"])
def test_force_and_tangent_are_derivatives_of_the_energy(kind, nu, direct):
    solid = make_solid(kind, nu, direct=direct)
    state, direction = draw_state(solid, 0.02), draw_state(solid, 1.0, seed=1)
    force, tangent = solid.linearise(state)
    step = 1e-6
    ahead, behind = state + step * direction, state - step * direction
    assert (solid.energy(ahead) - solid.energy(behind)) / (2 * step) == pytest.approx(force @ direction, rel=1e-6)
    change = (solid.linearise(ahead)[0] - solid.linearise(behind)[0]) / (2 * step)
    assert change == pytest.approx(tangent @ direction, abs=1e-6 * np.abs(change).max())
    assert abs(tangent - tangent.T).max() < 1e-12 * abs(tangent).max()


@pytest.mark.parametrize("direct", [0.0, 2.0])
@pytest.mark.parametrize("nu", [0.3, 0.5])
@pytest.mark.parametrize("kind", ["ring", "block"])
def test_the_cauchy_stress_does_the_work_of_the_nodal_forces(kind, nu, direct):
    solid = make_solid(kind, nu, direct=direct)
    elements = solid.elements
    state, motion = draw_state(solid, 0.02), draw_state(solid, 1.0, seed=1)
    motion[elements.displacements :] = 0  # mean pressures
    gradients = [np.zeros((*elements.weight.shape, 3, 3)) for _ in range(2)]
    for gradient, moved in zip(gradients, (state, motion), strict=True):
        for entry, (i, j) in zip(np.moveaxis(elements.compute_gradient(moved), -1, 0), elements.places, strict=True):
            gradient[..., i, j] = entry
    F = np.eye(3) + gradients[0]
    spatial = gradients[1] @ np.linalg.inv(F)  # gradient of the motion in the deformed solid
    power = (solid.cauchy_stress(state) * spatial).sum(axis=(2, 3)) * np.linalg.det(F) * elements.weight
    assert power.sum() == pytest.approx(solid.linearise(state)[0] @ motion, rel=1e-9)


@pytest.mark.parametrize("kind", ["ring", "block"])
def test_undeformed_solid_has_the_matrix_of_linear_elasticity(kind):
    solid = make_solid(kind, 0.4)
    units = Units.of(make_cover(0.4))
    rest, tangent = solid.linearise(np.zeros(count_unknowns(solid)))
    linear = assemble_linear(solid.elements, np.array([1.0]), solid.bulk_compliance)
    assert np.abs(rest).max() == 0
    assert abs(tangent - linear).max() < 1e-12
    assert units.force == pytest.approx(units.stress * units.length**2)


@settings(max_examples=10, deadline=None)
@given(
    axis=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda a: np.linalg.norm(a) > 0.1),
    angle=st.floats(-np.pi, np.pi),
    shift=st.tuples(*[st.floats(-1, 1)] * 3),
)
def test_rigid_motion_needs_no_force(axis, angle, shift):
    """Rodrigues' rotation about any axis, and a translation."""
    solid = make_solid("block")
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    state = np.zeros(count_unknowns(solid))
    moved = solid.elements.nodes @ (rotation - np.eye(3)).T + np.array(shift)
    state[: solid.elements.displacements] = moved.ravel()
    assert np.abs(solid.linearise(state)[0]).max() < 1e-12
    assert abs(solid.energy(state)) < 1e-12


@pytest.mark.parametrize("threads", ["1", "3", "2,1", "no number"])
def test_threads_change_no_bit(monkeypatch, threads):
    solid = make_solid("block")
    state = draw_state(solid, 0.02)
    alone = solid.linearise(state)
    monkeypatch.setattr("fem_reference.finite_strain.hyperelastic._POINTS", 27)
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    residual, tangent = solid.linearise(state)
    assert (residual == alone[0]).all()
    assert (tangent != alone[1]).nnz == 0
    with pytest.raises(InvertedElementError, match="inside out"):
        solid.linearise(100 * state)
