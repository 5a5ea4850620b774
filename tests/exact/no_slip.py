"""Solve contacts without slip of a rigid indenter of revolution with a layered cover by integral equations.

Flat punch of radius a: let int_0^a phi(t) cos(k t) dt and int_0^a psi(t) sin(k t) dt be the Hankel transforms of
contact pressure and shear traction, and (c / k) [[L, -B], [-B, N]] the displacements of the top per traction
(`traction_compliance`), with c = (1 - nu) / mu of the top layer.  The conditions w = depth and u = 0 under the punch
become

    int_0^inf (L Phi(k) - B Psi(k)) cos(k x) dk = depth / c,   int_0^inf (N Psi(k) - B Phi(k)) sin(k x) dk = 0.

For large k, L and N tend to 1, and B to b = (1 - 2 nu) / 2 (1 - nu).  The limits give phi and psi and their finite
Hilbert transforms, the rest gives smooth kernels.  On a half space the solution is that of Mossakovskii (1954; Johnson,
Contact Mechanics, 1985, section 3.8).  phi and psi oscillate at the edge; with x = a tanh(s) the trapezoidal rule on
every other point integrates the Hilbert transform with exponential accuracy.

Curved shape: while the contact grows without slip, each increment of the depth is that of a flat punch of the present
contact radius (Spence 1968).  The condition that the top meets the shape where it first touches gives the depth as a
function of the contact radius, a Volterra equation of the first kind.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import j0

from fem_reference.closed_form.contact import LayerContact
from fem_reference.closed_form.layer import half_space_compliance, hankel_nodes
from meshes import Cover
from meshes.array_types import FloatArray
from tests.exact.tractions import traction_compliance, transfer_to_base

#: Largest value of s = artanh(x / a), at which 1 - x / a is near rounding, and step of the trapezoidal rule, for radii
#: up to the cover's thickness and proportionally smaller for larger ones [-].
_END, _STEP = 16.0, 0.125
#: Observed order of convergence with the number of increments of a growing contact, for the extrapolation [-].
_ORDER = 1.7


@dataclass(frozen=True, kw_only=True)
class StuckContact(LayerContact):
    """Solved contact without slip.

    Attributes:
        psi: Values psi(t) at the points of `phi`, where int psi(t) sin(k t) dt is the Hankel transform of order 1 of
            the shear traction, outward positive, shape (n,) [N/m].
    """

    psi: FloatArray = field(repr=False, compare=False)

    def base_waves(self, k: FloatArray) -> FloatArray:
        """Compute the Hankel transform of the pressure on the base, to which the shear contributes too."""
        t, dt, _ = self.phi
        parts = np.array_split(k, len(k) * len(t) // 1_000_000 + 1)
        shear = np.concatenate([np.sin(np.outer(part, t)) @ (dt * self.psi) for part in parts])
        return super().base_waves(k) + transfer_to_base(self.cover, k)[1] * shear


@dataclass(frozen=True, kw_only=True, eq=False)
class StuckPunch:
    """Solved contact without slip of a flat punch of radius a that is pressed by a unit depth.

    Attributes:
        cover: Cover that is pressed.
        radius: Radius a of the punch [m].
        places: Points t in 0..a, shape (n,) [m].
        weights: Weights of the integrals over t, shape (n,) [m].
        normal: Density phi at the points, shape (n,) [Pa].
        shear: Density psi at the points, shape (n,) [Pa].
    """

    cover: Cover
    radius: float
    places: FloatArray
    weights: FloatArray
    normal: FloatArray
    shear: FloatArray

    @property
    def stiffness(self) -> float:
        """Force on the punch per depth [N/m]."""
        return float(2 * np.pi * self.weights @ self.normal)

    def press(self, depth: float) -> StuckContact:
        """Return the contact at a depth [m]."""
        return StuckContact(
            force=self.stiffness * depth,
            depth=depth,
            contact_radius=self.radius,
            cover=self.cover,
            phi=np.stack([self.places, self.weights, self.normal * depth]),
            psi=self.shear * depth,
        )

    def top_displacement(self, radius: FloatArray) -> FloatArray:
        """Compute the downward displacement of the top per depth at m distances beyond the punch, shape (m,) [-]."""
        k, weight = hankel_nodes(self.cover, float(radius.max()) + self.radius)
        near, across, _ = _relative_compliance(self.cover, k)
        c, b = _half_space(self.cover)
        phi, psi = self.weights * self.normal, self.weights * self.shear
        density = (near - 1) * (np.cos(np.outer(k, self.places)) @ phi)
        density -= (across - b) * (np.sin(np.outer(k, self.places)) @ psi)
        distance = np.sqrt(radius[:, None] ** 2 - self.places**2)
        return np.asarray(c * ((1 / distance) @ phi + j0(np.outer(radius, k)) @ (density * weight)))


def stuck_punch(cover: Cover, radius: float, *, step: float = _STEP) -> StuckPunch:
    """Press a flat-ended rigid cylinder without slip into a laterally wide cover by a unit depth.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        radius: Radius of the cylinder [m].
        step: Step of the trapezoidal rule, for radii up to the cover's thickness; larger to see its error [-].
    """
    step /= max(1.0, radius / min(layer.thickness for layer in cover.layers))
    s = np.arange(step / 2, _END, step)
    places, weights = radius * np.tanh(s), radius * step / np.cosh(s) ** 2
    k, weight = hankel_nodes(cover, 2 * radius)
    near, across, along = _relative_compliance(cover, k)
    c, b = _half_space(cover)
    cos, sin = np.cos(np.outer(places, k)), np.sin(np.outer(places, k))
    two = 2 / np.pi
    even, odd = _hilbert(s, step)
    one = np.eye(len(s))
    normal = one + two * (cos * ((near - 1) * weight)) @ cos.T * weights
    mixed = -two * (b * odd + (cos * ((across - b) * weight)) @ sin.T * weights)
    mixed_back = -two * (b * even + (sin * ((across - b) * weight)) @ cos.T * weights)
    shear = one + two * (sin * ((along - 1) * weight)) @ sin.T * weights
    right = np.concatenate([np.full_like(s, two / c), np.zeros_like(s)])
    phi, psi = np.split(np.linalg.solve(np.block([[normal, mixed], [mixed_back, shear]]), right), 2)
    return StuckPunch(cover=cover, radius=radius, places=places, weights=weights, normal=phi, shear=psi)


def stuck_shape(
    cover: Cover, gap: Callable[[FloatArray], FloatArray], contact_radius: float, *, steps: int = 48
) -> StuckContact:
    """Press a curved rigid indenter of revolution without slip into a wide cover until the contact has a given radius.

    Results with `steps` and with half as many increments are extrapolated; the error is about 1e-4.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        gap: Function that returns the height of the indenter above its tip at n distances from the axis [m].
        contact_radius: Radius of the contact area [m].
        steps: Even number of increments of the contact radius [-].
    """
    coarse, fine = (_grow_contact(cover, gap, contact_radius, count) for count in (steps // 2, steps))
    weight = 1 / (2**_ORDER - 1)
    force = fine.force + weight * (fine.force - coarse.force)
    return replace(
        fine,
        force=force,
        depth=fine.depth + weight * (fine.depth - coarse.depth),
        phi=fine.phi * [[1], [1], [force / fine.force]],
        psi=fine.psi * force / fine.force,
    )


def _grow_contact(
    cover: Cover, gap: Callable[[FloatArray], FloatArray], contact_radius: float, steps: int
) -> StuckContact:
    """Solve a growing contact without slip with equal increments of its radius."""
    edges = contact_radius * np.arange(1, steps + 1) / steps
    middles = edges - edges[0] / 2
    punches = [stuck_punch(cover, float(radius)) for radius in middles]
    # An increment of the depth acts at the middle of its interval; the top is compared with the shape at the ends.
    lift = np.zeros((steps, steps))
    for i, punch in enumerate(punches):
        lift[i:, i] = 1 - punch.top_displacement(edges[i:])
    increments = np.linalg.solve(lift, gap(edges))
    parts = [punch.press(float(depth)) for punch, depth in zip(punches, increments, strict=True)]
    return StuckContact(
        force=sum(each.force for each in parts),
        depth=float(increments.sum()),
        contact_radius=contact_radius,
        cover=cover,
        phi=np.concatenate([each.phi for each in parts], axis=1),
        psi=np.concatenate([each.psi for each in parts]),
    )


def _hilbert(s: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Discretise the integrals of phi x / (x^2 - t^2) and of psi t / (t^2 - x^2) over t by the trapezoidal rule.

    x = a tanh(s) and t = a tanh(tau); phi is even, psi is odd.  Only points at an odd number of steps from x count,
    twice, so that the principal value is exact but for terms that decay exponentially with 1 / step.

    Returns:
        Matrices that act on phi and on psi, rows x and columns t, shape (n, n) each [-].
    """
    count = np.arange(len(s))
    right = np.where((count[:, None] - count) % 2 == 1, 2 * step, 0.0)
    left = np.where((count[:, None] + count + 1) % 2 == 1, 2 * step, 0.0)  # the mirror image of point j is -j - 1
    with np.errstate(divide="ignore", invalid="ignore"):
        same = np.where(right > 0, right * np.exp(_log_cosh(s)[:, None] - _log_cosh(s)) / np.sinh(s - s[:, None]), 0.0)
    mirror = left * np.exp(_log_cosh(s)[:, None] - _log_cosh(s)) / np.sinh(-s - s[:, None])
    return -(same + mirror) / 2, (same - mirror) / 2


def _log_cosh(s: FloatArray) -> FloatArray:
    """Compute ln cosh(s) without overflow."""
    return np.asarray(np.logaddexp(s, -s) - np.log(2))


def _half_space(cover: Cover) -> tuple[float, float]:
    """Return c = (1 - nu) / mu [1/Pa] and b = (1 - 2 nu) / 2 (1 - nu) [-] of the top layer."""
    material = cover.layers[-1].material
    nu = material.poisson_ratio
    return (1 - nu) / material.shear_modulus, (1 - 2 * nu) / (2 * (1 - nu))


def _relative_compliance(cover: Cover, k: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return L, B and N, the compliances of the top over (1 - nu) / (mu k), shape (m,) each [-]."""
    matrix = traction_compliance(cover, k) / half_space_compliance(cover.layers[-1], k)[:, None, None]
    return matrix[:, 0, 0], -matrix[:, 0, 1], matrix[:, 1, 1]
