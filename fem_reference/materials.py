"""Stored energies of rubber-like materials with their first and second derivatives, and the limits of their stability.

The energy per reference volume is W(F) = isochoric(F) - p (J - 1) - p^2 / 2 K, with the deformation gradient F and its
determinant J.  The mean pressure p is an independent unknown, so that an infinite bulk modulus K needs no special case
(Simo, Taylor and Pister 1985).  K is `Material.bulk_modulus`, which follows from shear modulus and Poisson ratio.  A
material supplies the isochoric part, which does not change when F is multiplied by a number.  For a law whose term of
the volume is K (J - 1)^2 / 2 this is the rest of its energy.  A law with another term of the volume supplies its whole
energy less K (J - 1)^2 / 2; p is then the pressure less that of the supplied part.

F has shape (..., 3, 3).  Derivatives are taken only with respect to the components of F that can differ from those of
the unit matrix: all nine in three dimensions, five in axisymmetric states.  First derivatives have shape (..., g) and
second ones (..., g, g), in the order of `places`.  The invariants are J^(-2/3) tr C and J^(-4/3) (tr^2 C - tr C^2) / 2
with C = F^T F (Holzapfel, Nonlinear Solid Mechanics, section 6.4).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from meshes import Material
from meshes.array_types import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True)
class MaterialSettings:
    """Constants of the material laws."""

    #: Relative difference of two principal stretches below which divided differences of the stresses are replaced by
    #: their limit for equal stretches, to avoid cancellation [-].
    equal: float = 1e-5
    #: Largest stretch, or reciprocal of the smallest, that is examined for stability [-].
    largest: float = 8.0
    #: Number of stretches from 1 to the largest that are examined for stability [-].
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
    cofactor = {}
    for i, j in {*places, (0, 0), (0, 1), (0, 2)}:
        k, m, p, q = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
        cofactor[i, j] = F[..., k, p] * F[..., m, q] - F[..., k, q] * F[..., m, p]
    second = np.zeros((*F.shape[:-2], len(places), len(places)))
    for a, (i, j) in enumerate(places):
        for b, (k, m) in enumerate(places):
            if i != k and j != m:  # the sign is that of both permutations (i, k, rest) and (j, m, rest) of (0, 1, 2)
                sign = 1 if ((k - i) % 3 == 1) == ((m - j) % 3 == 1) else -1
                second[..., a, b] = sign * F[..., 3 - i - k, 3 - j - m]
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
    # Row and column of the component of F of the second differentiation, along the last axis.
    k, m = i, j
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
class Polynomial:
    """Polynomial energy W = c1 x + c2 x^2 + c3 x^3 + c01 (I2 - 3) with x = I1 - 3.

    With c1 alone it is that of Treloar (1943, neo-Hookean, c1 = mu / 2), with c1 and c01 that of Mooney (1940) and
    Rivlin (1948), with c1, c2 and c3 that of Yeoh (1993).

    Attributes:
        c1: Modulus of the linear term in I1 [Pa].
        c2: Modulus of the quadratic term [Pa].
        c3: Modulus of the cubic term [Pa].
        c01: Modulus of the term in I2 [Pa].
    """

    c1: float
    c2: float = 0.0
    c3: float = 0.0
    c01: float = 0.0

    def isochoric(self, F: FloatArray, J: Invariant) -> Response:
        """Evaluate energy, stress and tangent moduli at deformation gradients F; see `Energy.isochoric`."""
        I1 = first_isochoric(F, J)
        x = I1.value - 3
        energy = x * (self.c1 + x * (self.c2 + x * self.c3))
        slope, curve = self.c1 + x * (2 * self.c2 + x * 3 * self.c3), 2 * self.c2 + 6 * self.c3 * x
        stress, tangent = slope[..., None] * I1.first, slope[..., None, None] * I1.second
        if np.any(curve):
            tangent += (curve[..., None] * I1.first)[..., :, None] * I1.first[..., None, :]
        if self.c01:
            I2 = second_isochoric(F, J)
            energy, stress = energy + self.c01 * (I2.value - 3), stress + self.c01 * I2.first
            tangent += self.c01 * I2.second
        return Response(energy=energy, stress=stress, tangent=tangent)


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
        # Moduli in the frame of the singular vectors: the Hessian on the diagonal, divided differences off it.
        local = np.zeros((*F.shape, 3, 3))
        for a in range(3):
            for b in range(3):
                local[..., a, a, b, b] = curve[..., a, b]
        for a, b in ((0, 1), (0, 2), (1, 2)):
            gap = stretch[..., a] - stretch[..., b]
            close = np.abs(gap) < _SETTINGS.equal * stretch[..., a]
            limit = (curve[..., a, a] + curve[..., b, b]) / 2 - curve[..., a, b]
            minus = np.where(close, limit, (slope[..., a] - slope[..., b]) / np.where(close, 1.0, gap))
            plus = (slope[..., a] + slope[..., b]) / (stretch[..., a] + stretch[..., b])
            local[..., [a, b], [b, a], [a, b], [b, a]] = ((minus + plus) / 2)[..., None]
            local[..., [a, b], [b, a], [b, a], [a, b]] = ((minus - plus) / 2)[..., None]
        turned = np.einsum("...ia,...bj,...abcd,...kc,...dl->...ijkl", U, Vt, local, U, Vt, optimize=True)
        i, j = np.array(J.places).T
        stress = pick_components((U * slope[..., None, :]) @ Vt, J.places)
        return Response(energy=energy, stress=stress, tangent=turned[..., i[:, None], j[:, None], i, j])

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
            # The derivative dW/dl times the principal stretch l.
            part = 2 * mu / alpha * (powers - total / 3)
            slope += part * inverse
            cross = -powers[..., :, None] / 3 - powers[..., None, :] / 3 + total[..., None] / 9
            block = 2 * mu * cross * inverse[..., :, None] * inverse[..., None, :]
            diagonal = (2 * mu * powers - part) * inverse**2
            curve += block + diagonal[..., None] * np.eye(3)
        return energy, slope, curve


#: Function that creates the stored energy of a material, its moduli divided by a unit of stress [Pa], by the name of
#: the model in `meshes.material.MODELS`.
ENERGIES: Mapping[str, Callable[[Material, float], Energy]] = {
    "neo-hookean": lambda each, unit: Polynomial(c1=each.shear_modulus / unit / 2),
    "mooney-rivlin": lambda each, unit: Polynomial(c1=each.number("c10") / unit, c01=each.number("c01") / unit),
    "yeoh": lambda each, unit: Polynomial(**{name: each.number(name) / unit for name in ("c1", "c2", "c3")}),
    "ogden": lambda each, unit: Ogden(
        moduli=tuple(mu / unit for mu in each.terms("mu")), exponents=each.terms("alpha")
    ),
}


def create_energy(material: Material, unit: float = 1.0) -> Energy:
    """Create the isochoric stored energy of a material.

    Args:
        material: Material.
        unit: Unit of stress by which all moduli are divided [Pa].

    Raises:
        ValueError: If the material is `linear-elastic`, which has no stored energy at finite strain, or its model has
            none in `ENERGIES`.
    """
    if material.small_strain_only:
        raise ValueError(f"{material.model} is a small-strain model; take neo-hookean for finite strain")
    if material.model not in ENERGIES:
        raise ValueError(f"{material.model} has no stored energy; add it to fem_reference.materials.ENERGIES")
    return ENERGIES[material.model](material, unit)


def create_finite_strain_energy(material: Material, unit: float = 1.0) -> Energy:
    """Create the isochoric stored energy of a material for finite strain.

    A `linear-elastic` material becomes neo-Hookean with the same shear modulus.  `unit` is that of `create_energy`.
    """
    if material.small_strain_only:
        return Polynomial(c1=material.shear_modulus / unit / 2)
    return create_energy(material, unit)


#: Homogeneous deformations by name: principal logarithmic strains of an incompressible material over the strain along
#: the first axis.  Axes that deform in the opposite sense are free of stress.  Planar compression is planar tension
#: along another axis.
_MODES = {
    "uniaxial tension": (1.0, -0.5, -0.5),
    "uniaxial compression": (-1.0, 0.5, 0.5),
    "equibiaxial tension": (1.0, 1.0, -2.0),
    "equibiaxial compression": (-1.0, -1.0, 2.0),
    "planar tension": (1.0, -1.0, 0.0),
}
#: Modes in which the thickness of a pressed cover shrinks; the thickness is then along the most shortened axis.
_SQUEEZING = ("uniaxial compression", "equibiaxial tension", "planar tension")
#: Components of the deformation gradient in the frame of the principal stretches.
_DIAGONAL: Places = ((0, 0), (1, 1), (2, 2))
#: Largest number of Newton steps for the strain of the axes that are free of stress [-].
_NEWTON_STEPS = 50
#: Largest change of the strain of the axes that are free of stress in one Newton step [-].
_LARGEST_STEP = 0.5
#: Change of the strain of the axes that are free of stress below which Newton's method ends [-].
_SMALLEST_STEP = 1e-12
#: Change in the last Newton step up to which a strain counts as found [-].
_CONVERGED = 1e-6
#: Largest lateral logarithmic strain that is examined [-].
_FARTHEST = 5.0
#: Change of a principal logarithmic strain between two of the examined strains above which it counts as a jump [-].
_LARGEST_JUMP = 0.2
#: Number of steps in which the strain of a compressible material grows [-].
_STRAIN_STEPS = 16


def find_unstable_stretches(material: Material) -> dict[str, float]:
    """Find the stretches along the loaded axis at which a material loses its stability.

    A material is stable as long as true stress rises with logarithmic strain (Drucker's criterion, as finite-element
    programs apply it to fits of rubber).  The lateral axes are free of stress, see `measure_stress`.

    Args:
        material: Material; `linear-elastic` is always stable.

    Returns:
        The stretch nearest to 1 at which stability is lost, by kind of deformation, for the kinds that lose it at
        stretches between 1/8 and 8 [-].
    """
    return {mode: float(stretches[0]) for mode, stretches in _find_unstable_states(material).items()}


@lru_cache(maxsize=64)
def _find_unstable_states(material: Material) -> dict[str, FloatArray]:
    """Find the principal stretches at which a material loses its stability, by kind of deformation, shape (3,) [-]."""
    if material.small_strain_only:
        return {}
    strain = np.linspace(0, np.log(_SETTINGS.largest), _SETTINGS.stretches)[1:]
    out = {}
    for mode, direction in _MODES.items():
        stress, stretches = measure_stress(material, strain, np.array(direction))
        # Where no state is near, the stress is not found (NaN) or the sides jump, which counts as a fall as well.
        jumps = np.abs(np.diff(np.log(stretches), axis=0)).max(axis=1) > _LARGEST_JUMP
        falls = np.flatnonzero(~(np.diff(stress / stretches.prod(axis=1)) > 0) | jumps)
        if falls.size:
            out[mode] = stretches[falls[0]]
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
    found = _find_unstable_states(material)
    if not any(mode in found and thickness < found[mode].min() for mode in _SQUEEZING):
        return ""
    return f"{describe_instability(material)}; the cover is pressed to {thickness:.0%} of its thickness, beyond that"


def measure_stress(material: Material, strain: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the stress in a homogeneous deformation whose lateral axes are free of stress.

    An incompressible material deforms by the logarithmic strains `strain * direction`.  In a compressible one the axes
    whose direction is opposite to that of the first axis share the strain at which their stress vanishes.

    Args:
        material: Material with a stored energy.
        strain: Strains, shape (n,) [-].
        direction: Principal logarithmic strains at constant volume over the strain, with sum 0, shape (3,) [-].

    Returns:
        Derivative of the stored energy with respect to the strain, shape (n,) [Pa], NaN where no state without lateral
        stress is found; and principal stretches, shape (n, 3) [-].
    """
    steps = _STRAIN_STEPS if np.isfinite(material.bulk_modulus) else 1
    lateral = (direction * direction[0] < 0) & np.isfinite(material.bulk_modulus)
    prescribed = np.outer(strain, direction)
    before = sides = np.zeros_like(prescribed)
    # The strain grows in steps, and the start value is extrapolated, so that the sides follow one branch of solutions.
    for step in range(1, steps + 1):
        start = np.where(lateral, 2 * sides - before, step / steps * prescribed)
        first, stretches = _balance_sides(material, start, lateral)
        before, sides = sides, np.log(stretches)
    return np.asarray((first * stretches) @ direction), stretches


