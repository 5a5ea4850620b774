"""Designs of a flat cover and array: what every thickness, hardness and pitch lets a sensor tell, and the best one.

The errors are those of `limits`, by the same functions: point touches, or touches of one radius, or of a ball whose
touch radius follows from the hardness.  Layers keep their proportions, the array its number of texels, and a texel its
electronics.  The responses are exact for wide linear layers; one layer's does not depend on its modulus.
"""

from __future__ import annotations

import contextlib
import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import product

import numpy as np
from scipy.interpolate import CubicSpline

from fem_reference.closed_form.contact import indent
from fem_reference.closed_form.layer import point_response
from meshes import Cover, Material, Sphere, TexelArray
from meshes.hardness import modulus_from_hardness
from meshes.layer import scale_layers
from validation.resolution.ball import Pressed, estimate_errors, press_ball
from validation.resolution.channel import Channel, find_channel, say_noise
from validation.resolution.limits import find_place_error, study_middle
from validation.results import Column, Result, result_model
from validation.sensor_file import SensorDescription

#: Numbers of a design in their printed form.
NUMBERS = {
    "error_m": Column(heading="error of place", unit="um", factor=1e6, meaning="per axis, force known"),
    "spread_m": Column(
        heading="width of the spread", unit="mm", factor=1e3, meaning="full width at half maximum under a point load"
    ),
    "least_N": Column(heading="least force", unit="mN", factor=1e3, meaning="detected at the worst place"),
    "most_N": Column(heading="largest load", unit="N", meaning="saturation, or a ball at 30 % of the thickness"),
    "touch_m": Column(heading="touch radius", unit="mm", factor=1e3, meaning="of the ball under the load"),
    "depth_m": Column(heading="depth", unit="mm", factor=1e3, meaning="of the ball under the load"),
}
#: Axes of the designs in their printed form.
AXES = {
    "thickness": Column(heading="thickness", unit="mm", factor=1e3),
    "hardness": Column(heading="hardness"),
    "pitch": Column(heading="pitch", unit="mm", factor=1e3),
}
#: Radius of the ball that ends the load range of point touches, similar to a fingertip [m].
FINGER = 5e-3
#: Depth of this ball that ends the load range.
_DEPTH = "30 % of the thickness"
#: Distances over the thickness among which the base pressure falls to half its largest value [-].
_DISTANCES = np.linspace(0, 3, 97)
#: Error over that of the best design, up to which a design counts as equal [-].
FLAT = 1.1


@result_model
class Design(Result):
    """One design.

    Attributes:
        thickness: Thickness of the cover [m].
        hardness: Hardness of its softest layer; None for the modulus of the sensor.
        pitch: Smaller pitch of the array [m].
        modulus: Young's modulus of the softest layer [Pa].
        numbers: Values under the names of `NUMBERS`; None for what does not exist or needs finite elements.
        bands: Least and largest of each within the tolerance; None where one end has no value.
        ends: What ends the load range.
    """

    thickness: float
    hardness: float | None
    pitch: float
    modulus: float
    numbers: dict[str, float | None]
    bands: dict[str, tuple[float, float] | None]
    ends: str

    @property
    def error(self) -> float:
        """Error of place, inf if it is not known [m]."""
        return math.inf if (found := self.numbers["error_m"]) is None else found

    def holds(self, load: float) -> bool:
        """Return whether a load lies within the load range, as far as that is known."""
        least, most = self.numbers["least_N"], self.numbers["most_N"]
        return math.isfinite(self.error) and least is not None and least <= load <= (most or math.inf)


