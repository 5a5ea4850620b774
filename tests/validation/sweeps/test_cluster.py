"""Sweeps on clusters of dask.distributed on this machine: killed workers, late ones, and ones of another version."""

from __future__ import annotations

import json
import time
from pathlib import Path

import dask
import distributed  # noqa: F401 -- its defaults, before `dask.config.set`
import pytest

import validation
from benchmarks import sweep_scores as scores
from validation.errors import InputError
from validation.sweeps import measurements

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def stand_in(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path / "store"))
    monkeypatch.setitem(measurements.COMMANDS, "derive", scores.stand_in)


def read(path):
    return [line.split() for line in Path(path).read_text().splitlines()]


def test_a_killed_worker_costs_one_design_and_none_is_lost(tmp_path, monkeypatch):
    path = scores.write_sweep(tmp_path, 6)
    monkeypatch.setenv(scores.SETTINGS, json.dumps({"log": str(tmp_path / "log"), "kills": 0.02, "once": True}))
    with dask.config.set({"distributed.worker.preload": [scores.__file__]}):
        assert validation.sweep(path, workers=2).lost == {}
        log = read(tmp_path / "log")
        assert sorted(each for word, each, _ in log if word == "end") == [f"0.0{n}" for n in range(1, 7)]
        assert 1 <= sum(word == "start" for word, _, _ in log) - 6 <= 2


@pytest.fixture
def cluster(tmp_path):
    made = scores.Cluster(tmp_path, {"seconds": 0.5})
    made.start("scheduler")
    yield made
    made.end()


def wait_for(condition, seconds=120):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.2)


def test_a_late_worker_helps_and_one_of_another_version_is_refused(tmp_path, cluster):
    scores.write_sweep(tmp_path, 60)
    cluster.start("early")
    client = cluster.start("client")
    wait_for(cluster.read_log)
    stranger, late = cluster.start("stranger", numpy="1.0"), cluster.start("late")
    wait_for(lambda: client.poll() is not None)
    assert client.returncode == 0
    workers = {int(process) for _, _, process in cluster.read_log()}
    assert workers == {cluster.processes["early"].pid, late.pid}
    wait_for(lambda: stranger.poll() is not None)
    assert "is refused: numpy 1.0 instead of" in (tmp_path / "stranger.txt").read_text()
    found = validation.sweep(tmp_path / "sweep.toml", only_plan=True)
    assert found.words == [""] * 60
    assert all(each[0] for each in found.results)


def test_a_sweep_does_not_start_beside_a_worker_of_another_version(tmp_path, cluster):
    path = scores.write_sweep(tmp_path, 3)
    cluster.start("stranger", numpy="1.0")
    wait_for(lambda: "Registered to" in (tmp_path / "stranger.txt").read_text())
    with pytest.raises(InputError, match=r"worker .* is refused: numpy 1\.0 instead of") as caught:
        validation.sweep(path, cluster=cluster.address)
    assert len(caught.value.faults) == 1
    assert cluster.read_log() == []


def test_a_cluster_that_does_not_answer_is_named(tmp_path):
    with pytest.raises(InputError, match=r"tcp://127\.0\.0\.1:9 does not answer within"):
        validation.sweep(scores.write_sweep(tmp_path, 3), cluster="tcp://127.0.0.1:9")
