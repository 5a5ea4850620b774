"""A command that lacks optional packages says in one line how to install all of them, before any work."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.support.pages import load_script
from tests.support.words import split_command, split_table
from validation.extras import EXTRAS, MissingExtraError, require

PROJECT = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())
#: Modules of the distributions in an extra whose names differ, and distributions that the product does without.
MODULES = {"scikit-fem": "skfem", "pyserial": "serial", "mcap-ros2-support": "mcap_ros2"}
WITHOUT = {"pypardiso", "array-api-compat"}
#: Commands, and the extras whose modules they miss in a base installation.
MISSING = split_table("""
demo | fem,report
validate WTS | fem,report
validate WTS --recordings data.toml | fem,report,device
validate WTS --measured gelsight-mini | fem
press WTS BALL | fem
press WTS BALL --out pressed | fem,report,view
press WTS BALL --model fast --thickness 1mm | fem
press fingertip BALL --out pressed | fem,report,view
derive WTS --thickness 1mm --out derived | fem,report,view
derive fingertip | fem
mesh fingertip --out meshed | fem,view
regress WTS --update | fem
export WTS --thickness 1mm | fem
view WTS BALL --thickness 1mm | fem
datasheet WTS --thickness 1mm | fem
limits WTS | fem
design WTS --thickness 2mm --out page | fem,report
calibrate a.mcap --sensor WTS --picture left-out.png | device,report,fem
calibrate data.toml --sensor WTS --picture left-out.png | device,report,fem
replay a.mcap | device
""")
DATA_SET = """name = 'mine'
[[series]]
name = 'one'
indenter = 'sphere:radius=5mm'
load = '1 N'
files = ['*.mcap']
use = ['fit']
"""
FAST = "; or compute the fast model alone: --model fast"
#: Program that answers each list of words on standard input with [exit status, standard output, standard error].
CHILD = """
import contextlib, io, json, sys
from validation.extras import EXTRAS
sys.modules.update(dict.fromkeys(EXTRAS))
from validation.cli.entry import main

answers = []
for words in json.load(sys.stdin):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), contextlib.suppress(SystemExit):
        try:
            main(words)
        except SystemExit as left:
            answers.append([left.code, out.getvalue(), err.getvalue()])
json.dump(answers, sys.stdout)
"""


@pytest.fixture
def without_extras(monkeypatch, without_reference):
    """Hide the modules of all extras, as in a base installation, and fail the test if finite elements are asked."""
    for module in EXTRAS:
        monkeypatch.setitem(sys.modules, module, None)


def test_every_optional_package_has_its_extra():
    declared = {
        (extra, MODULES.get(name, name))
        for extra in ("fem", "curved", "report", "device", "gym", "view", "sweep")
        for line in PROJECT["project"]["optional-dependencies"][extra]
        if (name := line.split(">")[0]) not in WITHOUT
    }
    assert {(extra, module) for module, extra in EXTRAS.items()} == declared


def test_all_missing_modules_and_their_extras_are_named_once(without_extras):
    require("numpy", useful=["matplotlib"])
    with pytest.raises(MissingExtraError) as raised:
        require("skfem", "jinja2", "numpy", useful=["matplotlib"])
    assert raised.value.extras == ("fem", "report")
    assert str(raised.value) == (
        "skfem, jinja2, matplotlib are not installed; "
        "run in a clone of softcover: python -m pip install -e '.[fem,report]'"
    )


@pytest.mark.slow
def test_one_line_names_all_extras_before_any_work(tmp_path):
    """A new process answers, which has imported no module of an extra."""
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    (tmp_path / "data.toml").write_text(DATA_SET)
    words = json.dumps([split_command(command) for command, _ in MISSING])
    program = [sys.executable, "-c", CHILD]
    answers = json.loads(subprocess.check_output(program, input=words, cwd=tmp_path, text=True))  # noqa: S603 -- this Python
    for (command, extras), (status, out, err) in zip(MISSING, answers, strict=True):
        assert (status, out, len(err.splitlines())) == (3, "", 1), command
        assert f"not installed; run in a clone of softcover: python -m pip install -e '.[{extras}]'" in err, command
    assert {path.name for path in tmp_path.iterdir()} == {"a.mcap", "data.toml"}


@pytest.mark.parametrize("change", ["", "--at=1mm,1mm --yaw=10deg --tilt=2deg,0deg", "--method foundation"])
def test_press_names_the_fast_model_where_it_does_without_finite_elements(softcover, without_extras, change):
    words = split_command(f"press WTS BALL {change}")
    assert softcover(*words)[2].rstrip().endswith(FAST)
    assert softcover(*words, "--model", "fast")[0] == 0


@pytest.mark.parametrize("change", ["--friction 0.4", "--accuracy 1%", "--model fem", "--out x", "--thickness 1mm"])
def test_press_names_no_way_out_where_there_is_none(softcover, without_extras, change):
    err = softcover(*split_command(f"press WTS BALL {change}"))[2]
    assert ".[fem" in err
    assert FAST not in err


@pytest.mark.slow
def test_calibrate_names_the_fast_model_for_a_built_in_sensor(softcover, tmp_path, without_extras):
    load_script("outputs").write_recordings(tmp_path)
    files = [f"{newton}N.csv" for newton in (1, 2, 3, 4)]
    err = softcover("calibrate", *files, "--sensor", "wts-0614-34")[2]
    assert err.rstrip().endswith("'.[fem]'; or compute the contact by the fast model: --method cover")
    status, out, _ = softcover("calibrate", *files, "--sensor", "wts-0614-34", "--method", "cover")
    assert status == 0
    assert "sensitivity" in out
