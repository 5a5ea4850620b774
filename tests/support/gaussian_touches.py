"""Touches whose texel forces are Gaussian functions of the place: 5 by 3 texels, in closed form with all slopes."""

import numpy as np

from validation.resolution.touches import Touches

PITCH = np.array([2e-3, 3e-3])
COLUMNS, ROWS = 5, 3
#: Middles of the texels [m], row by row from below; places are those from the texel in the middle.
CENTRES = np.array([[(k - 2) * 2e-3, (j - 1) * 3e-3] for j in range(ROWS) for k in range(COLUMNS)])
MIDDLE = 7
_WIDTH = 1.6e-3


def share(places, radius=0.0):
    """Force on each texel per newton and its slopes along x, y and with the radius, shape (k, n, 4)."""
    apart = np.asarray(places)[:, None] - CENTRES
    size = _WIDTH**2 + radius**2
    found = 0.4 * np.exp(-(apart**2).sum(axis=2) / (2 * size))
    x, y = (-apart[..., axis] / size * found for axis in (0, 1))
    return np.stack([x, y, found, found * (apart**2).sum(axis=2) * radius / size**2], axis=-1)


def _respond(points, axes, radius, among):
    return share(points @ axes.T, radius)[..., 2][:, among]


TOUCHES = Touches(
    origins=np.column_stack([CENTRES, np.zeros(15)]),
    axes=np.tile(np.eye(3)[:2], (15, 1, 1)),
    pitch=(2e-3, 3e-3),
    respond=_respond,
)
