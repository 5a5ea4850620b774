"""Planar covers: elastic layers on a rigid base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from meshes.material import Material


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One elastic layer.

    Attributes:
        thickness: Thickness [m].
        material: What it is made of.
    """

    thickness: float
    material: Material

    def __post_init__(self) -> None:
        """Check the thickness.

        Raises:
            ValueError: If it is not positive.
        """
        if not self.thickness > 0:
            raise ValueError(f"thickness must be positive, not {self.thickness} m")


@dataclass(frozen=True, kw_only=True)
class Cover:
    """Layers from bottom to top, fully bonded to one another; the bottom one rests on the rigid base.

    Attributes:
        layers: The layers, bottom first.
        base: Whether the bottom layer is bonded to the base or slides on it without friction.
        size: Edge lengths along x and y when the side edges are free [m]; None for a laterally wide cover.
        assumed: True where nobody measured this cover; every report says so.
    """

    layers: tuple[Layer, ...]
    base: Literal["bonded", "sliding"] = "bonded"
    size: tuple[float, float] | None = None
    assumed: bool = False

    def __post_init__(self) -> None:
        """Check that there is a layer.

        Raises:
            ValueError: If there is none or a size is not positive.
        """
        if not self.layers:
            raise ValueError("a cover needs at least one layer")
        if self.size is not None and min(self.size) <= 0:
            raise ValueError(f"cover size must be positive, not {self.size} m")

    @property
    def thickness(self) -> float:
        """Total thickness [m]."""
        return sum(layer.thickness for layer in self.layers)

    @property
    def small_strain_only(self) -> bool:
        """Whether no layer has a stored energy, so that only small strain makes sense."""
        return all(layer.material.small_strain_only for layer in self.layers)
