"""Touches from frames: places, forces and radius of one or several touches, with intervals that hold 95 %."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.distance import pdist
from scipy.stats import chi2

from meshes import atomic_file
from meshes.array_types import FloatArray
from validation.resolution.channel import Channel, Reading, find_channel, say_noise
from validation.resolution.chart import Chart, make_chart
from validation.resolution.frames import BELOW_ZERO, Frames
from validation.resolution.posterior import Posterior, Search, pool
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
#: Share of the largest response around a texel from which a lit texel belongs to a touch there, and rounds in which
#: several touches are found in turn, first the most likely ones, then points of their posterior [-].
_REACHED, _SWEEPS, _DRAWN_SWEEPS = 0.02, 3, 4
#: Largest deviation of texels from the touches, over their forces, of a frame that is explained [-].
_EXPLAINED = 0.1
#: Distance of two touches over the pitch, below which they may be one [-].
_CLOSE = 2.0
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
    "not explained": "texels deviate by more than 10 % and noise; look for more touches, doubt shape, cover or gains",
    "closer than two pitches": "they may be one touch, and their intervals are too narrow",
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
        x, y, z: Place on the top of the cover, in the array's frame; on flat covers z is the thickness [m].
        force: Force [N].
        radius: Radius; None if it is given [m].
    """

    x: Estimate
    y: Estimate
    z: Estimate
    force: Estimate
    radius: Estimate | None = None


@result_model
class LocatedFrame(Result):
    """Touches of one frame.

    Attributes:
        time: Time of the frame [s].
        touches: The touches; empty if none is found.
        unexplained: Deviation of the texels from the touches, over their forces, root mean square; dark and saturated
            texels count by what contradicts them [-].
        words: What limits the result; empty if nothing does.
    """

    time: float
    touches: tuple[LocatedTouch, ...] = ()
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
        wide = f"Round or slightly oval touches of an unknown radius from {low:.3g} mm to {high:.3g} mm"
        shape = wide if low < high else f"Round touches of radius {low:.3g} mm" if low else "Point touches"
        yield f"{shape}; {say_noise(self.noise, assumed=self.noise_assumed)}. Intervals hold 95 %."
        for word, meaning in _MEANINGS.items():
            if any(word in each for frame in self.frames for each in frame.words):
                yield f"{word}: {meaning}."

    def table(self) -> tuple[list[str], list[list[str | float]]]:
        """Return the headings and the rows of a table with one row for each touch, and for each frame without one."""
        names = [f"{name}{end}" for name in ("x", "y", "z", "force", "radius") for end in ("", "_low", "_high")]
        rows: list[list[str | float]] = []
        for number, frame in enumerate(self.frames):
            for place, touch in enumerate(frame.touches or (None,)):
                values = [] if touch is None else [touch.x, touch.y, touch.z, touch.force, touch.radius]
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


