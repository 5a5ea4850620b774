"""Tables of the texel forces of touches around one texel, for places and radii by the thousand."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage, signal

from meshes.array_types import FloatArray, IntArray
from validation.resolution.kernel import BEYOND
from validation.resolution.touches import Touches, spread_points

#: Steps of the lattice in a pitch, and radii besides the least one [-].
_STEPS, _RADII = 10, 12
#: Circles of point forces of a round touch, and point forces on each [-].
_SPOTS = 8, 16
#: Share of a force below which a texel is left out [-].
_LEAST_SHARE = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class Chart:
    """Texel forces of touches in a box around one texel: cubic splines in x and y, linear in the square of the radius.

    Attributes:
        texel: Index of the texel among the n active ones.
        low: Least x and y of the box from the point above the texel, shape (2,) [m].
        high: Largest x and y, shape (2,) [m].
        step: Steps of the lattice along x and y, shape (2,) [m].
        radii: Radii, shape (r,) [m].
        order: Indices of the texels of the table among the n active ones, by falling largest share, shape (s,).
        count: Number n of active texels.
        table: Coefficients, shape (r, nx, ny, s) [-].
    """

    texel: int
    low: FloatArray
    high: FloatArray
    step: FloatArray
    radii: FloatArray
    order: IntArray
    count: int
    table: FloatArray

    @property
    def arrays(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Low, step, radii and table."""
        return self.low, self.step, self.radii, self.table

    @cached_property
    def columns(self) -> IntArray:
        """Place of each active texel in the table, -1 for one that is out of reach, shape (n,)."""
        found = np.full(self.count, -1)
        found[self.order] = np.arange(len(self.order))
        return found

    @cached_property
    def peaks(self) -> FloatArray:
        """Largest share of a point force on each texel of the table, shape (s,) [-]."""
        return np.asarray(self.table[0].max(axis=(0, 1)))


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
    beyond = np.full(2, BEYOND) if known else 2 * BEYOND + np.ceil(radii[1] / step).astype(int)
    lines = (low[i] + step[i] * np.arange(-beyond[i], count[i] + beyond[i] + 1) for i in (0, 1))
    places = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    forces = touches.forces(texel, places.reshape(-1, 2), radii[0] if known else 0.0)
    reached = np.flatnonzero(forces.max(axis=0) > _LEAST_SHARE)
    splines = _filter(forces[:, reached].reshape(*places.shape[:2], -1))
    knots = np.array([radii[0]]) if known else np.linspace(*radii, _RADII + 1)
    if known:
        table = splines[None]
    else:
        trim = tuple(slice(b - BEYOND, b + n + BEYOND + 1) for b, n in zip(beyond, count, strict=True))
        table = np.stack([_filter(_blur(splines, each, step)[trim]) for each in knots])
    order = np.argsort(-table[0].max(axis=(0, 1)), kind="stable")
    return Chart(
        texel=texel, low=low, high=high, step=step, radii=knots, order=reached[order], count=forces.shape[1],
        table=np.ascontiguousarray(table[..., order]),
    )  # fmt: skip


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
