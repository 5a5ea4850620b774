import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fastmodel
import fem_reference
from validation.cli.entry import _COMMANDS, app
from validation.recordings.series import find_recordings_folder

FOUND = find_recordings_folder()
RECORDINGS = None if FOUND is None else FOUND.absolute()


@pytest.fixture
def sensor(tmp_path, softcover):
    assert softcover("init")[0] == 0
    return tmp_path / "sensor.toml"


@pytest.mark.parametrize("command", _COMMANDS)
def test_help_has_examples(softcover, command):
    status, out, _ = softcover(command, "--help")
    assert status == 0
    assert "Examples of use" in out
    assert f"softcover {command}" in out


PAGES = [[name] for name in _COMMANDS] + [["store", action] for action in ("list", "verify", "prune")]


@pytest.mark.parametrize("page", PAGES, ids=" ".join)
def test_help_examples_name_options_that_exist(page):
    command = app
    for word in page:
        command = command[word]
    examples = [line.split() for line in command.help.splitlines() if line.strip().startswith("softcover ")]
    assert examples
    for words in examples:
        assert words[1 : 1 + len(page)] == page
        if command.default_command:
            known = {name for argument in command.assemble_argument_collection() for name in argument.names}
            assert {word.split("=")[0] for word in words if word.startswith("--")} <= known


