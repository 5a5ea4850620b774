"""Compute the truth of cases of tactilebench with softcover, and write the file that the package reads.

    python benchmarks/tactilebench/truth.py [--tier TIER ...] [--cases N] [--processes 1] [--anew]
    python benchmarks/tactilebench/truth.py --seed 7 [--out FILE]

Without a seed the cases are those of the release, and the file is the one in the package.  With a seed they are fresh
ones, for `python -m tactilebench score FORCES --truth FILE`.  Cases that the file or the list of left-out cases already
holds are kept, unless `--anew` is given, so that a stopped run goes on.  A case is left out if softcover refuses it,
does not converge within the time limit, or states intervals that are too wide (`cases_as_softcover.WIDEST`).
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from cases_as_softcover import find_limit, make_array, make_cover, make_indenter, make_pose, measure_width
from fem_reference import press, result_store
from fem_reference.small_strain_contact.several_indenters import Body, press_together
from meshes import Cover
from meshes.array_types import FloatArray
from tactilebench import BenchError, Case, load_truth, save_truth
from tactilebench.case import DATA
from tactilebench.draw import RELEASES, TIERS, draw

#: Processor time after which a case is given up [s].
LIMIT = 600
#: Wanted relative error where the usual grids leave intervals that are too wide [-].
ACCURACY = 2e-3
#: Cells per thickness under two bodies, on the two grids [-].
PAIR_CELLS = (16, 32)
#: Time between two writings of the file [s].
INTERVAL = 30.0


def solve(case: Case, accuracy: float | None = None) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Compute forces, half widths, force outside and its half width of a case, in the shapes of `tactilebench.Truth`.

    Args:
        case: The case.
        accuracy: Wanted relative error, for finer grids than usual [-].

    Raises:
        ValueError: If softcover refuses the case.
        RuntimeError: If it does not converge.
    """
    cover, array = make_cover(case), make_array(case)
    if len(case.bodies) > 1:
        assert isinstance(cover, Cover)
        bodies = [
            Body(indenter=make_indenter(each), load=each.load, at=each.at[:2], yaw=each.yaw) for each in case.bodies
        ]
        found: Any = press_together(cover, array, bodies, cells=PAIR_CELLS)
        if min(found.depths) <= 0 or max(found.depths) >= cover.thickness:
            raise ValueError("a body is lifted, or would pierce the cover")
        return found.texel_forces, found.texel_errors, np.array(found.outside), np.array(found.outside_error)
    (body,) = case.bodies
    places = case.motion.at if case.motion else (None,)
    presses = [
        press(
            cover,
            array,
            make_indenter(body),
            make_pose(body, at),
            load=load,
            friction=case.cover.friction,
            accuracy=accuracy,
        )
        for at, load in zip(places, case.loads, strict=True)
    ]
    if any(each.texel_errors is None or not np.isfinite(each.texel_errors).all() for each in presses):
        raise ValueError("the press states no errors of its texels")
    columns = [
        np.array([getattr(each, name) for each in presses])
        for name in ("texel_forces", "texel_errors", "outside", "outside_error")
    ]
    return tuple(each if case.motion else each[0] for each in columns)  # type: ignore[return-value]


def can_refine(case: Case) -> bool:
    """Return whether finer grids than usual take seconds: one body without friction on wide linear layers."""
    wide = not (case.cover.geometry or case.cover.size or case.cover.friction)
    return wide and len(case.bodies) == 1 and case.cover.layers[0].law == "linear-elastic"


def solve_case(version_: str, seed: int | None, name: str) -> tuple[str, list[Any] | str, float]:
    """Compute one case by name; returns the name, the arrays or why there are none, and the processor time [s]."""
    case = next(each for each in draw(version_, seed) if each.name == name)
    started = time.process_time()
    signal.signal(signal.SIGPROF, _give_up)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        arrays = [np.asarray(each) for each in solve(case)]
        width = measure_width(case, *arrays[:2])
        if not width <= find_limit(case) and can_refine(case):
            arrays = [np.asarray(each) for each in solve(case, ACCURACY)]
            width = measure_width(case, *arrays[:2])
        if not width <= find_limit(case):
            why = f"median half width {width:.2%} of the load" if width > 0 else "no texel bears 1 % of the load"
            return name, why, time.process_time() - started
        return name, arrays, time.process_time() - started
    except Exception as error:  # noqa: BLE001 -- the reason is listed
        return name, f"{type(error).__name__}: {' '.join(str(error).split())}", time.process_time() - started
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def _give_up(*_: object) -> None:
    raise TimeoutError(f"no result within {LIMIT} s of processor time")


