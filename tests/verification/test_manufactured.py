"""Manufactured solutions: order of convergence, locking, and the defects that break them.

A field is chosen; its stress is written out here, by formulas that share nothing with the elements; the body force
that it needs follows by differences; the elements must come back to the field at their order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import skfem

from fem_reference.elements.taylor_hood import Pattern, assemble_linear, prepare_elements
from fem_reference.finite_strain.contact_problem import locate_pressures
from fem_reference.finite_strain.hyperelastic import Solid
from fem_reference.finite_strain.loading_path import Units
from fem_reference.sparse_solver import ConstrainedSystem
from meshes import Cover, Layer, Material

STEP = 2e-3
#: What quadratic displacements and linear pressures are good for: displacement, its gradient, pressure.
ORDERS = np.array([3.0, 2.0, 2.0])
slow = pytest.mark.slow


def rubber(nu):
    return Material(name="m", model="neo-hookean", parameters={"shear_modulus": 1.0}, poisson_ratio=nu)


def bulk_compliance(nu):
    """1 / K for a shear modulus of 1."""
    return 3 * (1 - 2 * nu) / (2 * (1 + nu))


def slope(function, x, axis):
    """d function / dx along an axis, to fourth order; x is (d, ...), the function's result (..., any)."""
    h = np.zeros((len(x), *[1] * (x.ndim - 1)))
    h[axis] = STEP
    return (8 * (function(x + h) - function(x - h)) - function(x + 2 * h) + function(x - 2 * h)) / (12 * STEP)


# Fields, of (d, ...) to (..., d): around an axis (r, z), or in space.


def ring_any(x):
    return 0.08 * np.stack([np.sin(2 * x[0]) * np.cos(1.5 * x[1]), x[0] * np.sin(2 * x[1]) + x[0] ** 2], axis=-1)


def ring_volume(x):
    """What is added over K: its divergence is the pressure."""
    return 0.05 * np.stack([np.cos(2 * x[0]) * x[1] ** 2, np.cos(x[0] + x[1])], axis=-1)


def ring_isochoric(x):
    """A ring that widens at constant volume and shears along its axis."""
    return np.stack([np.sqrt(x[0] ** 2 + 0.15) - x[0], 0.2 * np.sin(2 * x[0])], axis=-1)


def ring_solenoidal(x):
    """u = curl: (psi_z, -psi_r - psi / r) of psi = r^2 sin(2 z) sin(r)."""
    r, z = x
    return 0.05 * np.stack(
        [2 * r**2 * np.cos(2 * z) * np.sin(r), -np.sin(2 * z) * (3 * r * np.sin(r) + r**2 * np.cos(r))], -1
    )


def block_isochoric(x):
    return np.stack([0.15 * np.sin(x[1] + 2 * x[2]), 0 * x[0], 0 * x[0]], axis=-1)


def block_any(x):
    more = np.stack([np.sin(x[0]), x[2] * np.sin(1.3 * x[1]), np.cos(x[0] + 0.7 * x[2])], axis=-1)
    return block_isochoric(x) + 0.03 * more


def pressure_any(x):
    return 0.3 * np.sin(1.5 * x[0]) * np.cos(x[-1])


@dataclass(frozen=True, kw_only=True)
class Case:
    """A field, its pressure when nothing can change volume, and the law."""

    field: object
    nu: float
    finite: bool
    axisymmetric: bool
    limit: object = pressure_any

    def gradient(self, x):
        """grad u as (..., 3, 3), in the order r, z, hoop around an axis."""
        out = np.zeros((*x.shape[1:], 3, 3))
        for j in range(len(x)):
            out[..., : len(x), j] = slope(self.field, x, j)
        if self.axisymmetric:
            out[..., 2, 2] = self.field(x)[..., 0] / x[0]
        return out

    def pressure(self, x):
        if self.nu == 0.5:
            return self.limit(x)
        G = self.gradient(x)
        volume = np.linalg.det(np.eye(3) + G) - 1 if self.finite else np.trace(G, axis1=-2, axis2=-1)
        return -volume / bulk_compliance(self.nu)

    def stress(self, x):
        """First Piola-Kirchhoff, shear modulus 1: dev of 2 e - p, or J^(-2/3) (F - tr C / 3 F^-T) - p J F^-T."""
        G, one = self.gradient(x), np.eye(3)
        p = self.pressure(x)[..., None, None]
        if not self.finite:
            trace = np.trace(G, axis1=-2, axis2=-1)[..., None, None]
            return G + G.swapaxes(-1, -2) - 2 / 3 * trace * one - p * one
        F = one + G
        J = np.linalg.det(F)[..., None, None]
        turned = np.linalg.inv(F).swapaxes(-1, -2)
        trace = (F**2).sum(axis=(-2, -1))[..., None, None]
        return J ** (-2 / 3) * (F - trace / 3 * turned) - p * J * turned

    def body_force(self, x):
        d = len(x)
        out = -sum(slope(self.stress, x, j)[..., :d, j] for j in range(d))
        if self.axisymmetric:
            P = self.stress(x)
            out -= np.stack([P[..., 0, 0] - P[..., 2, 2], P[..., 1, 0]], axis=-1) / x[0][..., None]
        return out


