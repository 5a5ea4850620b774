"""Predict what recordings of the protocol in `docs/how-to/record-a-data-set.md` determine, whole and in part.

Recordings of a sensor like the WTS 0614-34 are made up with the errors of a bench, and `softcover calibrate`'s fit runs
on them.  Half widths are medians over the draws, and `held` is the share of intervals that hold the truth.  The
thickness of the cover is the one with the smallest residual, from fits at three thicknesses; its half width is twice
its error over half of the draws (root mean square).  Takes three to four minutes of processor time.

    OMP_NUM_THREADS=1 python benchmarks/recording_protocol.py
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline

from meshes import Box, Cylinder, Indenter, TexelArray
from meshes.array_types import FloatArray
from validation.calibration.calibrate import Calibration, calibrate
from validation.calibration.model import (
    ContactMethod,
    CountCurve,
    Observations,
    Placement,
    Pose,
    make_reference_method,
    seat_unevenly,
)
from validation.sensor_file import load

SENSOR = load("wts-0614-34")
ARRAY = SENSOR.array
SQUARE, ROUND = Box(size=(10e-3, 10e-3, 5e-3)), Cylinder(radius=3e-3)
#: Area of each stamp over that of the square [-]; the load that closes a gap under a flat stamp rises with its area.
AREA = {SQUARE: 1.0, ROUND: 0.28}
#: Thicknesses of the cover in the fit over the true one, and the range of the answer [-].
FACTORS, RANGE = (0.8, 1.0, 1.25), (0.5, 2.0)
#: Share of draws without a thickness in the range above which it counts as not determined [-].
LOST = 0.1
#: Openings of the plates A (first two), B (next two) and C: the middle of the stamp [m].
PLACES = ((-4.3e-3, -9e-3), (4.3e-3, 6e-3), (4.3e-3, -7e-3), (-4.3e-3, 9e-3), (0.0, 1.5e-3))
LOADS = (2.0, 3.0, 5.0, 8.0)
COLD, WARM = 23.0, 33.0
#: Age of the averaged frames, and the standard deviation of the time of loading [s].
AGE, AGE_ERROR = 7.5, 0.5
#: Standard deviation of a place by calliper and template, and of putting a stamp down again [m].
CALLIPER, AGAIN = 0.2e-3, 0.05e-3
#: Standard deviations, from and to, of one laboratory: ln(gain) [-], counts of a recording over the expected ones [-],
#: seating heights of the square in a place [N]; creep coefficient [-].
GAINS, SCATTER, HEIGHTS, CREEP = (0.15, 0.3), (0.02, 0.05), (0.3, 1.0), (0.1, 0.14)
#: Share of the seating heights that is new whenever the square is put down [-].
NEW_HEIGHTS = 0.3
#: Errors of the mean counts of a texel [counts] and of a temperature [K].
NOISE, KELVIN = 3.0, 0.3
#: Distance from the middle of a stamp beyond which texels are left out [m].
REACH = 12e-3
SENSITIVITY, DEAD_FORCE, PER_KELVIN = 900.0, 0.05, 0.01


@dataclass(frozen=True, kw_only=True)
class Block:
    """Recordings of one tool: each place, load [N] and repeat once, at one temperature [degC]."""

    tool: Indenter = SQUARE
    places: tuple[int, ...] = tuple(range(len(PLACES)))
    loads: tuple[float, ...] = LOADS
    repeats: int = 1
    degrees: float = COLD
    yaw: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """Recordings of a part of the protocol.

    Attributes:
        blocks: The recordings.
        rising: Whether the temperature rises with the load, as when weights go on in ascending order.
        given: Whether the fit takes the places from the calliper, instead of fitting them.
    """

    blocks: tuple[Block, ...]
    rising: bool = False
    given: bool = False

    def runs(self) -> Iterator[tuple[Indenter, int, float, float, float]]:
        """Tool, place, yaw [rad], load [N] and temperature [degC] of each recording."""
        for block in self.blocks:
            for place in block.places:
                for newtons in block.loads * block.repeats:
                    warmer = (WARM - COLD) * (newtons - LOADS[0]) / np.ptp(LOADS)
                    degrees = COLD + warmer if self.rising else block.degrees
                    yield block.tool, place, block.yaw, newtons, float(degrees)


def list_protocols() -> dict[str, Protocol]:
    """Parts of the protocol by name, each with one thing more than the one before; then two ways not to do it."""
    few = (3.0, 8.0)
    five = Block()
    again = Block(loads=(5.0,))
    warm = Block(places=(1, 4), degrees=WARM)
    turned = Block(places=(4,), yaw=np.pi / 4)
    small = Block(tool=ROUND, places=(1, 4), loads=(1.0, 2.0, 3.0))
    basis = (five, again)
    return {
        "one place, 2 loads, twice": Protocol(blocks=(Block(places=(4,), loads=few, repeats=2),)),
        "+ a second place": Protocol(blocks=(Block(places=(4, 1), loads=few, repeats=2),)),
        "+ four loads": Protocol(blocks=(Block(places=(4, 1), repeats=2),)),
        "five places, 4 loads": Protocol(blocks=(five,)),
        "+ repeats": Protocol(blocks=basis),
        "+ a second temperature": Protocol(blocks=(*basis, warm)),
        "+ square turned, round stamp": Protocol(blocks=(*basis, warm, turned, small)),
        "25 as above, but warming as loads rise": Protocol(blocks=basis, rising=True),
        "25 as above, places taken from the calliper": Protocol(blocks=basis, given=True),
    }


def tabulate(thickness: float, steps: int = 5) -> ContactMethod:
    """Make the contact method by finite elements, with the share of a texel as a spline of its place under the tool.

    On a wide cover only the vector from the tool to the texel counts.

    Args:
        thickness: Thickness of the cover over that of the sensor [-].
        steps: Number of entries of the table along a pitch.
    """
    cover = SENSOR.layered_cover
    layers = tuple(dataclasses.replace(each, thickness=thickness * each.thickness) for each in cover.layers)
    half = 5
    pitch = ARRAY.pitch[0]
    near = TexelArray.grid(2 * half + 1, 2 * half + 1, pitch)
    exact = make_reference_method(dataclasses.replace(cover, layers=layers), near)
    count = (2 * half + 1) * steps
    ticks = pitch * ((np.arange(count) + 0.5) / steps - half - 0.5)
    splines: dict[tuple[Indenter, float, float], RectBivariateSpline] = {}

    def solve(indenter: Indenter, newtons: float, pose: Pose) -> FloatArray:
        key = indenter, newtons, pose.yaw
        if key not in splines:
            values = np.zeros((count, count))
            for i in range(steps):
                for k in range(steps):
                    x, y = (-pitch * ((number + 0.5) / steps - 0.5) for number in (i, k))
                    at = Pose(x, y, pose.yaw)
                    forces = exact.solve(indenter, newtons, at)
                    column = np.rint(near.centres[:, 0] / pitch).astype(int) + half
                    row = np.rint(near.centres[:, 1] / pitch).astype(int) + half
                    values[column * steps + i, row * steps + k] = forces
            splines[key] = RectBivariateSpline(ticks, ticks, values)
        away = ARRAY.centres[:, :2] - (pose.x, pose.y)
        inside = (np.abs(away) <= ticks[-1]).all(axis=1)
        return np.where(inside, np.maximum(splines[key](*away.T, grid=False), 0.0), 0.0)

    return ContactMethod(name="tabulated", about=exact.about, array=ARRAY, solve=solve)


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What the fit should find: the curve, and the true place of each placement by its name [m]."""

    curve: CountCurve
    places: dict[str, FloatArray]


