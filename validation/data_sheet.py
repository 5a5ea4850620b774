"""The data sheet of a sensor: each quantity with its definition and its origin, or the words `not stated`."""

from __future__ import annotations

import dataclasses
import html
import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from fastmodel import Parameters
from fastmodel.signal.electronics import Electronics, describe_calibration
from fastmodel.signal.point_spread import Gaussian
from meshes import Cover
from meshes.array_types import FloatArray
from validation.derivation.base import describe_provenance
from validation.errors import InputError
from validation.places import find_middle
from validation.render.image import Scale, spell_units, tactile_image
from validation.results import JsonObject, Result, result_model
from validation.sensor_file import SensorDescription

#: A command between back quotes, as texts for the terminal and Markdown have it.
_QUOTED = re.compile("`(.*?)`")
#: Text of an entry without a value.
NOT_STATED = "not stated"
#: Origin of the characteristic of a built-in sensor that nobody published.
NO_RANGE = "assumed: the characteristic is unpublished"
#: Number of forces at which the characteristic (counts over force) is evaluated to find its range and linearity [-].
_STEPS = 200_001
#: Largest force up to which the saturation of the characteristic is searched [N].
_LARGEST_FORCE = 1e6
#: Force of a touch whose place is told [N].
_LOAD = 1.0
#: Full width of a Gaussian at half of its maximum, over its standard deviation: sqrt(8 ln 2) [-].
_WIDTH_AT_HALF = 2.3548200450309493


@result_model
class Entry(Result):
    """One line of a data sheet.

    Attributes:
        name: Name for people.
        text: Value with its unit, or `not stated` with the reason.
        values: Values in SI units by their JSON names; None for those not stated.
        definition: Definition of the value.
        source: Origin of the value.
    """

    name: str
    text: str
    values: JsonObject
    definition: str
    source: str

    @property
    def is_stated(self) -> bool:
        """Whether the line of the data sheet has a value, and not the words `not stated`."""
        return not self.text.startswith(NOT_STATED)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DataSheet:
    """The data sheet of a sensor.

    Attributes:
        sensor: Name of the sensor.
        entries: Lines of the data sheet.
        picture: Forces on the texels under a load on one of them, as SVG.
    """

    sensor: str
    entries: tuple[Entry, ...]
    picture: str

    @property
    def title(self) -> str:
        """Heading of the data sheet, with the name of the sensor."""
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
        """Return the data sheet as a Markdown document with one table."""
        rows = [_HEADINGS, ("---",) * len(_HEADINGS), *self._rows()]
        lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
        return "\n".join([f"# {self.title}", "", *lines, ""])

    def html(self) -> str:
        """Return the data sheet as an HTML document with one table."""
        rows = "\n".join(
            f'<tr><th scope="row">{html.escape(name)}</th>'
            + "".join("<td>" + _QUOTED.sub(r"<code>\1</code>", html.escape(each)) + "</td>" for each in rest)
            + "</tr>"
            for name, *rest in self._rows()
        )
        headings = "".join(f'<th scope="col">{each}</th>' for each in _HEADINGS)
        title = html.escape(self.title)
        return _PAGE.format(title=title, headings=headings, rows=spell_units(rows), picture=self.picture)

    def _rows(self) -> list[tuple[str, ...]]:
        return [(entry.name, entry.text, entry.definition, entry.source) for entry in self.entries]


