"""Data types that every reader of recordings returns.

A `Recording` holds the frames of one file: the counts of each texel array over time.  It also holds temperatures,
readings of a force sensor and a `Setup`, which states how the recording was made, if the file has them.
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import IO, Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict

from fastmodel.signal.electronics import grey_levels
from fastmodel.signal.frame import Frame
from meshes import TexelArray
from meshes.bounded_file import FileLimitError, open_regular
from validation.errors import InputError

FloatArray = npt.NDArray[np.float64]
ClockArray = npt.NDArray[np.int64]
CountArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]

#: Pitch of the texels that is assumed if a file does not state it: that of the Weiss arrays [m].
DEFAULT_PITCH = 3.4e-3
#: Label of a recording whose file states no pitch, and its value.
PITCH_ASSUMED = "pitch assumed"
PITCH_LABEL = {PITCH_ASSUMED: f"{1e3 * DEFAULT_PITCH:g} mm"}
#: Largest count that is assumed if a file does not state it: that of a 12 bit converter [-].
DEFAULT_FULL_SCALE = 4095
#: Change of a count over the full scale, above which a texel counts as pressed during a recording [-].
_PRESSED_SHARE = 0.02
#: Tolerance of a coordinate of a texel centre when two arrays are compared [m].
_SAME_POSITION = 1e-6
#: A nanosecond [s].
NANOSECOND = 1e-9


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits on the content read from one recording.

    Attributes:
        kept: Number of bytes that may be kept of a recording, besides a multiple of the size of the file.
        ratio: Number of bytes that may be kept for each byte of the file [-].  Frames of an idle sensor unpack to 30
            times their size in the file.
        records: Number of records that may be unpacked, besides one for each byte of the file [-].  Reading this number
            takes seconds.
        message: Memory that a kept message takes besides its data [bytes].
        files: Number of files of a bag [-].
        seconds: Processor time to read a recording, besides that for its size [s].
        rate: Bytes of the file for which another second is granted [bytes / s].  Readers are at least ten times faster.
    """

    kept: int = 2**28
    ratio: int = 64
    records: int = 2**17
    message: int = 300
    files: int = 1000
    seconds: float = 5.0
    rate: int = 2**14


LIMITS = Limits()

#: Largest accepted number of texel arrays in a recording [-].
MOST_ARRAYS = 64
#: Largest full scale [-].  Counts are kept as signed 32-bit numbers.
MOST_FULL_SCALE = 2**31 - 1
#: Latest time, in the year 2262 [ns since 1970].  It is the largest that 64 bits hold.
LATEST = 2**63 - 1


class RecordingError(ValueError):
    """Reports that a recording cannot be read or used; the message names the file, the fault and what is accepted."""


