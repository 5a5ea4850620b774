"""Writes recordings as MCAP, so that a recorder may be killed at any moment.

A chunk is closed and handed to the system five times a second, by a thread of its own; another one forces
what is there to disk once a second.  What a killed recorder leaves is a valid file without its index and end;
`mcap_reader` reads it as it is and `recover` completes it.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self, cast

import numpy as np
import numpy.typing as npt

from validation.errors import MissingExtraError
from validation.recordings import labels, ros_messages
from validation.recordings.labels import Setup
from validation.recordings.recording import RecordedArray

#: How often what came is handed to the system, and how often it is forced to disk [s].
FLUSH_EVERY, SYNC_EVERY = 0.2, 1.0
_LARGEST_COUNT = 0xFFFF

SETUP_TOPIC, RAW_TOPIC, GAP_TOPIC = "/setup", "/raw", "/diagnostics"
TEMPERATURE_TOPIC, FORCE_TOPIC = "/temperatures", "/force"


class StorageError(OSError):
    """The disk does not take the recording; the message says what is kept."""


@dataclass(frozen=True, slots=True)
class Clocks:
    """When a frame was taken.

    Attributes:
        time: Host clock, UTC [ns].
        monotonic: Host's monotonic clock [ns]; 0 where unknown.
        ticks: Device's clock; 0 where unknown.
    """

    time: int
    monotonic: int = 0
    ticks: int = 0


class _File:
    """Output of the MCAP library: written at every flush at once, and cut back to the last whole chunk when that fails.

    The file is made by the first flush, so that a recorder killed at any moment leaves none or one with its set-up.
    """

    def __init__(self, path: Path) -> None:
        self.descriptor = -1
        self._path = path
        self._whole = 0
        self._held = bytearray()

    def write(self, data: bytes) -> int:
        self._held += data
        return len(data)

    def tell(self) -> int:
        return self._whole + len(self._held)

    def flush(self) -> None:
        if self.descriptor < 0:
            self._open()
        held, self._held = self._held, bytearray()
        written = 0
        while written < len(held):
            written += os.write(self.descriptor, memoryview(held)[written:])
        self._whole += written

    def _open(self) -> None:
        try:
            self.descriptor = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except OSError as error:
            raise StorageError(f"{self._path}: cannot be written: {error.strerror}; name a new file") from error

    def cut(self) -> None:
        """Leave what was whole at the last flush, and close; safe to call twice."""
        if self.descriptor >= 0:
            os.ftruncate(self.descriptor, self._whole)
            self.close()

    def close(self) -> None:
        os.close(self.descriptor)
        self.descriptor = -1


class RecordingWriter:
    """An MCAP file that grows.  Use it in a `with` block: leaving writes index and end.

    Args:
        path: The file; it must not exist.
        arrays: The arrays whose frames will come; frames that they hold already are not written.
        setup: How the recording is made.
        serial: Serial number of the sensor.
        start: Host clock at the start, UTC; now when not given [ns].

    Raises:
        StorageError: If the file exists or the disk does not take it.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        arrays: Sequence[RecordedArray],
        setup: Setup,
        serial: str = "",
        start: int | None = None,
    ) -> None:
        self.path = Path(path)
        self.frames = 0
        self._columns = [array.texels.columns for array in arrays]
        self._names = topic_names(len(arrays))
        self._sequence = [0] * len(arrays)
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._failure: OSError | None = None
        self._file = _File(self.path)
        self._writer = _mcap(self._file)
        self._channels: dict[str, int] = {}
        monotonic, now = time.monotonic_ns(), time.time_ns()
        self._start = now if start is None else start
        clock = {"start_ns": self._start, "monotonic_ns": monotonic}
        described = [labels.describe_array(array) for array in arrays]
        text = labels.to_json(setup, arrays=described, serial=serial, clock=clock)
        try:
            self._writer.start(profile="ros2", library="softcover")
            self._register()
            self._writer.add_metadata("softcover", {"labels": text})
            self._add(SETUP_TOPIC, self._start, ros_messages.text(text))
            self._writer.flush()
        except StorageError:
            raise
        except OSError as error:
            raise self._failed(error) from error
        # a slow disk holds up fsync for seconds; chunks must reach the system all the same
        self._threads = [threading.Thread(target=task, daemon=True) for task in (self._flush_on, self._sync_on)]
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> Self:
        """Nothing more to do: it is open."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Complete the file; an error that is on its way already is not replaced."""
        try:
            self.close()
        except StorageError:
            if error is None:
                raise

    def add_frame(
        self,
        array: int,
        clocks: Clocks,
        counts: npt.NDArray[np.integer],
        *,
        texel_forces: npt.NDArray[np.float64] | None = None,
    ) -> None:
        """Write one frame of one array.

        Args:
            array: Which of the arrays.
            clocks: When it was taken.
            counts: Shape (n,), 0..65535.
            texel_forces: Shape (n,) [N]; none on a real sensor.

        Raises:
            StorageError: If the disk took no more.
            ValueError: If a count does not fit 16 bits.
        """
        if counts.size and (counts.min() < 0 or counts.max() > _LARGEST_COUNT):
            raise ValueError(f"counts must lie in 0..{_LARGEST_COUNT}, not {counts.min()}..{counts.max()}")
        values = counts.astype(np.uint16)
        name = self._names[array]
        forces = ros_messages.no_forces() if texel_forces is None else texel_forces
        fields = ros_messages.FrameFields(clocks.monotonic, clocks.ticks, values, forces)
        picture = ros_messages.image(clocks.time, name, values, self._columns[array])
        sequence = self._sequence[array]
        self._sequence[array] += 1
        self._add(f"/{name}/image", clocks.time, picture, sequence)
        self._add(f"/{name}/frame", clocks.time, ros_messages.frame(clocks.time, name, fields), sequence)
        self.frames += array == 0

    def add_raw(self, time_ns: int, data: bytes) -> None:
        """Write bytes as they came from a port."""
        self._add(RAW_TOPIC, time_ns, ros_messages.octets(data))

    def add_gap(self, time_ns: int, text: str) -> None:
        """Write that frames are missing here."""
        self._add(GAP_TOPIC, time_ns, ros_messages.diagnostics(time_ns, "gap", text))

    def add_temperatures(self, time_ns: int, degrees: npt.ArrayLike) -> None:
        """Write temperatures, one per channel [degC]."""
        self._add(TEMPERATURE_TOPIC, time_ns, ros_messages.numbers(degrees))

    def add_force(self, time_ns: int, newtons: float) -> None:
        """Write what a force sensor beside the array reads [N]."""
        self._add(FORCE_TOPIC, time_ns, ros_messages.force(time_ns, "force_sensor", newtons))

    def close(self) -> None:
        """Write index and end, and close the file; safe to call twice.

        Raises:
            StorageError: If the disk took no more.
        """
        if self._closed.is_set():
            return
        self._closed.set()
        for thread in self._threads:
            thread.join()
        try:
            if self._failure is None:
                self._writer.finish()
                self._file.flush()
                os.fsync(self._file.descriptor)
        except OSError as error:
            self._failure = error
        if self._failure is not None:
            raise self._failed(self._failure) from self._failure
        self._file.close()

    def _register(self) -> None:
        topics = {SETUP_TOPIC: ros_messages.TEXT, RAW_TOPIC: ros_messages.BYTES}
        topics |= {GAP_TOPIC: ros_messages.DIAGNOSTICS, TEMPERATURE_TOPIC: ros_messages.NUMBERS}
        topics |= {FORCE_TOPIC: ros_messages.WRENCH}
        for name in self._names:
            topics |= {f"/{name}/image": ros_messages.IMAGE, f"/{name}/frame": ros_messages.FRAME}
        schemas = {
            kind: self._writer.register_schema(kind, "ros2msg", ros_messages.definition(kind))
            for kind in dict.fromkeys(topics.values())
        }
        self._channels = {
            topic: self._writer.register_channel(topic, "cdr", schemas[kind]) for topic, kind in topics.items()
        }

    def _add(self, topic: str, time_ns: int, data: bytes, sequence: int = 0) -> None:
        with self._lock:
            if self._failure is not None:
                raise self._failed(self._failure) from self._failure
            self._writer.add_message(
                channel_id=self._channels[topic],
                log_time=time_ns,
                publish_time=time_ns,
                sequence=sequence,
                data=data,
            )

    def _flush_on(self) -> None:
        self._repeat(FLUSH_EVERY, self._flush)

    def _sync_on(self) -> None:
        self._repeat(SYNC_EVERY, lambda: os.fsync(self._file.descriptor))

    def _repeat(self, seconds: float, do: Callable[[], None]) -> None:
        while not self._closed.wait(seconds):
            try:
                do()
            except OSError as error:
                self._failure = self._failure or error
                return

    def _flush(self) -> None:
        with self._lock:
            if not self._closed.is_set():
                self._writer.flush()

    def _failed(self, error: OSError) -> StorageError:
        """Cut the file back to its last whole chunk, close it and say so."""
        self._failure = error
        self._closed.set()
        self._file.cut()
        return StorageError(
            f"{self.path}: the disk takes no more ({error.strerror or error}); kept there is all but the last "
            f"{2 * FLUSH_EVERY:g} s"
        )


def _mcap(output: _File) -> Any:  # noqa: ANN401 -- the library's types say less than it takes
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise MissingExtraError("device", "mcap") from error
    return Writer(cast("Any", output), enable_data_crcs=True)


def topic_names(arrays: int) -> list[str]:
    """First parts of the topics of so many arrays."""
    return ["tactile"] if arrays == 1 else [f"tactile_{index}" for index in range(arrays)]
