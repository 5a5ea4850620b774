"""The data sheet of a sensor: each quantity with its definition and its origin, or the words `not stated`."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Iterator
from typing import Any

import numpy as np

from fastmodel import Parameters
from fastmodel.signal.electronics import Electronics, describe_calibration
from fastmodel.signal.point_spread import Gaussian
from validation.results import JsonObject, Result, result_model
from validation.sensor_file import BUILT_IN, SensorDescription

NOT_STATED = "not stated"
#: Number of forces at which the characteristic is evaluated, and largest force at which its end is looked for [-, N].
_STEPS, _LARGEST_FORCE = 200_001, 1e6
#: Full width of a Gaussian at half of its maximum, over its standard deviation: sqrt(8 ln 2) [-].
_WIDTH_AT_HALF = 2.3548200450309493
#: Origin of the electronics of the built-in sensors.
_BUILT_IN_SOURCES = {
    "wts-0614-34": "2015 internship report on the WTS 0614-34",
    "sdh2-distal": "slope of the WTS 0614-34 in the 2015 internship report; that of this array is unpublished",
}


@result_model
class Entry(Result):
    """One line of a data sheet.

    Attributes:
        name: Name for people.
        text: Value with its unit, or `not stated` and why.
        values: Values in SI units by their JSON names; None for those not stated.
        definition: What the value means.
        source: Where the value comes from.
    """

    name: str
    text: str
    values: JsonObject
    definition: str
    source: str

    @property
    def is_stated(self) -> bool:
        """Whether the entry has a value."""
        return not self.text.startswith(NOT_STATED)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DataSheet:
    """The data sheet of a sensor.

    Attributes:
        sensor: Name of the sensor.
        entries: Its lines.
    """

    sensor: str
    entries: tuple[Entry, ...]

    @property
    def title(self) -> str:
        """Heading of the sheet."""
        return f"Data sheet: {self.sensor}"

    def as_json(self) -> dict[str, Any]:
        """Return the name of the sensor and the entries by name, each with its values, definition and source."""
        entries = {
            entry.name.replace(" ", "_"): {
                **entry.values,
                "text": entry.text,
                "stated": entry.is_stated,
                "definition": entry.definition,
                "source": entry.source,
            }
            for entry in self.entries
        }
        return {"sensor": self.sensor, "entries": entries}

    def markdown(self) -> str:
        """Return the sheet as a Markdown document with one table."""
        rows = [_HEADINGS, ("---",) * len(_HEADINGS), *self._rows()]
        lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
        return "\n".join([f"# {self.title}", "", *lines, ""])

    def html(self) -> str:
        """Return the sheet as an HTML document with one table."""
        rows = "\n".join(
            f'<tr><th scope="row">{html.escape(name)}</th>'
            + "".join(f"<td>{html.escape(each)}</td>" for each in rest)
            + "</tr>"
            for name, *rest in self._rows()
        )
        headings = "".join(f'<th scope="col">{each}</th>' for each in _HEADINGS)
        return _PAGE.format(title=html.escape(self.title), headings=headings, rows=rows)

    def _rows(self) -> list[tuple[str, ...]]:
        return [(entry.name, entry.text, entry.definition, entry.source) for entry in self.entries]


_HEADINGS = ("quantity", "value", "definition", "source")
_PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>body{{font-family:sans-serif;margin:2em;max-width:70em}}td,th{{padding:.4em;text-align:left;vertical-align:top}}</style>
<h1>{title}</h1>
<table>
<thead><tr>{headings}</tr></thead>
<tbody>
{rows}
</tbody>
</table>
</html>
"""


def make_datasheet(parameters: Parameters, sensor: SensorDescription | None) -> DataSheet:
    """Make the data sheet of a sensor.

    Args:
        parameters: Parameters of the sensor's fast model.
        sensor: Description of the sensor; None if only the parameters are known.
    """
    source = "the folder of parameters, [electronics]" if sensor is None else f"{sensor.source}, [electronics]"
    if sensor is not None and sensor.name in BUILT_IN and sensor.source.startswith("built-in"):
        source = _BUILT_IN_SOURCES[sensor.name]
    assumed = parameters.provenance.get("electronics_assumed", ()) if sensor is None else sensor.assumed_electronics
    if assumed:
        source = f"partly assumed ({', '.join(assumed)}), else {source}"
    entries = (
        *_list_size(parameters, sensor),
        *_list_force(parameters, source),
        *_list_space(parameters),
        *_list_time(parameters, source),
        *_list_errors(parameters, source),
    )
    return DataSheet(sensor=parameters.array.name if sensor is None else sensor.name, entries=entries)


