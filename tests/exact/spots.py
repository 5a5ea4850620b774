"""Solve a layer on an infinitely long rigid cylinder under forces anywhere on its top, exactly.

A force is a Fourier series around the axis and a Fourier integral along it; `cylinder_waves` gives the response to each
wave.  The response of the base is smooth, so that any pressure may be replaced by forces at Gauss points, or by small
patches of uniform pressure.  Angles theta count from x toward y, z lies along the axis.

A texel measures the resultant of the traction on its patch along its own normal, shear included (see `cylinder`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from fem_reference.closed_form.cylinder import CylinderLayer
from fem_reference.closed_form.layer import place_gauss_points
from meshes.array_types import FloatArray
from tests.exact.cylinder_waves import transfer_cylinder_waves

ComplexArray = npt.NDArray[np.complex128]
#: Cosines and sines, or their integrals.
Pair = tuple[npt.NDArray[Any], npt.NDArray[Any]]
#: Functions of orders or wave numbers, places and the place of the load.
Around = Callable[[FloatArray, slice, float], list[Pair]]
Along = Callable[[FloatArray, slice, float], Pair]

#: Product of wave number, along or around, and thickness at which the transfer ends: about exp(-40) is left [-].
_LARGE = 40.0
#: Orders beyond that product [-].
_MORE_ORDERS = 10
#: Gauss points in a panel of wave numbers, smallest number of panels, and largest phase k z in a panel [rad].
_POINTS, _PANELS, _PHASE = 10, 48, 4.0
#: Largest number of waves, to limit time and memory, and waves that are solved at once [-].
_MOST_WAVES, _CHUNK = 4_000_000, 50_000
#: Points of the base at which waves are summed at once [-].
_PLACES = 512


@dataclass(frozen=True, kw_only=True)
class SpotLoad:
    """A force on a point of the top, or spread evenly over a small patch of it.

    Attributes:
        force: Force toward the axis [N].
        shear_force: Force toward larger theta [N].
        axial_force: Force along z [N].
        angle: Angle of the middle [rad].
        height: Coordinate z of the middle [m].
        half_angle: Half of the angle of the patch, 0 for a point [rad].
        half_length: Half of the length of the patch along z, 0 for a point [m].
    """

    force: float
    shear_force: float = 0.0
    axial_force: float = 0.0
    angle: float = 0.0
    height: float = 0.0
    half_angle: float = 0.0
    half_length: float = 0.0

    def __post_init__(self) -> None:
        """Check the size of the patch.

        Raises:
            ValueError: If a size is negative, or the patch overlaps itself.
        """
        if not (0 <= self.half_angle <= np.pi and self.half_length >= 0):
            raise ValueError(
                f"no patch has half an angle of {self.half_angle} rad and a length of {self.half_length} m"
            )


@dataclass(frozen=True, kw_only=True)
class SpotResponse:
    """Layer on a cylinder under spot loads.

    Attributes:
        layer: The layer.
        loads: The loads on its top.
    """

    layer: CylinderLayer
    loads: tuple[SpotLoad, ...]

    def base_traction(self, angles: npt.ArrayLike, heights: npt.ArrayLike) -> FloatArray:
        """Compute the traction (outward, tangential, axial) that the layer exerts on the core.

        Args:
            angles: Angles theta of points of the base, shape (n,) [rad].
            heights: Coordinates z of the points, shape (n,) [m].

        Returns:
            Tractions, shape (n, 3) [Pa].

        Raises:
            ValueError: If the layer is so thin that more than four million waves are needed.
        """
        theta, z = np.broadcast_arrays(np.asarray(angles, dtype=float), np.asarray(heights, dtype=float))

        def waves(number: FloatArray, at: FloatArray, origin: float) -> Pair:
            phase = np.outer(at - origin, number)
            return np.cos(phase), np.sin(phase)

        def around(m: FloatArray, rows: slice, origin: float) -> list[Pair]:
            return [waves(m, theta[rows], origin)] * 3

        def along(k: FloatArray, rows: slice, origin: float) -> Pair:
            return waves(k, z[rows], origin)

        return np.asarray(self._sum(z, around, along).real)

    def resultants(self, patches: npt.ArrayLike) -> FloatArray:
        """Integrate the traction on the core over patches, exactly.

        Args:
            patches: First and last angle [rad], first and last z [m] of each patch, shape (n, 4).

        Returns:
            Force of the layer on each patch along x, y and z, shape (n, 3) [N].

        Raises:
            ValueError: If a patch ends where or before it starts, or the layer is too thin.
        """
        out = np.asarray(patches, dtype=float)
        if out.ndim != 2 or out.shape[1] != 4 or not (out[:, 1::2] > out[:, ::2]).all():
            raise ValueError("patches must be rows of first angle, last angle, first z and last z, in this order")
        theta, half_angle = out[:, :2].mean(axis=1), np.diff(out[:, :2], axis=1)[:, 0] / 2
        z, half_length = out[:, 2:].mean(axis=1), np.diff(out[:, 2:], axis=1)[:, 0] / 2

        def around(m: FloatArray, rows: slice, origin: float) -> list[Pair]:
            # Tractions across the axis turn with the base: they are integrated with the factor exp(i theta).
            across, axial = (_integrate_waves(m, theta[rows], half_angle[rows], origin, turn) for turn in (1.0, 0.0))
            return [across, across, axial]

        def along(k: FloatArray, rows: slice, origin: float) -> Pair:
            return _integrate_waves(k, z[rows], half_length[rows], origin, 0.0)

        radial, tangential, axial = self._sum(out[:, 2:].T, around, along).T
        across = radial + 1j * tangential
        return np.asarray(self.layer.core_radius * np.stack([across.real, across.imag, axial.real], axis=1))

    def texel_forces(self, patches: npt.ArrayLike) -> FloatArray:
        """Compute texel forces: the resultant on each patch, shear included, against the normal of its middle.

        Args:
            patches: First and last angle [rad], first and last z [m] of each patch, shape (n, 4).

        Returns:
            Force of each texel, positive under pressure, shape (n,) [N].
        """
        at = np.asarray(patches, dtype=float)[:, :2].mean(axis=1)
        force = self.resultants(patches)
        return np.asarray(-(force[:, 0] * np.cos(at) + force[:, 1] * np.sin(at)))

    @property
    def load_force(self) -> FloatArray:
        """Force of the loads along x, y and z, shape (3,) [N]."""
        total = np.zeros(3)
        for load in self.loads:
            across = (-load.force + 1j * load.shear_force) * np.exp(1j * load.angle) * np.sinc(load.half_angle / np.pi)
            total += [across.real, across.imag, load.axial_force]
        return total

    def _sum(self, heights: FloatArray, around: Around, along: Along) -> ComplexArray:
        """Sum all waves of all loads at n places, shape (n, 3).

        Args:
            heights: Coordinates z between which the places lie, shape (..., n) [m].
            around: Function that returns the waves around the axis of each component at some of the places.
            along: Function that returns the waves along the axis.
        """
        total = np.zeros((heights.shape[-1], 3), dtype=complex)
        for load in self.loads:
            reach = float(np.abs(heights - load.height).max(initial=0.0)) + load.half_length
            k, weight, base = _tabulate(self.layer, _count_panels(self.layer, reach))
            m = np.arange(float(len(base)))
            spread = np.where(m > 0, 1.0, 0.5) * np.sinc(m * load.half_angle / np.pi)
            weight = weight * np.sinc(k * load.half_length / np.pi) / (np.pi**2 * self.layer.outer_radius)
            for first in range(0, len(total), _PLACES):
                rows = slice(first, first + _PLACES)
                turns = [(c * spread, s * spread) for c, s in around(m, rows, load.angle)]
                c, s = along(k, rows, load.height)
                forces = (-load.force, load.shear_force, load.axial_force)
                total[rows] += _superpose(base, turns, (c * weight, s * weight), forces)
        return total


def touch_cylinder(layer: CylinderLayer, *loads: SpotLoad) -> SpotResponse:
    """Solve a layer on an infinitely long rigid cylinder under the sum of some loads."""
    return SpotResponse(layer=layer, loads=loads)


def _superpose(base: FloatArray, around: list[Pair], along: Pair, forces: tuple[float, ...]) -> ComplexArray:
    """Sum waves at n places.

    The response to a force is even around and along the axis in its own component.  A tangential component with another
    one goes like the sine of the angle, an axial one like the sine of k z.

    Args:
        base: Transfer to the base, shape (M, K, 3, 3).
        around: Cosines and sines of m theta of each component, shape (n, M) each.
        along: Cosines and sines of k z, shape (n, K) each.
        forces: Force of each component.
    """
    out = np.zeros((len(along[0]), 3), dtype=complex)
    for j, force in enumerate(forces):
        if force == 0:
            continue
        for i in range(3):
            turn, shift = (i == 1) - (j == 1), (i == 2) - (j == 2)
            angular = turn * around[i][1] if turn else around[i][0]
            axial = shift * along[1] if shift else along[0]
            out[:, i] += force * np.einsum("nk,nk->n", angular @ base[:, :, i, j], axial)
    return out


def _integrate_waves(number: FloatArray, middle: FloatArray, half: FloatArray, origin: float, turn: float) -> Pair:
    """Integrate cos(n (x - origin)) and sin(n (x - origin)), times exp(i turn x), over |x - middle| < half.

    Returns:
        Integrals for each interval and number n, shape (len(middle), len(number)) each.
    """
    ahead, back = (
        np.exp(1j * (sign * np.outer(middle - origin, number) + turn * middle[:, None]))
        * (2 * half[:, None] * np.sinc(np.outer(half, sign * number + turn) / np.pi))
        for sign in (1, -1)
    )
    return (ahead + back) / 2, (ahead - back) / 2j


def _count_panels(layer: CylinderLayer, reach: float) -> int:
    """Count the panels of wave numbers for distances up to `reach` [m] along the axis: a power of two, times 48."""
    wanted = max(_LARGE * reach / layer.thickness / _PHASE / _PANELS, 1.0)
    return int(_PANELS * 2 ** np.ceil(np.log2(wanted)))


@lru_cache(maxsize=2)
def _tabulate(layer: CylinderLayer, panels: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Tabulate the transfer to the base.

    Returns:
        Wave numbers k along the axis and their weights, shape (K,) each [1/m], and the transfer [-],
        shape (M, K, 3, 3).

    Raises:
        ValueError: If it needs more than four million waves.
    """
    span = np.log(layer.outer_radius / layer.core_radius)
    orders = int(np.ceil(_LARGE / span)) + _MORE_ORDERS
    if orders * panels * _POINTS > _MOST_WAVES:
        raise ValueError(
            f"{orders} orders and {panels * _POINTS} wave numbers are too many: the layer is too thin for its radius, "
            "or load and texel are too far apart along the axis"
        )
    k, weight = place_gauss_points(np.linspace(0, _LARGE / layer.thickness, panels + 1), _POINTS)
    pieces = np.array_split(k, orders * len(k) // _CHUNK + 1)
    radii = layer.core_radius, layer.outer_radius
    tables = [transfer_cylinder_waves(orders, piece, *radii, layer.material).base for piece in pieces]
    return k, weight, np.concatenate(tables, axis=1)
