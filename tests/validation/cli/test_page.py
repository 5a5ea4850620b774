"""Commands that take no longer than a moment print what `docs/outputs.md` shows, to the character."""

import re

import pytest

from tests.support.pages import load_script

outputs = load_script("outputs")

#: Commands in the order in which they use each other's files.
COMMANDS = [
    command
    for command in (*outputs.QUICK, *outputs.SLOW)
    if command.split()[1] in {"init", "materials", "datasheet", "export", "press", "view"}
]
#: What differs between machines: the time of a press [s].
TIME = re.compile(r"\b\d+\.\d+ s +│")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_prints_what_the_page_shows(softcover, monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("validation.cli.output.LINE_INTERVAL", -1.0)
    code, out, err = softcover(*command.split()[1:])
    assert code == 0
    is_solved = command.split()[1] == "press"
    assert bool(re.search(r"^\[ *\d+\.\d s\]( \d+/\d+)? \w", err, flags=re.MULTILINE)) == is_solved
    printed = outputs.join_streams(err, out)
    lines = [TIME.sub("│", line.rstrip()) for line in printed.rstrip().splitlines()]
    assert lines == [TIME.sub("│", line) for line in outputs.read_page()[command].splitlines()]
