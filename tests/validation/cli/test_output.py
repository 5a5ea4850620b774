import contextlib
import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshes.catalogue import ASSUMED_COVER
from validation.cli.output import describe_cover, print_rows, show_wrapped

# Printable text without white space at the ends, where a table cell pads and trims.
CELL = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=12)


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
