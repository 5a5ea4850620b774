"""Write and read the `<plugin>` element for Gazebo of the 2015 report, with the spelling of the report.

The report gives the names of the elements and their values for the WTS 0614-34, but no definitions.  Here `rangeMin`
and `rangeMax` are the forces at which the counts leave zero and reach saturation [N], and `satMin` and `satMax`
the counts at these two forces [-].  `tactile_rate` is in frames per second, `cutFrequency` in Hz (0 together with
`orderFilter` 0 for no filter), sigmas are in pitches and ksizes in texels.  The block holds no positions, noise or
gains per texel, and no other spread than a Gaussian.

The plugin applies its linear characteristic to the force on a texel after the spread.  A characteristic that was
calibrated through the cover is therefore converted to a function of the force on the texel.  If the share of the
calibration tip's force on the texel is not known, the characteristic is written unchanged, and the attribute
`calibrated` of `<plugin>` states this.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree as ET

from fastmodel.errors import ParametersError
from fastmodel.parameters import Parameters
from fastmodel.signal.butterworth import Butterworth
from fastmodel.signal.electronics import TEXEL_FORCE, Electronics
from fastmodel.signal.point_spread import Gaussian
from meshes import TexelArray

#: The elements of the block and the types of their values, in the order in which they are written.
ELEMENTS: Mapping[str, type] = MappingProxyType(
    {
        "rows": int,
        "columns": int,
        "rangeMin": float,
        "rangeMax": float,
        "satMin": int,
        "satMax": int,
        "tactile_rate": float,
        "liniaritySensibility": float,
        "liniarityOfset": float,
        "dataTopicName": str,
        "imageTopicName": str,
        "cutFrequency": float,
        "orderFilter": int,
        "sigmax": float,
        "sigmay": float,
        "ksizex": int,
        "ksizey": int,
    }
)
#: Names of the types of elements in error messages.
_TYPE_NAMES = {int: "a whole number", float: "a number", str: "a name"}
#: Smallest number of bits of the converter that `read_block` assumes [-], that of the WTS 0614-34.
_BITS = 12


@dataclass(frozen=True, kw_only=True)
class PluginBlock:
    """The content of a `<plugin>` element of the 2015 report.

    Attributes:
        parameters: The parameters of the sensor.
        data_topic: Name of the topic on which the plugin publishes forces and counts.
        image_topic: Name of the topic on which the plugin publishes the image.
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
    """Write a sensor's parameters as the report's `<plugin>` element.

    Args:
        parameters: Array, Gaussian spread, linear electronics.
        name: Name of the plugin, and of its library without `lib` and `.so`.
        data_topic: Topic of the forces and counts.
        image_topic: Topic of the image.

    Raises:
        ParametersError: If the block cannot represent the parameters: the spread is not Gaussian, the characteristic is
            not linear, or the array is curved or masked.
    """
    spread, array, electronics = parameters.spread, parameters.array, parameters.electronics
    faults = {
        "the spread must be a Gaussian": not isinstance(spread, Gaussian),
        "the characteristic must be a straight line": electronics.characteristic is not None,
        "the array must be flat": not array.planar,
        "no texel may be masked": not array.active.all(),
    }
    if any(faults.values()) or not isinstance(spread, Gaussian):
        found = "; ".join(text for text, wrong in faults.items() if wrong)
        raise ParametersError(f"the Gazebo plugin block cannot hold these parameters: {found}")
    # the threshold of the firmware is subtracted from the offset, because there is no element for the threshold
    offset = electronics.offset - electronics.threshold
    slope = electronics.sensitivity / electronics.applied_share
    low_pass = parameters.filter
    values = (
        *(array.rows, array.columns, max(-offset / slope, 0.0), (electronics.output_max - offset) / slope),
        *(0, electronics.output_max, electronics.rate_hz, slope, offset, data_topic, image_topic),
        *((0.0, 0) if low_pass is None else (low_pass.cutoff_hz, low_pass.order)),
        *(spread.sigma_x, spread.sigma_y, spread.ksize_x, spread.ksize_y),
    )
    plugin = ET.Element("plugin", name=name, filename=f"lib{name}.so")
    if electronics.tip_radius is not None and electronics.tip_share is None:
        plugin.set("calibrated", electronics.calibrated)
    for element, value in zip(ELEMENTS, values, strict=True):
        ET.SubElement(plugin, element).text = str(value)
    ET.indent(plugin)
    return ET.tostring(plugin, encoding="unicode") + "\n"


def read_block(
    text: str, *, pitch: float | tuple[float, float], texel_size: float | tuple[float, float] | None = None
) -> PluginBlock:
    """Read the `<plugin>` element of the 2015 report from the text of a world file, a model file, or the element alone.

    Args:
        text: XML text.
        pitch: Distance between texel centres, which the element does not contain [m].
        texel_size: Edges of the sensitive rectangle of a texel, by default the pitch [m].

    Raises:
        ParametersError: If there is no such element, or if values are bad; the message lists all bad values.
    """
    values = _parse_values(text)
    spread = {f"{name}_{axis}": values[f"{name}{axis}"] for name in ("sigma", "ksize") for axis in "xy"}
    cutoff, order, white = values["cutFrequency"], values["orderFilter"], values["satMax"]
    try:
        parameters = Parameters(
            array=TexelArray.grid(values["rows"], values["columns"], pitch, texel_size=texel_size, name="gazebo"),
            spread=Gaussian(**spread),
            electronics=Electronics(
                rate_hz=values["tactile_rate"],
                sensitivity=values["liniaritySensibility"],
                offset=values["liniarityOfset"],
                output_max=white,
                bits=max(_BITS, int(white).bit_length()),
                calibrated=values["calibrated"],
            ),
            filter=None if cutoff == 0 and order == 0 else Butterworth(cutoff_hz=cutoff, order=order),
            provenance={"source": "Gazebo plugin block"},
        )
    except ValueError as error:
        raise ParametersError(f"Gazebo plugin block: {error}") from error
    return PluginBlock(parameters=parameters, data_topic=values["dataTopicName"], image_topic=values["imageTopicName"])


def _parse_values(text: str) -> dict[str, Any]:
    """Parse the values of the `<plugin>` element's children, and its attribute `calibrated`, by their names.

    Raises:
        ParametersError: If there is no such element or values have wrong types; the message lists all of these.
    """
    try:
        root = ET.fromstring(text)  # noqa: S314 -- a file of the user's own; expat refuses entity bombs since 2.4.1
    except ET.ParseError as error:
        raise ParametersError(f"Gazebo plugin block: not readable as XML: {error}") from error
    blocks = [plugin for plugin in root.iter("plugin") if plugin.find("liniaritySensibility") is not None]
    if not blocks:
        raise ParametersError("Gazebo plugin block: no <plugin> element with <liniaritySensibility> in it")
    values: dict[str, Any] = {"calibrated": blocks[0].get("calibrated", TEXEL_FORCE)}
    faults = []
    for element, kind in ELEMENTS.items():
        written = (blocks[0].findtext(element) or "").strip()
        try:
            values[element] = kind(written)
        except ValueError:
            values[element] = None
        if not written or values[element] is None or (kind is float and not math.isfinite(values[element])):
            faults.append(f"<{element}> must be {_TYPE_NAMES[kind]}, not {written!r}")
    if faults:
        raise ParametersError(f"Gazebo plugin block: {'; '.join(faults)}")
    return values
