"""Compilation of kernels by numba; a kernel is a function of explicit loops over arrays.

A kernel is an ordinary function in the subset of Python that numba can compile.  `compile_kernel` compiles one;
functions that kernels call are marked with `called_by_kernels`.  Numba is imported by the first compilation only.
"""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable, Iterator
from functools import cache, wraps
from pathlib import Path
from typing import Any, TypeVar

from meshes.atomic_file import hold_lock

_F = TypeVar("_F", bound=Callable[..., Any])

_LOG = logging.getLogger(__name__)

#: Compilation time above which a message is logged [s].
_SLOW = 2.0
#: Options of numba for every kernel.  Numpy's error model omits the check for division by zero, and the wrapper for
#: calls from C, which nothing uses, is omitted.  Each of the two options shortens compilation.
_OPTIONS: Any = {"error_model": "numpy", "no_cfunc_wrapper": True}

#: Functions marked with `called_by_kernels` that are not yet registered with numba.
_CALLED: list[Callable[..., Any]] = []


@contextlib.contextmanager
def report_slow_compilation(name: str) -> Iterator[None]:
    """Log a message if the body of the `with` statement, which compiles kernels, takes longer than `_SLOW`.

    Args:
        name: Name of the sensor or test in the message.
    """
    text = "%s: compiling the contact kernels; later runs load them from disk"
    timer = threading.Timer(_SLOW, lambda: _LOG.warning(text, name))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


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
    return _compile(loops)  # type: ignore[return-value]  # it takes the same arguments


def _compile_once(kernel: Any) -> Callable[..., Any]:  # noqa: ANN401 -- numba's class has no types
    """Make a version of a kernel's `compile` that waits while another process compiles it, and then loads the result.

    Numba looks for the machine code on disk first.  Without the lock, processes that start together all compile.
    """
    inner, lock = kernel.compile, Path(kernel.stats.cache_path) / f"{kernel.__name__}.lock"

    @wraps(inner)
    def compile_signature(signature: object) -> object:
        with hold_lock(lock):
            return inner(signature)

    return compile_signature


@cache
def _compile(loops: Callable[..., Any]) -> Callable[..., Any]:
    """Register the functions that a kernel calls with numba, and make numba's version of the kernel.

    While numba converts the results to Python objects, a signal such as Ctrl-C may raise an exception.  Python then
    reports a `SystemError` whose cause is this exception.  The returned function raises the exception itself.
    """
    import numba

    while _CALLED:
        function = _CALLED.pop()
        # Numba's `register_jitable` does the same, but does not accept compiler options.
        numba.extending.overload(function, jit_options=_OPTIONS, strict=False)(lambda *_, compiled=function: compiled)
    try:
        kernel: Any = numba.njit(cache=True, **_OPTIONS)(loops)
        kernel.compile = _compile_once(kernel)
    except RuntimeError:  # Without a writable folder for the machine code, each process compiles the kernel.
        kernel = numba.njit(**_OPTIONS)(loops)

    @wraps(kernel, updated=())
    def call(*arguments: Any) -> Any:  # noqa: ANN401 -- those of the kernel
        try:
            return kernel(*arguments)
        except SystemError as error:
            first: BaseException = error
            while isinstance(first, SystemError) and first.__cause__ is not None:
                first = first.__cause__
            raise first from None

    return call
