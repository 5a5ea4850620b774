"""Costs and losses of `softcover sweep`.

    python benchmarks/sweep_scores.py overhead              cost of a design beside its measurement, in one process
    python benchmarks/sweep_scores.py ratio --designs 200   two workers over one process: processor time, wall time
    python benchmarks/sweep_scores.py equal --designs 8     1, 2 and 4 workers give the same numbers, bit by bit
    python benchmarks/sweep_scores.py kills --kills 30      designs computed again and lost under random kills

`ratio` and `equal` derive designs of two layers; three of them are refused, and must be listed.  `overhead` and `kills`
replace the measurement by one that waits.  `kills` starts scheduler and workers as the page on sweeps says.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import validation
from validation.sweeps import measurements, run
from validation.sweeps.measurements import Quantity

HERE = Path(__file__).resolve()
#: Settings of the stand-in: `log`, `seconds`, `kills` (thickness [mm] that kills its worker), `once`, `numpy`.
SETTINGS = "SOFTCOVER_STAND_IN"
TWO_LAYERS = """sensor = "base.toml"
measure = ["derive"]
draw = "sobol"
count = {count}
[designs]
"cover.layer[0].thickness" = "0.5 mm : 2 mm"
"cover.layer[1].thickness" = "0.5 mm : 2 mm"
"cover.layer[1].material" = ["neoprene", "sylgard-184", "latex"]
"array.pitch" = "2.5 mm : 4 mm"
"electronics.noise" = "-0.0761 mN : 5 mN"
"""
BASE = """[array]
rows = 6
columns = 6
pitch = "3 mm"
[cover]
layer = [{ thickness = "1 mm", material = "latex" }, { thickness = "1 mm", material = "neoprene" }]
[electronics]
noise = "5 mN"
"""


def stand_in(subject: measurements.Subject) -> dict[str, Quantity]:
    """Wait instead of measuring; write a line to a log before and after."""
    settings = json.loads(os.environ.get(SETTINGS, "{}"))
    thickness = round(1e3 * subject.sensor.cover.thickness, 6)
    log = Path(settings.get("log", os.devnull))

    def write(word: str) -> None:
        with log.open("a") as file:
            file.write(f"{word} {thickness} {os.getpid()}\n")

    again = f"start {thickness} " in (log.read_text() if log.is_file() else "")
    write("start")
    if settings.get("kills") == thickness and not (settings.get("once") and again):
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(settings.get("seconds", 0.0))
    write("end")
    return {"thickness": Quantity(thickness, thickness, thickness, "mm")}


def dask_setup(_worker: object) -> None:
    """Replace the measurement in a worker, and its version of numpy; dask calls this function of a preloaded file."""
    settings = json.loads(os.environ.get(SETTINGS, "{}"))
    measurements.COMMANDS["derive"] = stand_in
    if "numpy" in settings:
        run.list_versions()["numpy"] = settings["numpy"]  # the cached result


def write_sweep(folder: Path, count: int) -> Path:
    """Write a sweep of designs of one key, for the stand-in."""
    path = folder / "sweep.toml"
    values = f'"0.01 mm : {count / 100} mm : {count}"'
    path.write_text(f'sensor = "wts-0614-34"\nmeasure = "derive"\n[designs]\n"cover.layer[0].thickness" = {values}\n')
    return path


def score_overhead(count: int) -> None:
    """Print the cost of one design beside its measurement, in one process."""
    dask_setup(None)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SOFTCOVER_STORE"] = f"{folder}/store"
        path = write_sweep(Path(folder), count)
        validation.sweep(path, only_plan=True)  # imports
        wall, processor = time.perf_counter(), time.process_time()
        validation.sweep(path)
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(f"{count} designs: {1e3 * wall / count:.1f} ms wall, {1e3 * processor / count:.1f} ms processor time each")


def run_sweep(folder: Path, name: str, *options: str) -> tuple[dict, float, float]:
    """Run the command with a store of its own; return its JSON, the processor time of all processes, wall time [s]."""
    environment = {
        **os.environ,
        "SOFTCOVER_STORE": str(folder / name),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    before, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    words = [str(Path(sys.executable).parent / "softcover"), "sweep", "two.toml", "--json", *options]
    done = subprocess.run(words, cwd=folder, env=environment, stdout=subprocess.PIPE, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(done.stdout), processor, time.perf_counter() - wall


def write_two_layers(folder: Path, count: int) -> None:
    """Write the sweep of two layers; the noise of three of 200 designs is negative, which is refused."""
    (folder / "base.toml").write_text(BASE)
    (folder / "two.toml").write_text(TWO_LAYERS.format(count=count))


def score_ratio(count: int) -> None:
    """Print the cost of two workers over that of one process."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_two_layers(folder, count)
        run_sweep(folder, "warm", "--only-plan")
        (one, cpu, wall), (two, cpu_2, wall_2) = run_sweep(folder, "one"), run_sweep(folder, "two", "--workers", "2")
    print(f"{count} designs, one process: {cpu:.1f} s processor, {wall:.1f} s wall ({cpu / count:.2f} s a design)")
    print(f"two workers: {cpu_2:.1f} s processor, {wall_2:.1f} s wall; load average {os.getloadavg()[0]:.1f}")
    print(f"ratio: processor {cpu_2 / cpu:.3f} (asked 1.15), wall {wall_2 / wall:.3f} (asked 0.6 on idle cores)")
    print(f"equal: {one['designs'] == two['designs']}; refused: {sum(bool(each['words']) for each in two['designs'])}")


