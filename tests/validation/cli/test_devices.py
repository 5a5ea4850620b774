"""`record`, `replay`, `import`, `emulate` and `doctor --port` as a user meets them."""

import json
import os
import re
import signal
import subprocess
import sys
from itertools import islice

import numpy as np
import pytest

import fastmodel
from meshes import TexelArray
from tests.support.virtual_port import answer_always
from validation.recordings import capture, mcap_reader
from validation.weiss.sensor import Sensor

pytest.importorskip("pty", reason="pseudo-terminals need Linux or macOS")


def test_a_recording_is_shown_and_imported_again(plug_in, tmp_path, softcover):
    path = tmp_path / "touch.mcap"
    options = ("--indenter", "sphere:radius=5mm", "--load", "500g", "--note", "palm", "--threshold", "9", "--json")
    status, out, _ = softcover("record", plug_in().name, "--out", path, "--seconds", "0.3", *options)
    told = json.loads(out)
    assert status == 0
    assert (told["gaps"], told["ended"]) == (0, "done")
    assert told["frames"] == len(mcap_reader.read(path).times) > 0

    status, out, _ = softcover("replay", path, "--json", "--csv", tmp_path / "a.csv")
    replayed = json.loads(out)
    assert status == 0
    assert replayed["frames"] == told["frames"]
    assert replayed["setup"]["load"] == pytest.approx(4.903325)
    assert replayed["setup"]["device"]["threshold"] == 9
    delays = np.sort(mcap_reader.read(path).arrival_delays)
    assert replayed["arrival_delays"] == {
        "median_s": pytest.approx(np.median(delays)),
        "p95_s": pytest.approx(np.interp(0.95 * (len(delays) - 1), np.arange(len(delays)), delays)),
        "largest_s": delays[-1],
    }

    status, _, errors = softcover("import", tmp_path / "a.csv", "--out", tmp_path / "b.mcap", "--note", "again")
    assert status == 0
    back = mcap_reader.read(tmp_path / "b.mcap")
    assert np.array_equal(back.arrays[0].counts, mcap_reader.read(path).arrays[0].counts)
    assert (back.setup.note, back.setup.indenter) == ("again", "sphere:radius=5mm")
    assert softcover("import", tmp_path / "a.csv", "--out", tmp_path / "b.mcap")[0] == 2
    status, _, errors = softcover("replay", path)
    assert "4.903 N; palm" in errors


def test_every_option_of_record_reaches_the_sensor_or_the_recorder(plug_in, tmp_path, softcover, monkeypatch):
    given = {}
    record = capture.record
    monkeypatch.setattr(
        capture, "record", lambda sensor, path, **options: given.update(options) or record(sensor, path, **options)
    )
    port = plug_in()
    options = ("--seconds", "0.2", "--run-length", "--interval-ms", "20", "--reconnect", "3", "--gain", "77")
    status, out, _ = softcover("record", port.name, "--out", tmp_path / "a.mcap", "--note", "x", *options, "--json")
    assert status == 0
    assert {name: given[name] for name in ("seconds", "run_length", "interval_ms", "reconnect")} == {
        "seconds": 0.2, "run_length": True, "interval_ms": 20, "reconnect": 3.0,
    }  # fmt: skip
    recording = mcap_reader.read(tmp_path / "a.mcap")
    assert (np.diff(recording.ticks) >= 19).all()  # whole milliseconds
    assert recording.setup.device["gain"] == 77
    assert json.loads(out)["frames"] == len(recording.times) > 1


@pytest.mark.slow
def test_a_cut_off_recording_is_completed_in_place(plug_in, tmp_path, softcover):
    path = tmp_path / "cut.mcap"
    assert softcover("record", plug_in().name, "--out", path, "--seconds", "0.3", "--json")[0] == 0
    path.write_bytes(path.read_bytes()[:-2000])
    assert not mcap_reader.is_complete(path)
    assert "cut off" in softcover("replay", path)[2]
    assert softcover("import", path)[0] == 0
    assert mcap_reader.is_complete(path)


@pytest.mark.slow
def test_another_device_on_the_port_and_a_second_client_are_refused(plug_in, softcover, monkeypatch):
    monkeypatch.setitem(Sensor.__init__.__kwdefaults__, "timeout", 0.1)
    with answer_always(b"hello\r\n") as name:
        status, _, errors = softcover("record", name)
    assert (status, len(errors.splitlines())) == (3, 1)
    assert "none of them is an answer" in errors
    port = plug_in()
    with Sensor(port.name):
        status, _, errors = softcover("record", port.name)
    assert (status, len(errors.splitlines())) == (3, 1)
    assert "another program has it open" in errors


@pytest.mark.slow
def test_emulate_serves_a_port_until_it_is_stopped(tmp_path):
    port = tmp_path / "wts"
    words = ["emulate", str(port), "--show", "ramp", "--fault", "lose=0.05", "--json"]
    code = "import sys; from validation.cli.entry import main; main(sys.argv[1:])"
    run = subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", code, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"},
    )
    told = "".join(iter(run.stdout.readline, "}\n")) + "}"
    assert json.loads(told)["port"] == str(port)
    with Sensor(str(port)) as sensor:
        events = list(islice(sensor.stream(), 150))
    assert {"Reading", "Gap"} == {type(event).__name__ for event in events}
    run.send_signal(signal.SIGTERM)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 0
    assert re.search(r"\d+ frames sent", errors)
    assert not os.path.lexists(port)


def test_doctor_asks_the_sensor(plug_in, softcover, monkeypatch):
    monkeypatch.setattr("validation.weiss.inquiry._CLOCK_FRAMES", 60)
    status, out, _ = softcover("doctor", "--port", plug_in().name, "--json")
    told = json.loads(out)
    assert status == 0
    assert "assumed 1 ms" in told["answers"]["clock"]
    assert "mask" in told["assumed"]


def _parameters():
    return fastmodel.Parameters(
        array=TexelArray.grid(14, 6, 3.4e-3),
        spread=fastmodel.Gaussian(sigma_x=0.6, sigma_y=0.6, ksize_x=5, ksize_y=5),
        electronics=fastmodel.WTS_0614_34,
    )


def test_emulate_shows_the_fast_model_and_a_recording(tmp_path, softcover):
    _parameters().save(tmp_path / "derived")
    for show in (tmp_path / "derived", _recorded(tmp_path)):
        status, out, _ = softcover("emulate", tmp_path / "p", "--show", show, "--seconds", "0.1", "--json")
        assert (status, json.loads(out)["show"]) == (0, str(show))
        assert json.loads(out)["tag"] == "softcover"  # the default; public drivers wait for a tag


def _recorded(folder):
    path = folder / "a.csv"
    path.write_text("# rows = 1\ntime,a,b\n0,1,2\n1,3,4\n")
    return path


@pytest.mark.parametrize("command", ["record", "emulate"])
def test_a_port_that_fails_ends_in_one_line(softcover, command):
    status, out, errors = softcover(command, "/dev/ttyNONE9")
    assert (status, out, len(errors.splitlines())) == (3, "", 1)
    assert "no such port" in errors
