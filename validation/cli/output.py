"""Printing of a command's results on standard output, and of messages and progress on standard error."""

from __future__ import annotations

import contextlib
import math
import shutil
import sys
import textwrap
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

from validation.render import escape

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as RichProgress
    from rich.progress import TaskID

    from meshes import Cover, SolidCover
    from meshes.array_types import FloatArray
    from validation.render.table import Table

#: Largest width of the lines of a printed paragraph [characters].
WIDTH = 80
#: Smallest width of the lines of a printed paragraph, on a narrower terminal [characters].
_LEAST_WIDTH = 40
#: Smallest width of a printed table: on a narrower terminal its lines wrap, instead of losing columns [characters].
_LEAST_TABLE = 60
#: Shortest time between two lines of progress if standard error is no terminal [s].
LINE_INTERVAL = 2.0
#: Time per item below which items count as read from the store, so that they tell nothing about the others [s].
_STORED = 0.3
#: Time between two lines of text which state that a computation is still busy [s].
LONG = 10.0
#: Notes for the user that are printed at the end of a command that succeeds.
_notes: list[str] = []


def say(message: str) -> None:
    """Write a message for the user to standard error, on one line."""
    sys.stderr.write(f"{escape(message)}\n")


def note(message: str) -> None:
    """Keep a message for the user until the command has succeeded; a failed command writes only its fault."""
    _notes.append(message)


def say_notes() -> None:
    """Write the messages that `note` kept to standard error, each once."""
    for message in dict.fromkeys(_notes):
        say(f"softcover: note: {message}")
    forget_notes()


def forget_notes() -> None:
    """Drop the messages that `note` kept, without writing them."""
    _notes.clear()


def show(text: str) -> None:
    """Write one or more lines of the result to standard output."""
    for line in text.split("\n"):
        sys.stdout.write(f"{escape(line)}\n")


def show_wrapped(text: str, *, indent: str = "", further: str = "") -> None:
    """Write a paragraph to standard output in lines of at most 80 characters, fewer on a narrower terminal.

    Names, options and addresses are not divided, because users copy them.  A longer one has its own line.

    Args:
        text: The paragraph.
        indent: Start of the first line.
        further: Start of the other lines.
    """
    width = max(_LEAST_WIDTH, min(WIDTH, shutil.get_terminal_size().columns))
    wrapper = textwrap.TextWrapper(
        width, initial_indent=indent, subsequent_indent=further, break_long_words=False, break_on_hyphens=False
    )
    show(wrapper.fill(text))


def print_meaning(sentences: Iterable[str]) -> None:
    """Print an empty line, then each sentence on lines of its own."""
    show("")
    for sentence in sentences:
        show_wrapped(sentence)


def print_json(result: Mapping[str, Any]) -> None:
    """Write one JSON object to standard output and flush it, because a program may already wait for it."""
    from validation.json_values import json_text

    sys.stdout.write(f"{json_text(result)}\n")
    sys.stdout.flush()


def make_console() -> Console:
    """Return a console of the package rich for standard output.

    If the reader of the output has ended, it raises `BrokenPipeError`; rich itself would end the process.
    """
    from rich.console import Console

    class Output(Console):
        def on_broken_pipe(self) -> None:
            raise  # noqa: PLE0704 -- rich calls this where it has caught the error

    console = Output(highlight=False)
    console.width = max(console.width, _LEAST_TABLE)
    return console


def render(table: Table, *, lines: bool = True) -> None:
    """Print a table on standard output; without `lines` between its columns a wide table fits a narrow terminal."""
    make_console().print(table.to_rich(lines=lines))


def print_table(
    headings: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = "", left: int = 1, lines: bool = True
) -> None:
    """Print a table of texts on standard output.

    Args:
        headings: Headings of the columns; empty for rows of name and value.
        rows: Cells of each row.
        title: Line above the table.
        left: Number of columns, from the left, that are aligned to the left; the others are aligned to the right.
        lines: Whether vertical lines separate the columns.
    """
    from validation.render.table import Table

    render(Table(headings, rows, caption=title, texts=range(left)), lines=lines)