@dataclass(frozen=True, kw_only=True)
class Setup:
    """Conditions of a recording.

    Attributes:
        indenter: The indenter as text in the notation of the command line, e.g. `box:size=10.5mmx10.5mmx5mm`.
        load: Load on the array, the weight or force of the indenter [N]; None if unknown.
        note: Further remarks.
        source: Port or file of the frames.
        source_sha256: SHA-256 hash of the source file, hexadecimal; empty for a port.
        device: Properties that the sensor reported: type, serial, firmware, threshold, gain, temperature.
        other: Other labels of the file by key, such as unknown keys of a CSV file.
    """

    indenter: str = ""
    load: float | None = None
    note: str = ""
    source: str = ""
    source_sha256: str = ""
    #: Options for reading the labels of a file.
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", strict=True)

    device: Mapping[str, str | bool | int | float] = field(default_factory=dict)
    other: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, indenter: str, load: str | None, note: str) -> Self:
        """Read the conditions of a recording from text.

        Args:
            indenter: Shape of the indenter, for example `sphere:radius=5mm`; empty if unknown.
            load: Load or weight with its unit; None if unknown.
            note: Further remarks.

        Raises:
            InputError: If the indenter or the load cannot be read.
        """
        from validation.text.indenter import read_indenter, read_load

        if indenter:
            read_indenter(indenter)
        return cls(indenter=indenter, load=None if load is None else read_load(load), note=note)

    def __post_init__(self) -> None:
        """Check that the load is a force of 0 N or more.

        Raises:
            ValueError: If the load is negative or not finite.
        """
        if self.load is not None and not (np.isfinite(self.load) and self.load >= 0):
            raise ValueError(f"a load is a force of 0 N or more, not {self.load}")


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedForces:
    """The forces of every frame of a simulated array; NaN where the file does not hold a value.

    `fastmodel.Frame` describes the values and their signs.

    Attributes:
        texel_forces: Force on each texel, shape (frames, n) [N].
        pressures: Mean pressure on each texel, shape (frames, n) [Pa].
        net_force: Force of all contacts on the array, shape (frames, 3) [N].
        net_torque: Torque of all contacts about the origin of the array's frame, shape (frames, 3) [N m].
        tangential: Tangential force on each texel, shape (frames, n, 2) [N].
        tangential_source: Method by which the tangential forces were computed; empty if there are none.
    """

    texel_forces: FloatArray
    pressures: FloatArray
    net_force: FloatArray
    net_torque: FloatArray
    tangential: FloatArray
    tangential_source: str = ""

    def select(self, number: int) -> dict[str, Any]:
        """Return the values of one frame by their names in `Frame`, without missing values."""
        names = ("texel_forces", "net_force", "net_torque", "tangential")
        values = {name: getattr(self, name)[number].copy() for name in names}
        given = {name: value for name, value in values.items() if not np.isnan(value).any()}
        return given | {"tangential_source": self.tangential_source}


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedArray:
    """One texel array of a recording and its frames.

    Attributes:
        texels: The array of n texels; texels that the hardware lacks are not active.
        enabled: Whether each texel was switched on during the recording (the dynamic mask), shape (n,).
        counts: Counts of each texel in each frame, shape (frames, n) [-]; negative if a zero was subtracted (tare).
        full_scale: Largest count that the converter of the sensor can give [-].
        offset: Number that MCAP files add to the counts, because they hold no negative numbers [-].
        unit: Name of the unit of the counts in the file.
        centre: Position x, y, z of the array in the frame of the sensor's drawing [m].
        rotation: Rotation of the array about the axes x, y and z of the sensor's drawing [rad].
        simulated: Forces of the frames of a simulated array; None for a real sensor.
    """

    texels: TexelArray
    enabled: BoolArray
    counts: CountArray
    full_scale: int
    offset: int = 0
    unit: str = "counts"
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    simulated: SimulatedForces | None = None

    def make_frame(self, number: int, time: float) -> Frame:
        """Make the frame of an index, with grey levels whose white is `full_scale`, and forces if there are any.

        Args:
            number: Index of the frame.
            time: Time of the frame [s].
        """
        counts = self.counts[number].astype(np.int64)
        image = grey_levels(counts, self.full_scale).reshape(self.texels.rows, self.texels.columns)
        forces = {} if self.simulated is None else self.simulated.select(number)
        return Frame(time=time, counts=counts, image=image, texel_area=float(np.prod(self.texels.texel_size)), **forces)

    def has_layout_of(self, array: TexelArray) -> bool:
        """Return whether rows, columns, texel centres (within 1 um) and active texels equal those of `array`."""
        mine = self.texels
        return (
            (mine.rows, mine.columns) == (array.rows, array.columns)
            and np.allclose(mine.centres, array.centres, rtol=0, atol=_SAME_POSITION)
            and bool((mine.active == array.active).all())
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """The frames of one file, with all other data in the file.

    Attributes:
        path: The file or folder of the recording.
        sha256: SHA-256 hash of the file's bytes, hexadecimal.
        serial: Serial number of the sensor.
        started: Date and time of the first frame, UTC, by the clock of the host.
        times: Time of each frame from the first frame, shape (frames,) [s].  `softcover record` fits these times to the
            device's clock.
        arrays: The texel arrays with their counts, in the order of the file.
        temperatures: Temperatures of all channels at each reading, shape (readings, channels) [degC].
        temperature_times: Time of each temperature reading from the first frame, shape (readings,) [s].
        setup: Indenter, load and notes of the recording.
        gaps: One line for each place where frames are missing, noted during the recording.
        complete: Whether the file was closed properly.  If the recorder was killed, up to half a second is missing.
        host_monotonic: Time at which each frame arrived on the monotonic clock of the host, shape (frames,) [ns]; empty
            or 0 if unknown.
        ticks: Time of each frame on the clock of the device, shape (frames,) [ticks]; empty or 0 if unknown.
        forces: Readings of a force sensor, shape (readings,) [N].
        force_times: Time of each reading of the force sensor from the first frame, shape (readings,) [s].
    """

    path: Path
    sha256: str
    serial: str = ""
    started: datetime
    times: FloatArray
    arrays: tuple[RecordedArray, ...]
    temperatures: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    temperature_times: FloatArray = field(default_factory=lambda: np.empty(0))
    setup: Setup = field(default_factory=Setup)
    gaps: tuple[str, ...] = ()
    complete: bool = True
    host_monotonic: ClockArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    ticks: ClockArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    forces: FloatArray = field(default_factory=lambda: np.empty(0))
    force_times: FloatArray = field(default_factory=lambda: np.empty(0))

    @property
    def seconds(self) -> float:
        """Time from the first frame to the last [s]; 0 without frames."""
        return float(self.times[-1]) if len(self.times) else 0.0

    @property
    def arrival_delays(self) -> FloatArray:
        """Time from each frame's stamp to its arrival, without the part that all frames share, shape (frames,) [s].

        The shape is (0,) if the recording does not hold the times at which frames arrived.
        """
        arrivals = self.host_monotonic
        if not arrivals.size or not arrivals.all():
            return np.empty(0)
        delays = arrivals * NANOSECOND - self.times
        return np.asarray(delays - delays.min(), dtype=np.float64)

    @property
    def frame_rate(self) -> float:
        """Mean number of frames per second [Hz]; NaN for fewer than two frames."""
        span = self.times[-1] - self.times[0] if len(self.times) > 1 else 0.0
        return float((len(self.times) - 1) / span) if span > 0 else float("nan")


def make_array(
    rows: int,
    columns: int,
    counts: CountArray | None = None,
    *,
    pitch: tuple[float, float] = (DEFAULT_PITCH, DEFAULT_PITCH),
    full_scale: int = DEFAULT_FULL_SCALE,
    active: BoolArray | None = None,
    name: str = "tactile",
) -> RecordedArray:
    """Make a recorded rectangular array, centred at the origin.

    Args:
        rows: Number of texels along y [-].
        columns: Number of texels along x [-].
        counts: Counts of each frame, shape (frames, rows * columns) [-]; no frames if not given.
        pitch: Distance between texel centres along x and y [m].
        full_scale: Largest count that the converter can give [-].
        active: Whether each texel exists, shape (rows * columns,); all if not given.
        name: Name of the array.
    """
    return RecordedArray(
        texels=TexelArray.grid(rows, columns, pitch, active=active, name=name),
        enabled=np.ones(rows * columns, dtype=bool),
        counts=np.empty((0, rows * columns), dtype=np.int32) if counts is None else counts,
        full_scale=full_scale,
    )


def find_pressed_array(recording: Recording) -> int:
    """Return the index of the array with the largest load.

    This is the array with the texel whose count changes most during the recording, of those that measure.  If no count
    changes by more than `_PRESSED_SHARE` of the full scale, it is the array with the texel whose count is farthest
    above the median of its array.  A load that rests on an array during the whole recording is then found as well.
    """
    measured = [array.counts[:, array.enabled & array.texels.active] for array in recording.arrays]
    arrays = [(c.astype(np.int64), array.full_scale) for c, array in zip(measured, recording.arrays, strict=True)]
    changes = [float(np.ptp(counts, axis=0).max(initial=0)) / scale if counts.size else 0.0 for counts, scale in arrays]
    if max(changes) <= _PRESSED_SHARE:
        changes = [float(counts.max() - np.median(counts)) / scale if counts.size else 0.0 for counts, scale in arrays]
    return int(np.argmax(changes))


def convert_to_utc(nanoseconds: int) -> datetime:
    """Convert a time since 1970 [ns] to a date, rounded down to microseconds.

    Raises:
        OverflowError: If the date lies after the year 9999.
    """
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=nanoseconds // 1000)


def count_seconds(times: Sequence[int], start: int) -> FloatArray:
    """Convert times [ns] to times from a start [ns], in seconds, shape (times,) [s]."""
    return (np.array(times, dtype=np.int64) - start).astype(np.float64) * NANOSECOND


def hash_contents(path: Path) -> str:
    """Return the hexadecimal SHA-256 hash of the bytes of a file, or of all files below a folder, sorted by path."""
    digest = hashlib.sha256()
    files = sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]
    for each in files:
        with each.open("rb") as file:
            hashlib.file_digest(file, lambda: digest)
    return digest.hexdigest()