def solved(case, mesh, spoil=lambda elements: elements):
    """Elements and the state they find, the field held all around."""
    elements = spoil(prepare_elements(mesh, axisymmetric=case.axisymmetric, order=6))
    basis, d = elements.basis, elements.dimension
    x = np.asarray(basis.global_coordinates())
    force = case.body_force(x) * (2 * np.pi * x[0] if case.axisymmetric else np.ones_like(x[0]))[..., None]
    load = np.zeros(elements.displacements + elements.pressures)
    for i in range(d):
        load[i : elements.displacements : d] = skfem.LinearForm(lambda v, w: w.f * v).assemble(basis, f=force[..., i])
    edge = basis.get_dofs().flatten()
    wanted = case.field(elements.nodes.T).ravel()
    held = (d * edge[:, None] + np.arange(d)).ravel()
    values = wanted[held]
    if case.nu == 0.5:  # the mean pressure is free when nothing can change volume
        held = np.append(held, elements.displacements)
        values = np.append(values, case.pressure(locate_pressures(elements)[:1].T))
    order = np.argsort(held)
    return elements, _balanced(case, elements, load, held[order], values[order])


def _balanced(case, elements, load, held, values):
    if not case.finite:
        matrix = assemble_linear(elements, np.ones(1), np.array([bulk_compliance(case.nu)]))
        return ConstrainedSystem(held).factorise(matrix).solve(load, values)
    cover = Cover(layers=(Layer(thickness=1.0, material=rubber(case.nu)),))
    body = Solid.from_cover(elements, cover, Units.of(cover))
    state = np.concatenate([case.field(elements.nodes.T).ravel(), np.zeros(elements.pressures)])
    for _ in range(12):
        force, tangent = body.linearise(state)
        change = ConstrainedSystem(held).factorise(tangent).solve(load - force, values - state[held])
        state += change
        if np.abs(change).max() < 1e-10:
            return state
    pytest.fail("Newton's method did not converge")


def errors(case, elements, state):
    """Of displacement, its gradient and the pressure in the mean square, relative."""
    x = np.asarray(elements.basis.global_coordinates())
    shape = np.stack([np.broadcast_to(elements.basis.basis[a][0], x.shape[1:]) for a in range(elements.cells.shape[1])])
    u = np.einsum("aeq,eai->eqi", shape, state[elements.unknowns].reshape(*elements.cells.shape, -1))
    rows, columns = np.array(elements.places).T
    pressure = np.einsum("eqb,eb->eq", elements.pressure_shape, state[elements.pressure_cells + elements.displacements])
    exact = case.pressure(x)
    if case.nu == 0.5:  # known but for its mean, which one held value fixes
        exact = exact + ((pressure - exact) * elements.weight).sum() / elements.weight.sum()
    pairs = [
        (u, case.field(x)),
        (elements.compute_gradient(state), case.gradient(x)[..., rows, columns]),
        (pressure[..., None], exact[..., None]),
    ]
    norm = lambda v: np.sqrt((elements.weight[..., None] * v**2).sum())  # noqa: E731
    return np.array([norm(found - exact) / norm(exact) for found, exact in pairs])


MESHES = {
    "quadrilaterals": lambda n: skfem.MeshQuad.init_tensor(np.linspace(0.5, 1.5, n + 1), np.linspace(0, 1, n + 1)),
    "triangles": lambda n: skfem.MeshTri.init_tensor(np.linspace(0.5, 1.5, n + 1), np.linspace(0, 1, n + 1)),
    "hexahedra": lambda n: skfem.MeshHex.init_tensor(*[np.linspace(0, 1, n + 1)] * 3),
    "tetrahedra": lambda n: skfem.MeshTet.init_tensor(*[np.linspace(0, 1, n + 1)] * 3),
}
FIELDS = {
    (True, 0.4): ring_any,
    (True, 0.5, False): ring_solenoidal,
    (True, 0.5, True): ring_isochoric,
    (False, 0.4): block_any,
    (False, 0.5, False): block_isochoric,
    (False, 0.5, True): block_isochoric,
}


def case_of(kind, nu, *, finite):
    around = kind in ("quadrilaterals", "triangles")
    field = FIELDS.get((around, nu)) or FIELDS[around, nu, finite]
    return Case(field=field, nu=nu, finite=finite, axisymmetric=around)


def observed(case, kind, coarse, fine, **options):
    """Orders of convergence between two grids."""
    each = [errors(case, *solved(case, MESHES[kind](n), **options)) for n in (coarse, fine)]
    return np.log(each[0] / each[1]) / np.log(fine / coarse)