def _balance_sides(material: Material, logarithms: FloatArray, lateral: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Find the strain at which the lateral axes are free of stress, by Newton's method from a start value.

    Args:
        material: Material with a stored energy.
        logarithms: Principal logarithmic strains with the start value, shape (n, 3) [-].
        lateral: Which axes are free of stress, shape (3,); none for an incompressible material, whose strain is kept.

    Returns:
        Derivatives of the stored energy with respect to the principal stretches, shape (n, 3) [Pa], NaN where the
        method does not converge; and principal stretches, shape (n, 3) [-].
    """
    energy, bulk = create_energy(material), material.bulk_modulus
    logarithms, step = logarithms.copy(), np.zeros(len(logarithms))
    for _ in range(_NEWTON_STEPS):
        stretches = np.exp(logarithms)
        F = stretches[:, :, None] * np.eye(3)
        J = volume_ratio(F, _DIAGONAL)
        found = energy.isochoric(F, J)
        first, second = found.stress, found.tangent
        if np.isinf(bulk):
            break
        pressure = bulk * (J.value - 1)
        first = first + pressure[:, None] * J.first
        second = second + bulk * J.first[:, :, None] * J.first[:, None, :] + pressure[:, None, None] * J.second
        slope = (first * stretches)[:, lateral].sum(axis=1)
        curve = slope + np.einsum("ni,nij,nj->n", stretches * lateral, second, stretches * lateral)
        # An unstable material can have a negative curvature; its absolute value keeps the step downhill.
        step = np.clip(slope / np.maximum(np.abs(curve), _SMALLEST_STEP * bulk), -_LARGEST_STEP, _LARGEST_STEP)
        if np.abs(step).max(initial=0.0) < _SMALLEST_STEP:
            break
        logarithms[:, lateral] = np.clip(logarithms[:, lateral] - step[:, None], -_FARTHEST, _FARTHEST)
    first[np.abs(step) > _CONVERGED] = np.nan
    return first, stretches
