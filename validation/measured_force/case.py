"""A measurement of force over depth, and the TOML file that describes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshes import Cover, Indenter, Layer, Sphere
from validation.errors import nearest
from validation.schema import parse, read
from validation.schema.measured_force import MeasurementTables

FloatArray = npt.NDArray[np.float64]

#: Measurements that come with the package, by the name on the command line, and their files.
BUILT_IN = {"gelsight-mini": "gelsight-mini.toml"}
#: Largest Poisson ratio, that of an incompressible material [-].
_INCOMPRESSIBLE = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurement:
    """Measured forces on an indenter at n depths.

    Attributes:
        name: Name for tables.
        source: Origin of the data.
        indenter: Indenter with an axis of revolution, pressed into the middle of the cover.
        cover: Cover; all moduli are multiplied by one fitted factor.
        depth: Approaches from first touch, ascending, shape (n,) [m].
        force: Measured normal forces, shape (n,) [N].
        fitted: Whether the moduli are fitted to each point; the others are scored, shape (n,).
        top_radius: Radius of curvature of a domed top under a ball; None for a flat top [m].
        force_uncertainty: Standard uncertainty of each force, independent of the others; None if unknown [N].
        zero_uncertainty: Standard uncertainty of the zero of depth, one error for all points; None if unknown [m].
    """

    name: str
    source: str
    indenter: Indenter
    cover: Cover
    depth: FloatArray
    force: FloatArray
    fitted: npt.NDArray[np.bool_]
    top_radius: float | None = None
    force_uncertainty: float | None = None
    zero_uncertainty: float | None = None

    @property
    def domed_indenter(self) -> Indenter:
        """The ball that has, on a flat top, the gap of the given ball on the domed top: curvatures add (Hertz)."""
        if self.top_radius is None or not isinstance(self.indenter, Sphere):
            return self.indenter
        return replace(self.indenter, radius=1 / (1 / self.indenter.radius + 1 / self.top_radius))

    @property
    def poisson_ends(self) -> tuple[Cover, Cover] | None:
        """The cover with the lowest and highest Poisson ratios of all its layers; None if no spread is given."""
        if not any(layer.material.poisson_spread for layer in self.cover.layers):
            return None
        low, high = (_shift_poisson_ratio(self.cover, sign) for sign in (-1, 1))
        return low, high


def _shift_poisson_ratio(cover: Cover, sign: int) -> Cover:
    """Move the Poisson ratio of every layer by its spread, at equal shear modulus, within 0..0.5."""

    def shift(layer: Layer) -> Layer:
        material = layer.material
        ratio = float(np.clip(material.poisson_ratio + sign * material.poisson_spread, 0, _INCOMPRESSIBLE))
        moduli = dict(material.parameters)
        if material.small_strain_only:
            moduli["youngs_modulus"] = 2 * material.shear_modulus * (1 + ratio)
        return replace(layer, material=replace(material, poisson_ratio=ratio, parameters=moduli))

    return replace(cover, layers=tuple(shift(layer) for layer in cover.layers))


def read_measured_force(path: str | Path) -> Measurement:
    """Read a file of measured forces, or take a built-in one.

    Args:
        path: Path of a file, or a name in `BUILT_IN`.

    Raises:
        InputError: With one line per fault: the place in the file, what is wrong, and what would be accepted.
        OSError: If the file exists and cannot be read.
    """
    name = str(path)
    hint = f"or built-in measurement; {nearest(name, BUILT_IN)}, or a TOML file"
    file = resources.files("validation.measured_force").joinpath(BUILT_IN[name]) if name in BUILT_IN else path
    return _build(read(Path(str(file)), MeasurementTables, hint=hint))


def parse_measurement(data: Mapping[str, Any], *, source: str) -> Measurement:
    """Convert the parsed tables of a file to a measurement.

    Args:
        data: The tables, as the TOML parser returns them.
        source: Path of the file, for error messages.

    Raises:
        InputError: With one line per fault.
    """
    return _build(parse(data, MeasurementTables, source=source))


def _build(tables: MeasurementTables) -> Measurement:
    """Make a measurement from its tables."""
    layers = tuple(Layer(thickness=each.thickness, material=each.material) for each in tables.cover.layer)
    points = sorted(tables.point, key=lambda each: each.depth)
    return Measurement(
        name=tables.name,
        source=tables.source,
        indenter=tables.indenter,
        cover=Cover(layers=layers, base=tables.cover.base, size=tables.cover.size),
        depth=np.array([each.depth for each in points]),
        force=np.array([each.force for each in points]),
        fitted=np.array([each.use == "fit" for each in points], dtype=bool),
        top_radius=tables.top_radius,
        force_uncertainty=tables.uncertainty.force,
        zero_uncertainty=tables.uncertainty.zero,
    )