def open_recorded(path: Path, expected: str = "a recording") -> IO[bytes]:
    """Open the file of a recording; it must be a regular file.

    Args:
        path: The file.
        expected: What it should be, in words.

    Raises:
        RecordingError: If the file is missing, cannot be read or is no regular file.
    """
    try:
        return open_regular(path)
    except (FileNotFoundError, IsADirectoryError):
        raise RecordingError(f"{path}: no such file; expected {expected}") from None
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}; expected {expected}") from error
    except FileLimitError as error:
        raise RecordingError(f"{path}: {error}") from None


@contextlib.contextmanager
def limit_time(path: Path) -> Iterator[None]:
    """Limit the processor time to read a recording, by a timer of the operating system.

    The limit holds for content unpacked by any library, in the main thread and where there are timers (not on Windows).

    Args:
        path: The file or folder.

    Raises:
        RecordingError: If reading takes longer than the limit for a recording of its size.
    """
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return
    files = itertools.islice(path.iterdir(), LIMITS.files) if path.is_dir() else [path]
    seconds = LIMITS.seconds + sum(file.stat().st_size for file in files if file.exists()) / LIMITS.rate

    def stop(*_: object) -> None:
        raise RecordingError(f"{path}: takes more than the {seconds:.0f} s of processor time accepted for its size")

    earlier = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds, 1.0)  # again each second, as libraries may swallow an exception
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, earlier)


