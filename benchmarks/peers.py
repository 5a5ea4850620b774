"""What benchmarks against other packages share: their environments, runs in processes of their own, pictures."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
from collections.abc import Sequence
from pathlib import Path
from typing import Any


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


def plot(lines: dict[str, list[tuple[float, float]]], path: Path, *, title: str, **labels: str) -> None:
    """Cost against unknowns, both axes logarithmic."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    for name, points in lines.items():
        axes.loglog(*zip(*points, strict=True), "o-", label=name)
    axes.set(title=title, **labels)
    axes.grid(visible=True, which="both", alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=150)