@result_model
class Designs(Result):
    """Designs of a sensor.

    Attributes:
        sensor: Name of the sensor.
        load: Force of a touch [N].
        noise: Standard deviation of the noise of a texel, as a force [N].
        noise_assumed: Whether it is one count, because none is stated.
        radius: Radius of the touches; 0 for points, None if it follows from the ball [m].
        ball: Radius of the ball of touch radius, depth and largest load [m].
        layers: Number of layers of the cover.
        scale: Scale of the hardness; empty for the modulus of the sensor.
        tolerance: Tolerance of the hardness, in its units; None for the range of the modulus in the literature.
        finite_error: Relative error of the largest load by the table of finite strain [-].
        designs: The designs, by thickness, then hardness, then pitch.
        best: Index of the design with the smallest error of place whose range holds the load; None if none does.
        flat: Thicknesses around the best one with at most 1.1 times its error, least and largest [m].
    """

    sensor: str
    load: float
    noise: float
    noise_assumed: bool
    radius: float | None
    ball: float
    layers: int
    scale: str
    tolerance: float | None
    finite_error: float
    designs: tuple[Design, ...]
    best: int | None
    flat: tuple[float, float] | None

    def values(self, axis: str) -> list[float | None]:
        """Return the values of an axis, ascending."""
        return list(dict.fromkeys(getattr(each, axis) for each in self.designs))

    @property
    def middle(self) -> Design:
        """The best design, else the one with the smallest error."""
        return min(self.designs, key=lambda each: each.error) if self.best is None else self.designs[self.best]

    def line(self, axis: str) -> list[Design]:
        """Return the designs that differ from the best one along an axis alone."""
        fixed = [each for each in AXES if each != axis]
        return [d for d in self.designs if all(getattr(d, each) == getattr(self.middle, each) for each in fixed)]

    @property
    def varied(self) -> list[str]:
        """Names of the axes with several values."""
        return [axis for axis in AXES if len(self.values(axis)) > 1]

    def varies(self, name: str) -> list[str]:
        """Return the axes along which a number changes anywhere."""
        found = []
        for axis in AXES:
            lines = defaultdict(set)
            for each in self.designs:
                lines[tuple(getattr(each, other) for other in AXES if other != axis)].add(each.numbers[name])
            found += [axis] if max(map(len, lines.values())) > 1 else []
        return found

    def explain(self) -> Iterator[str]:
        """Yield sentences about the best design, how flat the optimum is, and what the numbers hold for."""
        shape = f"round touches of {1e3 * self.radius:g} mm" if self.radius else "point touches"
        if self.radius is None:
            shape = f"touches of a ball of {1e3 * self.ball:g} mm radius"
        if self.best is None:
            yield (
                f"No design: {self.load:g} N lies outside the load range of each. The least error: "
                f"{self.describe(self.middle)}."
            )
        else:
            yield f"Best: {self.describe(self.middle)}."
        if self.flat and self.flat[0] < self.flat[1]:
            low, high = (1e3 * each for each in self.flat)
            yield f"Within 10 % of the best error: {low:.3g} mm to {high:.3g} mm thick, on this grid."
        yield f"For {shape} of {self.load:g} N, and {say_noise(self.noise, assumed=self.noise_assumed)}."
        if self.layers == 1:
            yield (
                "One layer: its hardness changes neither the spread nor the error of a touch of given radius. It acts "
                "through touch radius, depth and largest load alone."
            )
        table = f" Loads at {_DEPTH} come from a table at finite strain, good to {100 * self.finite_error:.2g} %."
        known = "" if "sweep" in self.middle.ends else table
        yield (
            f"Load range: up to {self.middle.ends}. Touch radius, depth and load at {_DEPTH} are those of a ball of "
            f"{1e3 * self.ball:g} mm radius.{known}"
        )
        yield "Curved covers, free sides and larger strains need finite elements: softcover sweep."

    def describe(self, design: Design) -> str:
        """Describe a design in words."""
        hard = "" if design.hardness is None else f", {design.hardness:.4g} Shore {self.scale.upper()}"
        if len(self.values("hardness")) > 1 and "hardness" not in self.varies("error_m"):
            hard += " (others have the same error)"
        numbers = ", ".join(
            f"{column.heading} {column.text(value)} {column.unit}"
            for name, column in NUMBERS.items()
            if (value := design.numbers[name]) is not None and name not in {"touch_m", "depth_m"}
        )
        return f"{1e3 * design.thickness:.3g} mm thick{hard}, pitch {1e3 * design.pitch:.3g} mm: {numbers}"


