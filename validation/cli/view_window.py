"""Window of the MuJoCo viewer that shows a simulation, with the live tactile image in a corner of the window."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from validation.render.image import Scale
from validation.scene.rendering import try_program

if TYPE_CHECKING:
    from validation.cli.view_scene import Scene

#: Shortest time between two drawings of the window [s].
DRAW_INTERVAL = 1 / 30
#: Distance of the tactile image from the window's corner [pixels].
MARGIN = 10
#: Largest edge of the tactile image in the window [pixels].
IMAGE_HEIGHT = 420
#: Azimuth of the viewer's camera [degrees]; the x axis points to the right, as in the tactile image.
AZIMUTH = 90.0
#: Elevation of the viewer's camera [degrees]; negative, so that it looks down.
ELEVATION = -40.0
#: Distance of the camera from the array, over the array's longer side [-].
CAMERA_DISTANCE = 2.5
#: Longest time to wait for a window to open, or for the viewer's threads to end [s].
TIMEOUT = 30.0
#: Program that tries to open a hidden window, and exits with the reason of a failure.  It runs in a separate process
#: before MuJoCo's viewer is started, because the viewer never returns if its window cannot be opened.
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


def find_window_fault() -> str | None:
    """Find out whether a window can be opened on this machine.

    Returns:
        The reason why no window can be opened; None if a window can be opened.
    """
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "there is no display: neither DISPLAY nor WAYLAND_DISPLAY is set"
    slow = f"the display did not answer within {TIMEOUT:g} s"
    return try_program(_PROBE, TIMEOUT, slow=slow, silent="no reason given")


class Window(contextlib.ExitStack):
    """The window of MuJoCo's viewer with a simulation, as a context manager.

    Call `find_window_fault` first, because the viewer never returns if no window can be opened.

    Args:
        scene: The simulation to show.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__()
        self._scene = scene
        self._viewer: Any = None
        self._next = time.monotonic()

    def __enter__(self) -> Self:
        """Open the window of the viewer and place its camera."""
        from mujoco import viewer

        others = set(threading.enumerate())
        self._viewer = viewer.launch_passive(
            self._scene.model, self._scene.data, show_left_ui=False, show_right_ui=False
        )
        # The process may crash if it ends while the viewer's threads draw.  At the end the window is therefore closed,
        # and the process waits for these threads.
        for thread in set(threading.enumerate()) - others:
            self.callback(thread.join, TIMEOUT)
        self.callback(self._viewer.close)
        with self._viewer.lock():
            camera = self._viewer.cam
            camera.azimuth, camera.elevation = AZIMUTH, ELEVATION
            camera.distance = CAMERA_DISTANCE * max(self._scene.sensor.parameters.array.extent)
        return self

    @property
    def is_open(self) -> bool:
        """Whether the window is open; a user can close it."""
        return bool(self._viewer.is_running())

    @property
    def is_due(self) -> bool:
        """Whether enough time has passed to draw the viewer's window again."""
        return time.monotonic() >= self._next

    def show(self, counts: npt.NDArray[np.integer], text: str) -> None:
        """Draw the present state of the simulation, the tactile image and a line of text.

        Args:
            counts: Counts of the n texels, shape (n,).
            text: The line of text.
        """
        import mujoco

        started = time.monotonic()
        parameters = self._scene.sensor.parameters
        scale = Scale(peak=parameters.electronics.output_max)
        image = scale.rgb(counts.reshape(-1, parameters.array.columns)[::-1])
        pixels = max(1, IMAGE_HEIGHT // max(image.shape))  # Texels are drawn as equal squares.
        image = image.repeat(pixels, axis=0).repeat(pixels, axis=1)
        rectangle = mujoco.MjrRect(MARGIN, MARGIN, image.shape[1], image.shape[0])
        self._viewer.set_images((rectangle, image))
        self._viewer.set_texts((None, mujoco.mjtGridPos.mjGRID_TOPLEFT, text.strip(), ""))
        self._viewer.sync()
        # On slow machines the next drawing is delayed, so that drawing takes at most a quarter of the time.
        now = time.monotonic()
        self._next = now + max(DRAW_INTERVAL, 3 * (now - started))
