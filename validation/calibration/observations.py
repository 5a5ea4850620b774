"""Mean images under known loads, as arrays that the forward model is fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from meshes import Indenter
from meshes.array import FloatArray

BoolArray = npt.NDArray[np.bool_]


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
    def known(self) -> bool:
        """Whether no part of the pose is fitted."""
        return None not in (self.at, self.yaw, self.tilt)


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

    def select(self, chosen: npt.NDArray[np.bool_]) -> Observations:
        """Return the images for which `chosen`, shape (m,), is true."""
        index = np.flatnonzero(chosen)
        return replace(
            self,
            placements=tuple(self.placements[k] for k in index),
            groups=tuple(self.groups[k] for k in index),
            creep=self.creep[index] if self.creep.size else self.creep,
            **{
                name: getattr(self, name)[index]
                for name in ("loads", "counts", "measured", "temperatures", "ages", "thresholds")
            },
        )


def join_observations(parts: Sequence[Observations]) -> Observations:
    """Join several sets of images to one.

    Raises:
        ValueError: If there are none.
    """
    if not parts:
        raise ValueError("there are no recordings; name at least three")
    names = ("loads", "counts", "measured", "temperatures", "ages", "thresholds", "creep")
    return Observations(
        placements=tuple(each for part in parts for each in part.placements),
        groups=tuple(each for part in parts for each in part.groups),
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names},
    )
