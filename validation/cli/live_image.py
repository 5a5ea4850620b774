"""Live tactile image of a sensor, a recording or a simulation, shown in the terminal on standard error."""

from __future__ import annotations

import contextlib
import sys
import time
from typing import TYPE_CHECKING, Self

from validation.cli.output import say

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from rich.live import Live

#: Shortest time between two live images on a terminal [s].
PICTURE_INTERVAL = 0.1
#: Shortest time between two lines of text if the output is not a terminal [s].
LINE_INTERVAL = 5.0


class LiveImage(contextlib.ExitStack):
    """Shows the latest tactile image and a line of text on a terminal; without a terminal, only the line of text.

    Args:
        columns: Number of texels in a row [-].
        full_scale: Number of counts that is drawn with the brightest colour [counts].
        quiet: Whether to show nothing at all.
    """

    def __init__(self, *, columns: int = 1, full_scale: int = 1, quiet: bool = False) -> None:
        super().__init__()
        self.set_up(columns, full_scale)
        self._quiet = quiet
        self._live: Live | None = None
        self._next = time.monotonic()

    def set_up(self, columns: int, full_scale: int) -> None:
        """Set the number of texels in a row of the image, and the counts that have the brightest colour [counts]."""
        self._columns, self._full_scale = columns, full_scale

    def __enter__(self) -> Self:
        """Start to show live images if standard error is a terminal."""
        if sys.stderr.isatty() and not self._quiet:
            from rich.console import Console
            from rich.live import Live

            live = Live(console=Console(stderr=True), auto_refresh=False, transient=True)
            self._live = self.enter_context(live)
        return self

    #: Whether the display is still open: always, because a user can close the viewer's window, but not this display.
    is_open = True

    @property
    def is_due(self) -> bool:
        """Whether enough time has passed to show the next live image or line of text."""
        return not self._quiet and time.monotonic() >= self._next

    def show(self, counts: npt.NDArray[np.integer], text: str) -> None:
        """Show a tactile image and a line of text below the image.

        Args:
            counts: Counts of the n texels, shape (n,).
            text: The line of text.
        """
        self._next = time.monotonic() + (PICTURE_INTERVAL if self._live else LINE_INTERVAL)
        if self._live is None:
            say(text)
            return
        from validation.cli.heat_map import draw_heat_map
        from validation.render.image import Scale

        image = counts.reshape(-1, self._columns)
        scale = Scale(peak=self._full_scale, unit="", factor=1)
        self._live.update(draw_heat_map(image, scale).append(text), refresh=True)
