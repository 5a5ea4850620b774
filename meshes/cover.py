"""Planar covers: the elastic layers between an indenter and the texel array, on a rigid base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from meshes.array_types import is_positive
from meshes.material import Material

#: How the bottom layer lies on the rigid base.
Base = Literal["bonded", "sliding"]


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
        """Check the thickness and the material.

        Raises:
            ValueError: If the thickness is not positive and finite.
            TypeError: If the material is not a `Material`.
        """
        if not is_positive(self.thickness):
            raise ValueError(f"thickness must be positive, not {self.thickness} m")
        if not isinstance(self.material, Material):
            raise TypeError(f"material must be a Material, for example MATERIALS['tpu'], not {self.material!r}")


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
            raise ValueError(f"cover size must be positive edge lengths along x and y, not {self.size} m")

    @property
    def thickness(self) -> float:
        """Total thickness of the layers [m]."""
        return sum(layer.thickness for layer in self.layers)

    @property
    def small_strain_only(self) -> bool:
        """Whether the materials of all layers are valid at small strain only."""
        return all(layer.material.small_strain_only for layer in self.layers)
