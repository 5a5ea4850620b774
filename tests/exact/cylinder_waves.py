"""Compute the exact response of a layer on a rigid cylinder to tractions that vary as exp(i m theta) exp(i k z).

The displacement u follows from 2 mu u = 4 (1 - nu) B - grad(r e_r . B + phi), where phi and the Cartesian components of
B are harmonic (Papkovich and Neuber; Barber, Elasticity, chapter 21, without axial component of B).  Harmonic functions
are the modified Bessel functions I_m(k r), which grow with r, and K_m(k r), which decay.  Of each kind, three fields
make up all solutions, with x = k r, f = I_m and f+- = I_(m+-1), or f = K_m and f+- = -K_(m+-1):

    G = (f- / 2 + f+ / 2, f+ / 2 - f- / 2, -f)                    phi = f / k
    F = ((4 (1 - nu) +- m) f+- - x f, +-(4 (1 - nu) +- m) f+-, x f+-)   B of f+ for I, of f- for K
    T = (-f+-, -+f+-, f)                                          a combination of the other field of that form, and G

where the signs above are those of I and below those of K.  These three stay independent for k r much smaller than m.
The Bessel functions enter as ratios of neighbouring orders, and of the two faces of the layer, so that nothing
overflows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ive, kve

from fem_reference.closed_form.cylinder import HarmonicTransfer
from meshes import Material
from meshes.array_types import FloatArray

#: Orders above the largest one, and above the largest argument, at which the recurrence of I_m starts [-].
_AHEAD = 60


@dataclass(frozen=True, kw_only=True, eq=False)
class _Bessel:
    """Modified Bessel functions of orders m = 0..M - 1 (rows) at arguments x (columns), over the one of order m.

    Attributes:
        order: Orders, shape (M, 1) [-].
        x: Arguments, shape (n,) [-].
        up: f+ / f, shape (M, n) [-].
        down: f- / f, shape (M, n) [-].
        slope: Derivative of f over f, shape (M, n) [-].
        log: Natural logarithm of |f|, shape (M, n) [-].
    """

    order: FloatArray
    x: FloatArray
    up: FloatArray
    down: FloatArray
    slope: FloatArray
    log: FloatArray


def transfer_cylinder_waves(
    orders: int, wave_numbers: FloatArray, core: float, outer: float, material: Material
) -> HarmonicTransfer:
    """Compute the response to tractions of orders m = 0..orders - 1 and of wave numbers k along the axis.

    The outward components are proportional to cos(m theta) cos(k z), the tangential ones to sin(m theta) cos(k z), the
    axial ones to cos(m theta) sin(k z).

    Args:
        orders: Number of orders M [-].
        wave_numbers: Wave numbers k > 0, shape (n,) [1/m].
        core: Radius of the core [m].
        outer: Radius of the top of the layer [m].
        material: Material, with its linear elastic properties at zero load.

    Returns:
        Transfer with components (outward, tangential, axial), arrays of shape (M, n, 3, 3).
    """
    k = np.asarray(wave_numbers, dtype=float)
    nu = material.poisson_ratio
    inside, outside = _grow(orders, k * core), _grow(orders, k * outer)
    near, far = _decay(orders, k * core), _decay(orders, k * outer)
    # Growing fields are 1 at the top, decaying ones at the core.
    fall, fade = np.exp(inside.log - outside.log), np.exp(far.log - near.log)
    bottom = np.concatenate([_evaluate(inside, nu, 1.0) * fall[..., None, None], _evaluate(near, nu, -1.0)], axis=-1)
    top = np.concatenate([_evaluate(outside, nu, 1.0), _evaluate(far, nu, -1.0) * fade[..., None, None]], axis=-1)
    # Stresses are in units of 2 mu k; divided by `scale` they are of the size of the displacements.
    scale = np.sqrt(1 + (outside.order / outside.x) ** 2)[..., None, None]
    system = np.concatenate([bottom[..., :3, :], top[..., 3:, :] / scale], axis=-2)
    size = np.abs(system).max(axis=-2, keepdims=True)
    right = np.zeros((6, 3))
    right[3:] = np.eye(3)
    unknown = np.linalg.solve(system / size, np.broadcast_to(right, (*system.shape[:-1], 3)))
    unknown /= np.swapaxes(size, -1, -2) * scale
    stiffness = (2 * material.shear_modulus * k)[:, None, None]
    return HarmonicTransfer(base=bottom[..., 3:, :] @ unknown, compliance=top[..., :3, :] @ unknown / stiffness)


def _grow(orders: int, x: FloatArray) -> _Bessel:
    """Compute I_m(x); the ratio I_(m+1) / I_m follows from the recurrence, downwards, where it is stable."""
    start = _AHEAD + max(orders, int(np.ceil(x.max())))
    ratio = x / (start + np.hypot(start, x))
    up = np.empty((orders, len(x)))
    for m in range(start - 1, -1, -1):
        ratio = 1 / (2 * (m + 1) / x + ratio)
        if m < orders:
            up[m] = ratio
    order = np.arange(float(orders))[:, None]
    log = np.log(ive(0, x)) + x + np.vstack([np.zeros_like(x), np.cumsum(np.log(up[:-1]), axis=0)])
    return _Bessel(order=order, x=x, up=up, down=up + 2 * order / x, slope=up + order / x, log=log)


def _decay(orders: int, x: FloatArray) -> _Bessel:
    """Compute K_m(x), with the sign of its neighbours; K_(m+1) / K_m follows from the recurrence, upwards."""
    ratio = np.empty((orders, len(x)))
    ratio[0] = kve(1, x) / kve(0, x)
    for m in range(1, orders):
        ratio[m] = 2 * m / x + 1 / ratio[m - 1]
    order = np.arange(float(orders))[:, None]
    log = np.log(kve(0, x)) - x + np.vstack([np.zeros_like(x), np.cumsum(np.log(ratio[:-1]), axis=0)])
    down = -np.vstack([ratio[:1], 1 / ratio[:-1]])
    return _Bessel(order=order, x=x, up=-ratio, down=down, slope=down - order / x, log=log)


def _evaluate(f: _Bessel, nu: float, sign: float) -> FloatArray:
    """Evaluate the three fields of one kind, over f.

    Args:
        f: Bessel functions of that kind.
        nu: Poisson ratio [-].
        sign: 1 for I, -1 for K.

    Returns:
        Rows 2 mu u_r, 2 mu u_theta, 2 mu u_z and the stresses rr, rt and rz over k, shape (M, n, 6, 3).
    """
    m, x = f.order, f.x
    one, zero = np.ones_like(f.up), np.zeros_like(f.up)
    up, down = one - (m + 1) / x * f.up, one + (m - 1) / x * f.down  # derivatives of f+ and f-
    beside, beside_slope = (f.up, up) if sign > 0 else (f.down, down)
    c = 4 * (1 - nu) + sign * m
    values = [
        [(f.down + f.up) / 2, (f.up - f.down) / 2, -one],
        [c * beside - x, sign * c * beside, x * beside],
        [-beside, -sign * beside, one],
    ]
    slopes = [
        [(down + up) / 2, (up - down) / 2, -f.slope],
        [c * beside_slope - one - x * f.slope, sign * c * beside_slope, beside + x * beside_slope],
        [-beside_slope, -sign * beside_slope, f.slope],
    ]
    columns = []
    for (u, v, w), (u_slope, v_slope, w_slope), div in zip(values, slopes, (zero, one, zero), strict=True):
        normal = 2 * nu * div + u_slope
        shear, axial = (-m * u / x + v_slope - v / x) / 2, (w_slope - u) / 2
        columns.append(np.stack([u, v, w, normal, shear, axial], axis=-1))
    return np.stack(columns, axis=-1)