def _list_size(parameters: Parameters, sensor: SensorDescription | None) -> Iterator[Entry]:
    array = parameters.array
    x, y = (1e3 * edge for edge in array.extent)
    active = int(array.active.sum())
    yield Entry(
        name="size",
        text=f"{x:.4g} x {y:.4g} mm, {array.columns} x {array.rows} texels ({active} measure)",
        values={"size_m": list(array.extent), "columns": array.columns, "rows": array.rows, "active_texels": active},
        definition="edges of the rectangle around all texels, along x and y; columns x rows",
        source="the array",
    )
    text, thickness, assumed = NOT_STATED + ": parameters do not describe the cover", None, None
    if sensor is not None:
        thickness, assumed = sensor.cover.thickness, sensor.cover.assumed
        layers = (f"{1e3 * layer.thickness:.4g} mm {layer.material.name}" for layer in sensor.cover.layers)
        text = " + ".join(layers) + (" (assumed)" if assumed else "")
    yield Entry(
        name="cover",
        text=text,
        values={"cover_thickness_m": thickness, "cover_assumed": assumed},
        definition="elastic layers over the texels, bottom to top",
        source="assumed: nobody published it" if assumed else "the sensor file, [cover], or the options",
    )


def _list_force(parameters: Parameters, source: str) -> Iterator[Entry]:
    electronics, share = parameters.electronics, parameters.electronics.applied_share
    forces, counts = trace_characteristic(electronics)
    low, high = find_range(forces, counts, electronics.output_max)
    rising = (forces >= low) & (forces <= high)
    slope: float | None = electronics.sensitivity / share
    if electronics.characteristic is not None or electronics.saturation_band:
        slope = float(np.polyfit(forces[rising], counts[rising], 1)[0]) if rising.sum() > 1 else None
    applied = "" if share == 1 else f" ({slope * share:.4g} per N under the calibration tip)" if slope else ""
    yield Entry(
        name="sensitivity",
        text=NOT_STATED if slope is None else f"{slope:.4g} counts per N on a texel{applied}",
        values={"sensitivity_per_N": slope, "sensitivity_applied_per_N": None if slope is None else slope * share},
        definition="slope of the least-squares line of counts over force on one texel, over the range; "
        + describe_calibration(electronics),
        source=source,
    )
    ends = high < forces[-1]
    upper = f"{high:.4g} N" if ends else "no end found"
    yield Entry(
        name="range",
        text=f"{low:.4g} N to {upper} on a texel; counts up to {electronics.output_max}",
        values={"range_N": [low, high if ends else None], "largest_count": electronics.output_max},
        definition="from the smallest force on one texel that gives a count to the force of the largest count",
        source=source,
    )
    step = None if slope is None else 1 / slope
    yield Entry(
        name="force resolution",
        text=NOT_STATED if step is None else f"{1e3 * step:.3g} mN per count, without noise",
        values={"force_resolution_N": step},
        definition="change of the force on one texel that changes the output by one count",
        source="1 / sensitivity",
    )


def _list_space(parameters: Parameters) -> Iterator[Entry]:
    array, spread = parameters.array, parameters.spread
    pitch = " x ".join(f"{1e3 * each:.4g}" for each in array.pitch)
    separation = _separate_two_points(parameters)
    text = f"{1e3 * separation:.3g} mm" if isinstance(separation, float) else f"{NOT_STATED}: {separation}"
    yield Entry(
        name="spatial resolution",
        text=f"{text}; pitch {pitch} mm",
        values={"spatial_resolution_m": separation if isinstance(separation, float) else None, "pitch_m": array.pitch},
        definition="smallest distance of two equal point loads on the cover, along x, that shows a dip between two "
        "peaks of texel values wherever the loads lie",
        source="finite elements of the cover (`softcover derive`)",
    )
    sigma = (spread.sigma_x, spread.sigma_y) if isinstance(spread, Gaussian) else None
    wide = [_WIDTH_AT_HALF * s * p for s, p in zip(sigma or (), array.pitch, strict=False)]
    yield Entry(
        name="width of the point spread",
        text=NOT_STATED + ": the spread is a table, not a Gaussian"
        if sigma is None
        else f"{1e3 * wide[0]:.3g} x {1e3 * wide[1]:.3g} mm (sigma {sigma[0]:.3g} x {sigma[1]:.3g} pitches)",
        values={"spread_width_m": wide or None, "spread_sigma_pitches": sigma},
        definition="full width at half maximum, 2.355 sigma, of the Gaussian that spreads the force on a texel",
        source=str(parameters.provenance.get("estimator", NOT_STATED)),
    )


def _list_time(parameters: Parameters, source: str) -> Iterator[Entry]:
    rate, low_pass = parameters.electronics.rate_hz, parameters.filter
    cutoff = None if low_pass is None else low_pass.cutoff_hz
    text = NOT_STATED if low_pass is None else f"{low_pass.cutoff_hz:.4g} Hz (Butterworth, order {low_pass.order})"
    yield Entry(
        name="bandwidth",
        text=f"{text}; {rate:.4g} frames/s hold up to {rate / 2:.4g} Hz",
        values={"bandwidth_hz": cutoff, "rate_hz": rate},
        definition="frequency at which the amplitude of a texel's force falls by 3 dB; at most half the frame rate",
        source="no [filter] is given" if low_pass is None else "[filter]" + source.partition("[electronics]")[2],
    )


