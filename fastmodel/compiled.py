"""Kernels: explicit loops over arrays, compiled by numba.

A kernel is an ordinary function in the part of Python that numba understands.  `compile_kernel` compiles one; functions
that kernels call are marked with `called_by_kernels`.  Numba is imported by the first compilation only.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

_F = TypeVar("_F", bound=Callable[..., Any])

#: Options of every kernel: numpy's error model saves a branch at each division, and the wrapper for calls from C is not
#: needed.  Both shorten compilation.
_OPTIONS: Any = {"error_model": "numpy", "no_cfunc_wrapper": True}

#: Functions that kernels call and that are not registered with numba yet.
_CALLED: list[Callable[..., Any]] = []


def called_by_kernels(function: _F) -> _F:
    """Decorate a function that kernels call, so that numba compiles it with them."""
    _CALLED.append(function)
    return function


def compile_kernel(loops: _F) -> _F:
    """Compile a function with numba on its first call; the machine code is kept on disk for later processes.

    Args:
        loops: The function.
    """
    return _compile(loops)  # type: ignore[return-value]  # numba's dispatcher takes the same arguments


@cache
def _compile(loops: Callable[..., Any]) -> Callable[..., Any]:
    import numba

    while _CALLED:
        function = _CALLED.pop()
        # as numba.extending.register_jitable does, which takes no compiler options
        numba.extending.overload(function, jit_options=_OPTIONS, strict=False)(lambda *_, compiled=function: compiled)
    try:
        kernel: Callable[..., Any] = numba.njit(cache=True, **_OPTIONS)(loops)
    except RuntimeError:  # no folder to keep machine code in: compile in every process
        kernel = numba.njit(**_OPTIONS)(loops)
    return kernel
