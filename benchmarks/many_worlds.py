"""What many worlds cost: array functions of contact and signal chain, and a batch of simulations in several processes.

    OMP_NUM_THREADS=1 python benchmarks/many_worlds.py

First it prints the largest share of the load that `ContactFunctions` places on other texels than the contact method
`cover`, by number of iterations, on random gap images and on the guided cases of `fastmodel_scores.py`.  Then come the
wall time and processor time per world for 4096 worlds of 84 texels in 64 bits, with JAX, 64 worlds at a time, and with
numpy in two threads.  They are followed by the processor time per world and step of filter, spread, characteristic and
image for 4096 worlds at once and one world at a time, on one core, and the largest difference of their results; and by
the time per world and physics step of a batch of eight worlds with one sensor, in one process and in two.  On a machine
that is busy with other work, the longest processor time of a process says what the wall time would be with a core for
each.  Times are medians of interleaved repetitions.
"""

from __future__ import annotations

import dataclasses
import itertools
import os
import statistics
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import fastmodel_scores
import mujoco
import numpy as np
from common import time_in_turn

import fastmodel
from fastmodel import Batch, Butterworth, ChainFunctions, ContactFunctions, Parameters
from fastmodel.contact import plate
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.gap import GapSamples
from fastmodel.pressure.gap_kernels import CYLINDER
from fastmodel.pressure.solvers import CoverSolver, Load
from fastmodel.signal.chain import ChainOutput

WORLDS, SAMPLES = 4096, 8
#: Samples of the contact forces per second [Hz].
RATE = 1000.0
#: Worlds, physics steps per call and repetitions of the batch.
BATCH, STEPS, REPETITIONS = 8, 400, 5


def compare_chain(parameters: Parameters) -> None:
    """Print the cost of the chain for all worlds at once and one by one, with a frame at every sample."""
    functions = ChainFunctions(parameters, RATE)
    forces = np.random.default_rng(0).uniform(0, 2, (SAMPLES, WORLDS, parameters.array.count))

    def run(samples: np.ndarray) -> ChainOutput:
        state = functions.settle(samples[0])
        for sample in samples:
            state, output = functions.frame(functions.take(state, sample))
        return output

    together = run(forces)
    alone = [run(forces[:, world]) for world in range(0, WORLDS, 64)]
    for name in ChainOutput._fields[:-1]:  # there are no other signals
        here = getattr(together, name)[::64].astype(float)
        apart = np.abs(here - np.array([getattr(each, name) for each in alone])).max()
        print(f"largest difference of {name}: {apart:.1e}")
        assert apart < 1e-12
    few = 256
    runs = {"at once": lambda: run(forces), "one": lambda: [run(forces[:, w]) for w in range(few)]}
    taken = {name: statistics.median(each) for name, each in time_in_turn(runs, REPETITIONS).items()}
    at_once, one = taken["at once"] / (WORLDS * SAMPLES), taken["one"] / (few * SAMPLES)
    print(
        f"chain: {1e6 * at_once:.2f} us per world and step for {WORLDS} worlds of {parameters.array.count} texels, "
        f"{1e6 * one:.1f} us one world at a time: x{one / at_once:.1f}"
    )


def find_places(grid: CellGrid, fine: int) -> list[np.ndarray]:
    """Find x and y of the columns and rows of fine x fine points in each cell [m]."""
    sizes = zip(grid.low, (grid.columns, grid.rows), grid.edge, strict=True)
    return [low + (np.arange(fine * count) + 0.5) * edge / fine for low, count, edge in sizes]


