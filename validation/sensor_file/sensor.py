"""Sensor files: one TOML file (or a built-in name) describes array, cover and electronics.

`load` reads it, lists every fault with its path, and hands out SI.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterator, Mapping
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from fastmodel.signal.butterworth import Butterworth
from fastmodel.signal.electronics import WTS_0614_34, Electronics
from fastmodel.signal.point_spread import Gaussian
from meshes import Cover, Layer, Material, TexelArray
from meshes.catalogue import ARRAYS, ASSUMED_COVER, MATERIALS
from validation.errors import InputError, nearest
from validation.sensor_file.tables import ElectronicsTable, FilterTable, SensorTables, SpreadTable
from validation.text.quantity import QuantityError, read_quantity

#: Coefficients of the report's 5th-degree characteristic.
_COEFFICIENTS = 6

#: The firmware of the DSACON32m subtracts its threshold and its load curve is not published: the slope of the
#: WTS stands in, and recordings are scored with a curve that is fitted to them.
_SDH2_ELECTRONICS = Electronics(rate_hz=31.25, sensitivity=WTS_0614_34.sensitivity, output_max=3512, bits=12)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SensorDescription:
    """A sensor, in SI.

    Attributes:
        name: What to call it.
        array: Its texels.
        cover: Its cover; `cover.assumed` is true where nobody measured it.
        electronics: From force to counts.
        filter: Low-pass before the electronics, or None.
        spread: A kernel that replaces the fitted one, or None.
        source: The file or built-in name it came from.
    """

    name: str
    array: TexelArray
    cover: Cover
    electronics: Electronics
    filter: Butterworth | None = None
    spread: Gaussian | None = None
    source: str = ""

    def describe_cover(self) -> dict[str, Any]:
        """The cover as JSON values, with its label where it is assumed."""
        cover = self.cover
        return {
            "assumed": cover.assumed,
            "base": cover.base,
            "size_m": cover.size,
            "thickness_m": cover.thickness,
            "layers": [
                {
                    "thickness_m": layer.thickness,
                    "material": layer.material.name,
                    "model": layer.material.model,
                    "youngs_modulus": layer.material.youngs_modulus,
                    "poisson_ratio": layer.material.poisson_ratio,
                    "source": layer.material.source,
                    "spread": layer.material.spread,
                }
                for layer in cover.layers
            ],
        }


#: Sensors that can be named instead of a file.  Both covers are assumed.
BUILT_IN: Mapping[str, SensorDescription] = MappingProxyType(
    {
        name: SensorDescription(
            name=name,
            array=ARRAYS[name],
            cover=ASSUMED_COVER,
            electronics=electronics,
            source=f"built-in {name}",
        )
        for name, electronics in (("wts-0614-34", WTS_0614_34), ("sdh2-distal", _SDH2_ELECTRONICS))
    }
)


def load(sensor: str | Path, *, material: str | None = None, thickness: str | None = None) -> SensorDescription:
    """Read a sensor from a TOML file or by its built-in name.

    Args:
        sensor: Path of a file, or one of `BUILT_IN`.
        material: Name of a material that replaces the cover's.
        thickness: Thickness with its unit that replaces the cover's.

    Raises:
        InputError: With one line per fault: path in the file, what is wrong, what would be accepted.
        OSError: If the file exists and cannot be read.
    """
    description = BUILT_IN.get(str(sensor)) or _read_file(Path(sensor))
    if material is None and thickness is None:
        return description
    return dataclasses.replace(description, cover=_replaced_cover(description.cover, material, thickness))


def read_template() -> str:
    """A commented sensor file that describes a WTS 0614-34 under 2 mm of rubber."""
    return resources.files("validation.sensor_file").joinpath("template.toml").read_text(encoding="utf-8")


def _read_file(path: Path) -> SensorDescription:
    if not path.is_file():
        hint = nearest(str(path), BUILT_IN)
        raise InputError(f"{path}: no such sensor file or built-in sensor; {hint}, or a file from `softcover init`")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    return parse(data, source=path)


def parse(data: Mapping[str, Any], *, source: Path) -> SensorDescription:
    """Turn the tables of a sensor file into a description.

    Args:
        data: The tables.
        source: The file they came from; `array.positions` is relative to it.

    Raises:
        InputError: With one line per fault.
    """
    from pydantic import TypeAdapter, ValidationError

    from validation.sensor_file.array import build_array
    from validation.sensor_file.faults import describe

    try:
        tables = TypeAdapter(SensorTables).validate_python(dict(data))
    except ValidationError as error:
        raise InputError(*(f"{source}: {line}" for line in describe(error))) from None
    _check_together(tables, source)
    name = tables.name or source.stem
    array, cover = build_array(tables.array, name=name, source=source), _cover(tables)
    _refuse_uncovered(array, cover, source)
    gains = tables.electronics.gains
    if gains is not None and len(gains) != array.count:
        raise InputError(f"{source}: electronics.gains: takes one number per texel ({array.count}), not {len(gains)}")
    return SensorDescription(
        name=name,
        array=array,
        cover=cover,
        electronics=_electronics(tables.electronics),
        filter=_filter(tables.filter),
        spread=_spread(tables.spread),
        source=str(source),
    )


def _cover(tables: SensorTables) -> Cover:
    layers = tuple(
        # The table's validator has already turned names and parameters into a Material.
        Layer(thickness=layer.thickness, material=layer.material)  # type: ignore[arg-type]
        for layer in tables.cover.layer
    )
    return Cover(layers=layers, base=tables.cover.base, size=tables.cover.size)


def _refuse_uncovered(array: TexelArray, cover: Cover, source: Path) -> None:
    """Refuse texels that stick out from under a cover of limited size, whose middle lies over the array's origin."""
    if cover.size is None or not array.planar:
        return
    reach = np.abs(array.centres[array.active, :2]) + np.array(array.texel_size) / 2
    out = np.flatnonzero((reach > np.array(cover.size) / 2 * (1 + 1e-9)).any(axis=1))
    if len(out):
        first = int(np.flatnonzero(array.active)[out[0]])
        needed, given = (" x ".join(f"{1e3 * edge:.4g} mm" for edge in pair) for pair in (2 * reach.max(0), cover.size))
        raise InputError(
            f"{source}: cover.size: {given} leaves {len(out)} texels uncovered in part or whole, the first is number "
            f"{first}; the middle of the cover lies over the array's origin and the texels take {needed}"
        )


