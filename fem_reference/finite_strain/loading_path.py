"""The problem statement that all solvers of an indentation share: cover, indenter, targets, friction and units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from meshes import Cover, Indenter

#: Whether loads or depths are prescribed.
Control = Literal["load", "depth"]

#: Scale factor on geometry and load that makes the nonlinear solve effectively small-strain [-].
_SMALL_STRAIN_SCALE = 1e-3


@dataclass(frozen=True, kw_only=True)
class Units:
    """SI values of the units of computation: the thickness of a cover and the shear modulus of its top layer.

    In SI units, displacements near 1e-6 m and pressures near 1e6 Pa share one matrix, which is then badly conditioned.
    Measured: texel forces lost four digits, and nearly incompressible solids appeared singular.

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

    def scale_cover(self, cover: Cover) -> Cover:
        """Cover with its thicknesses in the unit of length; the materials keep their moduli in SI units."""
        layers = tuple(replace(layer, thickness=layer.thickness / self.length) for layer in cover.layers)
        return replace(cover, layers=layers)


@dataclass(frozen=True, kw_only=True)
class LoadingPath:
    """A path of ascending loads or depths of one indenter on one cover.

    Small-strain contact is homogeneous: if the indenter's heights and the load or depth are multiplied by a factor, the
    displacements are as well.  A solver for finite strain therefore returns the small-strain solution, times
    `load_scale`, if that factor is small.

    Attributes:
        cover: The cover; solvers for finite strain treat a small-strain material as neo-Hookean with the same moduli.
        indenter: The shape.
        targets: Loads [N] or depths [m], ascending.
        control: Whether the targets are loads or depths.
        friction: Coefficient of Coulomb friction, inf for no slip [-].
        load_scale: Factor on the targets and on the indenter's heights [-].
    """

    cover: Cover
    indenter: Indenter
    targets: tuple[float, ...]
    control: Control
    friction: float = 0.0
    load_scale: float = 1.0

    @property
    def units(self) -> Units:
        """Units in which the path is solved."""
        return Units.of(self.cover)

    @property
    def scaled_targets(self) -> list[float]:
        """Targets times the load scale, in the units of computation [-]."""
        unit = self.units.force if self.control == "load" else self.units.length
        return [self.load_scale * target / unit for target in self.targets]

    @property
    def at_model_strain(self) -> LoadingPath:
        """The path at the strain that its material models describe: small if all layers are small-strain models."""
        return replace(self, load_scale=_SMALL_STRAIN_SCALE) if self.cover.small_strain_only else self

    @property
    def baseline(self) -> LoadingPath:
        """The same path without friction and at small strain."""
        return replace(self, friction=0.0, load_scale=_SMALL_STRAIN_SCALE)


def name_grid(progress: Callable[[str], None] | None, count: int) -> Callable[[str], None] | None:
    """Return `progress` with the number of elements through the cover put before each line; None stays None."""
    return None if progress is None else lambda text: progress(f"{count} elements through the cover: {text}")