def score_equal(count: int) -> None:
    """Print whether 1, 2 and 4 workers give the same numbers."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_two_layers(folder, count)
        found = [run_sweep(folder, f"with-{n}", "--workers", str(n))[0]["designs"] for n in (1, 2, 4)]
    print(f"{count} designs, 1, 2 and 4 workers bit-equal: {found[0] == found[1] == found[2]}")


class Cluster:
    """Scheduler, workers and client of a sweep on the loopback interface, each a process that can be killed.

    Args:
        folder: Folder of the sweep file, the store, the log and the outputs.
        settings: Settings of the stand-in.
    """

    def __init__(self, folder: Path, settings: dict) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.folder, self.address = folder, f"tcp://127.0.0.1:{self.port}"
        self.settings = {"log": str(folder / "log"), **settings}
        self.processes: dict[str, subprocess.Popen] = {}

    def start(self, name: str, **settings: object) -> subprocess.Popen:
        """Start `scheduler`, `client`, or a worker of any other name."""
        dask = str(Path(sys.executable).parent / "dask")
        python = [sys.executable, str(HERE), "client", str(self.folder / "sweep.toml"), self.address]
        words = {
            "scheduler": [dask, "scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"],
            "client": python,
        }.get(
            name,
            [dask, "worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--preload", str(HERE)],
        )
        environment = {**os.environ, "SOFTCOVER_STORE": str(self.folder / "store"), "OMP_NUM_THREADS": "1"}
        environment |= {SETTINGS: json.dumps({**self.settings, **settings}), "PYTHONPATH": str(HERE.parents[1])}
        with (self.folder / f"{name}.txt").open("a") as out:
            self.processes[name] = subprocess.Popen(words, cwd=self.folder, env=environment, stdout=out, stderr=out)
        return self.processes[name]

    def read_log(self) -> list[list[str]]:
        """Return word, thickness and process of each line of the log."""
        log = self.folder / "log"
        return [line.split() for line in log.read_text().splitlines()] if log.exists() else []

    def end(self) -> None:
        """End all processes."""
        for process in self.processes.values():
            process.kill()
            process.wait()


def score_kills(count: int, kills: int, seed: int) -> None:
    """Kill random processes of a sweep, start them again, and print what it cost."""
    chance, killed = random.Random(seed), []  # noqa: S311 -- no secret
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_sweep(folder, count)
        cluster = Cluster(folder, {"seconds": 0.5})
        names = ("scheduler", "worker 1", "worker 2", "client")
        try:
            while True:
                for each in names:
                    process = cluster.processes.get(each)
                    is_done = each == "client" and process is not None and process.poll() == 0
                    if not is_done and (process is None or process.poll() is not None):
                        cluster.start(each)
                if cluster.processes["client"].poll() == 0:
                    break
                before = len(cluster.read_log())
                deadline = time.monotonic() + 30  # Each round lets the sweep go on before the next kill.
                while (
                    len(cluster.read_log()) < before + 4
                    and time.monotonic() < deadline
                    and cluster.processes["client"].poll() is None
                ):
                    time.sleep(0.1)
                time.sleep(chance.uniform(0, 1))
                if len(killed) < kills:
                    killed.append(chance.choice(names))
                    cluster.processes[killed[-1]].kill()
                    cluster.processes[killed[-1]].wait()
        finally:
            cluster.end()
        log = cluster.read_log()
        os.environ["SOFTCOVER_STORE"] = str(folder / "store")
        found = validation.sweep(folder / "sweep.toml", only_plan=True)
    started, ended = (sum(line[0] == word for line in log) for word in ("start", "end"))
    missing = sum(each[0] is None for each in found.results)
    print(f"{count} designs, {len(killed)} kills ({', '.join(f'{killed.count(each)} of {each}' for each in names)})")
    print(f"started {started} times, ended {ended} times: {started - count} computed again, {missing} lost")


def main() -> None:
    """Run one of the measurements."""
    if sys.argv[1:2] == ["client"]:
        dask_setup(None)
        found = validation.sweep(sys.argv[2], cluster=sys.argv[3], announce=print)
        sys.exit(3 if found.lost else 0)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("overhead", "ratio", "equal", "kills"))
    parser.add_argument("--designs", type=int, default=100)
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if options.what == "kills":
        score_kills(options.designs, options.kills, options.seed)
    else:
        {"overhead": score_overhead, "ratio": score_ratio, "equal": score_equal}[options.what](options.designs)


if __name__ == "__main__":
    main()
