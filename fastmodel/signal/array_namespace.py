"""Arrays of any library that follows the Python array API standard: numpy, JAX, PyTorch and others.

The functions of the signal chain accept arrays of any of these libraries, and return arrays of the same library.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

#: An array of any library that follows the array API standard; its element type stands in the docstrings.
Array = Any


def find_namespace(values: Any) -> Any:  # noqa: ANN401 -- modules have no common type
    """Return the module whose functions accept an array, for example `numpy` or `jax.numpy`.

    Numbers and sequences of numbers belong to numpy.  Arrays of PyTorch, which do not follow the standard by
    themselves, need the package array-api-compat.

    Args:
        values: An array, or a value that `numpy.asarray` accepts.
    """
    if isinstance(values, np.ndarray):  # The general way below gives the same result in ten times the time.
        return np
    if hasattr(values, "__array_namespace__"):
        return values.__array_namespace__()
    if type(values).__module__.partition(".")[0] == "torch":
        import array_api_compat

        return array_api_compat.array_namespace(values)
    return np


def as_floats(xp: Any, values: Any) -> Array:  # noqa: ANN401 -- modules have no common type
    """Convert values to an array of floating-point numbers; an array of such numbers is returned itself.

    Args:
        xp: The module of the array, see `find_namespace`.
        values: An array of the module, or a value that its `asarray` accepts.
    """
    array = xp.asarray(values)
    return array if array.dtype in _list_float_types(xp) else cast(xp, array, _list_float_types(xp)[0])


def cast(xp: Any, array: Array, dtype: Any) -> Array:  # noqa: ANN401 -- modules have no common type
    """Convert an array to another element type; numpy's method takes a third of the time of its function `astype`.

    Args:
        xp: The module of the array, see `find_namespace`.
        array: The array.
        dtype: The element type.
    """
    return array.astype(dtype) if xp is np else xp.astype(array, dtype)


@cache
def _list_float_types(xp: Any) -> tuple[Any, Any]:  # noqa: ANN401 -- modules have no common type
    """Return the types of 64-bit and 32-bit floating-point numbers of an array module.

    Comparing a type with these two is faster than the function `isdtype` of the array API standard.
    """
    return xp.asarray(0.0, dtype=xp.float64).dtype, xp.asarray(0.0, dtype=xp.float32).dtype


def round_half_to_even(xp: Any, values: Array) -> Array:  # noqa: ANN401 -- modules have no common type
    """Round floating-point numbers to whole ones, halves to the even one.

    Args:
        xp: The module of the array, see `find_namespace`.
        values: Floating-point numbers.
    """
    # `rint` is not part of the standard, but numpy's takes a quarter of the time of its `round` for a small array
    return xp.rint(values) if hasattr(xp, "rint") else xp.round(values)
