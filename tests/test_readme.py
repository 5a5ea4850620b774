"""What README shows works, and what it names is there."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.DOTALL | re.MULTILINE)


def test_robot_example_runs_as_it_stands_without_a_warning(tmp_path):
    (example,) = blocks("python")
    done = subprocess.run(  # noqa: S603 -- our own README
        [sys.executable, "-c", example], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert "Warning" not in done.stderr
    (shown,) = blocks("text")
    numbers = [[int(word) for word in re.findall(r"\d+", text)] for text in (shown, done.stdout)]
    assert numbers[0] == pytest.approx(numbers[1], abs=2)
    forces, grey = numbers[1][:42], numbers[1][42:]
    assert len(grey) == 42
    assert sum(force > 10 for force in forces) > 2 * sum(level > 0 for level in grey) > 0


def test_two_commands_come_first_and_soon():
    first, second = blocks("sh")[:2]
    assert first.count("\n") == second.count("\n") == 1
    assert first.strip().endswith(".venv/bin/softcover demo")
    assert second.strip() == ".venv/bin/pytest"
    assert README[: README.index(second)].count("\n") < 60


def test_ci_takes_its_commands_from_here():
    script = (ROOT / ".ci" / "run").read_text()
    awk = re.search(r"mapfile -t COMMANDS < <\((.*)\)\n", script).group(1)
    found = subprocess.run(  # noqa: S603 -- our own script
        [shutil.which("bash"), "-c", awk], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert found.splitlines() == [block.strip() for block in blocks("sh")[:2]]
