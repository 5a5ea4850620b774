"""Commands that need no finite elements print what `docs/outputs.md` shows, to the character."""

import re

import pytest

from tests.support.pages import load_script

outputs = load_script("outputs")

#: Commands in the order in which they use each other's files.
COMMANDS = [
    command
    for command in outputs.QUICK
    if command.split()[1] in {"init", "materials", "datasheet", "export", "press", "view"}
]
#: What may differ between machines: the time of a press [s].
TIME = re.compile(r"\b0\.\d{3} s\b")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_prints_what_the_page_shows(softcover, monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, err = softcover(*command.split()[1:])
    assert code == 0
    printed = outputs._PROGRESS.sub("", err) + out
    lines = [TIME.sub("TIME", line.rstrip()) for line in printed.rstrip().splitlines()]
    assert lines == [TIME.sub("TIME", line) for line in outputs.read_page()[command].splitlines()]
