"""Records the frames of a sensor on a port into a file."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from validation.recordings.mcap_writer import Clocks, RecordingWriter, StorageError
from validation.recordings.recording import RecordedArray, Setup, make_array
from validation.weiss.commands import MatrixInfo
from validation.weiss.continuity import Gap
from validation.weiss.frames import Reading
from validation.weiss.link import Chunk, LinkLostError, PortError
from validation.weiss.sensor import Sensor, SensorError

_SECONDS_PER_NANOSECOND = 1e-9


class RecordingStoppedError(PortError):
    """The port went away during a recording; the message says why and how many frames are kept."""


@dataclass(frozen=True, kw_only=True)
class Captured:
    """Summary of a recording that was just made.

    Attributes:
        path: The file.
        frames: Number of frames in it [-].
        gaps: Number of places where frames are missing [-].
        seconds: Time from the first frame to the last, by the host's clock [s].
        ended: Whether the time was over (`done`) or the user pressed Ctrl-C (`interrupted`).
    """

    path: Path
    frames: int
    gaps: int
    seconds: float
    ended: Literal["done", "interrupted"]

    @property
    def rate(self) -> float:
        """Mean number of frames per second; NaN for fewer than two frames [Hz]."""
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
    """Record frames, raw bytes and gaps until the time is over or the user presses Ctrl-C.

    Args:
        sensor: An open sensor.
        path: The file to write; it must not exist.
        setup: How the sensor is loaded; the properties that the sensor reports are added.
        seconds: Duration; until Ctrl-C if not given [s].
        run_length: Whether to ask for run-length encoded frames.
        interval_ms: Time between frames; 0 for as fast as the device can [ms].
        reconnect: How long to try to open the port again after it went away [s].
        on_event: Called with every reading and gap, e.g. to show them.

    Raises:
        RecordingStoppedError: If the port went away; the frames received before are kept.
        StorageError: If the file cannot be written; the frames written before are kept.
    """
    reported = _ask_properties(sensor)
    setup = setup or Setup()
    setup = replace(setup, source=setup.source or sensor.port, device={**reported, **setup.device})
    array = make_device_array(sensor.read_matrix(), str(reported.get("type", "tactile")))
    session = _Session(sensor, on_event)
    try:
        with RecordingWriter(path, arrays=[array], setup=setup, serial=str(reported["serial"])) as writer:
            session.run(writer, seconds, run_length=run_length, interval_ms=interval_ms, reconnect=reconnect)
    except LinkLostError as error:
        raise RecordingStoppedError(f"{error}; {session.frames} frames are kept in {path}") from error
    except StorageError as error:
        if not session.frames:
            raise
        raise StorageError(f"{error}; {session.frames} frames had come") from error
    return Captured(
        path=Path(path), frames=session.frames, gaps=session.gaps, seconds=session.seconds, ended=session.ended
    )


def make_device_array(matrix: MatrixInfo, name: str = "tactile") -> RecordedArray:
    """Make the array that a device describes, without frames."""
    return make_array(
        matrix.rows,
        matrix.columns,
        pitch=(matrix.cell_width, matrix.cell_height),
        full_scale=matrix.full_scale,
        name=name,
    )


class _Session:
    """One run of the recorder, with its counts of frames and gaps."""

    def __init__(self, sensor: Sensor, on_event: Callable[[Reading | Gap], None] | None) -> None:
        self.frames = self.gaps = 0
        self.ended: Literal["done", "interrupted"] = "done"
        self._sensor = sensor
        self._on_event = on_event
        #: UTC minus the host's monotonic clock, and the monotonic clock at the first and last frame [ns].
        self._utc_offset = time.time_ns() - time.monotonic_ns()
        self._first = self._last = 0

    @property
    def seconds(self) -> float:
        """Time from the first frame to the last [s]."""
        return (self._last - self._first) * _SECONDS_PER_NANOSECOND

    def run(
        self, writer: RecordingWriter, seconds: float | None, *, run_length: bool, interval_ms: int, reconnect: float
    ) -> None:
        """Write frames, raw bytes and gaps until the time is over or the user presses Ctrl-C."""

        def write_raw(chunk: Chunk) -> None:
            writer.add_raw(chunk.host_time + self._utc_offset, chunk.data)

        stop = None if seconds is None else time.monotonic_ns() + round(seconds / _SECONDS_PER_NANOSECOND)
        self._write_temperature(writer)
        stream = self._sensor.stream(run_length=run_length, interval_ms=interval_ms, reconnect=reconnect)
        self._sensor.tap = write_raw
        try:
            for event in stream:
                self._write_event(writer, event)
                if stop is not None and event.host_time >= stop:
                    break
        except KeyboardInterrupt:
            self.ended = "interrupted"
        finally:
            self._sensor.tap = None
            stream.close()
        for gap in self._sensor.take_last_gaps():
            self._write_event(writer, gap)
        self._write_temperature(writer)

    def _write_event(self, writer: RecordingWriter, event: Reading | Gap) -> None:
        now = event.host_time + self._utc_offset
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

    def _write_temperature(self, writer: RecordingWriter) -> None:
        """Ask for the temperature and write it, if the sensor reports it.

        Called before and after the stream only: no source says whether a device answers while it streams.
        """
        with suppress(SensorError):
            writer.add_temperatures(time.time_ns(), [self._sensor.read_temperature()])


def _ask_properties(sensor: Sensor) -> dict[str, str | int | float]:
    """Ask for the properties of the device; those that it refuses are left out."""
    info = sensor.read_info()
    questions: dict[str, Callable[[], str | int | float]] = {
        "type": sensor.read_type,
        "tag": sensor.read_tag,
        "threshold": sensor.read_threshold,
        "gain": sensor.read_gain,
        "temperature": sensor.read_temperature,
    }
    properties: dict[str, str | int | float] = {"serial": info.serial_number, "firmware": info.firmware}
    for name, ask in questions.items():
        with suppress(SensorError):
            properties[name] = ask()
    return properties
