"""Mean images under known loads, as arrays that the forward model is fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from meshes import Indenter
from meshes.array_types import FloatArray

BoolArray = npt.NDArray[np.bool_]


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
        """The five numbers, shape (5,) [m, m, rad, rad, rad]."""
        return np.array([self.x, self.y, self.yaw, self.tilt_x, self.tilt_y])

    def named(self) -> dict[str, float]:
        """Return the five numbers by names that end in the units."""
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
        """The pose; None if a part of it is fitted."""
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

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            ValueError: If shapes disagree, or a load is negative or not finite.
        """
        m = len(self.loads)
        lengths = {len(each) for each in (self.placements, self.groups, self.temperatures, self.ages, self.thresholds)}
        if self.counts.ndim != 2 or self.counts.shape != self.measured.shape or {len(self.counts), *lengths} != {m}:  # noqa: PLR2004
            raise ValueError(f"{m} loads need counts of shape ({m}, n) and {m} entries of everything else")
        if not (np.isfinite(self.loads).all() and (self.loads >= 0).all()):
            raise ValueError("loads must be numbers of 0 or more")

    @property
    def distinct_placements(self) -> tuple[Placement, ...]:
        """Each placement once, in the order of the images."""
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
