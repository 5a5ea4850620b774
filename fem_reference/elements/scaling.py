"""Numbers near one: lengths in thicknesses, stresses in the top layer's shear modulus.

Displacements of a micrometre beside pressures of a megapascal make a matrix that no solver factorises well; measured,
texel forces lost four digits, and nearly incompressible solids looked singular.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from meshes import Cover


@dataclass(frozen=True, kw_only=True)
class Units:
    """What one stands for.

    Attributes:
        length: [m].
        stress: [Pa].
    """

    length: float
    stress: float

    @classmethod
    def of(cls, cover: Cover) -> Units:
        """The units of a cover."""
        return cls(length=cover.thickness, stress=cover.layers[-1].material.shear_modulus)

    @property
    def force(self) -> float:
        """[N]."""
        return self.stress * self.length**2

    def target(self, value: float, control: str) -> float:
        """A load [N] or a depth [m] as a number."""
        return value / (self.force if control == "load" else self.length)

    def thin(self, cover: Cover) -> Cover:
        """The cover with its thicknesses as numbers; the materials keep their moduli."""
        layers = tuple(replace(layer, thickness=layer.thickness / self.length) for layer in cover.layers)
        return replace(cover, layers=layers)
