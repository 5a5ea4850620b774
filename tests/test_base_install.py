"""The wheel without extras supports the fast model: README's example, export, terminal view, press and store."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
TOUCH = ("--indenter", "sphere:radius=5mm", "--load", "500g")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Folder with the programs of a new environment that holds the wheel and the base dependencies only."""
    folder = tmp_path_factory.mktemp("base")
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder / "wheel", ROOT]
    subprocess.run(build, check=True)  # noqa: S603 -- ours
    (wheel,) = (folder / "wheel").glob("*.whl")
    venv.create(folder / "venv")
    programs = folder / "venv" / "bin"
    pip = [sys.executable, "-m", "pip", "--python", programs / "python"]
    subprocess.run([*pip, "install", "--quiet", "--no-compile", wheel], check=True)  # noqa: S603 -- ours
    return programs


@pytest.fixture
def run(installed, tmp_path):
    """Run a program of that environment in an empty folder, away from the source tree."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    environment["SOFTCOVER_STORE"] = str(tmp_path / "store")
    environment["NUMBA_OPT"] = "0"  # the kernels run for a moment only

    def call(program, *words, status=0):
        command = [installed / program, *words]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)  # noqa: S603 -- ours
        assert done.returncode == status, done.stderr
        return done

    return call


def test_the_environment_holds_no_extra_and_nothing_of_the_source_tree(run):
    code = "import importlib.util as u, validation; print([n for n in ('skfem', 'mcap') if u.find_spec(n)], validation)"
    found = run("python", "-c", code).stdout
    assert found.startswith("[] ")
    assert str(ROOT) not in found


def test_the_description_on_a_package_index_has_no_broken_pictures_or_links(run):
    description = run(
        "python", "-c", "import importlib.metadata as m; print(m.metadata('softcover').get_payload())"
    ).stdout
    assert "# softcover" in description
    assert re.findall(r"\]\((?!https?:)[^)]*\)", description) == []


def test_the_example_of_the_readme_runs_without_a_warning(run):
    (example,) = re.findall(r"^```python\n(.*?)^```$", README, flags=re.DOTALL | re.MULTILINE)
    done = run("python", "-W", "error", "-c", example)
    compiling = "sensor 'sensor': compiling the contact kernels; later runs load them from disk"
    assert set(done.stderr.splitlines()) <= {compiling}
    assert max(int(word) for word in re.findall(r"\d+", done.stdout)) > 100


def test_commands_of_the_base(run, tmp_path):
    """Export, terminal view, press by the fast model, store, materials, template and doctor."""
    result = json.loads(run("softcover", "export", "wts-0614-34", "--format", "urdf", "--out", "out", "--json").stdout)
    assert {path.name for path in (tmp_path / "out").iterdir()} >= set(result["files"])
    done = run("softcover", "view", "wts-0614-34", *TOUCH, "--display", "terminal", "--seconds", "1.2")
    assert "4.90 N at" in done.stdout
    done = run("softcover", "press", "sdh2-distal", *TOUCH, "--model", "fast", "--json")
    assert json.loads(done.stdout)["models"]["fast"]["total_force"] == pytest.approx(0.5 * 9.80665, rel=1e-3)
    assert run("softcover", "store", "list").stdout.strip() == f"0 entries, 0 bytes in {tmp_path / 'store'}"
    assert "dragon-skin-30" in run("softcover", "materials").stdout
    assert "nominal stress" in run("softcover", "materials", "tpu").stdout
    run("softcover", "init")
    assert "'.[fem]'" in run("softcover", "doctor").stdout


def test_the_way_out_that_the_line_on_a_missing_extra_names_works(run):
    line = run("softcover", "press", "wts-0614-34", *TOUCH, status=3).stderr
    assert line.endswith("'.[fem]'; or compute the fast model alone: --model fast\n")
    assert "4.9" in run("softcover", "press", "wts-0614-34", *TOUCH, "--model", "fast").stdout
    assert "softcover export wts-0614-34 --out FOLDER" in run("softcover", "derive", "wts-0614-34", status=3).stderr
    run("softcover", "export", "wts-0614-34", "--out", "stored")
    line = run("softcover", "press", "stored", *TOUCH, status=2).stderr
    assert line.endswith("or use it as it is: --model fast\n")
    assert "4.9" in run("softcover", "press", "stored", *TOUCH, "--model", "fast").stdout
