"""Damaged files of strangers: a short run of the fuzzer, and a long one."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

PATH = Path(__file__).parents[2] / "benchmarks" / "fuzz_inputs.py"
KINDS = ("sensor file", "positions", "parameters", "npz", "mcap", "csv", "binary stl", "ascii stl")
BAGS = ("ros1 bag", "ros2 folder", "ros2 mcap")


@pytest.mark.parametrize("kind", KINDS + BAGS)
def test_damaged_files_are_read_or_refused(benchmarks, kind, caplog):
    fuzzer = importlib.import_module("fuzz_inputs")
    assert kind in fuzzer.make_good_files()
    for seed in range(6):
        _, outcome, _, _ = fuzzer.try_file(kind, seed)
        assert outcome in ("read", "refused"), outcome
    assert "Traceback" not in caplog.text


@pytest.mark.slow
@pytest.mark.parametrize("files", [220, pytest.param(1000, marks=pytest.mark.bench)])
def test_many_damaged_files_in_worker_processes(files):
    words = [sys.executable, str(PATH), "--files", str(files), "--seed", "7"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)  # noqa: S603 -- ours
    assert done.returncode == 0, done.stdout
    assert sum(json.loads(done.stdout)["outcomes"].values()) == files
    assert "Traceback" not in done.stderr
