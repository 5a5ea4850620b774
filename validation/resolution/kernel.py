"""Compiled loops over touches: their texel forces by a chart, their least squares, and the likelihood of a frame."""

# mypy: disable-error-code="no-untyped-def,no-untyped-call,untyped-decorator"
# ruff: noqa: ANN001, ANN201, ANN202, PLR0917 -- arrays, whose types numba finds; it takes no keywords

# Compiled functions are loops: numba takes several times as long to compile operations on arrays.

from __future__ import annotations

import math

import numba
import numpy as np

#: Steps of the lattice beyond the ends of a chart [-].
BEYOND = 3
#: Coefficients of 1, u, u^2 and u^3 in the four cubic B-splines around a point u of 0..1 in its step.
_SPLINES = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6
#: Standard deviation of the ellipticities of a touch of unknown shape, and their largest length: that of a line, beyond
#: which a variance of the pressure is negative [-].
_OVAL, LINE = 0.5, 1.0
#: Steps in which ellipticities are brought back to that length [-].
_SHORTENED = 8
#: Passes in which dark and saturated texels that the forces contradict join the least squares [-].
_PASSES = 3
#: Arguments beyond which the logarithm of the normal distribution is 0, and its series [-].
_NEAR, _FAR = 8.0, -35.0
#: Least force [N] and probability [-].
_TINY, _LEAST = 1e-12, 1e-300


@numba.njit(cache=True)
def share_points(chart, places, radii, count):
    """Compute the force per unit force on texels, shape (m, 3, s) [-].

    The second and third rows are changes per ellipticity: of half the difference of the variances of the pressure along
    x and y, and of its covariance, over the variance a^2 / 5 along one axis.  They are 0 if one radius is known.

    Args:
        chart: Least place (2,), steps (2,), radii (r,) and coefficients (r, nx, ny, c) of a chart.
        places: Places, shape (m, 2) [m].
        radii: Radii, shape (m,) [m].
        count: Number s of texels, the first ones of the table.
    """
    low, step, knots, table = chart
    found, last = np.zeros((len(places), 3, count)), len(knots) - 1
    part, first = np.empty((2, 3, 4)), np.zeros(2, np.int64)
    for point in range(len(places)):
        for i in range(2):
            node = (places[point, i] - low[i]) / step[i] + BEYOND
            first[i] = math.floor(node) - 1
            u = node - first[i] - 1
            for j in range(4):
                one, linear, square, cube = _SPLINES[0, j], _SPLINES[1, j], _SPLINES[2, j], _SPLINES[3, j]
                part[i, 0, j] = one + u * (linear + u * (square + u * cube))
                part[i, 1, j] = (linear + u * (2 * square + 3 * u * cube)) / step[i]
                part[i, 2, j] = (2 * square + 6 * u * cube) / step[i] ** 2
        x, y, squared, share = part[0], part[1], 0.0, 0.0
        lower = upper = 0
        if last:
            lower, squared = min(max(np.searchsorted(knots, radii[point]) - 1, 0), last - 1), radii[point] ** 2
            upper = lower + 1
            share = (squared - knots[lower] ** 2) / (knots[upper] ** 2 - knots[lower] ** 2)
        force, oval, turned = found[point, 0], found[point, 1], found[point, 2]
        for a in range(4):
            for b in range(4):
                near, far = table[lower, first[0] + a, first[1] + b], table[upper, first[0] + a, first[1] + b]
                p, r = x[0, a] * y[0, b], squared / 5 * x[1, a] * y[1, b]
                q = squared / 10 * (x[2, a] * y[0, b] - x[0, a] * y[2, b])
                for k in range(count):
                    value = (1 - share) * near[k] + share * far[k]
                    force[k] += p * value
                    oval[k] += q * value
                    turned[k] += r * value
    return found


@numba.njit(cache=True, fastmath={"reassoc", "contract"})
def _add(shares, target, weight, power, normal, right):
    """Fill the lower half of the normal equations of least squares, times a power, shapes (3, 3) and (3,)."""
    force, oval, turned = shares[0], shares[1], shares[2]
    a = b = c = d = e = f = x = y = z = 0.0
    for k in range(len(target)):
        p, q, r = weight[k] * force[k], weight[k] * oval[k], weight[k] * turned[k]
        a, b, c, d = a + p * force[k], b + p * oval[k], c + q * oval[k], d + p * turned[k]
        e, f, x, y, z = e + q * turned[k], f + r * turned[k], x + p * target[k], y + q * target[k], z + r * target[k]
    normal[0, 0], normal[1, 0], normal[1, 1], normal[2, 0], normal[2, 1], normal[2, 2] = a, b, c, d, e, f
    right[0], right[1], right[2] = x, y, z
    for i in range(3):
        right[i] *= power
        for j in range(i + 1):
            normal[i, j] *= power


@numba.njit(cache=True)
def _factor(matrix, vector):
    """Overwrite a positive definite matrix (3, 3) by its lower root, and a vector by its product with the inverse."""
    for i in range(3):
        for j in range(i + 1):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(matrix[i, i]) if i == j else matrix[i, j] / matrix[j, j]
        for j in range(i):
            vector[i] -= matrix[i, j] * vector[j]
        vector[i] /= matrix[i, i]
    _turn(matrix, vector)


@numba.njit(cache=True)
def _turn(root, vector):
    """Overwrite a vector (3,) by its product with the inverse of the transpose of a lower root."""
    for i in (2, 1, 0):
        for j in range(i + 1, 3):
            vector[i] -= root[j, i] * vector[j]
        vector[i] /= root[i, i]


