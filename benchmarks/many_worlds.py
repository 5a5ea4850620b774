"""What many worlds cost: the signal chain as array functions, and a batch of simulations in one or two processes.

    OMP_NUM_THREADS=1 python benchmarks/many_worlds.py

First it prints the processor time per world and step of filter, spread, characteristic and image for 4096 worlds of 84
texels at once and one world at a time, on one core, and the largest difference of their results.  Then it prints the
time per world and physics step of a batch of eight worlds with one sensor, in one process and in two.  On a machine
that is busy with other work, the longest processor time of a process says what the wall time would be with a core for
each.  Times are medians of interleaved repetitions.
"""

from __future__ import annotations

import dataclasses
import os
import statistics
import time
import warnings
from collections.abc import Sequence

import mujoco
import numpy as np
from common import time_in_turn

import fastmodel
from fastmodel import Batch, Butterworth, ChainFunctions, Parameters
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
    compare_chain(dataclasses.replace(wts, filter=Butterworth(cutoff_hz=40.0, order=4)))
    compare_processes(wts)
