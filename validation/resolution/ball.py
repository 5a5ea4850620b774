"""Contact radius, depth and largest load of a ball on one layer, from a table of presses in dimensionless groups.

The groups are those of one layer bonded to a rigid base: Poisson ratio, radius of the ball, depth and contact radius
over the thickness h, and load over mu h^2.  The table holds the exact linear solution, and the load at finite strain of
a neo-Hookean layer over the linear one at the same depth.  `benchmarks/ball_table.py` computes it.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from meshes import Layer
from meshes.array_types import FloatArray

#: Poisson ratios, radii of the ball and depths over the thickness, of the table [-].
RATIOS = (0.4, 0.45, 0.475, 0.49, 0.495, 0.5)
RADII = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0)
DEPTHS = (0.002, 0.005, 0.01, 0.02, 0.04, 0.07, 0.11, 0.16, 0.22, 0.3)
#: Depth from which the finite elements press; below it the ratio of the loads tends to one [-].
LEAST_FINITE = 0.04
#: The table.
PATH = Path(__file__).with_name("ball_table.csv")
#: Offset of the coordinate of the Poisson ratio, in which the table is smooth [-].
_OFFSET = 0.005


class Pressed(NamedTuple):
    """A ball under a load: contact radius and depth, nan beyond 30 % of the thickness [m], and the load there [N]."""

    contact: float
    depth: float
    most: float


def press_ball(layer: Layer, radius: float, load: float) -> Pressed | None:
    """Press a ball on one layer; its contact radius is that of the linear solution, its depth that of finite strain.

    Args:
        layer: The layer; materials for small strain count as neo-Hookean of the same moduli.
        radius: Radius of the ball [m].
        load: Load on the ball [N].

    Returns:
        The pressed ball; None outside the table.
    """
    ratio, h, at = layer.material.poisson_ratio, layer.thickness, radius / layer.thickness
    if not (RATIOS[0] <= ratio <= RATIOS[-1] and RADII[0] <= at <= RADII[-1]):
        return None
    finite, contacts, depths = _interpolate(ratio, at)
    unit = layer.material.shear_modulus * h**2
    group = float(np.log(load / unit))

    def look(values: CubicSpline, power: float) -> float:
        """Interpolate a logarithm; below the smallest depth it follows the power of Hertz."""
        return h * float(np.exp(values(max(group, values.x[0])) + power * min(group - values.x[0], 0.0)))

    most = unit * float(np.exp(finite[-1]))
    if group > finite[-1]:
        return Pressed(np.nan, np.nan, most)
    return Pressed(look(contacts, 1 / 3), look(depths, 2 / 3), most)


@cache
def _interpolate(ratio: float, radius: float) -> tuple[FloatArray, CubicSpline, CubicSpline]:
    """Interpolate the table, as logarithms: load by depth, and contact radius and depth by the load [-]."""
    row = CubicSpline(_place(RATIOS), _read(), axis=0)(_place(ratio))
    linear, contact, ratios = CubicSpline(np.log(RADII), row, axis=0)(np.log(radius))
    return linear + ratios, CubicSpline(linear, contact), CubicSpline(linear + ratios, np.log(DEPTHS))


def estimate_errors() -> FloatArray:
    """Return the largest relative leave-one-out errors of linear load, contact radius and ratio of loads, shape (3,).

    Each inner Poisson ratio and radius is left out in turn, and interpolated from the others.
    """
    table, worst = _read(), np.zeros(3)
    for axis, nodes in enumerate((_place(RATIOS), np.log(RADII))):
        for out in range(1, len(nodes) - 1):
            rest = np.delete(np.arange(len(nodes)), out)
            found = CubicSpline(nodes[rest], table.take(rest, axis), axis=axis)(nodes[out])
            worst = np.maximum(worst, np.abs(np.expm1(found - table.take(out, axis))).max(axis=(0, 2)))
    return worst


def _place(ratios: float | tuple[float, ...]) -> FloatArray:
    return np.asarray(-np.log(0.5 + _OFFSET - np.array(ratios)))


@cache
def _read() -> FloatArray:
    """Read the logarithms of linear load, contact radius and ratio of loads, shape (ratios, radii, 3, depths) [-]."""
    rows = np.loadtxt(PATH, delimiter=",").reshape(len(RATIOS), len(RADII), len(DEPTHS), -1)
    return np.moveaxis(np.log(rows[..., 3:]), -1, 2)