_HEADINGS = ("quantity", "value", "definition", "source")
_PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>:root{{color-scheme:light dark}}body{{font-family:sans-serif;margin:2em;max-width:70em}}
table{{border-collapse:collapse}}figure{{margin:1em 0}}tr{{break-inside:avoid}}
td,th{{padding:.4em;text-align:left;vertical-align:top;border-bottom:1px solid #8888}}
@media screen and (max-width:700px){{body{{margin:1em}}thead{{display:none}}
th,td{{display:block;border:0;padding:.1em 0}}tr{{display:block;border-bottom:1px solid #8888;padding:.5em 0}}
td:nth-of-type(n+2){{font-size:.85em}}}}
@media print{{body{{margin:0;font-size:9pt}}}}</style>
<h1>{title}</h1>
<figure>{picture}<figcaption>Forces on the texels under a load on one of them, in % of the load</figcaption></figure>
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
    if sensor is not None and sensor.source.startswith("built-in"):
        source = sensor.sources.get("range", NO_RANGE)
    assumed = parameters.provenance.get("electronics_assumed", ()) if sensor is None else sensor.assumed_electronics
    if assumed:
        source = f"partly assumed ({', '.join(assumed)}), else {source}"
    entries = (
        *_list_size(parameters, sensor),
        *_list_force(parameters, source),
        *_list_space(parameters),
        *_list_limits(parameters, sensor),
        *_list_time(parameters, source),
        *_list_errors(parameters, source),
    )
    array = parameters.array
    share = np.asarray(parameters.spread.operator(array))[:, find_middle(array)]
    picture = tactile_image(array, share, Scale(peak=float(share.max()), unit="%", factor=100), name="Spread")
    return DataSheet(sensor=array.name if sensor is None else sensor.name, entries=entries, picture=picture)


def _make_entry(name: str, text: str | None, definition: str, source: str, values: dict[str, Any]) -> Entry:
    """Make a line of the data sheet; if `text` is None the line says `not stated`."""
    return Entry(name=name, text=text or NOT_STATED, values=values, definition=definition, source=source)


def _list_size(parameters: Parameters, sensor: SensorDescription | None) -> Iterator[Entry]:
    array = parameters.array
    x, y = (1e3 * edge for edge in array.extent)
    active = int(array.active.sum())
    yield _make_entry(
        "size",
        f"{x:.4g} x {y:.4g} mm, {array.layout} ({active} texels measure)",
        "edges of the rectangle around all texels, along x and y; columns x rows",
        "the array",
        {"size_m": list(array.extent), "columns": array.columns, "rows": array.rows, "active_texels": active},
    )
    known = parameters.provenance if sensor is None else describe_provenance(sensor)
    layers, thickness, assumed = (known.get(key) for key in ("cover", "cover_thickness", "cover_assumed"))
    part = None if sensor is None else sensor.sources.get("cover")
    stated = "the folder of parameters, [provenance]" if sensor is None else "the sensor file, [cover], or the options"
    yield _make_entry(
        "cover",
        f"{NOT_STATED}: parameters do not describe the cover"
        if layers is None
        else layers + " (assumed)" * (bool(assumed) and "assumed" not in layers),
        "elastic layers over the texels, bottom to top",
        "partly assumed, " * bool(part) + (part or "assumed: nobody published it") if assumed else stated,
        {"cover_thickness_m": thickness, "cover_assumed": assumed if layers else None},
    )


def _list_force(parameters: Parameters, source: str) -> Iterator[Entry]:
    electronics, share = parameters.electronics, parameters.electronics.applied_share
    forces, counts = trace_range(electronics)
    low, high = float(forces[0]), float(forces[-1]) if counts[-1] >= electronics.output_max else None
    slope: float | None = electronics.sensitivity / share
    if _is_bent(electronics):
        slope = float(np.polyfit(forces, counts, 1)[0]) if len(forces) > 1 else None
    applied = "" if share == 1 or not slope else f" ({slope * share:.4g} per N under the calibration tip)"
    yield _make_entry(
        "sensitivity",
        None if slope is None else f"{slope:.4g} counts per N on a texel{applied}",
        "slope of the least-squares line of counts over force on one texel, over the range; "
        + describe_calibration(electronics),
        source,
        {"sensitivity_per_N": slope, "sensitivity_applied_per_N": None if slope is None else slope * share},
    )
    upper = "no end found" if high is None else f"{high:.4g} N"
    yield _make_entry(
        "range",
        f"{low:.4g} N to {upper} on a texel; counts up to {electronics.output_max}",
        "from the smallest force on one texel that gives a count to the force of the largest count",
        source,
        {"range_N": [low, high], "largest_count": electronics.output_max},
    )
    step = None if slope is None else 1 / slope
    yield _make_entry(
        "force resolution",
        None if step is None else f"{1e3 * step:.3g} mN per count, without noise",
        "change of the force on one texel that changes the output by one count",
        "1 / sensitivity",
        {"force_resolution_N": step},
    )


def _list_space(parameters: Parameters) -> Iterator[Entry]:
    array, spread = parameters.array, parameters.spread
    found = _separate_two_points(parameters)
    separation = found if isinstance(found, float) else None
    text = f"{NOT_STATED}: {found}" if separation is None else f"{1e3 * separation:.3g} mm"
    yield _make_entry(
        "spatial resolution",
        f"{text}; pitch {' x '.join(f'{1e3 * each:.4g}' for each in array.pitch)} mm",
        "smallest distance of two equal point loads on the cover, along x, between which the force on a texel "
        "falls to 73.5 % of its peaks (Rayleigh); an image shows the dip from two pitches on",
        "finite elements of the cover (`softcover derive`)",
        {"spatial_resolution_m": separation, "pitch_m": array.pitch},
    )
    text, sigma, wide = NOT_STATED + ": the spread is a table, not a Gaussian", None, None
    if isinstance(spread, Gaussian):
        sigma = (spread.sigma_x, spread.sigma_y)
        wide = [_WIDTH_AT_HALF * s * p for s, p in zip(sigma, array.pitch, strict=True)]
        text = "{:.3g} x {:.3g} mm (sigma {:.3g} x {:.3g} pitches)".format(*(1e3 * each for each in wide), *sigma)
    yield _make_entry(
        "width of the point spread",
        text,
        "full width at half maximum, 2.355 sigma, of the Gaussian that spreads the force on a texel",
        str(parameters.provenance.get("estimator", NOT_STATED)),
        {"spread_width_m": wide, "spread_sigma_pitches": sigma},
    )


def _list_limits(parameters: Parameters, sensor: SensorDescription | None) -> Iterator[Entry]:
    """List what the sensor can tell of touches, where the response of its cover takes no finite elements."""
    error, over, aside = None, math.nan, math.nan
    text = f"{NOT_STATED}: `softcover limits` computes it by finite elements"
    noise = "noise and electronics as stated"
    if sensor is not None and isinstance(sensor.cover, Cover) and sensor.cover.size is None:
        from validation.resolution.channel import make_channel
        from validation.resolution.limits import find_place_error, study_middle

        try:
            channel, assumed = make_channel(parameters.electronics, None, sensor.array.active)
            study = study_middle(sensor, channel, load=_LOAD)
            noise = f"noise of {1e3 * channel.noise:.3g} mN{' (one count, as none is stated)' if assumed else ''}"
            error = find_place_error(study)
            over, aside = (channel.find_least_force(each) for each in study.respond(np.outer([0, 0.5], study.pitch)))
            text = f"{1e6 * error:.3g} um"
        except InputError as fault:
            text = f"{NOT_STATED}: {fault}"
    elif sensor is None:
        text = f"{NOT_STATED}: the cover is not known"
    yield _make_entry(
        "error of place",
        text,
        f"standard deviation per axis of the place of a touch of {_LOAD:g} N around the middle texel, known force",
        f"exact response of the cover, {noise} (`softcover limits`)",
        {"place_error_m": error},
    )
    yield _make_entry(
        "least force",
        text if error is None else f"{1e3 * over:.3g} mN over a texel, {1e3 * aside:.3g} mN between four",
        "90 % of point touches are detected, with 0.1 % of false alarms",
        f"exact response of the cover, {noise} (`softcover limits`)",
        {"least_force_N": None if error is None else [over, aside]},
    )


def _list_time(parameters: Parameters, source: str) -> Iterator[Entry]:
    rate, low_pass = parameters.electronics.rate_hz, parameters.filter
    text = NOT_STATED if low_pass is None else f"{low_pass.cutoff_hz:.4g} Hz (Butterworth, order {low_pass.order})"
    if (high := parameters.electronics.high_pass_hz) is not None:
        yield _make_entry(
            "high-pass",
            f"{high:.4g} Hz (first order)",
            "frequency below which the amplitude falls by more than 3 dB; a held force reads zero",
            source,
            {"high_pass_hz": high},
        )
    yield _make_entry(
        "bandwidth",
        f"{text}; {rate:.4g} frames/s hold up to {rate / 2:.4g} Hz",
        "frequency at which the amplitude of a texel's force falls by 3 dB; at most half the frame rate",
        "no [filter] is given" if low_pass is None else "[filter]" + source.partition("[electronics]")[2],
        {"bandwidth_hz": None if low_pass is None else low_pass.cutoff_hz, "rate_hz": rate},
    )


def _list_errors(parameters: Parameters, source: str) -> Iterator[Entry]:
    electronics, validity = parameters.electronics, parameters.validity
    noise = electronics.noise or None
    yield _make_entry(
        "accuracy",
        NOT_STATED + ("" if noise is None else f"; noise {1e3 * noise:.3g} mN on each texel force"),
        "largest difference between the force that the counts stand for and the true one; noise: standard "
        "deviation of the force on one texel",
        "needs recordings under known loads (`softcover calibrate`)" if noise is None else source,
        {"accuracy_N": None, "noise_N": noise},
    )
    loads = None if validity is None else (validity.load_2_percent, validity.load_5_percent)
    ranges = [f"{part} % up to {load:.3g} N" for part, load in zip((2, 5), loads or (), strict=False) if load]
    yield _make_entry(
        "accuracy of the fast model",
        loads and "force on wrong texels: " + (f"at most {', '.join(ranges)}" if ranges else "above 5 % at every load"),
        "against finite elements, under a ball of one pitch radius",
        "`softcover derive`",
        {"model_load_2_percent_N": loads and loads[0], "model_load_5_percent_N": loads and loads[1]},
    )
    loop = 2 * electronics.hysteresis_share * electronics.hysteresis_width or None
    yield _make_entry(
        "hysteresis",
        loop and f"{1e3 * loop:.3g} mN",
        "largest difference of the force between unloading and loading at the same true force",
        "needs recordings with rising and falling loads (`softcover calibrate`)" if loop is None else source,
        {"hysteresis_N": loop},
    )
    creep = electronics.creep or None
    yield _make_entry(
        "creep",
        creep and f"{100 * creep:.3g} % in a factor e of time",
        "growth of the reading under a constant load, 1 + c ln(t / 2 s); extrapolated before 1 s and after 14 s, "
        "and not known after unloading",
        "needs recordings that hold a load (`softcover calibrate`)" if creep is None else source,
        {"creep_per_ln_time": creep},
    )
    linearity = find_nonlinearity(electronics)
    yield _make_entry(
        "linearity",
        f"{NOT_STATED}: a straight line is given" if linearity is None else f"{100 * linearity:.2g} % of full scale",
        "largest distance of the counts from their least-squares line in the range, over the largest count",
        "needs a measured characteristic of degree 5" if linearity is None else source,
        {"nonlinearity": linearity},
    )
    coefficient = electronics.temperature_coefficient or None
    yield _make_entry(
        "temperature",
        coefficient and f"{100 * coefficient:.3g} % per kelvin",
        "relative change of the measured force per kelvin",
        source if coefficient else NOT_STATED,
        {"temperature_per_K": coefficient},
    )


def _is_bent(electronics: Electronics) -> bool:
    """Return whether counts over force are a polynomial or a line that bends into saturation, and no straight line."""
    return electronics.characteristic is not None or bool(electronics.saturation_band)


def trace_range(electronics: Electronics) -> tuple[FloatArray, FloatArray]:
    """Compute the counts of one texel from the smallest force with a count to the smallest one with the largest count.

    Returns:
        Forces on the texel, shape (k,) [N], and counts, shape (k,) [-].  If the counts never reach the largest one, the
        forces end above 1 MN.
    """
    bare = dataclasses.replace(electronics, gains=None, noise=0.0, temperature_coefficient=0.0)
    top = 1e-3
    while top < _LARGEST_FORCE and bare.counts(np.array([top]))[0] < electronics.output_max:
        top *= 2
    forces = np.linspace(0, 1.01 * top, _STEPS)
    counts = np.asarray(bare.counts(forces[:, None]))[:, 0]
    some, full = np.flatnonzero(counts > 0), np.flatnonzero(counts >= electronics.output_max)
    shown = slice(some[0] if some.size else 0, full[0] + 1 if full.size else None)
    return forces[shown], counts[shown]


def find_nonlinearity(electronics: Electronics) -> float | None:
    """Compute the nonlinearity: largest distance of the counts from their least-squares line, over the largest count.

    Returns:
        The distance [-]; None if the characteristic is a straight line with a sharp end.
    """
    if not _is_bent(electronics):
        return None
    forces, counts = trace_range(electronics)
    line = np.polyval(np.polyfit(forces, counts, 1), forces)
    return float(np.abs(counts - line).max() / electronics.output_max)


def _separate_two_points(parameters: Parameters) -> float | str:
    """Compute the smallest distance of two point loads that the texels can separate [m].

    Returns:
        The distance, or a text with the reason why it is not known.
    """
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
    return found if np.isfinite(found) else "not separated up to twelve pitches"
