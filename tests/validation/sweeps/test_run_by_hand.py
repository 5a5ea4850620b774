"""Runs of sweeps: tasks on a cluster that is stood in for, keys and results in the store, plans and their words."""

import functools
import os
from dataclasses import replace
from types import SimpleNamespace

import pytest

import validation
from fem_reference import result_store
from fem_reference.errors import ConvergenceError
from validation.errors import InputError
from validation.sensor_file import BUILT_IN
from validation.sweeps import measurements
from validation.sweeps.measurements import Measurement, Quantity
from validation.sweeps.run import check_store, compute, find_key, list_versions, read_result, run_here

pytestmark = pytest.mark.usefixtures("store")

SENSOR = BUILT_IN["wts-0614-34"]
DERIVE, LIMITS = (Measurement(command=name, options={}) for name in ("derive", "limits"))


@pytest.fixture
def commands(monkeypatch):
    """Replace two commands by quick ones; the list of those that ran."""
    ran = []

    def derive(subject, **options):
        ran.append(("derive", subject.sensor.name, options))
        if "fail" in options:
            raise options["fail"]
        return {"a": Quantity(1.5, 1.25, 2.0, "N")}

    def limits(subject, **_):
        ran.append(("limits", subject.sensor.name, {}))
        raise ConvergenceError("no\n solution  at all")

    monkeypatch.setitem(measurements.COMMANDS, "derive", derive)
    monkeypatch.setitem(measurements.COMMANDS, "limits", limits)
    return ran


def test_results_and_refusals_are_stored_once(commands):
    assert read_result(find_key(SENSOR, DERIVE)) is None
    compute(SENSOR, [DERIVE, LIMITS])
    found, failed = (read_result(find_key(SENSOR, each)) for each in (DERIVE, LIMITS))
    assert found["quantities"] == {"a": Quantity(1.5, 1.25, 2.0, "N")}
    assert isinstance(found["quantities"]["a"], Quantity)
    assert (found["words"], failed["words"]) == ("", "limits: did not converge: no solution at all")
    assert (failed["quantities"], 0 <= found["seconds"] < 5) == ({}, True)
    compute(SENSOR, [LIMITS, DERIVE])
    assert [name for name, *_ in commands] == ["derive", "limits"]


def test_a_refusal_is_told_without_a_word_on_convergence(commands, monkeypatch):
    def refuse(_):
        raise ValueError("too  thin")

    monkeypatch.setitem(measurements.COMMANDS, "derive", refuse)
    compute(SENSOR, [DERIVE])
    assert read_result(find_key(SENSOR, DERIVE))["words"] == "derive: too thin"


def test_a_key_depends_on_sensor_command_and_options_and_not_on_the_source():
    key = find_key(SENSOR, DERIVE)
    assert key == find_key(replace(SENSOR, source="elsewhere.toml", sources={"pitch": "a guess"}), DERIVE)
    assert key != find_key(SENSOR, LIMITS)
    assert key != find_key(SENSOR, Measurement(command="derive", options={"format": "svg"}))
    assert key != find_key(replace(SENSOR, friction=0.25), DERIVE)
    assert {"python", "softcover", "mujoco", "numpy", "solver", "sources"} <= set(list_versions())
    assert len(list_versions()["sources"]) == 16


def test_designs_are_computed_one_by_one_here(commands):
    told = []
    run_here({4: (SENSOR, [DERIVE]), 2: (replace(SENSOR, name="other"), [DERIVE])}, told.append)
    assert told == [4, 2]
    assert [name for _, name, _ in commands] == ["wts-0614-34", "other"]


def test_a_store_that_cannot_be_written_is_named(store):
    check_store()
    store.write_text("a file")
    with pytest.raises(InputError, match=r"SOFTCOVER_STORE: .*store .*it keeps the results"):
        check_store()


class Future(SimpleNamespace):
    """A future that has ended."""

    __hash__ = object.__hash__

    def exception(self):
        return self.error


class Client:
    """A client of dask that stands in for a cluster, or the cluster itself; notes what it is asked in `state`."""

    loop, kind = "loop", "client"

    def __init__(self, state, **options):
        self.state = state
        state.made.append((self.kind, options))
        if options.get("address") == "silent:1":
            raise OSError("refused")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return False

    def run(self, _check, *given):
        self.state.checked = given
        return self.state.faults

    def register_plugin(self, plugin, name):
        self.state.plugins.append((name, plugin.client))

    def unregister_worker_plugin(self, name):
        self.state.plugins.append((name, None))
        raise OSError("the scheduler is gone")

    def submit(self, _function, *_task, key):
        self.state.keys.append(key)
        status, error = self.state.ends[len(self.state.keys) - 1]
        return Future(status=status, error=error)


class LocalCluster(Client):
    """A cluster on this machine."""

    kind = "local"


