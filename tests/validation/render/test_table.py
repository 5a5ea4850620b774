"""Tables of results: every kind of field in the terminal, in CSV and in lists of facts."""

import csv
import io
import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

import pytest
from rich import box

from validation.pooling import Pooled
from validation.render import escape
from validation.render.table import Cell, Table, interval, number, tabulate, tabulate_facts
from validation.results import Column, Number, Result, result_model

DASH = "\u2013"


@result_model
class Inner(Result):
    depth: Annotated[Number, Column(heading="depth", unit="mm", factor=1e3)]
    hidden: float = 1.0


@result_model
class Row(Result):
    name: Annotated[str, Column(heading="case", small="of {0.kind}")]
    kind: Annotated[str, Column(heading="kind")]
    state: Annotated[
        str, Column(heading="state", words={"ok": "fine", "no": "bad"}, alarms=("no",), small="x{0.scale}")
    ]
    ends: Annotated[tuple[float, float], Column(heading="", unit="mm", factor=1e3, digits=2, parts=("low", "high"))]
    value: Annotated[Number, Column(heading="value", digits=4, factor_field="scale", small="limit {0.scale:g}")]
    scale: float
    share: Annotated[Number | None, Column(heading="share", unit="%", factor=100)] = None
    pair: Annotated[tuple[float, ...], Column(heading="pair", unit="N", digits=2)] = (1.0, 2.25)
    by_name: Annotated[Mapping[str, float] | None, Column(heading="error", unit="%", factor=100)] = None
    inner: Inner | None = None
    printed: ClassVar[Mapping[str, Column]] = {"twice": Column(heading="twice")}

    @property
    def twice(self):
        return 2 * self.value


ROWS = (
    Row(name="a", kind="ball", state="ok", ends=(1.234e-3, 5.678e-3), value=0.123456, scale=10.0, share=0.25),
    Row(name="b", kind="box", state="no", ends=(0.0, math.nan), value=math.nan, scale=1000.0),
)


def test_each_kind_of_field_has_its_cell():
    fields = ("name", "kind", "state", "ends", "value", "share", "twice")
    table = tabulate("t", "a caption", ROWS, Row, fields)
    assert (table.name, table.caption) == ("t", "a caption")
    assert table.headings == ["case", "kind", "state", "low [mm]", "high [mm]", "value", "share [%]", "twice"]
    assert list(table.texts) == [2]  # words stand to the left
    first, second = table.rows
    assert first == [
        Cell(text="a", small="of ball"), Cell(text="ball"), Cell(text="fine", small="x10.0"),
        Cell(text="1.2", value=1.234e-3), Cell(text="5.7", value=5.678e-3),
        Cell(text="1.235", value=0.123456, small="limit 10"), Cell(text="25.0", value=0.25),
        Cell(text="0.247", value=0.246912),
    ]  # fmt: skip
    assert second == [
        Cell(text="b", small="of box"), Cell(text="box"), Cell(text="bad", small="x1000.0", bold=True),
        Cell(text="0", value=0.0), Cell(text=DASH), Cell(text=DASH, small="limit 1000"), Cell(text=DASH),
        Cell(text=DASH),
    ]  # fmt: skip
    assert list(tabulate("t", "", ROWS, Row, ("state", "kind")).texts) == []  # the first column is to the left anyway


def test_facts_are_those_of_a_result_and_of_the_results_in_it():
    row = Row(
        name="a", kind="ball", state="ok", ends=(1e-3, 2e-3), value=3.0, scale=2.0,
        by_name={"peak_texel": 0.5, "sum": 0.0}, inner=Inner(depth=4.5e-4),
    )  # fmt: skip
    table = tabulate_facts("facts", "about it", row)
    assert (table.name, table.caption, table.headings) == ("facts", "about it", ("quantity", "value"))
    assert [(label.text, cell.text, cell.value) for label, cell in table.rows] == [
        ("case", "a", None), ("kind", "ball", None), ("state", "ok", None), ("low [mm]", "1.0", 1e-3),
        ("high [mm]", "2.0", 2e-3), ("value", "3.000", 3.0), ("pair [N]", "1.0, 2.2", None),
        ("error peak texel [%]", "50.0", 0.5), ("error sum [%]", "0", 0.0), ("depth [mm]", "0.450", 4.5e-4),
        ("twice", "6.00", 6.0),
    ]  # fmt: skip
    unknown = tabulate_facts("facts", "", Inner(depth=math.nan))
    assert [(cell.text, cell.value) for _, cell in unknown.rows] == [(DASH, None)]


