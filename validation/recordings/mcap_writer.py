"""Writes recordings as MCAP files that stay readable if the recorder is killed at any moment.

Five times a second, one thread closes a chunk (group of messages) and passes it to the operating system.  Once a
second, another thread forces the file to the disk (fsync).  A killed recorder leaves a valid file without index and
footer: `mcap_reader.read` reads such a file, and `mcap_reader.recover` completes it.

The messages are ROS 2 messages in their binary format, CDR. Images, diagnostics, temperatures and forces use standard
types, so that Foxglove and ROS 2 tools display them.  No standard type holds a frame with the clocks of host and
device.  The type of this program is therefore defined in every file, as is usual in ROS 2 recordings.

Labels (set-up, arrays, serial number and clocks) are a JSON object, in a message and in the metadata of the file.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Any, cast

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationError

from meshes import TexelArray
from meshes.array import check_texel_count
from meshes.bounded_file import parse_json
from validation.extras import MissingExtraError
from validation.json_values import json_text
from validation.recordings.recording import (
    LATEST,
    MOST_ARRAYS,
    MOST_FULL_SCALE,
    RecordedArray,
    RecordingError,
    Setup,
)

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

    from fastmodel.signal.frame import Frame

#: Topic of the labels of a recording.
SETUP_TOPIC = "/setup"
#: Topic of the bytes as the sensor sent them.
RAW_TOPIC = "/raw"
#: Topic of messages about gaps in the stream of frames.
GAP_TOPIC = "/diagnostics"
#: Topic of temperatures.
TEMPERATURE_TOPIC = "/temperatures"
#: Topic of the readings of a force sensor.
FORCE_TOPIC = "/force"
#: Name of the ROS 2 type of a frame message.
FRAME = "softcover_msgs/msg/TactileFrame"
#: Definition of the ROS 2 type of a frame message.
FRAME_DEFINITION = """std_msgs/Header header
uint64 host_monotonic
uint32 device_ticks
uint16[] counts
float64[] texel_forces
"""
#: ROS 2 type of the messages of each topic.  A topic of one array, such as `/left/image`, has the key of its last part,
#: `image`.
KINDS = {
    SETUP_TOPIC: "std_msgs/msg/String",
    RAW_TOPIC: "std_msgs/msg/UInt8MultiArray",
    GAP_TOPIC: "diagnostic_msgs/msg/DiagnosticArray",
    TEMPERATURE_TOPIC: "std_msgs/msg/Float64MultiArray",
    FORCE_TOPIC: "geometry_msgs/msg/WrenchStamped",
    "image": "sensor_msgs/msg/Image",
    "frame": FRAME,
    "pressures": "std_msgs/msg/Float64MultiArray",
    "wrench": "geometry_msgs/msg/WrenchStamped",
    "tangential": "std_msgs/msg/Float64MultiArray",
}
#: First part of the label of tangential forces; their source follows, see `Frame.tangential_source`.
TANGENTIAL_LABEL = "tangential force x, y [N]: "
#: Time between two chunks of the file [s].
_FLUSH_INTERVAL = 0.2
#: Time between two calls of fsync, which forces the file to the disk [s].
_SYNC_INTERVAL = 1.0
#: Largest count that a frame message can hold, because its counts are 16 bit numbers [-].
LARGEST_COUNT = 0xFFFF
#: Level of a ROS diagnostic status that marks a warning.
_WARNING = 1


#: Name and version of the format of the labels; files with another name or version are refused.
FORMAT = "softcover-recording/1"
#: Largest accepted number of characters of the labels [-].
_MOST_CHARACTERS = 2**20
#: Number of faults in the labels above which an error message names no single fault [-].
_MOST_FAULTS = 1000

#: A length [m] or an angle [rad]; values beyond the limits indicate a wrong unit.
_Coordinate = Annotated[float, Field(ge=-1000.0, le=1000.0)]
_Pair = tuple[_Coordinate, _Coordinate]
_Triple = tuple[_Coordinate, _Coordinate, _Coordinate]
_Nanoseconds = Annotated[int, Field(ge=0, le=LATEST)]
#: Booleans, stored in the file as text of the digits 0 and 1.
_Mask = Annotated[Any, PlainValidator(lambda text: np.array([digit == "1" for digit in text]))]


class _Table(BaseModel):
    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False)


class ArrayLabels(_Table):
    """Labels of one texel array in a recording: layout, masks, full scale and pose."""

    name: str
    rows: int
    columns: int
    pitch_m: _Pair
    texel_size_m: _Pair
    active: _Mask
    enabled: _Mask
    full_scale: int = Field(ge=1, le=MOST_FULL_SCALE)
    offset: int = Field(default=0, ge=0, le=0xFFFF)
    unit: str
    centre_m: _Triple
    rotation_rad: _Triple

    def make(self) -> RecordedArray:
        """Make the recorded array that the labels describe, without frames.

        Raises:
            ValueError: If a number is impossible, or a mask has another size than the array.
        """
        check_texel_count(self.rows, self.columns)
        if len(self.enabled) != self.rows * self.columns:
            raise ValueError(f"a mask of {len(self.enabled)} texels; expected {self.rows} x {self.columns}")
        size, active = self.texel_size_m, self.active
        return RecordedArray(
            texels=TexelArray.grid(
                self.rows, self.columns, self.pitch_m, texel_size=size, active=active, name=self.name
            ),
            enabled=self.enabled,
            counts=np.empty((0, len(self.enabled)), dtype=np.int32),
            full_scale=self.full_scale,
            offset=self.offset,
            unit=self.unit,
            centre=self.centre_m,
            rotation=self.rotation_rad,
        )


class ClockLabels(_Table):
    """Time at the start of the recording: UTC since 1970, and on the monotonic clock of the host [ns]."""

    start_ns: _Nanoseconds
    monotonic_ns: _Nanoseconds


class Labels(_Table):
    """All labels of a recording: serial number, arrays, clocks and conditions."""

    format: str
    serial: str
    arrays: tuple[ArrayLabels, ...]
    clock: ClockLabels
    setup: Setup


def encode_labels(
    setup: Setup, arrays: tuple[RecordedArray, ...], *, serial: str = "", start: int = 0, monotonic: int = 0
) -> str:
    """Return labels as the text of a JSON object.

    Args:
        setup: Indenter, load and notes of the recording.
        arrays: The texel arrays; their frames are left out.
        serial: Serial number of the sensor.
        start: Time at the start of the recording, UTC since 1970 [ns].
        monotonic: Time at the start of the recording, on the monotonic clock of the host [ns].
    """
    described = [
        {
            "name": array.texels.name,
            "rows": array.texels.rows,
            "columns": array.texels.columns,
            "pitch_m": array.texels.pitch,
            "texel_size_m": array.texels.texel_size,
            "active": "".join(map(str, array.texels.active.astype(int))),
            "enabled": "".join(map(str, array.enabled.astype(int))),
            "full_scale": array.full_scale,
            "offset": array.offset,
            "unit": array.unit,
            "centre_m": array.centre,
            "rotation_rad": array.rotation,
        }
        for array in arrays
    ]
    clock = {"start_ns": start, "monotonic_ns": monotonic}
    stated = {key: value for key, value in vars(setup).items() if key != "other" or value}
    labels = {"format": FORMAT, "serial": serial, "arrays": described, "clock": clock, "setup": stated}
    return json_text(labels, indent=None)


def decode_labels(text: str, path: Path) -> tuple[Labels, tuple[RecordedArray, ...]]:
    """Parse the text of the JSON object that `encode_labels` returns; return the labels and the arrays without frames.

    Args:
        text: Text of the JSON object.
        path: The file that holds the text, for error messages.

    Raises:
        RecordingError: If the text does not hold labels of a recording.
    """
    if len(text) > _MOST_CHARACTERS:
        raise RecordingError(f"{path}: its labels have {len(text)} characters; at most {_MOST_CHARACTERS} are accepted")
    try:
        entries = parse_json(text)
        name = entries["format"]
        if len(entries["arrays"]) > MOST_ARRAYS:
            raise ValueError(f"{len(entries['arrays'])} arrays; at most {MOST_ARRAYS} are accepted")  # noqa: TRY301
        if name == FORMAT:
            labels = Labels.model_validate_json(text)
            return labels, tuple(each.make() for each in labels.arrays)
    except ValidationError as error:
        faults = error.errors(include_url=False, include_input=False) if error.error_count() <= _MOST_FAULTS else []
        fault = f"{'.'.join(map(str, faults[0]['loc']))}: {faults[0]['msg']}" if faults else "faults everywhere"
        raise RecordingError(f"{path}: its labels cannot be read: {fault}; expected {FORMAT!r}") from error
    except (ArithmeticError, KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{path}: its labels cannot be read: {error}; expected {FORMAT!r}") from error
    raise RecordingError(f"{path}: its labels have the format {str(name)[:40]!r}; accepted: {FORMAT!r}")


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


@cache
def load_types() -> Typestore:
    """Load the standard ROS 2 message types and that of frame messages.

    Raises:
        MissingExtraError: If rosbags is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise MissingExtraError("rosbags") from error
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(FRAME_DEFINITION, FRAME))
    return types