@pytest.fixture
def cluster(monkeypatch):
    """A stand-in for dask whose futures end as told."""
    pytest.importorskip("distributed")
    from validation.sweeps import cluster as module

    state = SimpleNamespace(made=[], ends={}, faults={"tcp://one": ""}, plugins=[], keys=[], module=module)
    monkeypatch.setattr(module, "Client", functools.partial(Client, state))
    monkeypatch.setattr(module, "LocalCluster", functools.partial(LocalCluster, state))
    monkeypatch.setattr(module, "as_completed", lambda futures, loop: list(futures))
    return state


def make_tasks(count):
    return {10 * (k + 1): (replace(SENSOR, name=f"pad {k}"), [DERIVE, LIMITS]) for k in range(count)}


def test_a_cluster_tells_finished_designs_and_why_others_are_lost(cluster):
    from distributed import KilledWorker

    cluster.ends = dict(
        enumerate([
            ("finished", None), ("error", MemoryError("2 GB")), ("cancelled", None), ("finished", None),
            ("error", KilledWorker("task", SimpleNamespace(address="tcp://one"), 3)), ("lost", None),
        ])
    )  # fmt: skip
    told, tasks = [], make_tasks(6)
    lost = cluster.module.run_there(tasks, told.append, workers=3, address=None)
    assert told == [10, 40]
    assert lost == {
        20: "MemoryError: 2 GB", 30: "the cluster was lost", 60: "the cluster was lost",
        50: "its worker was killed again and again (memory, time)",
    }  # fmt: skip
    assert cluster.keys == [find_key(sensor, DERIVE) for sensor, _ in tasks.values()]
    (_, local), (_, client) = cluster.made[:2]
    assert (local["n_workers"], local["threads_per_worker"], local["processes"]) == (3, 1, True)
    assert (client["timeout"], client["set_as_default"]) == (10, False)
    versions, folder, token = cluster.checked
    assert (versions, folder) == (list_versions(), str(result_store.folder().absolute()))
    assert result_store.unpack(result_store.read(token)) == list_versions()
    assert cluster.plugins == [("softcover-sweep", cluster.checked), ("softcover-sweep", None)]


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("nowhere", "--cluster: nowhere is no address and no file; write for example tcp://node1:8786"),
        ("silent:1", "--cluster: silent:1 does not answer within 10 s (OSError)"),
    ],
)
def test_a_cluster_that_cannot_be_reached_is_refused(cluster, address, words):
    with pytest.raises(InputError) as refused:
        cluster.module.run_there(make_tasks(1), print, workers=None, address=address)
    assert words in str(refused.value)


def test_a_cluster_is_reached_by_address_or_by_scheduler_file(cluster, tmp_path):
    cluster.ends = {0: ("finished", None), 1: ("finished", None)}
    (tmp_path / "scheduler.json").write_text("{}")
    for address in ("tcp://a:1", str(tmp_path / "scheduler.json")):
        cluster.module.run_there(make_tasks(1), lambda _: None, workers=None, address=address)
    clients = [options for kind, options in cluster.made if kind == "client"]
    assert (clients[0]["address"], clients[1]["scheduler_file"]) == ("tcp://a:1", str(tmp_path / "scheduler.json"))
    assert "address" not in clients[1]
    assert not any(kind == "local" for kind, _ in cluster.made)


def test_a_worker_that_cannot_compute_is_refused_before_anything_is_computed(cluster):
    cluster.faults = {"tcp://one": "", "tcp://two": "numpy 1 instead of 2"}
    with pytest.raises(InputError, match="--cluster: worker tcp://two is refused: numpy 1 instead of 2"):
        cluster.module.run_there(make_tasks(1), print, workers=2, address=None)
    assert cluster.keys == []


def test_a_worker_compares_versions_and_sees_the_store(cluster, monkeypatch, tmp_path):
    check, versions = cluster.module.check_worker, list_versions()
    assert check({**versions, "numpy": "0", "rust": "1"}, "there", "token") == (
        f"numpy {versions['numpy']} instead of 0, rust None instead of 1; start it in the environment of the client"
    )
    folder = str(tmp_path / "shared")
    assert check(versions, folder, "0" * 64).startswith(f"it does not see the store {folder}; set SOFTCOVER_STORE")
    assert os.environ["SOFTCOVER_STORE"] == folder
    key = result_store.make_key("sweep token", {})
    result_store.write(key, result_store.pack({"a": 1}), {"kind": "x", "code": "", "inputs": {}})
    assert check(versions, folder, key) == ""
    closed = []
    worker = SimpleNamespace(
        address="tcp://late", close="close",
        loop=SimpleNamespace(add_callback=lambda *given, **options: closed.append((given, options))),
    )  # fmt: skip
    cluster.module.Guard(versions, folder, key).setup(worker)
    assert closed == []
    cluster.module.Guard(versions, folder, "0" * 64).setup(worker)
    assert closed == [(("close",), {"reason": "refused"})]


def write(folder, thicknesses, measure='"derive"'):
    path = folder / "sweep.toml"
    path.write_text(
        f'sensor = "wts-0614-34"\nmeasure = {measure}\n[designs]\n"cover.layer[0].thickness" = {thicknesses}\n'
    )
    return path


