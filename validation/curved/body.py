"""Body of a curved cover: where its shape comes from, and the meshes that the finite elements solve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

from meshes.solids import SolidMesh, SweptCover

#: Receives a line of text before each step.
Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class CoverBody:
    """Body of a curved cover.

    Attributes:
        source: What the body is made from, in words.
        thickness: Thickness along the normals of the base, or its mean [m].
        make: Function that makes meshes of a thickness [m], coarsest first, and reports its progress.
        changeable: Whether the body can be made with another thickness.
        notes: Sentences on what was repaired or assumed.
    """

    source: str
    thickness: float
    make: Callable[[float, Progress], tuple[SolidMesh, ...]]
    changeable: bool = True
    notes: tuple[str, ...] = ()
    _made: dict[float, tuple[SolidMesh, ...]] = field(default_factory=dict, repr=False)

    def meshes(self, progress: Progress | None = None) -> tuple[SolidMesh, ...]:
        """Make the meshes, coarsest first; they are kept for the next call.

        Raises:
            ValueError: If the body cannot be meshed, with one line per fault.
            ModuleNotFoundError: If the mesher is not installed.
        """
        if self.thickness not in self._made:
            self._made[self.thickness] = self.make(self.thickness, progress or (lambda _: None))
        return self._made[self.thickness]

    def with_thickness(self, thickness: float) -> CoverBody:
        """Return the same body with another thickness [m].

        Raises:
            ValueError: If the thickness follows from the given surfaces.
        """
        if thickness == self.thickness:
            return self
        if not self.changeable:
            raise ValueError(f"the thickness follows from {self.source}; leave it out")
        return replace(self, thickness=thickness)


def make_swept_body(cover: SweptCover, source: str) -> CoverBody:
    """Make the body of a cover that is swept from its base."""
    return CoverBody(source=source, thickness=cover.thickness, make=partial(_sweep, cover))


def _sweep(cover: SweptCover, thickness: float, progress: Progress) -> tuple[SolidMesh, ...]:
    progress("hexahedra swept from the base")
    return replace(cover, thickness=thickness).meshes()