def test_a_file_has_unrounded_numbers_and_printed_texts():
    table = Table(("case", "a", "b"), [("x,y", Cell(text="1.2", value=1.23456789e-3), Cell(text=DASH, small="why"))])
    rows = list(csv.reader(io.StringIO(table.to_csv())))
    assert rows == [["case", "a", "b"], ["x,y", "0.00123456789", DASH]]
    assert table.to_csv().endswith("\n")
    assert "\r" not in table.to_csv()


def test_a_terminal_shows_the_second_line_in_brackets_and_numbers_to_the_right():
    rows = [("x\x1b", Cell(text="1.2", small="2 to 3"), "word", Cell(text="5", bold=True))]
    table = Table(("case", "a", "b [red]", "c"), rows, caption="about \x1b", texts=(2,)).to_rich()
    assert table.title.plain == "about \\x1b"
    assert table.show_header
    assert (table.box, table.padding) == (box.HEAVY_HEAD, (0, 1, 0, 1))
    assert [column.header.plain for column in table.columns] == ["case", "a", "b [red]", "c"]
    assert [column.justify for column in table.columns] == ["left", "right", "left", "right"]
    assert [column.no_wrap for column in table.columns] == [True, False, False, False]
    assert {column.overflow for column in table.columns} == {"fold"}
    assert [next(iter(column.cells)).plain for column in table.columns] == ["x\\x1b", "1.2 (2 to 3)", "word", "5"]


def test_a_narrow_terminal_shows_no_vertical_lines_and_a_list_of_facts_no_headings():
    table = Table((), [("name", Cell(text="1", value=1.0))]).to_rich(lines=False)
    assert table.title is None
    assert not table.show_header
    assert (table.box, table.padding) == (box.SIMPLE_HEAD, (0, 1, 0, 0))
    assert [column.justify for column in table.columns] == ["left", "left"]
    assert [column.no_wrap for column in table.columns] == [True, False]


@pytest.mark.parametrize(
    ("given", "options", "cell"),
    [
        (0.012345, {}, ("0.0123", "")), (0.012345, {"factor": 100.0, "digits": 2}, ("1.2", "")),
        (0.5, {"unit": "mm", "small": "x"}, ("0.500 mm", "x")), (None, {"small": "x", "unit": "mm"}, (DASH, "x")),
        (math.nan, {}, (DASH, "")), (0.0, {"unit": "N"}, ("0 N", "")),
        (0.25, {"column": Column(heading="", factor=10, decimals=3)}, ("2.500", "")),
    ],
)  # fmt: skip
def test_a_number_is_printed_in_its_unit_and_kept_as_it_is(given, options, cell):
    found = number(given, **options)
    assert (found.text, found.small, found.bold) == (*cell, False)
    assert found.value == (None if given is None or math.isnan(given) else given)


@pytest.mark.parametrize(
    ("pooled", "cell"),
    [
        ((0.2, 0.15, 0.3, 6), ("20.0", "15.0 to 30.0", 0.2)),
        ((0.2, math.nan, math.nan, 2), ("20.0", "2 cases, no interval", 0.2)),
        ((math.nan, math.nan, math.nan, 0), (DASH, "", None)),
        ((0.2, math.nan, math.nan, 4), ("20.0", "the same in all 4 cases", 0.2)),
    ],
)  # fmt: skip
def test_a_mean_has_its_interval_or_the_reason_why_there_is_none(pooled, cell):
    mean, low, high, cases = pooled
    found = interval(Pooled(mean=mean, low=low, high=high, level=0.95, cases=cases), Column(heading="", factor=100))
    assert (found.text, found.small, found.value) == cell


@pytest.mark.parametrize("length", [1999, 2000, 2001, 5000])
def test_a_text_of_more_than_2000_characters_loses_its_middle(length):
    text = "".join(chr(97 + k % 26) for k in range(length))
    shown = escape(text)
    if length <= 2000:
        assert shown == text
    else:
        assert shown == f"{text[:1800]}... ({length} characters) ...{text[-200:]}"


@pytest.mark.parametrize(
    ("text", "shown"),
    [("a\x1b[31m", "a\\x1b[31m"), ("\u202eb", "\\u202eb"), ("\u00b5m \u4e2d", "\u00b5m \u4e2d"), ("a\nb", "a\\nb")],
)
def test_characters_that_steer_a_terminal_are_spelled(text, shown):
    assert escape(text) == shown