def _sum_forces(searches: list[Search]) -> FloatArray:
    return np.asarray(np.sum([search.explained for search in searches], axis=0))


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
        known = np.isfinite(low)
        level = np.where(known, (low + np.where(known & np.isfinite(high), high, low)) / 2, 0.0)
        if level.min() < -_NEGATIVE * self.channel.spread:
            return LocatedFrame(time=time, words=("negative forces",))
        if level.max() < max(_REST * self.channel.spread, 0.0):
            return LocatedFrame(time=time, words=("at rest",))
        searches = self._fit(reading, level, [int(np.argmax(level))])
        words: tuple[str, ...] = ()
        while len(searches) < count:
            noise = _REST * self.channel.spread
            rest = np.where(level > noise, level - _sum_forces(searches), 0.0)
            texels = [*(search.chart.texel for search in searches), int(np.argmax(rest))]
            more = self._fit(reading, level, texels) if rest.max() > noise else searches
            if more is searches or not self._is_better(reading, more, searches):
                words = (f"{count} touches are not told apart",)
                break
            searches = more
        return self._describe(reading, level, searches, time, words)

    def _fit(self, reading: Reading, level: FloatArray, texels: list[int]) -> list[Search]:
        """Find touches around some texels, each in turn with the force of the others taken off."""
        forces = np.zeros((len(texels), len(level)))
        searches: list[Search] = []
        for _ in range(_SWEEPS if len(texels) > 1 else 1):
            searches = []
            for number, texel in enumerate(texels):
                others = np.delete(forces, number, axis=0).sum(axis=0)
                searches.append(self._search(reading, level - others, self.chart(texel), others))
                forces[number] = searches[-1].explained
        return searches

    def _sample(self, reading: Reading, level: FloatArray, searches: list[Search]) -> list[Posterior]:
        """Draw from the posterior of touches, of several in turn beside drawn points of the others.

        This is Gibbs sampling of whole touches (Geman and Geman, Stochastic relaxation, 1984), from the most likely
        ones on; all points of each round count.
        """
        if len(searches) == 1:
            return [searches[0].sample()]
        forces, rng = np.array([search.explained for search in searches]), np.random.default_rng(0)
        rounds: list[list[Posterior]] = []
        for _ in range(_DRAWN_SWEEPS):
            rounds.append([])
            for number, search in enumerate(searches):
                others = np.delete(forces, number, axis=0).sum(axis=0)
                part = self._search(reading, level - others, search.chart, others).sample()
                forces[number] = part.texels[rng.choice(len(part.weights), p=part.weights)]
                rounds[-1].append(part)
        return [pool(list(parts)) for parts in zip(*rounds, strict=True)]

    def _search(self, reading: Reading, level: FloatArray, chart: Chart, others: FloatArray) -> Search:
        top, most = float(self.channel.edges[-2].max()), np.zeros(len(level))
        most[chart.order] = chart.peaks
        near = (level > _REST * self.channel.spread) & (most > _REACHED * most.max())
        total = float(level[near].sum())
        least = np.maximum(_LEFT_OUT * self.channel.noise, self.channel.edges[1] - _REST * self.channel.noise)
        measured = np.isfinite(reading.low[0]) | np.isfinite(reading.high[0])
        seen = chart.order[: chart.columns[measured & ((total * most > least) | near)].max(initial=-1) + 1]
        limit = _OVER_SATURATION * top / most.max() if np.isfinite(top) else _OVER_SUM * total
        most_force = max(limit, 2 * total, self.channel.noise)
        return Search(chart=chart, channel=self.channel, reading=reading, seen=seen, most=most_force, others=others)

    def _is_better(self, reading: Reading, more: list[Search], searches: list[Search]) -> bool:
        """Return whether further touches explain a frame better than noise and the misfit would let expect."""
        seen = np.unique(np.concatenate([search.seen for search in (*more, *searches)]))
        forces = np.array([_sum_forces(each)[seen] for each in (more, searches)])
        better, worse = self.channel.log_likelihood(reading, forces, seen)[0]
        scale = max(1.0, *(search.misfit / max(search.free, 1) for search in more))
        return bool(2 * (better - worse) > scale * chi2.isf(_CHANCE, more[0].size))

    def _describe(
        self, reading: Reading, level: FloatArray, searches: list[Search], time: float, words: tuple[str, ...]
    ) -> LocatedFrame:
        touches = []
        for search, part in zip(searches, self._sample(reading, level, searches), strict=True):
            texel = search.chart.texel
            points = self.touches.origins[texel] + part.places @ self.touches.axes[texel]
            mean, low, high = part.summarise(np.column_stack([points, part.forces, part.radii]))
            lift = self.touches.project(mean[None, :3])[0] - mean[:3]
            mean[:3], low[:3], high[:3] = mean[:3] + lift, low[:3] + lift, high[:3] + lift
            x, y, z, force, wide = (Estimate(value=v, low=a, high=b) for v, a, b in zip(mean, low, high, strict=True))
            radius = wide if self.radii[0] < self.radii[1] else None
            touches.append(LocatedTouch(x=x, y=y, z=z, force=force, radius=radius))
        full, tells = np.isposinf(reading.high[0]), np.isfinite(reading.low[0])
        lit = tells & ~full & (level > _REST * self.channel.spread)
        apart = self._contradict(reading, level, _sum_forces(searches))
        share = float(np.linalg.norm(apart) / max(float(np.linalg.norm(level[lit | tells & full])), 1e-300))
        free = max(int((lit | (apart != 0)).sum()) - sum(search.size for search in searches), 1)
        if share > _EXPLAINED and ((apart / self.channel.spread) ** 2).sum() > chi2.isf(_CHANCE, free):
            words = (*words, f"not explained by {len(touches)} touch{'es' if len(touches) > 1 else ''}")
        places = np.array([[touch.x.value, touch.y.value, touch.z.value] for touch in touches])
        if len(places) > 1 and pdist(places).min() < _CLOSE * max(self.touches.pitch):
            words = (*words, "touches closer than two pitches")
        saturated, told = int((full & tells).sum()), int(lit.sum())
        for count, word, said in ((saturated, "saturated", saturated > 0), (told, "lit", told < _LIT)):
            if said:
                words = (*words, f"{count} texel{'s' if count != 1 else ''} {word}")
        return LocatedFrame(time=time, touches=tuple(touches), unexplained=share, words=words)

    def _contradict(self, reading: Reading, level: FloatArray, forces: FloatArray) -> FloatArray:
        """Compute the deviation of forces from what each texel tells, shape (n,) [N].

        Forces within the dead zone agree with a dark texel, forces beyond saturation with a saturated one, and all with
        a texel that was not measured or neither shows a touch nor lies under one.
        """
        low, high = (each[0] for each in reading)
        under = np.maximum(level, forces) > _REST * self.channel.spread
        least, most = np.where(np.isfinite(low), level, -np.inf), np.where(np.isfinite(high), high, np.inf)
        most = np.where(np.isfinite(low) & np.isfinite(high), level, most)
        return np.asarray(np.where(under, np.maximum(forces - most, 0) + np.minimum(forces - least, 0), 0.0))


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
        if len(_PREPARED) >= _MOST_PREPARED:
            del _PREPARED[next(iter(_PREPARED))]
        made = make_locator(sensor, noise=noise, radii=radii, forces=frames.forces, progress=progress)
        _PREPARED[key] = (sensor, *made)
    _, locator, assumed = _PREPARED[key]
    reading = locator.channel.take(frames.values)
    reading.low[:, ~frames.measured], reading.high[:, ~frames.measured] = -np.inf, np.inf
    least = -BELOW_ZERO * sensor.electronics.output_max
    found = []
    for number, time in enumerate(frames.times):
        if progress:
            progress(f"frame {number + 1} of {len(frames.times)}")
        if not frames.forces and frames.values[number].min() < least:
            found.append(LocatedFrame(time=time, words=("negative forces",)))
            continue
        found.append(locator.find(Reading(*(each[[number]] for each in reading)), count, time))
    return Located(
        sensor=sensor.name, radii=locator.radii, noise=locator.channel.noise, noise_assumed=assumed, frames=tuple(found)
    )
