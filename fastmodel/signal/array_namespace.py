"""Arrays of any library that follows the Python array API standard: numpy, JAX, PyTorch and others.

The functions of the signal chain accept arrays of any of these libraries, and return arrays of the same library.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from fastmodel.errors import FastModelError

#: Type of 64-bit numbers of numpy.
_DOUBLE = np.dtype(np.float64)
#: An array of any library that follows the array API standard; its element type stands in the docstrings.
Array = Any


def find_namespace(values: Any, otherwise: Any = np) -> Any:  # noqa: ANN401 -- modules have no common type
    """Return the module whose functions accept an array, for example `numpy` or `jax.numpy`.

    Arrays of PyTorch, which do not follow the standard by themselves, need the package array-api-compat.

    Args:
        values: An array, a number, or a sequence of numbers.
        otherwise: Module to which numbers and sequences of numbers belong.
    """
    if isinstance(values, np.ndarray):  # The general way below gives the same result in ten times the time.
        return np
    if hasattr(values, "__array_namespace__"):
        return values.__array_namespace__()
    if _is_tensor(values):
        import array_api_compat

        return array_api_compat.array_namespace(values)
    return otherwise


def _is_tensor(values: Any) -> bool:  # noqa: ANN401 -- modules have no common type
    """Return whether an array belongs to PyTorch."""
    return type(values).__module__.partition(".")[0] == "torch"


def convert(constant: Any, like: Array) -> Array:  # noqa: ANN401 -- an array of numpy or a sparse matrix
    """Convert a constant to the library, element type and device of an array.

    Args:
        constant: A matrix, which stays sparse for arrays of numpy, or an array of numpy.
        like: The array.
    """
    if isinstance(like, np.ndarray):
        return constant if constant.dtype == like.dtype else constant.astype(like.dtype)
    dense = constant if isinstance(constant, np.ndarray) else constant.toarray()
    place = {"device": like.device} if _is_tensor(like) else {}
    return find_namespace(like).asarray(dense, dtype=like.dtype, **place)


def is_known(values: Array) -> bool:
    """Return whether the values of an array are known, and not only its shape and type as under `jax.jit`."""
    jax = sys.modules.get("jax")
    return jax is None or not isinstance(values, jax.core.Tracer)


def check_floats(
    name: str,
    values: Any,  # noqa: ANN401 -- arrays of several libraries, or what they convert
    like: Array | None = None,
    shape: tuple[int, ...] | None = None,
    otherwise: Any = np,  # noqa: ANN401 -- modules have no common type
) -> Array:
    """Check library, element type, device and shape of an array of floating-point numbers, and return the array.

    Args:
        name: Name of the argument, for messages.
        values: The array.  Numbers and sequences are converted, and arrays of numpy where another library is wanted.
        like: An array of the wanted library, type and device; None for any with 32 or 64 bits.
        shape: The wanted shape; None for any.
        otherwise: Module to which numbers and sequences are converted if `like` is None.

    Raises:
        FastModelError: If the array differs in one of these.
    """
    # The general way below gives the same results in more time.
    if type(values) is np.ndarray and shape in {None, values.shape}:
        if values.dtype is (_DOUBLE if like is None else like.dtype):
            return values
    elif isinstance(values, float) and type(like) is np.ndarray and shape == ():
        return np.asarray(values, dtype=like.dtype)
    own, xp = find_namespace(values, None), find_namespace(values if like is None else like, otherwise)
    if own is None or (own is np and xp is not np):
        values, own = _read(name, values, xp, like), xp
    if own is not xp:
        given, wanted = (each.__name__.removeprefix("array_api_compat.") for each in (own, xp))
        raise FastModelError(f"{name} is an array of {given}; convert it to one of {wanted}")
    if not _is_float(xp, values) or (like is not None and values.dtype != like.dtype):
        wanted = "float32 or float64" if like is None else like.dtype
        raise FastModelError(f"{name} has elements of type {values.dtype}; convert them to {wanted}")
    if like is not None and _is_tensor(like) and values.device != like.device:
        raise FastModelError(f"{name} lies on {values.device}; move it with .to({str(like.device)!r})")
    if shape is not None and tuple(values.shape) != shape:
        raise FastModelError(f"{name} has shape {tuple(values.shape)}; give shape {shape}")
    return values


def _read(name: str, values: Any, xp: Any, like: Array | None) -> Array:  # noqa: ANN401 -- what a module converts
    """Convert numbers, sequences or an array of numpy to an array of a module, of the type of `like` if given.

    Raises:
        FastModelError: If they are no numbers.
    """
    try:
        return xp.asarray(values) if like is None else convert(np.asarray(values, dtype=np.float64), like)
    except (TypeError, ValueError) as error:
        raise FastModelError(f"{name} is no array of numbers; give one of {xp.__name__}") from error


def as_floats(xp: Any, values: Any) -> Array:  # noqa: ANN401 -- modules have no common type
    """Convert values to an array of floating-point numbers; an array of such numbers is returned itself.

    Args:
        xp: The module of the array, see `find_namespace`.
        values: An array of the module, or a value that its `asarray` accepts.
    """
    array = xp.asarray(values)
    return array if _is_float(xp, array) else cast(xp, array, xp.float64)


def cast(xp: Any, array: Array, dtype: Any) -> Array:  # noqa: ANN401 -- modules have no common type
    """Convert an array to another element type; numpy's method takes a third of the time of its function `astype`.

    Args:
        xp: The module of the array, see `find_namespace`.
        array: The array.
        dtype: The element type.
    """
    return array.astype(dtype) if xp is np else xp.astype(array, dtype)


def _is_float(xp: Any, array: Array) -> bool:  # noqa: ANN401 -- modules have no common type
    """Return whether an array has 64-bit or 32-bit floating-point numbers, faster than the function `isdtype`."""
    return array.dtype is _DOUBLE or bool(array.dtype == xp.float64 or array.dtype == xp.float32)  # noqa: PLR1714 -- types without a hash


def round_half_to_even(xp: Any, values: Array) -> Array:  # noqa: ANN401 -- modules have no common type
    """Round floating-point numbers to whole ones, halves to the even one.

    Args:
        xp: The module of the array, see `find_namespace`.
        values: Floating-point numbers.
    """
    # `rint` is not part of the standard, but numpy's takes a quarter of the time of its `round` for a small array
    return xp.rint(values) if hasattr(xp, "rint") else xp.round(values)
