"""What one grid answers for one target, whatever solved it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from fem_reference.error import extrapolated
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]


class Level(Protocol):
    """One grid's answer."""

    @property
    def total_force(self) -> float:
        """Force on the indenter [N]."""

    @property
    def depth(self) -> float:
        """Approach from first touch [m]."""

    @property
    def area(self) -> float:
        """Contact area [m2]."""

    @property
    def surface(self) -> FloatArray:
        """Where the touching points are, in the indenter's frame, and their force: x, y [m], force [N], (m, 3)."""

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:
        """Force on each texel for a pose, shape (n,) [N]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ExtrapolatedLevel:
    """The limit of a first-order sequence of grids, as the pressure under a sharp edge makes it.

    Attributes:
        levels: The grids' answers, coarsest first.
        sizes: Their element sizes.
    """

    levels: Sequence[Level]
    sizes: Sequence[float]

    @property
    def total_force(self) -> float:
        """Force on the indenter [N]."""
        return extrapolated([level.total_force for level in self.levels], self.sizes)

    @property
    def depth(self) -> float:
        """Approach from first touch [m]."""
        return extrapolated([level.depth for level in self.levels], self.sizes)

    @property
    def area(self) -> float:
        """Contact area of the finest grid [m2]."""
        return self.levels[-1].area

    @property
    def surface(self) -> FloatArray:
        """Touching points of the finest grid, shape (m, 3)."""
        return self.levels[-1].surface

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:
        """Force on each texel for a pose, shape (n,) [N]."""
        last, before = (level.texel_forces(array, at, yaw) for level in (self.levels[-1], self.levels[-2]))
        return np.asarray(last + (last - before) / (self.sizes[-2] / self.sizes[-1] - 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class CorrectedLevel:
    """A converged small-strain answer plus what finite strain changes on one grid.

    A sharp edge is singular: three-dimensional grids round it and approach its limit slowly.  The small-strain limit of
    the same grid makes the same mistake, so the difference between the two carries the finite strain alone and is added
    to the small-strain answer, which is known to four digits (a control variate).

    Attributes:
        exact: The converged small-strain answer at any load.
        rest: This grid at a small load.
        deep: This grid at the target.
    """

    exact: Level
    rest: Level
    deep: Level

    @property
    def total_force(self) -> float:
        """Force on the indenter [N]."""
        return self.deep.total_force

    @property
    def depth(self) -> float:
        """Approach from first touch [m]."""
        exact, rest, deep = (level.depth / level.total_force for level in (self.exact, self.rest, self.deep))
        return (exact + deep - rest) * self.deep.total_force

    @property
    def area(self) -> float:
        """Contact area [m2]."""
        return self.exact.area * self.deep.area / self.rest.area

    @property
    def surface(self) -> FloatArray:
        """Touching points at the target, shape (m, 3)."""
        return self.deep.surface

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:
        """Force on each texel for a pose, shape (n,) [N]."""
        exact, rest, deep = (
            level.texel_forces(array, at, yaw) / level.total_force for level in (self.exact, self.rest, self.deep)
        )
        return np.asarray((exact + deep - rest) * self.deep.total_force)
