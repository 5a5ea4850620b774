"""Area of a polygon, for comparison with the area of its parts."""

import numpy as np


def compute_area(polygon):
    """Area of a polygon, positive if its corners go counterclockwise, by the shoelace formula [m2]."""
    corners = np.array(polygon, dtype=float)
    x, y = (corners - corners[0]).T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)
