"""Pages of the documentation as programs: their blocks of code run in order, in an empty folder.

A block that begins with ```python or ```sh runs, except ```sh notest.  A comment `<!-- test: python` or `<!-- test: sh`
holds a block that runs but is not shown, `<!-- file: NAME -->` before a block writes the block to a file.  A block
```text after ```sh, or after ```python that prints, is a part of what the block prints; `...` stands for the rest.
"""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

_NUMBER = re.compile(r"\d+(?:\.\d+)?")
ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md"))
_BLOCK = re.compile(
    r"^(?:<!-- file: (?P<file>\S+) -->\n)?```(?P<language>[^\n]*)\n(?P<code>.*?)^```$"
    r"|^<!-- test: (?P<hidden>\w+)\n(?P<secret>.*?)^-->$",
    flags=re.DOTALL | re.MULTILINE,
)


def list_blocks(path):
    """List language and code of each block of a page; a block that goes to a file has the language `file NAME`."""
    found = []
    for match in _BLOCK.finditer(path.read_text()):
        if match["hidden"]:
            found.append((match["hidden"], match["secret"]))
        elif match["file"]:
            found.append((f"file {match['file']}", match["code"]))
        else:
            found.append((match["language"].strip(), match["code"]))
    return found


def list_missing(shown, printed):
    """List the shown lines that are not printed: their words must agree, and their numbers to 5 %."""
    return [
        line
        for line in shown.splitlines()
        if line != "..." and not any(map(partial(is_shown, line), printed.splitlines()))
    ]


def is_shown(line, printed):
    """Whether a printed line has the words and the numbers of a shown one."""
    return _NUMBER.sub("#", line).split() == _NUMBER.sub("#", printed).split() and all(
        float(now) == pytest.approx(float(then), rel=0.05, abs=0 if "." in then else 1)
        for then, now in zip(_NUMBER.findall(line), _NUMBER.findall(printed), strict=True)
    )


def make_program(path):
    """Make a Python program of the blocks of a page that run."""
    lines = [
        "import contextlib, io, subprocess",
        "from pathlib import Path",
        "def run_shell(code):",
        "    done = subprocess.run(['bash', '-euo', 'pipefail', '-c', code], stdout=subprocess.PIPE, text=True)",
        "    assert done.returncode == 0, code",
        "    return done.stdout",
        "from tests.support.pages import list_missing",
    ]
    previous = ""
    for language, code in list_blocks(path):
        if language == "python":
            lines += [
                "shown = contextlib.ExitStack()",
                "out = shown.enter_context(contextlib.redirect_stdout(io.StringIO()))",
            ]
            lines += [code, "shown.close()", "printed = out.getvalue()"]
        elif language == "sh":
            lines.append(f"printed = run_shell({code!r})")
        elif language == "text" and previous in {"prints", "sh"}:
            lines.append(f"assert list_missing({code!r}, printed) == []")
        elif language.startswith("file "):
            lines.append(f"Path({language.split()[1]!r}).write_text({code!r})")
        previous = "prints" if language == "python" and "print(" in code else language
    return "\n".join(lines)


def run_page(path, folder):
    """Run a page in a folder; return the finished process."""
    programs = str(Path(sys.executable).parent)
    environment = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}", "COLUMNS": "80", "TERM": "dumb"}
    environment["PYTHONPATH"] = f"{ROOT}:{os.environ.get('PYTHONPATH', '')}"
    program = folder / "page.py"
    program.write_text(make_program(path))
    return subprocess.run(  # noqa: S603 -- our own document
        [sys.executable, program], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def load_script(name):
    """Import a script of the documentation, `docs/NAME.py`, as a module."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
