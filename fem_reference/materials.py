"""Stored energies of rubber-like materials with their first and second derivatives, and the limits of their stability.

The energy per reference volume is W(F) = isochoric(F) - p (J - 1) - p^2 / 2 K, with the deformation gradient F and its
determinant J.  The mean pressure p is an independent unknown, so that an infinite bulk modulus K needs no special case
(Simo, Taylor and Pister 1985).  A material supplies the isochoric part, which does not change when F is multiplied by
a number.  A compressible energy V(F) of small-strain bulk modulus K supplies V(F) - K (J - 1)^2 / 2 in its place; p is
then the pressure less that of this part.

F has shape (..., 3, 3).  Derivatives are taken only with respect to the components of F that can differ from those of
the unit matrix: all nine in three dimensions, five in axisymmetric states.  First derivatives have shape (..., g) and
second ones (..., g, g), in the order of `places`.  The invariants are J^(-2/3) tr C and J^(-4/3) (tr^2 C - tr C^2) / 2
with C = F^T F (Holzapfel, Nonlinear Solid Mechanics, section 6.4).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from meshes import Material
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class MaterialSettings:
    """Numbers of the material laws."""

    #: Relative difference of two principal stretches below which divided differences of the stresses are replaced by
    #: their limit for equal stretches, to avoid cancellation [-].
    equal: float = 1e-5
    #: Largest stretch, or reciprocal of the smallest, that is examined for stability [-].
    largest: float = 8.0
    #: Number of stretches up to it [-].
    stretches: int = 600


_SETTINGS = MaterialSettings()


#: Row and column of each selected component of a 3 x 3 tensor.
Places = tuple[tuple[int, int], ...]

#: Row and column of all nine components of a 3 x 3 tensor, row by row.
EVERY_PLACE: Places = tuple((i, j) for i in range(3) for j in range(3))


@dataclass(frozen=True, kw_only=True, eq=False)
class Invariant:
    """Invariant of the deformation gradient F, with its derivatives with respect to g components of F.

    Attributes:
        value: Value of the invariant, shape (...) [-].
        first: First derivatives, shape (..., g) [-].
        second: Second derivatives, shape (..., g, g) [-].
        places: Row and column in F of each of the g components.
    """

    value: FloatArray
    first: FloatArray
    second: FloatArray
    places: Places


def pick_components(tensor: FloatArray, places: Places) -> FloatArray:
    """Select g components, given by row and column, of tensors of shape (..., 3, 3); the result has shape (..., g)."""
    i, j = np.array(places).T
    return np.asarray(tensor[..., i, j])


def volume_ratio(F: FloatArray, places: Places = EVERY_PLACE) -> Invariant:
    """Compute J = det F with its first derivatives (cofactors of F) and second derivatives (signed entries of F)."""
    cofactor = {place: _minor(F, *place) for place in {*places, (0, 0), (0, 1), (0, 2)}}
    second = np.zeros((*F.shape[:-2], len(places), len(places)))
    for a, (i, j) in enumerate(places):
        for b, (k, m) in enumerate(places):
            if i != k and j != m:
                second[..., a, b] = _sign(i, k) * _sign(j, m) * F[..., 3 - i - k, 3 - j - m]
    return Invariant(
        value=sum((F[..., 0, j] * cofactor[0, j] for j in range(3)), np.zeros(F.shape[:-2])),
        first=np.stack([cofactor[place] for place in places], axis=-1),
        second=second,
        places=places,
    )


def first_isochoric(F: FloatArray, J: Invariant) -> Invariant:
    """Compute the first isochoric invariant J^(-2/3) tr C with its derivatives."""
    trace = Invariant(
        value=np.einsum("...ij,...ij->...", F, F),
        first=2 * pick_components(F, J.places),
        second=2 * np.eye(len(J.places)),
        places=J.places,
    )
    return _multiply_by_power(trace, J, -2 / 3)


def second_isochoric(F: FloatArray, J: Invariant) -> Invariant:
    """Compute the second isochoric invariant J^(-4/3) (tr^2 C - tr C^2) / 2 with its derivatives."""
    C = F.swapaxes(-1, -2) @ F
    b = F @ F.swapaxes(-1, -2)
    trace = np.einsum("...ii->...", C)
    i, j = np.array(J.places).T
    k, m = i, j  # component of F of the second differentiation, along the last axis
    i, j = i[:, None], j[:, None]
    flat = pick_components(F, J.places)
    second = (
        4 * flat[..., :, None] * flat[..., None, :]
        + 2 * trace[..., None, None] * ((i == k) & (j == m))
        - 2 * (i == k) * C[..., m, j]
        - 2 * F[..., i, m] * F[..., k, j]
        - 2 * b[..., i, k] * (j == m)
    )
    plain = Invariant(
        value=(trace**2 - np.einsum("...ij,...ij->...", C, C)) / 2,
        first=2 * (trace[..., None] * flat - pick_components(F @ C, J.places)),
        second=second,
        places=J.places,
    )
    return _multiply_by_power(plain, J, -4 / 3)


def _multiply_by_power(plain: Invariant, J: Invariant, power: float) -> Invariant:
    """Multiply an invariant by a power of J; the derivatives of the product follow from the product rule."""
    scale = J.value**power
    slope = power * scale / J.value
    curve = (power - 1) * slope / J.value * plain.value
    mixed = (slope[..., None] * plain.first)[..., :, None] * J.first[..., None, :]
    second = (curve[..., None] * J.first)[..., :, None] * J.first[..., None, :]
    second += mixed
    second += mixed.swapaxes(-1, -2)
    second += (slope * plain.value)[..., None, None] * J.second
    second += scale[..., None, None] * plain.second
    return Invariant(
        value=scale * plain.value,
        first=scale[..., None] * plain.first + (slope * plain.value)[..., None] * J.first,
        second=second,
        places=J.places,
    )


def _minor(F: FloatArray, i: int, j: int) -> FloatArray:
    """Compute the cofactor of F_ij."""
    k, m, p, q = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
    return np.asarray(F[..., k, p] * F[..., m, q] - F[..., k, q] * F[..., m, p])


def _sign(i: int, k: int) -> int:
    """Return the sign of the permutation (i, k, remaining index) of (0, 1, 2)."""
    return 1 if (k - i) % 3 == 1 else -1


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Stored energy, first Piola-Kirchhoff stress and tangent moduli at many points.

    Attributes:
        energy: Stored energy W per reference volume, shape (...) [J/m3].
        stress: dW/dF, the g components listed in `Invariant.places`, shape (..., g) [Pa].
        tangent: d2W/dF2, derivatives of these components with respect to the same components of F, shape (..., g, g)
            [Pa].
    """

    energy: FloatArray
    stress: FloatArray
    tangent: FloatArray


