"""Reduces each recording of a data set to mean images of the pressed array under known loads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from meshes.array import TexelArray
from meshes.array_types import FloatArray
from validation.calibration.model import CREEP_START, Observations
from validation.data_sets.data_set import DataFile, DataSet
from validation.data_sets.zeros import (
    APPLIED_SHARE,
    Zeroed,
    deviate,
    find_unloaded,
    find_unloaded_by_force,
    subtract_zero,
)
from validation.recordings.importing import open_recording
from validation.recordings.recording import (
    NANOSECOND,
    BoolArray,
    CountArray,
    RecordedArray,
    Recording,
    RecordingError,
    find_pressed_array,
)
from validation.schema.data_set import FORCE, NO_ZERO, REST

#: Length of the part at the end of a load whose median sum of counts is the final value [s].
_FINAL_PERIOD = 2.0
#: Largest number of recordings that a line names [-].
_MOST_NAMES = 5
#: Quantile of the sum of counts that is taken for the sum under load, to find the end of the load [-].
_LOADED = 0.9
#: Smallest time under load at the end of a recording to which creep is fitted, over `CREEP_START` [-].
_SHORTEST_CREEP = 2.0


def find_load(times: FloatArray, total: FloatArray) -> tuple[float, int]:
    """Find the time from which the sum of counts stays above half its final value, and where the load ends.

    Args:
        times: Times of the frames, shape (frames,) [s].
        total: Sum of the counts of each frame, shape (frames,) [-].

    Returns:
        Time at which the load was applied, that of the last frame if the counts never rise [s]; and the index of the
        last frame under load, before frames during its removal.
    """
    loaded = np.flatnonzero(total >= APPLIED_SHARE * max(float(np.quantile(total, _LOADED)), 0.0))
    last = int(loaded[-1]) if len(loaded) else len(total) - 1
    final = float(np.median(total[(times >= times[last] - _FINAL_PERIOD) & (times <= times[last])]))
    below = np.flatnonzero((total[: last + 1] < APPLIED_SHARE * final) | (final <= 0))
    onset = float(times[min(below[-1] + 1, len(times) - 1)]) if len(below) else float(times[0])
    if last + 1 < len(times) and final > 0:
        last = int(np.flatnonzero(total >= NUMBERS.ended * final)[-1])
    return onset, last


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
        most_images: Largest number of images that a recording with a force channel is divided into [-].
        shortest: Shortest time over which frames under a load that ends early are averaged [s].
        ended: Share of the final sum of counts below which a load that ends is being removed [-].
        contrary: Sum of counts over that under a lighter load, below which one of the two labels is doubted [-].
        same_load: Largest ratio of two loads that are taken for equal [-].
        force_differs: Difference of label and force channel, over the label, above which they contradict [-].
        saturated: Share of pressed texels at the end of the range from which a recording is refused [-].
    """

    most_images: int = 24
    shortest: float = 1.0
    ended: float = 0.95
    contrary: float = 0.9
    same_load: float = 1.05
    force_differs: float = 0.2
    saturated: float = 0.9


NUMBERS = ImageNumbers()


