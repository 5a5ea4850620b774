"""Finds out whether this machine can draw in three dimensions, before VTK is asked to: it crashes where it cannot.

VTK draws into a window of X11, or without a display by EGL or OSMesa.  If their libraries are missing, or the drivers
below them, the process ends by a segmentation fault.  So the libraries are looked for first, and then a program in a
process of its own draws a small picture.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from typing import Any

#: Libraries that VTK's windows without a display load, one of which must be there.
_LIBRARIES = {
    "vtkEGLRenderWindow": ("libEGL.so.1", "libEGL.so"),
    "vtkOSOpenGLRenderWindow": ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),
}
#: VTK's window on a display.
_ON_DISPLAY = "vtkXOpenGLRenderWindow"
#: Variable of the environment with which VTK chooses its window.
_CHOICE = "VTK_DEFAULT_OPENGL_WINDOW"
#: Program that draws a small picture and ends with status 0 if that works.
_PROBE = """
import sys, pyvista
plotter = pyvista.Plotter(off_screen=sys.argv[1] == "off", window_size=(32, 32))
plotter.add_mesh(pyvista.Plane())
if sys.argv[1] == "off":
    picture = plotter.screenshot(None, return_img=True)
    sys.exit(0 if picture.max() else "the picture is black")
plotter.show(interactive=False, auto_close=True)
"""
#: Longest time to wait for the small picture [s].
_TIMEOUT = 120.0


class RenderingError(OSError):
    """No picture can be drawn on this machine; the message says what is missing."""


def import_pyvista() -> Any:  # noqa: ANN401 -- its types differ between versions
    """Import pyvista.

    Raises:
        ImportError: If pyvista is not installed.
    """
    return importlib.import_module("pyvista")


@contextlib.contextmanager
def draw_without_display() -> Iterator[None]:
    """Let VTK draw into memory within the `with` block.

    Raises:
        ImportError: If pyvista is not installed.
        RenderingError: If this machine can draw no picture.
    """
    import_pyvista()
    with _choose(find_window_without_display()):
        yield


@contextlib.contextmanager
def draw_on_display() -> Iterator[None]:
    """Let VTK open windows on the display within the `with` block.

    Raises:
        ImportError: If pyvista is not installed.
        RenderingError: If there is no display, or no window can be opened on it.
    """
    import_pyvista()
    check_display()
    if sys.platform.startswith("linux"):
        with _choose(_ON_DISPLAY):
            yield
    else:
        yield


@cache
def find_window_without_display() -> str:
    """Find the kind of VTK's window that draws into memory; empty where VTK needs no choice.

    Raises:
        RenderingError: If this machine can draw no picture.
    """
    if not sys.platform.startswith("linux"):
        _require(_try_to_draw("", "off"), "VTK cannot draw on this machine")
        return ""
    present = [name for name, libraries in _LIBRARIES.items() if any(map(_is_library, libraries))]
    if not present:
        raise RenderingError(
            "neither EGL nor OSMesa is installed, and without one of them VTK cannot draw; "
            "on Debian or Ubuntu: apt-get install libegl1 libgl1-mesa-dri (or libosmesa6)"
        )
    faults = {name: _try_to_draw(name, "off") for name in present}
    for name, fault in faults.items():
        if fault is None:
            return name
    raise RenderingError(
        f"VTK cannot draw here ({'; '.join(f'{name}: {fault}' for name, fault in faults.items())}); "
        "on Debian or Ubuntu: apt-get install libegl1 libgl1-mesa-dri"
    )


@cache
def check_display() -> None:
    """Check that a window can be opened.

    Raises:
        RenderingError: If there is no display, or no window can be opened on it.
    """
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        raise RenderingError("no window can be opened: there is no display, DISPLAY is not set")
    kind = _ON_DISPLAY if sys.platform.startswith("linux") else ""
    _require(_try_to_draw(kind, "on"), "no window can be opened")


def _require(fault: str | None, what: str) -> None:
    if fault is not None:
        raise RenderingError(f"{what} ({fault})")


def _is_library(name: str) -> bool:
    """Return whether a shared library can be loaded."""
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def _try_to_draw(window: str, screen: str) -> str | None:
    """Draw a small picture in a process of its own; return why that failed, None if it did not."""
    command = [sys.executable, "-c", _PROBE, screen]
    environment = os.environ | ({_CHOICE: window} if window else {})
    try:
        tried = subprocess.run(  # noqa: S603 -- ours
            command, capture_output=True, text=True, check=False, timeout=_TIMEOUT, env=environment
        )
    except subprocess.TimeoutExpired:
        return f"no picture within {_TIMEOUT:g} s"
    if tried.returncode == 0:
        return None
    if tried.returncode < 0:
        return f"the process was ended by signal {-tried.returncode}"
    return (tried.stderr.strip().splitlines() or ["the picture is empty"])[-1][:200]


@contextlib.contextmanager
def _choose(window: str) -> Iterator[None]:
    """Make VTK use one kind of window within the `with` block."""
    before = os.environ.get(_CHOICE)
    if window:
        os.environ[_CHOICE] = window
    try:
        yield
    finally:
        if window and before is None:
            del os.environ[_CHOICE]
        elif before is not None:
            os.environ[_CHOICE] = before
