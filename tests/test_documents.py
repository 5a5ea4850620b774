"""The examples in the documents run."""

import re
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def test_the_gripper_with_replaced_pads_runs_without_a_warning():
    section = (DOCS / "fast-model.md").read_text().split("## On other people's robots")[1].split("\n## ")[0]
    (example,) = re.findall(r"^```python\n(.*?)^```$", section, flags=re.DOTALL | re.MULTILINE)
    command = [sys.executable, "-W", "always", "-c", example]
    done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 -- our own document
    assert "OptionWarning" not in done.stderr
    assert done.stdout == "5.000 N and 5.000 N\n"
