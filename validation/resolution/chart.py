"""Tables of the texel forces of touches around one texel, for places and radii by the thousand."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from scipy import ndimage, signal

from meshes.array_types import FloatArray, IntArray
from validation.resolution.touches import Touches, spread_points

#: Steps of the lattice in a pitch and beyond the ends of a chart, and radii besides the least one [-].
_STEPS, _BEYOND, _RADII = 10, 3, 12
#: Circles of point forces of a round touch, and point forces on each [-].
_SPOTS = 8, 16
#: Share of a force below which a texel is left out [-].
_LEAST_SHARE = 1e-5
#: Coefficients of 1, u, u^2 and u^3 in the four cubic B-splines around a point u of 0..1 in its step.
_SPLINES = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Chart:
    """Texel forces of touches in a box around one texel: cubic splines in x and y, linear in the square of the radius.

    Attributes:
        texel: Index of the texel among the n active ones.
        low: Least x and y of the box from the point above the texel, shape (2,) [m].
        high: Largest x and y, shape (2,) [m].
        step: Steps of the lattice along x and y, shape (2,) [m].
        radii: Radii, shape (r,) [m].
        columns: Place of each active texel in the table, -1 for one that is out of reach, shape (n,).
        table: Coefficients, shape (r, nx, ny, s) [-].
    """

    texel: int
    low: FloatArray
    high: FloatArray
    step: FloatArray
    radii: FloatArray
    columns: IntArray
    table: FloatArray

    @cached_property
    def peaks(self) -> FloatArray:
        """Largest share of a point force on each texel of the table, shape (s,) [-]."""
        return np.asarray(self.table[0].max(axis=(0, 1)))

    def at(self, places: FloatArray, radii: FloatArray, seen: IntArray) -> FloatArray:
        """Compute the force per unit force on the texels `seen`, shape (m, 1, s) or, if radii differ, (m, 3, s) [-].

        The second and third rows are changes per ellipticity: of half the difference of the variances of the pressure
        along x and y, and of its covariance, over the variance a^2 / 5 along one axis.

        Args:
            places: Places in the box, shape (m, 2) [m].
            radii: Radius of each touch, shape (m,) [m].
            seen: Indices of the s texels among the active ones.
        """
        nodes = (places - self.low) / self.step + _BEYOND
        first = np.floor(nodes)
        powers = np.vander((nodes - first).ravel(), 4, increasing=True).reshape(-1, 2, 4)
        squares, knots = radii**2, self.radii**2
        value = powers @ _SPLINES
        weights = [value[:, 0, :, None] * value[:, 1, None]]
        if len(knots) > 1:
            slope = powers[..., :3] @ (_SPLINES[1:] * [[1], [2], [3]]) / self.step[:, None]
            bend = powers[..., :2] @ (_SPLINES[2:] * [[2], [6]]) / self.step[:, None] ** 2
            oval = bend[:, 0, :, None] * value[:, 1, None] - value[:, 0, :, None] * bend[:, 1, None]
            tenth = squares[:, None, None] / 10
            weights += [tenth * oval, 2 * tenth * slope[:, 0, :, None] * slope[:, 1, None]]
        lower = np.clip(np.searchsorted(knots, squares) - 1, 0, max(len(knots) - 2, 0))
        upper = np.minimum(lower + 1, len(knots) - 1)
        share = (squares - knots[lower]) / np.where(upper > lower, knots[upper] - knots[lower], np.inf)
        index = np.column_stack([lower, first - 1]).astype(int)
        return np.asarray(_gather(self.table, index, share, np.stack(weights, axis=1), self.columns[seen]))


@numba.njit(cache=True)
def _gather(table, index, share, weights, columns):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202 -- arrays
    points, rows = weights.shape[:2]
    found = np.zeros((points, rows, len(columns)))
    for point in range(points):
        layer, i, j = index[point]
        for more in range(2):
            part = share[point] if more else 1 - share[point]
            if part == 0:
                continue
            for a in range(4):
                for b in range(4):
                    for row in range(rows):
                        weight = part * weights[point, row, a, b]
                        for k in range(len(columns)):
                            if columns[k] >= 0:
                                found[point, row, k] += weight * table[layer + more, i + a, j + b, columns[k]]
    return found


def make_chart(touches: Touches, texel: int, low: FloatArray, high: FloatArray, radii: tuple[float, float]) -> Chart:
    """Tabulate the response around a texel.

    Args:
        touches: Texel forces of touches.
        texel: Index of the texel among the active ones.
        low: Least x and y of the places from the point above the texel, shape (2,) [m].
        high: Largest x and y, shape (2,) [m].
        radii: Least and largest radius; equal if it is known [m].
    """
    known = radii[0] == radii[1]
    count = np.ceil((high - low) / np.array(touches.pitch) * _STEPS - 1e-6).astype(int)
    step = (high - low) / count
    beyond = np.full(2, _BEYOND) if known else 2 * _BEYOND + np.ceil(radii[1] / step).astype(int)
    lines = (low[i] + step[i] * np.arange(-beyond[i], count[i] + beyond[i] + 1) for i in (0, 1))
    places = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    forces = touches.forces(texel, places.reshape(-1, 2), radii[0] if known else 0.0)
    reached = forces.max(axis=0) > _LEAST_SHARE
    splines = _filter(forces[:, reached].reshape(*places.shape[:2], -1))
    knots = np.array([radii[0]]) if known else np.linspace(*radii, _RADII + 1)
    if known:
        table = splines[None]
    else:
        trim = tuple(slice(b - _BEYOND, b + n + _BEYOND + 1) for b, n in zip(beyond, count, strict=True))
        table = np.stack([_filter(_blur(splines, each, step)[trim]) for each in knots])
    columns = np.where(reached, np.cumsum(reached) - 1, -1)
    return Chart(texel=texel, low=low, high=high, step=step, radii=knots, columns=columns, table=table)


def _filter(forces: FloatArray) -> FloatArray:
    """Return the coefficients of the splines through forces on a lattice, of the same shape (nx, ny, s)."""
    for axis in (0, 1):
        forces = ndimage.spline_filter1d(forces, axis=axis, mode="mirror")
    return forces


def _blur(splines: FloatArray, radius: float, step: FloatArray) -> FloatArray:
    """Sum point touches to round ones: from coefficients of splines to forces on the lattice, of the same shape."""
    spots = spread_points(radius, *_SPOTS) / step
    wide = np.ceil(np.abs(spots).max(axis=0)).astype(int) + 1
    apart = [np.abs(spots[:, [i]] - np.arange(-wide[i], wide[i] + 1)) for i in (0, 1)]
    x, y = (np.where(u < 1, 2 / 3 - u**2 + u**3 / 2, np.maximum(2 - u, 0) ** 3 / 6) for u in apart)
    return np.asarray(signal.fftconvolve(splines, ((x.T @ y) / len(spots))[..., None], mode="same", axes=(0, 1)))