def test_help_pages_import_no_heavy_package():
    code = (
        "import contextlib, io, sys\n"
        "from validation.cli import main\n"
        f"for words in {[[], *PAGES]!r}:\n"
        "    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):\n"
        "        main([*words, '--help'])\n"
        "heavy = {'numpy', 'scipy', 'mujoco', 'skfem', 'pint', 'pydantic', 'plotly', 'matplotlib', 'fem_reference'}\n"
        "print(*heavy & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603 -- ours
    assert done.stdout.split() == []


def test_init_never_overwrites(softcover, sensor):
    sensor.write_text("mine")
    status, _, err = softcover("init")
    assert status == 2
    assert "exists already" in err
    assert sensor.read_text() == "mine"
    assert softcover("init", "--force")[0] == 0


def test_materials(softcover):
    status, out, _ = softcover("materials", "--json")
    assert status == 0
    assert json.loads(out)["materials"]["dragon-skin-30"]["youngs_modulus"] == pytest.approx(669e3)
    assert "dragon-skin-30" in softcover("materials")[1]


def test_doctor(softcover):
    status, out, _ = softcover("doctor", "--json")
    assert status == 0
    assert json.loads(out)["parts"]["base"]["mujoco"]


def test_derive_prints_one_json_object_and_writes_its_files(softcover, sensor):
    status, out, _ = softcover("derive", sensor, "--json", "--out", "derived")
    result = json.loads(out)
    assert status == 0
    assert 0.3 < result["psf"]["sigma_x"] < 0.8
    assert json.loads(Path("derived/derive.json").read_text()) == result
    assert fastmodel.load("derived").spread.sigma_x == result["psf"]["sigma_x"]
    assert Path("derived/psf.svg").stat().st_size > 1000


def test_derive_with_another_cover(softcover):
    _, out, _ = softcover("derive", "wts-0614-34", "--material", "dragon-skin-30", "--thickness", "3mm", "--json")
    cover = json.loads(out)["cover"]
    assert cover["assumed"] is False
    assert (cover["layers"][0]["material"], cover["thickness_m"]) == ("dragon-skin-30", 3e-3)


def test_derive_labels_the_assumed_cover(softcover):
    assert "ASSUMED" in softcover("derive", "wts-0614-34")[1]


def test_press_prints_the_keys_that_others_rely_on(softcover):
    status, out, _ = softcover(
        "press", "wts-0614-34", "--indenter", "box:size=6mmx10mmx5mm", "--load", "500g", "--at=-0.7mm,1.1mm",
        "--yaw=-45deg", "--json",
    )  # fmt: skip
    result = json.loads(out)
    assert status == 0
    for model in ("fem", "fast"):
        entry = result["models"][model]
        assert np.shape(entry["texel_forces"]) == (14, 6)
        assert np.sum(entry["texel_forces"]) + entry["outside"] == pytest.approx(entry["total_force"], rel=1e-3)
        assert entry["total_force"] == pytest.approx(0.5 * 9.80665, rel=1e-3)
        assert entry["seconds"] >= 0
    assert result["models"]["fem"]["depth"] > 0
    assert result["models"]["fast"]["method"] == "cover"
    assert result["models"]["fast"]["depth"] == pytest.approx(result["models"]["fem"]["depth"], rel=0.1)
    assert result["models"]["fem"]["error_estimate"].keys() == {"total_force", "peak_texel", "contact_area"}
    assert result["models"]["fem"]["assumptions"].keys() >= {"strain", "friction", "base"}
    assert result["scores"].keys() >= {
        "total_force_error",
        "misplaced_force",
        "relative_l2",
        "centre_of_pressure_m",
        "image_changed_percent",
        "pixels_changed",
    }


def test_the_reports_boxes_can_be_asked_for_and_misplace_more(softcover):
    touch = ("press", "wts-0614-34", "--indenter", "box:size=6mmx10mmx5mm", "--load", "500g", "--json")
    cover, boxes = (json.loads(softcover(*touch, "--method", method)[1]) for method in ("cover", "boxes"))
    assert boxes["models"]["fast"]["depth"] is None
    assert boxes["scores"]["misplaced_force"] > 5 * cover["scores"]["misplaced_force"]


@pytest.mark.slow
def test_fast_model_takes_the_load_that_the_reference_has_at_a_depth(softcover):
    _, out, _ = softcover("press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--depth", "0.3mm", "--json")
    models = json.loads(out)["models"]
    assert models["fem"]["depth"] == pytest.approx(0.3e-3, rel=1e-6)
    assert models["fast"]["total_force"] == pytest.approx(models["fem"]["total_force"], rel=1e-3)


@pytest.mark.slow
def test_press_draws_both_models(softcover):
    status, out, _ = softcover("press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "500g")
    assert status == 0
    assert "finite elements, mN" in out
    assert "fast model, mN" in out


def test_press_with_the_fast_model_alone(softcover):
    _, out, _ = softcover(
        "press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "2N", "--model", "fast", "--json"
    )
    result = json.loads(out)
    assert list(result["models"]) == ["fast"]
    assert result["scores"] is None


BAD = [
    (["derive", "no.toml"], "no.toml: no such sensor file"),
    (["derive", "wts-0614-3"], "did you mean 'wts-0614-34'"),
    (["derive", "wts-0614-34", "--material", "dragonskin-30"], "did you mean 'dragon-skin-30'"),
    (["derive", "wts-0614-34", "--thickness", "2"], "--thickness: '2' has no unit"),
    (["derive", "wts-0614-34", "--thickness=-2mm"], "--thickness: must be positive"),
    (["derive"], "sensor is missing"),
    (["derive", "wts-0614-34", "--thicknes", "2mm"], "--thicknes"),
    (["press", "wts-0614-34", "--indenter", "shpere:radius=5mm", "--load", "1N"], "did you mean 'sphere'"),
    (["press", "wts-0614-34", "--indenter", "sphere:raduis=5mm", "--load", "1N"], "did you mean 'radius'"),
    (["press", "wts-0614-34", "--indenter", "sphere", "--load", "1N"], "sphere needs radius"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "1N", "--method", "boxs"], "'boxes'"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=-5mm", "--load", "1N"], "positive"),
    (["press", "wts-0614-34", "--indenter", "box:size=1mmx2mm", "--load", "1N"], "is not 3 values"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm"], "give one of them"),
    (
        ["press", "wts-0614-34", "--indenter", "tip", "--load", "1N", "--model", "fast", "--friction", "0.4"],
        "--friction: the fast model has none",
    ),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "5"], "--load: '5' has no unit"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "0N"], "--load: must be positive"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--depth", "3mm"], "pierce the cover"),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "1N", "--at=1m,0m"], "is not on the array"),
    (
        ["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "1N", "--yaw=45"],
        "--yaw: '45' has no unit",
    ),
    (["press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "1N", "--model=fen"], "did you mean 'fem'"),
    (["export", "wts-0614-34", "--format", "urdf"], "unknown format 'urdf'; accepted: mjcf, gazebo"),
    (["validate", "wts-0614-34", "--recordings", "nowhere"], "nowhere: no such folder"),
    (["dervie", "wts-0614-34"], "did you mean 'derive'"),
]


@pytest.mark.parametrize(("words", "expected"), BAD, ids=[" ".join(words) for words, _ in BAD])
def test_bad_input_is_one_line_and_status_2(softcover, tmp_path, words, expected):
    status, out, err = softcover(*words)
    assert status == 2
    assert expected in err
    assert out == ""
    assert all(line.startswith("softcover: ") for line in err.splitlines())
    assert list(tmp_path.iterdir()) == []


def test_every_fault_of_every_option_at_once(softcover):
    words = ("no.toml", "--indenter", "spher:x=1", "--load", "3", "--at=1mm", "--yaw=x", "--model", "fen")
    status, _, err = softcover("press", *words)
    assert status == 2
    places = [line.split(": ")[1] for line in err.splitlines()]
    assert places == ["--model", "no.toml", "--indenter", "--at", "--yaw", "--load"]


def test_bad_sensor_file_lists_all_faults_and_writes_nothing(softcover, sensor, tmp_path):
    text = sensor.read_text().replace('"2 mm"', '"-2 mm"').replace("0.49", "0.51").replace("rows = 14", "rowz = 14")
    sensor.write_text(text)
    status, out, err = softcover("derive", sensor, "--json", "--out", "derived")
    assert status == 2
    assert out == ""
    for place in ("array.rows", "array.rowz", "cover.layer[0].thickness", "cover.layer[0].material.poisson_ratio"):
        assert sum(f" {place}: " in line for line in err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["sensor.toml"]


@pytest.mark.parametrize("command", [["demo"], ["derive", "wts-0614-34"], ["export", "wts-0614-34"]])
def test_unwritable_out_is_found_before_the_work(softcover, command, monkeypatch):
    def too_late(*_, **__):
        raise AssertionError("the reference was asked first")

    monkeypatch.setattr(sys.modules["fem_reference.linear_response.point_spread"], "point_spread", too_late)
    status, _, err = softcover(*command, "--out", "/proc/no/report")
    assert status == 3
    assert err.startswith("softcover: /proc/no/report: cannot be written")


def test_out_folder_of_somebody_else_is_left_alone(softcover, tmp_path):
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.tex").write_text("years of work")
    status, _, err = softcover("export", "wts-0614-34", "--out", "home")
    assert status == 2
    assert "softcover did not write" in err
    assert (tmp_path / "home" / "thesis.tex").read_text() == "years of work"


@pytest.mark.parametrize(
    ("module", "extra"),
    [
        ("skfem", "fem"),
        pytest.param("jinja2", "report", marks=pytest.mark.slow),
        pytest.param("plotly", "report", marks=pytest.mark.slow),
    ],
)
def test_missing_extra_gives_the_command_that_installs_it(tmp_path, module, extra):
    code = f"import sys; sys.modules[{module!r}] = None\nfrom validation.cli import main\nmain(['demo'])"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)  # noqa: S603 -- ours
    assert done.returncode == 3
    assert done.stderr.splitlines() == [
        f"softcover: {module} is not installed; run: python -m pip install 'softcover[{extra}]'"
    ]
    assert list(tmp_path.iterdir()) == []


def test_solver_that_does_not_converge_is_status_4(softcover, monkeypatch):
    def diverge(*_, **__):
        raise fem_reference.ConvergenceError("contact did not settle after 50 steps")

    monkeypatch.setattr(sys.modules["fem_reference.linear_response.point_spread"], "point_spread", diverge)
    status, _, err = softcover("derive", "wts-0614-34")
    assert (status, err) == (4, "softcover: contact did not settle after 50 steps\n")


@pytest.mark.skipif(RECORDINGS is None, reason="no recordings here")
def test_recordings_of_another_array(softcover):
    status, _, err = softcover("validate", "wts-0614-34", "--recordings", RECORDINGS)
    assert status == 2
    assert "is not wts-0614-34" in err
    assert "sdh2-distal" in err


@pytest.mark.skipif(RECORDINGS is None, reason="no recordings here")
def test_truncated_recording(softcover, tmp_path):
    shutil.copytree(next(RECORDINGS.rglob("room")), tmp_path / "data" / "room")
    for path in tmp_path.rglob("*"):
        path.chmod(0o755)
    damaged = tmp_path / "data" / "room" / "C1.dsa"
    damaged.write_bytes(damaged.read_bytes()[:9000])
    status, _, err = softcover("validate", "sdh2-distal", "--recordings", tmp_path / "data")
    assert status == 2
    assert "C1.dsa: truncated" in err
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


@pytest.mark.slow
def test_demo_goes_the_whole_way(softcover, tmp_path):
    recordings = [] if RECORDINGS is None else ["--recordings", RECORDINGS]
    status, out, err = softcover("demo", "--json", *recordings)
    assert status == 0
    page = (tmp_path / "softcover-report" / "index.html").read_text()
    assert ("Light weights to heavy ones" in page) == bool(recordings)
    assert json.loads(out)["campaign"]["skill"]["zeros"]["mean"] > 0.4
    assert "softcover-report/index.html" in err
    names = {path.name for path in (tmp_path / "softcover-report").iterdir()}
    assert names >= {"index.html", "scores.json", "parameters.toml", "cover.npz", "plotly.min.js"}
