"""Units in which solvers compute: lengths in thicknesses of the cover, stresses in shear moduli of its top layer.

In SI units, displacements near 1e-6 m and pressures near 1e6 Pa share one matrix, which is then badly conditioned.
Measured: texel forces lost four digits, and nearly incompressible solids appeared singular.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from meshes import Cover


@dataclass(frozen=True, kw_only=True)
class Units:
    """SI values of the units of computation.

    Attributes:
        length: Unit of length [m].
        stress: Unit of stress [Pa].
    """

    length: float
    stress: float

    @classmethod
    def of(cls, cover: Cover) -> Units:
        """Units of a cover: its thickness and the shear modulus of its top layer."""
        return cls(length=cover.thickness, stress=cover.layers[-1].material.shear_modulus)

    @property
    def force(self) -> float:
        """Unit of force [N]."""
        return self.stress * self.length**2

    def scale_target(self, value: float, control: str) -> float:
        """Load [N] or depth [m] in these units [-]."""
        return value / (self.force if control == "load" else self.length)

    def scale_cover(self, cover: Cover) -> Cover:
        """Cover with its thicknesses in the unit of length; the materials keep their moduli in SI units."""
        layers = tuple(replace(layer, thickness=layer.thickness / self.length) for layer in cover.layers)
        return replace(cover, layers=layers)
