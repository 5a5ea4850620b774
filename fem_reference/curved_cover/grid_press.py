"""Contact of one indenter on one mesh of a curved cover, at a depth or under a load."""

from __future__ import annotations

from typing import Literal

import numpy as np

from fem_reference.curved_cover.compliance import NormalCompliance
from fem_reference.curved_cover.contact import ContactForces, solve_contact
from fem_reference.curved_cover.pressure_shapes import GapSampler
from fem_reference.errors import ConvergenceError, PiercedError, TooShallowError
from meshes.array_types import FloatArray

#: Largest difference between the load and its target, over the target, and largest number of steps to it [-].
_LOAD_ERROR, _STEPS = 1e-7, 60
#: Every this many steps to the load the interval is halved, so that it shrinks where the secants do not [-].
_BISECT = 5
#: Rank of the node, by its distance from the indenter, at whose touch the search for a load starts.
_FIRST_NODES = 4


class GridPress:
    """Contact of one indenter on one mesh, at a depth or under a load.

    Args:
        compliance: Compliance of the top of the mesh.
        sampler: Points of the top that the indenter can touch.
        direction: Unit direction of the motion, shape (3,).
        touch: Travel to the first touch [m].
        deepest: Largest depth that is solved [m].

    Attributes:
        touch: Travel to the first touch [m].
    """

    def __init__(
        self,
        compliance: NormalCompliance,
        sampler: GapSampler,
        direction: FloatArray,
        touch: float,
        deepest: float,
    ) -> None:
        self._compliance, self._sampler, self._direction = compliance, sampler, direction
        self.touch, self._deepest = touch, deepest

    def to(self, target: float, control: Literal["load", "depth"]) -> ContactForces:
        """Solve the contact under a load [N] or at a depth [m].

        Raises:
            TooShallowError: If the indenter touches less than the shapes of the pressure resolve.
        """
        found = self.at_depth(target) if control == "depth" else self.under_load(target)
        if not found.load > 0:
            raise TooShallowError(
                f"at a depth of {1e3 * target:.3g} mm the indenter touches less than the mesh of the cover resolves; "
                "use a larger depth or a finer mesh"
            )
        return found

    def at_depth(self, depth: float) -> ContactForces:
        """Solve the contact at a depth [m]."""
        self._check_depth(depth)
        return solve_contact(self._compliance, self._sampler, self._direction, self.touch + depth)

    def _check_depth(self, depth: float) -> None:
        """Raise a `PiercedError` beyond the largest depth [m]."""
        if depth > self._deepest:
            raise PiercedError(
                f"at a depth of {1e3 * depth:.4g} mm the indenter would go through most of the cover; use at most "
                f"{1e3 * self._deepest:.4g} mm",
                "depth",
            )

    def under_load(self, load: float, *, start: float | None = None, least: float = 0.0) -> ContactForces:
        """Find the depth at which the load is reached [N], by the secant method between bounds.

        The stiffness of the contact starts it: it leaves out that hats grow as the indenter moves.

        Args:
            load: The load [N].
            start: Depth at which the search starts; that at which a few nodes touch if None [m].
            least: Depth below the wanted one [m].
        """
        low, high = least, np.inf
        depth, before = self._first_depth() if start is None else start, None
        for number in range(1, _STEPS + 1):
            contact = self.at_depth(min(depth, self._deepest))
            excess = contact.load - load
            if abs(excess) <= _LOAD_ERROR * load:
                return contact
            if excess < 0 and depth >= self._deepest:
                raise PiercedError(
                    f"{load:.4g} N would press the indenter through most of the cover; use at most {contact.load:.3g} "
                    "N, a wider indenter or a stiffer cover",
                    "load",
                )
            low, high = (depth, high) if excess < 0 else (low, depth)
            slope = contact.stiffness
            if before is not None and (contact.load - before[1]) * (depth - before[0]) > 0:
                slope = (contact.load - before[1]) / (depth - before[0])
            before = depth, contact.load
            depth = min(depth - excess / slope, self._deepest) if slope > 0 else self._deepest
            if not low < depth < high or (number % _BISECT == 0 and np.isfinite(high)):
                depth = (low + high) / 2 if np.isfinite(high) else self._deepest
        raise ConvergenceError(f"the depth under {load:.4g} N was not found in {_STEPS} steps")

    def _first_depth(self) -> float:
        """Return a depth at which a few nodes touch [m]."""
        depth = self._deepest / 128
        while depth < self._deepest and (self.at_depth(depth).forces > 0).sum() < _FIRST_NODES:
            depth *= 2
        return min(depth, self._deepest)
