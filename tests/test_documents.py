"""The examples in the documents run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from validation.cli.entry import app
from validation.regression.quantities import EXPERIMENTS

DOCS = Path(__file__).parents[1] / "docs"


def test_the_gripper_with_replaced_pads_runs_without_a_warning():
    section = (DOCS / "fast-model.md").read_text().split("## On other people's robots")[1].split("\n## ")[0]
    (example,) = re.findall(r"^```python\n(.*?)^```$", section, flags=re.DOTALL | re.MULTILINE)
    command = [sys.executable, "-W", "always", "-c", example]
    done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 -- our own document
    assert "OptionWarning" not in done.stderr
    assert done.stdout == "5.000 N and 5.000 N\n"


@pytest.mark.parametrize("name", ["regression.md", "regress.yml"])
def test_commands_of_the_regression_check_are_accepted(name):
    lines = re.findall(r"softcover (regress sensor\S* [^#\n]*)", (DOCS / name).read_text())
    assert len(lines) >= 2
    for line in lines:
        command, bound, _ = app.parse_args(line.split(), exit_on_error=False, print_error=False)
        assert command.__name__ == "regress"
        assert bound.arguments["baseline"] == Path("sensor.baseline.json")


def test_every_group_of_the_regression_check_is_explained():
    text = (DOCS / "regression.md").read_text()
    rows = re.findall(r"^\| (`.*?`) \|", text, flags=re.MULTILINE)
    assert {name for row in rows for name in re.findall(r"`(.*?)`", row)} == set(EXPERIMENTS)