@numba.njit(cache=True)
def _combine(linear, shares, forces):
    force, oval, turned = shares[0], shares[1], shares[2]
    x, y, z = linear[0], linear[1], linear[2]
    for k in range(len(forces)):
        forces[k] = x * force[k] + y * oval[k] + z * turned[k]


@numba.njit(cache=True)
def _bound(normal, right, most, linear, root):
    """Solve normal equations (3, 3) for a force of 0 to `most` and ellipticities up to those of a line.

    Fills the linear parameters (3,), whose first value is the last force, and the root of their precision (3, 3).
    Beyond a line, the precision of the ellipticities grows until they fit (More and Sorensen, Computing a trust region
    step, 1983).
    """
    oval = (_OVAL * max(linear[0], 1e-3 * most)) ** -2
    for _ in range(_SHORTENED):
        for i in range(3):
            linear[i] = right[i]
            for j in range(3):
                root[i, j] = normal[i, j]
        root[0, 0] += 12 / most**2
        root[1, 1] += oval
        root[2, 2] += oval
        linear[0] += 6 / most
        _factor(root, linear)
        linear[0] = min(max(linear[0], 0.0), most)
        longest, square = LINE * max(linear[0], 1e-3 * most), linear[1] ** 2 + linear[2] ** 2
        if square <= (1.01 * longest) ** 2:
            break
        first = linear[1] / root[1, 1]
        second = (linear[2] - root[2, 1] * first) / root[2, 2]
        oval += square / (first**2 + second**2) * (math.sqrt(square) / longest - 1)
    shorter = min(1.0, LINE * linear[0] / max(math.sqrt(square), _TINY))
    linear[1] *= shorter
    linear[2] *= shorter


@numba.njit(cache=True)
def _solve(shares, texels, noise, most, power, linear, root, weight, residual):
    """Fill linear parameters (3,), the root of their precision (3, 3), and deviations of texels (s,) at one place."""
    target, known, sign = texels[0], texels[1], texels[2]
    normal, right = np.zeros((3, 3)), np.zeros(3)
    linear[0] = most / 2
    for k in range(len(target)):
        weight[k] = known[k]
    for _ in range(_PASSES):
        _add(shares, target, weight, power, normal, right)
        _bound(normal, right, most, linear, root)
        _combine(linear, shares, residual)
        same = linear[1] == 0
        for k in range(len(target)):
            residual[k] -= target[k]
            if known[k] == 0:
                wrong = noise**-2 if sign[k] * residual[k] > 0 else 0.0
                same, weight[k] = same and wrong == weight[k], wrong
        if same:
            break
    for k in range(len(target)):
        residual[k] *= math.sqrt(weight[k])


@numba.njit(cache=True)
def _judge(forces, texels, noise):
    """Compute the logarithm of the likelihood of a frame from the forces of a touch on texels (s,) [N]."""
    found, target, known, sign, half = 0.0, texels[0], texels[1], texels[2], texels[3]
    for k in range(len(forces)):
        apart = target[k] - forces[k]
        u = sign[k] * apart / noise
        if half[k]:
            far, wide = abs(apart) / noise / math.sqrt(2), half[k] / noise / math.sqrt(2)
            found += math.log(max((math.erfc(far - wide) - math.erfc(far + wide)) / 2, _LEAST))
        elif known[k]:
            found -= known[k] * apart**2 / 2
        elif u < _FAR:
            found -= u**2 / 2 + math.log(-u * math.sqrt(2 * math.pi)) + 1 / u**2
        elif u < _NEAR:
            found += math.log(math.erfc(-u / math.sqrt(2)) / 2)
    return found


@numba.njit(cache=True)
def fit_touches(chart, texels, noise, most, power, places, radii, more):
    """Fit linear parameters of touches at m places: the force, and the force times two ellipticities.

    Args:
        chart: As in `share_points`.
        texels: Force that each texel tells [N]; one over its variance, 0 for a dark or saturated one, which tells an
            edge; the sign of forces that contradict it; and half the width of a count that is wide beside the noise,
            shape (4, s).
        noise: Standard deviation of the noise [N].
        most: Largest force [N].
        power: Power of the likelihood beside the prior [-].
        places: Places, shape (m, 2) [m].
        radii: Radii, shape (m,) [m].
        more: Steps away from the least squares in standard deviations, shape (m, 3); overwritten.

    Returns:
        Linear parameters, shape (m, 3) [N]; the logarithms of their volume, times the density of their shape given the
        force, and of the likelihood, shape (m, 2); deviations of the texels from the least squares in standard
        deviations, 0 where dark and saturated ones agree, and forces on them, both of shape (m, s).
    """
    shares, wide, oval = share_points(chart, places, radii, texels.shape[1]), texels.shape[1], len(chart[2]) > 1
    linear, logs, root, weight = more.copy(), np.empty((len(more), 2)), np.zeros((3, 3)), np.empty(wide)
    residual, forces = np.empty((len(more), wide)), np.empty((len(more), wide))
    for point in range(len(more)):
        found = linear[point]
        _solve(shares[point], texels, noise, most, power, found, root, weight, residual[point])
        _turn(root, more[point])
        for i in range(3):
            found[i] += more[point, i]
        logs[point, 0] = -math.log(root[0, 0])
        if oval:
            force = max(found[0], _TINY)
            shape = (found[1] ** 2 + found[2] ** 2) / (_OVAL * force) ** 2 / 2
            logs[point, 0] -= math.log(root[1, 1] * root[2, 2] * force**2) + shape
        _combine(found, shares[point], forces[point])
        logs[point, 1] = _judge(forces[point], texels, noise)
    return linear, logs, residual, forces
