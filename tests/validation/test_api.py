"""The verbs of the package do what the commands of the same names do."""

import inspect
import json
import re
import subprocess
import sys

import numpy as np
import pytest

import fastmodel
import validation
from tests.support.laboratory import ARRAY, STAMP_TEXT, draw_gains, make_curve, press, uniform_method, write
from validation.calibration.model import Pose
from validation.cli.entry import _COMMANDS
from validation.errors import InputError
from validation.sensor_file import SensorDescription

#: Options of commands that a Python function does not need, or that `load` takes.
ELSEWHERE = {"json", "material", "thickness", "layer"}


def test_every_verb_is_listed_typed_and_explained():
    for name in validation.__all__:
        verb = getattr(validation, name)
        signature = inspect.signature(verb)
        assert all(each.annotation is not inspect.Parameter.empty for each in signature.parameters.values()), name
        assert signature.return_annotation is not inspect.Signature.empty, name
        for parameter in signature.parameters:
            assert re.search(rf"^ +{parameter}: ", verb.__doc__, flags=re.MULTILINE), (name, parameter)
    assert set(validation.__all__) - set(_COMMANDS) == {
        "History",
        "fit_filter",
        "load",
        "next_touches",
        "press_in_time",
        "read_report",
    }


def test_the_import_is_cheap():
    code = (
        "import sys, validation; print(*{'numpy', 'pydantic', 'mujoco', 'scipy'} & set(sys.modules), len(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603 -- ours
    assert len(done.stdout.split()) == 1


def test_a_sensor_is_read_from_a_name_a_file_or_a_folder(tmp_path):
    assert isinstance(validation.load("wts-0614-34", thickness="1mm"), SensorDescription)
    fastmodel.load("wts-0614-34").save(tmp_path)
    assert isinstance(validation.load(tmp_path), fastmodel.Parameters)
    with pytest.raises(InputError, match="were derived for one cover"):
        validation.load(tmp_path, thickness="1mm")
    with pytest.raises(InputError, match="no description of the cover"):
        validation.derive(tmp_path)


def test_a_verb_returns_what_the_command_prints(softcover):
    words = "export wts-0614-34 --out out --format urdf --mass 20g --json"
    status, out, _ = softcover(*words.split())
    assert status == 0
    assert json.loads(out) == validation.export("wts-0614-34", "out", format="urdf", mass="20g").as_json()


def test_a_fast_press_computes_no_finite_elements():
    found = validation.press("wts-0614-34", "sphere:radius=5mm", load="2 N", at="1mm,0mm", models=("fast",))
    assert found.fast.total_force == pytest.approx(2.0)
    assert found.fem is None
    for options in ({}, {"load": "1 N", "depth": "1 mm"}):
        with pytest.raises(InputError, match="give one of them"):
            validation.press("wts-0614-34", "sphere:radius=5mm", **options)


def test_a_recording_is_replayed_and_recordings_calibrate(tmp_path, monkeypatch):
    curve = make_curve(draw_gains(np.random.default_rng(2)))
    pose, paths = Pose(1e-3, -2e-3), []
    for number, newtons in enumerate((4.0, 8.0, 12.0, 16.0)):
        paths.append(write(press(uniform_method(), curve, newtons, pose), tmp_path / f"{number}.mcap"))
    assert validation.replay(paths[0]).setup.indenter == STAMP_TEXT
    (tmp_path / "own.toml").write_text(
        f"[array]\nrows = {ARRAY.rows}\ncolumns = {ARRAY.columns}\npitch = '5 mm'\n[[cover.layer]]\n"
        "thickness = '2 mm'\nmaterial = 'dragon-skin-30'\n[electronics]\nrate = '271 Hz'\nsensitivity = '1 1/N'\n"
    )
    monkeypatch.setattr("validation.calibration.calibrate.choose_method", lambda *_: uniform_method())
    out, picture = tmp_path / "new.toml", tmp_path / "left-out.png"
    found = validation.calibrate(paths, tmp_path / "own.toml", at="1mm,-2mm", out=out, picture=picture)
    assert found.estimates["sensitivity"].value == pytest.approx(917 * curve.gains[found.texels].mean(), rel=0.02)
    assert validation.load(out).electronics.gains == pytest.approx(found.gains, abs=1e-5)
    assert picture.read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(InputError, match="exists; name a new file"):
        validation.calibrate(paths, tmp_path / "own.toml", out=out)
    with pytest.raises(InputError, match="give both"):
        validation.calibrate(paths, tmp_path / "own.toml", tip="1mm")
