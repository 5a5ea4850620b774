"""Chooses the touches that settle gains and cover best, and predicts what they will settle.

Unknown are the gain of each texel, the thickness of the cover and its Poisson ratio if asked for, and a shift of all
touches from their planned places.  The shift, and for each touch an error of its own of place and force, have known
standard deviations; the latter are eliminated, so that the texels of one touch have correlated errors.  The covariance
of the unknowns is the inverse of the sum of the Fisher matrices of the touches and of the prior.  The touches minimise
the mean variance of what is wanted (A-optimality), by exchange of one touch after the other (Fedorov, Theory of Optimal
Experiments, 1972, chapter 3).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshes import Cover
from meshes.array_types import FloatArray, IntArray
from meshes.layer import scale_layers
from validation.errors import InputError
from validation.resolution.channel import Channel, find_channel, say_noise
from validation.resolution.touches import Touches, find_touches
from validation.results import Result, format_digits, result_model
from validation.sensor_file import SensorDescription

#: Relative step of the thickness, and step of the Poisson ratio, in difference quotients [-].
_STEP, _POISSON_STEP = 0.01, 0.001
#: Standard deviations of gains, of the logarithm of the thickness and of the Poisson ratio before any touch [-].
GAIN, THICKNESS, POISSON = 0.2, 0.5, 0.1
#: Standard deviation over that of the prior, below which a quantity counts as identified, and factor by which the prior
#: of the gains is widened for this: what only the likeness of the gains tells is not identified [-].
_IDENTIFIED, _LOOSE = 0.5, 30.0
#: Information of a texel about each unknown over the largest of its touch, below which it is left out [-].
_NEGLIGIBLE = 1e-3
#: Number of candidates whose gain is computed exactly; they are those of the largest gain with independent texels [-].
_LIKELY = 16
#: Number of decimals of gains over the largest one, to which those of equivalent candidates are equal [-].
_EQUAL = 5
#: Largest number of rounds of exchange, and smallest relative gain of a round after which another one follows [-].
_ROUNDS, _WORTH = 6, 1e-3
#: 97.5 % quantile of the standard normal distribution [-].
_QUANTILE = 1.959964
#: Names of the quantities that can be wanted.
WANTED = ("gains", "thickness", "poisson")
Progress = Callable[[str], None]


@result_model
class Touch(Result):
    """A planned touch.

    Attributes:
        texel: Index of the nearest texel.
        at: Place on top of the cover in the frame of the array, shape (3,) [m].
        load: Force [N].
    """

    texel: int
    at: tuple[float, float, float]
    load: float


@result_model
class Expected(Result):
    """How well a quantity is known before and after the planned touches.

    Attributes:
        name: `gains` (root mean square over texels), `worst gain`, `thickness`, `poisson` or `shift`.
        before: Half width of its 95 % interval with the prior and the earlier touches.
        after: Half width with the planned touches.
        unit: `-` for a relative error or a ratio, `m` for a length.
        known: Whether the earlier touches at least halve the standard deviation of the prior, whatever the gains are;
            the shift is not judged.
        identified: Whether all touches do.
    """

    name: str
    before: float
    after: float
    unit: str
    known: bool
    identified: bool


@result_model
class NextTouches(Result):
    """Planned touches in the order in which they are made, and what they will settle.

    Attributes:
        sensor: Name of the sensor.
        radius: Radius of the loaded circle [m].
        noise: Standard deviation of the noise of a texel's force [N].
        noise_assumed: Whether it is one count, because none is stated.
        earlier: Number of touches that are already made.
        touches: The planned touches.
        expected: What is known before and after them.
    """

    sensor: str
    radius: float
    noise: float
    noise_assumed: bool
    earlier: int
    touches: tuple[Touch, ...]
    expected: tuple[Expected, ...]

    def list_expected(self) -> Iterator[tuple[str, ...]]:
        """Yield name, and half width of the 95 % interval before and after the touches with its unit."""
        for each in self.expected:
            factor, unit = (1e6, "um") if each.unit == "m" else (1.0, "") if each.name == "poisson" else (100.0, "%")
            before, after = (
                f"+-{format_digits(factor * value, 3)} {unit}".strip() for value in (each.before, each.after)
            )
            yield each.name, before, after

    def explain(self) -> Iterator[str]:
        """Yield sentences about the touches, and about what stays unknown."""
        yield (
            f"{len(self.touches)} touches with a loaded circle of {1e3 * self.radius:g} mm radius, after "
            f"{self.earlier} earlier ones; {say_noise(self.noise, assumed=self.noise_assumed)}. Their order is "
            "drawn, so that drift is no pattern over the array."
        )
        judged = [each for each in self.expected if each.unit == "-"]
        if unknown := [each.name for each in judged if not each.identified]:
            yield f"Not identifiable from these touches, and bounded by the prior alone: {', '.join(unknown)}."
        if self.earlier and (changed := [each.name for each in judged if each.identified and not each.known]):
            place = ", ".join(f"{1e3 * value:.3g}" for value in self.touches[0].at[:2])
            yield (
                f"Not identifiable from the earlier touches: {', '.join(changed)}. These touches change that; the "
                f"first is at {place} mm."
            )


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Standard deviations of what is not known about a touch.

    Attributes:
        place: Error of the place of each touch per axis [m].
        shift: Error of the place that all touches have in common, per axis [m].
        force: Relative error of the force of each touch [-].
    """

    place: float
    shift: float
    force: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Texel forces per unit force of k touches on n texels, and their slopes.

    Attributes:
        shares: Forces, shape (k, n) [-].
        moved: Slopes along x and y of the place, shape (k, n, 2) [1/m].
        cover: Slopes with the logarithm of the thickness and with the Poisson ratio, shape (k, n, 2) [-].
    """

    shares: FloatArray
    moved: FloatArray
    cover: FloatArray


class Covers:
    """The cover of a sensor, and flat covers with other thicknesses and Poisson ratios."""

    def __init__(self, sensor: SensorDescription, progress: Progress | None = None) -> None:
        """Prepare the response of the sensor's cover.

        Args:
            sensor: Array and cover.
            progress: Called with a line of text before each step.
        """
        self._sensor, self._progress = sensor, progress
        self.main = find_touches(sensor.cover, sensor, progress)
        self._changed: dict[tuple[float, float], Touches] = {(1.0, 0.0): self.main}

    def change(self, factor: float, raised: float) -> Touches:
        """Return a cover with thicknesses times a factor and Poisson ratios raised by a number, up to 0.5."""
        key = factor, raised
        if key not in self._changed:
            cover = self._sensor.cover
            if not isinstance(cover, Cover):
                raise TypeError(f"only the thickness of a flat cover changes, not that of a {type(cover).__name__}")
            layers = tuple(
                replace(each, material=each.material.with_poisson_ratio(min(each.material.poisson_ratio + raised, 0.5)))
                if raised
                else each
                for each in scale_layers(cover.layers, factor * cover.thickness)
            )
            self._changed[key] = find_touches(replace(cover, layers=layers), self._sensor, self._progress)
        return self._changed[key]

    def respond(self, texel: int, places: FloatArray, radius: float) -> Response:
        """Compute the response to touches around a texel, at places of shape (k, 2) [m], and its slopes."""
        main, step = self.main, self.main.step
        x, y = (
            (main.forces(texel, places + by, radius) - main.forces(texel, places - by, radius)) / (2 * step)
            for by in (np.array([step, 0.0]), np.array([0.0, step]))
        )
        shares = main.forces(texel, places, radius)
        cover = np.zeros((*shares.shape, 2))
        if isinstance(self._sensor.cover, Cover):
            thick, thin = (self.change(math.exp(by), 0.0).forces(texel, places, radius) for by in (_STEP, -_STEP))
            low = self.change(1.0, -_POISSON_STEP).forces(texel, places, radius)
            cover = np.stack([(thick - thin) / (2 * _STEP), (shares - low) / _POISSON_STEP], axis=-1)
        return Response(shares=shares, moved=np.stack([x, y], axis=-1), cover=cover)


def inform(response: Response, loads: FloatArray, channel: Channel, errors: Errors) -> FloatArray:
    """Compute roots of the Fisher matrices of k touches, shape (k, m, n + 4).

    The columns are the logarithms of the n gains and of the thickness, the Poisson ratio, and the shift along x and y
    [m].  A root is a matrix R with the Fisher matrix R^T R; its m rows are texels, those beyond the lit ones zero.

    Args:
        response: Response to the touches.
        loads: Force of each touch, shape (k,) [N].
        channel: Noise and electronics.
        errors: Errors of places and forces.
    """
    count, texels = response.shares.shape
    forces = loads[:, None] * response.shares
    information = channel.information(forces)
    told = (
        information[..., None]
        * np.concatenate([response.shares[..., None], response.cover, response.moved], axis=2) ** 2
    )
    told = (told / np.maximum(told.max(axis=1, keepdims=True), 1e-300)).max(axis=2)
    most = int((told > _NEGLIGIBLE).sum(axis=1).max(initial=1))
    roots = np.zeros((count, most, texels + 4))
    for touch in range(count):
        seen = np.argsort(told[touch])[::-1][:most]
        slopes = loads[touch] * np.concatenate([response.cover[touch, seen], response.moved[touch, seen]], axis=1)
        weight = np.sqrt(information[touch, seen])[:, None]
        own = weight * np.column_stack([errors.force * forces[touch, seen], errors.place * slopes[:, 2:]])
        rows = np.zeros((most, texels + 4))
        rows[np.arange(most), seen] = forces[touch, seen]
        rows[:, texels:] = slopes
        # Noise of variance 1 and the errors of the touch itself together.
        root = np.linalg.cholesky(np.eye(most) + own @ own.T)
        roots[touch] = np.linalg.solve(root, weight * rows)
    return roots


def exchange(start: FloatArray, roots: FloatArray, wanted: FloatArray, count: int, first: Sequence[int]) -> list[int]:
    """Choose touches with the smallest sum of weighted variances.

    Args:
        start: Information before them, shape (p, p).
        roots: Roots of the Fisher matrices of the k candidates, shape (k, m, p).
        wanted: Weight of the variance of each unknown, shape (p,).
        count: Number of touches.
        first: Touches to begin with, at most `count`; the others are added one after the other.

    Returns:
        Indices of the chosen candidates, one for each touch; a candidate may be chosen several times.
    """

    def find_best(information: FloatArray) -> int:
        covariance = np.linalg.inv(information)
        spread = roots @ covariance
        gained, size = ((spread**2) @ wanted, np.einsum("kmp,kmp->km", spread, roots))
        likely = np.sort(_rank((gained / (1 + size)).sum(axis=1))[:_LIKELY])
        # By the identity of Woodbury, the sum of weighted variances falls by the trace of (I + R C R^T)^-1 R C W C R^T.
        parts, near = roots[likely], spread[likely]
        inner = np.eye(roots.shape[1]) + near @ parts.transpose(0, 2, 1)
        falls = np.trace(np.linalg.solve(inner, (near * wanted) @ near.transpose(0, 2, 1)), axis1=1, axis2=2)
        return int(likely[_rank(falls)[0]])

    chosen = list(first)
    information = start + sum((roots[each].T @ roots[each] for each in chosen), np.zeros_like(start))
    while len(chosen) < count:
        chosen.append(find_best(information))
        information += roots[chosen[-1]].T @ roots[chosen[-1]]
    last = math.inf
    for _ in range(_ROUNDS):
        for number, old in enumerate(chosen):
            information -= roots[old].T @ roots[old]
            chosen[number] = find_best(information)
            information += roots[chosen[number]].T @ roots[chosen[number]]
        cost = float(wanted @ np.diag(np.linalg.inv(information)))
        if cost > (1 - _WORTH) * last:
            break
        last = cost
    return chosen


def _rank(values: FloatArray) -> IntArray:
    """Return the indices of values from the largest on; the first of equal ones first, whatever the rounding."""
    return np.argsort(-np.round(values / np.abs(values).max(initial=1e-300), _EQUAL), kind="stable")


class Plan:
    """Candidates for touches on a sensor, and the information before them."""

    def __init__(
        self, covers: Covers, channel: Channel, errors: Errors, *, load: float, radius: float, wanted: Sequence[str]
    ) -> None:
        """Compute the responses to touches over centres, edges and corners of all texels that measure.

        Args:
            covers: The cover and its changes.
            channel: Noise and electronics.
            errors: Errors of places and forces.
            load: Force of each touch [N].
            radius: Radius of the loaded circle [m].
            wanted: Some of `WANTED`; the Poisson ratio counts as known unless it is wanted.
        """
        touches = covers.main
        self.covers = covers
        half = np.array([[x, y] for x in (0, 0.5, -0.5) for y in (0, 0.5, -0.5)]) * touches.pitch
        texels = len(touches.origins)
        spots = np.array([
            (*np.round(origin + place @ axes, 7), texel, *place)
            for texel, (origin, axes) in enumerate(zip(touches.origins, touches.axes, strict=True))
            for place in half
        ])  # fmt: skip
        order = np.lexsort((np.abs(spots[:, 4:]).sum(axis=1), *spots[:, :3].T))  # a centre before an edge of another
        spots = spots[order]
        new = np.append(True, (np.diff(spots[:, :3], axis=0) != 0).any(axis=1))
        self.spots = spots[new][np.argsort(spots[new][:, 3], kind="stable")]
        # Over a centre a small shift changes nothing in first order; touches are judged one standard deviation beside.
        moved = math.hypot(errors.place, errors.shift)
        parts = [
            covers.respond(texel, self.spots[self.spots[:, 3] == texel, 4:] + moved, radius)
            for texel in range(texels)
            if (self.spots[:, 3] == texel).any()
        ]
        self.response = Response(
            **{name: np.concatenate([getattr(each, name) for each in parts]) for name in ("shares", "moved", "cover")}
        )
        self.roots = inform(self.response, np.full(len(self.spots), load), channel, errors)
        flat = bool(self.response.cover.any())
        deviations = [GAIN] * texels + [THICKNESS * flat, POISSON * (flat and "poisson" in wanted)] + [errors.shift] * 2
        self.free = np.array(deviations) > 0
        self.prior = np.diag(np.array(deviations)[self.free] ** -2.0)
        weights = [("gains" in wanted) / texels] * texels + ["thickness" in wanted, "poisson" in wanted, 0, 0]
        self.wanted = np.array(weights, dtype=float)[self.free]

    def add(self, start: FloatArray, roots: FloatArray) -> FloatArray:
        """Add the information of touches to that of `start`, shape (p, p)."""
        free = roots[..., self.free].reshape(-1, int(self.free.sum()))
        return start + free.T @ free

    def choose(self, start: FloatArray, count: int) -> list[int]:
        """Choose touches, from none and from every centre once, where they suffice; the better choice is returned."""
        # Of equivalent candidates that nearest to the middle of the array is taken.
        order = np.argsort(
            np.round(np.linalg.norm(self.spots[:, :3] - self.spots[:, :3].mean(axis=0), axis=1), 6), kind="stable"
        )
        centres = np.flatnonzero((self.spots[order, 4:] == 0).all(axis=1)).tolist()
        roots = self.roots[order][..., self.free]
        choices = [
            [int(each) for each in order[exchange(start, roots, self.wanted, count, first)]]
            for first in ((), centres)
            if len(first) <= count
        ]
        costs = [float(self.wanted @ np.diag(np.linalg.inv(self.add(start, self.roots[each])))) for each in choices]
        return choices[int(np.argmin(costs))]

    def expect(self, before: FloatArray, after: FloatArray) -> tuple[Expected, ...]:
        """List what is known before and after, from the information of both, shape (p, p)."""
        texels = len(self.covers.main.origins)
        loose = np.diag(np.where(np.arange(len(self.prior)) < texels, 1 - _LOOSE**-2, 0.0) * np.diag(self.prior))
        found = np.zeros((5, len(self.free)))
        found[:, self.free] = np.sqrt(
            [np.diag(np.linalg.inv(each)) for each in (before, after, before - loose, after - loose, self.prior)]
        )
        groups = {
            "gains": (np.sqrt((found[:, :texels] ** 2).mean(axis=1)), "-"),
            "worst gain": (found[:, :texels].max(axis=1), "-"),
            "thickness": (found[:, texels], "-"),
            "poisson": (found[:, texels + 1], "-"),
            "shift": (found[:, texels + 2 :].max(axis=1), "m"),
        }
        return tuple(
            Expected(
                name=name,
                before=float(_QUANTILE * widths[0]),
                after=float(_QUANTILE * widths[1]),
                unit=unit,
                known=bool(unit == "m" or widths[2] < _IDENTIFIED * widths[4]),
                identified=bool(unit == "m" or widths[3] < _IDENTIFIED * widths[4]),
            )
            for name, (widths, unit) in groups.items()
            if widths[4] > 0
        )


def plan_touches(
    sensor: SensorDescription,
    count: int,
    *,
    errors: Errors,
    load: float,
    radius: float,
    noise: float | None = None,
    wanted: Sequence[str] = WANTED[:2],
    earlier: FloatArray | None = None,
    progress: Progress | None = None,
) -> NextTouches:
    """Choose the next touches.

    Args:
        sensor: Array, cover and electronics.
        count: Number of touches.
        errors: Errors of places and forces.
        load: Force of each touch [N].
        radius: Radius of the loaded circle [m].
        noise: Standard deviation of the noise of each texel's force; None for that of the sensor, or one count [N].
        wanted: Some of `WANTED`.
        earlier: Places, forces and radii of touches on a flat cover that are already made, shape (k, 4) [m, m, N, m].
        progress: Called with a line of text before each step.

    Raises:
        InputError: If the characteristic falls or has too many counts, or a touch shows on no texel.
        ConvergenceError: If finite elements are needed and did not converge.
    """
    channel, assumed = find_channel(sensor, noise, progress)
    plan = Plan(Covers(sensor, progress), channel, errors, load=load, radius=radius, wanted=wanted)
    if not channel.is_shown(load * plan.response.shares).any():
        raise InputError(f"--load: no texel shows a touch of {load:g} N; give a larger load")
    before, touches = plan.prior, plan.covers.main
    for x, y, force, size in () if earlier is None else earlier:
        place = np.array([[x, y]]) - touches.origins[0, :2]
        before = plan.add(before, inform(plan.covers.respond(0, place, size), np.array([force]), channel, errors))
    if progress:
        progress(f"choice of {count} touches from {len(plan.spots)} places")
    chosen = plan.choose(before, count)
    np.random.default_rng(0).shuffle(chosen)
    index = np.flatnonzero(sensor.array.active)
    return NextTouches(
        sensor=sensor.name,
        radius=radius,
        noise=channel.noise,
        noise_assumed=assumed,
        earlier=0 if earlier is None else len(earlier),
        touches=tuple(
            Touch(texel=int(index[int(texel)]), at=(x, y, z), load=load)
            for x, y, z, texel in plan.spots[chosen, :4].tolist()
        ),
        expected=plan.expect(before, plan.add(before, plan.roots[chosen])),
    )
