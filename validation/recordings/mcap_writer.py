"""Writes recordings as MCAP files that stay readable when the recorder is killed at any moment.

One thread closes a chunk and hands it to the operating system five times a second.  Another thread forces the file to
the disk once a second.  A killed recorder leaves a valid file without its index and end: `mcap_reader.read` reads it as
it is, and `mcap_reader.recover` completes it.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, cast

import numpy as np
import numpy.typing as npt

from validation.errors import MissingExtraError
from validation.recordings import ros_messages
from validation.recordings.labels import Labels, encode_labels
from validation.recordings.recording import RecordedArray, Setup

if TYPE_CHECKING:
    from mcap.writer import Writer

SETUP_TOPIC, RAW_TOPIC, GAP_TOPIC = "/setup", "/raw", "/diagnostics"
TEMPERATURE_TOPIC, FORCE_TOPIC = "/temperatures", "/force"

#: Time between two chunks, and between two times that the file is forced to the disk [s].
_FLUSH_INTERVAL, _SYNC_INTERVAL = 0.2, 1.0
#: Largest count that a frame message of 16 bit numbers can hold [-].
_LARGEST_COUNT = 0xFFFF


class StorageError(OSError):
    """A recording cannot be written, e.g. to a full disk; the message says what is kept."""


@dataclass(frozen=True, slots=True)
class Clocks:
    """The time of a frame on each clock.

    Attributes:
        time: Host clock, UTC since 1970 [ns].
        monotonic: Monotonic clock of the host [ns]; 0 if unknown.
        ticks: Clock of the device [ticks]; 0 if unknown.
    """

    time: int
    monotonic: int = 0
    ticks: int = 0


class RecordingWriter(AbstractContextManager["RecordingWriter"]):
    """A growing MCAP file.  Use it in a `with` block: leaving the block writes the index and the end of the file.

    Args:
        path: The file; it must not exist.
        arrays: The arrays whose frames will be added; frames that they already hold are not written.
        setup: How the recording is made.
        serial: Serial number of the sensor.
        start: Host clock at the start, UTC since 1970; the present time if not given [ns].

    Raises:
        StorageError: If the file exists or cannot be written.
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
        self._names = name_topics(len(arrays))
        self._sequence = [0] * len(arrays)
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._failure: OSError | None = None
        self._file = _File(self.path)
        self._writer = _open_writer(self._file)
        self._channels: dict[str, int] = {}
        monotonic, now = time.monotonic_ns(), time.time_ns()
        labels = Labels(
            setup=setup, arrays=tuple(arrays), serial=serial, start=now if start is None else start, monotonic=monotonic
        )
        try:
            self._write_start(labels)
        except StorageError:
            raise
        except OSError as error:
            raise self._abandon_file(error) from error
        # Flush and fsync run in separate threads: fsync may block for seconds on a slow disk, and meanwhile finished
        # chunks must still be handed to the operating system, where they survive the end of this process.
        tasks = ((_FLUSH_INTERVAL, self._flush), (_SYNC_INTERVAL, lambda: os.fsync(self._file.descriptor)))
        self._threads = [threading.Thread(target=self._repeat, args=task, daemon=True) for task in tasks]
        for thread in self._threads:
            thread.start()

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Complete the file.  An exception that left the `with` block takes precedence over a `StorageError`."""
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
            array: Index of the array.
            clocks: Time of the frame.
            counts: Shape (n,), 0..65535 [-].
            texel_forces: Shape (n,) [N]; None for a real sensor.

        Raises:
            StorageError: If an earlier write failed.
            ValueError: If a count does not fit 16 bits.
        """
        if counts.size and (counts.min() < 0 or counts.max() > _LARGEST_COUNT):
            raise ValueError(f"counts must lie in 0..{_LARGEST_COUNT}, not {counts.min()}..{counts.max()}")
        values = counts.astype(np.uint16)
        name = self._names[array]
        image = ros_messages.encode_image(clocks.time, name, values, self._columns[array])
        frame = ros_messages.FrameMessage(
            host_monotonic=clocks.monotonic,
            ticks=clocks.ticks,
            counts=values,
            texel_forces=np.empty(0) if texel_forces is None else texel_forces,
        )
        sequence = self._sequence[array]
        self._sequence[array] += 1
        self._add(f"/{name}/image", clocks.time, image, sequence)
        self._add(f"/{name}/frame", clocks.time, ros_messages.encode_frame(clocks.time, name, frame), sequence)
        self.frames += array == 0

    def add_raw(self, time_ns: int, data: bytes) -> None:
        """Write bytes as received from a port at a UTC time since 1970 [ns]."""
        self._add(RAW_TOPIC, time_ns, ros_messages.encode_bytes(data))

    def add_gap(self, time_ns: int, text: str) -> None:
        """Write one line about missing frames, noticed at a UTC time since 1970 [ns]."""
        self._add(GAP_TOPIC, time_ns, ros_messages.encode_diagnostics(time_ns, "gap", text))

    def add_temperatures(self, time_ns: int, degrees: npt.ArrayLike) -> None:
        """Write the temperatures of all channels, shape (channels,) [degC], at a UTC time since 1970 [ns]."""
        self._add(TEMPERATURE_TOPIC, time_ns, ros_messages.encode_numbers(degrees))

    def add_force(self, time_ns: int, newtons: float) -> None:
        """Write a reading of a force sensor [N], taken at a UTC time since 1970 [ns]."""
        self._add(FORCE_TOPIC, time_ns, ros_messages.encode_force(time_ns, "force_sensor", newtons))

    def close(self) -> None:
        """Write the index and the end, and close the file; a second call does nothing.

        Raises:
            StorageError: If the file cannot be completed.
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
        self._check_failure()
        self._file.close()

    def _write_start(self, labels: Labels) -> None:
        """Write the header, the types and topics, and the labels."""
        topics = {
            SETUP_TOPIC: ros_messages.TEXT,
            RAW_TOPIC: ros_messages.BYTES,
            GAP_TOPIC: ros_messages.DIAGNOSTICS,
            TEMPERATURE_TOPIC: ros_messages.NUMBERS,
            FORCE_TOPIC: ros_messages.WRENCH,
        }
        for name in self._names:
            topics |= {f"/{name}/image": ros_messages.IMAGE, f"/{name}/frame": ros_messages.FRAME}
        self._writer.start(profile="ros2", library="softcover")
        schemas = {
            kind: self._writer.register_schema(kind, "ros2msg", ros_messages.define_type(kind))
            for kind in dict.fromkeys(topics.values())
        }
        self._channels = {
            topic: self._writer.register_channel(topic, "cdr", schemas[kind]) for topic, kind in topics.items()
        }
        text = encode_labels(labels)
        self._writer.add_metadata("softcover", {"labels": text})
        self._add(SETUP_TOPIC, labels.start, ros_messages.encode_text(text))
        self._writer.flush()

    def _add(self, topic: str, time_ns: int, data: bytes, sequence: int = 0) -> None:
        with self._lock:
            self._check_failure()
            self._writer.add_message(self._channels[topic], time_ns, data, publish_time=time_ns, sequence=sequence)

    def _repeat(self, seconds: float, task: Callable[[], None]) -> None:
        """Run a task at an interval [s] until the file is closed or the task fails."""
        while not self._closed.wait(seconds):
            try:
                task()
            except OSError as error:
                self._failure = self._failure or error
                return

    def _flush(self) -> None:
        with self._lock:
            if not self._closed.is_set():
                self._writer.flush()

    def _check_failure(self) -> None:
        """Raise a `StorageError` if an earlier write failed."""
        if self._failure is not None:
            raise self._abandon_file(self._failure) from self._failure

    def _abandon_file(self, error: OSError) -> StorageError:
        """Cut the file back to its last complete chunk, close it and return an error that says so."""
        self._failure = error
        self._closed.set()
        self._file.cut()
        return StorageError(
            f"{self.path}: the disk takes no more ({error.strerror or error}); the file holds all but the last "
            f"{2 * _FLUSH_INTERVAL:g} s; free some space before the next recording"
        )


class _File:
    """Output of the MCAP library.  Each flush writes to the disk at once; the bytes of a failed flush can be removed.

    The first flush creates the file, so that a killed recorder leaves either no file or one with its set-up.
    """

    def __init__(self, path: Path) -> None:
        self.descriptor = -1
        self._path = path
        self._size = 0
        self._buffer = bytearray()

    def write(self, data: bytes) -> int:
        """Take bytes; they reach the disk with the next flush."""
        self._buffer += data
        return len(data)

    def tell(self) -> int:
        """Position of the next byte in the file."""
        return self._size + len(self._buffer)

    def flush(self) -> None:
        """Write all bytes taken since the last flush."""
        if self.descriptor < 0:
            self._create()
        data, self._buffer = self._buffer, bytearray()
        written = 0
        while written < len(data):
            written += os.write(self.descriptor, memoryview(data)[written:])
        self._size += written

    def cut(self) -> None:
        """Remove what a failed flush wrote, and close the file; a second call does nothing."""
        if self.descriptor >= 0:
            os.ftruncate(self.descriptor, self._size)
            self.close()

    def close(self) -> None:
        """Close the file."""
        os.close(self.descriptor)
        self.descriptor = -1

    def _create(self) -> None:
        try:
            self.descriptor = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except OSError as error:
            raise StorageError(f"{self._path}: cannot be written: {error.strerror}; name a new file") from error


def name_topics(arrays: int) -> list[str]:
    """First part of the topics of each array."""
    return ["tactile"] if arrays == 1 else [f"tactile_{index}" for index in range(arrays)]


def _open_writer(output: _File) -> Writer:
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise MissingExtraError("device", "mcap") from error
    # the library asks for a complete file object but only writes, tells and flushes
    return Writer(cast("IO[bytes]", output), enable_data_crcs=True)
