"""Planar covers: the elastic layers between an indenter and the texel array, on a rigid base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from meshes.material import Material


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One elastic layer of a cover.

    Attributes:
        thickness: Thickness of the layer [m].
        material: Material of the layer.
    """

    thickness: float
    material: Material

    def __post_init__(self) -> None:
        """Check the thickness.

        Raises:
            ValueError: If the thickness is not positive.
        """
        if not self.thickness > 0:
            raise ValueError(f"thickness must be positive, not {self.thickness} m")


@dataclass(frozen=True, kw_only=True)
class Cover:
    """The elastic layers between an indenter and the array, bonded to one another, on a rigid base.

    Attributes:
        layers: The layers, from bottom to top.
        base: Whether the bottom layer is bonded to the rigid base, or slides on the base without friction.
        size: Edge lengths along x and y of a cover with free side edges; None for a cover so wide that its side edges
            have no effect [m].
        assumed: True if thickness and material were never measured; reports then say so.
    """

    layers: tuple[Layer, ...]
    base: Literal["bonded", "sliding"] = "bonded"
    size: tuple[float, float] | None = None
    assumed: bool = False

    def __post_init__(self) -> None:
        """Check the layers and the size.

        Raises:
            ValueError: If there is no layer, or an edge length is not positive.
        """
        if not self.layers:
            raise ValueError("a cover needs at least one layer")
        if self.size is not None and min(self.size) <= 0:
            raise ValueError(f"cover size must be positive, not {self.size} m")

    @property
    def thickness(self) -> float:
        """Total thickness of the layers [m]."""
        return sum(layer.thickness for layer in self.layers)

    @property
    def small_strain_only(self) -> bool:
        """Whether the materials of all layers are valid at small strain only."""
        return all(layer.material.small_strain_only for layer in self.layers)