class Energy(Protocol):
    """Interface of an isochoric stored energy, which does not depend on the volume ratio."""

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli.

        Args:
            F: Deformation gradients, shape (..., 3, 3) [-].
            J: Determinants of F with derivatives, from `volume_ratio`; `J.places` selects the components of stress and
                tangent.
        """


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """Stored energy of another material times a constant factor, for a change of units.

    Attributes:
        energy: Energy that is multiplied.
        factor: Constant factor on the energy [-].
    """

    energy: Energy
    factor: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli, each times the factor; see `Energy.isochoric`."""
        plain = self.energy.isochoric(F, J)
        return Response(
            energy=plain.energy * self.factor, stress=plain.stress * self.factor, tangent=plain.tangent * self.factor
        )


def respond_to_invariant(invariant: Invariant, energy: FloatArray, slope: FloatArray, curve: FloatArray) -> Response:
    """Compute stress w' dI/dF and tangent w'' dI/dF x dI/dF + w' d2I/dF2 of an energy w(I) of one invariant I.

    Args:
        invariant: Invariant I with its derivatives with respect to F.
        energy: Energy w(I) at each point, shape (...) [J/m3].
        slope: First derivative w'(I), shape (...) [Pa].
        curve: Second derivative w''(I), shape (...) [Pa].
    """
    stress = slope[..., None] * invariant.first
    tangent = slope[..., None, None] * invariant.second
    if np.any(curve):
        tangent += (curve[..., None] * invariant.first)[..., :, None] * invariant.first[..., None, :]
    return Response(energy=energy, stress=stress, tangent=tangent)


