import contextlib
import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes.catalogue import ASSUMED_COVER
from validation.cli.output import describe_cover, print_json, print_rows, print_table, show_wrapped

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


@pytest.mark.parametrize(("indent", "further"), [("", ""), ("", "    "), ("  ", "  ")])
def test_paragraphs_are_wrapped_at_80_characters_and_indented(capsys, indent, further):
    text = "- " + " ".join(f"word{number}" for number in range(40))
    show_wrapped(text, indent=indent, further=further)
    first, *rest = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{indent}- word0 ")
    assert len(rest) > 2
    assert all(line.startswith(f"{further}word") for line in rest)
    assert all(70 < len(line) <= 80 for line in (first, *rest[:-1]))
    assert " ".join(line.strip() for line in (first, *rest)) == text


@pytest.mark.parametrize("name", ["dragon-skin-thirty-yeoh", "--layer", f"https://example.org/{'a-long-path/' * 8}end"])
@pytest.mark.parametrize("before", range(60, 81, 4))
def test_a_name_is_never_divided_between_lines(capsys, name, before):
    show_wrapped(f"{'x' * before} {name} and more")
    assert name in capsys.readouterr().out.split()
