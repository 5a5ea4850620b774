"""The Gazebo plugin block of the 2015 report, in its own spelling, written and read.

The report gives its parameters' names and its WTS 0614-34 line, not a definition of each number.  Here: `rangeMin` and
`rangeMax` are the forces at which counting begins and at which it saturates [N], `satMin` and `satMax` the counts
there; `tactile_rate` is in frames per second, `cutFrequency` in Hz (0 with `orderFilter` 0: no filter), sigmas are in
pitches and ksizes in texels.  The block holds no positions, noise or per-texel gains, and a Gaussian only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree as ET

from fastmodel.errors import ParametersError
from fastmodel.parameters import Parameters
from fastmodel.signal.butterworth import Butterworth
from fastmodel.signal.electronics import Electronics
from fastmodel.signal.point_spread import Gaussian
from meshes import TexelArray

_WHOLE = ("rows", "columns", "satMin", "satMax", "orderFilter", "ksizex", "ksizey")
_NUMBERS = (
    "rangeMin",
    "rangeMax",
    "tactile_rate",
    "liniaritySensibility",
    "liniarityOfset",
    "cutFrequency",
    "sigmax",
    "sigmay",
)
_TEXTS = ("dataTopicName", "imageTopicName")
#: What the block holds, in the order in which it is written.
NAMES = (
    "rows",
    "columns",
    "rangeMin",
    "rangeMax",
    "satMin",
    "satMax",
    "tactile_rate",
    "liniaritySensibility",
    "liniarityOfset",
    "dataTopicName",
    "imageTopicName",
    "cutFrequency",
    "orderFilter",
    "sigmax",
    "sigmay",
    "ksizex",
    "ksizey",
)


@dataclass(frozen=True, kw_only=True)
class PluginBlock:
    """A block that was read.

    Attributes:
        parameters: What the fast model makes of it.
        data_topic: Where the plugin publishes forces and counts.
        image_topic: Where it publishes the image.
    """

    parameters: Parameters
    data_topic: str
    image_topic: str


def write_block(
    parameters: Parameters,
    *,
    name: str = "tactile",
    data_topic: str = "tactile/data",
    image_topic: str = "tactile/image",
) -> str:
    """A sensor's parameters as the report's `<plugin>` element.

    Args:
        parameters: Array, Gaussian spread, linear electronics.
        name: Name of the plugin, and of its library without `lib` and `.so`.
        data_topic: Where it shall publish forces and counts.
        image_topic: Where it shall publish the image.

    Raises:
        ParametersError: If the block cannot hold them: another spread than a Gaussian, a 5th-degree characteristic,
            or a curved or masked array.
    """
    values = {**_numbers(parameters, _gaussian(parameters)), "dataTopicName": data_topic, "imageTopicName": image_topic}
    plugin = ET.Element("plugin", name=name, filename=f"lib{name}.so")
    for key in NAMES:
        value = values[key]
        ET.SubElement(plugin, key).text = value if isinstance(value, str) else repr(value)
    ET.indent(plugin)
    return ET.tostring(plugin, encoding="unicode") + "\n"


def read_block(
    text: str, *, pitch: float | tuple[float, float], texel_size: float | tuple[float, float] | None = None
) -> PluginBlock:
    """Parameters from a `<plugin>` element, alone or anywhere in a world or model file.

    Args:
        text: The XML.
        pitch: Distance between texel centres, which the block does not hold [m].
        texel_size: Sensitive rectangle of a texel; the pitch when not given [m].

    Raises:
        ParametersError: If there is no such block, or with all faults of its values.
    """
    values = _values(text)
    try:
        return PluginBlock(
            parameters=Parameters(
                array=TexelArray.grid(values["rows"], values["columns"], pitch, texel_size=texel_size, name="gazebo"),
                spread=Gaussian(
                    sigma_x=values["sigmax"],
                    sigma_y=values["sigmay"],
                    ksize_x=values["ksizex"],
                    ksize_y=values["ksizey"],
                ),
                electronics=Electronics(
                    rate_hz=values["tactile_rate"],
                    sensitivity=values["liniaritySensibility"],
                    offset=values["liniarityOfset"],
                    output_max=values["satMax"],
                    bits=max(12, int(values["satMax"]).bit_length()),
                ),
                filter=_low_pass(values["cutFrequency"], values["orderFilter"]),
                provenance={"source": "Gazebo plugin block"},
            ),
            data_topic=values["dataTopicName"],
            image_topic=values["imageTopicName"],
        )
    except ValueError as error:
        raise ParametersError(f"Gazebo plugin block: {error}") from error


def _gaussian(parameters: Parameters) -> Gaussian:
    """The spread of parameters that the block can hold."""
    spread, array = parameters.spread, parameters.array
    faults = [
        text
        for wrong, text in (
            (not isinstance(spread, Gaussian), "the spread must be a Gaussian"),
            (parameters.electronics.characteristic is not None, "the characteristic must be a straight line"),
            (not array.planar, "the array must be flat"),
            (not array.active.all(), "no texel may be masked"),
        )
        if wrong
    ]
    if faults or not isinstance(spread, Gaussian):
        raise ParametersError(f"the Gazebo plugin block cannot hold these parameters: {'; '.join(faults)}")
    return spread


def _numbers(parameters: Parameters, spread: Gaussian) -> dict[str, int | float]:
    """What the block says in numbers, by its names."""
    electronics, low_pass, array = parameters.electronics, parameters.filter, parameters.array
    begins, ends = (
        (count + electronics.threshold - electronics.offset) / electronics.sensitivity
        for count in (0, electronics.output_max)
    )
    return {
        "rows": array.rows,
        "columns": array.columns,
        "rangeMin": max(begins, 0.0),
        "rangeMax": ends,
        "satMin": 0,
        "satMax": electronics.output_max,
        "tactile_rate": electronics.rate_hz,
        "liniaritySensibility": electronics.sensitivity,
        "liniarityOfset": electronics.offset - electronics.threshold,
        "cutFrequency": 0.0 if low_pass is None else low_pass.cutoff_hz,
        "orderFilter": 0 if low_pass is None else low_pass.order,
        "sigmax": spread.sigma_x,
        "sigmay": spread.sigma_y,
        "ksizex": spread.ksize_x,
        "ksizey": spread.ksize_y,
    }


def _low_pass(cutoff_hz: float, order: int) -> Butterworth | None:
    return None if cutoff_hz == 0 and order == 0 else Butterworth(cutoff_hz=cutoff_hz, order=order)


def _values(text: str) -> dict[str, Any]:
    """Every value of the block by its name."""
    try:
        root = ET.fromstring(text)  # noqa: S314 -- a file of the user's own; expat refuses entity bombs since 2.4.1
    except ET.ParseError as error:
        raise ParametersError(f"Gazebo plugin block: not readable as XML: {error}") from error
    blocks = [each for each in root.iter("plugin") if each.find("liniaritySensibility") is not None]
    if not blocks:
        raise ParametersError("Gazebo plugin block: no <plugin> element with <liniaritySensibility> in it")
    found: dict[str, Any] = {}
    faults = []
    for name in NAMES:
        written = (blocks[0].findtext(name) or "").strip()
        try:
            found[name] = _value(name, written)
        except ValueError:
            wanted = "a whole number" if name in _WHOLE else "a number" if name in _NUMBERS else "a name"
            faults.append(f"<{name}> must be {wanted}, not {written!r}")
    if faults:
        raise ParametersError(f"Gazebo plugin block: {'; '.join(faults)}")
    return found


def _value(name: str, written: str) -> int | float | str:
    if not written:
        raise ValueError(name)
    if name in _TEXTS:
        return written
    if name in _WHOLE:
        return int(written)
    number = float(written)
    if not math.isfinite(number):
        raise ValueError(name)
    return number
