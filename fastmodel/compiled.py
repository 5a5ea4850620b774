"""Compilation of kernels by numba; a kernel is a function of explicit loops over arrays.

A kernel is an ordinary function in the subset of Python that numba can compile.  `compile_kernel` compiles one;
functions that kernels call are marked with `called_by_kernels`.  Numba is imported by the first compilation only.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

_F = TypeVar("_F", bound=Callable[..., Any])

#: Options of numba for every kernel.  Numpy's error model omits the check for division by zero, and the wrapper for
#: calls from C, which nothing uses, is omitted.  Each of the two options shortens compilation.
_OPTIONS: Any = {"error_model": "numpy", "no_cfunc_wrapper": True}

#: Functions marked with `called_by_kernels` that are not registered with numba yet.
_CALLED: list[Callable[..., Any]] = []


def called_by_kernels(function: _F) -> _F:
    """Mark a function that kernels call, so that numba compiles the function together with the kernels."""
    _CALLED.append(function)
    return function


def compile_kernel(loops: _F) -> _F:
    """Return a version of a function that numba compiles on its first call.

    The machine code is kept on disk for later processes.

    Args:
        loops: The function; its loops are written out.
    """
    return _compile(loops)  # type: ignore[return-value]  # numba's dispatcher takes the same arguments


@cache
def _compile(loops: Callable[..., Any]) -> Callable[..., Any]:
    """Register the functions that kernels call with numba, and make numba's version of a kernel."""
    import numba

    while _CALLED:
        function = _CALLED.pop()
        # this does what numba.extending.register_jitable does, which does not accept compiler options
        numba.extending.overload(function, jit_options=_OPTIONS, strict=False)(lambda *_, compiled=function: compiled)
    try:
        kernel: Callable[..., Any] = numba.njit(cache=True, **_OPTIONS)(loops)
    except RuntimeError:  # no writable folder for the machine code: compile anew in every process
        kernel = numba.njit(**_OPTIONS)(loops)
    return kernel