def _near(place: tuple[float, float]) -> FloatArray:
    """Return whether each texel is near a place.  The others read zero; without them the fit is faster."""
    return np.asarray((np.abs(ARRAY.centres[:, :2] - place) < REACH).all(axis=1))


def make_up(protocol: Protocol, method: ContactMethod, random: np.random.Generator) -> tuple[Observations, Truth]:
    """Make up the recordings of one laboratory."""
    gains = np.exp(random.normal(0, random.uniform(*GAINS), ARRAY.count))
    scatter, height, creep = (random.uniform(*each) for each in (SCATTER, HEIGHTS, CREEP))
    curve = CountCurve(
        sensitivity=SENSITIVITY,
        dead_force=DEAD_FORCE,
        gain_temperature=PER_KELVIN,
        dead_temperature=0.0,
        reference_temperature=COLD,
        creep=creep,
        reference_age=AGE,
        output_max=float("inf"),
        saturation_band=0.0,
        gains=gains,
        heights=np.zeros(ARRAY.count),
    )
    errors = random.normal(0, CALLIPER, (2, len(PLACES), 2))
    heights = random.normal(0, height, (len(PLACES), ARRAY.count))
    rows, places = [], {}
    for number, (tool, place, yaw, newtons, degrees) in enumerate(protocol.runs()):
        true = PLACES[place] + errors[int(tool is ROUND), place]
        again = true + random.normal(0, AGAIN, 2)
        forces = method.texel_forces(tool, np.array([newtons]), Pose(*again.tolist(), yaw))
        seat = heights[place] + NEW_HEIGHTS * random.normal(0, height, ARRAY.count)
        forces = seat_unevenly(forces, AREA[tool] * seat)
        counts = curve.predict(
            forces * (1 + random.normal(0, scatter)),
            temperatures=np.array([degrees + random.normal(0, KELVIN)]),
            ages=np.array([AGE + random.normal(0, AGE_ERROR)]),
            thresholds=np.zeros(1),
        )[0]
        counts = np.maximum(np.rint(counts + random.normal(0, NOISE, ARRAY.count) * (counts > 0)), 0.0)
        name = f"{type(tool).__name__} {place} {yaw:.2f}"
        places[name] = true
        at = PLACES[place] if protocol.given else None
        stands = Placement(name=name, indenter=tool, at=at, yaw=yaw)
        rows.append((newtons, counts, stands, f"run {number}", degrees, _near(PLACES[place])))
    loads, images, placements, groups, temperatures, measured = zip(*rows, strict=True)
    count = len(rows)
    seen = Observations(
        loads=np.array(loads),
        counts=np.array(images),
        measured=np.array(measured),
        placements=placements,
        groups=groups,
        temperatures=np.array(temperatures),
        ages=np.full(count, AGE),
        thresholds=np.zeros(count),
        creep=np.full(count, creep),
    )
    return seen, Truth(curve=curve, places=places)


