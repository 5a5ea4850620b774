"""The assumptions about the protocol that no source confirms, and their check on a connected sensor.

The constants that follow from these assumptions stand in `protocol`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import islice
from types import MappingProxyType

import numpy as np

from validation.weiss.protocol import TICK, Command, Reading, compress
from validation.weiss.sensor import NoAnswerError, Sensor, SensorError

#: Description of each assumption by topic, so that a user can check it on a real sensor.
UNCONFIRMED: Mapping[str, str] = MappingProxyType(
    {
        "clock": "a tick of the frame's timestamp is 1 ms",
        "run length": "units are 16 bit: 12 bit value, 4 bit count (as on the SDH generation); flag is bit 0",
        "tare": "command 0x23 takes one byte, 1 to tare and 0 to undo, and the device subtracts by itself",
        "threshold": "the answer to 0x35 is an unsigned 16 bit number; the device subtracts the threshold",
        "gain": "the answer to 0x37 is an unsigned 8 bit number, 0..255",
        "loop": "command 0x06 answers with the bytes it was sent",
        "mask": "the answer to 0x33 has one bit per texel, lowest bit first, 1 for a texel that exists; "
        "the payloads of 0x31 and 0x32 are unknown and passed on as bytes",
        "texel order": "rows come one after the other, columns fastest; press one corner to see",
    }
)

#: Number of frames over which the length of a tick of the device's clock is measured, about one second [-].
_CLOCK_FRAMES = 300


def inquire(sensor: Sensor) -> Mapping[str, str]:
    """Send the commands whose format is assumed, and describe each answer, or that none came, in one line.

    No setting of the device is changed.

    Args:
        sensor: An open sensor that does not stream frames.

    Returns:
        The descriptions by topic of the assumption.

    Raises:
        LinkLostError: If the port is lost.
    """
    questions: dict[str, Callable[[], str]] = {
        "system info (0x50)": lambda: str(sensor.read_info()),
        "sensor type (0x38)": lambda: repr(sensor.read_type()),
        "matrix info (0x30)": lambda: str(sensor.read_matrix()),
        "mask (0x33)": lambda: _describe_mask(sensor),
        "device tag (0x52)": lambda: repr(sensor.read_tag()),
        "threshold (0x35)": lambda: f"{sensor.read_threshold()}, read as an unsigned 16 bit number",
        "gain (0x37)": lambda: f"{sensor.read_gain()}, read as an unsigned 8 bit number",
        "loop (0x06)": lambda: _check_loop(sensor),
        "clock": lambda: _measure_clock(sensor),
        "run length": lambda: _check_run_length(sensor),
        "texel order": lambda: _find_largest_texel(sensor),
    }
    answers = {}
    for topic, question in questions.items():
        try:
            answers[topic] = question()
        except (SensorError, NoAnswerError, ValueError) as error:
            answers[topic] = f"not as assumed: {error}"
    return answers


def _describe_mask(sensor: Sensor) -> str:
    """Describe how many texels exist according to the answer to the command `get mask`."""
    mask = sensor.read_mask()
    return f"{int(mask.sum())} of {mask.size} texels exist, read as one bit per texel"


def _check_loop(sensor: Sensor) -> str:
    """Check that the sensor answers the command `loop` with the bytes that it was sent."""
    sent = b"softcover"
    (data,) = sensor.ask(Command.LOOP, sent)
    return "answers with the bytes it was sent" if data == sent else f"answers {data!r} to {sent!r}"


def _measure_clock(sensor: Sensor) -> str:
    """Measure the length of a tick of the device's clock, and the frame rate, from a stream of frames."""
    stream = sensor.stream()
    readings = [event for event in islice(stream, _CLOCK_FRAMES) if isinstance(event, Reading)]
    stream.close()
    if not readings or readings[-1].ticks == readings[0].ticks or readings[-1].host_time == readings[0].host_time:
        raise ValueError(f"{len(readings)} frames of {_CLOCK_FRAMES} events have one time; expected a clock that runs")
    first, last = readings[0], readings[-1]
    seconds = 1e-9 * (last.host_time - first.host_time)
    tick, rate = seconds / (last.ticks - first.ticks), (len(readings) - 1) / seconds
    return f"{tick * 1e3:.4f} ms per tick (assumed {TICK * 1e3:g} ms), {rate:.1f} frames/s free-running"


def _check_run_length(sensor: Sensor) -> str:
    """Compare a run-length encoded frame with the raw frame before it."""
    raw, packed = sensor.read_frame(), sensor.read_frame(run_length=True)
    if not packed.run_length:
        return "asked for, but the frame came raw"
    difference = int(np.abs(raw.counts.astype(int) - packed.counts).max())
    return (
        f"decodes to {len(packed.counts)} texels in {len(compress(packed.counts))} bytes, "
        f"at most {difference} counts from the raw frame before it"
    )


def _find_largest_texel(sensor: Sensor) -> str:
    """Describe the place of the texel with the largest count, so that a user who presses a corner can check it."""
    texel = int(sensor.read_frame().counts.argmax())
    row, column = divmod(texel, sensor.read_matrix().columns)
    return f"largest is texel {texel}, read as row {row}, column {column}: press a corner to check"
