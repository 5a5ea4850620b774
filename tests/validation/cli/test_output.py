import contextlib
import io
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes.catalogue import ASSUMED_COVER
from validation.cli.output import describe_cover, explain_error, print_table, show_wrapped

# Printable text without white space at the ends, where a table cell pads and trims.
CELL = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=12)


def printed(function, *arguments, **options):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        function(*arguments, **options)
    return out.getvalue()


@given(rows=st.lists(st.tuples(CELL, CELL), min_size=1, max_size=5), title=CELL)
def test_rows_are_printed_as_they_are_without_markup(rows, title):
    text = printed(print_table, (), [("[red]name[/red]", "[/]"), *rows], title=title)
    assert title in text
    for cell in [cell for row in rows for cell in row] + ["[red]name[/red]", "[/]"]:
        assert cell in text


def test_the_assumed_cover_is_labelled():
    assert describe_cover(ASSUMED_COVER).startswith("ASSUMED: 2 mm ")


@pytest.mark.parametrize(
    ("estimates", "first", "last"),
    [
        ({"peak_texel": 0.0074, "contact_area": 0.15, "depth": 0.002}, "0.74 % (largest texel;", "to 15 % only."),
        ({"peak_texel": 0.02, "contact_area": 0.003}, "2 % (largest texel;", "below 1 %): refine."),
        ({"sigma": 0.005, "total_force": math.nan}, "0.5 % (width of the kernel;", "below 1 %)."),
        ({"depth": math.nan}, "No error", "one mesh only."),
    ],
)
def test_an_error_is_that_of_forces_and_depth_and_not_of_the_area_of_a_small_touch(estimates, first, last):
    text = explain_error(estimates, "refine")
    assert first in text
    assert text.endswith(last)


@pytest.mark.parametrize("name", ["dragon-skin-thirty-yeoh", "--layer", f"https://example.org/{'a-long-path/' * 8}end"])
@pytest.mark.parametrize("before", [60, 76])
def test_a_name_is_never_divided_between_lines_of_80_characters(capsys, name, before):
    show_wrapped(f"{'x' * before} {name} and more", further="  ")
    lines = capsys.readouterr().out.splitlines()
    assert name in " ".join(lines).split()
    assert all(len(line) <= 80 or line.strip() == name for line in lines)
    assert all(line.startswith("  ") for line in lines[1:])
