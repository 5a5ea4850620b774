"""Display of a computation's progress on standard error: a moving bar on a terminal, lines of text without one.

A computation that is not finished after half a minute says so, also within a stage that says nothing itself.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from typing import TYPE_CHECKING, Self

from validation.cli.output import escape

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress
    from rich.progress import TaskID

#: Shortest time between two lines of text, without a terminal [s].
LINE_INTERVAL = 2.0
#: Time between two lines which say that the computation takes long [s].
LONG = 30.0


class Progress(contextlib.ExitStack):
    """Shows the current stage of a computation.

    Call the object with the name of a stage of unknown length; call `step` for each item of a stage of known length.
    """

    def __init__(self) -> None:
        super().__init__()
        self._bar: RichProgress | None = None
        self._task: TaskID | None = None
        self._started = time.perf_counter()
        self._last_line = self._started
        self._stage = "start"
        self._finished = threading.Event()

    def __enter__(self) -> Self:
        """Start the moving bar if standard error is a terminal."""
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
            from rich.progress import Progress as Bar

            columns = (
                SpinnerColumn(),
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                MofNCompleteColumn(),
            )
            bar = Bar(*columns, TimeElapsedColumn(), console=Console(stderr=True), transient=True)
            self._bar = self.enter_context(bar)
        else:
            thread = threading.Thread(target=self._tell_long, daemon=True)
            thread.start()
            self.callback(thread.join)
            self.callback(self._finished.set)
        return self

    def _tell_long(self) -> None:
        """Write a line at regular intervals until the computation ends."""
        while not self._finished.wait(LONG):
            seconds = time.perf_counter() - self._started
            sys.stderr.write(f"[{seconds:5.1f} s] this takes long; still busy with: {self._stage}\n")

    def __call__(self, stage: str) -> None:
        """Show that a stage of unknown length begins; `stage` is its name."""
        self._show(stage, 0, None)

    def step(self, done: int, total: int, name: str) -> None:
        """Show that `done` of `total` items are finished and that the item `name` comes next."""
        self._show(name, done, total)

    def _show(self, text: str, done: int, total: int | None) -> None:
        text = escape(text)
        self._stage = text or self._stage
        if self._bar is not None:
            if self._task is None:
                self._task = self._bar.add_task(text, total=total)
            self._bar.update(self._task, description=text, completed=done, total=total)
            return
        now = time.perf_counter()
        if text and now - self._last_line > LINE_INTERVAL:
            self._last_line = now
            count = "" if total is None else f" {done}/{total}"
            sys.stderr.write(f"[{now - self._started:5.1f} s]{count} {text}\n")
