"""Records the frames of a sensor on a serial port into an MCAP file."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, TypeVar

from validation.recordings.mcap_writer import Clocks, RecordingWriter, StorageError
from validation.recordings.recording import NANOSECOND, BoolArray, RecordedArray, Setup, make_array
from validation.weiss.protocol import MatrixInfo, Reading
from validation.weiss.sensor import LinkLostError, PortError, Sensor
from validation.weiss.stream import DeviceClock, Gap, Residual

T = TypeVar("T")
Properties = dict[str, str | int | float]


class RecordingStoppedError(PortError):
    """Reports that the port was lost during a recording; the message gives the reason and the number of kept frames."""


@dataclass(frozen=True, kw_only=True)
class Captured:
    """Summary of a finished recording.

    Attributes:
        path: The file of the recording.
        frames: Number of frames in the file [-].
        gaps: Number of gaps: places in the stream where frames or bytes are missing or wrong [-].
        seconds: Time from the first frame to the last, by the clock of the host [s].
        residual: Deviation of the arrival times of the frames from their stamps, which follow the device's clock.
        ended: `done` if the requested duration was over, `interrupted` if the user pressed Ctrl-C.
        unknown: Properties that the device did not report, such as `temperature after the frames`.
    """

    path: Path
    frames: int
    gaps: int
    seconds: float
    residual: Residual
    ended: Literal["done", "interrupted"]
    unknown: tuple[str, ...] = ()

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
    """Record frames, raw bytes and gaps of a sensor until the duration is over or the user presses Ctrl-C.

    Args:
        sensor: An open sensor.
        path: File to write; it must not exist.
        setup: Conditions of the recording, such as the load; the properties that the sensor reports are added.
        seconds: Duration of the recording; until Ctrl-C if not given [s].
        run_length: Whether to request run-length encoded frames.
        interval_ms: Time between frames; 0 for the shortest time that the device supports [ms].
        reconnect: Longest time during which a lost port is opened again and again [s].
        on_event: Function that is called with every reading and every gap, for example to show them.

    Raises:
        RecordingStoppedError: If the port was lost; the frames received before are kept in the file.
        StorageError: If the file cannot be written; the frames written before are kept in the file.
    """
    unknown: list[str] = []
    reported = _ask_properties(sensor, unknown)
    setup = setup or Setup()
    setup = replace(setup, source=setup.source or sensor.port, device={**reported, **setup.device})
    mask = _ask("mask", sensor.read_mask, unknown)
    array = make_device_array(sensor.read_matrix(), str(reported.get("type", "tactile")), active=mask)
    session = _Session(sensor, on_event, unknown)
    stream = sensor.stream(run_length=run_length, interval_ms=interval_ms, reconnect=reconnect)
    try:
        with RecordingWriter(path, arrays=[array], setup=setup, serial=str(reported["serial"])) as writer:
            session.run(writer, stream, seconds)
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
        residual=session.clock.residual,
        ended=session.ended,
        unknown=tuple(unknown),
    )


def make_device_array(matrix: MatrixInfo, name: str = "tactile", *, active: BoolArray | None = None) -> RecordedArray:
    """Make a recorded array without frames from the description that a device gives of its array.

    Args:
        matrix: The description.
        name: Name of the array.
        active: Whether each texel exists, shape (n,); all if not given.
    """
    return make_array(
        matrix.rows,
        matrix.columns,
        pitch=(matrix.cell_width, matrix.cell_height),
        full_scale=matrix.full_scale,
        active=active,
        name=name,
    )


class _Session:
    """One run of the recorder; counts the frames and gaps that were written."""

    def __init__(self, sensor: Sensor, on_event: Callable[[Reading | Gap], None] | None, unknown: list[str]) -> None:
        self.frames = self.gaps = 0
        self.ended: Literal["done", "interrupted"] = "done"
        self.clock = DeviceClock()
        self._sensor = sensor
        self._on_event = on_event
        self._unknown = unknown
        #: UTC time since 1970 minus time on the monotonic clock of the host [ns].
        self._utc_offset = time.time_ns() - time.monotonic_ns()
        #: Time of the first and of the last frame on the monotonic clock of the host [ns].
        self._first = self._last = 0

    @property
    def seconds(self) -> float:
        """Time from the first recorded frame to the last [s]."""
        return (self._last - self._first) * NANOSECOND

    def run(self, writer: RecordingWriter, stream: Generator[Reading | Gap, None, None], seconds: float | None) -> None:
        """Write frames, raw bytes and gaps to a file until the duration is over or the user presses Ctrl-C.

        Args:
            writer: The file.
            stream: Stream of the sensor, which starts when the first event is taken from it.
            seconds: Duration; None for no limit [s].
        """
        stop = None if seconds is None else time.monotonic_ns() + round(seconds / NANOSECOND)
        self._write_temperature(writer, "before")
        self._sensor.tap = lambda chunk: writer.add_raw(chunk.host_time + self._utc_offset, chunk.data)
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
        self._write_temperature(writer, "after")

    def _write_event(self, writer: RecordingWriter, event: Reading | Gap) -> None:
        now = event.host_time + self._utc_offset
        if isinstance(event, Gap):
            writer.add_gap(now, str(event))
            self.gaps += 1
        else:
            taken = self.clock.stamp(event.ticks, event.host_time) + self._utc_offset
            writer.add_frame(0, Clocks(taken, event.host_time, event.ticks, arrival=now), event.counts)
            self._first = self._first or event.host_time
            self._last = event.host_time
            self.frames += 1
        if self._on_event is not None:
            self._on_event(event)

    def _write_temperature(self, writer: RecordingWriter, when: str) -> None:
        """Read the temperature from the sensor and write it to the file, if the sensor reports a temperature.

        The method is called before and after the stream only, because no source states whether a device answers
        commands while it streams.
        """
        degrees = _ask(f"temperature {when} the frames", self._sensor.read_temperature, self._unknown)
        if degrees is not None:
            writer.add_temperatures(time.time_ns(), [degrees])


def _ask(name: str, question: Callable[[], T], unknown: list[str]) -> T | None:
    """Ask an optional question; without an answer add its name to `unknown` and return None.

    A port that is lost before the frames is reported by the next command; after the frames nothing else is needed.
    """
    try:
        return question()
    except PortError:
        unknown.append(name)
        return None


def _ask_properties(sensor: Sensor, unknown: list[str]) -> Properties:
    """Read the properties of a device by name, and add the names of those that it does not report to `unknown`."""
    info = sensor.read_info()
    questions: dict[str, Callable[[], str | int | float]] = {
        "type": sensor.read_type,
        "tag": sensor.read_tag,
        "threshold": sensor.read_threshold,
        "gain": sensor.read_gain,
        "temperature": sensor.read_temperature,
    }
    answers = {name: _ask(name, question, unknown) for name, question in questions.items()}
    known = {name: answer for name, answer in answers.items() if answer is not None}
    return {"serial": info.serial_number, "firmware": info.firmware, **known}
