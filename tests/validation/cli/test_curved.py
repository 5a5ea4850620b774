"""The command line on sensors with curved covers."""

import re

import numpy as np
import pytest

from validation.cli.entry import main
from validation.derivation.derive import derive
from validation.errors import InputError
from validation.places import SolidPlaces
from validation.sensor_file import CURVED


def run(*words):
    with pytest.raises(SystemExit) as ended:
        main(words)
    return ended.value.code


@pytest.mark.parametrize(
    "words",
    [
        ("validate", "fingertip", "--recordings", "none"),
        ("export", "phalanx", "--format", "sdf", "--out", "x"),
        ("datasheet", "flat-pad"),
        ("view", "fingertip", "--indenter", "sphere:radius=4mm", "--load", "1N"),
    ],
    ids=lambda words: words[0],
)
def test_commands_for_flat_covers_refuse_in_one_line(words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(*words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "curved cover" in line
    assert "leave them out" in line or "`softcover " in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", ["0,0", "a,b,c", "0,0,0", "1,2,nan", "1mm,0mm,0mm", "", "1" * 101, "down"])
def test_bad_directions_are_refused(text):
    with pytest.raises(InputError, match=r"--direction: .*--direction=0,0.5,-1"):
        SolidPlaces(sensor=CURVED["fingertip"]).parse({"direction": text}, "--")


def test_a_direction_is_read():
    found = SolidPlaces(sensor=CURVED["fingertip"]).parse({"direction": "0, 1e-1,-1"}, "--")
    assert found.direction == (0.0, 0.1, -1.0)


def test_all_faults_of_a_pose_are_told_before_the_cover_is_meshed(capsys, monkeypatch):
    monkeypatch.setattr("validation.places.make_meshes", None)
    pose = ("--at=tip", "--direction=up", "--yaw=3", "--tilt=1deg", "--strain=large")
    assert run("press", "fingertip", "--indenter", "ball:radius=4mm", "--load=1N", *pose) == 2
    lines = capsys.readouterr().err.splitlines()
    assert [re.match(r"softcover: (--\w+): ", line)[1] for line in lines] == [each.split("=")[0] for each in pose]
    assert "accepted: middle, centre, texel, off grid, edge, corner, side, or x,y,z such as 0mm,2mm,8mm" in lines[0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("fingertip", "--tilt=85deg,0deg", "--load=1N"), "--tilt"),
        (("fingertip", "--friction=0.4", "--load=1N"), "--friction: 0.4 is not computed on curved covers; accepted: 0"),
        (
            ("fingertip", "--friction=no-slip", "--load=1N", "--strain=finite"),
            "--friction: on curved covers no slip",
        ),
        (("fingertip", "--friction=no-slip", "--load=1N", "--model=fast"), "--friction: the fast model has none"),
        (("fingertip", "--friction=sticky", "--load=1N"), "--friction: 'sticky' is not zero"),
        (("fingertip", "--load=1N", "--model=fast", "--out=x"), "--out"),
        (("fingertip",), "--load, --depth"),
        (("wts-0614-34", "--direction=0,0,-1", "--load=1N"), "--direction"),
    ],
)
def test_options_that_do_not_fit_are_named(words, said, capsys):
    assert run("press", *words, "--indenter", "ball:radius=4mm") == 2
    assert said in capsys.readouterr().err


@pytest.fixture(scope="module")
def derived(small_pad, tmp_path_factory):
    """A folder with the parameters of a curved cover."""
    folder = tmp_path_factory.mktemp("derived")
    derive(small_pad).parameters.save(folder)
    return str(folder)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("export", "DERIVED", "--format", "sdf", "--out", "x"), "a model of boxes cannot hold"),
        (("export", "DERIVED", "--format", "urdf", "--out", "x"), "a model of boxes cannot hold"),
        (("export", "DERIVED", "--format", "gazebo", "--out", "x"), "the array must be flat|spread must be a Gaussian"),
        (("press", "DERIVED", "--indenter", "ball:radius=4mm", "--load=1N"), "name the sensor file"),
        (
            ("press", "DERIVED", "--indenter", "ball:radius=4mm", "--load=1N", "--model=fast", "--method=area"),
            "is curved",
        ),
        (("view", "DERIVED", "--indenter", "ball:radius=4mm", "--load=1N", "--method=boxes"), "is curved"),
        (("validate", "DERIVED"), "name the sensor file"),
        (("emulate", "port", "--show", "fingertip"), "softcover derive fingertip --out FOLDER"),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, tuple) else "",
)
def test_folders_of_curved_covers_are_refused_where_they_have_no_meaning(words, said, derived, softcover, tmp_path):
    status, _, err = softcover(*(derived if word == "DERIVED" else word for word in words))
    assert status == 2
    (line,) = err.splitlines()
    assert re.search(said, line)
    assert list(tmp_path.iterdir()) == []


def test_a_press_of_parameters_does_not_call_force_outside_the_array(derived, capsys):
    assert run("press", derived, "--indenter", "ball:radius=4mm", "--load=0.2N", "--model=fast") == 0
    assert "along the motion" in capsys.readouterr().out


def test_derive_prints_the_responses_and_what_they_mean(small_pad, softcover, monkeypatch):
    """Each figure against the derivation itself."""
    derivation = derive(small_pad)
    monkeypatch.setattr("validation.derivation.derive.derive_cover", lambda *_args, **_options: derivation)
    status, out, _ = softcover("derive", "flat-pad")
    assert status == 0
    text = " ".join(out.translate(str.maketrans("│┌┐└┘├┤┬┴┼─", " " * 11)).split())
    own = np.diag(derivation.responses.matrix)[derivation.sensor.array.active]
    for name, share in (("least", own.min()), ("largest", own.max())):
        assert f"point force that the texel below measures, {name} [%] {100 * share:.1f}" in text
    assert f"hash {derivation.mesh.digest[:12]}: " in text
    assert "of all texels need not sum to the load." in text
    assert "No error of the finite elements is known: there is one mesh only." in text
