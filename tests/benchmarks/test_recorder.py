"""The benchmark of recorder and emulator with all kinds of faults at once, for less than its ten minutes."""

import importlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("pty", reason="pseudo-terminals need Linux or macOS")

from tests.support.virtual_port import VirtualPort
from validation.recordings import mcap_reader
from validation.recordings.capture import record
from validation.weiss.sensor import Sensor
from validation.weiss.virtual import Misbehaviour

_SCRIPT = Path(__file__).parents[2] / "benchmarks" / "recorder.py"


@pytest.fixture
def compare(monkeypatch):
    """The comparison of the benchmark."""
    monkeypatch.syspath_prepend(str(_SCRIPT.parent))
    return importlib.import_module("recorder").compare


@pytest.mark.slow
def test_all_faults_at_once_lose_no_gap_and_no_time(tmp_path):
    words = [sys.executable, _SCRIPT, "--seconds", "45", "--out", tmp_path / "a.mcap"]
    run = subprocess.run(words, capture_output=True, text=True, check=False)  # noqa: S603 -- own script
    assert run.returncode == 0, run.stdout + run.stderr
    assert "passed" in run.stdout


@pytest.mark.slow
def test_the_comparison_sees_what_is_wrong(tmp_path, compare):
    """A recording with faults passes; the same without its gaps, with wrong gaps or with arrival times does not."""
    port = VirtualPort(misbehaviour=Misbehaviour(rates={"lose": 0.05, "cut": 0.02}, pauses=((0.5, 1.0),)))
    try:
        with Sensor(port.name) as sensor:
            record(sensor, tmp_path / "a.mcap", seconds=1.6)
    finally:
        port.unplug()
    recording = mcap_reader.read(tmp_path / "a.mcap")
    assert compare(recording).is_good
    assert compare(recording).long == 1
    assert not compare(replace(recording, gaps=())).is_good
    wrong = tuple(gap.replace(" 1 frames", " 2 frames") for gap in recording.gaps)
    assert compare(replace(recording, gaps=wrong)).short_errors > 0
    late = recording.times + 0.01 * (recording.ticks % 2)
    assert not compare(replace(recording, times=late)).is_good
