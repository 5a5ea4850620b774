"""Sensors side by side: what is published of each array, where, and what is assumed in its place."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from validation.data_sheet import NOT_STATED
from validation.sensor_file import BUILT_IN, PUBLISHED, SensorDescription, load

#: Name that stands for all built-in sensors with flat layers.
ALL = "all"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Compared:
    """One sensor of a comparison.

    Attributes:
        name: Name of the sensor.
        values: Value of each quantity that the model uses, as text with its unit, by the name of the quantity.
        sources: Where the value is stated, by quantity; a quantity without a source is assumed.
    """

    name: str
    values: dict[str, str]
    sources: dict[str, str]

    @property
    def cells(self) -> list[str]:
        """The values in a row of a table."""
        return [text if name in self.sources else NOT_STATED for name, text in self.values.items()]

    @property
    def origins(self) -> str:
        """Where each value is stated, and the values that are assumed, in one sentence."""
        groups: dict[str, list[str]] = {}
        for name, text in self.values.items():
            source = self.sources.get(name)
            groups.setdefault(source or "assumed", []).append(name if source else f"{name} {text}")
        return "; ".join(f"{', '.join(names)}: {source}" for source, names in groups.items())


def put_side_by_side(sensors: Sequence[str | Path]) -> list[Compared]:
    """Put sensors side by side.

    Args:
        sensors: Sensor files or names; "all" stands for all built-in sensors with flat layers.

    Raises:
        InputError: If a sensor cannot be read.
    """
    names = [name for each in sensors for name in ((*BUILT_IN, *PUBLISHED) if each == ALL else (each,))]
    found = [load(each) for each in dict.fromkeys(names)]
    return [Compared(name=each.name, values=_list_values(each), sources=dict(each.sources)) for each in found]


def _list_values(sensor: SensorDescription) -> dict[str, str]:
    """Return the value of each quantity as text."""
    array, electronics = sensor.array, sensor.electronics
    active, size = int(array.active.sum()), array.layout
    pitch = [f"{1e3 * each:.4g}" for each in dict.fromkeys(array.pitch)]
    largest = (electronics.output_max - electronics.offset + electronics.threshold) / electronics.sensitivity
    where = "on a texel" if electronics.tip_radius is None else "under a tip"
    layers = sensor.cover.layers
    return {
        "texels": size if active == array.count else f"{size}, {active} measure",
        "pitch": " x ".join(pitch) + " mm",
        "rate": f"{electronics.rate_hz:.4g} Hz",
        "range": "a polynomial" if electronics.characteristic else f"{largest:.3g} N {where}",
        "bits": str(electronics.bits),
        "cover": " + ".join(f"{1e3 * layer.thickness:.4g} mm {layer.material.name}" for layer in layers),
    }
