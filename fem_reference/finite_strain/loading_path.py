"""Define the problem that the solvers of an indentation solve: cover, indenter, target loads or depths, friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from meshes import Cover, Indenter
from meshes.array_types import FloatArray

#: Quantity that is prescribed along a loading path: the load or the depth of the indenter.
Control = Literal["load", "depth"]

#: Function that receives a line of text about the progress of a solution, or None.
Progress = Callable[[str], None] | None

#: Load scale for small strain [-].  With it a finite-strain solver returns the small-strain solution, multiplied by the
#: scale.
_SMALL_STRAIN_SCALE = 1e-3


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of length and stress in which a problem is solved: cover thickness and shear modulus of the top layer.

    In SI units, one matrix would combine displacements near 1e-6 m with pressures near 1e6 Pa and be ill-conditioned:
    in a test, texel forces lost four digits, and nearly incompressible solids appeared singular.

    Attributes:
        length: Unit of length [m].
        stress: Unit of stress [Pa].
    """

    length: float
    stress: float

    @classmethod
    def of(cls, cover: Cover) -> Units:
        """Return the units of computation of a cover: its thickness and the shear modulus of its top layer."""
        return cls(length=cover.thickness, stress=cover.layers[-1].material.shear_modulus)

    @property
    def force(self) -> float:
        """Unit of force in which a problem is solved: stress times squared length [N]."""
        return self.stress * self.length**2

    def scale_moduli(self, cover: Cover) -> tuple[FloatArray, FloatArray]:
        """Return shear moduli and bulk compliances of the layers at zero load, shape (layers,) each [-]."""
        materials = [layer.material for layer in cover.layers]
        shear = np.array([each.shear_modulus for each in materials]) / self.stress
        return shear, np.array([self.stress / each.bulk_modulus for each in materials])

    def scale_cover(self, cover: Cover) -> Cover:
        """Return the cover with layer thicknesses divided by the unit of length; moduli remain in SI units."""
        layers = tuple(replace(layer, thickness=layer.thickness / self.length) for layer in cover.layers)
        return replace(cover, layers=layers)


@dataclass(frozen=True, kw_only=True)
class LoadingPath:
    """Sequence of ascending target loads or depths of one indenter on one cover.

    Small-strain contact is homogeneous: if the heights of the indenter and the load or depth are multiplied by a
    factor, the displacements are multiplied by the same factor.  If the factor `load_scale` is small, a solver for
    finite strain therefore returns the small-strain solution times `load_scale`.

    Attributes:
        cover: Cover; solvers for finite strain treat a small-strain material as neo-Hookean with the same moduli.
        indenter: Indenter with its shape.
        targets: Target loads [N] or depths [m], ascending.
        control: Whether the targets are loads or depths.
        friction: Coefficient of Coulomb friction, inf for no slip [-].
        baseline_friction: Coefficient of friction of the baseline, the solution used for comparison, 0 or inf [-].
        load_scale: Factor on the targets and on the heights of the indenter [-].
        fields: Whether displacement and stress in the cover are part of the solution.
        meshed_for: Target for which the element sizes under a curved indenter are chosen; None for the last one.
    """

    cover: Cover
    indenter: Indenter
    targets: tuple[float, ...]
    control: Control
    friction: float = 0.0
    baseline_friction: float = 0.0
    load_scale: float = 1.0
    fields: bool = False
    meshed_for: float | None = None

    @property
    def units(self) -> Units:
        """Units of length and stress in which the loading path is solved."""
        return Units.of(self.cover)

    @property
    def scaled_targets(self) -> list[float]:
        """Target loads or depths times the load scale, in the units of computation [-]."""
        unit = self.units.force if self.control == "load" else self.units.length
        return [self.load_scale * target / unit for target in self.targets]

    @property
    def at_model_strain(self) -> LoadingPath:
        """This loading path, at small strain if all layers have small-strain materials, else at finite strain."""
        return replace(self, load_scale=_SMALL_STRAIN_SCALE if self.cover.small_strain_only else 1.0)

    @property
    def baseline(self) -> LoadingPath:
        """The path that shows the effect of finite strain: the same one at small strain, with `baseline_friction`."""
        return replace(self, friction=self.baseline_friction, load_scale=_SMALL_STRAIN_SCALE)

    @property
    def has_friction_effect(self) -> bool:
        """Whether the coefficient of friction differs from that of the baseline solution."""
        return self.friction != self.baseline_friction

    @property
    def is_in_plane(self) -> bool:
        """Whether the path can be solved in the r-z plane: an indenter of revolution on a wide cover."""
        return self.cover.size is None and self.indenter.axisymmetric

    @property
    def refines_in_turn(self) -> bool:
        """Whether the grids refine edge radius and element size alternately: under flat faces with friction, in 3-D."""
        return self.indenter.is_flat and self.has_friction_effect and not self.is_in_plane


def name_part(progress: Progress, part: str) -> Progress:
    """Wrap a progress callback so that each line begins with the name of a part of the computation."""
    return None if progress is None else lambda text: progress(f"{part}: {text}")


def name_grid(progress: Progress, count: int) -> Progress:
    """Wrap a progress callback so that each line begins with the number of elements through the cover."""
    return name_part(progress, f"{count} elements through the cover")


def report(progress: Progress, text: str) -> None:
    """Call a progress callback with a line of text, unless the callback is None."""
    if progress is not None:
        progress(text)
