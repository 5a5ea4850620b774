"""Layers of a cover: thickness and material of each."""

from __future__ import annotations

from dataclasses import dataclass, replace

from meshes.array_types import describe_lengths, is_positive
from meshes.material import Material

#: Remedy where a cover cannot have several layers.
ONE_LAYER = "several layers need a mesh of hexahedra swept from the base, as of the built-in covers"


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
            raise ValueError(f"thickness must be positive, not {describe_lengths(self.thickness)}")
        if not isinstance(self.material, Material):
            raise TypeError(f"material must be a Material, for example MATERIALS['tpu'], not {self.material!r}")


#: Material of a whole cover, or its layers from base to top, of whose thicknesses only the ratios count.
Layers = Material | tuple[Layer, ...]


def scale_layers(layers: Layers, thickness: float) -> tuple[Layer, ...]:
    """Return layers, or the one layer of a material, with a total thickness [m]."""
    if isinstance(layers, Material):
        return (Layer(thickness=thickness, material=layers),)
    factor = thickness / sum(each.thickness for each in layers)
    return tuple(replace(each, thickness=factor * each.thickness) for each in layers)
