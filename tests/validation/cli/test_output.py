import contextlib
import io
import json

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from meshes.catalogue import ASSUMED_COVER
from validation.cli.output import describe_cover, print_json, print_rows, print_table

# Printable text without white space at the ends, where a table cell pads and trims.
CELL = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=12)
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


def printed(function, *arguments, **options):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        function(*arguments, **options)
    return out.getvalue()


@given(rows=st.lists(st.tuples(CELL, CELL), min_size=1, max_size=5), title=CELL)
def test_rows_are_printed_as_they_are_without_markup(rows, title):
    text = printed(print_rows, [("[red]name[/red]", "[/]"), *rows], title=title)
    assert title in text
    for cell in [cell for row in rows for cell in row] + ["[red]name[/red]", "[/]"]:
        assert cell in text


@given(rows=st.lists(st.tuples(CELL, CELL, CELL), max_size=5), headings=st.tuples(CELL, CELL, CELL))
def test_tables_print_every_cell_in_its_row(rows, headings):
    lines = printed(print_table, headings, rows).splitlines()
    shown = [[cell.strip() for cell in line.strip("│┃").replace("┃", "│").split("│")] for line in lines]
    plain = [row for row in [headings, *rows] if "│" not in "".join(row)]
    for row in plain:
        assert list(row) in shown or any("|" in cell for cell in row)


@given(values=st.dictionaries(CELL, st.one_of(NUMBERS, st.lists(NUMBERS, max_size=3)), max_size=5))
def test_json_is_one_object_in_which_only_finite_numbers_are_numbers(values):
    read = json.loads(printed(print_json, values))
    assert read.keys() == values.keys()
    for key, value in values.items():
        numbers, texts = (value, read[key]) if isinstance(value, list) else ([value], [read[key]])
        assert texts == [number if np.isfinite(number) else None for number in numbers]


def test_json_takes_arrays_as_lists():
    result = json.loads(printed(print_json, {"image": np.arange(6).reshape(2, 3), "nothing": np.float64("nan")}))
    assert result == {"image": [[0, 1, 2], [3, 4, 5]], "nothing": None}


def test_the_assumed_cover_is_labelled():
    assert describe_cover(ASSUMED_COVER).startswith("ASSUMED: 2 mm ")