def find_kind(topic: str) -> str | None:
    """Return the ROS 2 type of the messages of a topic of a recording; None for any other topic."""
    return KINDS.get(topic) or KINDS.get(topic.rpartition("/")[2])


def encode(kind: str, /, **fields: object) -> bytes:
    """Encode a message in CDR.

    Args:
        kind: ROS 2 type of the message.
        fields: Values of the fields of the message; a mapping represents a message within the message.
    """
    return bytes(load_types().serialize_cdr(_make_message(kind, fields), kind))


def _make_message(kind: str, fields: Mapping[str, Any]) -> object:
    types, made = load_types(), dict(fields)
    for name, (_, detail) in types.fielddefs[kind][1]:
        value = made[name]
        if isinstance(value, Mapping):
            made[name] = _make_message(str(detail), value)
        elif isinstance(value, list):
            ((_, inner), _) = cast("tuple[tuple[object, str], object]", detail)
            made[name] = [_make_message(inner, each) for each in value]
    return types.types[kind](**made)


def _make_header(time_ns: int, name: str) -> Mapping[str, object]:
    """Return the header of a message at a time, UTC since 1970 [ns], in the coordinate frame `name`."""
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": name}


def _make_numbers(values: npt.ArrayLike, label: str = "") -> Mapping[str, object]:
    """Return the fields of a ROS multi-array message; `label` states the meaning of the numbers."""
    numbers = np.asarray(values, dtype=np.float64)
    sizes = numbers.shape if label else ()
    sides: list[Mapping[str, object]] = [
        {"label": "" if axis else label, "size": size, "stride": int(np.prod(sizes[axis:]))}
        for axis, size in enumerate(sizes)
    ]
    return {"layout": {"dim": sides, "data_offset": 0}, "data": numbers.ravel()}


