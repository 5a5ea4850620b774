"""Exceptions that several solvers of `fem_reference` raise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any


class PiercedError(ValueError):
    """A load or depth would push the indenter through the cover.

    Attributes:
        control: Whether the target was a `load` or a `depth`.
        largest: Largest load that the cover bears [N]; NaN if it is not known.
    """

    def __init__(self, message: str, control: str, largest: float = math.nan) -> None:
        super().__init__(message)
        self.control, self.largest = control, largest


class UnsupportedError(ValueError):
    """An argument of `press` is not supported for the kind of cover that is pressed.

    Attributes:
        argument: Name of the argument of `press`.
    """

    def __init__(self, message: str, argument: str) -> None:
        super().__init__(message)
        self.argument = argument


class ConvergenceError(RuntimeError):
    """An iterative solver of this package stopped before it reached its tolerance."""


class PathConvergenceError(ConvergenceError):
    """The solution of a loading path stopped before its target, although steps were halved repeatedly.

    Attributes:
        cause: Reason why the last step did not converge, in words.
        load: Load of the last equilibrium [unit of force of `walk_to`]; 0 if no step converged.  Solvers of
            indentations convert it to newtons.
        depth: Depth of the last equilibrium [unit of length of `walk_to`]; 0 if no step converged.  Solvers of
            indentations convert it to metres.
        solved: Part of the path that was solved (`SolvedPath`), for initial guesses; None where there is none.
    """

    solved: Any = None

    def __init__(self, message: str, *, cause: str, load: float = 0.0, depth: float = 0.0) -> None:
        super().__init__(message)
        self.cause, self.load, self.depth = cause, load, depth


class TooShallowError(ConvergenceError):
    """The contact has no cell or node of the grid, because the load or depth is too small for the grid."""


class IncompletePathError(ConvergenceError):
    """A loading path stopped before its last target load or depth.

    Attributes:
        reached: Results (`Indentation`) of the targets that were reached on all grids, followed by that of the largest
            load or depth that was reached on all grids; empty if nothing was reached.
    """

    def __init__(self, message: str, reached: Sequence[Any]) -> None:
        super().__init__(message)
        self.reached = list(reached)