@dataclass(frozen=True, kw_only=True, eq=False)
class _Plan:
    """What all designs have in common; lengths are in m, forces in N."""

    sensor: SensorDescription
    cover: Cover
    channel: Channel
    load: float
    radius: float | None
    ball: float

    @cached_property
    def softest(self) -> int:
        """Index of the softest layer, whose hardness varies."""
        return int(np.argmin([each.material.youngs_modulus for each in self.cover.layers]))

    def make_cover(self, thickness: float, modulus: float) -> Cover:
        """Scale the layers to a thickness, and give the softest one a modulus."""
        layers = list(scale_layers(self.cover.layers, thickness))
        soft = layers[self.softest]
        material = Material(
            name=soft.material.name, model="linear-elastic", parameters={"youngs_modulus": modulus},
            poisson_ratio=soft.material.poisson_ratio,
        )  # fmt: skip
        layers[self.softest] = replace(soft, material=material)
        return replace(self.cover, layers=tuple(layers))

    def number(self, thickness: float, pitch: float, modulus: float) -> tuple[dict[str, float | None], str]:
        """Compute the numbers of a design, and what ends its load range."""
        cover = self.make_cover(thickness, modulus)
        pressed = self.press(cover)
        touch = pressed.contact if self.radius is None else self.radius
        # The response of one layer does not depend on its modulus, so that designs share it.
        *seen, most = self.see(thickness, pitch, touch, modulus if len(cover.layers) > 1 else self.modulus)
        ends = "saturation"
        if math.isnan(pressed.most):
            ends += f", or less: the load at {_DEPTH} needs sweep"
        elif not pressed.most >= most:
            most, ends = pressed.most, _DEPTH
        found = dict(zip(NUMBERS, (*seen, most, pressed.contact, pressed.depth), strict=True))
        return {name: value if math.isfinite(value) else None for name, value in found.items()}, ends

    @property
    def modulus(self) -> float:
        """Young's modulus of the softest layer of the sensor [Pa]."""
        return self.cover.layers[self.softest].material.youngs_modulus

    def press(self, cover: Cover) -> Pressed:
        """Press the ball on a cover; its largest load is nan outside the table."""
        one = len(cover.layers) == 1 and cover.base == "bonded"
        if one and (found := press_ball(cover.layers[0], self.ball, self.load)):
            return found
        if self.radius is None:
            # No solution where the contact reaches the rim of the ball, or has gaps.
            with contextlib.suppress(ValueError):
                solved = indent(cover, Sphere(radius=self.ball), load=self.load)
                return Pressed(solved.contact_radius, solved.depth, math.nan)
        return Pressed(math.nan, math.nan, math.nan)

    @cached_property
    def see(self) -> Callable[[float, float, float, float], tuple[float, float, float, float]]:
        """Function that computes error, spread, least force and saturation load by thickness, pitch, touch, modulus."""
        return cache(self._see)

    def _see(self, thickness: float, pitch: float, touch: float, modulus: float) -> tuple[float, float, float, float]:
        cover, array = self.make_cover(thickness, modulus), _scale_array(self.sensor.array, pitch)
        spread = self.find_spread(thickness, modulus)
        if math.isnan(touch):
            return math.nan, spread, math.nan, math.nan
        sensor = replace(self.sensor, array=array, cover=cover)
        study = study_middle(sensor, self.channel, load=self.load, radius=touch)
        over, aside = study.respond(np.array([[0.0, 0.0], [0.5, 0.5]]) * study.pitch)
        full = float(np.min(np.where(over > 0, self.channel.edges[-2] / np.where(over > 0, over, 1.0), np.inf)))
        return find_place_error(study), spread, self.channel.find_least_force(aside), full

    @cached_property
    def find_spread(self) -> Callable[[float, float], float]:
        """Function that computes the full width at half maximum of the base pressure under a point load."""

        def find(thickness: float, modulus: float) -> float:
            r = thickness * _DISTANCES
            pressure = point_response(self.make_cover(thickness, modulus), r)
            return 2 * float(CubicSpline(r, pressure / pressure[0] - 0.5).roots(extrapolate=False)[0])

        return cache(find)


