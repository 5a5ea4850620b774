"""Every backend gives the same answer, and a changed system is factorised again without a new analysis."""

from __future__ import annotations

import gc
from importlib.util import find_spec

import numpy as np
import pytest
import scipy.sparse as sp
import skfem
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference import sparse_solver
from fem_reference.elements.taylor_hood import assemble_linear, prepare_elements
from fem_reference.sparse_solver import BACKENDS, ConstrainedSystem, SymmetricFactors

PACKAGE = {"pardiso": "pypardiso", "metis": "pymetis", "plain": "scipy"}


def layered(nu, ratio=1.0, elements=4):
    """Two layers on a clamped base: matrix, clamped unknowns and a few loads."""
    mesh = skfem.MeshHex.init_tensor(*[np.linspace(0, 3, elements + 1)] * 2, np.linspace(0, 1, 3))
    region = (mesh.p[2][mesh.t].mean(axis=0) > 0.5).astype(int)
    prepared = prepare_elements(mesh, region=region)
    shear = np.array([1.0, ratio])
    matrix = assemble_linear(prepared, shear, 3 * (1 - 2 * nu) / (2 * shear * (1 + nu)))
    base = np.flatnonzero(prepared.nodes[:, 2] < 1e-9)
    load = np.random.default_rng(0).standard_normal((matrix.shape[0], 3))
    return matrix, (3 * base[:, None] + np.arange(3)).ravel(), load


def system(backend, matrix, fixed):
    pytest.importorskip(PACKAGE[backend])
    return ConstrainedSystem(fixed, backend=backend).factorise(matrix)


@pytest.mark.parametrize("ratio", [pytest.param(1.0, marks=pytest.mark.slow), 1000.0])
@pytest.mark.parametrize("nu", [pytest.param(0.3, marks=pytest.mark.slow), 0.4999, 0.5])
@pytest.mark.parametrize("backend", BACKENDS)
def test_backends_agree(backend, nu, ratio):
    matrix, fixed, load = layered(nu, ratio)
    found = system(backend, matrix, fixed).solve(load)
    expected = ConstrainedSystem(fixed, backend="plain").factorise(matrix).solve(load)
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("backend", BACKENDS)
def test_one_column_and_prescribed_values(backend):
    matrix, fixed, load = layered(0.5)
    mine = system(backend, matrix, fixed)
    value = np.linspace(0, 1, len(fixed))
    many, one = mine.solve(load, value), mine.solve(load[:, 1], value)
    assert one == pytest.approx(many[:, 1], abs=1e-12 * np.abs(many).max())
    assert (many[fixed] == value[:, None]).all()
    residual = matrix @ many - load - mine.reaction(many, load)
    assert np.abs(residual).max() <= 1e-10 * np.abs(load).max()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_larger_pattern_is_analysed_again(backend):
    matrix, fixed, load = layered(0.45)
    first = system(backend, matrix, fixed)
    spring = sp.coo_matrix(([3.0, 3.0], ([30, 290], [290, 30])), shape=matrix.shape)
    changed = (matrix + spring).tocsr()
    found = first.factorise(changed).solve(load)
    expected = ConstrainedSystem(fixed, backend="plain").factorise(changed).solve(load)
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


@pytest.mark.slow
def test_systems_do_not_share_a_solver():
    """Two pardiso systems alive at once, one dropped: the other still has its own factors."""
    matrix, fixed, load = layered(0.5)
    other, _, _ = layered(0.3)
    first, second = system("pardiso", matrix, fixed), system("pardiso", other, fixed)
    expected = first.solve(load)
    assert np.abs(second.solve(load) - expected).max() > 1e-3 * np.abs(expected).max()
    del second
    gc.collect()
    assert first.solve(load) == pytest.approx(expected, abs=1e-14)


def test_backend_is_chosen_by_argument_environment_and_size(monkeypatch):
    matrix, fixed, _ = layered(0.5, elements=2)
    monkeypatch.setenv("SOFTCOVER_SOLVER", "plain")
    assert ConstrainedSystem(fixed).factorise(matrix)._factors.backend == "plain"
    assert ConstrainedSystem(fixed, backend="metis").factorise(matrix)._factors.backend == "metis"
    monkeypatch.setenv("SOFTCOVER_SOLVER", "mumps")
    with pytest.raises(ValueError, match="unknown solver 'mumps'; known solvers: pardiso, metis, plain"):
        ConstrainedSystem(fixed).factorise(matrix)
    monkeypatch.delenv("SOFTCOVER_SOLVER")
    monkeypatch.setattr(sparse_solver, "_can_load_pardiso", lambda: False)
    assert sparse_solver._choose_backend(None, 10**6) == "metis"
    monkeypatch.setattr(sparse_solver, "find_spec", lambda _: None)
    assert sparse_solver._choose_backend(None, 10**6) == "plain"


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_floating_body_is_singular_in_words(backend):
    matrix = sp.csr_matrix(np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]))
    with pytest.raises(np.linalg.LinAlgError, match=r"singular|factorise"):
        system(backend, matrix, np.array([], dtype=int)).solve(np.ones(3))


@settings(max_examples=25, deadline=None)
@given(
    free=st.integers(2, 12),
    pressures=st.integers(0, 4),
    seed=st.integers(0, 1000),
    backend=st.sampled_from([name for name in BACKENDS if find_spec(PACKAGE[name])]),
)
def test_factors_of_any_saddle_point_system_solve_it_as_dense_algebra_does(free, pressures, seed, backend):
    """Symmetric, positive definite in the displacements, with zeros on the diagonal as incompressible rubber has."""
    rng = np.random.default_rng(seed)
    pressures = min(pressures, free - 1)
    half = rng.standard_normal((free, free))
    couple = rng.standard_normal((free, pressures))
    matrix = np.block([[half @ half.T + np.eye(free), couple], [couple.T, np.zeros((pressures, pressures))]])
    right = rng.standard_normal((len(matrix), 2))
    rows, columns = np.triu_indices(len(matrix))
    upper = sp.csr_matrix((matrix[rows, columns], (rows, columns)), shape=matrix.shape)
    found = SymmetricFactors(backend=backend).factorise(upper).solve(right)
    assert found == pytest.approx(np.linalg.solve(matrix, right), rel=1e-6, abs=1e-6)
