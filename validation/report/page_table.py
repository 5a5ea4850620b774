"""Tables of the report's page: cells with their text and the number behind it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from validation.campaign.pooling import Pooled
from validation.results import Column


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A cell of a table.

    Attributes:
        text: What is printed.
        value: The number behind the text as `report.json` has it, for sorting; None for text.
        small: A second, smaller line.
        bold: Whether the text is emphasised.
    """

    text: str
    value: float | None = None
    small: str = ""
    bold: bool = False


@dataclass(frozen=True, kw_only=True)
class PageTable:
    """A table of the page.  The first column names the row.

    Attributes:
        name: Identifier of the table on the page.
        caption: What the table shows.
        headings: Headings of the columns.
        rows: Cells of each row.
        texts: Indices of further columns that hold text, which is aligned to the left.
    """

    name: str
    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    texts: tuple[int, ...] = ()


def number(value: float | None, factor: float = 1.0, digits: int = 3, small: str = "", unit: str = "") -> Cell:
    """Make the cell of a number; a dash if it is None or NaN.

    Args:
        value: The number, in the unit of `report.json`.
        factor: Factor to the printed unit [-].
        digits: Number of significant digits [-].
        small: A second, smaller line.
        unit: Printed unit, where the heading of the column does not name it.
    """
    if value is None or math.isnan(value):
        return Cell(text="\u2013", small=small)
    return Cell(text=f"{_format(factor * value, digits)} {unit}".strip(), value=value, small=small)


def interval(pooled: Pooled, metric: Column) -> Cell:
    """Make the cell of a mean, with its interval on a second line."""
    if math.isnan(pooled.mean):
        return Cell(text="\u2013")
    ends = f"{metric.text(pooled.low)} to {metric.text(pooled.high)}"
    return Cell(text=metric.text(pooled.mean), value=pooled.mean, small=ends)


def head(metric: Column) -> str:
    """Return the heading of a metric's column, with its unit."""
    return f"{metric.heading} [{metric.unit}]" if metric.unit else metric.heading


def _format(value: float, digits: int) -> str:
    """Format a number with significant digits, without exponent from 1e-4 to 1e6."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else "inf"
    if not 1e-4 <= abs(value) < 1e6:  # noqa: PLR2004 -- as the docstring says
        return f"{value:.{digits - 1}e}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}"
