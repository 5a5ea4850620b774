"""The page with the commands' outputs shows what they print."""

from __future__ import annotations

import math
import os
import re
import string
from pathlib import Path

import pytest

from tests.support.pages import load_script
from validation.cli.entry import app

outputs = load_script("outputs")

#: Words and numbers of a text, without the lines of tables.
TOKEN = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?|[^\W\d]+|[^\w\s]")
LINES = re.compile("[\u2500-\u257f\u2800-\u28ff]")


def split(text):
    return TOKEN.findall(LINES.sub(" ", text))


def differ(shown, printed, in_real_time=False):
    """The first place where two outputs differ in a word, or in a number by more than 5 % and 0.05; None if nowhere.

    Times are not compared, and no numbers of what was recorded in real time.
    """
    one, other = split(shown), split(printed)
    for place, (a, b) in enumerate(zip(one, other, strict=False)):
        is_time = one[place + 1 : place + 2] in (["s"], ["ms"], ["min"], ["kB"], ["bytes"])
        if (
            a[-1] in string.digits
            and b[-1] in string.digits
            and (in_real_time or is_time or math.isclose(float(a), float(b), rel_tol=0.05, abs_tol=0.05))
        ):
            continue
        if a != b:
            return " ".join(one[max(0, place - 5) : place + 5]), " ".join(other[max(0, place - 5) : place + 5])
    return None if len(one) == len(other) else (one[len(other) :], other[len(one) :])


def test_a_planted_difference_is_found():
    text = "misplaced force │ 0.6 % of 4.9 N on 5 mm²\ntime 8.7 s"
    assert differ(text, text.replace("8.7", "3.1")) is None
    assert differ(text, text.replace("0.6", "0.7")) is not None
    assert differ(text, text.replace("force", "load")) is not None
    assert differ(text, text + " and more") is not None
    assert differ(text, text.replace("0.6", "0.7"), in_real_time=True) is None
    assert differ(text, text.replace("force", "load"), in_real_time=True) is not None


def test_every_command_is_shown_and_fits_eighty_columns():
    page = outputs.read_page()
    assert list(page) == list(outputs.ALL)
    shown = {command.split()[1] for command in page}
    assert {name for name in app if not name.startswith("-")} - shown == {"demo"}  # it prints what validate prints
    for command, text in page.items():
        tables = [line for line in text.splitlines() if LINES.search(line)]
        assert max(map(len, tables), default=0) <= 80, command


@pytest.mark.slow
@pytest.mark.parametrize(
    "commands",
    [
        pytest.param(outputs.QUICK, id="quick"),
        pytest.param(outputs.SLOW, id="slow"),
        pytest.param(outputs.LONG, id="long", marks=pytest.mark.bench),
    ],
)
def test_the_page_shows_what_the_commands_print(commands, tmp_path):
    """Commands that need finite elements share the store of the other tests, which evaluate the same sensor."""
    page = outputs.read_page()
    shared = None if commands is outputs.QUICK else Path(os.environ["SOFTCOVER_STORE"])
    needed = ("softcover init", *commands) if commands is outputs.SLOW else commands
    printed = outputs.run_commands(needed, tmp_path, shared)
    found = {
        command: differ(page[command], printed[command], command in outputs.IN_REAL_TIME)
        for command in commands
        if command not in outputs.OF_THIS_MACHINE
    }
    assert {command: places for command, places in found.items() if places} == {}
