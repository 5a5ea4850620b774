"""A Shadow hand closes until its tactile arrays are touched, and holds a force on their sum.

    python -m pip install -e '.[report,device]' gymnasium-robotics  # in a clone of softcover
    python examples/adaptive_grasp.py --out grasp

The hand, its nine arrays and the grip are those of `shadow_hand.py`, at 31 frames/s.  Each finger joint closes until an
array beyond it counts, so that the fingers adapt to the object.  Then a PI law on the sum of the texels of all arrays
flexes the fingers: it holds 3 N, then 5 N, and goes on while the forearm turns over and the weight of the grip changes
sides.  The controller sees counts alone; the forces in MuJoCo are drawn beside its reading.

The gains follow from the latency and from the stiffness, which the hand measures: it flexes the touching fingers slowly
and fits the reading.  The lag is that of the joints, damping over position gain.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import numpy.typing as npt
from force_control import BAND, derive_gains, read_forces
from shadow_hand import FINGERS, GRASP, PREFIX, Hand, smooth_step

import fastmodel

if TYPE_CHECKING:
    from shadow_hand_picture import Moment

FloatArray = npt.NDArray[np.float64]

#: Frames per second [Hz], length of the run [s], speed of a closing joint [rad/s], step of the physics [s].
RATE_HZ, SECONDS, CLOSING, TIMESTEP = 31.0, 7.0, 0.8, 2e-3
#: Speed at which the touching fingers flex while the hand measures its stiffness [rad/s], and its end [N].
PROBING, PROBED = 0.3, 2.5
#: Wanted sum of the arrays [N] from the first touch of all fingers, and later; time of the step [s].
WANTED, MORE, STEP = 3.0, 5.0, 3.5
#: Start and end of the turn of the forearm [s].
TURN = (4.5, 5.7)
#: Time at which the fingers start to close [s], counts of an array that are a touch [-], time to wait for one [s].
START, TOUCH, PATIENCE = 0.4, 60, 1.8
#: Titles of the moments that are drawn, and their times [s].
MOMENTS = (("before", 0.3), ("touched", 1.5), ("5 N", 4.4), ("turned over", 6.9))
#: Largest flexion of the law beyond the angles of first touch [rad].
MOST_FLEXION = 0.6


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """What happened, at each of k frames.

    Attributes:
        times: Time of the frame, shape (k,) [s].
        reading: Sum of the texel forces that the counts of all arrays stand for, shape (k,) [N].
        true: Sum of the forces on all arrays in MuJoCo, shape (k,) [N].
        arrays: Reading of each array, shape (k, 9) [N].
        wanted: Wanted sum, shape (k,); NaN before the law acts [N].
        moments: The moments to draw, as `shadow_hand_picture.Moment`.
        seconds: Processor time of physics, arrays and controller [s].
        hand: The hand at the end; `touched` are the times of first touch by finger [s], `stiffness` the measured growth
            of the reading with flexion [N/rad], `lag` that of the joints [s].
    """

    hand: AdaptiveGrasp
    times: FloatArray
    reading: FloatArray
    true: FloatArray
    arrays: FloatArray
    wanted: FloatArray
    moments: list[Moment]
    seconds: float

    def settling(self) -> float:
        """Return the time from the step until the reading stays within 5 % of the wanted force, before the turn [s]."""
        here = (self.times >= STEP) & (self.times < TURN[0])
        outside = np.flatnonzero(np.abs(self.reading[here] - MORE) > BAND * MORE)
        after = self.times[here][outside[-1] + 1 :] if len(outside) else [STEP]
        return float(after[0] - STEP) if len(after) else float("inf")


class AdaptiveGrasp(Hand):
    """The hand with a controller on the counts of its arrays."""

    def __init__(self, parameters: fastmodel.Parameters, *, rate: float = RATE_HZ) -> None:
        super().__init__(parameters, rate=rate, timestep=TIMESTEP)
        self.rate = rate
        self.touched: dict[str, float] = {}
        self.stiffness = self.lag = float("nan")
        self.wanted = float("nan")
        self._probe: list[tuple[float, float]] = []
        self._flexion = self._last = 0.0
        # Commanded angle of each flexing joint; it stays where an array beyond the joint is touched.
        self._angles = {
            (finger, joint): float(self.data.joint(f"{PREFIX}{finger.upper()}{joint}").qpos[0])
            for finger in FINGERS
            for joint in ("J2", "J1")
        }
        self._held: set[tuple[str, str]] = set()

    def follow(self, seconds: float = SECONDS) -> Iterator[tuple[float, FloatArray]]:
        """Simulate; yield the time of each frame and the reading of each array [N]."""
        while self.data.time < seconds:
            mujoco.mj_step(self.model, self.data)
            is_new = [sensor.step(self.data) for sensor in self.sensors.values()]
            if all(is_new):
                frames = {name: sensor.frame() for name, sensor in self.sensors.items()}
                electronics = self.sensors["palm"].parameters.electronics
                readings = np.array([read_forces(electronics, each.counts).sum() for each in frames.values()])
                self._close({name: int(np.sum(each.counts)) for name, each in frames.items()})
                self._hold(float(readings.sum()))
                self._command()
                yield frames["palm"].time, readings

    def _close(self, counts: dict[str, int]) -> None:
        """Close each joint until an array beyond it counts; joints that find nothing stop after a while."""
        now = self.data.time
        for finger, joint in self._angles:
            links = ("middle",) if joint == "J1" else ("proximal", "middle")
            if now >= START and any(counts[finger + link] >= TOUCH for link in links):
                self.touched.setdefault(finger, now)
                self._held.add((finger, joint))
            if START <= now <= START + PATIENCE and (finger, joint) not in self._held:
                self._angles[finger, joint] = min(self._angles[finger, joint] + CLOSING / self.rate, GRASP[f"F{joint}"])

    def _hold(self, reading: float) -> None:
        """Measure the stiffness once all fingers have closed, then hold the wanted sum."""
        now = self.data.time
        if now <= START + PATIENCE or not self.touched:
            return
        if np.isnan(self.stiffness):
            self._probe.append((self._flexion, reading))
            if reading < max(PROBED, self._probe[0][1] + 1.0) and self._flexion < MOST_FLEXION:
                self._flexion += PROBING / self.rate
                return
            self.stiffness = max(float(np.polyfit(*np.array(self._probe).T, 1)[0]), 1.0)
            joint = self.model.joint(f"{PREFIX}FFJ2")
            gain = self.model.actuator(f"{PREFIX}A_FFJ2").gainprm[0]
            self.lag = float(np.asarray(self.model.dof_damping)[joint.dofadr[0]] / gain)
        self.wanted = MORE if now >= STEP else WANTED
        period = 1 / self.rate
        gains = derive_gains(period, period / 2, self.lag)
        error = (self.wanted - reading) / self.stiffness
        change = gains.gain * (error - gains.kept * self._last)
        self._flexion, self._last = float(np.clip(self._flexion + change, -MOST_FLEXION, MOST_FLEXION)), error

    def _command(self) -> None:
        """Send the angles to the joints, those of the touching fingers with the flexion of the law."""
        now = self.data.time
        self.data.ctrl[self._actuators] = self._open + smooth_step(now, 0.3, 0.9) * (self._grasp - self._open)
        for (finger, joint), angle in self._angles.items():
            flexion = self._flexion if finger in self.touched else 0.0
            self.data.actuator(f"{PREFIX}A_{finger.upper()}{joint}").ctrl[0] = angle + flexion
        self.data.ctrl[-1] = np.pi * smooth_step(now, *TURN)


def run(rate: float = RATE_HZ, seconds: float = SECONDS, *, draws: bool = False) -> Run:
    """Run the grasp; with `draws` keep four moments of it for the picture."""
    from shadow_hand_picture import Camera, Moment, capture_moment

    hand = AdaptiveGrasp(fastmodel.load("wts-0614-34"), rate=rate)
    camera, moments, rows, spent, begun = Camera(hand) if draws else None, list[Moment](), [], 0.0, time.process_time()
    for now, readings in hand.follow(seconds):
        spent += time.process_time() - begun
        true = sum(sensor.carried() for sensor in hand.sensors.values())
        rows.append((now, readings.sum(), true, readings, hand.wanted))
        if camera and len(moments) < len(MOMENTS) and now >= MOMENTS[len(moments)][1]:
            moments.append(capture_moment(hand, MOMENTS[len(moments)][0], now, camera))
        begun = time.process_time()
    if camera:
        camera.close()
    times, reading, true, arrays, wanted = (np.array(column) for column in zip(*rows, strict=True))
    return Run(
        hand=hand, times=times, reading=reading, true=true, arrays=arrays, wanted=wanted, moments=moments, seconds=spent
    )


def draw(found: Run, path: Path) -> None:
    """Draw the hand and its arrays at four moments, and below the reading, the true force and each array."""
    from matplotlib.colors import PowerNorm
    from matplotlib.figure import Figure
    from shadow_hand_picture import COLOURS, draw_arrays

    rendered = all(moment.picture is not None for moment in found.moments)
    figure = Figure(figsize=(11, 9 if rendered else 7), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(2.4 if rendered else 1.6, 1.0))
    axes = above.subplots(2 if rendered else 1, len(found.moments), squeeze=False)
    norm = PowerNorm(0.5, vmin=0.0, vmax=max(image.max() for each in found.moments for image in each.forces.values()))
    for column, moment in enumerate(found.moments):
        if moment.picture is not None:
            axes[0, column].imshow(moment.picture)
            axes[0, column].axis("off")
        axes[0, column].set_title(f"{moment.title}, {moment.time:.1f} s")
        drawn = draw_arrays(axes[-1, column], found.hand, moment, norm)
    above.colorbar(drawn, ax=axes[-1, :], label="force on the texel [N]", shrink=0.9)
    left, right = below.subplots(1, 2)
    left.step(found.times, found.reading, where="post", color="black", label="reading, sum of the arrays")
    left.plot(found.times, found.true, "--", color="black", label="true sum")
    left.step(found.times, found.wanted, where="post", color=COLOURS[2], label="wanted")
    left.axvspan(*TURN, color="#e4e7ec")
    for finger, when in found.hand.touched.items():
        left.axvline(when, color=COLOURS[FINGERS.index(finger)], linewidth=0.8, linestyle=":")
    for index, link in enumerate(found.hand.sensors):
        colour = "black" if link == "palm" else COLOURS[index % len(COLOURS)]
        right.plot(found.times, found.arrays[:, index], "--" if "middle" in link else "-", color=colour, label=link)
    left.set_ylabel("force [N]")
    left.set_title("dotted: a finger touches; grey: the forearm turns over", fontsize="medium")
    right.set_ylabel("reading of each array [N]")
    for axis in (left, right):
        axis.set_xlabel("time [s]")
        axis.set_xlim(0, found.times[-1])
        axis.set_ylim(bottom=0)
        axis.legend(frameon=False, fontsize="small", loc="upper left", ncols=1 if axis is left else 2)
    figure.savefig(path, dpi=100)


def main() -> None:
    """Run the example."""
    from validation.output_folder import new_folder

    parser = argparse.ArgumentParser(description="A Shadow hand closes until touched and holds a force.")
    parser.add_argument("--out", type=Path, default=Path("grasp"), help="folder for the picture")
    options = parser.parse_args()
    run(seconds=0.1)  # numba compiles the contact solver, which would spoil the measured time
    found = run(draws=True)
    with new_folder(options.out) as folder:
        draw(found, folder / "grasp.png")
    for finger, when in found.hand.touched.items():
        print(f"{finger} touched at {when:.2f} s")
    print(f"stiffness {found.hand.stiffness:.1f} N/rad, lag of the joints {1e3 * found.hand.lag:.0f} ms")
    print(f"settles within 5 % of {MORE:g} N after {found.settling():.2f} s")
    print(f"at the end: reading {found.reading[-1]:.2f} N, true {found.true[-1]:.2f} N")
    print(f"{SECONDS:g} s in {found.seconds:.1f} s of processor time: {SECONDS / found.seconds:.1f} times real time")
    print(f"wrote grasp.png to {options.out}")


if __name__ == "__main__":
    main()
