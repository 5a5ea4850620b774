"""The problem of a press, the input of every solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from fem_reference.finite_strain.loading_path import Control
from meshes import Indenter, Pose, TexelArray

#: Kinds of strain that a user can request.
STRAINS = ("small", "finite")


@dataclass(frozen=True, kw_only=True, eq=False)
class PressProblem:
    """Input of a solver besides the cover, with checked values.

    Attributes:
        array: Array with the texels under the cover.
        indenter: Indenter with its shape.
        pose: Pose of the indenter, and direction of its motion.
        targets: Target loads [N] or depths [m], ascending.
        control: Whether the targets are loads or depths.
        friction: Coefficient of Coulomb friction between indenter and cover, inf for no slip [-].
        strain: Requested kind of strain; None for the default of the solver.
        accuracy: Wanted relative error; None for the usual grids [-].
        fields: Whether the results have displacement and stress in the cover.
        progress: Called with a line of text before each solve; None for no reports.
    """

    array: TexelArray
    indenter: Indenter
    pose: Pose
    targets: tuple[float, ...]
    control: Control
    friction: float = 0.0
    strain: Literal["small", "finite"] | None = None
    accuracy: float | None = None
    fields: bool = False
    progress: Callable[[str], None] | None = None