def test_the_cost_is_told_after_the_first_design_or_by_those_in_the_store(commands, tmp_path, monkeypatch):
    from validation.sweeps import run

    clock = iter([0.0, 90.0] + [100.0, 130.0] * 3 + [200.0, 260.0] * 9)
    monkeypatch.setattr(run.time, "process_time", lambda: next(clock))
    lines, heard = [], []
    validation.sweep(write(tmp_path, ["1 mm", "2 mm", "-1 mm"]), announce=lines.append, progress=heard.append)
    assert (lines[0], len(lines)) == ("3 designs: 0 stored, 1 refused, 2 to compute", 2)
    assert lines[1].startswith("one design takes 90 s of processor time, 1 about ")
    assert heard == ["0/2 designs", "1/2 designs", "2/2 designs"]
    lines.clear()
    validation.sweep(write(tmp_path, ["1 mm", "2 mm", "3 mm", "4 mm"]), announce=lines.append)
    assert lines[0] == "4 designs: 2 stored, 0 refused, 2 to compute"
    assert lines[1].startswith("one design takes 60 s of processor time, 2 about 2")  # 90 s and 30 s in the mean
    assert len(lines) == 2


def test_results_that_are_missing_in_the_store_at_the_end_are_told(commands, tmp_path, monkeypatch):
    monkeypatch.setattr(result_store, "write", lambda *_: None)
    found = validation.sweep(write(tmp_path, ["1 mm", "2 mm"]))
    assert found.words == ["its result is not in the store"] * 2
    assert len(commands) == 2
    planned = validation.sweep(write(tmp_path, ["1 mm", "2 mm"]), only_plan=True)
    assert (planned.words, len(commands)) == (["", ""], 2)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"workers": 0}, "--workers: must be at least 1, not 0"),
        ({"workers": 2, "cluster": "a:1"}, "give one of the two"),
        ({"out": "out", "only_plan": True}, "--out, --only-plan: nothing is measured"),
        ({"workers": -3}, "must be at least 1, not -3"),
    ],
)  # fmt: skip
def test_options_that_exclude_each_other_are_refused(commands, tmp_path, options, words):
    with pytest.raises(InputError) as refused:
        validation.sweep(write(tmp_path, ["1 mm"]), **options)
    assert words in str(refused.value)
    assert commands == []


def test_an_option_that_one_design_takes_is_accepted_for_all(commands, tmp_path, monkeypatch):
    refusals = {1.0: "too thin", 2.0: "", 3.0: "too thick"}

    def check(self, sensor):
        if words := refusals[round(1e3 * sensor.cover.thickness, 6)]:
            raise InputError(words)

    monkeypatch.setattr(Measurement, "check", check)
    assert len(validation.sweep(write(tmp_path, ["1 mm", "2 mm", "3 mm"])).designs) == 3
    with pytest.raises(InputError, match="too thin"):
        validation.sweep(write(tmp_path, ["1 mm", "3 mm"]))


def test_missing_measurements_of_a_design_alone_are_computed(commands, tmp_path):
    validation.sweep(write(tmp_path, ["1 mm"]))
    lines = []
    found = validation.sweep(write(tmp_path, ["1 mm"], '["derive", "limits"]'), announce=lines.append)
    assert [name for name, *_ in commands] == ["derive", "limits"]
    assert lines[0] == "1 designs: 0 stored, 0 refused, 1 to compute"
    assert found.words == ["limits: did not converge: no solution at all"]


def test_workers_take_the_tasks_and_share_the_time(commands, cluster, tmp_path, monkeypatch):
    asked, lines = [], []

    def run_there(tasks, told, *, workers, address):
        asked.append((list(tasks), workers, address))
        run_here(dict(list(tasks.items())[:1]), told)
        return {1: "its worker was killed"}

    monkeypatch.setattr(cluster.module, "run_there", run_there)
    path = write(tmp_path, ["1 mm", "2 mm", "3 mm"])
    found = validation.sweep(path, workers=1, announce=lines.append)
    assert asked == [([0, 1, 2], 1, None)]
    assert found.words == ["", "its worker was killed", "its result is not in the store"]
    assert lines[1].endswith(" on 1 workers")
    validation.sweep(path, cluster="tcp://a:1")
    assert asked[1] == ([1, 2], None, "tcp://a:1")


def test_a_wish_for_a_quantity_that_is_not_known_before_is_refused_after_the_first_design(tmp_path, monkeypatch):
    ran = []
    monkeypatch.setitem(
        measurements.COMMANDS, "regress", lambda _, group: ran.append(group) or {"a": Quantity(1.0, 1.0, 1.0, "N")}
    )
    path = write(tmp_path, ["1 mm", "2 mm"], '"regress kernel"')
    with pytest.raises(InputError, match="unknown quantity 'b'"):
        validation.sweep(path, wish="b < 1 N")
    assert ran == ["kernel"]
    assert [each.state for each in validation.sweep(path, wish="a < 2 N").judge()] == ["certain", "certain"]