class Progress(contextlib.ExitStack):
    """Shows the current stage of a computation: a moving bar on a terminal, lines of text without one.

    Call the object with the name of a stage of unknown length.  Call `step` for each item of a stage of known length.
    Every ten seconds a line states what the computation is busy with, also during a stage without output.  The time
    left follows from that of finished items, which is told from the first one on.
    """

    def __init__(self) -> None:
        super().__init__()
        self._bar: RichProgress | None = None
        self._task: TaskID | None = None
        self._started = self._last_line = time.perf_counter()
        self._stage = ": start"
        self._first = (0, 0, 0.0)  # of the present items: number finished when they began, total, and time [s]
        self._finished = threading.Event()

    def __enter__(self) -> Self:
        """Start the moving bar if standard error is a terminal."""
        if sys.stderr.isatty():
            from rich import progress
            from rich.console import Console

            bar = progress.Progress(
                progress.SpinnerColumn(),
                progress.TextColumn("{task.description}", markup=False),
                progress.BarColumn(),
                progress.MofNCompleteColumn(),
                progress.TimeElapsedColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self._bar = self.enter_context(bar)
        else:
            thread = threading.Thread(target=self._tell_long, daemon=True)
            thread.start()
            self.callback(thread.join)
            self.callback(self._finished.set)
        return self

    def _tell_long(self) -> None:
        """Write a line with the current stage at regular intervals until the computation ends."""
        while not self._finished.wait(LONG):
            seconds = time.perf_counter() - self._started
            sys.stderr.write(f"[{seconds:5.1f} s] still busy with{self._stage}\n")

    def __call__(self, stage: str) -> None:
        """Show that a stage of unknown length begins; `stage` is its name."""
        self._show(stage, 0, None)

    def step(self, done: int, total: int, name: str) -> None:
        """Show that `done` of `total` items are finished and that the item `name` comes next."""
        self._show(name, done, total)

    def _describe_share(self, done: int, total: int) -> str:
        """Describe how many of the items are finished, and about how long the others take."""
        from validation.text.quantity import format_time

        now, (before, items, began) = time.perf_counter(), self._first
        if items != total or done < before or now - began < _STORED * (done - before):
            self._first = before, _, began = done, total, now
        left = "" if done == before else f", about {format_time((now - began) / (done - before) * (total - done))} left"
        return f" {done}/{total}" + (f" ({100 * done / total:.0f} %{left})" if 0 < done < total else "")

    def _show(self, text: str, done: int, total: int | None) -> None:
        text = escape(text)
        count = "" if total is None else self._describe_share(done, total)
        self._stage = f"{count}: {text}" if text else self._stage
        if self._bar is not None:
            if self._task is None:
                self._task = self._bar.add_task(text, total=total)
            self._bar.update(self._task, description=text, completed=done, total=total)
            return
        now = time.perf_counter()
        if text and now - self._last_line > LINE_INTERVAL:
            self._last_line = now
            sys.stderr.write(f"[{now - self._started:5.1f} s]{count} {text}\n")


#: Estimated relative error of the finite elements below which they count as good [-].
GOOD_ERROR = 0.01


def explain_error(estimates: Mapping[str, float], remedy: str) -> str:
    """Explain the largest error estimate of forces and depth, and name its quantity and a remedy if it is large.

    The area of the touch has a sentence of its own: of a small touch it is uncertain where forces and depth are not.

    Args:
        estimates: Estimated relative errors of the finite elements by quantity [-]; NaN if not known.
        remedy: What the user can do about a large error.
    """
    known = {_name_estimate(name): value for name, value in estimates.items() if not math.isnan(value)}
    area = known.pop("contact area", 0.0)
    if not known:
        return "No error of the finite elements is known: there is one mesh only."
    name = max(known, key=lambda each: known[each])
    sentence = (
        f"The finite elements state an error of at most {100 * known[name]:.2g} % ({name}; good: below "
        f"{100 * GOOD_ERROR:.0f} %)"
    )
    sentence += "." if known[name] <= GOOD_ERROR else f": {remedy}."
    return sentence if area <= GOOD_ERROR else f"{sentence} The area of the touch is known to {100 * area:.2g} % only."


#: Printed names of quantities with an error estimate, by their key in JSON, where the two differ.
_ESTIMATED = {"peak_texel": "largest texel", "sigma": "width of the kernel"}


def _name_estimate(key: str) -> str:
    return _ESTIMATED.get(key, key.replace("_", " "))


def describe_errors(estimates: Mapping[str, float]) -> str:
    """Describe error estimates [-] in one line, in percent and with the names of their quantities; NaN is left out."""
    texts = [
        f"{_name_estimate(name)} {100 * value:.2g} %" for name, value in estimates.items() if not math.isnan(value)
    ]
    return ", ".join(texts) or "none: there is one mesh only"


def describe_vector(force: Sequence[float] | FloatArray) -> str:
    """Describe the net force on an array, shape (3,) [N], for the line of text below a live image."""
    return "net force ({:.2f}, {:.2f}, {:.2f}) N".format(*force)


def describe_cover(cover: Cover | SolidCover) -> str:
    """Describe a cover in one line of text, which begins with ASSUMED if the real cover was never measured."""
    layers = " + ".join(
        f"{1e3 * layer.thickness:.4g} mm {layer.material.name} "
        f"(E {layer.material.youngs_modulus / 1e6:.4g} MPa, nu {layer.material.poisson_ratio:.4g})"
        for layer in cover.layers
    )
    if cover.size is not None:
        layers += ", {:.4g} x {:.4g} mm, free side edges".format(*(1e3 * edge for edge in cover.size))
    if cover.source:
        layers += f"; {cover.source}"
    return f"ASSUMED: {layers}" if cover.assumed else layers
