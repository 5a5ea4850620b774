"""Write the `<plugin>` element for Gazebo of the 2015 report, with the spelling of the report.

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

from xml.etree import ElementTree as ET

from fastmodel.errors import ParametersError
from fastmodel.parameters import Parameters
from fastmodel.signal.point_spread import Gaussian


def write_block(parameters: Parameters) -> str:
    """Write a sensor's parameters as the report's `<plugin>` element.

    Args:
        parameters: Array, Gaussian spread, linear electronics.

    Raises:
        ParametersError: If the block cannot represent the parameters: the spread is not Gaussian, the characteristic is
            not linear, or the array is curved or masked.
    """
    spread, array, electronics = parameters.spread, parameters.array, parameters.electronics
    faults = {
        "the spread must be a Gaussian": not isinstance(spread, Gaussian),
        "the characteristic must be a straight line": electronics.characteristic is not None,
        "no high-pass may be given": electronics.high_pass_hz is not None,
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
    values = {
        "rows": array.rows,
        "columns": array.columns,
        "rangeMin": max(-offset / slope, 0.0),
        "rangeMax": (electronics.output_max - offset) / slope,
        "satMin": 0,
        "satMax": electronics.output_max,
        "tactile_rate": electronics.rate_hz,
        "liniaritySensibility": slope,
        "liniarityOfset": offset,
        "dataTopicName": "tactile/data",
        "imageTopicName": "tactile/image",
        "cutFrequency": 0.0 if low_pass is None else low_pass.cutoff_hz,
        "orderFilter": 0 if low_pass is None else low_pass.order,
        "sigmax": spread.sigma_x,
        "sigmay": spread.sigma_y,
        "ksizex": spread.ksize_x,
        "ksizey": spread.ksize_y,
    }
    plugin = ET.Element("plugin", name="tactile", filename="libtactile.so")
    if electronics.tip_radius is not None and electronics.tip_share is None:
        plugin.set("calibrated", electronics.calibrated)
    for element, value in values.items():
        ET.SubElement(plugin, element).text = str(value)
    ET.indent(plugin)
    return ET.tostring(plugin, encoding="unicode") + "\n"