#: Half width of an interval, and whether it holds the truth, or the share of intervals that do.
Interval = tuple[float, float]
NOTHING: Interval = (np.nan, np.nan)


def compare(found: Calibration, seen: Observations, truth: Truth) -> dict[str, Interval]:
    """Compare the intervals of a calibration with the truth; NaN for what it does not determine.

    Returns:
        Half width and share of intervals that hold the truth: of the sensitivity [%], the gains (median) [%], the
        positions (median) [mm] and the temperature coefficient of the gain [%/K], by name.
    """
    curve, texels = truth.curve, found.texels
    warmer = 1 + PER_KELVIN * (seen.temperatures.mean() - COLD)
    level, true_gains = found.estimates["sensitivity"], curve.gains[texels]
    half = (level.high - level.low) / 2
    sensitivity = SENSITIVITY * true_gains.mean() * warmer
    widths, gains = found.gain_half_widths[texels], found.gains[texels]
    held = np.abs(gains - true_gains / true_gains.mean()) < widths
    parts = [
        (width, abs(value - truth.places[name][axis]))
        for name, pose in found.poses.items()
        for axis, (value, width) in enumerate((pose["x_m"], pose["y_m"]))
        if width
    ]
    slope = found.estimates.get("temperature")
    return {
        "sensitivity": (100 * half / level.value, float(abs(level.value - sensitivity) < half)),
        "gains": (float(100 * np.median(widths / gains)), float(held.mean())),
        "position": (
            (
                float(1e3 * np.median([width for width, _ in parts])),
                float(np.mean([off < width for width, off in parts])),
            )
            if parts
            else NOTHING
        ),
        "temperature": (
            (50 * (slope.high - slope.low), float(slope.low < PER_KELVIN / warmer < slope.high)) if slope else NOTHING
        ),
    }


def find_thickness(rms: list[float]) -> float:
    """Return the logarithm of the thickness of least residual over the true one; NaN outside `RANGE` [-].

    Args:
        rms: Residuals at `FACTORS` [counts].
    """
    bend, slope, _ = np.polyfit(np.log(FACTORS), np.square(rms), 2)
    best = -slope / (2 * bend) if bend > 0 else np.nan
    return best if np.log(RANGE[0]) < best < np.log(RANGE[1]) else np.nan


def study(protocol: Protocol, methods: dict[float, ContactMethod], draws: int) -> tuple[int, dict[str, Interval]]:
    """Simulate a part of the protocol.

    Args:
        protocol: The part.
        methods: Contact method by thickness over the true one.
        draws: Number of laboratories.

    Returns:
        Number of texels with a gain (median), then half widths and shares of intervals that hold the truth, by name.
    """
    rows: list[dict[str, Interval]] = []
    counts, thicknesses = [], []
    for seed in range(draws):
        seen, truth = make_up(protocol, methods[1.0], np.random.default_rng(seed))
        fit = calibrate(seen, methods[1.0])
        rows.append(compare(fit, seen, truth))
        counts.append(len(fit.texels))
        if seed <= draws // 2:
            others = {factor: calibrate(seen, methods[factor]) for factor in FACTORS if factor != 1.0}
            thicknesses.append(find_thickness([(others | {1.0: fit})[each].residual_rms_counts for each in FACTORS]))
    found: dict[str, Interval] = {}
    for name in rows[0]:
        widths, held = np.array([row[name] for row in rows]).T
        found[name] = (float(np.median(widths)), float(held.mean()))
    errors = np.array(thicknesses)
    lost = np.isnan(errors).mean() > LOST
    found["thickness"] = NOTHING if lost else (float(200 * np.sqrt(np.nanmean(errors**2))), np.nan)
    return int(np.median(counts)), found


def describe(interval: Interval, digits: int) -> str:
    """Write a half width and the share of intervals that hold the truth."""
    width, held = interval
    if np.isnan(width):
        return "not determined"
    return f"{width:.{digits}f}" + ("" if np.isnan(held) else f" ({100 * held:.0f} %)")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=15, help="number of laboratories")
    draws = parser.parse_args().draws
    methods = {factor: tabulate(factor) for factor in FACTORS}
    digits = {"sensitivity": 0, "gains": 0, "position": 2, "temperature": 1, "thickness": 0}
    print("| recordings | number | texels | sensitivity [%] | gains [%] | position [mm] | gain [%/K] | thickness [%] |")
    print("|---|---|---|---|---|---|---|---|")
    for name, protocol in list_protocols().items():
        texels, found = study(protocol, methods, draws)
        cells = {each: describe(found[each], places) for each, places in digits.items()}
        cells |= {"position": "given"} if protocol.given else {}
        print(f"| {name} | {len(list(protocol.runs()))} | {texels} | {' | '.join(cells.values())} |", flush=True)


if __name__ == "__main__":
    main()