class Budget:
    """Limits on the content read from one recording: numbers of records and unpacked bytes, and range of times."""

    def __init__(self, path: Path, size: int) -> None:
        """Start with the limits for a recording of a given size [bytes]."""
        self._path = path
        self._bytes, self._records = LIMITS.kept + LIMITS.ratio * size, LIMITS.records + size

    def spend(self, *, size: int = 0, records: int = 0) -> None:
        """Count unpacked bytes and records.

        Raises:
            RecordingError: If the total exceeds the limit for a recording of its size.
        """
        self._bytes -= size
        self._records -= records
        if self._bytes < 0 or self._records < 0:
            raise RecordingError(f"{self._path}: holds far more messages than a recording of its size")

    def spend_message(self, topic: str, size: int, times: tuple[int, ...]) -> None:
        """Count a message that is kept.

        Args:
            topic: Topic of the message.
            size: Size of the data of the message [bytes].
            times: Times that the message states [ns since 1970].

        Raises:
            RecordingError: If the messages exceed the limit for a recording of its size, or a time is impossible.
        """
        self.spend(size=size + LIMITS.message)
        if not 0 <= min(times) <= max(times) <= LATEST:
            raise RecordingError(f"{self._path}: damaged: a message of {topic} has no possible time")


def choose_array(recording: Recording, index: int | None) -> int:
    """Return the index of an array: the given one, or the array with the largest change of counts.

    Raises:
        InputError: If the recording has no array of the given index.
    """
    count = len(recording.arrays)
    if index is not None and not 0 <= index < count:
        raise InputError(f"--array: {recording.path} has {count} arrays; accepted: 0..{count - 1}, not {index}")
    return find_pressed_array(recording) if index is None else index
