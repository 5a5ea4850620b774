"""Outlines of flat faces: corners of polygons, and the distance from them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def flats_of_circle(diameter: float) -> float:
    """Width across flats of the hexagon that has a circle's area: sqrt(3) / 2 w^2 = pi / 4 d^2 [m]."""
    return diameter * float(np.sqrt(np.pi / (2 * np.sqrt(3))))


def hexagon(across: float) -> list[tuple[float, float]]:
    """Corners, counterclockwise, of a hexagon with flats facing along x [m]."""
    turn = np.pi / 6 + np.arange(6) * np.pi / 3
    return [(float(across / np.sqrt(3) * np.cos(t)), float(across / np.sqrt(3) * np.sin(t))) for t in turn]


def inside_polygon(corners: list[tuple[float, float]], x: FloatArray, y: FloatArray) -> FloatArray:
    """Distance from a polygon's outline, positive inside, any shape [m]."""
    nearest = np.full(np.broadcast(x, y).shape, np.inf)
    crossings = np.zeros(nearest.shape, dtype=bool)
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        dx, dy = bx - ax, by - ay
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx**2 + dy**2), 0, 1)
        nearest = np.minimum(nearest, np.hypot(x - ax - along * dx, y - ay - along * dy))
        if dy:
            crossings ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * dx / dy)
    return np.where(crossings | (nearest == 0), nearest, -nearest)
