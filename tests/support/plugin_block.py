"""Reader of the `<plugin>` element that `fastmodel.adapters.gazebo` writes."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from fastmodel import Butterworth, Gaussian, Parameters
from fastmodel.signal.electronics import Electronics
from meshes import TexelArray


def read_block(text: str, *, pitch: float) -> Parameters:
    """Read the parameters of a sensor from the element; it does not contain the pitch of the texels [m]."""
    plugin = ET.fromstring(text)  # noqa: S314 -- written by the test
    values = {element.tag: element.text for element in plugin}
    cutoff, order = float(values["cutFrequency"]), int(values["orderFilter"])
    return Parameters(
        array=TexelArray.grid(int(values["rows"]), int(values["columns"]), pitch),
        spread=Gaussian(
            sigma_x=float(values["sigmax"]),
            sigma_y=float(values["sigmay"]),
            ksize_x=int(values["ksizex"]),
            ksize_y=int(values["ksizey"]),
        ),
        electronics=Electronics(
            rate_hz=float(values["tactile_rate"]),
            sensitivity=float(values["liniaritySensibility"]),
            offset=float(values["liniarityOfset"]),
            output_max=int(values["satMax"]),
            calibrated=plugin.get("calibrated", "texel force"),
        ),
        filter=Butterworth(cutoff_hz=cutoff, order=order) if order else None,
    )