def _check_together(tables: SensorTables, source: Path) -> None:
    """Find the faults that show only when several keys are read together."""
    faults = [f"{source}: {fault}" for fault in (*_electronics_faults(tables), *_spread_faults(tables.spread))]
    if faults:
        raise InputError(*faults)


def _electronics_faults(tables: SensorTables) -> Iterator[str]:
    electronics = tables.electronics
    largest = 2**electronics.bits - 1
    if (electronics.sensitivity is None) == (electronics.characteristic is None):
        yield "electronics: give either sensitivity (a line, '2665.7 1/N') or characteristic (c0..c5 [1/N^k])"
    if electronics.characteristic is not None and len(electronics.characteristic) != _COEFFICIENTS:
        yield f"electronics.characteristic: takes {_COEFFICIENTS} numbers c0..c5 [1/N^k]"
    if electronics.output_max is not None and electronics.output_max > largest:
        yield (
            f"electronics.output_max: {electronics.output_max} does not fit {electronics.bits} bits; "
            f"accepted: 1..{largest}"
        )


def _spread_faults(spread: SpreadTable | None) -> Iterator[str]:
    for name in ("ksize_x", "ksize_y") if spread else ():
        if getattr(spread, name) % 2 == 0:
            yield f"spread.{name}: must be odd, not {getattr(spread, name)}"


def _electronics(table: ElectronicsTable) -> Electronics:
    return Electronics(
        rate_hz=table.rate,
        # The slope is not used where a characteristic is given, but it must be a positive number.
        sensitivity=table.sensitivity or 1.0,
        offset=table.offset,
        output_max=table.output_max or 2**table.bits - 1,
        bits=table.bits,
        noise=table.noise,
        threshold=table.threshold,
        saturation_band=table.saturation_band,
        characteristic=None if table.characteristic is None else tuple(table.characteristic),
        gains=None if table.gains is None else tuple(table.gains),
    )


def _filter(table: FilterTable | None) -> Butterworth | None:
    return None if table is None else Butterworth(cutoff_hz=table.cutoff, order=table.order)


def _spread(table: SpreadTable | None) -> Gaussian | None:
    if table is None:
        return None
    return Gaussian(sigma_x=table.sigma_x, sigma_y=table.sigma_y, ksize_x=table.ksize_x, ksize_y=table.ksize_y)


def _replaced_cover(cover: Cover, material: str | None, thickness: str | None) -> Cover:
    """The cover of one layer that `--material` and `--thickness` describe; what is not given stays."""
    faults = []
    if (material is None or thickness is None) and len(cover.layers) > 1:
        faults.append("--material, --thickness: the cover has several layers; give both to replace them by one")
    chosen = cover.layers[0].material if material is None else _named_material(material, faults)
    height = cover.layers[0].thickness
    try:
        height = height if thickness is None else read_quantity(thickness, "length", place="--thickness")
    except QuantityError as error:
        faults.append(str(error))
    if height <= 0:
        faults.append(f"--thickness: must be positive, not {thickness!r}; write for example '2mm'")
    if faults or chosen is None:
        raise InputError(*faults)
    assumed = cover.assumed and (material is None or thickness is None)
    layers = (Layer(thickness=height, material=chosen),)
    return dataclasses.replace(cover, layers=layers, assumed=assumed)


def _named_material(name: str, faults: list[str]) -> Material | None:
    if name not in MATERIALS:
        faults.append(f"--material: unknown material {name!r}; {nearest(name, MATERIALS)}")
    return MATERIALS.get(name)
