"""Type checkers see the types of arguments from mujoco, as far as stubs of mujoco are installed."""

import importlib.metadata
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CALLS = """
import mujoco
import fastmodel
from pathlib import Path

spec = mujoco.MjSpec()
wts = fastmodel.load("wts-0614-34")
fastmodel.attach("robot.xml", "palm", wts)
fastmodel.attach(spec, 3, wts)
fastmodel.attach(spec, "palm", Path("wts"))
fastmodel.attach(spec, "palm", wts, replaces=[spec.worldbody])
sensor = fastmodel.attach(spec, spec.sites[0], wts, replaces=["pad", spec.geoms[0]])
sensor.bind(spec)
sensor.step(spec.compile())
fastmodel.recommend_options("robot.xml")
"""
WRONG = [
    'Argument 1 to "attach" has incompatible type "str"; expected "MjSpec"',
    'Argument 2 to "attach" has incompatible type "int"; expected "str | MjsBody | MjsSite"',
    'Argument 3 to "attach" has incompatible type "Path"; expected "Parameters"',
    'List item 0 has incompatible type "MjsBody"; expected "str | MjsGeom"',
    'Argument 1 to "bind" of "Sensor" has incompatible type "MjSpec"; expected "MjModel"',
    'Argument 1 to "step" of "Sensor" has incompatible type "MjModel"; expected "MjData"',
    'Argument 1 to "recommend_options" has incompatible type "str"; expected "MjSpec"',
]


def has_stubs():
    try:
        importlib.metadata.version("mujoco-stubs")
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


@pytest.mark.slow
@pytest.mark.skipif(not has_stubs(), reason="mujoco-stubs is not installed")
def test_mypy_names_every_wrong_argument(tmp_path):
    (tmp_path / "calls.py").write_text(CALLS)
    command = [sys.executable, "-m", "mypy", "--cache-dir", str(tmp_path), str(tmp_path / "calls.py")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)  # noqa: S603 -- ours
    errors = [
        line.split(" error: ")[1] for line in done.stdout.splitlines() if "calls.py" in line and " error: " in line
    ]
    assert len(errors) == len(WRONG), done.stdout
    assert all(error.startswith(wrong) for error, wrong in zip(errors, WRONG, strict=True)), errors
