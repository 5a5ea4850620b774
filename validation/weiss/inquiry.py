"""Asks a connected sensor what no document says, so that `unconfirmed` can be settled on the bench."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import islice

import numpy as np

from validation.weiss.commands import Command
from validation.weiss.frames import compress
from validation.weiss.sensor import Reading, Sensor, SensorError
from validation.weiss.unconfirmed import TICK

_NANO = 1e-9
_FRAMES = 300


def inquire(sensor: Sensor) -> Mapping[str, str]:
    """One line per open question.  Nothing in the device is changed.

    Args:
        sensor: An open sensor that does not stream.

    Raises:
        PortError: If the sensor stops answering.
    """
    questions: dict[str, Callable[[], str]] = {
        "system info (0x50)": lambda: str(sensor.info()),
        "sensor type (0x38)": lambda: repr(sensor.sensor_type()),
        "matrix info (0x30)": lambda: str(sensor.matrix()),
        "threshold (0x35)": lambda: f"{sensor.threshold()}, read as an unsigned 16 bit number",
        "gain (0x37)": lambda: f"{sensor.gain()}, read as an unsigned 8 bit number",
        "loop (0x06)": lambda: _loop(sensor),
        "clock": lambda: _clock(sensor),
        "run length": lambda: _run_length(sensor),
        "texel order": lambda: _order(sensor),
    }
    return {topic: _ask(question) for topic, question in questions.items()}


def _ask(question: Callable[[], str]) -> str:
    try:
        return question()
    except (SensorError, ValueError) as error:
        return f"not as assumed: {error}"


def _loop(sensor: Sensor) -> str:
    sent = b"softcover"
    (data,) = sensor.ask(Command.LOOP, sent)
    return "answers with the bytes it was sent" if data == sent else f"answers {data!r} to {sent!r}"


def _clock(sensor: Sensor) -> str:
    stream = sensor.stream()
    readings = [event for event in islice(stream, _FRAMES) if isinstance(event, Reading)]
    stream.close()
    ticks, seconds = (
        readings[-1].ticks - readings[0].ticks,
        (readings[-1].host_time - readings[0].host_time) * _NANO,
    )
    rate = (len(readings) - 1) / seconds
    return f"{seconds / ticks * 1e3:.4f} ms per tick (assumed {TICK * 1e3:g} ms), {rate:.1f} frames/s free-running"


def _run_length(sensor: Sensor) -> str:
    raw, packed = sensor.single(), sensor.single(run_length=True)
    if not packed.run_length:
        return "asked for, but the frame came raw"
    apart = int(np.abs(raw.counts.astype(int) - packed.counts).max())
    size = len(compress(packed.counts))
    return (
        f"decodes to {len(packed.counts)} texels in {size} bytes, at most {apart} counts from the raw frame before it"
    )


def _order(sensor: Sensor) -> str:
    counts = sensor.single().counts
    columns = sensor.matrix().columns
    row, column = divmod(int(counts.argmax()), columns)
    return f"largest is texel {counts.argmax()}, read as row {row}, column {column}: press a corner to check"
