"""Writes recordings as MCAP files that stay readable if the recorder is killed at any moment.

Five times a second, one thread closes a chunk (group of messages) and passes it to the operating system.  Once a
second, another thread forces the file to the disk (fsync).  A killed recorder leaves a valid file without index and
footer: `mcap_reader.read` reads such a file, and `mcap_reader.recover` completes it.
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

from validation.extras import MissingExtraError
from validation.recordings import ros_messages
from validation.recordings.labels import Labels, encode_labels
from validation.recordings.recording import RecordedArray, Setup

if TYPE_CHECKING:
    from mcap.writer import Writer

    from fastmodel.signal.frame import Frame

#: Topics of the messages in a recording other than frames and images: labels, bytes as received, gaps in the stream of
#: frames, temperatures, readings of the force sensor.
SETUP_TOPIC, RAW_TOPIC, GAP_TOPIC = "/setup", "/raw", "/diagnostics"
TEMPERATURE_TOPIC, FORCE_TOPIC = "/temperatures", "/force"

#: First part of the label of tangential forces; their source follows, see `Frame.tangential_source`.
TANGENTIAL_LABEL = "tangential force x, y [N]: "
#: Time between two chunks, and time between two calls of fsync, which forces the file to the disk [s].
_FLUSH_INTERVAL, _SYNC_INTERVAL = 0.2, 1.0
#: Largest count that a frame message can hold, because its counts are 16 bit numbers [-].
LARGEST_COUNT = 0xFFFF


class StorageError(OSError):
    """Reports that a recording cannot be written, for example to a full disk; the message states what is kept."""


@dataclass(frozen=True, slots=True)
class Clocks:
    """The time of a frame on three clocks.

    Attributes:
        time: Time at which the frame was taken, on the clock of the host, UTC since 1970 [ns].
        monotonic: Time at which the frame arrived, on the monotonic clock of the host [ns]; 0 if unknown.
        ticks: Time on the clock of the device [ticks]; 0 if unknown.
        arrival: Time at which the frame arrived, on the clock of the host, UTC since 1970 [ns]; `time` if unknown.
    """

    time: int
    monotonic: int = 0
    ticks: int = 0
    arrival: int | None = None


class RecordingWriter(AbstractContextManager["RecordingWriter"]):
    """Writes a recording to an MCAP file.  Use it in a `with` block, whose end writes index and footer of the file.

    Args:
        path: The file to write; it must not exist.
        arrays: The arrays whose frames will be added; frames that `arrays` already hold are not written.
        setup: How the recording is made.
        serial: Serial number of the sensor.
        start: Time at the start of the recording, UTC since 1970; the present time if not given [ns].

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
        self._offsets = [array.offset for array in arrays]
        self._names = name_topics(len(arrays))
        self._sequence = [0] * len(arrays)
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._failure: OSError | None = None
        self._file = _File(self.path)
        self._writer = _open_writer(self._file)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
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
        # Flush and fsync run in separate threads.  On a slow disk, fsync may block for seconds.  During this time,
        # finished chunks must still be passed to the operating system; otherwise they are lost if this process ends.
        tasks = ((_FLUSH_INTERVAL, self._flush), (_SYNC_INTERVAL, lambda: os.fsync(self._file.descriptor)))
        self._threads = [threading.Thread(target=self._repeat, args=task, daemon=True) for task in tasks]
        for thread in self._threads:
            thread.start()

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Complete the file.  If the `with` block raised an exception, a `StorageError` does not replace it."""
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
            array: Index of the array among the arrays of the recording.
            clocks: Time of the frame on each clock.
            counts: Counts of the n texels, shape (n,), which the array's offset brings into 0..65535 [-].
            texel_forces: Forces on the texels from a simulation, shape (n,) [N]; None for a real sensor.

        Raises:
            StorageError: If an earlier write failed.
            ValueError: If a count does not fit 16 bits.
        """
        least, most = -self._offsets[array], LARGEST_COUNT - self._offsets[array]
        if counts.size and (counts.min() < least or counts.max() > most):
            raise ValueError(f"counts must lie in {least}..{most}, not {counts.min()}..{counts.max()}")
        values = (counts.astype(np.int64) + self._offsets[array]).astype(np.uint16)
        name = self._names[array]
        pixels = counts.clip(0, LARGEST_COUNT).astype(np.uint16)
        image = ros_messages.encode_image(clocks.time, name, pixels, self._columns[array])
        frame = ros_messages.FrameMessage(
            host_monotonic=clocks.monotonic,
            ticks=clocks.ticks,
            counts=values,
            texel_forces=np.empty(0) if texel_forces is None else texel_forces,
        )
        sequence = self._sequence[array]
        self._sequence[array] += 1
        data = ros_messages.encode_frame(clocks.time, name, frame)
        self._add(f"/{name}/image", clocks.time, image, sequence, arrival=clocks.arrival)
        self._add(f"/{name}/frame", clocks.time, data, sequence, arrival=clocks.arrival)
        self.frames += array == 0

    def add_simulated_frame(self, array: int, clocks: Clocks, frame: Frame) -> None:
        """Write one frame of one simulated array, with all forces and pressures that the frame has.

        Net force and torque are written as a wrench message; pressures and tangential forces as arrays of numbers,
        whose first dimension has a label with their unit and source.

        Args:
            array: Index of the array among the arrays of the recording.
            clocks: Time of the frame on each clock.
            frame: The frame.

        Raises:
            StorageError: If an earlier write failed.
            ValueError: If a count does not fit 16 bits.
        """
        name, number, time_ns = self._names[array], self._sequence[array], clocks.time
        self.add_frame(array, clocks, frame.counts, texel_forces=frame.texel_forces)
        if frame.pressures is not None:
            data = ros_messages.encode_numbers(frame.pressures, "pressure [Pa]")
            self._add(f"/{name}/pressures", time_ns, data, number, kind=ros_messages.NUMBERS)
        if frame.net_force is not None and frame.net_torque is not None:
            data = ros_messages.encode_wrench(time_ns, name, frame.net_force, frame.net_torque)
            self._add(f"/{name}/wrench", time_ns, data, number, kind=ros_messages.WRENCH)
        if frame.tangential is not None:
            data = ros_messages.encode_numbers(frame.tangential, f"{TANGENTIAL_LABEL}{frame.tangential_source}")
            self._add(f"/{name}/tangential", time_ns, data, number, kind=ros_messages.NUMBERS)

    def add_raw(self, time_ns: int, data: bytes) -> None:
        """Write bytes that were received from a port at `time_ns`, UTC since 1970 [ns], without parsing them."""
        self._add(RAW_TOPIC, time_ns, ros_messages.encode_bytes(data))

    def add_gap(self, time_ns: int, text: str) -> None:
        """Write one line of text on missing frames that were noticed at `time_ns`, UTC since 1970 [ns]."""
        self._add(GAP_TOPIC, time_ns, ros_messages.encode_diagnostics(time_ns, "gap", text))

    def add_temperatures(self, time_ns: int, degrees: npt.ArrayLike) -> None:
        """Write the temperatures of all channels, shape (channels,) [degC], at `time_ns`, UTC since 1970 [ns]."""
        self._add(TEMPERATURE_TOPIC, time_ns, ros_messages.encode_numbers(degrees))

    def add_force(self, time_ns: int, newtons: float) -> None:
        """Write a reading of a force sensor [N] that was taken at `time_ns`, UTC since 1970 [ns]."""
        self._add(FORCE_TOPIC, time_ns, ros_messages.encode_wrench(time_ns, "force_sensor", (0.0, 0.0, newtons)))

    def close(self) -> None:
        """Write index and footer, and close the file; a second call does nothing.

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
        """Write the header of the file, the message types and topics, and the labels of the recording."""
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
        self._schemas = {
            kind: self._writer.register_schema(kind, "ros2msg", ros_messages.define_type(kind))
            for kind in dict.fromkeys(topics.values())
        }
        self._channels = {
            topic: self._writer.register_channel(topic, "cdr", self._schemas[kind]) for topic, kind in topics.items()
        }
        text = encode_labels(labels)
        self._writer.add_metadata("softcover", {"labels": text})
        self._add(SETUP_TOPIC, labels.start, ros_messages.encode_text(text))
        self._writer.flush()

    def _add(
        self, topic: str, time_ns: int, data: bytes, sequence: int = 0, *, kind: str = "", arrival: int | None = None
    ) -> None:
        """Write an encoded message to a topic.

        Args:
            topic: The topic.
            time_ns: Time of the message, UTC since 1970 [ns].
            data: The message.
            sequence: Number of the message in its topic.
            kind: Type of the message, for a topic that the head of the file does not announce.
            arrival: Time at which the message arrived, UTC since 1970 [ns]; `time_ns` if not given.
        """
        with self._lock:
            self._check_failure()
            if topic not in self._channels:
                self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind])
            logged = time_ns if arrival is None else arrival
            self._writer.add_message(self._channels[topic], logged, data, publish_time=time_ns, sequence=sequence)

    def _repeat(self, seconds: float, task: Callable[[], None]) -> None:
        """Run a task every `seconds` [s] until the file is closed or the task raises `OSError`."""
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
        """Truncate the file after its last complete chunk, close it, and return the error to raise."""
        self._failure = error
        self._closed.set()
        self._file.cut()
        return StorageError(
            f"{self.path}: the disk takes no more ({error.strerror or error}); the file holds all but the last "
            f"{2 * _FLUSH_INTERVAL:g} s; free some space before the next recording"
        )


class _File:
    """Output file for the mcap library: collects bytes in memory and writes them when `flush` is called.

    Bytes of a failed flush can be removed from the file.  The first flush creates the file, so that a killed recorder
    leaves either no file or a file with its labels.
    """

    def __init__(self, path: Path) -> None:
        self.descriptor = -1
        self._path = path
        self._size = 0
        self._buffer = bytearray()

    def write(self, data: bytes) -> int:
        """Append bytes to the buffer, which the next flush writes to the file; return their number."""
        self._buffer += data
        return len(data)

    def tell(self) -> int:
        """Return the position of the next byte in the file, including the bytes in the buffer."""
        return self._size + len(self._buffer)

    def flush(self) -> None:
        """Write the buffered bytes to the file, which the first call creates."""
        if self.descriptor < 0:
            try:
                self.descriptor = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
            except OSError as error:
                raise StorageError(f"{self._path}: cannot be written: {error.strerror}; name a new file") from error
        data, self._buffer = self._buffer, bytearray()
        written = 0
        while written < len(data):
            written += os.write(self.descriptor, memoryview(data)[written:])
        self._size += written

    def cut(self) -> None:
        """Remove the bytes that a failed flush wrote, and close the file; a second call does nothing."""
        if self.descriptor >= 0:
            os.ftruncate(self.descriptor, self._size)
            self.close()

    def close(self) -> None:
        """Close the file."""
        os.close(self.descriptor)
        self.descriptor = -1


def name_topics(arrays: int) -> list[str]:
    """Return the first part of the topics of each array: `tactile`, or `tactile_0`, `tactile_1`, ... for several."""
    return ["tactile"] if arrays == 1 else [f"tactile_{index}" for index in range(arrays)]


def _open_writer(output: _File) -> Writer:
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise MissingExtraError("mcap") from error
    # `Writer` is declared to need a complete file object, but it only calls `write`, `tell` and `flush`.
    return Writer(cast("IO[bytes]", output), enable_data_crcs=True)
