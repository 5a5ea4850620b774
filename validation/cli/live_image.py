"""A live tactile image on standard error, and a way to end a running command by a signal."""

from __future__ import annotations

import contextlib
import signal
import sys
import time
from collections.abc import Iterator
from types import FrameType
from typing import TYPE_CHECKING, Self

from validation.cli.output import say

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from rich.live import Live

#: Time between two pictures on a terminal, and between two lines where there is no terminal [s].
PICTURE_INTERVAL, LINE_INTERVAL = 0.1, 5.0


class LiveImage(contextlib.ExitStack):
    """Shows the latest image and a line of text on a terminal; where there is no terminal, only the line.

    Args:
        columns: Texels in a row.
        full_scale: Count that is drawn with the brightest colour.
        quiet: Show nothing at all.
    """

    def __init__(self, *, columns: int, full_scale: int, quiet: bool = False) -> None:
        super().__init__()
        self._columns = columns
        self._full_scale = full_scale
        self._quiet = quiet
        self._live: Live | None = None
        self._next = time.monotonic()

    def __enter__(self) -> Self:
        """Start the display."""
        if sys.stderr.isatty() and not self._quiet:
            from rich.console import Console
            from rich.live import Live

            live = Live(console=Console(stderr=True), auto_refresh=False, transient=True)
            self._live = self.enter_context(live)
        return self

    #: Whether the display is still there; only a window can be closed by the user.
    is_open = True

    @property
    def is_due(self) -> bool:
        """Whether it is time to show the next image or line."""
        return not self._quiet and time.monotonic() >= self._next

    def show(self, counts: npt.NDArray[np.integer], text: str) -> None:
        """Show the counts of all texels, shape (n,), and a line of text below them."""
        self._next = time.monotonic() + (PICTURE_INTERVAL if self._live else LINE_INTERVAL)
        if self._live is None:
            say(text)
            return
        from validation.cli.heat_map import draw_heat_map

        image = counts.reshape(-1, self._columns)
        self._live.update(draw_heat_map(image, image / self._full_scale).append(text), refresh=True)


@contextlib.contextmanager
def interrupt_on_terminate() -> Iterator[None]:
    """Treat SIGTERM like Ctrl-C, so that the device is stopped and the file completed before the command ends."""

    def interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 -- the signature of a signal handler
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
