"""Tables of results: rendered to the terminal, to CSV and, by the template of the report's page, to HTML.

The printed form of a field of a result is its `Column`, see `validation.results`.  A table is made in three ways:
`tabulate` makes one row for each result, `tabulate_facts` makes one row for each field of a result and of the results
within it, and `Table` takes headings and rows of texts.  `validation.cli.output.render` prints a table.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from validation.render import escape
from validation.results import DASH, Column, Result, columns

if TYPE_CHECKING:
    from rich.table import Table as RichTable

    from validation.pooling import Pooled


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A cell of a table.

    Attributes:
        text: Printed text.
        value: The number behind the text as `report.json` has it, for sorting and CSV; None for text.
        small: A second, smaller line.
        bold: Whether the text is emphasised.
    """

    text: str
    value: float | None = None
    small: str = ""
    bold: bool = False


class Table:
    """A table of results; the first column names the row.

    Args:
        headings: Headings of the columns, with units; empty for a list of names and values.
        rows: Cells of each row; a text stands for a cell that shows it.
        caption: Caption of the table.
        name: Identifier of the table on the page.
        texts: Indices of further columns that hold text, which is aligned to the left.
    """

    def __init__(
        self,
        headings: Sequence[str],
        rows: Iterable[Sequence[Cell | str]],
        *,
        caption: str = "",
        name: str = "",
        texts: Sequence[int] = (),
    ) -> None:
        self.headings, self.caption, self.name, self.texts = headings, caption, name, texts
        self.rows = [[cell if isinstance(cell, Cell) else Cell(text=cell) for cell in row] for row in rows]

    def to_csv(self) -> str:
        """Return the table as CSV: numbers unrounded and in SI units as in `report.json`, other cells as printed."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.headings)
        writer.writerows([cell.text if cell.value is None else cell.value for cell in row] for row in self.rows)
        return out.getvalue()

    def to_rich(self, *, lines: bool = True) -> RichTable:
        """Return the table for a terminal; the smaller second line of a cell stands in brackets behind its first line.

        Args:
            lines: Whether vertical lines separate the columns; without them a wide table fits a narrow terminal.
        """
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        # Strings are converted to `Text`, because rich would parse plain strings in a table for markup.
        table = RichTable(
            title=Text(escape(self.caption)) if self.caption else None,
            show_header=bool(self.headings),
            box=box.HEAVY_HEAD if lines else box.SIMPLE_HEAD,
            padding=(0, 1) if lines else (0, 1, 0, 0),
        )
        for index, heading in enumerate(self.headings or ("", "")):
            left = index == 0 or index in self.texts or not self.headings
            table.add_column(
                Text(escape(heading)), justify="left" if left else "right", no_wrap=index == 0, overflow="fold"
            )
        for row in self.rows:
            table.add_row(*(Text(escape(f"{c.text} ({c.small})" if c.small else c.text)) for c in row))
        return table


def tabulate(name: str, caption: str, results: Iterable[Result], shown: type[Result], fields: Sequence[str]) -> Table:
    """Make a table with one row for each result; the `Column` of a field defines how the field is printed.

    Args:
        name: Identifier of the table.
        caption: Caption of the table.
        results: The results.
        shown: Type of the results.
        fields: Names of the fields or properties that are shown.
    """
    known = columns(shown)
    headings: list[str] = []
    texts: list[int] = []
    for field in fields:
        column = known[field]
        parts = column.parts or (column.heading,)
        texts += [len(headings)] if column.words and headings else []
        headings += [f"{part} [{column.unit}]" if column.unit else part for part in parts]
    rows = [[cell for field in fields for cell in _make_cells(each, field, known[field])] for each in results]
    return Table(name=name, caption=caption, headings=headings, rows=rows, texts=texts)


def tabulate_facts(name: str, caption: str, result: Result) -> Table:
    """Make a table of two columns, quantity and value, of all fields with a `Column` of a result and of results in it.

    A field without a value has no row; a mapping has a row for each of its entries.

    Args:
        name: Identifier of the table.
        caption: Caption of the table.
        result: The result.
    """
    return Table(name=name, caption=caption, headings=("quantity", "value"), rows=list(_walk_facts(result)))


def _walk_facts(result: Result) -> Iterator[list[Cell]]:
    known = columns(type(result))
    for field in dict.fromkeys((*(each.name for each in dataclasses.fields(result)), *known)):  # type: ignore[arg-type]
        value, column = getattr(result, field), known.get(field)
        if isinstance(value, Result):
            yield from _walk_facts(value)
        if column is None or value is None:
            continue
        named = {column.heading: value}
        if isinstance(value, Mapping):
            named = {f"{column.heading} {key.replace('_', ' ')}": each for key, each in value.items()}
        elif column.parts:
            named = dict(zip(column.parts, value, strict=True))
        for heading, each in named.items():
            label = Cell(text=f"{heading} [{column.unit}]" if column.unit else heading)
            if isinstance(each, str):
                yield [label, Cell(text=each)]
            elif isinstance(each, tuple):
                yield [label, Cell(text=", ".join(map(column.text, each)))]
            else:
                yield [label, Cell(text=column.text(each), value=None if math.isnan(each) else each)]


def _make_cells(item: Result, field: str, column: Column) -> list[Cell]:
    value: Any = getattr(item, field)
    factor = getattr(item, column.factor_field) if column.factor_field else column.factor
    if column.parts:
        return [number(each, factor, column.digits) for each in value]
    small = column.small.format(item)
    if column.words:
        return [Cell(text=column.words[value], small=small, bold=value in column.alarms)]
    if isinstance(value, str):
        return [Cell(text=value, small=small)]
    return [number(value, factor, column.digits, small)]


def number(
    value: float | None,
    factor: float = 1.0,
    digits: int = 3,
    small: str = "",
    unit: str = "",
    *,
    column: Column | None = None,
) -> Cell:
    """Make the cell of a number; a dash if it is None or NaN.

    Args:
        value: The number, in the unit of `report.json`.
        factor: Factor to the printed unit [-].
        digits: Number of significant digits [-].
        small: A second, smaller line.
        unit: Printed unit, where the heading of the column does not name it.
        column: Format of the number, instead of factor and digits.
    """
    if value is None or math.isnan(value):
        return Cell(text=DASH, small=small)
    text = (column or Column(heading="", factor=factor, digits=digits)).text(value)
    return Cell(text=f"{text} {unit}".strip(), value=value, small=small)


def interval(pooled: Pooled, column: Column) -> Cell:
    """Make the cell of a mean over cases, with its confidence interval on a second, smaller line."""
    if math.isnan(pooled.mean):
        return Cell(text=DASH)
    ends = f"{column.text(pooled.low)} to {column.text(pooled.high)}"
    small = pooled.describe() if math.isnan(pooled.low) else ends
    return Cell(text=column.text(pooled.mean), value=pooled.mean, small=small)
