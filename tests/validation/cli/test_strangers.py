"""Names and notes in files of strangers: they lead to no file outside the output folder and do not steer a terminal."""

import dataclasses
import json

import pytest

import fastmodel
from validation.render import escape

ESCAPES = "\x1b[2J\x1b]0;title\x07 \u202eevil \x9b31m\r"


def save_named(name, folder):
    parameters = fastmodel.load("wts-0614-34")
    dataclasses.replace(parameters, array=dataclasses.replace(parameters.array, name=name)).save(folder)


@pytest.mark.parametrize("form", ["mjcf", "gazebo"])
@pytest.mark.parametrize("name", ["../../escaped", "{tmp_path}/escaped", "..\\escaped", "a/b", ESCAPES, "\0"])
def test_the_name_of_a_sensor_leads_to_no_other_folder(softcover, tmp_path, name, form):
    work = tmp_path / "far" / "down"
    work.mkdir(parents=True)
    save_named(name.format(tmp_path=tmp_path), work / "given")
    before = {path for path in tmp_path.rglob("*") if path != work / "out"}
    status, out, _ = softcover("export", str(work / "given"), "--format", form, "--out", str(work / "out"), "--json")
    assert status == 0
    assert {path for path in tmp_path.rglob("*") if work / "out" not in (path, *path.parents)} == before
    assert set(json.loads(out)["files"]) <= {path.name for path in (work / "out").iterdir()}


def test_escape_sequences_in_a_recording_are_printed_as_text(softcover, tmp_path):
    (tmp_path / "a.csv").write_text(f"# rows = 1\n# columns = 1\n# note = {ESCAPES.strip()} end\ntime,t\n0,1\n")
    status, out, err = softcover("replay", "a.csv")
    assert status == 0
    assert r"\x1b[2J" in err
    assert (out + err).replace("\n", "").isprintable()


@pytest.mark.slow
def test_escape_sequences_in_arguments_and_names_are_printed_as_text(softcover, tmp_path):
    save_named(ESCAPES, tmp_path / "given")
    words = ("--indenter", "tip", "--load", "1N")
    for command in (
        ["press", "given", "--model", "fast", *words],
        ["export", ESCAPES],
        ["derive", f"no{ESCAPES}.toml"],
    ):
        _, out, err = softcover(*command)
        assert (out + err).replace("\n", "").isprintable()


def test_printable_text_stays_as_it_is():
    assert escape("Weiss WTS \u00b5m 0.5 \u00d7 2 \u2026") == "Weiss WTS \u00b5m 0.5 \u00d7 2 \u2026"
    assert len(escape("a" * 10**6)) < 2100


def test_long_texts_are_cut_in_messages(softcover):
    status, _, err = softcover("derive", "wts-0614-34", "--material", "x" * 10**5)
    assert status == 2
    assert "xxx...; accepted" in err
    assert len(err) < 2500