class Build:
    """Cases of one version and seed, those that are solved, and those that are left out with the reason.

    Args:
        version_: Version of the benchmark.
        seed: Seed of fresh cases; None for those of the release.
        out: File of the truth.

    Raises:
        BenchError: If the file holds no truth, or that of another seed, or its folder does not exist.
    """

    def __init__(self, version_: str, seed: int | None, out: Path) -> None:
        self.version, self.seed, self.out = version_, seed, out
        # Beside the package, not in it.
        folder = out.parent if out.parent != DATA else Path(__file__).parent
        self.left_out_file = folder / f"{out.stem}.left-out.json"
        self.drawn = {case.name: case for case in draw(version_, seed)}
        self.solved: dict[str, Case] = {}
        self.left_out: dict[str, str] = {}
        if out.exists():
            self.solved = {case.name: case for case in load_truth(out)}
        if strange := sorted(self.solved.keys() - self.drawn.keys()):
            raise BenchError(f"--out: {out} holds {strange[0]}, a case of another seed; name another file")
        if not out.parent.is_dir():
            raise BenchError(f"--out: {out.parent} is no folder; make it first")
        if self.left_out_file.exists():
            self.left_out = json.loads(self.left_out_file.read_text())

    def choose(self, tiers: Sequence[str], count: int | None, *, anew: bool) -> list[str]:
        """Return the names of the first `count` cases of each tier that are to be computed."""
        names = [
            name for tier in tiers for name in [case.name for case in self.drawn.values() if case.tier == tier][:count]
        ]
        return [name for name in names if anew or (name not in self.solved and name not in self.left_out)]

    def add(self, name: str, found: list[Any] | str) -> None:
        """Add the result of a case, or why there is none."""
        self.solved.pop(name, None)
        self.left_out.pop(name, None)
        if isinstance(found, str):
            self.left_out[name] = found
            return
        seed = "" if self.seed is None else f" --seed {self.seed}"
        command = f"python benchmarks/tactilebench/truth.py --name {name}{seed}"
        self.solved[name] = self.drawn[name].with_truth(*found, command=command)

    def write(self) -> None:
        """Write both files, each as a whole."""
        kept = [self.solved[name] for name in self.drawn if name in self.solved]
        if kept:
            partial_ = self.out.with_name(f".{self.out.name}.part.npz")
            made_by = f"softcover {version('softcover')}, solver {result_store.code_version()}"
            save_truth(partial_, kept, seed=self.seed, made_by=made_by)
            partial_.replace(self.out)
        text = json.dumps({name: self.left_out[name] for name in self.drawn if name in self.left_out}, indent=1) + "\n"
        partial_ = self.left_out_file.with_name(f".{self.left_out_file.name}.part")
        partial_.write_text(text)
        partial_.replace(self.left_out_file)

    def run(self, names: Sequence[str], processes: int) -> None:
        """Compute cases and write them as they come."""
        started = written = time.monotonic()
        with multiprocessing.get_context("spawn").Pool(processes, maxtasksperchild=40) as pool:
            work = partial(solve_case, self.version, self.seed)
            for number, (name, found, seconds) in enumerate(pool.imap_unordered(work, names), start=1):
                self.add(name, found)
                what = f"left out: {found}" if isinstance(found, str) else "solved"
                left = (time.monotonic() - started) / number * (len(names) - number) / 60
                print(f"{number} of {len(names)}, {left:.0f} min left: {name} {what}, {seconds:.0f} s", flush=True)
                if time.monotonic() - written > INTERVAL:
                    self.write()
                    written = time.monotonic()
        self.write()


def main() -> int:
    """Compute the cases and print how many of each tier there are, and which are left out."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--version", default="2026.1", choices=sorted(RELEASES))
    parser.add_argument("--tier", action="append", choices=sorted(TIERS), help="only this tier; may be repeated")
    parser.add_argument("--name", action="append", help="only the case of this name; may be repeated")
    parser.add_argument("--cases", type=int, help="only the first cases of each tier")
    parser.add_argument("--seed", type=int, help="draw fresh cases")
    parser.add_argument("--out", type=Path, help="file to write")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--anew", action="store_true", help="compute cases again that the file already holds")
    given = parser.parse_args()
    if min(given.processes, 1 if given.cases is None else given.cases) < 1:
        parser.error("--processes, --cases: must be 1 or more")
    usual = DATA / f"{given.version}.npz" if given.seed is None else Path(f"truth-{given.version}-s{given.seed}.npz")
    try:
        build = Build(given.version, given.seed, given.out or usual)
    except BenchError as error:
        print(error, file=sys.stderr)
        return 2
    if unknown := [name for name in given.name or () if name not in build.drawn]:
        print(f"--name {unknown[0]}: there is no such case", file=sys.stderr)
        return 2
    names = given.name or build.choose(given.tier or list(TIERS), given.cases, anew=given.anew)
    build.run(names, given.processes)
    for tier in TIERS:
        parts = (build.solved, build.left_out)
        counts = [sum(build.drawn[name].tier == tier for name in part) for part in parts]
        print(f"{tier}: {counts[0]} solved, {counts[1]} left out of {TIERS[tier][0]}")
    for name, why in build.left_out.items():
        print(f"{name}: {why}")
    print(f"{build.out}: {build.out.stat().st_size / 1024:.0f} KiB" if build.out.exists() else "nothing is solved")
    return 0


if __name__ == "__main__":
    sys.exit(main())
