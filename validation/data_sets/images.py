"""Reduces each recording of a data set to mean images of the pressed array under known loads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import detrend

from meshes.array import TexelArray
from meshes.array_types import FloatArray
from validation.calibration.model import CREEP_START, Observations
from validation.data_sets.data_set import DataFile, DataSet
from validation.recordings.importing import open_recording
from validation.recordings.recording import BoolArray, RecordedArray, Recording, RecordingError, find_pressed_array
from validation.schema.data_set import FORCE

#: Sum of counts over its final value above which the load counts as applied [-].  The load is applied at the time after
#: which the sum stays above this share.
_APPLIED_SHARE = 0.5
#: Length of the part at the end of a recording whose median sum of counts is the final value [s].
_FINAL_PERIOD = 2.0
#: Smallest number of frames at rest at the start of a recording [-].
_FLAT_FRAMES = 4
#: Smallest change of the first principal component of the counts that indicates a change of the load, over the standard
#: deviation of its noise [-].
_STEP_OVER_NOISE = 6.0
#: Quantile, over the frames, of the change of the first principal component that counts as the whole change [-].
_WHOLE = 0.95
#: Number of steps of the power iteration for the first principal component [-].  Few steps suffice, because a change of
#: the load affects the counts far more than anything else.
_POWERS = 10
#: Longest time in which a load is applied or removed, from the last frame at rest to half of the whole change [s].
_STEP_TIME = 1.0
#: Smallest time under load at the end of a recording to which creep is fitted, over `CREEP_START` [-].
_SHORTEST_CREEP = 2.0


def find_rest(times: FloatArray, counts: FloatArray) -> int:
    """Count the frames at rest at the start of a recording, before a load is applied or removed.

    The largest change of the image over time (first principal component) must first stay within its noise, then exceed
    the noise by a factor, and reach half of its size within one second.  A recording that begins under load creeps.  It
    changes fastest at its start and has no frames at rest.

    Args:
        times: Times of the frames, shape (frames,) [s].
        counts: Counts of the n texels, shape (frames, n) [-].

    Returns:
        Number of frames at rest, 0 if the recording does not begin at rest.
    """
    if len(times) < 2 * _FLAT_FRAMES:
        return 0
    centred = counts - np.median(counts, axis=0)
    # The power iteration starts from the frame that differs most from the median.
    image = centred[np.argmax(np.abs(centred).sum(axis=1))]
    for _ in range(_POWERS):
        image = centred.T @ (centred @ image)
        image = image / max(float(np.linalg.norm(image)), np.finfo(float).tiny)
    main = centred @ image
    moved = np.abs(main - np.median(main[:_FLAT_FRAMES]))
    # The standard deviation of one frame follows from the median of the differences between successive frames.
    noise = max(1.4826 * float(np.median(np.abs(np.diff(main)))) / np.sqrt(2), 1.0)
    beyond = moved > _STEP_OVER_NOISE * noise
    if not beyond.any() or beyond[:_FLAT_FRAMES].any():
        return 0
    still = int(np.flatnonzero(moved[: np.argmax(beyond)] <= 3 * noise)[-1])
    half = int(np.argmax(moved >= _APPLIED_SHARE * np.quantile(moved, _WHOLE)))
    return still + 1 if times[half] - times[still] <= _STEP_TIME else 0


def find_load_onset(times: FloatArray, counts: FloatArray) -> float:
    """Find the time from which the sum of counts stays above half its final value.

    Args:
        times: Times of the frames, shape (frames,) [s].
        counts: Counts of the n texels, shape (frames, n) [-].

    Returns:
        Time at which the load was applied; the time of the last frame if the recording ends without load [s].
    """
    total = counts.sum(axis=1)
    final = float(np.median(total[times >= times[-1] - _FINAL_PERIOD]))
    below = np.flatnonzero((total < _APPLIED_SHARE * final) | (final <= 0))
    return float(times[min(below[-1] + 1, len(times) - 1)]) if len(below) else float(times[0])


def find_creep(age: FloatArray, counts: FloatArray, threshold: float) -> float:
    """Fit the creep coefficient c of counts + threshold = s (1 + c ln(t / 2 s)) from 2 s after loading to the end.

    The sum over the texels that are lit throughout is fitted by least squares; saturation is not taken into account.

    Args:
        age: Time since loading of each frame, shape (frames,) [s].
        counts: Counts of the n texels, shape (frames, n) [-].
        threshold: Counts that the firmware subtracted from each texel [-].

    Returns:
        The coefficient; NaN if the recording is shorter than twice 2 s under load, or no texel is lit [-].
    """
    late = age >= CREEP_START
    lit = counts[late]
    lit = lit[:, (lit > 0).all(axis=0)] if len(lit) else lit
    if not lit.size or age[-1] < _SHORTEST_CREEP * CREEP_START:
        return float("nan")
    slope, start = np.polyfit(np.log(age[late] / CREEP_START), (lit + threshold).sum(axis=1), 1)
    return float(slope / start)


@dataclass(frozen=True, kw_only=True)
class ImageNumbers:
    """Constants of the reduction of recordings to images.

    Attributes:
        fewest_frames: Smallest number of frames from which the noise about a straight trend can be estimated [-].
        most_images: Largest number of images that a recording with a force channel is divided into [-].
        zero_share: Sum of counts at rest, over the sum of counts that a load adds, above which the zero is rejected
            [-].
        unloaded: Share of the largest force of a channel below which a frame counts as unloaded [-].
    """

    fewest_frames: int = 3
    most_images: int = 24
    zero_share: float = 0.01
    unloaded: float = 0.005


NUMBERS = ImageNumbers()


@dataclass(frozen=True, kw_only=True, eq=False)
class Image:
    """Mean frame of one recording, or of a part of one with a force channel, under a known load.

    Attributes:
        file: The recording.
        load: Load on the indenter [N].
        counts: Mean counts of the n texels, shape (n,) [-].
        measured: Whether each texel exists and was switched on, shape (n,).
        temperature: Temperature of the sensor; NaN if unknown [degC].
        age: Time from loading to the middle of the frames; NaN if the load varies [s].
        creep: Relative growth of the counts per unit of ln(time), with the threshold added back; NaN if unknown [-].
        threshold: Counts that the firmware subtracted [-].
        noise: Standard deviation of a texel's counts about a straight trend, over texels that are never zero [counts].
        full_scale: Largest count of the array according to the recording [-].
        sha256: SHA-256 hash of the file.
    """

    file: DataFile
    load: float
    counts: FloatArray
    measured: BoolArray
    temperature: float
    age: float
    creep: float
    threshold: float
    noise: float
    full_scale: int
    sha256: str

    @property
    def case(self) -> str:
        """Name shared by repeated recordings of one load in one series and placement."""
        return f"{self.file.placement.name} {self.load:.3g} N"


def read_images(data_set: DataSet, array: TexelArray) -> tuple[list[Image], list[str]]:
    """Read all recordings of a data set.

    Args:
        data_set: The data set.
        array: Array of the sensor.

    Returns:
        The images, and one line for each recording that cannot be used.
    """
    images: list[Image] = []
    problems: list[str] = []
    first: dict[str, DataFile] = {}
    for file in data_set.files:
        try:
            found = read_image(file, array)
        except (RecordingError, OSError) as error:
            problems.append(f"{error}; left out")
            continue
        earlier = first.setdefault(found[0].sha256, file)
        if earlier is file:
            images += found
        elif earlier.series != file.series:
            problems.append(f"{file.path}: the same content as {earlier.path} of another series; left out")
    return images, problems


def observe(images: Sequence[Image]) -> Observations:
    """Collect images as observations for the fit of the forward model or its predictions."""
    columns = {"loads": "load", "temperatures": "temperature", "ages": "age", "thresholds": "threshold"}
    columns |= {name: name for name in ("counts", "measured", "creep")}
    return Observations(
        **{name: np.array([getattr(image, one) for image in images]) for name, one in columns.items()},
        placements=tuple(image.file.placement for image in images),
        groups=tuple(image.file.name for image in images),
    )


def read_image(file: DataFile, array: TexelArray) -> list[Image]:
    """Read one recording and average its frames.

    Args:
        file: The recording.
        array: Array of the sensor; the pressed array of the recording must have the same layout, which a CSV file
            need not state.

    Returns:
        One image; several for a recording with a force channel.

    Raises:
        RecordingError: If the recording is damaged, from another array, without a load, or too short.
    """
    recording = open_recording(file.path, sensor=array)
    if not len(recording.times):
        raise RecordingError(f"{file.path}: holds no frames")
    pressed = _find_array(recording, file, array)
    counts = pressed.counts.astype(np.float64)
    threshold = file.threshold
    if threshold is None:
        threshold = float(recording.setup.device.get("threshold", 0.0))

    def average(frames: BoolArray, load: float, *, age: float = float("nan"), creep: float = float("nan")) -> Image:
        """Make the image of some frames of the recording, with the mean of their counts."""
        return Image(
            file=file,
            load=load,
            counts=counts[frames].mean(axis=0),
            measured=pressed.enabled & array.active,
            temperature=_find_temperature(recording, file, recording.times[frames]),
            age=age,
            creep=creep,
            threshold=threshold,
            noise=_noise(counts[frames]),
            full_scale=pressed.full_scale,
            sha256=recording.sha256,
        )

    load = file.load if isinstance(file.load, float) else recording.setup.load
    if file.load == FORCE or (load is None and len(recording.forces)):
        return [average(frames, load) for frames, load in _divide_by_force(recording, file, counts)]
    if load is None:
        raise RecordingError(
            f"{file.path}: its load is not known; write `# load = 4.9` [N] above the columns of a CSV file, or "
            "name it in a data-set file, such as load = '500 g'"
        )
    age = _find_age(recording, file, counts, load)
    inside = (age >= file.window[0]) & (age < file.window[1])
    if not inside.any():
        raise RecordingError(f"{file.path}: no frame {file.window[0]:g}..{file.window[1]:g} s after loading")
    return [average(inside, load, age=float(age[inside].mean()), creep=find_creep(age, counts, threshold))]


def _find_age(recording: Recording, file: DataFile, counts: FloatArray, load: float) -> FloatArray:
    """Return the time since loading of each frame, shape (frames,) [s].

    Raises:
        RecordingError: If the load does not stay on, or not for long enough, or the counts at rest are not zero.
    """
    if load > 0:
        rest = find_rest(recording.times, counts)
        _check_rest(file, counts[:rest], counts[rest:])
    age = recording.times - find_load_onset(recording.times, counts)
    if load > 0 and not counts[-1].any():
        raise RecordingError(f"{file.path}: not under load at its end; expected a weight that stays on")
    if age[-1] < file.window[1]:
        raise RecordingError(
            f"{file.path}: the load is on for {age[-1]:.1f} s; the window of {file.window[0]:g}..{file.window[1]:g} s "
            "after loading needs more"
        )
    return np.asarray(age)


def _divide_by_force(recording: Recording, file: DataFile, counts: FloatArray) -> Iterator[tuple[BoolArray, float]]:
    """Divide frames with a force channel into consecutive ones, each with its mean load [N].

    Raises:
        RecordingError: If the load is not constant or too short, or the counts at rest are not zero.
    """
    if not len(recording.forces):
        raise RecordingError(f"{file.path}: has no force channel; add one with `softcover import --force`")
    loads = np.interp(recording.times, recording.force_times, recording.forces)
    unloaded = loads <= NUMBERS.unloaded * loads.max(initial=0.0)
    if unloaded.any() and not unloaded.all():
        _check_rest(file, counts[unloaded], counts[~unloaded])
    numbers = np.arange(len(loads))
    for piece in np.array_split(numbers, min(NUMBERS.most_images, len(loads))):
        yield np.isin(numbers, piece), max(float(loads[piece].mean()), 0.0)


def _find_array(recording: Recording, file: DataFile, array: TexelArray) -> RecordedArray:
    """Return the pressed array of a recording; it must have the layout of `array`."""
    index = find_pressed_array(recording) if file.array is None else file.array
    if index >= len(recording.arrays):
        raise RecordingError(f"{file.path}: has {len(recording.arrays)} arrays; array = {index} is none of them")
    pressed = recording.arrays[index]
    if not pressed.counts.any():
        raise RecordingError(f"{file.path}: no array was pressed; expected a load on {array.name}")
    if not pressed.has_layout_of(array):
        raise RecordingError(
            f"{file.path}: the pressed array (number {index}: {describe_layout(pressed.texels)}) is not "
            f"{array.name} ({describe_layout(array)}); expected a recording of that sensor"
        )
    return pressed


def describe_layout(array: TexelArray) -> str:
    """Describe columns, rows, number of active texels and pitch of an array, for error messages."""
    pitch = " x ".join(f"{step * 1e3:g}" for step in array.pitch)
    return f"{array.columns} x {array.rows}, {int(array.active.sum())} active, pitch {pitch} mm"


def _find_temperature(recording: Recording, file: DataFile, times: FloatArray) -> float:
    """Return the mean temperature at the given times; NaN if neither recording nor data-set file has one [degC]."""
    if file.temperature is not None:
        return file.temperature
    if not recording.temperatures.size:
        return float("nan")
    channels = recording.temperatures.shape[1]
    if not -channels <= file.temperature_channel < channels:
        raise RecordingError(
            f"{file.path}: has {channels} temperature channels; temperature_channel = {file.temperature_channel} is "
            "none of them"
        )
    readings = recording.temperatures[:, file.temperature_channel]
    return float(np.interp(times, recording.temperature_times, readings).mean())


def _check_rest(file: DataFile, rest: FloatArray, pressed: FloatArray) -> None:
    """Refuse a recording whose counts at rest are not zero, or whose counts fall under load.

    A texel is above zero at rest if its mean exceeds three standard deviations and one count, the resolution.  Such
    texels are relevant if their counts add up to more than a hundredth of the change due to the load.

    Args:
        file: The recording, for messages.
        rest: Frames without load, shape (frames, n) [counts]; none if the recording begins under load.
        pressed: Frames under load, shape (frames, n) [counts].

    Raises:
        RecordingError: If the counts at rest are not zero, or the counts fall under load.
    """
    if not len(rest):
        return
    level, noise = rest.mean(axis=0), rest.std(axis=0)
    change = np.median(pressed, axis=0) - level
    shifted = level > 3 * noise + 1
    if level[shifted].sum() <= NUMBERS.zero_share * np.abs(change).sum():
        return
    seen = f"{np.median(level[shifted]):.0f} counts at rest (noise {np.median(noise[shifted]):.0f})"
    if change.sum() < 0:
        raise RecordingError(
            f"{file.path}: the counts fall by {-change.sum():.0f} in all while the load is on, from {seen}; expected "
            "counts that are zero at rest and rise with the load: subtract each texel's counts from its mean at rest"
        )
    raise RecordingError(
        f"{file.path}: {int(shifted.sum())} texels have {seen}, and the load adds {change.sum():.0f} in all; expected "
        "counts that are zero at rest: subtract each texel's mean at rest from its counts"
    )


def _noise(frames: FloatArray) -> float:
    """Return the standard deviation of counts about a straight trend in time, over texels that are never zero [counts].

    The result is 0 if there are too few frames or no such texels.
    """
    lit = frames[:, frames.min(axis=0) > 0]
    if len(lit) < NUMBERS.fewest_frames or not lit.shape[1]:
        return 0.0
    rest = detrend(lit, axis=0)
    return float(np.sqrt((rest**2).sum() / (rest.size - 2 * lit.shape[1])))