@dataclass(frozen=True, kw_only=True)
class NeoHookean:
    """Neo-Hookean energy W = mu / 2 (I1 - 3) (Treloar 1943).

    Attributes:
        shear_modulus: Shear modulus mu [Pa].
    """

    shear_modulus: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli at deformation gradients F; see `Energy.isochoric`."""
        I1 = first_isochoric(F, J)
        slope = np.full_like(I1.value, self.shear_modulus / 2)
        return respond_to_invariant(I1, slope * (I1.value - 3), slope, np.zeros_like(slope))


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin:
    """Mooney-Rivlin energy W = c10 (I1 - 3) + c01 (I2 - 3) (Mooney 1940, Rivlin 1948).

    Attributes:
        c10: Modulus of the term in I1 [Pa].
        c01: Modulus of the term in I2 [Pa].
    """

    c10: float
    c01: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli at deformation gradients F; see `Energy.isochoric`."""
        I1, I2 = first_isochoric(F, J), second_isochoric(F, J)
        zero = np.zeros_like(I1.value)
        one = respond_to_invariant(I1, self.c10 * (I1.value - 3), zero + self.c10, zero)
        two = respond_to_invariant(I2, self.c01 * (I2.value - 3), zero + self.c01, zero)
        return Response(
            energy=one.energy + two.energy, stress=one.stress + two.stress, tangent=one.tangent + two.tangent
        )


