"""Measure what the base installation and each extra take, and write the table into docs/installation.md.

Each line is a virtual environment of its own.  The size is that of its site-packages without pip; the time is that of
`pip install` alone, with packages from the index or from pip's cache, so it depends on the connection.

    python docs/install_size.py            prints the table
    python docs/install_size.py --write    writes it into docs/installation.md
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import tempfile
import time
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "installation.md"
#: Lines of the page between which the table stands.
BEGIN, END = "<!-- sizes: begin -->", "<!-- sizes: end -->"
#: Packages that an empty environment holds.
_WITH_EVERY_ENVIRONMENT = {"pip", "setuptools"}
#: What each extra adds, in words.
PURPOSE = {
    "": "fast model in MuJoCo, `export`, `view`, `datasheet`, `press --model fast`",
    "fem": "finite elements: `derive`, `press`",
    "curved": "tetrahedra for curved covers that cannot be swept",
    "report": "reports and pictures: `demo`, `validate`",
    "docs": "this site: `sphinx-build docs site`",
    "device": "the real sensor and its files",
    "gym": "Gymnasium wrapper",
    "torch": "contact and signal chain on arrays of PyTorch (PyTorch itself not included)",
    "view": "`press --out`: `fields.vtu`",
    "sweep": "many designs on several processors or a cluster: `sweep --workers`, `sweep --out`",
    "all": "all of these but `docs` and `test`",
    "test": "tests, linters, types",
}


def main() -> None:
    """Measure all environments, and print or write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the table into docs/installation.md")
    parser.add_argument("--only", nargs="*", help="extras to measure, and base; all when left out")
    options = parser.parse_args()
    table = "\n".join(make_table(options.only))
    print(table)
    if options.write:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        after = rest.partition(END)[2]
        PAGE.write_text(f"{before}{BEGIN}\n{table}\n{END}{after}", encoding="utf-8")


def list_extras() -> list[str]:
    """List the base, named by an empty text, and the extras of the project."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    return ["", *(name for name in extras if name != "all"), "all"]


def make_table(only: list[str] | None) -> list[str]:
    """Measure each environment, and return the lines of the table."""
    lines = [
        "| install | for | size [MB] | more than the base [MB] | packages | time [s] |",
        "|---|---|---|---|---|---|",
    ]
    base = 0.0
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, ROOT], check=True
        )
        (wheel,) = Path(folder).glob("*.whl")
        for extra in list_extras():
            if only and (extra or "base") not in only:
                continue
            size, count, seconds = measure(wheel, extra)
            base = base or size
            name = f"`{extra}`" if extra else "(base)"
            lines.append(f"| {name} | {PURPOSE[extra]} | {size:.0f} | {size - base:.0f} | {count} | {seconds:.0f} |")
    bits = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    return [*lines, "", f"Measured on {bits}, {os.cpu_count()} cores, by `python docs/install_size.py --write`."]


def measure(wheel: Path, extra: str) -> tuple[float, int, float]:
    """Install the wheel with an extra; return size of the packages [MB], their number, and the time of pip [s]."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    with tempfile.TemporaryDirectory() as folder:
        venv.create(folder, with_pip=True)
        python = Path(folder) / "bin" / "python"
        target = f"{wheel}[{extra}]" if extra else str(wheel)
        started = time.perf_counter()
        command = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", target]
        subprocess.run(command, check=True, env=environment)
        seconds = time.perf_counter() - started
        library = Path(folder) / "lib"  # packages, and beside them the libraries of MKL
        (packages,) = library.glob("python*/site-packages")
        kept = [path for path in packages.iterdir() if path.name.partition("-")[0] not in _WITH_EVERY_ENVIRONMENT]
        beside = [path for path in library.iterdir() if not path.name.startswith("python")]
        files = (file for path in (*kept, *beside) for file in (path, *path.rglob("*")) if file.is_file())
        size = sum(file.stat().st_size for file in files if not file.is_symlink()) / 1e6
        return size, sum(path.suffix == ".dist-info" for path in kept), seconds


if __name__ == "__main__":
    main()
