"""What benchmarks share: runs in turn, environments and processes of other packages, their options, and pictures."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import venv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

Lines = dict[str, list[tuple[float, float]]]


def time_in_turn(runs: dict[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Processor times of functions that are called in turn, so that other work on the machine counts little [s]."""
    taken: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            start = time.process_time()
            run()
            taken[name].append(time.process_time() - start)
    return taken


def environment(folder: Path) -> dict[str, str]:
    """Variables of a process with one thread and a store of its own."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    return {**os.environ, **threads, "SOFTCOVER_STORE": str(folder / "store")}


def answered(command: Sequence[str], variables: dict[str, str], name: str, *, limit: float) -> dict[str, Any] | None:
    """What a process writes on its last line as JSON; None, and a word why, where it fails or takes too long [s]."""
    try:
        done = subprocess.run(command, env=variables, capture_output=True, text=True, check=True, timeout=limit)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        print(f"  {name}: {(getattr(error, 'stderr', '') or str(error)).strip().splitlines()[-1]}")
        return None
    return dict(json.loads(done.stdout.splitlines()[-1]))


def installed(folder: Path, *packages: str) -> Path:
    """An environment with a peer, which softcover itself never needs."""
    venv.create(folder / "peer", with_pip=True)
    python = folder / "peer" / ("Scripts" if sys.platform == "win32" else "bin") / "python"
    subprocess.run([str(python), "-m", "pip", "install", "--quiet", *packages], check=True)
    return python


def make_parser(description: str | None) -> argparse.ArgumentParser:
    """Make the parser of a comparison with another package."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worker", type=json.loads, help=argparse.SUPPRESS)
    parser.add_argument("--peer", type=Path, help="a Python that has the other package; installed when not given")
    parser.add_argument("--scaling", action="store_true", help="cost against unknowns as well")
    parser.add_argument("--plot", type=Path, help="picture of the scaling")
    parser.add_argument("--json", type=Path, help="all results")
    return parser


def finish(given: argparse.Namespace, summary: dict[str, Any], scaling: Callable[[], Lines], **labels: str) -> None:
    """Measure and draw the cost against the size, and write all results, as the options say."""
    if given.scaling or given.plot:
        summary["scaling"] = scaling()
        for name, points in summary["scaling"].items():
            print(name, *(f"\n  {unknowns:8.0f} {cpu:8.3f}" for unknowns, cpu in points))
    if given.plot:
        draw([(labels, summary["scaling"])], given.plot)
    if given.json:
        given.json.write_text(json.dumps(summary, indent=1))


def draw(panels: list[tuple[dict[str, str], Lines]], path: Path) -> None:
    """Draw lines of two quantities beside each other, both axes logarithmic: labels and lines of each panel."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure = plt.figure(figsize=(1.5 + 4.5 * len(panels), 4), layout="constrained")
    for number, (labels, lines) in enumerate(panels, start=1):
        axes = figure.add_subplot(1, len(panels), number)
        for name, points in lines.items():
            axes.loglog(*zip(*points, strict=True), "o-", label=name)
        axes.set(**labels)
        axes.grid(visible=True, which="both", alpha=0.3)
        axes.legend()
    figure.savefig(path, dpi=150)
