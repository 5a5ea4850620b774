"""What one grid answers for one target, whatever solved it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from fem_reference.grid_convergence import extrapolated
from meshes import TexelArray
from meshes.pose import Pose

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
    def overlap(self) -> float:
        """Mean distance that contact left between the surfaces, over the depth [-]."""

    @property
    def surface(self) -> FloatArray:
        """Where the touching points are, in the indenter's frame, and their force: x, y [m], force [N], (m, 3)."""

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:
        """Force on each texel for a pose, shape (n,) [N]."""


class Grounded(Level, Protocol):
    """A level that knows the base pressure on a grid of points."""

    @property
    def half(self) -> tuple[float, float]:
        """Half widths of the shape's footprint [m]."""

    @property
    def x(self) -> FloatArray:
        """Points along x, shape (m,) [m]."""

    @property
    def y(self) -> FloatArray:
        """Points along y, shape (n,) [m]."""

    @property
    def pressure(self) -> FloatArray:
        """Base pressure, shape (m, n) [Pa]."""


def shared_out(level: Grounded, pose: Pose) -> FloatArray:
    """The force on the indenter shared out by the base pressure under it: a stand-in for where it touches.

    Args:
        level: Base pressure on points whose frame the pose leads to.
        pose: Where the indenter stands among the points.

    Returns:
        In the indenter's frame: x, y [m], force [N], shape (m, 3).
    """
    x, y = pose.local(*np.meshgrid(level.x, level.y, indexing="ij"))
    weight = np.outer(np.gradient(level.x), np.gradient(level.y)) * np.maximum(level.pressure, 0)
    under = (np.abs(x) <= level.half[0]) & (np.abs(y) <= level.half[1])
    return np.column_stack([x[under], y[under], weight[under] * level.total_force / weight[under].sum()])


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledLevel:
    """A flat face's small-strain answer at another load or depth: the contact stays as it is and all else is scaled.

    Attributes:
        level: The answer that is scaled.
        factor: By how much [-].
    """

    level: Level
    factor: float

    @property
    def total_force(self) -> float:
        """Force on the indenter [N]."""
        return self.factor * self.level.total_force

    @property
    def depth(self) -> float:
        """Approach from first touch [m]."""
        return self.factor * self.level.depth

    @property
    def area(self) -> float:
        """Contact area [m2]."""
        return self.level.area

    @property
    def overlap(self) -> float:
        """Mean distance that contact left between the surfaces, over the depth [-]."""
        return self.level.overlap

    @property
    def surface(self) -> FloatArray:
        """Touching points, shape (m, 3)."""
        return self.level.surface * [1, 1, self.factor]

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:
        """Force on each texel for a pose, shape (n,) [N]."""
        return self.factor * self.level.texel_forces(array, at, yaw)


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
        return float(extrapolated([level.total_force for level in self.levels], self.sizes))

    @property
    def depth(self) -> float:
        """Approach from first touch [m]."""
        return float(extrapolated([level.depth for level in self.levels], self.sizes))

    @property
    def area(self) -> float:
        """Contact area of the finest grid [m2]."""
        return self.levels[-1].area

    @property
    def overlap(self) -> float:
        """Mean distance that contact left between the surfaces, over the depth [-]."""
        return self.levels[-1].overlap

    @property
    def surface(self) -> FloatArray:
        """Touching points of the finest grid, shape (m, 3)."""
        return self.levels[-1].surface

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:
        """Force on each texel for a pose, shape (n,) [N]."""
        return extrapolated([level.texel_forces(array, at, yaw) for level in self.levels], self.sizes)


@dataclass(frozen=True, kw_only=True, eq=False)
class CorrectedLevel:
    """A converged frictionless small-strain answer plus what finite strain or friction changes on one grid.

    Three-dimensional grids are coarse, round sharp edges and approach their limit slowly.  The small-strain solution on
    the same grid, under the same rounded shape, makes the same mistake, so the difference between the two carries the
    change alone and is added to the small-strain answer, which is known to four digits (a control variate).

    Attributes:
        exact: The converged frictionless small-strain answer for the target.
        rest: This grid's frictionless small-strain answer for the target over `share`.
        deep: This grid's answer for the target over `share`, with finite strain, friction or both.
        control: Which of load and depth the target is.
        share: The change is taken where it stands out of what a grid resolves, at the target over `share`; what finite
            strain changes is of first order in it, so this share of it belongs to the target [-].
        touched: Small-strain grid that tells the contact area where this one cannot, under flat faces.
    """

    exact: Level
    rest: Level
    deep: Level
    control: Literal["load", "depth"]
    share: float = 1.0
    touched: Level | None = None

    @property
    def total_force(self) -> float:
        """Force on the indenter [N]."""
        if self.control == "load":
            return self.share * self.deep.total_force
        return self.depth * self.exact.total_force / self.exact.depth * self._changed(lambda x: x.total_force / x.depth)

    @property
    def depth(self) -> float:
        """Approach from first touch [m]."""
        if self.control == "depth":
            return self.share * self.deep.depth
        return (
            self.total_force
            * self.exact.depth
            / self.exact.total_force
            * self._changed(lambda x: x.depth / x.total_force)
        )

    @property
    def area(self) -> float:
        """Contact area [m2]."""
        return self.touched.area if self.touched is not None else self.exact.area * self._changed(lambda x: x.area)

    @property
    def overlap(self) -> float:
        """Mean distance that contact left between the surfaces, over the depth [-]."""
        return max(self.rest.overlap, self.deep.overlap)

    @property
    def surface(self) -> FloatArray:
        """Touching points at the target, shape (m, 3)."""
        return self.deep.surface * [1, 1, self.total_force / self.deep.total_force]

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:
        """Force on each texel for a pose, shape (n,) [N]."""
        exact, rest, deep = (
            level.texel_forces(array, at, yaw) / level.total_force for level in (self.exact, self.rest, self.deep)
        )
        return np.asarray((exact + self.share * (deep - rest)) * self.total_force)

    def _changed(self, quantity: Callable[[Level], float]) -> float:
        """Factor on a quantity [-]."""
        return 1 + self.share * (quantity(self.deep) / quantity(self.rest) - 1)