def _make_wrench(force: npt.ArrayLike, torque: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Mapping[str, object]:
    """Return the fields of a wrench: force [N] and torque about the origin of the coordinate frame [N m]."""
    given = {"force": force, "torque": torque}
    return {name: dict(zip("xyz", map(float, np.asarray(each)), strict=True)) for name, each in given.items()}


@contextmanager
def _hold_interrupts() -> Iterator[None]:
    """Hold Ctrl-C and SIGTERM back until the `with` block ends: an exception within a record would tear its chunk."""
    held: list[int] = []
    is_main = threading.current_thread() is threading.main_thread()  # Only the main thread handles signals.
    handlers = [(number, signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM) if is_main]
    before = {number: handler for number, handler in handlers if handler is not None}  # None is another library's
    try:
        for number in before:
            signal.signal(number, lambda caught, _: held.append(caught))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for caught in held[:1]:
            signal.raise_signal(caught)


class RecordingWriter(AbstractContextManager["RecordingWriter"]):
    """Writes a recording to an MCAP file.  Use it in a `with` block, whose end writes index and footer of the file.

    Args:
        path: The file to write; it must not exist.
        arrays: The arrays whose frames will be added; frames that `arrays` already hold are not written.
        setup: Indenter, load and notes of the recording.
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
        try:
            from mcap.writer import Writer
        except ImportError as error:
            raise MissingExtraError("mcap") from error
        self.path = Path(path)
        self.frames = 0
        self._arrays = tuple(arrays)
        self._names = name_topics(len(arrays))
        self._sequence = [0] * len(arrays)
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._failure: OSError | None = None
        self._file = _File(self.path)
        # `Writer` is declared to need a complete file object, but it only calls `write`, `tell` and `flush`.
        self._writer = Writer(cast("IO[bytes]", self._file), enable_data_crcs=True)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        monotonic, now = time.monotonic_ns(), time.time_ns() if start is None else start
        labels = encode_labels(setup, self._arrays, serial=serial, start=now, monotonic=monotonic)
        try:
            self._writer.start(profile="ros2", library="softcover")
            topics = [topic for topic in KINDS if topic.startswith("/")]
            for topic in topics + [f"/{name}/{end}" for name in self._names for end in ("image", "frame")]:
                self._register(topic)
            self._writer.add_metadata("softcover", {"labels": labels})
            self._add(SETUP_TOPIC, now, {"data": labels})
            self._writer.flush()
        except StorageError:
            raise
        except OSError as error:
            raise self._abandon_file(error) from error
        # Flush and fsync run in separate threads.  On a slow disk, fsync may block for seconds.  During this time,
        # finished chunks must still be passed to the operating system, because they are lost if this process ends.
        tasks = ((_FLUSH_INTERVAL, self._flush), (_SYNC_INTERVAL, lambda: os.fsync(self._file.descriptor)))
        self._threads = [threading.Thread(target=self._repeat, args=task, daemon=True) for task in tasks]
        for thread in self._threads:
            thread.start()

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Complete the file; an exception of the `with` block takes precedence over a `StorageError`."""
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
        offset, columns, name = self._arrays[array].offset, self._arrays[array].texels.columns, self._names[array]
        least, most = -offset, LARGEST_COUNT - offset
        if counts.size and (counts.min() < least or counts.max() > most):
            raise ValueError(f"counts must lie in {least}..{most}, not {counts.min()}..{counts.max()}")
        header, number = _make_header(clocks.time, name), self._sequence[array]
        self._sequence[array] += 1
        pixels = np.ascontiguousarray(counts.clip(0, LARGEST_COUNT), dtype="<u2")
        # The first row of the image has the smallest y.
        image = {
            "header": header,
            "height": pixels.size // columns,
            "width": columns,
            "encoding": "mono16",
            "is_bigendian": 0,
            "step": 2 * columns,
            "data": pixels.view(np.uint8),
        }
        frame = {
            "header": header,
            "host_monotonic": clocks.monotonic,
            "device_ticks": clocks.ticks,
            "counts": (counts.astype(np.int64) + offset).astype(np.uint16),
            "texel_forces": np.empty(0) if texel_forces is None else texel_forces,
        }
        self._add(f"/{name}/image", clocks.time, image, number, arrival=clocks.arrival)
        self._add(f"/{name}/frame", clocks.time, frame, number, arrival=clocks.arrival)
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
        name, number, when = self._names[array], self._sequence[array], clocks.time
        self.add_frame(array, clocks, frame.counts, texel_forces=frame.texel_forces)
        if frame.pressures is not None:
            self._add(f"/{name}/pressures", when, _make_numbers(frame.pressures, "pressure [Pa]"), number)
        if frame.net_force is not None and frame.net_torque is not None:
            wrench = _make_wrench(frame.net_force, frame.net_torque)
            self._add(f"/{name}/wrench", when, {"header": _make_header(when, name), "wrench": wrench}, number)
        if frame.tangential is not None:
            label = f"{TANGENTIAL_LABEL}{frame.tangential_source}"
            self._add(f"/{name}/tangential", when, _make_numbers(frame.tangential, label), number)

    def add_raw(self, time_ns: int, data: bytes) -> None:
        """Write bytes that were received from a port at `time_ns`, UTC since 1970 [ns], without parsing them."""
        layout = {"dim": [], "data_offset": 0}
        self._add(RAW_TOPIC, time_ns, {"layout": layout, "data": np.frombuffer(data, dtype=np.uint8)})

    def add_gap(self, time_ns: int, text: str) -> None:
        """Write one line of text on missing frames that were noticed at `time_ns`, UTC since 1970 [ns]."""
        status = {"level": _WARNING, "name": "gap", "message": text, "hardware_id": "", "values": []}
        self._add(GAP_TOPIC, time_ns, {"header": _make_header(time_ns, "gap"), "status": [status]})

    def add_temperatures(self, time_ns: int, degrees: npt.ArrayLike) -> None:
        """Write the temperatures of all channels, shape (channels,) [degC], at `time_ns`, UTC since 1970 [ns]."""
        self._add(TEMPERATURE_TOPIC, time_ns, _make_numbers(degrees))

    def add_force(self, time_ns: int, newtons: float) -> None:
        """Write a reading of a force sensor [N] that was taken at `time_ns`, UTC since 1970 [ns]."""
        wrench = _make_wrench((0.0, 0.0, newtons))
        self._add(FORCE_TOPIC, time_ns, {"header": _make_header(time_ns, "force_sensor"), "wrench": wrench})

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

    def _register(self, topic: str) -> None:
        """Write the description of a topic to the file, and that of its message type if the type is new in the file."""
        kind = find_kind(topic) or ""
        if kind not in self._schemas:
            definition = load_types().generate_msgdef(kind, ros_version=2)[0].encode()
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition)
        self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind])

    def _add(
        self,
        topic: str,
        time_ns: int,
        fields: Mapping[str, object],
        sequence: int = 0,
        *,
        arrival: int | None = None,
    ) -> None:
        """Write a message to a topic.

        Args:
            topic: The topic.
            time_ns: Time of the message, UTC since 1970 [ns].
            fields: Fields of the message.
            sequence: Number of the message in its topic.
            arrival: Time at which the message arrived, UTC since 1970 [ns]; `time_ns` if not given.
        """
        data = encode(find_kind(topic) or "", **fields)
        with _hold_interrupts(), self._lock:
            self._check_failure()
            if topic not in self._channels:
                self._register(topic)
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
