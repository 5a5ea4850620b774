"""Touches from frames: places, forces and radius of one or several touches, with intervals that hold 95 %."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from meshes import atomic_file
from meshes.array_types import FloatArray
from validation.resolution.channel import Channel, Reading, find_channel
from validation.resolution.chart import Chart, make_chart
from validation.resolution.frames import BELOW_ZERO, Frames
from validation.resolution.posterior import Posterior, Search
from validation.resolution.touches import Touches, find_touches
from validation.results import Result, result_model
from validation.sensor_file import SensorDescription

#: Half width of the box of places around the brightest texel, over the pitch [-].
_AROUND = 1.5
#: Standard deviations above which a texel shows a touch, and below which a negative force is an error [-].
_REST, _NEGATIVE = 4.0, 6.0
#: Texels that are lit where a place is more than that of a texel [-].
_LIT = 3
#: Force on a texel over the standard deviation of its noise, below which it is left out [-].
_LEFT_OUT = 0.5
#: Largest deviation of lit texels from the touches, over their forces, of a frame that is explained [-].
_EXPLAINED = 0.1
#: Chance of a misfit, or of a further touch by noise alone, that is taken for real [-].
_CHANCE = 1e-2
#: Largest force of the prior over the one at which a touch saturates its texel, and over the sum of texel forces [-].
_OVER_SATURATION, _OVER_SUM = 3.0, 10.0


#: Prepared searches of the last few sensors and options, with the sensor, so that its number stays its own.
_PREPARED: dict[tuple[object, ...], tuple[SensorDescription, Locator, bool]] = {}
_MOST_PREPARED = 4
#: What the words of a frame mean.
_MEANINGS = {
    "at rest": "no texel exceeds four standard deviations of noise and rounding",
    "negative forces": "a texel pulls more than noise can; subtract another zero",
    "lit": "fewer than three texels tell a force, so the place is little more than that of a texel",
    "saturated": "these texels tell a least force only",
    "not told apart": "fewer touches explain the frame as well",
    "not explained": "the deviation is beyond 10 % and beyond noise; look for more touches, or doubt cover and gains",
}


@result_model
class Estimate(Result):
    """A quantity of a touch: the mean of its posterior, and the interval that holds it with 95 %."""

    value: float
    low: float
    high: float


@result_model
class LocatedTouch(Result):
    """One touch.

    Attributes:
        x, y, z: Place on the cover, in the array's frame [m].
        force: Force [N].
    """

    x: Estimate
    y: Estimate
    z: Estimate
    force: Estimate


@result_model
class LocatedFrame(Result):
    """Touches of one frame.

    Attributes:
        time: Time of the frame [s].
        touches: The touches; empty if none is found.
        radius: Radius of the touches; None if it is given, or no touch is found [m].
        unexplained: Deviation of lit texels from the touches, over their forces, root mean square [-].
        words: What limits the result; empty if nothing does.
    """

    time: float
    touches: tuple[LocatedTouch, ...] = ()
    radius: Estimate | None = None
    unexplained: float = 0.0
    words: tuple[str, ...] = ()


@result_model
class Located(Result):
    """Touches of many frames.

    Attributes:
        sensor: Name of the sensor.
        radii: Least and largest radius of a touch that may be; equal if it is given [m].
        noise: Standard deviation of the noise of a texel, as a force [N].
        noise_assumed: Whether it is one count, because none is stated.
        frames: Touches of each frame.
    """

    sensor: str
    radii: tuple[float, float]
    noise: float
    noise_assumed: bool
    frames: tuple[LocatedFrame, ...]

    def explain(self) -> Iterator[str]:
        """Yield sentences about the touches that are looked for, the noise, and the words of frames."""
        low, high = (1e3 * each for each in self.radii)
        shape = f"of radius {low:.3g} mm" if low == high else f"of an unknown radius from {low:.3g} mm to {high:.3g} mm"
        assumed = ": one count, because the sensor states none; give yours with --noise" if self.noise_assumed else ""
        yield f"Touches {shape}; noise of {1e3 * self.noise:.3g} mN{assumed}. Intervals hold 95 %."
        for word, meaning in _MEANINGS.items():
            if any(word in each for frame in self.frames for each in frame.words):
                yield f"{word}: {meaning}."

    def table(self) -> tuple[list[str], list[list[str | float]]]:
        """Return the headings and the rows of a table with one row for each touch, and for each frame without one."""
        names = [f"{name}{end}" for name in ("x", "y", "z", "force", "radius") for end in ("", "_low", "_high")]
        rows: list[list[str | float]] = []
        for number, frame in enumerate(self.frames):
            for place, touch in enumerate(frame.touches or (None,)):
                values = [] if touch is None else [touch.x, touch.y, touch.z, touch.force, frame.radius]
                parts = [[e.value, e.low, e.high] if e else [""] * 3 for e in values] or [[""] * 3] * 5
                told = [*(each for part in parts for each in part), frame.unexplained]
                rows.append([number, frame.time, "" if touch is None else place, *told, "; ".join(frame.words)])
        return ["frame", "time", "touch", *names, "unexplained", "words"], rows

    def write(self, path: Path) -> None:
        """Write the table as CSV, lengths in m and forces in N.

        Raises:
            OSError: If the file cannot be written.
        """
        text, (head, rows) = io.StringIO(), self.table()
        csv.writer(text, lineterminator="\n").writerows([head, *rows])
        atomic_file.replace(path, [text.getvalue().encode()])


@dataclass(kw_only=True, eq=False)
class Locator:
    """Finds touches in frames of a sensor.

    Attributes:
        touches: Texel forces of touches.
        channel: Noise and electronics.
        centres: Centres of all texels, also of those that do not measure, shape (k, 3) [m].
        radii: Least and largest radius of touches; equal if it is known [m].
    """

    touches: Touches
    channel: Channel
    centres: FloatArray
    radii: tuple[float, float]
    _charts: dict[int, Chart] = field(default_factory=dict)

    def chart(self, texel: int) -> Chart:
        """Return the table of touches around an active texel, within the array."""
        if texel not in self._charts:
            pitch = np.array(self.touches.pitch)
            apart = (self.centres - self.touches.origins[texel]) @ self.touches.axes[texel].T
            low = np.maximum(-_AROUND * pitch, apart.min(axis=0) - pitch / 2)
            high = np.minimum(_AROUND * pitch, apart.max(axis=0) + pitch / 2)
            self._charts[texel] = make_chart(self.touches, texel, low, high, self.radii)
        return self._charts[texel]

    def find(self, reading: Reading, count: int, time: float = 0.0) -> LocatedFrame:
        """Find touches in one frame.

        Args:
            reading: Reading of all active texels, shape (1, n) [N].
            count: Number of touches that are looked for.
            time: Time of the frame [s].
        """
        low, high = (each[0] for each in reading)
        level = np.where(np.isposinf(high), low, np.where(np.isneginf(low), 0.0, (low + high) / 2))
        level = np.where(np.isfinite(level), level, 0.0)
        if level.min() < -_NEGATIVE * self.channel.spread:
            return LocatedFrame(time=time, words=("negative forces",))
        if level.max() < max(_REST * self.channel.spread, 0.0):
            return LocatedFrame(time=time, words=("at rest",))
        search = self._search(reading, level, (int(np.argmax(level)),))
        found = search.sample()
        words: tuple[str, ...] = ()
        for _ in range(1, count):
            more = self._add_touch(search, found, reading, level)
            if more is None:
                words = (f"{count} touches are not told apart",)
                break
            search, found = more
        return self._describe(search, found, time, words)

    def _search(self, reading: Reading, level: FloatArray, texels: tuple[int, ...]) -> Search:
        charts = tuple(self.chart(each) for each in texels)
        total, top = level[level > _REST * self.channel.spread].sum(), float(self.channel.edges[-2].max())
        most = np.zeros(len(level))
        for chart in charts:
            reached = chart.columns >= 0
            most[reached] = np.maximum(most[reached], chart.peaks[chart.columns[reached]])
        own = max(chart.peaks.max() for chart in charts)
        least = np.maximum(_LEFT_OUT * self.channel.noise, self.channel.edges[1] - _REST * self.channel.noise)
        measured = np.isfinite(reading.low[0]) | np.isfinite(reading.high[0])
        seen = np.flatnonzero(measured & ((total * most > least) | (level > _REST * self.channel.spread)))
        limit = _OVER_SATURATION * top / own if np.isfinite(top) else _OVER_SUM * total
        return Search(charts=charts, channel=self.channel, reading=reading, seen=seen, most=max(limit, 2 * total))

    def _add_touch(
        self, search: Search, found: Posterior, reading: Reading, level: FloatArray
    ) -> tuple[Search, Posterior] | None:
        """Add a touch where the frame is explained least; None if it explains no more than noise would."""
        rest = level.copy()
        rest[search.seen] -= found.explained
        if rest.max() < _REST * self.channel.spread:
            return None
        texels = (*(chart.texel for chart in search.charts), int(np.argmax(rest)))
        more = self._search(reading, level, texels)
        better = more.sample()
        scale = max(1.0, better.misfit / max(more.free, 1))
        if 2 * (better.likely - found.likely) < scale * chi2.isf(_CHANCE, 3):
            return None
        return more, better

    def _describe(self, search: Search, found: Posterior, time: float, words: tuple[str, ...]) -> LocatedFrame:
        touches = []
        for number, chart in enumerate(search.charts):
            points = self.touches.origins[chart.texel] + found.places[:, number] @ self.touches.axes[chart.texel]
            mean, _, low, high = found.summarise(np.column_stack([points, found.forces[:, number]]))
            lift = self.touches.project(mean[None, :3])[0] - mean[:3]
            mean[:3], low[:3], high[:3] = mean[:3] + lift, low[:3] + lift, high[:3] + lift
            values = [Estimate(value=v, low=a, high=b) for v, a, b in zip(mean, low, high, strict=True)]
            touches.append(LocatedTouch(x=values[0], y=values[1], z=values[2], force=values[3]))
        radius = None
        if self.radii[0] < self.radii[1]:
            mean, _, low, high = found.summarise(found.radii[:, None])
            radius = Estimate(value=mean[0], low=low[0], high=high[0])
        lit = search.lit
        told = search.level[lit]
        share = float(np.sqrt(((found.explained[lit] - told) ** 2).sum() / max((told**2).sum(), 1e-300)))
        if search.free > 0 and share > _EXPLAINED and found.misfit > chi2.isf(_CHANCE, search.free):
            words = (*words, f"not explained by {len(touches)} touch{'es' if len(touches) > 1 else ''}")
        if full := int((np.isposinf(search.reading.high) & np.isfinite(search.reading.low)).sum()):
            words = (*words, f"{full} texel{'s' if full > 1 else ''} saturated")
        if lit.sum() < _LIT:
            words = (*words, f"{lit.sum()} texel{'s' if lit.sum() != 1 else ''} lit")
        return LocatedFrame(time=time, touches=tuple(touches), radius=radius, unexplained=share, words=words)


def make_locator(
    sensor: SensorDescription,
    *,
    noise: float | None = None,
    radii: tuple[float, float] | None = None,
    forces: bool = False,
    progress: Callable[[str], None] | None = None,
) -> tuple[Locator, bool]:
    """Prepare the search for touches, and tell whether the noise is assumed to be one count.

    Args:
        sensor: Array, cover and electronics.
        noise: Standard deviation of the noise of each texel's force; None for that of the sensor, or one count [N].
        radii: Least and largest radius of touches, equal if it is known; None for 0 to one pitch [m].
        forces: Whether frames hold forces, and not counts.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If the characteristic falls, or has too many counts.
        ConvergenceError: If finite elements are needed and did not converge.
    """
    channel, assumed = find_channel(sensor, noise, progress)
    locator = Locator(
        touches=find_touches(sensor.cover, sensor, progress),
        channel=Channel(noise=channel.noise) if forces else channel,
        centres=sensor.array.centres,
        radii=radii or (0.0, max(sensor.array.pitch)),
    )
    return locator, assumed


def locate_frames(
    sensor: SensorDescription,
    frames: Frames,
    *,
    count: int = 1,
    noise: float | None = None,
    radii: tuple[float, float] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Located:
    """Find touches in frames; arguments, besides the `count` of touches, and errors as those of `make_locator`."""
    key = (id(sensor), noise, radii, frames.forces)
    if key not in _PREPARED:
        _PREPARED.pop(next(iter(_PREPARED)), None) if len(_PREPARED) >= _MOST_PREPARED else None
        made = make_locator(sensor, noise=noise, radii=radii, forces=frames.forces, progress=progress)
        _PREPARED[key] = (sensor, *made)
    _, locator, assumed = _PREPARED[key]
    reading = locator.channel.take(frames.values)
    reading.low[:, ~frames.measured], reading.high[:, ~frames.measured] = -np.inf, np.inf
    least = -BELOW_ZERO * sensor.electronics.output_max
    found = []
    for number, time in enumerate(frames.times):
        if not frames.forces and frames.values[number].min() < least:
            found.append(LocatedFrame(time=time, words=("negative forces",)))
            continue
        found.append(locator.find(Reading(*(each[[number]] for each in reading)), count, time))
    return Located(
        sensor=sensor.name, radii=locator.radii, noise=locator.channel.noise, noise_assumed=assumed, frames=tuple(found)
    )
