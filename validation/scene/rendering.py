"""Determines whether this machine can draw in three dimensions before VTK is used, because VTK may crash.

Without a display VTK draws by EGL or OSMesa.  If their libraries or drivers are missing, the process ends with a
segmentation fault.  The libraries are therefore searched first.  Then a separate process draws a small picture.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

#: Names of the shared library that VTK loads to draw without a display, by class of VTK's window.  A library with one
#: of the names must be installed.
_LIBRARIES = {
    "vtkEGLRenderWindow": ("libEGL.so.1", "libEGL.so"),
    "vtkOSOpenGLRenderWindow": ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),
}
#: Name of the environment variable that selects the class of VTK's window.
_CHOICE = "VTK_DEFAULT_OPENGL_WINDOW"
#: Program that tries to draw a small picture with pyvista, and ends with status 0 if that works.
_PROBE = """
import sys, pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32))
plotter.add_mesh(pyvista.Plane())
sys.exit(0 if plotter.screenshot(None, return_img=True).max() else "the picture is black")
"""
#: Longest time to wait for the program that tries to draw a small picture [s].
_TIMEOUT = 120.0


class RenderingError(OSError):
    """Reports that VTK can draw no picture on this machine; the message names the missing part."""


@contextlib.contextmanager
def open_plotter(**options: Any) -> Iterator[Any]:  # noqa: ANN401 -- its types differ between versions
    """Open a plotter of pyvista that draws into memory within the `with` block.

    Args:
        **options: Options of `pyvista.Plotter`.

    Raises:
        ImportError: If pyvista is not installed.
        RenderingError: If this machine can draw no picture.
    """
    import pyvista

    window, before = find_window_without_display(), os.environ.get(_CHOICE)
    if window:
        os.environ[_CHOICE] = window
    try:
        with contextlib.closing(pyvista.Plotter(off_screen=True, **options)) as plotter:
            yield plotter
    finally:
        if before is not None:
            os.environ[_CHOICE] = before
        elif window:
            del os.environ[_CHOICE]


@cache
def find_window_without_display() -> str:
    """Find the class of VTK's window that draws into memory on this machine; empty if VTK needs no choice.

    Raises:
        RenderingError: If this machine can draw no picture.
    """
    if not sys.platform.startswith("linux"):
        if fault := _try_to_draw(""):
            raise RenderingError(f"VTK cannot draw on this machine ({fault})")
        return ""
    faults = {}
    for name in (name for name, libraries in _LIBRARIES.items() if any(map(_is_library, libraries))):
        fault = _try_to_draw(name)
        if fault is None:
            return name
        faults[name] = fault
    if faults:
        raise RenderingError(
            f"VTK cannot draw here ({'; '.join(f'{name}: {fault}' for name, fault in faults.items())}); "
            "on Debian or Ubuntu: apt-get install libegl1 libgl1-mesa-dri"
        )
    raise RenderingError(
        "neither EGL nor OSMesa is installed, and without one of them VTK cannot draw; "
        "on Debian or Ubuntu: apt-get install libegl1 libgl1-mesa-dri (or libosmesa6)"
    )


def _is_library(name: str) -> bool:
    """Return whether a shared library can be loaded."""
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def _try_to_draw(window: str) -> str | None:
    """Draw a small picture in a separate process; return the reason of a failure, None if it succeeds."""
    environment = os.environ | ({_CHOICE: window} if window else {})
    slow = f"no picture within {_TIMEOUT:g} s"
    return try_program(_PROBE, _TIMEOUT, slow=slow, silent="the picture is empty", environment=environment)


def try_program(
    program: str, timeout: float, *, slow: str, silent: str, environment: Mapping[str, str] | None = None
) -> str | None:
    """Run a Python program in a process of its own.

    Args:
        program: Text of the program.
        timeout: Longest time to wait for its end [s].
        slow: Reason of a program that does not end in time.
        silent: Reason of a program that fails without a word.
        environment: Its environment; that of this process if None.

    Returns:
        Why it failed: the last line that it wrote to standard error; None if it did not fail.
    """
    command = [sys.executable, "-c", program]
    try:
        tried = subprocess.run(  # noqa: S603 -- ours
            command, capture_output=True, text=True, check=False, timeout=timeout, env=environment
        )
    except subprocess.TimeoutExpired:
        return slow
    if tried.returncode < 0:
        return f"the process was ended by signal {-tried.returncode}"
    return (tried.stderr.strip().splitlines() or [silent])[-1][:200] if tried.returncode else None
