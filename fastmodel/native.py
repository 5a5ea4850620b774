"""Optional machine code: the same loops, compiled by numba where numba is installed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from fastmodel.errors import FastModelError

Kernel = Callable[..., Any]


def choose_kernel(loops: Kernel, plain: Kernel, *, native: bool | None) -> Kernel:
    """The compiled loops or the numpy function that does the same.

    Args:
        loops: Explicit loops over arrays, in what numba understands.
        plain: The same in numpy.
        native: True for the compiled loops, False for numpy, None for the loops where numba is installed.

    Raises:
        FastModelError: If compiled loops are asked for and numba is not installed.
    """
    if native is False:
        return plain
    kernel = _compiled(loops)
    if kernel is None and native:
        raise FastModelError("native=True needs numba: pip install 'softcover[fast]'")
    return kernel or plain


@cache
def _compiled(loops: Kernel) -> Kernel | None:
    try:
        import numba
    except ImportError:
        return None
    try:
        kernel: Kernel = numba.njit(cache=True)(loops)
    except RuntimeError:  # no folder to cache in: compile in every process
        kernel = numba.njit(loops)
    return kernel
