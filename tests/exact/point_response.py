"""Tabulate the exact pressure on the base under a point load."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from fem_reference.closed_form import point_response
from meshes import Cover


def point_response_spline(cover: Cover, reach: float, points: int = 1601) -> CubicSpline:
    """Tabulate the base pressure per unit point load (`point_response`) as a cubic spline of the distance.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        reach: Largest distance from the load [m].
        points: Number of points of the table, evenly spaced from 0 to `reach` [-].
    """
    radius = np.linspace(0.0, reach, points)
    return CubicSpline(radius, point_response(cover, radius), bc_type="clamped")
