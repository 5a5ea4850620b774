"""Optional machine code: the same loops, compiled by numba where numba is installed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

from fastmodel.errors import FastModelError

Kernel = Callable[..., Any]
_F = TypeVar("_F", bound=Kernel)

#: Numpy's error model: without a branch at every division kernels are smaller, and sooner compiled.  No entry from C,
#: which nobody takes and which takes the compiler's time.
_OPTIONS: Any = {"error_model": "numpy", "no_cfunc_wrapper": True}

#: Functions that kernels call, with what is compiled in their place; emptied when numba gets to know them.
_CALLED: list[tuple[Kernel, Kernel]] = []


def called_by_kernels(loops: Kernel | None = None) -> Callable[[_F], _F]:
    """Decorate a function that kernels call, so that numba compiles it with them.

    Args:
        loops: What to compile in its place; the function itself when not given.
    """

    def mark(function: _F) -> _F:
        _CALLED.append((function, loops or function))
        return function

    return mark


def compile_kernel(loops: _F) -> _F:
    """Compile a function with numba; the compiled code is kept on disk for later processes.

    Args:
        loops: Explicit loops over arrays, in the part of Python that numba understands.
    """
    return _compile(loops)  # type: ignore[return-value]  # numba's dispatcher takes the same arguments


def choose_kernel(loops: Kernel, plain: Kernel, *, native: bool | None) -> Kernel:
    """The compiled loops or the numpy function that does the same.

    Args:
        loops: Explicit loops over arrays, in what numba understands.
        plain: The same in numpy.
        native: True for the compiled loops, False for numpy, None for the loops where numba is installed.

    Raises:
        FastModelError: If compiled loops are asked for and numba is not installed.
    """
    return find_kernel(loops, native=native) or plain


def find_kernel(loops: Kernel, *, native: bool | None) -> Kernel | None:
    """The compiled loops; None where numpy is to do it in a way of its own.

    Args:
        loops: As `choose_kernel` takes them.
        native: See there.

    Raises:
        FastModelError: If compiled loops are asked for and numba is not installed.
    """
    if native is False:
        return None
    kernel = _compiled(loops)
    if kernel is None and native:
        raise FastModelError("native=True needs numba: pip install 'softcover[fast]'")
    return kernel


@cache
def _compile(loops: Kernel) -> Kernel:
    import numba

    while _CALLED:
        function, compiled = _CALLED.pop()
        # the way of numba.extending.register_jitable, which takes no other function
        numba.extending.overload(function, jit_options=_OPTIONS, strict=False)(lambda *_, compiled=compiled: compiled)
    try:
        kernel: Kernel = numba.njit(cache=True, **_OPTIONS)(loops)
    except RuntimeError:  # no folder to cache in: compile in every process
        kernel = numba.njit(**_OPTIONS)(loops)
    return kernel


def _compiled(loops: Kernel) -> Kernel | None:
    try:
        return _compile(loops)
    except ImportError:
        return None
