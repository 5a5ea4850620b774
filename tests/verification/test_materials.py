"""Stored energies against differences, invariances, small strain and closed forms; each check has a defect it must see.

A check is a function that returns a relative error: the same one passes the real energies and fails the planted ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from fem_reference.materials import (
    Ogden,
    Polynomial,
    Response,
    create_energy,
    first_isochoric,
    second_isochoric,
    volume_ratio,
)
from meshes.catalogue import MATERIALS

ENERGIES = {
    "neo-hookean": Polynomial(c1=0.65),
    "mooney-rivlin": Polynomial(c1=0.3, c01=0.2),
    "yeoh": Polynomial(c1=0.5, c2=0.1, c3=0.02),
    "yeoh, negative third": Polynomial(c1=100.6, c2=6.387, c3=-0.149),
    "ogden, one term": Ogden(moduli=(1.97,), exponents=(2.72,)),
    "ogden, three terms": Ogden(moduli=(0.7, 0.3, 0.05), exponents=(1.5, 5.0, -2.0)),
}
SHEAR_MODULI = (1.3, 1.0, 1.0, 201.2, 1.97, 1.05)
TOLERANCE = 1e-7

every_energy = pytest.mark.parametrize("name", ENERGIES)


def deformations():
    """Random ones, and those where stretches meet or nearly meet."""
    rng = np.random.default_rng(1)
    random = np.eye(3) + 0.3 * rng.standard_normal((40, 3, 3))
    random = random[np.linalg.det(random) > 0.2]
    turned = rotation(0.7) @ np.diag([1.4, 0.8, 0.8]) @ rotation(1.9)
    special = [np.eye(3), 1.1 * np.eye(3), np.diag([2.0, 2**-0.5, 2**-0.5]), np.diag([0.5, 2**0.5, 2**0.5]), turned]
    near = [np.diag([1.2, 1.2 * (1 + gap), 0.7]) for gap in (1e-12, 1e-8, 0.9e-5, 1.1e-5, 1e-4, 1e-3)]
    return np.array([*random[:12], *special, *near])


def rotation(angle):
    axis = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])
    cross = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def respond(material, F):
    """The response with its nine components as 3 x 3."""
    found = material.isochoric(F, volume_ratio(F))
    return Response(energy=found.energy, stress=square(found.stress), tangent=square(found.tangent, 2))


def square(components, order=1):
    """(..., 9) as (..., 3, 3), (..., 9, 9) as (..., 3, 3, 3, 3)."""
    return components.reshape(*components.shape[: components.ndim - order], *(3,) * (2 * order))


def relative(found, wanted):
    """Largest difference over the largest value anywhere."""
    return np.abs(found - wanted).max() / np.abs(wanted).max()


def central_difference(function, F, step=1e-5):
    """d function / dF, the two indices of F last."""
    columns = []
    for place in np.ndindex(3, 3):
        shift = np.zeros((3, 3))
        shift[place] = step
        columns.append((function(F + shift) - function(F - shift)) / (2 * step))
    return np.stack(columns, axis=-1).reshape(*columns[0].shape, 3, 3)


def derivative_error(material):
    """Stress against differences of the energy, tangent against differences of the stress."""
    F = deformations()
    found = respond(material, F)
    stress = central_difference(lambda G: respond(material, G).energy, F)
    tangent = central_difference(lambda G: respond(material, G).stress, F)
    return max(relative(found.stress, stress), relative(found.tangent, tangent))


def symmetry_error(material):
    tangent = respond(material, deformations()).tangent
    return relative(tangent.transpose(0, 3, 4, 1, 2), tangent)


def rotation_error(material):
    """Turning the deformed body turns the stress with it; turning the undeformed one changes nothing (isotropy)."""
    F, Q = deformations(), rotation(1.1)
    rest, after, before = respond(material, F), respond(material, Q @ F), respond(material, F @ Q)
    return max(
        relative(after.energy, rest.energy),
        relative(before.energy, rest.energy),
        relative(after.stress, Q @ rest.stress),
        relative(before.stress, rest.stress @ Q),
        relative(after.tangent, np.einsum("ia,kc,...ajcl->...ijkl", Q, Q, rest.tangent)),
        relative(before.tangent, np.einsum("bj,dl,...ibkd->...ijkl", Q, Q, rest.tangent)),
    )


def volume_error(material):
    """Swelling does not change an isochoric energy, and costs no work: P : F = 0."""
    F = deformations()
    rest, swollen = respond(material, F), respond(material, 1.7 * F)
    work = np.einsum("...ij,...ij->...", rest.stress, F)
    return max(relative(swollen.energy, rest.energy), np.abs(work).max() / np.abs(rest.stress).max())


def small_strain_error(material, shear_modulus):
    """At rest: no energy, no stress, and the deviatoric tangent of linear elasticity."""
    found = respond(material, np.eye(3))
    one = np.eye(3)
    deviatoric = np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one)
    wanted = shear_modulus * (deviatoric - 2 / 3 * np.einsum("ij,kl->ijkl", one, one))
    at_rest = max(abs(float(found.energy)), np.abs(found.stress).max()) / shear_modulus
    return max(at_rest, relative(found.tangent, wanted))


@every_energy
def test_derivatives_agree_with_differences(name):
    assert derivative_error(ENERGIES[name]) < TOLERANCE


@every_energy
def test_tangent_is_symmetric(name):
    assert symmetry_error(ENERGIES[name]) < 1e-12


@every_energy
def test_energy_is_objective_and_isotropic(name):
    assert rotation_error(ENERGIES[name]) < 1e-9


@every_energy
def test_energy_does_not_depend_on_the_volume_ratio(name):
    assert volume_error(ENERGIES[name]) < 1e-12


@pytest.mark.parametrize(("name", "shear_modulus"), list(zip(ENERGIES, SHEAR_MODULI, strict=True)))
def test_small_strain_is_linear_elasticity(name, shear_modulus):
    assert small_strain_error(ENERGIES[name], shear_modulus) < 1e-12


@pytest.mark.parametrize("name", [name for name, material in MATERIALS.items() if not material.small_strain_only])
def test_library_has_the_small_strain_modulus_that_it_states(name):
    assert small_strain_error(create_energy(MATERIALS[name]), MATERIALS[name].shear_modulus) < 1e-12


@pytest.mark.parametrize(
    "invariant",
    [
        volume_ratio,
        lambda F: first_isochoric(F, volume_ratio(F)),
        lambda F: second_isochoric(F, volume_ratio(F)),
    ],
    ids=["J", "I1", "I2"],
)
def test_invariants_have_the_derivatives_that_they_state(invariant):
    F = deformations()
    first, second = (square(invariant(F).first), square(invariant(F).second, 2))
    assert relative(first, central_difference(lambda G: invariant(G).value, F)) < TOLERANCE
    assert relative(second, central_difference(lambda G: square(invariant(G).first), F)) < TOLERANCE


@every_energy
def test_around_an_axis_five_components_are_those_of_nine(name):
    """Deformations that turn nothing out of the plane: the same numbers, without the four that vanish."""
    F = deformations()[:12].copy()
    F[:, :2, 2] = F[:, 2, :2] = 0
    places = ((0, 0), (0, 1), (1, 0), (1, 1), (2, 2))
    kept = np.array([0, 1, 3, 4, 8])
    F = F[np.linalg.det(F) > 0.1]
    whole = ENERGIES[name].isochoric(F, volume_ratio(F))
    part = ENERGIES[name].isochoric(F, volume_ratio(F, places))
    assert relative(part.stress, whole.stress[:, kept]) < 1e-14
    assert relative(part.tangent, whole.tangent[:, kept[:, None], kept]) < 1e-14


def test_second_invariant_is_that_of_the_inverse():
    """I2(F) = I1(F^-1) for the isochoric invariants."""
    F = deformations()
    inverse = np.linalg.inv(F)
    wanted = first_isochoric(inverse, volume_ratio(inverse)).value
    assert relative(second_isochoric(F, volume_ratio(F)).value, wanted) < 1e-12


# Closed forms: an incompressible body that is free at its sides, so that the pressure cancels the stress there.

STRETCHES = np.linspace(0.4, 3.0, 27)


def tension(material, stretch, exponent):
    """True stress along x of an incompressible body with y free; stretches l, l^exponent and what is left."""
    other = stretch**exponent
    F = np.stack([np.diag([a, b, 1 / (a * b)]) for a, b in zip(stretch, other, strict=True)])
    true = respond(material, F).stress @ F.swapaxes(-1, -2)
    return true[:, 0, 0] - true[:, 2, 2]


def invariants(stretch, exponent):
    squares = np.array([stretch**2, stretch ** (2 * exponent), stretch ** (-2 * (1 + exponent))])
    return squares, squares.sum(axis=0), (1 / squares).sum(axis=0)


@pytest.mark.parametrize("exponent", [-0.5, 0.0, 1.0], ids=["uniaxial", "pure shear", "equibiaxial"])
def test_tension_has_its_closed_form(exponent):
    """Treloar 1975: s1 - s3 = 2 (l1^2 - l3^2) (dW/dI1 + l2^2 dW/dI2); Ogden 1972: sum 2 mu/a (l1^a - l3^a)."""
    squares, I1, _ = invariants(STRETCHES, exponent)
    fall = 2 * (squares[0] - squares[2])
    rivlin, yeoh = ENERGIES["mooney-rivlin"], ENERGIES["yeoh"]
    ogden = ENERGIES["ogden, three terms"]
    wanted = {
        "neo-hookean": fall * 1.3 / 2,
        "mooney-rivlin": fall * (rivlin.c1 + rivlin.c01 * squares[1]),
        "yeoh": fall * (yeoh.c1 + 2 * yeoh.c2 * (I1 - 3) + 3 * yeoh.c3 * (I1 - 3) ** 2),
        "ogden, three terms": sum(
            2 * mu / alpha * (squares[0] ** (alpha / 2) - squares[2] ** (alpha / 2))
            for mu, alpha in zip(ogden.moduli, ogden.exponents, strict=True)
        ),
    }
    for name, stress in wanted.items():
        assert relative(tension(ENERGIES[name], STRETCHES, exponent), stress) < 1e-12


def same(one, other):
    F = deformations()
    a, b = respond(one, F), respond(other, F)
    return max(relative(getattr(a, name), getattr(b, name)) for name in ("energy", "stress", "tangent"))


def test_models_contain_one_another():
    neo = Polynomial(c1=0.7)
    assert same(Ogden(moduli=(1.4,), exponents=(2.0,)), neo) < 1e-9
    assert same(Polynomial(c1=0.7, c2=0.0, c3=0.0), neo) < 1e-12
    assert same(Polynomial(c1=0.7, c01=0.0), neo) < 1e-12
    assert same(Ogden(moduli=(1.0, 0.4), exponents=(2.0, -2.0)), Polynomial(c1=0.5, c01=0.2)) < 1e-9
    assert same(Ogden(moduli=(0.4, 0.6), exponents=(3.0, 3.0)), Ogden(moduli=(1.0,), exponents=(3.0,))) < 1e-12


@pytest.mark.parametrize(
    ("name", "largest"),
    [(n, 4.0 if m.model == "yeoh" else 2.0) for n, m in MATERIALS.items() if not m.small_strain_only],
)
def test_pulling_forces_of_the_library_grow_with_the_stretch(name, largest):
    """The pulling force grows with the stretch over the range of the fit, and in compression to a third."""
    stretch = np.linspace(0.33, largest, 200)
    assert (np.diff(tension(create_energy(MATERIALS[name]), stretch, -0.5) / stretch) > 0).all()


def test_material_of_small_strain_has_no_energy():
    with pytest.raises(ValueError, match="take neo-hookean"):
        create_energy(MATERIALS["neoprene"])


# Planted defects: what each check must see.


@dataclass(frozen=True, kw_only=True)
class Spoiled:
    """A right energy whose response is spoiled by a factor."""

    right: Polynomial | Ogden = ENERGIES["ogden, three terms"]
    energy: float = 1.0
    stress: float = 1.0
    tangent: float = 1.0

    def isochoric(self, F, J):
        found = self.right.isochoric(F, J)
        return Response(
            energy=self.energy * found.energy, stress=self.stress * found.stress, tangent=self.tangent * found.tangent
        )


def flat(tensor):
    """(..., 3, 3) as (..., 9)."""
    return tensor.reshape(*tensor.shape[:-2], 9)


class WithVolume:
    """mu / 2 (tr C - 3) without the factor J^(-2/3): right derivatives, but swelling costs energy."""

    def isochoric(self, F, J):
        second = np.broadcast_to(np.eye(9), (*F.shape[:-2], 9, 9))
        energy = (np.einsum("...ij,...ij->...", F, F) - 3) / 2
        return Response(energy=energy, stress=flat(F), tangent=second)


class Linear:
    """mu e : e of the linear strain: right derivatives and small-strain shear, but a rotation costs energy."""

    def isochoric(self, F, J):
        strain = (F + F.swapaxes(-1, -2)) / 2 - np.eye(3)
        one = np.eye(3)
        second = np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one)
        return Response(
            energy=np.einsum("...ij,...ij->...", strain, strain),
            stress=2 * flat(strain),
            tangent=np.broadcast_to(second.reshape(9, 9), (*F.shape[:-2], 9, 9)),
        )


class Lopsided(Polynomial):
    """A tangent that lacks its symmetry."""

    def isochoric(self, F, J):
        found = super().isochoric(F, J)
        tangent = found.tangent.copy()
        tangent[..., 0, 4] *= 1.001
        return Response(energy=found.energy, stress=found.stress, tangent=tangent)


def test_planted_defects_are_found():
    assert derivative_error(Spoiled(energy=1.0001)) > 100 * TOLERANCE
    assert derivative_error(Spoiled(stress=1.0001)) > 100 * TOLERANCE
    assert derivative_error(Spoiled(tangent=1.0001)) > 100 * TOLERANCE
    assert symmetry_error(Lopsided(c1=0.5)) > 1e-5
    assert derivative_error(WithVolume()) < TOLERANCE  # consistent, and yet wrong:
    assert volume_error(WithVolume()) > 0.1
    assert small_strain_error(WithVolume(), 1.0) > 0.1
    assert derivative_error(Linear()) < TOLERANCE
    assert rotation_error(Linear()) > 0.1
    assert small_strain_error(Spoiled(tangent=0.5), 1.05) > 0.4
    assert same(Ogden(moduli=(1.4,), exponents=(2.01,)), Polynomial(c1=0.7)) > 1e-4
