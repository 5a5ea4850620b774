"""Patch tests and convergence of the mixed elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import skfem

from fem_reference.elements.taylor_hood import assemble_linear, prepare_elements
from fem_reference.sparse_solver import ConstrainedSystem


def distorted(mesh, seed=0, amount=0.15):
    """Move interior vertices at random."""
    rng = np.random.default_rng(seed)
    inside = mesh.interior_nodes()
    points = mesh.p.copy()
    size = mesh.param()
    points[:, inside] += rng.uniform(-amount, amount, (mesh.dim(), len(inside))) * size / np.sqrt(mesh.dim())
    return type(mesh)(points, mesh.t)


MESHES = {
    "tetrahedra": lambda: skfem.MeshTet().refined(2),
    "hexahedra": lambda: skfem.MeshHex().refined(2),
    "triangles": lambda: skfem.MeshTri().refined(2).translated((0.5, 0.0)),
    "quadrilaterals": lambda: skfem.MeshQuad().refined(2).translated((0.5, 0.0)),
}


def solve_with_boundary(mesh, field, mu, bulk_compliance):
    """Prescribe a displacement field on the whole boundary and return what comes out inside."""
    elements = prepare_elements(mesh, axisymmetric=mesh.dim() == 2, order=6)
    matrix = assemble_linear(elements, np.array([mu]), np.array([bulk_compliance]))
    boundary = elements.basis.get_dofs().flatten()
    d = elements.dimension
    fixed = np.sort((d * boundary[:, None] + np.arange(d)).ravel())
    if bulk_compliance == 0:
        fixed = np.append(fixed, matrix.shape[0] - 1)  # the mean pressure is free when nothing can change volume
    wanted = field(elements.nodes.T).T.ravel()
    values = np.zeros(len(fixed))
    values[fixed < elements.displacements] = wanted[fixed[fixed < elements.displacements]]
    solution = ConstrainedSystem(fixed).factorise(matrix).solve(np.zeros(matrix.shape[0]), values)
    return elements, solution[: elements.displacements], wanted


@pytest.mark.parametrize("bulk_compliance", [0.7, 1e-3])
@pytest.mark.parametrize("kind", ["tetrahedra", "hexahedra"])
def test_solid_patch_test(kind, bulk_compliance):
    gradient = np.array([[0.1, 0.3, -0.2], [0.05, -0.2, 0.4], [0.6, 0.1, 0.3]])
    _, found, wanted = solve_with_boundary(distorted(MESHES[kind]()), lambda x: gradient @ x, 1.3, bulk_compliance)
    assert np.abs(found - wanted).max() <= 1e-10 * np.abs(wanted).max()


@pytest.mark.parametrize("bulk_compliance", [0.7, 1e-3, 0.0])
@pytest.mark.parametrize("kind", ["triangles", "quadrilaterals"])
def test_axisymmetric_patch_test(kind, bulk_compliance):
    """u = (a r, b z) is a uniform strain; isochoric (b = -2a) when incompressible."""
    a, b = 0.2, -0.4 if bulk_compliance == 0 else 0.1
    mesh = distorted(MESHES[kind]())
    _, found, wanted = solve_with_boundary(mesh, lambda x: np.stack([a * x[0], b * x[1]]), 1.3, bulk_compliance)
    assert np.abs(found - wanted).max() <= 1e-10 * np.abs(wanted).max()


def test_a_planted_defect_fails_the_patch_test():
    """A wrong hoop strain (half of it) must not pass."""
    mesh = distorted(MESHES["quadrilaterals"]())
    elements = prepare_elements(mesh, axisymmetric=True, order=6)
    broken = replace(elements, hoop=elements.hoop / 2)
    matrix = assemble_linear(broken, np.array([1.3]), np.array([0.7]))
    boundary = elements.basis.get_dofs().flatten()
    fixed = np.sort((2 * boundary[:, None] + np.arange(2)).ravel())
    wanted = np.stack([0.2 * elements.nodes[:, 0], 0.1 * elements.nodes[:, 1]], axis=1).ravel()
    found = ConstrainedSystem(fixed).factorise(matrix).solve(np.zeros(matrix.shape[0]), wanted[fixed])
    assert np.abs(found[: elements.displacements] - wanted).max() > 1e-4


def test_stiffness_is_symmetric_and_rigid_motion_needs_no_force():
    elements = prepare_elements(distorted(MESHES["hexahedra"]()))
    matrix = assemble_linear(elements, np.array([2.0]), np.array([0.3]))
    assert abs(matrix - matrix.T).max() < 1e-12
    x = elements.nodes
    turn = np.stack([-x[:, 1], x[:, 0], 0 * x[:, 0]], axis=1).ravel()
    motion = np.concatenate([turn, np.zeros(elements.pressures)])
    assert np.abs(matrix @ motion).max() < 1e-12


def test_pressure_may_jump_between_regions():
    mesh = skfem.MeshQuad.init_tensor(np.array([0.5, 1.0]), np.array([0.0, 0.5, 1.0]))
    assert prepare_elements(mesh, axisymmetric=True).pressures == 6
    assert prepare_elements(mesh, axisymmetric=True, region=np.array([0, 1])).pressures == 8


def test_meshes_without_defined_elements_are_refused():
    with pytest.raises(ValueError, match="no mixed element for MeshLine1"):
        prepare_elements(skfem.MeshLine())
    with pytest.raises(ValueError, match="axisymmetric"):
        prepare_elements(skfem.MeshQuad())