@dataclass(frozen=True, kw_only=True, eq=False)
class Image:
    """Mean frame of one recording, or of a part of one with a force channel, under a known load.

    Attributes:
        file: The recording.
        load: Load on the indenter [N].
        counts: Mean counts of the n texels above rest, shape (n,) [-]; noise about the zero may be negative.
        floor: Count up to which a texel does not differ from rest, shape (n,) [-].
        sign: -1 if the recorded counts fall under load and were turned, else 1.
        measured: Whether each texel exists and was switched on, shape (n,).
        temperature: Temperature of the sensor; NaN if unknown [degC].
        age: Time from loading to the middle of the frames; NaN if the load varies [s].
        creep: Relative growth of the counts per unit of ln(time), with the threshold added back; NaN if unknown [-].
        threshold: Counts that the firmware subtracted [-].
        noise: Standard deviation of a texel's counts about a straight trend, over texels that are never zero [counts].
        full_scale: Largest count of the array above rest according to the recording [-].
        sha256: SHA-256 hash of the file.
        array: Index of the pressed array in the recording [-].
        note: Sentence about a doubt in this image; empty without one.
    """

    file: DataFile
    load: float
    counts: FloatArray
    floor: FloatArray
    sign: int
    measured: BoolArray
    temperature: float
    age: float
    creep: float
    threshold: float
    noise: float
    full_scale: int
    sha256: str
    array: int = 0
    note: str = ""

    @property
    def total(self) -> float:
        """Sum of the counts of the measured texels [-]."""
        return float(self.counts[self.measured].sum())

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
        The images, and one line for each recording that cannot be used or is in doubt.
    """
    images: list[Image] = []
    problems: list[str] = []
    copies: list[str] = []
    first: dict[tuple[object, ...], DataFile] = {}
    for file in data_set.files:
        try:
            found = read_image(file, array)
        except (RecordingError, OSError) as error:
            problems.append(f"{error}; left out")
            continue
        window = file.window if np.isfinite(found[0].age) else ()
        earlier = first.setdefault((found[0].sha256, found[0].array, *window), file)
        if earlier is file:
            images += found
            problems += dict.fromkeys(f"{file.path}: {image.note}" for image in found if image.note)
        else:
            other = f" of series {earlier.series!r}" * (earlier.series != file.series)
            copies.append(f"{file.path} (as {earlier.path}{other})")
    if copies:
        problems.append(f"the same content is read once; left out: {_list(copies)}")
    images, turned = _agree_on_sign(images)
    return images, [*problems, *turned, *_doubt_labels(images)]


def _list(names: Sequence[str]) -> str:
    """Name the first of some things, and count the others."""
    more = [f"{len(names) - _MOST_NAMES} more"] if len(names) > _MOST_NAMES else []
    return ", ".join([*names[:_MOST_NAMES], *more])


def _agree_on_sign(images: list[Image]) -> tuple[list[Image], list[str]]:
    """Return the images whose counts change under load in the direction of most images, and a line about the others."""
    falling = [image.sign < 0 for image in images]
    if not any(falling):
        return images, []
    if all(falling):
        return images, ["the counts fall under load in every recording; they are turned"]
    sign = -1 if sum(falling) > len(images) / 2 else 1
    others = dict.fromkeys(str(image.file.path) for image in images if image.sign != sign)
    words = ("rise", "fall") if sign < 0 else ("fall", "rise")
    line = (
        f"{_list(list(others))}: the counts {words[0]} under load, and {words[1]} in most recordings of the data set; "
        "expected one sign, and frames at rest before the load; left out"
    )
    return [image for image in images if image.sign == sign], [line]


def _doubt_labels(images: Sequence[Image]) -> Iterator[str]:
    """Yield a line for each series and placement where a heavier load has a clearly smaller sum of counts."""
    groups: dict[tuple[str, str], list[Image]] = {}
    for image in images:
        if np.isfinite(image.age):
            groups.setdefault((image.file.series, image.file.placement.name), []).append(image)
    for group in groups.values():
        pairs = [
            (heavy, light)
            for heavy, light in permutations(group, 2)
            if heavy.load > NUMBERS.same_load * light.load and heavy.total < NUMBERS.contrary * light.total
        ]
        for heavy, light in pairs[:1]:
            more = f", and {len(pairs) - 1} more pairs" * (len(pairs) > 1)
            yield (
                f"{heavy.file.path} ({heavy.load:.3g} N) has a smaller sum of counts than {light.file.path} "
                f"({light.load:.3g} N) in the same place{more}; check the labels; the loads are used as labelled"
            )


def observe(images: Sequence[Image]) -> Observations:
    """Collect images as observations for the fit of the forward model or its predictions."""
    columns = {"loads": "load", "temperatures": "temperature", "ages": "age", "thresholds": "threshold"}
    columns |= {name: name for name in ("counts", "measured", "creep")}
    columns["floors"] = "floor"
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
    measured = pressed.enabled & array.active
    if not measured.any():
        raise RecordingError(
            f"{file.path}: every texel of the pressed array is switched off; expected some that measure"
        )
    zeroed = _zero(recording, file, pressed, array, measured)
    counts = zeroed.counts
    threshold = file.threshold
    if threshold is None:
        threshold = float(recording.setup.device.get("threshold", 0.0))

    def average(frames: BoolArray, load: float, *, age: float = float("nan"), creep: float = float("nan")) -> Image:
        """Make the image of some frames of the recording, with the mean of their counts."""
        mean, time = counts[frames].mean(axis=0), float(recording.times[frames].mean())
        return Image(
            file=file, load=load, counts=mean, floor=zeroed.find_floor(frames), sign=zeroed.sign, measured=measured,
            temperature=_find_temperature(recording, file, recording.times[frames]), age=age, creep=creep,
            threshold=threshold, noise=_noise(counts[frames][:, measured]), sha256=recording.sha256,
            full_scale=_find_range(pressed, zeroed, measured), array=recording.arrays.index(pressed),
            note=zeroed.describe_drift(time, float(mean[measured].sum())) if np.isfinite(age) else "",
        )  # fmt: skip

    load = file.load if isinstance(file.load, float) else recording.setup.load
    if _has_varying_load(recording, file):
        pieces = [(frames, average(frames, load)) for frames, load in _divide_by_force(recording, file)]
        for frames, image in pieces:
            _check_range(image, pressed.counts[frames], pressed.full_scale - threshold)
        return [image for _, image in pieces]
    if load is None:
        raise RecordingError(
            f"{file.path}: its load is not known; write `# load = 4.9` [N] above the columns of a CSV file, or "
            "name it in a data-set file, such as load = '500 g'"
        )
    age, last = _find_age(recording, file, zeroed, measured, load)
    inside = _find_window(file, age, last)
    creep = find_creep(age[:last], counts[:last, measured], threshold)
    image = average(inside, load, age=float(age[inside].mean()), creep=creep)
    _check_range(image, pressed.counts[inside], pressed.full_scale - threshold)
    _check_label(recording, image, inside)
    return [image]


def _has_varying_load(recording: Recording, file: DataFile) -> bool:
    """Return whether the force channel gives the loads of a recording."""
    labelled = isinstance(file.load, float) or recording.setup.load is not None
    return file.load == FORCE or (not labelled and len(recording.forces) > 0)


def _zero(
    recording: Recording, file: DataFile, pressed: RecordedArray, array: TexelArray, measured: BoolArray
) -> Zeroed:
    """Subtract the zero of each texel as the file says: `rest`, `none`, or a recording at rest.

    Raises:
        RecordingError: If no frames at rest are found where they are needed, or the recording at rest is of another
            array.
    """
    counts = pressed.counts.astype(np.float64)
    unloaded, rest = np.zeros(len(counts), dtype=bool), None
    if file.zero == NO_ZERO:
        rest = np.empty((0, counts.shape[1]))
    elif file.zero != REST:
        other = open_recording(file.zero, sensor=array)
        rest = other.arrays[min(recording.arrays.index(pressed), len(other.arrays) - 1)].counts.astype(np.float64)
        if not len(rest) or rest.shape[1] != counts.shape[1]:
            raise RecordingError(
                f"{file.zero}: {len(rest)} frames of {rest.shape[1]} texels; expected a recording of the unloaded "
                f"array with {counts.shape[1]} texels as in {file.path}"
            )
    elif len(recording.forces):
        unloaded = _read_forces(recording)[1]
    if file.zero == REST and not _has_varying_load(recording, file) and not unloaded.any():
        unloaded = find_unloaded(recording.times, counts[:, measured])
    try:
        return subtract_zero(recording.times, counts, measured, unloaded, rest=rest)
    except RecordingError as error:
        raise RecordingError(f"{file.path}: {error}") from error


def _find_range(pressed: RecordedArray, zeroed: Zeroed, measured: BoolArray) -> int:
    """Return the largest count above rest that the converter can give: up to full scale, or down to zero [-]."""
    zero = float(np.median(zeroed.zero[measured]))
    lowest = 0 if pressed.counts[:, measured].min() >= 0 and zero > 0 else -pressed.full_scale
    return max(1, round(pressed.full_scale - zero if zeroed.sign > 0 else zero - lowest))


def _find_age(
    recording: Recording, file: DataFile, zeroed: Zeroed, measured: BoolArray, load: float
) -> tuple[FloatArray, int]:
    """Return the time since loading of each frame, shape (frames,) [s], and the number of frames until the load ends.

    Raises:
        RecordingError: If nothing presses.
    """
    times, counts = recording.times, zeroed.counts[:, measured]
    total = counts.sum(axis=1)
    onset, last = find_load(times, total)
    loaded = ~zeroed.unloaded if not zeroed.unloaded.all() else zeroed.unloaded
    floor = zeroed.find_floor(loaded)[measured]
    if load > 0 and (total[last] <= 0 or not (counts[loaded].mean(axis=0) > floor).any()):
        raise RecordingError(f"{file.path}: no texel differs from rest beyond noise; expected an array that is pressed")
    return np.asarray(times - onset), last + 1


def _find_window(file: DataFile, age: FloatArray, last: int) -> BoolArray:
    """Return the frames to average: those of the window, or those before the end of a load that ends earlier.

    The part before an early end starts early enough to have the smallest length, but not while the counts rise most.

    Raises:
        RecordingError: If the load is on for too short a time, or there are no frames.
    """
    start, end = file.window
    on = float(age[last - 1])
    if on < end:
        end, shortest = on, min(NUMBERS.shortest, end - start)
        least = min(start, CREEP_START) + shortest
        if on < least:
            raise RecordingError(
                f"{file.path}: the load is on for {on:.1f} s; at least {least:g} s are needed for an average over "
                f"{shortest:g} s of the window of {file.window[0]:g}..{file.window[1]:g} s after loading"
            )
        start, end = min(start, end - shortest), end + NANOSECOND  # The last frame under load belongs to it.
    inside = (age >= start) & (age < end)
    inside[last:] = False
    if not inside.any():
        raise RecordingError(f"{file.path}: no frame {start:g}..{end:g} s after loading")
    return np.asarray(inside)


def _check_range(image: Image, raw: CountArray, top: float) -> None:
    """Refuse an image whose pressed texels all saturate.

    Args:
        image: The image.
        raw: Recorded counts of the image, shape (frames, n) [-].
        top: Largest count that the sensor gives [-].

    Raises:
        RecordingError: In this case.
    """
    lit = image.measured & (image.counts > image.floor)
    at_end = raw[:, lit] >= top if image.sign > 0 else raw[:, lit] <= min(0, int(raw[:, image.measured].min()))
    if lit.any() and at_end.mean() >= NUMBERS.saturated:
        raise RecordingError(
            f"{image.file.path}: {int(lit.sum())} pressed texels are at the end of the range at {image.load:.3g} N; "
            "use lighter loads"
        )


def _check_label(recording: Recording, image: Image, inside: BoolArray) -> None:
    """Refuse an image, of some of all frames, with a load that the force channel contradicts."""
    if len(recording.forces):
        force = float(_read_forces(recording)[0][inside].mean())
        if abs(force - image.load) > NUMBERS.force_differs * image.load:
            raise RecordingError(
                f"{image.file.path}: its load is said to be {image.load:.3g} N, and its force channel reads "
                f"{force:.3g} N; mend the label, or use the channel: load = 'force' in a data-set file"
            )


def _divide_by_force(recording: Recording, file: DataFile) -> Iterator[tuple[BoolArray, float]]:
    """Divide frames with a force channel into consecutive ones under load, each with its mean load [N].

    Frames at rest are the zero of the others, so that images of them alone would be zero whatever a model predicts.

    Raises:
        RecordingError: If there is no force channel.
    """
    if not len(recording.forces):
        raise RecordingError(f"{file.path}: has no force channel; add one with `softcover import --force`")
    loads, unloaded = _read_forces(recording)
    numbers = np.arange(len(loads))
    pieces = np.array_split(numbers, min(NUMBERS.most_images, len(loads)))
    for piece in (each for each in pieces if not unloaded[each].all()):
        yield np.isin(numbers, piece), max(float(loads[piece].mean()), 0.0)


def _read_forces(recording: Recording) -> tuple[FloatArray, BoolArray]:
    """Return the force at each frame [N] and the frames at rest, shape (frames,); the force at rest is subtracted."""
    forces = np.interp(recording.times, recording.force_times, recording.forces)
    unloaded = find_unloaded_by_force(forces)
    return forces - (float(np.median(forces[unloaded])) if unloaded.any() else 0.0), unloaded


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
    return f"{array.layout}, {int(array.active.sum())} active, pitch {pitch} mm"


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


def _noise(frames: FloatArray) -> float:
    """Return the standard deviation of counts about a straight trend in time, over texels that are never zero [counts].

    The result is 0 if there are too few frames or no such texels.
    """
    lit = frames[:, frames.min(axis=0) > 0]
    return float(np.sqrt(np.nan_to_num(deviate(lit) ** 2).mean())) if lit.size else 0.0