@dataclass(frozen=True, kw_only=True)
class Yeoh:
    """Yeoh energy W = c1 x + c2 x^2 + c3 x^3 with x = I1 - 3 (Yeoh 1993).

    Attributes:
        c1: Modulus of the linear term [Pa].
        c2: Modulus of the quadratic term [Pa].
        c3: Modulus of the cubic term [Pa].
    """

    c1: float
    c2: float
    c3: float

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli at deformation gradients F; see `Energy.isochoric`."""
        I1 = first_isochoric(F, J)
        x = I1.value - 3
        return respond_to_invariant(
            I1,
            x * (self.c1 + x * (self.c2 + x * self.c3)),
            self.c1 + x * (2 * self.c2 + x * 3 * self.c3),
            2 * self.c2 + 6 * self.c3 * x,
        )


@dataclass(frozen=True, kw_only=True)
class Ogden:
    """Ogden energy W = sum 2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3) (Ogden 1972).

    l1, l2 and l3 are the isochoric principal stretches.  The small-strain shear modulus is the sum of the mu.
    Derivatives are computed in the frame of the singular value decomposition F = U diag(l) V^T.  In this frame the
    stress is diagonal, and the tangent couples each pair of axes through divided differences (Smith, De Goes and Kim,
    Analytic eigensystems for isotropic distortion energies, 2019), which are finite for equal stretches.

    Attributes:
        moduli: Modulus mu of each term [Pa].
        exponents: Exponent alpha of each term, not zero [-].
    """

    moduli: tuple[float, ...]
    exponents: tuple[float, ...]

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli at deformation gradients F; see `Energy.isochoric`."""
        U, stretch, Vt = np.linalg.svd(F)
        energy, slope, curve = self._differentiate_principal(stretch, J.value)
        i, j = np.array(J.places).T
        tangent = _rotate(U, stretch, Vt, slope, curve)[..., i[:, None], j[:, None], i, j]
        return Response(
            energy=energy, stress=pick_components((U * slope[..., None, :]) @ Vt, J.places), tangent=tangent
        )

    def _differentiate_principal(self, stretch: FloatArray, J: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Compute the energy, its gradient and its Hessian with respect to the three principal stretches.

        Args:
            stretch: Principal stretches, shape (..., 3) [-].
            J: Volume ratios, shape (...) [-].

        Returns:
            Energy, shape (...) [J/m3], gradient, shape (..., 3) [Pa], and Hessian, shape (..., 3, 3) [Pa].
        """
        energy = np.zeros_like(J)
        slope = np.zeros_like(stretch)
        curve = np.zeros((*stretch.shape, 3))
        inverse = 1 / stretch
        for mu, alpha in zip(self.moduli, self.exponents, strict=True):
            powers = stretch**alpha * (J ** (-alpha / 3))[..., None]
            total = powers.sum(axis=-1, keepdims=True)
            energy += 2 * mu / alpha**2 * (total[..., 0] - 3)
            part = 2 * mu / alpha * (powers - total / 3)  # l dW/dl
            slope += part * inverse
            cross = -powers[..., :, None] / 3 - powers[..., None, :] / 3 + total[..., None] / 9
            block = 2 * mu * cross * inverse[..., :, None] * inverse[..., None, :]
            diagonal = (2 * mu * powers - part) * inverse**2
            curve += block + diagonal[..., None] * np.eye(3)
        return energy, slope, curve


def _rotate(U: FloatArray, stretch: FloatArray, Vt: FloatArray, slope: FloatArray, curve: FloatArray) -> FloatArray:
    """Compute the tangent moduli d2W/dF2 from gradient and Hessian of the energy W in the singular values of F.

    Args:
        U: Left singular vectors of F, shape (..., 3, 3) [-].
        stretch: Singular values of F, shape (..., 3) [-].
        Vt: Transposed right singular vectors of F, shape (..., 3, 3) [-].
        slope: Gradient of the energy, shape (..., 3) [Pa].
        curve: Hessian of the energy, shape (..., 3, 3) [Pa].

    Returns:
        Tangent moduli, shape (..., 3, 3, 3, 3) [Pa].
    """
    local = np.zeros((*stretch.shape, 3, 3, 3))
    for a in range(3):
        for b in range(3):
            local[..., a, a, b, b] += curve[..., a, b]
            if a < b:
                plus, minus = _divide_differences(stretch, slope, curve, a, b)
                for i, j in ((a, b), (b, a)):
                    local[..., i, j, i, j] += (minus + plus) / 2
                    local[..., i, j, j, i] += (minus - plus) / 2
    turned = np.einsum("...ia,...bj,...abcd,...kc,...dl->...ijkl", U, Vt, local, U, Vt, optimize=True)
    return np.asarray(turned)


def _divide_differences(
    stretch: FloatArray, slope: FloatArray, curve: FloatArray, a: int, b: int
) -> tuple[FloatArray, FloatArray]:
    """Compute (Wa + Wb) / (la + lb) and (Wa - Wb) / (la - lb); Wa is the derivative of the energy in the stretch la.

    Where la and lb are equal, the second quotient is replaced by its limit.
    """
    gap = stretch[..., a] - stretch[..., b]
    close = np.abs(gap) < _SETTINGS.equal * stretch[..., a]
    limit = (curve[..., a, a] + curve[..., b, b]) / 2 - curve[..., a, b]
    minus = np.where(close, limit, (slope[..., a] - slope[..., b]) / np.where(close, 1.0, gap))
    plus = (slope[..., a] + slope[..., b]) / (stretch[..., a] + stretch[..., b])
    return plus, minus


#: Stored energy of a material, by the name of its model in `meshes.material.MODELS`.
ENERGIES: Mapping[str, Callable[[Material], Energy]] = {
    "neo-hookean": lambda each: NeoHookean(shear_modulus=each.shear_modulus),
    "mooney-rivlin": lambda each: MooneyRivlin(c10=each.number("c10"), c01=each.number("c01")),
    "yeoh": lambda each: Yeoh(c1=each.number("c1"), c2=each.number("c2"), c3=each.number("c3")),
    "ogden": lambda each: Ogden(moduli=each.terms("mu"), exponents=each.terms("alpha")),
}


def create_energy(material: Material) -> Energy:
    """Create the isochoric stored energy of a material.

    Raises:
        ValueError: If the material is `linear-elastic`, which has no stored energy at finite strain.
    """
    if material.model not in ENERGIES:
        raise ValueError(f"{material.model} is a small-strain model; take neo-hookean for finite strain")
    return ENERGIES[material.model](material)


def create_finite_strain_energy(material: Material) -> Energy:
    """Create the isochoric stored energy of a material; `linear-elastic` becomes neo-Hookean of equal shear modulus."""
    return NeoHookean(shear_modulus=material.shear_modulus) if material.small_strain_only else create_energy(material)


#: Homogeneous deformations of incompressible material by name: logarithms of the principal stretches, over that of the
#: stretch that is stated.  Planar compression is planar tension along another axis.
_MODES = {
    "uniaxial tension": (1.0, -0.5, -0.5),
    "uniaxial compression": (-1.0, 0.5, 0.5),
    "equibiaxial tension": (1.0, 1.0, -2.0),
    "equibiaxial compression": (-1.0, -1.0, 2.0),
    "planar tension": (1.0, -1.0, 0.0),
}
#: Modes in which the thickness of a pressed cover shrinks, and the exponent of their stretch in the thickness [-].
_SQUEEZING = {"uniaxial compression": 1.0, "equibiaxial tension": -2.0, "planar tension": -1.0}


def find_unstable_stretches(material: Material) -> dict[str, float]:
    """Find the stretches at which an incompressible material loses its stability.

    A material is stable as long as true stress rises with logarithmic strain (Drucker's criterion, as finite-element
    programs apply it to fits of rubber).  The volume is held constant, so that the result is exact for Poisson ratio
    0.5.

    Args:
        material: Material; `linear-elastic` is always stable.

    Returns:
        The stretch nearest to 1 at which stability is lost, by kind of deformation, for the kinds that lose it at
        stretches between 1/8 and 8 [-].
    """
    if material.small_strain_only:
        return {}
    strain = np.linspace(0, np.log(_SETTINGS.largest), _SETTINGS.stretches)[1:]
    out = {}
    for mode, direction in _MODES.items():
        falls = np.flatnonzero(np.diff(measure_stress(material, strain, np.array(direction))) <= 0)
        if falls.size:
            out[mode] = float(np.exp(direction[0] * strain[falls[0]]))
    return out


def describe_instability(material: Material) -> str:
    """Say in words at which stretches a material loses its stability; empty if it does not up to a stretch of 8."""
    found = find_unstable_stretches(material)
    listed = ", ".join(f"{mode} at a stretch of {stretch:.3g}" for mode, stretch in found.items())
    return f"the material {material.name} loses stability in {listed}" if found else ""


def warn_of_instability(material: Material, thickness: float) -> str:
    """Say in words that a pressed material is beyond its stability; empty if it is not.

    The mean compression of the cover under the indenter is compared with the stretches of `find_unstable_stretches`.
    Local strains are larger, so a result without this warning may also contain unstable places.

    Args:
        material: Material of a layer.
        thickness: Thickness of the pressed cover over the undeformed thickness [-].
    """
    found = find_unstable_stretches(material)
    beyond = [mode for mode, power in _SQUEEZING.items() if mode in found and thickness < found[mode] ** power]
    if not beyond:
        return ""
    return f"{describe_instability(material)}; the cover is pressed to {thickness:.0%} of its thickness, beyond that"


def measure_stress(material: Material, strain: FloatArray, direction: FloatArray) -> FloatArray:
    """Compute the derivative of the stored energy along principal logarithmic strains `strain * direction` [Pa].

    Args:
        material: Material with a stored energy.
        strain: Strains, shape (n,) [-].
        direction: Principal strains per strain, with sum 0, shape (3,) [-].
    """
    stretch = np.exp(np.outer(strain, direction))
    F = stretch[:, :, None] * np.eye(3)
    first = create_energy(material).isochoric(F, volume_ratio(F, EVERY_PLACE)).stress.reshape(-1, 3, 3)
    return np.asarray((np.einsum("nii->ni", first) * stretch) @ direction)
