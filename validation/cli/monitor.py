"""Live tactile image and rate on standard error: a picture on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import contextlib
import signal
import sys
import time
from collections.abc import Iterator
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np
import numpy.typing as npt

from validation.cli.output import say

if TYPE_CHECKING:
    from rich.live import Live
    from rich.text import Text

#: How often the picture is drawn, and a line written where there is no terminal [s].
_PICTURE, _LINE = 0.1, 5.0


class Monitor:
    """Shows the latest image and a line of text.

    Args:
        columns: Texels in a row.
        full_scale: Count that is drawn brightest.
        quiet: Whether to show nothing.
    """

    def __init__(self, *, columns: int, full_scale: int, quiet: bool = False) -> None:
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

            self._live = Live(console=Console(stderr=True), auto_refresh=False, transient=True)
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the display."""
        if self._live is not None:
            self._live.stop()

    @property
    def due(self) -> bool:
        """Whether it is time to show something."""
        return not self._quiet and time.monotonic() >= self._next

    def show(self, counts: npt.NDArray[np.integer], text: str) -> None:
        """Show an image, shape (n,), and a line below it."""
        self._next = time.monotonic() + (_PICTURE if self._live else _LINE)
        if self._live is None:
            say(text)
        else:
            self._live.update(self._picture(counts, text), refresh=True)

    def _picture(self, counts: npt.NDArray[np.integer], text: str) -> Text:
        from rich.text import Text

        picture = Text()
        rows = counts.reshape(-1, self._columns)[::-1]
        for row, colours in zip(rows.tolist(), heat(rows / self._full_scale).tolist(), strict=True):
            for count, (red, green, blue) in zip(row, colours, strict=True):
                legible = "black" if red > 191 else "white"  # noqa: PLR2004 -- legibility
                picture.append(f"{count:5d} ", style=f"{legible} on rgb({red},{green},{blue})")
            picture.append("\n")
        return picture.append(text)


def heat(shares: npt.NDArray[np.floating]) -> npt.NDArray[np.uint8]:
    """Colours from black over red to yellow, of shares of the full scale, any shape to (..., 3)."""
    level = np.sqrt(np.clip(shares, 0, 1))
    return np.asarray(np.rint(255 * np.stack([level, 0.72 * level**1.5, 0.25 * level**3], axis=-1)), dtype=np.uint8)


@contextlib.contextmanager
def stoppable() -> Iterator[None]:
    """Let a request to terminate end a command as Ctrl-C does, so that devices stop and files are completed."""

    def interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 -- a signal handler's arguments
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
