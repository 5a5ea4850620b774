"""Records a sensor into a file."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from validation.recordings.labels import Setup, plain_array
from validation.recordings.mcap_writer import Clocks, RecordingWriter, StorageError
from validation.recordings.recording import RecordedArray
from validation.weiss.commands import MatrixInfo
from validation.weiss.continuity import Gap
from validation.weiss.link import Chunk, LinkLostError, PortError
from validation.weiss.sensor import Reading, Sensor, SensorError

_NANO = 1e-9


class RecordingStoppedError(PortError):
    """A recording ended before its time; the message says why and what is kept."""


@dataclass(frozen=True, kw_only=True)
class Captured:
    """What was recorded.

    Attributes:
        path: The file.
        frames: Frames in it.
        gaps: Places where frames are missing.
        seconds: From the first frame to the last, by the host's clock [s].
        ended: Why it ended.
    """

    path: Path
    frames: int
    gaps: int
    seconds: float
    ended: Literal["done", "interrupted"]

    @property
    def rate(self) -> float:
        """Mean frames per second; NaN for fewer than two frames [Hz]."""
        return (self.frames - 1) / self.seconds if self.frames > 1 and self.seconds > 0 else float("nan")


def record(
    sensor: Sensor,
    path: str | Path,
    *,
    setup: Setup | None = None,
    seconds: float | None = None,
    run_length: bool = False,
    interval_ms: int = 0,
    reconnect: float = 0.0,
    on_event: Callable[[Reading | Gap], None] | None = None,
) -> Captured:
    """Record frames, raw bytes and gaps until the time is over or Ctrl-C.

    Args:
        sensor: An open sensor.
        path: The file to write; it must not exist.
        setup: How the sensor is loaded; what the device says of itself is added.
        seconds: How long; until Ctrl-C when not given [s].
        run_length: Whether to ask for run-length encoding.
        interval_ms: Time between frames; 0 for as fast as the device can [ms].
        reconnect: How long to try to open the port again after it went away [s].
        on_event: Called with every reading and gap, to show them.

    Raises:
        RecordingStoppedError: If the port went away; what came is kept.
        StorageError: If the disk takes no more; what came is kept.
    """
    described = _ask(sensor)
    setup = setup or Setup()
    setup = replace(setup, source=setup.source or sensor.port, device={**described, **setup.device})
    offset = time.time_ns() - time.monotonic_ns()
    array = live_array(sensor.matrix(), str(described.get("type", "tactile")))
    session = _Session(offset, on_event)
    try:
        with RecordingWriter(path, arrays=[array], setup=setup, serial=str(described.get("serial", ""))) as writer:
            session.run(sensor, writer, seconds, run_length=run_length, interval_ms=interval_ms, reconnect=reconnect)
    except LinkLostError as error:
        raise RecordingStoppedError(f"{error}; {session.frames} frames are kept in {path}") from error
    except StorageError as error:
        if not session.frames:
            raise
        raise StorageError(f"{error}; {session.frames} frames had come") from error
    return Captured(
        path=Path(path),
        frames=session.frames,
        gaps=session.gaps,
        seconds=session.seconds,
        ended=session.ended,
    )


def live_array(matrix: MatrixInfo, name: str = "tactile") -> RecordedArray:
    """The array that a device describes, without frames."""
    return plain_array(
        matrix.rows,
        matrix.columns,
        np.empty((0, matrix.texels), dtype=np.int32),
        pitch=(matrix.cell_width, matrix.cell_height),
        full_scale=matrix.full_scale,
        name=name,
    )


class _Session:
    """One run of a recorder."""

    def __init__(self, offset: int, on_event: Callable[[Reading | Gap], None] | None) -> None:
        self.frames = self.gaps = 0
        self.ended: Literal["done", "interrupted"] = "done"
        self._offset = offset
        self._on_event = on_event
        self._first = self._last = 0

    @property
    def seconds(self) -> float:
        """From the first frame to the last [s]."""
        return (self._last - self._first) * _NANO

    def run(
        self,
        sensor: Sensor,
        writer: RecordingWriter,
        seconds: float | None,
        *,
        run_length: bool,
        interval_ms: int,
        reconnect: float,
    ) -> None:
        """Write what comes until it is over."""

        def keep(chunk: Chunk) -> None:
            writer.add_raw(chunk.host_time + self._offset, chunk.data)

        stop = None if seconds is None else time.monotonic_ns() + round(seconds / _NANO)
        self._temperature(sensor, writer)
        stream = sensor.stream(run_length=run_length, interval_ms=interval_ms, reconnect=reconnect)
        sensor.tap = keep
        try:
            for event in stream:
                self._write(writer, event)
                if stop is not None and event.host_time >= stop:
                    break
        except KeyboardInterrupt:
            self.ended = "interrupted"
        finally:
            sensor.tap = None
            stream.close()
        for gap in sensor.last_gaps():
            self._write(writer, gap)
        self._temperature(sensor, writer)

    def _write(self, writer: RecordingWriter, event: Reading | Gap) -> None:
        now = event.host_time + self._offset
        if isinstance(event, Gap):
            writer.add_gap(now, str(event))
            self.gaps += 1
        else:
            writer.add_frame(0, Clocks(now, event.host_time, event.ticks), event.counts)
            self._first = self._first or event.host_time
            self._last = event.host_time
            self.frames += 1
        if self._on_event is not None:
            self._on_event(event)

    @staticmethod
    def _temperature(sensor: Sensor, writer: RecordingWriter) -> None:
        """Before and after only: whether a device answers while it streams is not documented."""
        try:
            writer.add_temperatures(time.time_ns(), [sensor.temperature()])
        except SensorError:
            return


def _ask(sensor: Sensor) -> dict[str, str | int | float]:
    """What the device says of itself, as far as it answers."""
    info = sensor.info()
    questions: dict[str, Callable[[], str | int | float]] = {
        "type": sensor.sensor_type,
        "tag": sensor.tag,
        "threshold": sensor.threshold,
        "gain": sensor.gain,
        "temperature": sensor.temperature,
    }
    known: dict[str, str | int | float] = {"serial": info.serial_number, "firmware": info.firmware}
    for name, ask in questions.items():
        try:
            known[name] = ask()
        except SensorError:
            continue
    return known