GRIDS = {"quadrilaterals": (8, 16), "triangles": (8, 16), "hexahedra": (4, 8), "tetrahedra": (4, 8)}


@pytest.mark.parametrize(
    ("kind", "nu", "finite"),
    [
        pytest.param(k, nu, finite, marks=() if k == "quadrilaterals" and (nu == 0.5) == finite else slow)
        for k in GRIDS
        for nu in (0.4, 0.5)
        for finite in (False, True)
    ],
)
def test_elements_converge_at_their_order(kind, nu, finite):
    assert observed(case_of(kind, nu, finite=finite), kind, *GRIDS[kind]) == pytest.approx(ORDERS, abs=0.15)


def ring_even(x):
    return np.stack([0.2 * x[0], -0.1 * x[1]], axis=-1)


def block_even(x):
    gradient = np.array([[0.1, 0.3, -0.2], [0.05, -0.2, 0.1], [0.2, 0.1, 0.15]])
    return np.moveaxis(np.tensordot(gradient, x, 1), 0, -1)


@pytest.mark.parametrize("kind", MESHES)
def test_an_even_deformation_is_found_exactly(kind):
    """The patch test at finite strain; the pressures start from zero."""
    around = kind in ("quadrilaterals", "triangles")
    case = Case(field=ring_even if around else block_even, nu=0.4, finite=True, axisymmetric=around)
    assert errors(case, *solved(case, MESHES[kind](2))).max() < 1e-9
    if around:
        assert errors(case, *solved(case, MESHES[kind](2), spoil=half_the_hoop)).max() > 1e-3


# Defects: what the orders must see.


def half_the_hoop(elements):
    return replace(elements, hoop=elements.hoop / 2)


def no_hoop(elements):
    return replace(elements, hoop=0 * elements.hoop)


def other_sign_of_shear(elements):
    """Derivatives along z with the wrong sign."""
    return replace(elements, slope=elements.slope * np.array([1.0, -1.0]))


def pressure_of_cells(elements):
    """One mean of the four pressures in each element: less than linear."""
    return replace(elements, pressure_shape=np.full_like(elements.pressure_shape, 0.25))


@pytest.mark.parametrize("defect", [half_the_hoop, no_hoop, other_sign_of_shear, pressure_of_cells])
def test_planted_defects_lose_the_order(defect):
    case = case_of("quadrilaterals", 0.4, finite=False)
    assert observed(case, "quadrilaterals", 4, 8, spoil=defect).min() < 1.3


# Locking: one displacement that hardly changes volume and one pressure, whatever the Poisson ratio.


def nearly_isochoric(nu):
    def volume_pressure(x):
        u = ring_volume(x)
        return -(slope(ring_volume, x, 0)[..., 0] + slope(ring_volume, x, 1)[..., 1] + u[..., 0] / x[0])

    def field(x):
        return ring_solenoidal(x) + bulk_compliance(nu) * ring_volume(x)

    return Case(field=field, nu=nu, finite=False, axisymmetric=True, limit=volume_pressure)


def displacement_only(case, elements, load, held, values):
    """The defect: the same quadratic displacements with the volume's stiffness in place of a pressure."""
    unit = np.array([float(i == j) for i, j in elements.places])
    zero = np.zeros((len(elements.cells), elements.cells.shape[1] * 2, elements.pressure_cells.shape[1]))
    mixed = assemble_linear(elements, np.ones(1), np.ones(1))[: elements.displacements, : elements.displacements]
    moduli = np.outer(unit, unit) / bulk_compliance(case.nu) * elements.weight[..., None, None]
    volume = elements.integrate_stiffness(moduli)
    square = np.zeros((zero.shape[0], zero.shape[2], zero.shape[2]))
    whole = Pattern(elements).assemble(volume, zero, square)[: elements.displacements, : elements.displacements]
    out = np.zeros_like(load)
    out[: elements.displacements] = (
        ConstrainedSystem(held).factorise(mixed + whole).solve(load[: elements.displacements], values)
    )
    return out


def gradient_errors(ratios):
    return np.array(
        [errors(nearly_isochoric(nu), *solved(nearly_isochoric(nu), MESHES["triangles"](8)))[1] for nu in ratios]
    )


def test_elements_do_not_lock():
    """The error does not grow with the Poisson ratio, up to and including 0.5."""
    found = gradient_errors([0.3, 0.49, 0.499, 0.49999, 0.5])
    assert (found < 1.1 * found[0]).all()


def test_displacement_elements_lock(monkeypatch):
    """The planted defect of the test above."""
    monkeypatch.setitem(globals(), "_balanced", displacement_only)
    found = gradient_errors([0.3, 0.49, 0.499, 0.49999])
    assert found[2] > 2 * found[0]
    assert found[3] > 4 * found[0]
