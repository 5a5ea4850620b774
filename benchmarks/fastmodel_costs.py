"""What the fast model costs: every contact method against a bare plate, and the signal chain, in one run.

Ratios of the shortest of interleaved runs in processor time, so that other work on the machine counts little.  1 kHz
physics, 271 Hz frames, one core.  The picture shows cost and memory against the number of texels.

    OMP_NUM_THREADS=1 python benchmarks/fastmodel_costs.py [--json FILE] [--picture FILE]
"""

from __future__ import annotations

import argparse
import json
import tracemalloc
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from campaign import SHAPES as REPORTED
from common import draw, time_in_turn
from other_methods import METHODS, use_distance_fields

import fastmodel
from fastmodel import WTS_0614_34, Butterworth, Gaussian, Parameters, Plate
from fastmodel.contact.interface import TexelContact
from fem_reference import point_spread
from meshes import Box, Indenter, Sphere, TexelArray
from meshes.catalogue import ARRAYS
from tests.support.rubber import make_cover
from validation.derivation.kernel import cover_cells

SHAPES: dict[str, Indenter] = {
    "20 mm face": Box(size=(20e-3, 20e-3, 10e-3)),
    **{name: shape for name, shape in REPORTED.items() if name != "small rectangle"},
    "sphere": Sphere(radius=5e-3),
}
STEPS = 60
ROUNDS = 25
#: Speed of what slides, to and fro [m/s].
SPEED = 20e-3


def parameters(array: TexelArray) -> Parameters:
    """An array under 2 mm of rubber."""
    cover = make_cover(model="linear-elastic")
    cells = cover_cells(cover, array, point_spread(cover))
    return Parameters(array=array, spread=Gaussian.from_sigma(0.7), electronics=WTS_0614_34, surface=cells)


class Scene:
    """A free 500 g body on an array; the time of one step of it."""

    def __init__(self, settings: Parameters, shape: Indenter, method: str | TexelContact | None) -> None:
        """Build it, with a sensor or, without a method, with a bare plate."""
        spec = mujoco.MjSpec()
        fastmodel.recommend_options(spec)
        spec.option.timestep = 1e-3
        self.sensor = None
        if method is None:
            Plate().attach(spec.worldbody.add_frame(), settings.array, "plate")
        else:
            self.sensor = fastmodel.attach(spec, "world", settings, contact=method)
        body = spec.worldbody.add_body(pos=[0.7e-3, -1.1e-3, 0])
        body.add_freejoint()
        body.mass, body.explicitinertial, body.inertia = 0.5, True, [2e-5] * 3
        body.ipos = [0, 0, 5e-3]
        fastmodel.add_geoms(spec, body, shape)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        if self.sensor is not None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                self.sensor.bind(self.model)
        self.run(200)

    def run(self, steps: int, *, sliding: bool = False) -> None:
        """Run some steps."""
        for _ in range(steps):
            if sliding:
                self.data.qvel[0] = SPEED if self.data.time % 0.4 < 0.2 else -SPEED
            mujoco.mj_step(self.model, self.data)
            if self.sensor is not None:
                self.sensor.step(self.data)


def measure(runs: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Shortest seconds per step of each, taken in turns."""
    return {name: min(values) / STEPS for name, values in time_in_turn(runs, ROUNDS).items()}


def methods(settings: Parameters, names: Sequence[str] = tuple(SHAPES)) -> list[dict[str, Any]]:
    """Every method on shapes, resting and sliding."""
    rows = []
    for name, shape in ((name, SHAPES[name]) for name in names):
        scenes = {key: Scene(settings, shape, method) for key, method in {"bare": None, **METHODS}.items()}
        for sliding in (False, True):
            seconds = measure({key: partial(each.run, STEPS, sliding=sliding) for key, each in scenes.items()})
            rows.append({"shape": name, "sliding": sliding, "seconds": seconds})
            ratios = "  ".join(
                f"{method} x{seconds[method] / seconds['bare']:.1f} ({1e-3 / seconds[method]:.0f} x real time)"
                for method in METHODS
            )
            what = "sliding" if sliding else "resting"
            print(f"{name:<14}{what:<9}bare {1e6 * seconds['bare']:.1f} us  {ratios}", flush=True)
    return rows


def chain(settings: Parameters) -> dict[str, float]:
    """Boxes with and without everything after the physics, on the 20 mm face."""
    filtered = replace(settings, filter=Butterworth(cutoff_hz=40.0, order=4), surface=None)
    with_chain, without = (Scene(filtered, SHAPES["20 mm face"], "boxes") for _ in range(2))
    without.sensor = None
    seconds = measure({"chain": partial(with_chain.run, STEPS), "boxes": partial(without.run, STEPS)})
    ratio, alone = seconds["chain"] / seconds["boxes"], 1e6 * seconds["boxes"]
    print(f"signal chain on boxes: x{ratio:.2f} ({alone:.0f} us without)")
    return seconds


def texel_counts() -> list[dict[str, float]]:
    """Cost and memory of the default against the number of texels, a 12 mm square sliding."""
    scenes, memory = {}, {}
    for rows, columns in ((4, 3), (8, 4), (14, 6), (16, 16), (32, 32), (60, 60), (100, 100)):
        settings = parameters(TexelArray.grid(rows, columns, 3.4e-3))
        Scene(settings, SHAPES["big square"], "cover")  # what is made once in a process
        tracemalloc.start()
        scenes[rows * columns] = Scene(settings, SHAPES["big square"], "cover")
        memory[rows * columns] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    seconds = measure({str(n): partial(scene.run, STEPS, sliding=True) for n, scene in scenes.items()})
    found = [{"texels": n, "seconds": seconds[str(n)], "memory": memory[n]} for n in scenes]
    for row in found:
        print(f"{row['texels']:>6} texels: {1e6 * row['seconds']:.0f} us a step, {row['memory'] / 1e6:.2f} MB")
    return found


def draw_counts(rows: list[dict[str, float]], path: Path) -> None:
    """Draw cost and memory over texels, with lines of n log n."""
    n = np.array([row["texels"] for row in rows], dtype=np.float64)
    panels = []
    for key, unit, title in (
        ("seconds", 1e-6, "processor time a step of 1 ms [µs]"),
        ("memory", 1e6, "memory at most while it is made [MB]"),
    ):
        values = np.array([row[key] for row in rows]) / unit
        line = values[-1] * n * np.log(n) / (n[-1] * np.log(n[-1]))
        lines = {"cover, 12 mm square sliding": values, "n log n": line}
        pairs = {name: list(zip(n, each, strict=True)) for name, each in lines.items()}
        panels.append(({"xlabel": "texels", "title": title}, pairs))
    draw(panels, path)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="what the fast model costs")
    parser.add_argument("--json", type=Path, help="where to write every figure")
    parser.add_argument("--picture", type=Path, help="where to draw cost against texels")
    arguments = parser.parse_args()
    use_distance_fields()
    settings = parameters(ARRAYS["wts-0614-34"])
    result = {"chain": chain(settings), "methods": methods(settings), "texel_counts": texel_counts()}
    if arguments.picture is not None:
        draw_counts(result["texel_counts"], arguments.picture)
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
