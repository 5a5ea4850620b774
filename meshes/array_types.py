"""Types of numpy arrays for annotations, and two functions for checks of arguments and their messages."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


def is_positive(value: object) -> bool:
    """Return whether a value is a positive finite number; False for booleans, arrays and texts."""
    return isinstance(value, int | float | np.integer | np.floating) and value is not True and bool(0 < value < np.inf)


def describe_lengths(lengths: object) -> str:
    """Describe a length or several [m] in mm, for an error message; what is no number is shown as it is."""
    values = np.array(lengths, dtype=object).ravel().tolist()
    return ", ".join(f"{1e3 * each:.6g} mm" if type(each) in {int, float} else str(each) for each in values)
