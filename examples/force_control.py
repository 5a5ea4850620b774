"""Hold a force on the reading of a tactile array, and the contact in its middle, in a guided press.

    python -m pip install -e '.[fem,report]'  # in a clone of softcover
    python examples/force_control.py --out force-control

A tool with a spring presses a block on a WTS 0614-34.  A controller sees the counts of the array alone.  It moves the
tool with a PI law on the sum of the texels, limits the largest texel, and slides the array so that the centre of
pressure comes to its middle.  The images come from the fast model, from two simpler models, or from finite elements.
The script prints how fast the loops settle, and how far the true force then is from the reading.

The gains follow from the latency and the stiffness.  The tool is driven to the depth at which the fast model expects
the wanted force, so that the loop sees a gain of one behind the lag of the drive.  The law cancels that lag and leaves
an integrator with a delay, whose loop it closes in the time tau (Skogestad 2003, J. Process Control 13, 291-309).
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

import fastmodel
from meshes import Box, Indenter, Pose

if TYPE_CHECKING:
    from meshes import Cover

FloatArray = npt.NDArray[np.float64]
Signal = Callable[[float], float]

#: Models of the images: a name, and the contact method of the fast model; None stands for finite elements.
MODELS = {"reference": None, "fast": "default", "Gaussian": "foundation", "boxes": "boxes"}
#: The pressed object, stiffness of the tool behind it [N/m], time constant of its drive [s], largest force [N].
BLOCK, TOOL, LAG, MOST = Box(size=(10e-3, 10e-3, 5e-3)), 10e3, 0.02, 12.0
#: Wanted force before and after the step [N], time of the step [s].
BEFORE, WANTED, STEP = 3.0, 5.0, 0.6
#: The reading has settled once it stays within this share of the wanted force [-].
BAND = 0.05
#: Places of the block: x and y of its centre from the middle of the array [m].
PLACES = {
    "centre": (0.0, 0.0),
    "off-centre": (2.2e-3, 3.7e-3),
    "near the edge": (5.0e-3, 3.0e-3),
    "half beside": (9.0e-3, 3.0e-3),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Images:
    """Texel forces of one model as a function of the force and of the place of the object along x.

    Attributes:
        loads: Forces of the table, from 0, shape (l,) [N].
        places: Places of the table, shape (p,) [m].
        forces: Texel forces, shape (l, p, n) [N].
        depths: How far the tool is driven from first touch at each force, its spring included, shape (l,) [m].
    """

    loads: FloatArray
    places: FloatArray
    forces: FloatArray
    depths: FloatArray

    def at(self, force: float, x: float) -> FloatArray:
        """Return the texel forces, shape (n,) [N]; linear between the entries of the table, and in force beyond it."""
        load = min(max(force, 0.0), self.loads[-1])
        i = int(np.clip(np.searchsorted(self.loads, load) - 1, 0, len(self.loads) - 2))
        s = (load - self.loads[i]) / (self.loads[i + 1] - self.loads[i])
        rows = (1 - s) * self.forces[i] + s * self.forces[i + 1]
        if len(self.places) == 1:
            return np.asarray(rows[0] * max(force / self.loads[-1], 1.0))
        j = int(np.clip(np.searchsorted(self.places, x) - 1, 0, len(self.places) - 2))
        t = (x - self.places[j]) / (self.places[j + 1] - self.places[j])
        return np.asarray(((1 - t) * rows[j] + t * rows[j + 1]) * max(force / self.loads[-1], 1.0))

    def force(self, depth: float) -> float:
        """Return the force at a depth of the tool [N]."""
        stiffness = (self.loads[-1] - self.loads[-2]) / (self.depths[-1] - self.depths[-2])
        return float(np.interp(depth, self.depths, self.loads) + max(depth - self.depths[-1], 0.0) * stiffness)

    def depth(self, force: float) -> float:
        """Return the depth of the tool at a force [m]."""
        return float(np.interp(force, self.loads, self.depths))


def make_images(
    model: str,
    parameters: fastmodel.Parameters,
    cover: Cover,
    indenter: Indenter,
    *,
    loads: Sequence[float] = (MOST,),
    places: Sequence[float] = (0.0,),
    y: float = 0.0,
) -> Images:
    """Tabulate the texel forces of a model; a flat face on a linear cover needs one load alone.

    Args:
        model: A name in `MODELS`.
        parameters: The array and its fast model.
        cover: The cover, for finite elements.
        indenter: The object.
        loads: Ascending forces above 0 [N].
        places: Ascending places of the object along x [m].
        y: Its place along y [m].
    """
    method, forces, depths = MODELS[model], [], [0.0]
    for x in places:
        if method is None:
            from fem_reference import press_path

            found = press_path(cover, parameters.array, indenter, Pose.planar(at=(x, y)), loads=list(loads))
            forces.append([each.texel_forces for each in found])
            curve = [each.depth for each in found]
        else:
            pressed = [fastmodel.indent(parameters, indenter, load=load, at=(x, y), contact=method) for load in loads]
            forces.append([each.texel_forces for each in pressed])
            if pressed[0].depth is None:  # the simpler models have no depth: the tool moves as with the fast model
                pressed = [fastmodel.indent(parameters, indenter, load=load, at=(x, y)) for load in loads]
            curve = [each.depth or 0.0 for each in pressed]
    table = np.array(forces).transpose(1, 0, 2)
    depths += [depth + load / TOOL for depth, load in zip(curve, loads, strict=True)]
    return Images(
        loads=np.array([0.0, *loads]),
        places=np.array(places),
        forces=np.concatenate([np.zeros_like(table[:1]), table]),
        depths=np.array(depths),
    )


def read_forces(electronics: fastmodel.Electronics, counts: npt.ArrayLike) -> FloatArray:
    """Return the texel forces that counts stand for [N].

    A texel says nothing below its dead zone.  The dead zone is added back gradually over as much force again, because
    the sum would jump when a texel begins to count, and the loop would hunt between the two sums.
    """
    above = np.asarray(counts) / electronics.sensitivity * electronics.applied_share
    dead = -electronics.offset / electronics.sensitivity * electronics.applied_share
    return np.asarray(above + np.minimum(above, dead))


@dataclass(frozen=True, kw_only=True)
class Gains:
    """A PI law in steps of one frame: command += gain (error - kept * last error).

    Attributes:
        gain: Gain on the error [-].
        kept: Share of the last error that is taken back, which cancels the lag of the drive [-].
    """

    gain: float
    kept: float


def derive_gains(period: float, latency: float, lag: float = LAG) -> Gains:
    """Derive the law from the frame period, the mean latency and the time constant of the drive [s].

    The closed loop has the time constant tau: one and a half times the latency, and no faster than the drive.
    """
    tau, kept = max(1.5 * latency, lag), float(np.exp(-period / lag))
    return Gains(gain=period / ((tau + latency) * (1 - kept)), kept=kept)


@cache
def measure_latency(parameters: fastmodel.Parameters, delay: float = 0.0, *, phases: int = 64) -> float:
    """Measure the mean time from a step of the force to the arrival of the first frame with half of it [s].

    Args:
        parameters: The sensor; its filter and rate count.
        delay: Time from the sample to the arrival of its frame [s].
        phases: Number of instants within a frame period at which the force steps.
    """
    rate, fine = parameters.electronics.rate_hz, 32
    chain = fastmodel.ChainFunctions(parameters, rate_hz=rate * fine, spreads=False)
    half, found = np.full(parameters.array.count, 1.0), []
    for phase in (np.arange(phases) + 0.5) / phases:
        state, tick = chain.settle(np.zeros(parameters.array.count)), 0
        while True:
            state, tick = chain.take(state, half * (tick / fine >= phase)), tick + 1
            if (tick - 1) % fine == 0 and state.filter[-1, 0] >= 0.5:  # noqa: PLR2004 -- half of the step
                break
        found.append(((tick - 1) / fine - phase) / rate + delay)
    return float(np.mean(found))


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """What happened in one loop, at each of k frames.

    Attributes:
        times: Time of the sample, shape (k,) [s].
        true: Force of the object on the cover, shape (k,) [N].
        reading: Sum of the texel forces that the counts stand for, shape (k,) [N].
        largest: Largest of them, shape (k,) [N].
        middle: Their centre of pressure along x, shape (k,) [m].
        place: Place of the object along x, shape (k,) [m].
        forces: Texel forces of the model of the loop, shape (k, n) [N].
        counts: Counts, shape (k, n) [-].
    """

    times: FloatArray
    true: FloatArray
    reading: FloatArray
    largest: FloatArray
    middle: FloatArray
    place: FloatArray
    forces: FloatArray
    counts: npt.NDArray[np.int64]

    def settling(self, start: float, wanted: float, until: float = np.inf) -> float:
        """Return the time from `start` until the reading stays within the band [s]; inf if it does not stay."""
        here = (self.times >= start) & (self.times < until)
        outside = np.flatnonzero(np.abs(self.reading[here] - wanted) > BAND * wanted)
        times = self.times[here]
        if len(outside) and outside[-1] == len(times) - 1:
            return np.inf
        return float(times[outside[-1] + 1] - start) if len(outside) else 0.0


@dataclass(frozen=True, kw_only=True)
class Loop:
    """A controller on the counts of an array, with its tool.

    Attributes:
        images: The model of the images, and the true relation of depth and force.
        expected: The relation that the controller expects, of the fast model.
        parameters: The sensor.
        delay: Time from the sample to the command that follows from it [s].
        limit: Largest force on a texel [N]; inf for none.
        centres: Whether the array slides so that the centre of pressure comes to its middle.
    """

    images: Images
    expected: Images
    parameters: fastmodel.Parameters
    delay: float = 0.0
    limit: float = np.inf
    centres: bool = False

    def run(self, seconds: float, wanted: Signal, *, x: float = 0.0, moved: Signal = lambda _: 0.0) -> Record:
        """Run the loop.

        Args:
            seconds: Length of the run [s].
            wanted: Wanted force as a function of time [N].
            x: Place of the object at the start [m].
            moved: Displacement of the object towards the tool as a function of time, a disturbance [m].
        """
        electronics = self.parameters.electronics
        period = 1 / electronics.rate_hz
        gains = derive_gains(period, measure_latency(self.parameters, self.delay))
        chain = fastmodel.ChainFunctions(self.parameters, rate_hz=electronics.rate_hz, spreads=False)
        columns = self.parameters.array.centres[:, 0]
        drive = _Drive(np.array([self.expected.depth(wanted(0.0)), x]))
        state, rows = None, []
        command, last, waiting = np.array([wanted(0.0), x]), np.zeros(2), list[tuple[float, FloatArray]]()
        for now in np.arange(0.0, seconds, period):
            while waiting and waiting[0][0] <= now:
                drive.set(*waiting.pop(0))
            depth, place = drive.move(now)
            true = self.images.force(depth + moved(now))
            forces = self.images.at(true, place)
            state = chain.settle(np.zeros_like(forces)) if state is None else state
            state, output = chain.frame(chain.take(state, forces))
            texels = read_forces(electronics, output.counts)
            reading, largest = float(texels.sum()), float(texels.max())
            middle = float(texels @ columns / reading) if reading > 0 else 0.0
            target = min(wanted(now), reading * self.limit / largest) if largest > 0 else wanted(now)
            error = np.array([target - reading, -middle if self.centres else 0.0])
            command = command + gains.gain * (error - gains.kept * last)
            command[0], last = np.clip(command[0], 0.0, MOST), error
            waiting.append((now + self.delay, np.array([self.expected.depth(command[0]), command[1]])))
            rows.append((now, true, reading, largest, middle, place, forces, output.counts))
        return Record(**{f.name: np.array(column) for f, column in zip(dataclasses.fields(Record), zip(*rows))})  # noqa: B905 -- as many


class _Drive:
    """Position of tool and slide: each follows its command with the time constant `LAG`."""

    def __init__(self, start: FloatArray) -> None:
        self._place, self._command, self._time = start, start, 0.0

    def move(self, now: float) -> FloatArray:
        """Move on to a time; return the positions [m]."""
        self._place = self._command + (self._place - self._command) * np.exp(-(now - self._time) / LAG)
        self._time = now
        return self._place

    def set(self, when: float, command: FloatArray) -> None:
        """Give a command at a time."""
        self.move(max(when, self._time))
        self._command = command


@cache
def load_sensor(rate: float, creep: float = 0.0) -> tuple[fastmodel.Parameters, Cover]:
    """Load the WTS 0614-34 with another frame rate [Hz] and creep [-]; return its fast model and its cover."""
    from validation.sensor_file import BUILT_IN

    parameters = fastmodel.load("wts-0614-34")
    electronics = dataclasses.replace(parameters.electronics, rate_hz=rate, creep=creep)
    return dataclasses.replace(parameters, electronics=electronics), BUILT_IN["wts-0614-34"].layered_cover


def step(now: float) -> float:
    """Return the wanted force of a step [N]."""
    return WANTED if now >= STEP else BEFORE


def allow(period: float, latency: float) -> float:
    """Return the time that a loop may take to settle: 0.2 s, or five frames and twice the latency [s]."""
    return max(0.2, 5 * period + 2 * latency)


def settle_everywhere(models: Sequence[str] = ("fast",)) -> Iterator[tuple[dict[str, str | float], Record]]:
    """Step the wanted force at each place, rate, delay and model; yield the numbers and the record of each loop."""
    for place, (x, y) in PLACES.items():
        for model in models:
            parameters, cover = load_sensor(31.0)
            expected = make_images("fast", parameters, cover, BLOCK, places=[x], y=y)
            images = make_images(model, parameters, cover, BLOCK, places=[x], y=y)
            for rate in (31.0, 271.0):
                for late in (0.0, 1.0):
                    sensor, delay = load_sensor(rate)[0], late / rate
                    latency = measure_latency(sensor, delay)
                    found = Loop(images=images, expected=expected, parameters=sensor, delay=delay).run(2.0, step, x=x)
                    yield (
                        {
                            "place": place, "model": model, "frames/s": rate, "latency [ms]": 1e3 * latency,
                            "settles [ms]": 1e3 * found.settling(STEP, WANTED),
                            "allowed [ms]": 1e3 * allow(1 / rate, latency),
                            "reading [N]": found.reading[-1], "true [N]": found.true[-1],
                        },
                        found,
                    )  # fmt: skip


#: Places of the table in which the block slides along x [m], its start [m], y [m], limit of a texel [N], and time from
#: which the controller may press as hard as the limit allows [s].
SLIDE, START, SLIDE_Y, LIMIT, PUSH = np.linspace(-1.7e-3, 6.8e-3, 11), 4.0e-3, 3.0e-3, 0.45, 0.3


@cache
def tabulate_slide(model: str, rate: float) -> Images:
    """Tabulate the texel forces of a model along the slide; the rate is that of the frames [Hz]."""
    return make_images(model, *load_sensor(rate), BLOCK, places=SLIDE.tolist(), y=SLIDE_Y)


def guide(model: str, rate: float = 271.0, seconds: float = 1.5) -> tuple[Record, FloatArray]:
    """Limit the largest texel and centre the contact with the images of a model.

    Returns:
        What happened, and the true texel forces, of finite elements at the same force and place, shape (k, n) [N].
    """
    parameters, _ = load_sensor(rate)
    tables = {name: tabulate_slide(name, rate) for name in {model, "fast", "reference"}}
    loop = Loop(
        images=tables[model], expected=tables["fast"], parameters=parameters, limit=LIMIT, centres=True, delay=1 / rate
    )
    found = loop.run(seconds, lambda now: MOST if now >= PUSH else 1.0, x=START)
    true = [tables["reference"].at(force, x) for force, x in zip(found.true, found.place, strict=True)]
    return found, np.array(true)


def measure_misplaced(one: FloatArray, other: FloatArray) -> float:
    """Return the mean over time of the force on wrong texels, over the force [-]; forces have shape (k, n) [N]."""
    return float(np.mean(np.abs(one - other).sum(axis=1) / 2 / other.sum(axis=1)))


def main() -> None:
    """Run the example."""
    from force_control_picture import draw_models, draw_steps

    from validation.output_folder import new_folder

    parser = argparse.ArgumentParser(description="Hold a force on the reading of a tactile array.")
    parser.add_argument("--out", type=Path, default=Path("force-control"), help="folder for the pictures")
    options = parser.parse_args()
    rows = [row for row, _ in settle_everywhere(("fast", "reference"))]
    print(*rows[0], sep="  ")
    for row in rows:
        print(*(f"{value:.2f}" if isinstance(value, float) else value for value in row.values()), sep="  ")
    guided = {model: guide(model) for model in MODELS}
    for model, (found, true) in guided.items():
        place, misplaced = 1e3 * found.place[-1], 100 * measure_misplaced(found.forces, true)
        print(
            f"{model}: largest texel read {found.largest[-1]:.3f} N, true {true[-1].max():.3f} N; true force "
            f"{found.true[-1]:.2f} N; block {place:+.2f} mm from the middle; misplaced {misplaced:.2f} %"
        )
    with new_folder(options.out) as folder:
        draw_steps(folder / "force-control.png")
        draw_models(guided, folder / "force-control-models.png")
    print(f"wrote force-control.png and force-control-models.png to {options.out}")


if __name__ == "__main__":
    main()
