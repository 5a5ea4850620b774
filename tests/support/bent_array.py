"""A texel array on a bent sheet."""

import numpy as np

from meshes import TexelArray


def bent_array():
    """3 x 3 texels of 3 mm on a cylinder of radius 8.5 mm about the x axis."""
    angle = np.repeat([-0.4, 0.0, 0.4], 3)
    along = np.tile([-3.4e-3, 0.0, 3.4e-3], 3)
    normals = np.stack([np.zeros(9), np.sin(angle), np.cos(angle)], axis=1)
    return TexelArray(
        centres=8.5e-3 * (normals - [0, 0, 1]) + along[:, None] * [1.0, 0, 0],
        normals=normals,
        texel_size=(3e-3, 3e-3),
        pitch=(3.4e-3, 3.4e-3),
        rows=3,
        columns=3,
        active=np.ones(9, dtype=bool),
    )
