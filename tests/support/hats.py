"""Point forces that are divided bilinearly among the cells of a grid."""

import numpy as np


def share_by_hats(grid, points):
    """Sum point forces on all cells, each weighed by hat functions over the centres of the cells.

    Forces beyond the outermost centres act on the outermost cells.

    Args:
        grid: A `CellGrid` of rows x columns cells.
        points: Positions x, y in the frame of the grid [m] and forces [N], shape (k, 3).

    Returns:
        Force on each cell, shape (rows, columns) [N].
    """
    found = np.zeros((grid.rows, grid.columns))
    counts = np.array([grid.columns, grid.rows])
    for x, y, force in points:
        place = np.clip((np.array([x, y]) - grid.low) / grid.edge - 0.5, 0, counts - 1)
        along, across = (np.maximum(1 - np.abs(at - np.arange(n)), 0) for at, n in zip(place, counts, strict=True))
        found += force * np.outer(across, along)
    return found