def _scale_array(array: TexelArray, pitch: float) -> TexelArray:
    """Scale an array in its plane to a smaller pitch [m]."""
    factor = pitch / min(array.pitch)
    (x, y), (wide, high) = array.pitch, array.texel_size
    return replace(
        array,
        centres=array.centres * factor,
        pitch=(factor * x, factor * y),
        texel_size=(factor * wide, factor * high),
    )


def find_designs(
    sensor: SensorDescription,
    cover: Cover,
    *,
    load: float,
    thicknesses: Sequence[float],
    pitches: Sequence[float],
    noise: float | None = None,
    radius: float | None = 0.0,
    ball: float | None = None,
    hardnesses: Sequence[float] = (),
    scale: str = "",
    tolerance: float | None = None,
    progress: Callable[[str], None] | None = None,
) -> Designs:
    """Compute all designs, and choose the best one.

    Args:
        sensor: Array and electronics.
        cover: Wide cover of planar layers.
        load: Force of a touch [N].
        thicknesses: Thicknesses of the cover [m].
        pitches: Smaller pitches of the array [m].
        noise: Standard deviation of the noise of each texel's force; None for that of the sensor, or one count [N].
        radius: Radius of the touches; 0 for points, None for that of the ball [m].
        ball: Radius of the ball; None for 5 mm [m].
        hardnesses: Hardnesses of the softest layer; empty for the modulus of the sensor.
        scale: Scale of the hardness.
        tolerance: Tolerance of the hardness; None for the range of the modulus in the literature.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If the characteristic falls, or has too many counts.
    """
    channel, assumed = find_channel(sensor, noise, progress)
    plan = _Plan(
        sensor=sensor, cover=cover, channel=channel, load=load, radius=radius, ball=ball or FINGER
    )  # fmt: skip
    material = cover.layers[plan.softest].material
    ends = (0.0, -(tolerance or 0.0), tolerance or 0.0)
    softness: dict[float | None, tuple[float, ...]] = {
        each: tuple(modulus_from_hardness(each + by, scale).youngs_modulus for by in ends) for each in hardnesses
    } or {None: (material.youngs_modulus, *material.modulus_range)}
    designs: list[Design] = []
    grid = list(product(thicknesses, softness.items(), pitches))
    for thickness, (hardness, moduli), pitch in grid:
        if progress:
            progress(f"design {len(designs) + 1} of {len(grid)}")
        found, reasons = zip(*(plan.number(thickness, pitch, each) for each in moduli), strict=True)
        designs.append(
            Design(
                thickness=thickness, hardness=hardness, pitch=pitch, modulus=moduli[0], numbers=found[0],
                bands={name: _bound([each[name] for each in found]) for name in NUMBERS}, ends=reasons[0],
            )
        )  # fmt: skip
    best, flat = _choose(designs, load)
    return Designs(
        sensor=sensor.name, load=load, noise=channel.noise, noise_assumed=assumed, radius=radius, ball=plan.ball,
        layers=len(cover.layers), scale=scale, tolerance=tolerance, finite_error=float(estimate_errors()[2]),
        designs=tuple(designs), best=best, flat=flat,
    )  # fmt: skip


def _bound(values: list[float | None]) -> tuple[float, float] | None:
    known = [each for each in values if each is not None]
    return (min(known), max(known)) if len(known) == len(values) else None


def _choose(designs: list[Design], load: float) -> tuple[int | None, tuple[float, float] | None]:
    """Return the index of the best design, and the thicknesses around it that are as good."""
    usable = [number for number, each in enumerate(designs) if each.holds(load)]
    if not usable:
        return None, None
    best = min(usable, key=lambda number: designs[number].error)
    chosen = designs[best]
    line = [each for each in designs if (each.hardness, each.pitch) == (chosen.hardness, chosen.pitch)]
    good = [each.holds(load) and each.error <= FLAT * chosen.error for each in line]
    low = high = line.index(chosen)
    while low and good[low - 1]:
        low -= 1
    while high + 1 < len(line) and good[high + 1]:
        high += 1
    return best, (line[low].thickness, line[high].thickness)
