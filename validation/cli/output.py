"""Printing of a command's results on standard output, and of messages on standard error."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

    from meshes import Cover, SolidCover
    from meshes.array_types import FloatArray


#: Largest width of printed lines of text [characters].
WIDTH = 80
#: Largest number of characters of a text from a file that is printed, and how many of them are from its end [-]; the
#: middle of a longer text is left out.  A message ends with the reason.
_LONGEST, _END = 2000, 200


def escape(text: str) -> str:
    r"""Replace characters of a text that could steer a terminal, such as escape sequences, by `\x1b` and the like.

    Names and notes come from files that strangers wrote.  All characters that are not printable are replaced, also
    those that change the direction of writing; the middle of a text of more than
    2000 characters is left out.
    """
    cut = text
    if len(text) > _LONGEST:
        cut = f"{text[: _LONGEST - _END]}... ({len(text)} characters) ...{text[-_END:]}"
    return cut if cut.isprintable() else "".join(map(_escape_character, cut))


def _escape_character(character: str) -> str:
    return character if character.isprintable() else character.encode("unicode_escape").decode()


def say(message: str) -> None:
    """Write a message for the user to standard error, on one line."""
    sys.stderr.write(f"{escape(message)}\n")


#: Notes that are written when the command has succeeded.
_notes: list[str] = []


def note(message: str) -> None:
    """Keep a message for the user until the command has succeeded; a command with a fault writes its fault only."""
    _notes.append(message)


def say_notes() -> None:
    """Write the kept messages to standard error, each once."""
    for message in dict.fromkeys(_notes):
        say(f"softcover: note: {message}")
    forget_notes()


def forget_notes() -> None:
    """Drop the kept messages."""
    _notes.clear()


def show(text: str) -> None:
    """Write one or more lines of the result to standard output."""
    for line in text.split("\n"):
        sys.stdout.write(f"{escape(line)}\n")


def show_wrapped(text: str, *, indent: str = "", further: str = "") -> None:
    """Write a paragraph to standard output in lines of at most 80 characters.

    Names, options and addresses are never divided, because users copy them; a longer one has a line of its own.

    Args:
        text: The paragraph.
        indent: Start of the first line.
        further: Start of the other lines.
    """
    show(
        textwrap.fill(
            text,
            WIDTH,
            initial_indent=indent,
            subsequent_indent=further,
            break_long_words=False,
            break_on_hyphens=False,
        )
    )


def print_json(result: Mapping[str, Any]) -> None:
    """Write one JSON object to standard output, at once: a program may wait for it while the command still runs."""
    from validation.json_values import json_text

    sys.stdout.write(f"{json_text(result)}\n")
    sys.stdout.flush()


def describe_vector(force: Sequence[float] | FloatArray) -> str:
    """Describe the net force on an array, shape (3,) [N], for the line of a live image."""
    x, y, z = force
    return f"net force ({x:.2f}, {y:.2f}, {z:.2f}) N"


def make_console() -> Console:
    """Return a console of rich for standard output that raises `BrokenPipeError` instead of ending the process."""
    from rich.console import Console

    class Output(Console):
        def on_broken_pipe(self) -> None:
            raise  # noqa: PLE0704 -- rich calls this where it has caught the error

    return Output(highlight=False)


def print_rows(rows: Iterable[tuple[str, str]], *, title: str | None = None) -> None:
    """Print a table of two columns, name and value; a row with an empty name continues the row above."""
    print_table(None, rows, title=title, left=2)


def print_table(
    headings: Sequence[str] | None,
    rows: Iterable[Sequence[str | Text]],
    *,
    title: str | None = None,
    caption: str | None = None,
    left: int = 1,
    lines: bool = True,
) -> None:
    """Print a table on standard output.

    Args:
        headings: Headings of the columns; None for two columns without headings.
        rows: Cells of each row; strings are printed as they are, without markup.
        title: Line above the table.
        caption: Line below the table.
        left: Number of columns, from the left, that are aligned to the left; the others are aligned to the right.
        lines: Whether vertical lines separate the columns; without them a wide table fits a narrow terminal.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=title and Text(escape(title)),
        caption=caption and Text(escape(caption)),
        show_header=headings is not None,
        box=box.HEAVY_HEAD if lines else box.SIMPLE_HEAD,
        padding=(0, 1) if lines else (0, 1, 0, 0),
    )
    for index, heading in enumerate(headings or ("", "")):
        table.add_column(
            Text(escape(heading)), justify="left" if index < left else "right", no_wrap=index == 0, overflow="fold"
        )
    for row in rows:
        # Strings are converted to `Text`, because rich would parse plain strings in a table for markup.
        table.add_row(*(Text(escape(cell)) if isinstance(cell, str) else cell for cell in row))
    make_console().print(table)


#: Names of the quantities of error estimates for people, where they differ from those in JSON.
_ESTIMATED = {"peak_texel": "largest texel", "sigma": "width of the kernel"}


def describe_errors(estimates: Mapping[str, float]) -> str:
    """Describe error estimates by the names of their quantities; fractions become percent."""
    return ", ".join(
        f"{_ESTIMATED.get(name, name.replace('_', ' '))} {100 * value:.2g} %" for name, value in estimates.items()
    )


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
