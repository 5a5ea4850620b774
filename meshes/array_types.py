"""Types of numpy arrays of 64-bit floats, 64-bit integers and booleans, for annotations."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


def is_positive(value: object) -> bool:
    """Return whether a value is a positive finite number; False for booleans, arrays and texts."""
    return isinstance(value, int | float | np.integer | np.floating) and value is not True and bool(0 < value < np.inf)
