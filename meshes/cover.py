"""Covers between an indenter and a texel array, on a rigid base: planar layers, or a solid of any shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Literal, get_args

import numpy as np

from meshes.array_types import FloatArray, describe_lengths, is_positive
from meshes.layer import ONE_LAYER, Layer

if TYPE_CHECKING:
    from meshes.solids import SolidMesh

#: Support of the bottom layer on the rigid base.
Base = Literal["bonded", "sliding"]


@dataclass(frozen=True, kw_only=True)
class Cover:
    """The elastic layers between an indenter and the array, bonded to one another, on a rigid base.

    Attributes:
        layers: The layers, from bottom to top.
        base: Whether the bottom layer is bonded to the rigid base, or slides on the base without friction.
        size: Edge lengths along x and y of a cover with free side edges [m]; None for a cover so wide that its side
            edges have no effect.
        assumed: Whether thickness and material are assumed and were never measured, which reports state.
        source: Origin of the shape, in words; empty for planar layers, whose shape is their thickness.
        notes: Sentences on repairs of the shape and assumptions about it; empty for planar layers.
    """

    source: ClassVar[str] = ""
    notes: ClassVar[tuple[str, ...]] = ()

    layers: tuple[Layer, ...]
    base: Base = "bonded"
    size: tuple[float, float] | None = None
    assumed: bool = False

    def __post_init__(self) -> None:
        """Check the layers and the size.

        Raises:
            ValueError: If there is no layer, the base is unknown, or the size is not two positive edge lengths.
            TypeError: If the layers are not a tuple or list of `Layer`.
        """
        if not isinstance(self.layers, tuple | list) or not all(isinstance(layer, Layer) for layer in self.layers):
            raise TypeError(f"layers must be a tuple of Layer, not {self.layers!r}")
        if not self.layers:
            raise ValueError("a cover needs at least one layer")
        if self.base not in get_args(Base):
            raise ValueError(f"unknown base {self.base!r}; accepted: {', '.join(get_args(Base))}")
        if self.size is not None and not (np.shape(self.size) == (2,) and all(map(is_positive, self.size))):
            raise ValueError(
                f"cover size must be positive edge lengths along x and y, not {describe_lengths(self.size)}"
            )

    @property
    def thickness(self) -> float:
        """Total thickness of the layers [m]."""
        return sum(layer.thickness for layer in self.layers)

    def meshes(self, progress: Callable[[str], None] | None = None) -> tuple[SolidMesh, ...]:
        """Raise an error, because planar layers have no meshes: their solvers make their own grids.

        Raises:
            ValueError: Always.
        """
        del progress
        raise ValueError("has a flat cover, which needs no mesh file")

    @property
    def small_strain_only(self) -> bool:
        """Whether the materials of all layers are valid at small strain only."""
        return all(layer.material.small_strain_only for layer in self.layers)


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidCover:
    """A cover of any shape, bonded to its base, with free sides, solved on meshes of its solid.

    Attributes:
        layers: The layers, from base to top, bonded to one another.  Their thickness is that along the normals of the
            base, or the mean thickness.
        source: Origin of the solid, in words.
        make: Function that makes meshes for the thicknesses of the layers [m], coarsest first, and reports its
            progress.
        assumed: Whether thickness and material are assumed and were never measured, which reports state.
        notes: Sentences on repairs of the shape and assumptions about it.
        given: Thicknesses of the layers that follow from the given shape [m]; None if any can be made.
        refine: Function that makes, for the thicknesses of the layers [m], a mesh finer than all of `make`; None if
            there is none.
        base_triangles: Triangles of the base, facing into the cover, shape (b, 3, 3) [m]; None for the base of the
            finest mesh.
    """

    base: ClassVar[Base] = "bonded"
    size: ClassVar[None] = None

    layers: tuple[Layer, ...]
    source: str
    make: Callable[[tuple[float, ...], Callable[[str], None]], tuple[SolidMesh, ...]]
    assumed: bool = False
    notes: tuple[str, ...] = ()
    given: tuple[float, ...] | None = None
    refine: Callable[[tuple[float, ...]], SolidMesh] | None = None
    base_triangles: FloatArray | None = None
    _made: dict[tuple[float, ...], tuple[SolidMesh, ...]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        """Check the layers.

        Raises:
            ValueError: If there is no layer, or number and thickness of the layers are not those of the given shape.
        """
        if not self.layers:
            raise ValueError("a cover needs at least one layer")
        if self.given is not None and len(self.layers) != len(self.given):
            count = f"{len(self.given)} layer" + "s" * (len(self.given) > 1)
            raise ValueError(f"{self.source} has {count}, not {len(self.layers)}: {ONE_LAYER}")
        if self.given not in {None, self.thicknesses}:
            raise ValueError(f"the thickness follows from {self.source}; leave it out")

    @property
    def thickness(self) -> float:
        """Thickness of the cover along the normals of its base, or the mean thickness if it varies [m]."""
        return sum(self.thicknesses)

    @property
    def thicknesses(self) -> tuple[float, ...]:
        """Thicknesses of the layers, from base to top [m]."""
        return tuple(layer.thickness for layer in self.layers)

    @property
    def small_strain_only(self) -> bool:
        """Whether the materials of all layers are valid at small strain only."""
        return all(layer.material.small_strain_only for layer in self.layers)

    def meshes(self, progress: Callable[[str], None] | None = None) -> tuple[SolidMesh, ...]:
        """Return the meshes of the cover, coarsest first.

        The meshes are made in the first call.  Later calls return the same meshes, also for a copy of this cover with
        other materials.

        Args:
            progress: Function that receives a line of text before each step; None for no progress.

        Raises:
            ValueError: If the solid cannot be meshed, with one line per fault.
            ModuleNotFoundError: If the mesher is not installed.
        """
        if self.thicknesses not in self._made:
            self._made[self.thicknesses] = self.make(self.thicknesses, progress or (lambda _: None))
        return self._made[self.thicknesses]
