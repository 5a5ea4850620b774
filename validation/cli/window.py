"""The MuJoCo viewer's window on a simulation, with the live tactile image in its corner."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from validation.cli.monitor import heat

if TYPE_CHECKING:
    from validation.cli.sliding import Sliding

#: How often the window is drawn [s].
_PERIOD = 1 / 30
#: Distance of the image from the window's corner, and its height at most [pixels].
_BORDER, _HEIGHT = 10, 420
#: Where the camera looks to [degrees]: x is to the right, as in the image.  Its distance over the array's longer side.
_AZIMUTH, _ELEVATION, _DISTANCE = 90.0, -40.0, 2.5
#: The viewer waits for ever for a window that cannot be opened; so another process tries first, for so long [s].
_PATIENCE = 30.0
_PROBE = """
import glfw, sys
glfw.ERROR_REPORTING = "ignore"
if glfw.init():
    glfw.window_hint(glfw.VISIBLE, False)
    if glfw.create_window(8, 8, "", None, None):
        sys.exit()
_, reason = glfw.get_error()
sys.exit(reason.decode() if reason else "no reason given")
"""


def why_no_window() -> str | None:
    """Why no window can be opened here; None where one can."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "there is no display: neither DISPLAY nor WAYLAND_DISPLAY is set"
    try:
        tried = subprocess.run(  # noqa: S603 -- our own code
            [sys.executable, "-c", _PROBE], capture_output=True, text=True, check=False, timeout=_PATIENCE
        )
    except subprocess.TimeoutExpired:
        return f"the display did not answer within {_PATIENCE:g} s"
    if tried.returncode == 0:
        return None
    return (tried.stderr.strip().splitlines() or ["no reason given"])[-1]


class Window:
    """The viewer's window on a scene, in a `with` block; `why_no_window` tells beforehand whether it can open.

    Args:
        scene: What to show.
    """

    def __init__(self, scene: Sliding) -> None:
        self._scene = scene
        self._viewer: Any = None
        self._drawing: set[threading.Thread] = set()
        self._next = time.monotonic()

    def __enter__(self) -> Self:
        """Open the window."""
        from mujoco import viewer

        others = set(threading.enumerate())
        self._viewer = viewer.launch_passive(
            self._scene.model, self._scene.data, show_left_ui=False, show_right_ui=False
        )
        self._drawing = set(threading.enumerate()) - others
        with self._viewer.lock():
            camera = self._viewer.cam
            camera.azimuth, camera.elevation = _AZIMUTH, _ELEVATION
            camera.distance = _DISTANCE * max(self._scene.sensor.parameters.array.extent)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the window and wait until it is gone: a program that ends while it is drawn may crash."""
        self._viewer.close()
        for thread in self._drawing:
            thread.join(_PATIENCE)

    @property
    def open(self) -> bool:
        """Whether nobody has closed it yet."""
        return bool(self._viewer.is_running())

    @property
    def due(self) -> bool:
        """Whether it is time to draw."""
        return time.monotonic() >= self._next

    def show(self, text: str) -> None:
        """Draw the scene as it is, its tactile image, and a line of text."""
        import mujoco

        started = time.monotonic()
        sensor = self._scene.sensor
        frame = sensor.frame()
        image = _enlarged(frame.counts.reshape(frame.image.shape), sensor.parameters.electronics.output_max)
        place = mujoco.MjrRect(_BORDER, _BORDER, image.shape[1], image.shape[0])
        self._viewer.set_images((place, image))
        self._viewer.set_texts((None, mujoco.mjtGridPos.mjGRID_TOPLEFT, text, ""))
        self._viewer.sync()
        # Where drawing is slow, the simulation still gets most of the time.
        now = time.monotonic()
        self._next = now + max(_PERIOD, 3 * (now - started))


def _enlarged(counts: npt.NDArray[np.int64], full_scale: int) -> npt.NDArray[np.uint8]:
    """The tactile image as a picture, uppermost pixels first: row 0 is at the bottom, shape (height, width, 3)."""
    pixels = max(1, _HEIGHT // max(counts.shape))
    return heat(counts[::-1] / full_scale).repeat(pixels, axis=0).repeat(pixels, axis=1)
