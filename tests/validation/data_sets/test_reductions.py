"""Images of recordings at and beside each bound: zero, range, window, saturation, labels and copies."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from meshes import Box, TexelArray
from validation.calibration.model import Placement
from validation.data_sets.data_set import DataFile, DataSet
from validation.data_sets.images import Image, ImageNumbers, find_load, read_image, read_images
from validation.recordings.importing import save
from validation.recordings.recording import Recording, RecordingError, Setup, make_array

HERE = Placement(name="here", indenter=Box(size=(0.01, 0.01, 0.01)), at=(0.0, 0.0), yaw=0.0)
PITCH = (4e-3, 3e-3)
ARRAY = TexelArray.grid(2, 3, PITCH, name="pad")
#: Times of the frames [s]; the load is on from 2 s.
TIMES = np.arange(0, 15, 0.25)
ON = TIMES >= 2
PRESSED = np.array([0.0, 500.0, 300.0, 0.0, 0.0, 0.0])


def record(
    folder, counts, *, name="a.mcap", load=5.0, full_scale=1000, forces=None, device=None, warm=(), more=(), **of
):
    made = Recording(
        path=Path("made"), sha256="", started=datetime(2026, 1, 1, tzinfo=UTC), times=TIMES[: len(counts)],
        arrays=tuple(
            replace(make_array(2, 3, np.rint(each).astype(np.int32), pitch=PITCH, full_scale=full_scale), **of)
            for each in (counts, *more)
        ),
        setup=Setup(load=load, device=device or {}), temperatures=np.array(warm) if warm else np.empty((0, 0)),
        temperature_times=TIMES[: len(warm)], forces=np.empty(0) if forces is None else forces,
        force_times=TIMES[: 0 if forces is None else len(forces)],
    )  # fmt: skip
    save(made, folder / name)
    return folder / name


def describe(path, **options):
    return DataFile(**{"path": path, "name": path.name, "series": "s", "placement": HERE, **options})


def read(path, **options):
    return read_image(describe(path, **options), ARRAY)


def press(zero=10.0, on=ON, pressed=PRESSED):
    return zero + np.outer(on, pressed)


def test_a_recording_at_rest_gives_the_zero_of_each_texel(tmp_path):
    levels = np.array([10.0, 20, 30, 40, 50, 60])
    path = record(tmp_path, press(levels, np.ones(60)))
    rest = record(tmp_path, np.tile(levels, (8, 1)), name="rest.mcap", more=(np.zeros((8, 6)),))
    (image,) = read(path, zero=rest)
    assert image.counts == pytest.approx(PRESSED)
    (raw,) = read(path, zero="none")
    assert raw.counts == pytest.approx(levels + PRESSED)
    second = record(tmp_path, np.zeros((60, 6)), name="two.mcap", more=(press(levels, np.ones(60)),))
    assert read(second, zero=rest)[0].counts == pytest.approx(levels + PRESSED)  # the second array at rest
    one = record(tmp_path, np.tile(levels, (8, 1)), name="one.mcap")
    assert read(second, zero=one)[0].counts == pytest.approx(PRESSED)  # of one array, this one
    none = record(tmp_path, np.zeros((0, 6)), name="none.mcap")
    with pytest.raises(RecordingError, match=r"none\.mcap: 0 frames of 6 texels; expected a recording of the unloaded"):
        read(path, zero=none)
    (tmp_path / "five.csv").write_text("# rows = 1\ntime,a,b,c,d,e\n0,1,2,3,4,5\n")
    with pytest.raises(RecordingError, match=r"five\.csv: 1 frames of 5 texels; .* with 6 texels as in .*a\.mcap"):
        read(path, zero=tmp_path / "five.csv")


@pytest.mark.parametrize(
    ("counts", "full_scale"),
    [
        (press(10), 990),
        (press(-20), 1020),
        (press(0, pressed=-PRESSED), 1000),
        (press(800, pressed=-PRESSED), 800),
        (press(100, pressed=-PRESSED), 1100),  # down to -400
        (press(-100, pressed=-PRESSED), 900),
    ],
)
def test_the_range_is_what_is_left_above_or_below_rest(tmp_path, counts, full_scale):
    (image,) = read(record(tmp_path, counts))
    assert image.full_scale == full_scale
    assert image.counts == pytest.approx(PRESSED)


@pytest.mark.parametrize(
    ("load", "words"), [(0.5, "no texel differs from rest beyond noise"), (0.0, "the load is on for 0.0 s")]
)
def test_a_load_that_nothing_shows_is_told(tmp_path, load, words):
    wave = np.resize([1.0, -1.0, -1.0, 1.0], 60)
    noise = 100 + np.outer(wave, [1, -1, 1, -1, 1, -1])
    path, rest = record(tmp_path, noise, load=load), record(tmp_path, noise[:8], name="rest.mcap")
    with pytest.raises(RecordingError, match=rf"a\.mcap: {words}"):
        read(path, zero=rest)


def test_texels_that_are_switched_off_take_no_part(tmp_path):
    path = record(tmp_path, press(), enabled=np.zeros(6, dtype=bool))
    with pytest.raises(RecordingError, match=r"a\.mcap: every texel of the pressed array is switched off"):
        read(path, array=0)
    some = record(tmp_path, press(pressed=PRESSED + np.eye(6)[5] * 400), name="b.mcap", enabled=np.arange(6) < 5)
    (image,) = read(some)
    assert (image.measured.tolist(), image.total) == ([True] * 5 + [False], pytest.approx(800))
    assert image.case == "here 5 N"


@pytest.mark.parametrize(
    ("on", "window", "ages"),  # time under load [s]; first and last age of the frames [s]
    [
        (12.75, (4.0, 6.0), (4.0, 5.75)),
        (12.75, (6.0, 12.75), (6.0, 12.5)),
        (12.75, (6.0, 13.0), (6.0, 12.75)),
        (6.5, (6.0, 9.0), (5.5, 6.5)),
        (3.0, (6.0, 9.0), (2.0, 3.0)),
        (2.75, (6.0, 9.0), "on for 2.8 s; at least 3 s are needed for an average over 1 s of the window of 6..9"),
        (1.5, (1.0, 1.5), (1.0, 1.25)),
        (1.25, (1.0, 1.5), "the load is on for 1.2 s; at least 1.5 s are needed for an average over 0.5 s"),
        (12.75, (4.05, 4.1), "no frame 4.05..4.1 s after loading"),
    ],
)  # fmt: skip
def test_frames_of_the_window_or_before_an_early_end_are_averaged(tmp_path, on, window, ages):
    """The counts are ten times the age, so that their mean states that of the frames."""
    age = TIMES - 2
    loaded = ON & (age <= on)
    counts = 10 + np.outer(loaded * 1.0, PRESSED) + np.outer(loaded * age * 10, [0, 1, 0, 0, 0, 0])
    path = record(tmp_path, counts)
    if isinstance(ages, str):
        with pytest.raises(RecordingError, match=ages):
            read(path, window=window)
        return
    (image,) = read(path, window=window)
    assert image.age == pytest.approx(np.mean(ages))
    assert image.counts[1] == pytest.approx(500 + 10 * np.mean(ages), abs=0.51)
    assert image.counts[2] == pytest.approx(300)


@pytest.mark.parametrize(
    ("threshold", "lower", "refused"),
    [(None, 0, False), (10.0, 0, True), (9.0, 0, False), (10.0, 2, True), (10.0, 3, False)],
)
def test_images_with_nine_tenths_of_their_counts_at_the_end_are_refused(tmp_path, threshold, lower, refused):
    """Twenty frames of one texel at 510 of 520 counts, of which the firmware subtracted 10; some read less."""
    counts = press(10, pressed=np.array([0, 500.0, 0, 0, 0, 0]))
    counts[24 : 24 + lower, 1] = 400
    path = record(tmp_path, counts, full_scale=520)
    if refused:
        with pytest.raises(
            RecordingError, match="1 pressed texels are at the end of the range at 5 N; use lighter loads"
        ):
            read(path, window=(4.0, 9.0), threshold=threshold)
    else:
        assert read(path, window=(4.0, 9.0), threshold=threshold)[0].threshold == (threshold or 0.0)


def test_counts_that_fall_to_zero_are_at_the_end_of_the_range(tmp_path):
    falls = np.array([0, 700.0, 0, 0, 0, 0])
    with pytest.raises(RecordingError, match="1 pressed texels are at the end of the range"):
        read(record(tmp_path, press(700, pressed=-falls)))
    assert read(record(tmp_path, press(701, pressed=-falls), name="b.mcap"))[0].sign == -1


@pytest.mark.parametrize(
    ("options", "temperature"),
    [({}, 50.0), ({"temperature_channel": -2}, 30.0), ({"temperature_channel": 0}, 30.0),
     ({"temperature_channel": 1}, 50.0), ({"temperature": 0.0}, 0.0)],
)  # fmt: skip
def test_the_temperature_is_that_of_a_channel_or_of_the_file(tmp_path, options, temperature):
    assert read(record(tmp_path, press(), warm=[(30.0, 50.0)] * 3), **options)[0].temperature == temperature
    assert np.isnan(read(record(tmp_path, press(), name="b.mcap"))[0].temperature)


def test_a_force_channel_gives_the_loads_where_no_label_does(tmp_path):
    forces = np.where(ON, 4.0, 0.0)
    labelled = record(tmp_path, press(), forces=forces, load=4.5)
    assert [image.load for image in read(labelled)] == [4.5]
    assert len(read(labelled, load="force")) > 10
    bare = record(tmp_path, press(), name="b.mcap", forces=forces, load=None)
    assert len(read(bare)) > 10
    assert [image.load for image in read(bare, load=4.25)] == [4.25]
    assert {round(image.load, 6) for image in read(bare)[1:]} == {4.0}


def read_all(files):
    return read_images(DataSet(name="", folder=Path(), files=tuple(files), problems=()), ARRAY)


@pytest.mark.parametrize(
    ("loads", "sums", "words"),
    [
        ((5.0, 6.0), (800, 719), "a0.mcap (6 N)|a1.mcap (5 N)"),
        ((5.0, 6.0), (800, 720), None),
        ((4.0, 4.2), (800, 400), None),  # a twentieth more is the same load
        ((4.0, 4.21), (800, 400), "(4.21 N) has a smaller sum of counts than"),
        ((5.0, 6.0, 7.0), (800, 400, 700), ", and 1 more pairs; check the labels"),
        ((6.0, 5.0), (800, 400), None),
    ],
)
def test_a_heavier_load_with_a_clearly_smaller_sum_is_doubted(tmp_path, loads, sums, words):
    files = [
        describe(record(tmp_path, press(pressed=np.array([0, total, 0, 0, 0, 0.0])), name=f"a{number}.mcap", load=load))
        for number, (load, total) in enumerate(zip(loads, sums, strict=True))
    ]
    images, problems = read_all(files)
    assert len(images) == len(loads)
    assert len(problems) == (words is not None)
    if words and "|" not in words:
        assert words in problems[0]
    apart = [replace(file, placement=replace(HERE, name=file.name)) for file in files]
    assert read_all(apart)[1] == []
    assert read_all([replace(file, series=file.name) for file in files])[1] == []


@pytest.mark.parametrize(("copies", "end"), [(5, "a4.mcap (as "), (6, "1 more"), (7, "2 more")])
def test_five_copies_are_named_and_more_are_counted(tmp_path, copies, end):
    first = record(tmp_path, press(), name="first.mcap")
    for number in range(copies):
        (tmp_path / f"a{number}.mcap").write_bytes(first.read_bytes())
    paths = [tmp_path / f"a{number}.mcap" for number in range(copies)]
    images, (line,) = read_all([describe(path) for path in (first, *paths)])
    assert [image.file.path for image in images] == [first]
    assert line.startswith(
        f"the same content is read once; left out: {paths[0]} (as {first}), {paths[1]} (as {first}), "
    )
    assert end in line
    assert f"{paths[4]} (as {first})" in line
    assert not any(str(path) in line for path in paths[5:])


def test_the_end_of_a_load_lies_where_half_of_its_upper_sum_was_last_reached():
    """Frames every half second; a load that never rises begins with the last frame."""
    times = np.arange(12) / 2
    assert find_load(times, np.array([0, 0, 0, 10, 10, 10, 10, 10, 10, 10, 10, 5.0])) == (1.5, 11)
    assert find_load(times, np.array([0, 0, 0, 10, 10, 10, 10, 10, 10, 10, 10, 4.9])) == (1.5, 10)
    assert find_load(times, np.array([0, 0, 0, 10, 10, 10, 10, 10, 10, 10, 9.5, 0])) == (1.5, 10)
    # an array whose counts stay below zero is never loaded
    assert find_load(times, np.linspace(-9, -4, 12)) == find_load(times, np.linspace(-4, -9, 12)) == (times[11], 11)
    assert find_load(times, np.array([0, 0, 0, 10, 10, 10, 10, 10, 10, 10, 9.4, 0])) == (1.5, 9)
    assert find_load(times, np.array([0.5] * 12)) == (0.0, 11)


def test_the_numbers_are_those_stated():
    numbers = ImageNumbers()
    assert (numbers.most_images, numbers.shortest, numbers.ended, numbers.contrary) == (24, 1.0, 0.95, 0.9)
    assert (numbers.same_load, numbers.force_differs, numbers.saturated) == (1.05, 0.2, 0.9)
    image = Image(file=describe(Path("x")), load=4.1234, counts=np.array([1.0, 2, 4]), floor=np.zeros(3), sign=1,
                  measured=np.array([True, False, True]), temperature=20.0, age=1.0, creep=0.0, threshold=0.0,
                  noise=1.0, full_scale=9, sha256="")  # fmt: skip
    assert (image.total, image.case, image.array, image.note) == (5.0, "here 4.12 N", 0, "")
