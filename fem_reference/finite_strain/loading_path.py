"""What is pressed how far, for every solver at finite strain or with friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from meshes import Cover, Indenter

#: Factor on heights and targets that leaves no strain to speak of [-].
_REST = 1e-3


@dataclass(frozen=True, kw_only=True)
class LoadingPath:
    """One path of loads or depths.

    Attributes:
        cover: The cover; a small-strain material counts as neo-Hookean with the same moduli.
        indenter: The shape.
        targets: Loads [N] or depths [m], ascending.
        control: Which of the two.
        friction: Coefficient of Coulomb's law, inf for no slip [-].
        steepness: Factor on targets and on the indenter's heights; far below one there is no strain to speak of and the
            answer, divided by it again, is that of small strain [-].
    """

    cover: Cover
    indenter: Indenter
    targets: tuple[float, ...]
    control: Literal["load", "depth"]
    friction: float = 0.0
    steepness: float = 1.0

    @property
    def scaled(self) -> list[float]:
        """What the solver is asked for [N] or [m]."""
        return [self.steepness * target for target in self.targets]

    @property
    def at_its_strain(self) -> LoadingPath:
        """The path at the strain that the materials ask for: small where all of them are small-strain models."""
        return replace(self, steepness=_REST) if self.cover.small_strain_only else self

    @property
    def at_rest(self) -> LoadingPath:
        """The frictionless path at small strain."""
        return replace(self, friction=0.0, steepness=_REST)


def with_grid(progress: Callable[[str], None] | None, n: int) -> Callable[[str], None] | None:
    """`progress` with the grid named first."""
    return None if progress is None else lambda text: progress(f"{n} elements through the cover: {text}")
