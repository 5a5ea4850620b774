"""The smallest errors with which a sensor tells place, force, radius and separation of touches, and the least force.

Cramer-Rao: no unbiased estimate has a smaller standard deviation than the inverse of the Fisher matrix of the counts
allows (Kay, Estimation Theory, 1993, section 3.7).  It counts where at least three texels are lit and it is below a
tenth of the pitch.  Elsewhere the error of place and force is that of the mean of the posterior, for a place anywhere
within a pitch and a force up to twice the load (van Trees, Detection, Estimation and Modulation Theory, 1968, 2.4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from meshes import Cover, SolidCover
from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.layer import scale_layers
from validation.errors import InputError
from validation.places import find_middle
from validation.resolution.channel import Channel, find_channel, say_noise
from validation.resolution.touches import Touches, find_touches
from validation.results import Result, result_model
from validation.sensor_file import SensorDescription

#: Distance of the texels next to one, over the pitch, least and largest [-].
_NEXT = 0.5, 1.5
#: Places along each side of a pitch at which a touch is tried, and frames drawn at each [-].
_PLACES, _FRAMES = 4, 16
#: Frames drawn at each place where a number for every texel is wanted [-].
_MAP_FRAMES = 4
#: Points of the posterior along x and y, over a pitch with known and unknown force and around a place; of force [-].
_FINE, _COARSE, _NARROW, _FORCES = 49, 33, 17, 25
#: Texels that are lit where the bound counts, and its largest standard deviation over the pitch [-].
_LIT, _SHARP = 3, 0.1
#: Half width of a posterior where the bound counts, in its standard deviations, and of forces in those of noise [-].
_WIDE = 6.0
#: Largest force of the prior, over the load [-].
_HEAVIEST = 2.0
#: Largest condition number of a Fisher matrix in units of pitch, load and radius [-].
_SINGULAR = 1e12
#: Share of a force below which a texel does not say how large it is [-].
_LEAST_SHARE = 1e-6


@result_model
class Limit(Result):
    """One limit: the root mean square of its standard deviation over places within a pitch.

    Attributes:
        name: Name of the quantity.
        unit: Unit of the numbers, `m` or `N`.
        bound: Smallest standard deviation by the Fisher matrix; None where that is singular.
        posterior: Standard deviation of the posterior; None where none is computed.
        value: The one that counts; None for singular.
        counts: Which of the two counts, `bound`, `posterior`, or both with the share of places; `singular`; or the rule
            of detection.
    """

    name: str
    unit: str
    bound: float | None
    posterior: float | None
    value: float | None
    counts: str


@result_model
class Limits(Result):
    """Limits of a sensor.

    Attributes:
        sensor: Name of the sensor.
        load: Force of a touch [N].
        radius: Radius of a touch; 0 for a point [m].
        separation: Distance of two touches; None if not asked for [m].
        noise: Standard deviation of the noise of a texel, as a force [N].
        noise_assumed: Whether it is one count, because none is stated.
        texel: Index of the texel around or beside which the touches lie.
        prior: Where a touch may be: `around`, within a pitch around the texel; `between`, in the cell between the
            centre of the texel and those next along x and y, within a pitch across if the array has one row or column.
        tip_share: Share of the force that a texel under the tip measures, for which the line of counts was measured;
            None if the line takes the force on a texel [-].
        ideal: Limits with noise alone, without electronics.
        counted: Limits of the counts.
        by_texel: Error of place per axis with known force, of touches within the pitch of each texel [m]; None for a
            texel that does not measure; empty if not asked for.
        thicknesses: For covers of other thicknesses: `thickness_m`, error of place per axis with known force by noise
            alone and of the counts, `ideal_m` and `counted_m`, and `least_force_N`; empty if not asked for.
    """

    sensor: str
    load: float
    radius: float
    separation: float | None
    noise: float
    noise_assumed: bool
    texel: int
    prior: str = "around"
    tip_share: float | None = None
    ideal: tuple[Limit, ...]
    counted: tuple[Limit, ...]
    by_texel: tuple[float | None, ...] = ()
    thicknesses: tuple[dict[str, float | None], ...] = ()

    def explain(self) -> Iterator[str]:
        """Yield sentences about the touches, the noise, and which number of each quantity counts."""
        shape = f"round touches of {1e3 * self.radius:g} mm" if self.radius else "point touches"
        cell = {"around": "within a pitch around", "between": "in the cell beyond the centre of"}[self.prior]
        yield (
            f"For {shape} of {self.load:g} N {cell} texel {self.texel}, and "
            f"{say_noise(self.noise, assumed=self.noise_assumed)}."
        )
        if self.tip_share:
            yield (
                f"The line of counts was measured under a tip. On this cover the texel under it measures "
                f"{self.tip_share:.3g} of the force, so that with another cover the same line means other electronics."
            )
        which: dict[str, dict[str, None]] = {}
        for each in self.counted:
            which.setdefault(each.counts, {})[each.name.split(",")[0].removesuffix(" x").removesuffix(" y")] = None
        for counts, names in which.items():
            yield f"{' and '.join(names).capitalize()}: {counts}."
        if self.thicknesses:
            best = min(self.thicknesses, key=lambda row: row["counted_m"] or math.inf)
            yield f"Best thickness for the place, as counted: {1e3 * (best['thickness_m'] or 0):.3g} mm."


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """Touches above one texel of a sensor, seen through one channel.

    Attributes:
        touches: Texel forces of touches.
        channel: Noise and electronics.
        texel: Index of the texel among the active ones.
        load: Force of a touch [N].
        radius: Radius of a touch [m].
        shift: Middle of the cell of places from the texel, along x and y, over the pitch [-].
    """

    touches: Touches
    channel: Channel
    texel: int
    load: float
    radius: float = 0.0
    shift: FloatArray | float = 0.0

    @property
    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest x and y of the cell of places, shape (2,) each [m]."""
        return (self.shift - 0.5) * self.pitch, (self.shift + 0.5) * self.pitch

    @property
    def pitch(self) -> FloatArray:
        """Pitch along x and y, shape (2,) [m]."""
        return np.array(self.touches.pitch)

    @property
    def places(self) -> FloatArray:
        """Places within a pitch, shape (k, 2) [m]."""
        line = (np.arange(_PLACES) + 0.5) / _PLACES - 0.5
        return (np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2) + self.shift) * self.pitch

    def respond(self, places: FloatArray, radius: float | None = None) -> FloatArray:
        """Compute the force on each texel per unit force at each place, shape (k, n) [-]."""
        return self.touches.forces(self.texel, places, self.radius if radius is None else radius)

    def find_slopes(self, places: FloatArray) -> FloatArray:
        """Compute the texel forces and their slopes, shape (k, n, 4) [N/m, N/m, -, N/m].

        The slopes are along x and y, with the force and with the radius of the touch.
        """
        step = self.touches.step
        x, y = (
            self.load * (self.respond(places + by) - self.respond(places - by)) / (2 * step)
            for by in (np.array([step, 0.0]), np.array([0.0, step]))
        )
        widened = np.zeros_like(x)
        if self.radius:
            by = min(step, self.radius / 2)
            widened = self.load * (self.respond(places, self.radius + by) - self.respond(places, self.radius - by))
            widened /= 2 * by
        return np.stack([x, y, self.respond(places), widened], axis=-1)

    def judge(self, forces: FloatArray, errors: FloatArray) -> BoolArray:
        """Return at which places the bound counts, from forces (k, n) [N] and errors along x and y (k, 2) [m]."""
        return np.asarray(self._lights_enough(forces) & (errors < _SHARP * self.pitch).all(axis=1))

    def _lights_enough(self, forces: FloatArray) -> BoolArray:
        """Return at which places three texels are lit, from forces (k, n) [N]."""
        return np.asarray(self.channel.is_lit(forces).sum(axis=1) >= _LIT)

    def sample(self, truths: FloatArray, half: FloatArray, frames: int, *, known: bool, seed: int = 0) -> FloatArray:
        """Return the mean variance of the posterior of x, y [m2] and force [N2] over frames, shape (k, 3).

        Args:
            truths: Places of the touches, shape (k, 2) [m]; one place if the force is unknown or `half` is finite.
            half: Half width of the part of the pitch around the place on which the posterior is computed, shape (2,)
                [m]; inf for all of the pitch.
            frames: Number of frames of each touch.
            known: Whether the force is known.
            seed: Seed of the noise.
        """
        exact = np.repeat(self.load * self.respond(truths), frames, axis=0)
        reading = self.channel.read(exact, np.random.default_rng(seed).standard_normal(exact.shape))
        whole = not np.isfinite(half).all()
        places, shares = self.list_whole(_FINE if known else _COARSE) if whole else self._list_around(truths[0], half)
        grid, weight = self._list_forces(exact[0, self.seen], shares, known=known)
        cases = (grid[..., None] * shares[:, None]).reshape(grid.size, len(self.seen))
        odds = self.channel.log_likelihood(reading, cases, self.seen) + weight.reshape(-1)
        odds -= odds.max(axis=1, keepdims=True)
        np.exp(odds, out=odds)
        values = np.column_stack([np.repeat(places, grid.shape[1], axis=0), grid.reshape(-1) - self.load])
        total, mean, square = np.split(
            odds @ np.column_stack([np.ones(len(values)), values, values**2]), [1, 4], axis=1
        )
        variance = np.maximum(square / total - (mean / total) ** 2, 0.0)
        return np.asarray(variance.reshape(len(truths), frames, -1).mean(axis=1))

    @cached_property
    def seen(self) -> IntArray:
        """Indices of the texels that frames of touches within the pitch may show."""
        ends = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5], [0.0, 0.0]]) + self.shift
        most = _HEAVIEST * self.load * self.respond(ends * self.pitch).max(axis=0)
        return np.flatnonzero(self.channel.is_shown(most[None])[0])

    @cached_property
    def list_whole(self) -> Callable[[int], tuple[FloatArray, FloatArray]]:
        """Function that lists places over a pitch, and the shares of the texels `seen`, by the places along a side."""
        return cache(lambda count: self._list_between(*self.ends, count))

    def _list_around(self, truth: FloatArray, half: FloatArray) -> tuple[FloatArray, FloatArray]:
        low, high = self.ends
        return self._list_between(np.maximum(low, truth - half), np.minimum(high, truth + half), _NARROW)

    def _list_between(self, low: FloatArray, high: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
        """List places at equal steps, shape (m, 2) [m], and the shares of the texels `seen` there, shape (m, s) [-]."""
        line = (np.arange(count) + 0.5) / count
        places = np.stack(np.meshgrid(*(low + (high - low) * line[:, None]).T), axis=-1).reshape(-1, 2)
        return places, self.touches.forces(self.texel, places, self.radius, self.seen)

    def _list_forces(self, exact: FloatArray, shares: FloatArray, *, known: bool) -> tuple[FloatArray, FloatArray]:
        """List forces of touches at m places that a frame may show, and the logarithms of their weights, shape (m, f).

        If a texel is lit, its own force lies within a few standard deviations of noise, whatever the place is.

        Args:
            exact: Forces on the texels `seen` under the touch, shape (s,) [N].
            shares: Force on these texels per unit force at each place, shape (m, s) [-].
            known: Whether the force is the load.
        """
        if known:
            return np.full((len(shares), 1), self.load), np.zeros((len(shares), 1))
        lit = np.where(self.channel.is_lit(exact, self.seen), exact, -np.inf)
        line = (np.arange(_FORCES) + 0.5) / _FORCES
        if not np.isfinite(lit).any():
            return np.tile(_HEAVIEST * self.load * line, (len(shares), 1)), np.zeros((len(shares), _FORCES))
        texel, spread = int(np.argmax(lit)), self.channel.spread
        share = np.maximum(shares[:, [texel]], _LEAST_SHARE)
        forces = (exact[texel] + _WIDE * spread * (2 * line - 1)) / share
        possible = (forces > 0) & (forces < _HEAVIEST * self.load)
        return forces, np.where(possible, -np.log(share), -np.inf)

    def list_places(self, *, known: bool) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Compute variances by Fisher matrix and by posterior of x, y [m2] and force [N2], and where the bound counts.

        Args:
            known: Whether the force is known; its variances are then 0.

        Returns:
            Both variances, of shape (k, 3), inf where the matrix is singular, and truth values of shape (k,).
        """
        bound = np.zeros((len(self.places), 3))
        size = 2 if known else 3
        covariance, forces = self.bound(self.places, size)
        bound[:, :size] = np.diagonal(covariance, axis1=1, axis2=2)
        regular = self.judge(forces, np.sqrt(bound[:, :2]))
        posterior = np.zeros((len(self.places), 3))
        if known and not regular.all():  # one list of cases serves all places
            posterior[~regular] = self.sample(self.places[~regular], np.full(2, np.inf), _FRAMES, known=True)
        for place in np.flatnonzero(regular | (not known)).tolist():
            half = _WIDE * np.sqrt(bound[place, :2]) if regular[place] else np.full(2, np.inf)
            posterior[place] = self.sample(self.places[[place]], half, _FRAMES, known=known, seed=place)[0]
        return bound, posterior, regular

    def bound(self, places: FloatArray, size: int) -> tuple[FloatArray, FloatArray]:
        """Compute the smallest covariance of x, y, force and radius, the first `size` of them, at k places.

        Returns:
            Covariances, shape (k, size, size), inf where the Fisher matrix is singular, and texel forces, shape (k, n)
            [N].
        """
        slopes = self.find_slopes(places)
        forces = self.load * slopes[..., 2]
        scale = np.array([*self.pitch, self.load, self.radius or 1.0])[:size]
        return self._invert(slopes[..., :size], forces, scale), forces

    def bound_separation(self, separation: float) -> tuple[FloatArray, BoolArray]:
        """Compute the smallest error of the separation of two touches along x, all places and forces unknown.

        Args:
            separation: Distance of the touches, which lie on both sides of each place [m].

        Returns:
            Standard deviation [m] and truth value at each place, whether the bound counts, both of shape (k,).
        """
        aside = np.array([separation / 2, 0.0])
        first, second = (self.find_slopes(self.places + by)[..., :3] for by in (-aside, aside))
        forces = self.load * (first[..., 2] + second[..., 2])
        covariance = self._invert(
            np.concatenate([first, second], axis=-1), forces, np.array([*self.pitch, self.load] * 2)
        )
        apart = np.array([-1.0, 0, 0, 1, 0, 0])
        known = np.isfinite(covariance[:, 0, 0])
        deviation = np.full(len(known), np.inf)
        deviation[known] = np.sqrt(apart @ covariance[known] @ apart)
        return deviation, self._resolve(forces, deviation, separation)

    def bound_radius(self) -> tuple[FloatArray, BoolArray]:
        """Compute the smallest error of the radius and where it counts, with place and force unknown."""
        covariance, forces = self.bound(self.places, 4)
        deviation = np.sqrt(covariance[:, 3, 3])
        return deviation, self._resolve(forces, deviation, self.radius)

    def _resolve(self, forces: FloatArray, deviation: FloatArray, value: float) -> BoolArray:
        return np.asarray(self._lights_enough(forces) & (deviation < value))

    def _invert(self, slopes: FloatArray, forces: FloatArray, scale: FloatArray) -> FloatArray:
        """Invert the Fisher matrices of the counts, shape (k, p, p); inf where they are singular.

        Args:
            slopes: Slopes of the texel forces, shape (k, n, p) [N per unit].
            forces: Texel forces, shape (k, n) [N].
            scale: Size of each parameter, shape (p,).
        """
        scaled = slopes * scale
        fisher = np.einsum("kna,kn,knb->kab", scaled, self.channel.information(forces), scaled)
        found = np.full(fisher.shape, np.inf)
        regular = np.linalg.cond(fisher) < _SINGULAR
        found[regular] = np.linalg.inv(fisher[regular]) * np.outer(scale, scale)
        return found


def study_middle(
    sensor: SensorDescription,
    channel: Channel,
    *,
    load: float,
    radius: float = 0.0,
    progress: Callable[[str], None] | None = None,
) -> Study:
    """Prepare touches above the texel nearest to the middle of an array.

    Args:
        sensor: Array and cover.
        channel: Noise and electronics.
        load: Force of a touch [N].
        radius: Radius of a touch; 0 for a point [m].
        progress: Called with a line of text before each step.

    Raises:
        ConvergenceError: If finite elements are needed and did not converge.
    """
    texel = int(np.searchsorted(np.flatnonzero(sensor.array.active), find_middle(sensor.array)))
    touches = find_touches(sensor.cover, sensor, progress)
    return Study(touches=touches, channel=channel, texel=texel, load=load, radius=radius)


def find_cell(touches: Touches, texel: int) -> FloatArray:
    """Find the middle of the cell between a texel and those next along its x and y, shape (2,) [pitch].

    The texels next in the direction of the axis come first; along an axis without any the cell lies around the texel.

    Args:
        touches: Texel forces of touches.
        texel: Index of the texel among the active ones.

    Raises:
        InputError: If no texel is next.
    """
    apart = (touches.origins - touches.origins[texel]) @ touches.axes[texel].T / np.array(touches.pitch)
    along = (np.abs(apart) > _NEXT[0]) & (np.abs(apart) < _NEXT[1]) & (np.abs(apart[:, ::-1]) < _NEXT[0])
    found = np.where((along & (apart > 0)).any(axis=0), 0.5, np.where(along.any(axis=0), -0.5, 0.0))
    if not found.any():
        raise InputError(f"--prior: no texel that measures is next to texel {texel}; leave `between` out")
    return np.asarray(found)


def list_limits(study: Study, separation: float | None) -> tuple[Limit, ...]:
    """List the limits of a study: places, force, radius, separation, least force."""
    found = []
    for known in (True, False):
        bound, posterior, regular = study.list_places(known=known)
        words = f"force {'known' if known else 'unknown'}"
        names = (("place x, " + words, "m"), ("place y, " + words, "m"), ("force", "N"))[: 2 if known else 3]
        found += [
            _combine(name, unit, bound[:, axis], posterior[:, axis], regular) for axis, (name, unit) in enumerate(names)
        ]
    if study.radius:
        found.append(_keep("radius", *study.bound_radius()))
    if separation is not None:
        found.append(_keep("separation", *study.bound_separation(separation)))
    for name, place in (("least force, over the texel", 0.0), ("least force, worst place", 0.5)):
        force = _finite(study.channel.find_least_force(study.respond(place * study.pitch[None])[0]))
        found.append(
            Limit(
                name=name,
                unit="N",
                bound=None,
                posterior=None,
                value=force,
                counts="90 % of touches found, 0.1 % false alarms",
            )
        )
    return tuple(found)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _combine(name: str, unit: str, bound: FloatArray, posterior: FloatArray, regular: BoolArray) -> Limit:
    """Take the variances of the bound where it counts, else those of the posterior."""
    value = float(np.sqrt(np.where(regular, bound, posterior).mean()))
    share = f"bound at {regular.sum()} of {regular.size} places, else posterior"
    counts = "bound" if regular.all() else share if regular.any() else "posterior"
    root = float(np.sqrt(posterior.mean()))
    return Limit(name=name, unit=unit, bound=_finite(np.sqrt(bound.mean())), posterior=root, value=value, counts=counts)


def _keep(name: str, deviation: FloatArray, regular: BoolArray) -> Limit:
    """Take the bound if it counts at all places."""
    root = _finite(np.sqrt((deviation**2).mean()))
    counts = "bound" if regular.all() else f"singular at {(~regular).sum()} of {regular.size} places"
    return Limit(name=name, unit="m", bound=root, posterior=None, value=root if regular.all() else None, counts=counts)


def find_place_error(study: Study, frames: int = _FRAMES) -> float:
    """Compute the root mean square error of place per axis with known force, over places within a pitch [m]."""
    covariance, forces = study.bound(study.places, 2)
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    regular = study.judge(forces, np.sqrt(variance))
    total = variance[regular].sum(axis=0)
    if not regular.all():
        total = total + study.sample(study.places[~regular], np.full(2, np.inf), frames, known=True)[:, :2].sum(axis=0)
    return float(np.sqrt(total.mean() / len(regular)))


def find_limits(
    sensor: SensorDescription,
    *,
    load: float,
    radius: float = 0.0,
    separation: float | None = None,
    noise: float | None = None,
    prior: str = "around",
    over_array: bool = False,
    thicknesses: Sequence[float] = (),
    progress: Callable[[str], None] | None = None,
) -> Limits:
    """Compute the limits of touches above the middle texel of a sensor.

    Args:
        sensor: Array, cover and electronics.
        load: Force of a touch [N].
        radius: Radius of a touch; 0 for a point [m].
        separation: Distance of two touches of this load each; None for one touch [m].
        noise: Standard deviation of the noise of each texel's force; None for that of the sensor, or one count [N].
        prior: Where a touch may be, `around` a texel or `between` texels.
        over_array: Whether to compute the error of place above each texel.
        thicknesses: Thicknesses of the cover for a curve; all layers are scaled by one factor [m].
        progress: Called with a line of text before each step.

    Raises:
        InputError: If the characteristic falls, has too many counts, the thickness of a curved cover is to change, or
            there is nothing between texels.
        ConvergenceError: If finite elements are needed and did not converge.
    """
    cover, array = sensor.cover, sensor.array
    covers = _scale(cover, thicknesses)
    counted, assumed = find_channel(sensor, noise, progress)
    ideal = Channel(noise=counted.noise)
    middle = study_middle(sensor, counted, load=load, radius=radius, progress=progress)
    study = replace(middle, shift=find_cell(middle.touches, middle.texel) if prior == "between" else 0.0)
    by_texel: list[float | None] = [None] * array.count if over_array else []
    for number, texel in enumerate(np.flatnonzero(array.active) if over_array else ()):
        by_texel[texel] = find_place_error(replace(study, texel=number, shift=0.0), _MAP_FRAMES)
    curve = []
    for thickness, scaled in zip(thicknesses, covers, strict=True):
        other = replace(study, touches=find_touches(scaled, sensor, progress))
        least = counted.find_least_force(other.respond(np.zeros((1, 2)))[0])
        curve.append({
            "thickness_m": thickness,
            "ideal_m": find_place_error(replace(other, channel=ideal)),
            "counted_m": find_place_error(other),
            "least_force_N": _finite(least),
        })  # fmt: skip
    return Limits(
        sensor=sensor.name,
        load=load,
        radius=radius,
        separation=separation,
        noise=counted.noise,
        noise_assumed=assumed,
        texel=int(np.flatnonzero(array.active)[study.texel]),
        prior=prior,
        tip_share=counted.electronics.tip_share if counted.electronics else None,
        ideal=list_limits(replace(study, channel=ideal), separation),
        counted=list_limits(study, separation),
        by_texel=tuple(by_texel),
        thicknesses=tuple(curve),
    )


def _scale(cover: Cover | SolidCover, thicknesses: Sequence[float]) -> list[Cover]:
    """Scale all layers of a flat cover to other thicknesses [m]."""
    if not thicknesses:
        return []
    if not isinstance(cover, Cover):
        raise InputError("--thicknesses: the curve is computed for flat covers; leave it out, and mesh other covers")
    return [replace(cover, layers=scale_layers(cover.layers, thickness)) for thickness in thicknesses]
