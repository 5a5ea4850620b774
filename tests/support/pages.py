"""Pages of the documentation as programs: their blocks of code run in order, in an empty folder.

A block that begins with ```python or ```sh runs, except ```sh notest.  A comment `<!-- test: python` or `<!-- test: sh`
holds a block that runs but is not shown, `<!-- file: NAME -->` before a block writes the block to a file.
"""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

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


def make_program(path):
    """Make a Python program of the blocks of a page that run."""
    lines = [
        "import subprocess",
        "from pathlib import Path",
        "def run_shell(code):",
        "    assert subprocess.run(['bash', '-euo', 'pipefail', '-c', code]).returncode == 0, code",
    ]
    for language, code in list_blocks(path):
        if language == "python":
            lines.append(code)
        elif language == "sh":
            lines.append(f"run_shell({code!r})")
        elif language.startswith("file "):
            lines.append(f"Path({language.split()[1]!r}).write_text({code!r})")
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