def _list_errors(parameters: Parameters, source: str) -> Iterator[Entry]:
    electronics, validity = parameters.electronics, parameters.validity
    noise = electronics.noise or None
    yield Entry(
        name="accuracy",
        text=NOT_STATED + ("" if noise is None else f"; noise {1e3 * noise:.3g} mN on each texel force"),
        values={"accuracy_N": None, "noise_N": noise},
        definition="largest difference between the force that the counts stand for and the true one; noise: standard "
        "deviation of the force on one texel",
        source="needs recordings under known loads (`softcover calibrate`)" if noise is None else source,
    )
    yield Entry(
        name="accuracy of the fast model",
        text=NOT_STATED
        if validity is None
        else f"at most 2 % of the force on wrong texels up to {validity.load_2_percent:.3g} N, 5 % up to "
        f"{validity.load_5_percent:.3g} N",
        values={
            "model_load_2_percent_N": None if validity is None else validity.load_2_percent,
            "model_load_5_percent_N": None if validity is None else validity.load_5_percent,
        },
        definition="against finite elements, under a ball of one pitch radius",
        source="`softcover derive`",
    )
    share, width = electronics.hysteresis_share, electronics.hysteresis_width
    loop = 2 * share * width or None
    yield Entry(
        name="hysteresis",
        text=NOT_STATED if loop is None else f"{1e3 * loop:.3g} mN",
        values={"hysteresis_N": loop},
        definition="largest difference of the force between unloading and loading at the same true force",
        source="needs recordings with rising and falling loads (`softcover calibrate`)" if loop is None else source,
    )
    linearity = find_nonlinearity(electronics)
    yield Entry(
        name="linearity",
        text=f"{NOT_STATED}: a straight line is given"
        if linearity is None
        else f"{100 * linearity:.2g} % of full scale",
        values={"nonlinearity": linearity},
        definition="largest distance of the counts from their least-squares line in the range, over the largest count",
        source="needs a measured characteristic of degree 5" if linearity is None else source,
    )
    coefficient = electronics.temperature_coefficient or None
    yield Entry(
        name="temperature",
        text=NOT_STATED if coefficient is None else f"{100 * coefficient:.3g} % per kelvin",
        values={"temperature_per_K": coefficient},
        definition="relative change of the measured force per kelvin",
        source=NOT_STATED if coefficient is None else source,
    )


def trace_characteristic(electronics: Electronics) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Compute the counts of one texel over its force, from zero to beyond saturation.

    Returns:
        Forces on the texel, shape (k,) [N], and counts, shape (k,) [-].
    """
    bare = dataclasses.replace(electronics, gains=None, noise=0.0, temperature_coefficient=0.0)
    top = 1e-3
    while top < _LARGEST_FORCE and bare.counts(np.array([top]))[0] < electronics.output_max:
        top *= 2
    forces = np.linspace(0, 1.01 * top, _STEPS)
    return forces, np.asarray(bare.counts(forces[:, None]))[:, 0]


def find_range(forces: np.ndarray[Any, Any], counts: np.ndarray[Any, Any], largest: int) -> tuple[float, float]:
    """Find the smallest force that gives a count, and the smallest one that gives the largest count; else the last."""
    some, full = np.flatnonzero(counts > 0), np.flatnonzero(counts >= largest)
    return float(forces[some[0]] if some.size else 0.0), float(forces[full[0]] if full.size else forces[-1])


def find_nonlinearity(electronics: Electronics) -> float | None:
    """Compute the largest distance of the counts from their least-squares line over the range, over the largest count.

    Returns:
        The distance [-]; None if the characteristic is a straight line that ends sharply.
    """
    if electronics.characteristic is None and not electronics.saturation_band:
        return None
    forces, counts = trace_characteristic(electronics)
    low, high = find_range(forces, counts, electronics.output_max)
    inside = (forces >= low) & (forces <= high)
    line = np.polyval(np.polyfit(forces[inside], counts[inside], 1), forces[inside])
    return float(np.abs(counts[inside] - line).max() / electronics.output_max)


def _separate_two_points(parameters: Parameters) -> float | str:
    """Compute the two-point separation on the texels [m], or return the reason why it is not known."""
    tables = parameters.tables
    if "point_response_radius" not in tables:
        return "the parameters hold no point response"
    try:
        from fem_reference.linear_response.point_spread import PointSpread
    except ImportError:
        return "its computation needs the extra fem; run in a clone of softcover: python -m pip install -e '.[fem]'"
    from validation.derivation.kernel import texel_separation

    spread = PointSpread(
        radius=tables["point_response_radius"],
        pressure_per_force=tables["point_response_pressure"],
        reaction=1.0,
        thickness=0.0 if parameters.surface is None else parameters.surface.thickness,
    )
    found = texel_separation(spread, parameters.array)
    return found if np.isfinite(found) else "no distance up to twelve pitches shows a dip"