def draw_gaps(functions: ContactFunctions, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw gaps under balls, rollers, tilted faces and wavy bodies, and loads [m, N]."""
    rng, grid, gaps = np.random.default_rng(0), functions.grid, []
    size = np.array([grid.columns, grid.rows]) * grid.edge
    x, y = np.meshgrid(*find_places(grid, 1))
    for k in range(count):
        a, b = x - rng.uniform(-0.3, 0.3) * size[0], y - rng.uniform(-0.3, 0.3) * size[1]
        turn, radius, wide, long = rng.uniform(0, np.pi), rng.uniform(2e-3, 20e-3), *rng.uniform(1.5e-3, 12e-3, 2)
        u, v = a * np.cos(turn) + b * np.sin(turn), b * np.cos(turn) - a * np.sin(turn)
        if k % 4 == 0:
            gap = np.where(np.hypot(u, v) < radius, radius - np.sqrt(np.maximum(radius**2 - u**2 - v**2, 0)), np.inf)
        elif k % 4 == 1:
            gap = np.where(
                (abs(u) < radius) & (abs(v) < long), radius - np.sqrt(np.maximum(radius**2 - u**2, 0)), np.inf
            )
        elif k % 4 == 2:
            tilt = rng.uniform(-0.02, 0.02, 2)
            gap = np.where((abs(u) < wide) & (abs(v) < long), tilt[0] * u + tilt[1] * v, np.inf)
        else:
            numbers = rng.uniform(-600, 600, (6, 2))
            gap = 3e-5 * sum(np.cos(a * x + b * y) for a, b in numbers) + (u**2 + v**2) / 2 / rng.uniform(0.01, 0.2)
        gaps.append(gap)
    return np.array(gaps), rng.uniform(0.2, 10, count)


def compare_contact(parameters: Parameters, worlds: int = 10_000) -> None:
    """Print how far the array functions are from the contact method `cover` on the same cells."""
    functions = ContactFunctions(parameters)
    grid, (gaps, loads) = functions.grid, draw_gaps(functions, worlds)
    solver = CoverSolver(parameters.surface, grid, tolerance=1e-6, steps=1000)
    base = grid.build_base_forces(parameters.surface, parameters.array)
    expected = []
    for gap, force in zip(gaps, loads, strict=True):
        row, column = np.isfinite(gap).nonzero()
        place = grid.low + (np.column_stack([column, row]) + 0.5) * grid.edge
        cells = (np.zeros(len(row), dtype=np.int64), row, column, np.ones(len(row)), *place.T.copy(), gap[row, column])
        samples = GapSamples(*cells, np.column_stack([place, 0 * row]), np.tile([0.0, 0.0, 1.0], (len(row), 1)))
        solver.reset()
        found = solver.solve(samples, [Load.on_plate(force, np.zeros(2), tilts=False)])
        expected.append(base.from_window(found.window, found.origin))
    for steps in (0, 3, 4, 5, 8, 10):
        found = functions.forces(gaps, loads, iterations=steps).texel_forces
        print_misplaced(f"{worlds} random gaps", steps, np.abs(found - expected).sum(axis=1) / 2 / loads)


def compare_guided(ratios: Sequence[float] = fastmodel_scores.RATIOS) -> None:
    """Print how far the array functions are from presses with the contact method `cover`, from 4 x 4 points a cell."""
    bodies, sample, apart = [], plate.sample_gap, {0: [], 5: [], 8: [], 10: []}
    plate.sample_gap = lambda grid, posed, reach: bodies.append(posed) or sample(grid, posed, reach)
    for ratio in ratios:
        parameters = fastmodel_scores.parameters(ratio)
        functions = ContactFunctions(parameters)
        grid = functions.grid
        across, along = find_places(grid, 4)
        points = np.array([(x, y, 0.0) for y in along for x in across])
        cases = itertools.product(
            fastmodel_scores.SHAPES.values(), fastmodel_scores.LOADS, fastmodel_scores.YAWS, fastmodel_scores.PLACES
        )
        for shape, load, yaw, at in cases:
            pressed = fastmodel.indent(parameters, shape, load=load, at=at, yaw=yaw, contact="cover")
            (body,) = bodies[-1]
            # the kernel of `cover` also enlarges cylinders, whose sizes are radius and half length
            larger = body.shape.sizes + body.shape.edge * (body.shape.kinds == CYLINDER)[:, None]
            body = dataclasses.replace(body, shape=dataclasses.replace(body.shape, sizes=larger))
            gap = body.measure_gaps(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), behind=1.0)
            gap = gap.reshape(4 * grid.rows, 4 * grid.columns)
            for steps, each in apart.items():
                found = functions.forces(gap, pressed.total_force, iterations=steps)
                each.append(np.abs(found.texel_forces - pressed.texel_forces).sum() / 2 / pressed.total_force)
    plate.sample_gap = sample
    for steps, each in apart.items():
        print_misplaced(f"{len(each)} guided cases", steps, np.array(each))


def print_misplaced(what: str, steps: int, shares: np.ndarray) -> None:
    """Print the largest and the median share of the load on other texels."""
    most, median = 100 * shares.max(), 100 * np.median(shares)
    print(f"{what}, {steps} iterations: at most {most:.4f} % of the load misplaced, median {median:.5f} %")


def time_contact(parameters: Parameters) -> None:
    """Print what the array functions cost per world, with JAX and with numpy, after compilation."""
    import jax

    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 -- jax takes it so
    functions = ContactFunctions(parameters)
    gaps, loads = draw_gaps(functions, WORLDS)
    moments = np.zeros((WORLDS, 2))

    def run_jax(steps: int, count: int) -> Callable[[], object]:
        arrays = (gaps, loads, moments)[:count]
        given = [jax.numpy.asarray(each.reshape(-1, 64, *each.shape[1:])) for each in arrays]

        @jax.jit
        def run(given: list[jax.Array]) -> jax.Array:
            return jax.lax.map(lambda each: functions.forces(*each, iterations=steps).texel_forces, given)

        return lambda: jax.block_until_ready(run(given))

    def run_numpy(steps: int) -> Callable[[], object]:
        def run(half: slice) -> np.ndarray:
            return functions.forces(gaps[half], loads[half], iterations=steps).texel_forces

        return lambda: list(threads.map(run, (slice(0, WORLDS // 2), slice(WORLDS // 2, None))))

    with ThreadPoolExecutor(2) as threads:
        runs = {
            "foundation, JAX": run_jax(0, 2),
            "foundation, numpy": run_numpy(0),
            "5 iterations, JAX": run_jax(5, 2),
            "5 iterations, numpy": run_numpy(5),
            "6 iterations with moments, JAX": run_jax(6, 3),
            "10 iterations, JAX": run_jax(10, 2),
        }
        for name, run in runs.items():
            run()
            taken = []
            for _ in range(REPETITIONS):
                start, before = time.perf_counter(), time.process_time()
                run()
                taken.append((time.perf_counter() - start, time.process_time() - before))
            wall, busy = (1e3 * statistics.median(each) / WORLDS for each in zip(*taken, strict=True))
            print(f"{name}: {wall:.2f} ms per world, {busy:.2f} ms of processor time")


def push(number: int, data: mujoco.MjData) -> None:
    """Push the block of every world its own way."""
    data.xfrc_applied[1, :3] = [0.2 * np.sin(number + 20 * data.time), 0.05, -4.0]


def compare_processes(parameters: Parameters) -> None:
    """Print the cost of a batch in one process and in two."""
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    spec.option.timestep = 1e-3
    sensor = fastmodel.attach(spec, "world", parameters)
    body = spec.worldbody.add_body(pos=[0, 0, 3.2e-3])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[5e-3, 4e-3, 3e-3], mass=0.1)
    model = spec.compile()
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}")
    with Batch(model, [sensor], BATCH) as one, Batch(model, [sensor], BATCH, processes=2) as two:
        batches = {"one process": one, "two processes": two}
        for batch in batches.values():
            batch.step(STEPS, push)
        wall: dict[str, list[float]] = {name: [] for name in batches}
        busy: dict[str, list[float]] = {name: [] for name in batches}
        for _ in range(REPETITIONS):
            for name, batch in batches.items():
                start, before = time.perf_counter(), read_processor_times(batch)
                batch.step(STEPS, push)
                wall[name].append(time.perf_counter() - start)
                busy[name].append(max(np.subtract(read_processor_times(batch), before)))
    for what, taken in (("wall time", wall), ("longest processor time of a process", busy)):
        cost = {name: statistics.median(each) / (BATCH * STEPS) for name, each in taken.items()}
        text = ", ".join(f"{1e6 * each:.0f} us in {name}" for name, each in cost.items())
        print(f"batch, {what} per world and step: {text}: x{cost['one process'] / cost['two processes']:.2f}")


def read_processor_time(number: int, data: mujoco.MjData, sensors: Sequence[fastmodel.Sensor]) -> float:  # noqa: ARG001
    """Processor time that the process of a world has used [s]."""
    return time.process_time()


def read_processor_times(batch: Batch) -> list[float]:
    """Processor times of the processes of all worlds, and of this process [s]."""
    return [*batch.visit(read_processor_time), time.process_time()]


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    wts = fastmodel.load("wts-0614-34")
    compare_contact(wts)
    compare_guided()
    time_contact(wts)
    compare_chain(dataclasses.replace(wts, filter=Butterworth(cutoff_hz=40.0, order=4)))
    compare_processes(wts)
