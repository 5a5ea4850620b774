"""Forward model of a recording: pose of the indenter, force on each texel by a contact method, and counts.

    counts = S(max(0, g (1 + a (T - T0)) C(t) / C(t0) (s f + o(T)) - threshold)),  C(t) = 1 + c ln(t / 2 s),
    o(T) = threshold - s (d + b (T - T0))

Here f is the texel force, s the sensitivity, g the gain of the texel, d the dead force (below which a texel of gain one
reads zero), a and b the temperature coefficients of the gain and of the dead force, c the creep coefficient, t0 the age
that the sensitivity holds for, and S the soft saturation of `fastmodel.signal.electronics`.  Creep and temperature act
on the counts before the firmware subtracts its threshold.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, field, fields, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

import fastmodel
import meshes
from fastmodel import Electronics, Parameters
from fastmodel.attachment import DEFAULT, choose_method
from fastmodel.bench import Bench
from fastmodel.errors import MissedArrayError
from fastmodel.signal.electronics import saturate
from meshes import Cover, Indenter, TexelArray, tilt_indenter
from meshes.array_types import FloatArray

if TYPE_CHECKING:
    from fem_reference import Indentation, PointSpread

BoolArray = npt.NDArray[np.bool_]

#: Time after loading at which the creep factor 1 + c ln(t / t0) is one, and from which it is fitted [s].
CREEP_START = 2.0


@dataclass(frozen=True, order=True)
class Pose:
    """Pose of an indenter in the array's frame: position [m], yaw and tilt [rad]."""

    x: float
    y: float
    yaw: float = 0.0
    tilt_x: float = 0.0
    tilt_y: float = 0.0

    @property
    def vector(self) -> FloatArray:
        """x, y, yaw, tilt_x and tilt_y, shape (5,) [m, m, rad, rad, rad]."""
        return np.array(astuple(self))

    def named(self) -> dict[str, float]:
        """Return x, y, yaw and the two tilts by names that end in the units."""
        names = ("x_m", "y_m", "yaw_rad", "tilt_x_rad", "tilt_y_rad")
        return dict(zip(names, self.vector.tolist(), strict=True))


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Pose of an indenter in the array's frame that one or several recordings share; None for a part that is fitted.

    Attributes:
        name: Name of the placement.
        indenter: The indenter.
        at: Position of the indenter's axis [m].
        yaw: Rotation of the indenter about its axis [rad].
        tilt: Rotations of the indenter about its x and y axes, before the yaw [rad].
    """

    name: str
    indenter: Indenter
    at: tuple[float, float] | None = None
    yaw: float | None = None
    tilt: tuple[float, float] | None = (0.0, 0.0)

    @property
    def pose(self) -> Pose | None:
        """Pose of the placement; None if a part of the pose is fitted."""
        if self.at is None or self.yaw is None or self.tilt is None:
            return None
        return Pose(*self.at, self.yaw, *self.tilt)


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """Mean tactile images under known loads: m images of n texels.

    Attributes:
        loads: Load of each image, shape (m,) [N].
        counts: Mean counts, shape (m, n) [-].
        measured: Whether each texel was measured in each image, shape (m, n).
        placements: Pose of the indenter in each image, m entries.
        groups: Name of the recording of each image, m entries; images of one recording have common errors.
        temperatures: Temperature of the sensor, NaN if unknown, shape (m,) [degC].
        ages: Time since loading, NaN if unknown, shape (m,) [s].
        thresholds: Counts that the firmware subtracted, shape (m,) [-].
        creep: Creep coefficient measured in each recording, NaN if unknown, shape (m,) [-].
        floors: Count up to which a texel does not differ from rest, shape (m, n) [-]; 0 if not given.
    """

    loads: FloatArray
    counts: FloatArray
    measured: BoolArray
    placements: tuple[Placement, ...]
    groups: tuple[str, ...]
    temperatures: FloatArray
    ages: FloatArray
    thresholds: FloatArray
    creep: FloatArray = field(default_factory=lambda: np.empty(0))
    floors: FloatArray = field(default_factory=lambda: np.empty(0))

    @property
    def lit(self) -> BoolArray:
        """Whether each texel was measured and its count differs from rest beyond noise, shape (m, n)."""
        return np.asarray(self.measured & (self.counts > (self.floors if len(self.floors) else 0.0)))

    @property
    def largest_count(self) -> float:
        """Largest count of a texel that was measured [-]."""
        return float(self.counts[self.measured].max())

    @property
    def distinct_placements(self) -> tuple[Placement, ...]:
        """All different placements of the images, in the order of the images."""
        return tuple(dict.fromkeys(self.placements))

    def rows_of(self, placement: Placement) -> BoolArray:
        """Return whether each image belongs to a placement, shape (m,)."""
        return np.array([each == placement for each in self.placements])

    def select(self, chosen: BoolArray) -> Observations:
        """Return the images for which `chosen`, shape (m,), is true."""
        index = np.flatnonzero(chosen)
        parts: dict[str, Any] = {each.name: getattr(self, each.name) for each in fields(self)}
        for name, part in parts.items():
            if len(part):
                parts[name] = part[index] if isinstance(part, np.ndarray) else tuple(part[k] for k in index)
        return Observations(**parts)


def join_observations(parts: Sequence[Observations]) -> Observations:
    """Join several sets of images to one.

    Raises:
        ValueError: If there are none.
    """
    if not parts:
        raise ValueError("there are no recordings; name at least three")
    columns: dict[str, Any] = {}
    for name in (each.name for each in fields(Observations)):
        values = [getattr(part, name) for part in parts]
        columns[name] = np.concatenate(values) if isinstance(values[0], np.ndarray) else sum(values, start=())
    return Observations(**columns)


#: Name of the contact method by finite elements.
REFERENCE = "reference"
#: Edge of the squares in which the contact forces of finite elements are summed to one force at their centroid, over
#: the pitch [-].  Fewer points make a fit of the pose faster.  The squares are far smaller than a texel.
_BIN = 0.1
#: Distance of the positions at which the contact of a level face is solved, over the pitch, and of the yaws [rad].
_LATTICE, _LATTICE_YAW = 0.1, 0.05
#: Number of loads at which the contact of an indenter that is not flat is solved [-].  Texel forces between them are
#: interpolated.
_LOADS = 7
#: Number of compiled models of one contact method that are kept [-].
_BENCHES = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactMethod:
    """A method that computes texel forces, with a cache of computed forces.

    Attributes:
        name: Name of the method in tables.
        about: Assumptions of the method, in a few words.
        array: The n texels.
        solve: Function from indenter, load [N] and pose to the force on each texel, shape (n,) [N].
        gain_error: Largest known relative error of a texel's share of the load by the method [-]; 0 for finite
            elements.  It is also an error of the gain of the texel.
        thickness: Thickness of the cover [m]; NaN where `rescale` is None.
        rescale: Makes the method for the cover with the thickness of all layers times a factor [-]; None for methods
            whose parameters hold for one cover.
    """

    name: str
    about: str
    array: TexelArray
    solve: Callable[[Indenter, float, Pose], FloatArray]
    gain_error: float = 0.0
    thickness: float = float("nan")
    rescale: Callable[[float], ContactMethod] | None = None
    # A changed copy has empty caches.
    _known: dict[tuple[Indenter, float, Pose], FloatArray] = field(init=False, default_factory=dict)
    _blocks: dict[tuple[Indenter, int, int, int, int], FloatArray] = field(init=False, default_factory=dict)

    def texel_forces(self, indenter: Indenter, loads: FloatArray, pose: Pose, *, smooth: bool = False) -> FloatArray:
        """Compute the force on each of n texels under each of m loads; zero where the indenter misses the array.

        Under the face of a flat, level indenter, forces are proportional to the load.  For other indenters the contact
        is solved at up to seven loads, and the share of each texel is interpolated linearly in the logarithm of the
        load.

        Args:
            indenter: The indenter.
            loads: Loads, shape (m,) [N].
            pose: Pose of the indenter.
            smooth: Whether the force under a level face is interpolated between a lattice of poses, as for a fit.

        Returns:
            Forces, shape (m, n) [N].
        """
        positive = loads[loads > 0]
        if not positive.size:
            return np.zeros((len(loads), self.array.count))
        if indenter.is_flat and not pose.tilt_x and not pose.tilt_y:
            share = self._interpolate_share(indenter, pose) if smooth else self._share(indenter, 1.0, pose)
            return np.outer(loads, share)
        low, high = float(positive.min()), float(positive.max())
        grid = np.unique(positive) if len(np.unique(positive)) <= _LOADS else np.geomspace(low, high, _LOADS)
        shares = np.array([self._share(indenter, float(load), pose) for load in grid])
        place = np.interp(np.log(np.maximum(loads, low)), np.log(grid), np.arange(len(grid)))
        below = np.minimum(place.astype(int), max(len(grid) - 2, 0))
        part = (place - below)[:, None]
        above = np.minimum(below + 1, len(grid) - 1)
        return np.asarray(loads[:, None] * ((1 - part) * shares[below] + part * shares[above]))

    def _interpolate_share(self, indenter: Indenter, pose: Pose) -> FloatArray:
        """Interpolate the share of each texel under a level face between a lattice of poses, shape (n,) [-].

        Fits of one indenter use the same poses of the lattice again and again, so that each is solved once.
        """
        steps = np.array([_LATTICE * each for each in self.array.pitch] + [_LATTICE_YAW])
        place = np.array([pose.x, pose.y, pose.yaw]) / steps
        corner = np.floor(place).astype(int)
        t = place - corner
        # Cubic convolution after Keys (1981), with weights for the nodes -1, 0, 1 and 2 of each axis.
        weights = 0.5 * np.array([-t + 2 * t**2 - t**3, 2 - 5 * t**2 + 3 * t**3, t + 4 * t**2 - 3 * t**3, t**3 - t**2])
        yaws = range(4) if t[2] and not indenter.axisymmetric else (1,)
        key = indenter, *corner.tolist(), len(yaws)
        if key not in self._blocks:
            nodes = [(corner + node - 1) * steps for node in itertools.product(range(4), range(4), yaws)]
            shares = np.array([self._share(indenter, 1.0, Pose(*node.tolist())) for node in nodes])
            self._blocks[key] = shares.reshape(16, len(yaws), -1)
        about_z = weights[:, 2] if len(yaws) > 1 else np.ones(1)
        return np.asarray(np.outer(weights[:, 0], weights[:, 1]).ravel() @ (about_z @ self._blocks[key]))

    def _share(self, indenter: Indenter, load: float, pose: Pose) -> FloatArray:
        key = indenter, load, pose
        if key not in self._known:
            self._known[key] = self.solve(indenter, load, pose) / load
        return self._known[key]


def make_fast_method(parameters: Parameters, method: str = DEFAULT) -> ContactMethod:
    """Make the contact method of a fast model.

    Args:
        parameters: Array and cover of the fast model.
        method: Name of its contact method (`fastmodel.METHODS`), or `default`.
    """

    @lru_cache(maxsize=_BENCHES)
    def make_bench(indenter: Indenter, load: float) -> Bench:
        away = fastmodel.Placement(indenter=indenter, load=load, at=parameters.array.pitch)
        return Bench(parameters, [away], contact=method)

    def solve(indenter: Indenter, load: float, pose: Pose) -> FloatArray:
        try:
            bench = make_bench(tilt_indenter(indenter, (pose.tilt_x, pose.tilt_y)), load)
            return bench.press([(pose.x, pose.y, pose.yaw)]).texel_forces
        except MissedArrayError:
            return np.zeros(parameters.array.count)

    chosen = choose_method(method, parameters)[0]
    return ContactMethod(
        name=f"fast model, {chosen}",
        about=_ABOUT.get(chosen, chosen),
        array=parameters.array,
        solve=solve,
        gain_error=_COVER_ERROR if chosen == "cover" else _SPREAD_ERROR,
    )


#: Largest relative error of a fitted gain with the contact method `cover` [-].  It was found against finite elements,
#: on simulated recordings of a box of 16 mm x 12 mm on 8 x 10 texels.
_COVER_ERROR = 0.033
#: Largest relative error of a fitted gain with the other contact methods, on the recordings of `_COVER_ERROR` [-].
#: It occurred where the force was spread by a Gaussian, which was narrower than a texel.
_SPREAD_ERROR = 0.34
#: Assumptions of each contact method, by its name.
_ABOUT = {
    "cover": "contact pressure on the layered cover, solved cell by cell",
    "boxes": "MuJoCo boxes share the load by contact points; Gaussian spread",
    "foundation": "springs under the cover's surface; spread of the cover if known, else Gaussian",
    REFERENCE: "rigid frictionless indenter on the cover by finite elements at small strain",
}


def make_reference_method(cover: Cover, array: TexelArray) -> ContactMethod:
    """Make the contact method by finite elements at small strain.

    On a wide cover the contact is the same at every position and yaw, so it is solved once for each load and tilt.

    Args:
        cover: Cover; its materials are linearised and its side edges are neglected.
        array: The texels.
    """
    from fem_reference import point_spread, press
    from validation.derivation.contact_range import linearise

    linear = linearise(cover)
    contacts: dict[tuple[Indenter, float, float, float], tuple[FloatArray, FloatArray]] = {}
    spread: list[PointSpread] = []

    def solve(indenter: Indenter, load: float, pose: Pose) -> FloatArray:
        key = indenter, load, pose.tilt_x, pose.tilt_y
        if not spread:
            spread.append(point_spread(linear))
        if key not in contacts:
            pressed = press(
                linear, array, indenter, load=load, pose=meshes.Pose.planar(tilt=(pose.tilt_x, pose.tilt_y))
            )
            contacts[key] = _bin_forces(pressed, _BIN * min(array.pitch))
        points, forces = contacts[key]
        c, s = np.cos(pose.yaw), np.sin(pose.yaw)
        places = points @ np.array([[c, s], [-s, c]]) + (pose.x, pose.y)
        return np.asarray(load * (forces @ spread[0].texel_influence(array, places)) / forces.sum())

    def rescale(factor: float) -> ContactMethod:
        layers = tuple(replace(layer, thickness=factor * layer.thickness) for layer in cover.layers)
        return make_reference_method(replace(cover, layers=layers), array)

    return ContactMethod(
        name=REFERENCE, about=_ABOUT[REFERENCE], array=array, solve=solve, thickness=cover.thickness, rescale=rescale
    )


def _bin_forces(found: Indentation, edge: float) -> tuple[FloatArray, FloatArray]:
    """Sum the normal forces of a press on layers in squares of a given edge.

    Args:
        found: The press.
        edge: Edge of the squares [m].

    Returns:
        Centroids of the forces in k squares, shape (k, 2) [m], and the forces, shape (k,) [N].
    """
    normal = -found.contact_forces[:, 2]
    places, normal = found.contact_points[normal > 0, :2], normal[normal > 0]
    squares = np.floor(places / edge).astype(np.int64)
    _, index = np.unique(squares, axis=0, return_inverse=True)
    index = index.ravel()
    forces = np.asarray(np.bincount(index, normal), dtype=np.float64)
    centres = [np.bincount(index, normal * places[:, axis]) / forces for axis in (0, 1)]
    return np.column_stack(centres), forces


@dataclass(frozen=True, kw_only=True, eq=False)
class CountCurve:
    """Parameters of the conversion from texel force to counts.

    Attributes:
        sensitivity: Slope s for a texel of gain one, at T0 and t0 [counts/N].
        dead_force: Dead force d [N].
        gain_temperature: Temperature coefficient a of the gain [1/K].
        dead_temperature: Temperature coefficient b of the dead force [N/K].
        reference_temperature: Temperature T0 [degC].
        creep: Creep coefficient c [-].
        reference_age: Time t0 since loading that the sensitivity holds for [s].
        output_max: Largest count after subtraction of the threshold; inf for no saturation [-].
        saturation_band: Counts below `output_max` over which the curve bends [-].
        gains: Gain g of each of n texels, shape (n,) [-].
        heights: Load at which each texel begins to carry, relative to that of an even face, shape (n,) [N]; zeros for
            even seating, see `seat_unevenly`.
    """

    sensitivity: float
    dead_force: float
    gain_temperature: float
    dead_temperature: float
    reference_temperature: float
    creep: float
    reference_age: float = CREEP_START
    output_max: float
    saturation_band: float
    gains: FloatArray
    heights: FloatArray

    def predict(
        self, forces: FloatArray, *, temperatures: FloatArray, ages: FloatArray, thresholds: FloatArray
    ) -> FloatArray:
        """Predict the counts of m images without rounding.

        Args:
            forces: Texel forces under an even face, shape (m, n) [N].
            temperatures: Temperature of each image; NaN where it is unknown, which means T0, shape (m,) [degC].
            ages: Time since loading of each image; NaN where it is unknown, which means t0, shape (m,) [s].
            thresholds: Counts that the firmware subtracts, shape (m,) [-].

        Returns:
            Counts, shape (m, n) [-].
        """
        if self.heights.any():
            forces = seat_unevenly(forces, self.heights)
        factor, offset = self._find_line(temperatures, ages, thresholds)
        signal = self.gains * (factor[:, None] * (self.sensitivity * forces + offset[:, None])) - thresholds[:, None]
        signal = np.maximum(signal, 0.0)
        if not np.isfinite(self.output_max):
            return np.asarray(signal)
        return np.asarray(saturate(signal, self.output_max, self.saturation_band))

    def _find_line(
        self, temperatures: FloatArray, ages: FloatArray, thresholds: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the factor of temperature and creep on all counts, and the offset before it, shape (m,) each [-]."""
        warmer = np.nan_to_num(temperatures - self.reference_temperature)
        ages = np.nan_to_num(ages, nan=self.reference_age)
        crept, at_reference = (1 + self.creep * np.log(age / CREEP_START) for age in (ages, self.reference_age))
        offset = thresholds - self.sensitivity * (self.dead_force + self.dead_temperature * warmer)
        return (1 + self.gain_temperature * warmer) * (crept / at_reference), offset

    def electronics(self, rate_hz: float, *, temperature: float, age: float, threshold: float) -> Electronics:
        """Return the curve at one temperature [degC] and time under load [s] as electronics of the fast model.

        Args:
            rate_hz: Frames per second [Hz].
            temperature: Temperature; NaN for T0 [degC].
            age: Time since loading; NaN for t0 [s].
            threshold: Counts that the firmware subtracts [-].
        """
        factor, offset = (float(each[0]) for each in self._find_line(*np.array([[temperature], [age], [threshold]])))
        saturates = bool(np.isfinite(self.output_max))
        largest = round(self.output_max) if saturates else 4095
        return Electronics(
            rate_hz=rate_hz,
            sensitivity=self.sensitivity * factor,
            offset=offset * factor,
            output_max=largest,
            bits=max(12, largest.bit_length()),
            threshold=threshold,
            saturation_band=self.saturation_band if saturates else 0.0,
            gains=tuple(self.gains.tolist()),
        )


def seat_unevenly(forces: FloatArray, heights: FloatArray) -> FloatArray:
    """Divide the load of each image among texels that an uneven face reaches one after the other.

    Texel i carries F_i max(0, p - e_i) / p0, where F_i is its force under an even face, p0 the load, e_i its height
    expressed as a load, and p the approach, expressed as a load, at which the sum of the forces is that of the F_i.
    This is a row of springs whose stiffnesses are the shares of the even face.

    Args:
        forces: Texel forces under an even face, shape (m, n) [N].
        heights: Heights e, shape (n,) [N].

    Returns:
        Forces, shape (m, n) [N].
    """
    total = forces.sum(axis=1, keepdims=True)
    share = np.divide(forces, total, out=np.zeros_like(forces), where=total > 0)
    order = np.argsort(heights)
    sorted_heights, stiffness = heights[order], np.cumsum(share[:, order], axis=1)
    moment = np.cumsum(share[:, order] * sorted_heights, axis=1)
    # With the first k texels in contact, sum share (p - e) = total gives p.  The contact is correct if p lies between
    # the heights of texel k and k + 1.
    approach = np.divide(total + moment, stiffness, out=np.full_like(forces, np.inf), where=stiffness > 0)
    reached = np.where(total > 0, np.minimum.accumulate(approach, axis=1)[:, -1:], 0.0)  # nothing touches without load
    return np.asarray(share * np.maximum(reached - heights, 0.0))
