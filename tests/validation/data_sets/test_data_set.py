"""Data-set files: what is read, which faults stop, and which cost a series, a file or a split only."""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from meshes import Sphere
from tests.support.laboratory import ARRAY, make_curve, press, uniform_method, write, write_data_set
from validation.calibration.model import Pose
from validation.data_sets.data_set import find_data_set
from validation.data_sets.images import read_images
from validation.data_sets.score import propose_splits
from validation.errors import InputError
from validation.recordings import RecordingError
from validation.schema import read as read_file
from validation.schema.data_set import DataSetTables

HEAD = "indenter = 'box:size=16mmx12mmx5mm'\nwindow = [4, 9]\n"


def record(path, load=4.0, **options):
    return write(press(uniform_method(), make_curve(np.ones(ARRAY.count)), load, Pose(0.0, 0.0), **options), path)


def test_a_file_names_series_loads_placements_and_splits(tmp_path):
    for name in ("a1.csv", "a2.csv", "b1.csv", "c.mcap"):
        record(tmp_path / "data" / name)
    found = write_data_set(
        tmp_path,
        HEAD
        + """
threshold = 100.0
[[series]]
name = "weights"
files = ["data/[ab]*.csv"]
loads = { "a*" = "200 g", "b*" = "1.5 N" }
use = "fit"
temperature_channel = 2
[[series]]
name = "ball"
indenter = "sphere:radius=8mm"
tilt = ["1 deg", "0 deg"]
[[series.file]]
path = "data/c.mcap"
load = "3 N"
at = ["1 mm", "-2 mm"]
temperature = 31.5
[[split]]
name = "moved"
fit = { series = "weights", most = "1.9 N" }
place = ["weights"]
score = "ball"
""",
    )
    assert found.problems == ()
    a, _, b, ball = found.files
    assert (a.load, b.load, ball.load) == (pytest.approx(0.2 * 9.80665), 1.5, 3.0)
    assert (a.placement.at, a.placement.yaw, a.placement.tilt) == (None, None, (0.0, 0.0))
    assert (ball.placement.at, ball.placement.yaw) == ((1e-3, -2e-3), 0.0)
    assert ball.placement.tilt == pytest.approx((np.radians(1), 0))
    assert ball.placement.indenter == Sphere(radius=8e-3)
    assert (a.threshold, a.window, a.temperature_channel, a.uses) == (100.0, (4.0, 9.0), 2, ("fit",))
    assert ball.temperature == 31.5
    fit, score = found.splits[0].fit[0], found.splits[0].score[0]
    assert [fit.takes(file.series, file.path.name, file.load) for file in found.files] == [False, False, True, False]
    assert [score.takes(file.series, file.path.name, file.load) for file in found.files] == [False, False, False, True]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[[series]]\nname = 'a'\nfile = 3", "series[0].file: must be a list"),
        ("[[series]]\nname = 'a'\nthreshhold = 3.0", "unknown key; did you mean 'threshold'"),
        ("[[series]]\nname = 'a'\nload = '3 mm'", "series[0].load"),
        ("[[series]]\nname = 'a'\nwindow = [9, 6]", "such as [6, 9]"),
        ("[[series]]\nname = 'a'\nuse = 'train'", "'train' is unknown"),
        ("[[series]]\nname = 'a'\nat = ['1 mm']", "must be 'fitted' or a pair"),
        ("name = 'empty'", "series: is missing"),
        ("[[series]]\nname = 'a'\n[[series]]\nname = 'a'", "'a' stands twice"),
        ("[[series]", "not a TOML file"),
    ],
)
def test_a_fault_of_the_file_is_named(tmp_path, text, fault):
    path = tmp_path / "set.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_file(path, DataSetTables)
    assert fault in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_fault_of_a_series_or_split_costs_that_series_or_split(tmp_path):
    record(tmp_path / "a.csv")
    found = write_data_set(
        tmp_path,
        HEAD
        + """
[[series]]
name = "good"
files = "*.csv"
[[series]]
name = "odd"
indenter = "bxo:size=1mm"
files = "*.csv"
[[series]]
name = "none"
files = "nowhere/*.csv"
[[series]]
name = "gone"
file = [{ path = "gone.csv" }]
[[series]]
name = "held back"
files = "*.csv"
use = "score"
[[split]]
name = "first"
fit = "goood"
score = "good"
[[split]]
name = "second"
fit = "held back"
score = "good"
""",
    )
    assert {file.series for file in found.files} == {"good", "held back"}
    text = "\n".join(found.problems)
    assert "series 'odd': indenter: unknown indenter 'bxo'; did you mean 'box'?" in text
    assert "series 'none': no recordings" in text
    assert "gone.csv: no such file" in text
    assert "split 'first': unknown series 'goood'; did you mean 'good'?" in text
    assert "split 'second': series 'held back' has use = ['score']" in text
    assert found.splits == ()


def test_a_recording_that_cannot_be_used_costs_itself(tmp_path):
    record(tmp_path / "a.csv")
    record(tmp_path / "b.mcap", load=5.0)
    record(tmp_path / "short.csv", seconds=3.5)
    (tmp_path / "damaged.csv").write_text("time,a\n0,x\n")
    foreign = (tmp_path / "a.csv").read_text().replace("# pitch = 0.005", "# pitch = 0.004")
    (tmp_path / "foreign.csv").write_text(foreign)
    (tmp_path / "unlabelled.csv").write_text(
        "".join(line for line in (tmp_path / "a.csv").read_text().splitlines(keepends=True) if "# load" not in line)
    )
    found = write_data_set(tmp_path, HEAD + "[[series]]\nname = 'a'\nfiles = ['*.csv', '*.mcap']\n")
    images, problems = read_images(found, ARRAY)
    assert [image.file.path.name for image in images] == ["a.csv", "b.mcap"]
    assert [image.load for image in images] == [4.0, 5.0]
    text = "\n".join(problems)
    assert len(problems) == 4
    assert "damaged.csv, line 2: not a number" in text
    assert "foreign.csv: the pressed array" in text
    assert "short.csv: the load is on for" in text
    assert "unlabelled.csv: its load is not known" in text


def test_an_image_holds_load_age_temperature_creep_and_noise(tmp_path):
    curve = make_curve(np.ones(ARRAY.count), creep=0.12)
    recording = press(uniform_method(), curve, 4.0, Pose(0.0, 0.0), temperature=33.0, noise=5.0, seconds=20.0)
    write(recording, tmp_path / "a.mcap")
    (image,), problems = read_images(
        write_data_set(tmp_path, HEAD + "[[series]]\nname = 'a'\nfiles = '*.mcap'\n"), ARRAY
    )
    assert problems == []
    assert (image.load, image.temperature) == (4.0, 33.0)
    assert image.age == pytest.approx(6.5, abs=0.1)
    assert image.creep == pytest.approx(0.12, abs=0.01)
    assert image.noise == pytest.approx(5.0, rel=0.1)


def test_copies_in_two_series_are_kept_once_and_told(tmp_path):
    record(tmp_path / "a.csv")
    (tmp_path / "b.csv").write_bytes((tmp_path / "a.csv").read_bytes())
    series = "[[series]]\nname = '{0}'\nfiles = '{0}.csv'\n"
    images, problems = read_images(write_data_set(tmp_path, HEAD + series.format("a") + series.format("b")), ARRAY)
    assert len(images) == 1
    assert "the same content is read once; left out:" in problems[0]
    assert "b.csv (as " in problems[0]
    assert "of series 'a'" in problems[0]


def test_copies_below_two_folders_cost_one_line(tmp_path):
    for name in ("a.csv", "b.csv"):
        record(tmp_path / "one" / name, load=4.0 if name == "a.csv" else 5.0)
        (tmp_path / "two").mkdir(exist_ok=True)
        (tmp_path / "two" / name).write_bytes((tmp_path / "one" / name).read_bytes())
    images, (line,) = read_images(
        write_data_set(tmp_path, HEAD + "[[series]]\nname = 'a'\nfiles = '**/*.csv'\n"), ARRAY
    )
    assert sorted(image.load for image in images) == [4.0, 5.0]
    assert "two/a.csv" in line
    assert "two/b.csv" in line


def test_the_folder_is_named_by_option_variable_or_file(tmp_path, monkeypatch):
    monkeypatch.delenv("SOFTCOVER_RECORDINGS", raising=False)
    assert find_data_set() is None
    record(tmp_path / "data" / "a.csv")
    text = HEAD + "[[series]]\nname = 'a'\nfiles = '*.csv'\n"
    beside = tmp_path / "data" / "set.toml"
    beside.write_text(text)
    apart = tmp_path / "apart.toml"
    apart.write_text("path = 'data'\n" + text)
    alone = tmp_path / "alone" / "alone.toml"
    alone.parent.mkdir()
    alone.write_text(text)
    for given in ((beside,), (apart,), (tmp_path / "data",), (tmp_path / "data", alone)):
        assert [file.path.name for file in find_data_set(*given).files] == ["a.csv"]
    (tmp_path / "empty").mkdir()
    for given in (alone, tmp_path / "empty"):
        with pytest.raises(InputError, match=r"^\S+\.toml: no recordings of it in .*; .* or write a data-set file"):
            find_data_set(given)
    monkeypatch.setenv("SOFTCOVER_RECORDINGS", str(tmp_path / "data"))
    assert len(find_data_set(alone).files) == 1
    assert find_data_set().name == "set"
    with pytest.raises(RecordingError, match="nowhere: no such folder"):
        find_data_set(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no such data-set file"):
        find_data_set(None, "nothing.toml")


def test_the_built_in_file_reads_the_published_tree(tmp_path):
    for letter in "AH":
        record(tmp_path / "python" / "calibration_pressure" / "Room temperature" / f"{letter}1.csv")
        record(tmp_path / "python" / "calibration_pressure" / "Room temperature" / "outlier" / f"{letter}2.csv")
    for path in tmp_path.rglob("*.csv"):
        path.rename(path.with_suffix(".dsa"))
    found = find_data_set(tmp_path)
    assert [(file.path.name, round(file.load / 9.80665, 3)) for file in found.files] == [
        ("A1.dsa", 0.2),
        ("H1.dsa", 0.9),
    ]
    assert {file.threshold for file in found.files} == {100.0}
    first = ["heavier", "between", "warmer", "third temperature", "other session"]
    assert [split.name for split in found.splits][:5] == first
    assert len(found.splits) == 15


@pytest.mark.parametrize(
    "known", ["labels", pytest.param("force", marks=pytest.mark.slow), pytest.param("table", marks=pytest.mark.slow)]
)
def test_without_splits_other_series_or_heavier_loads_are_predicted(tmp_path, known):
    """Loads come from labels, from force channels (which read nearly nothing for a while) or from the file itself."""
    for name, load in (("a1", 2.0), ("a2", 4.0), ("a[3]", 6.0), ("b1", 5.0)):
        made = press(uniform_method(), make_curve(np.ones(ARRAY.count)), load, Pose(0.0, 0.0))
        if known == "force":
            forces = np.where(made.times > 1.0, load, 0.0) + 0.01 * np.sin(9 * made.times)
            setup = dataclasses.replace(made.setup, load=None)
            made = dataclasses.replace(made, forces=forces, force_times=made.times, setup=setup)
        write(made, tmp_path / f"{name}.mcap")

    def propose(text):
        data_set = write_data_set(tmp_path, HEAD + text)
        images, faults = read_images(data_set, ARRAY)
        assert (data_set.splits, data_set.problems, faults) == (None, (), [])
        splits = propose_splits(images)
        return splits, [
            [sorted({i.file.path.name[:2] for i in images if any(_takes(each, i) for each in side)}) for side in sides]
            for sides in ((split.fit, split.place, split.score) for split in splits)
        ]

    series = '[[series]]\nname = "%s"\nfiles = ["%s*.mcap"]\nuse = "%s"\n'
    loads = '"?1*" = "2 N", "a2*" = "4 N", "a?3*" = "6 N", "b*" = "5 N"'
    series += "loads = {" + loads + "}\n" if known == "table" else f"load = '{known}'\n"
    ((split,), sides) = propose(series % ("A", "a", "fit"))
    assert (split.name, split.about, sides) == (
        "A heavier",
        "A: light loads to heavy ones",
        [[["a1"], [], ["a2", "a["]]],
    )
    ((split,), sides) = propose(series % ("A", "a", "fit") + series % ("B", "b", "score"))
    assert (split.name, split.about, sides) == ("other series", "A to B", [[["a1", "a2", "a["], [], ["b1"]]])
    assert propose(series % ("B", "b", "score")) == ((), [])
    assert propose(series % ("B", "b", "fit")) == ((), [])  # of one load there is no heavier half


def _takes(selection, image):
    return selection.takes(image.file.series, image.file.path.name, image.load)


@pytest.mark.parametrize("place", ["/etc", "../out", "in/../../out", "C:/out", "..\\\\out"])
@pytest.mark.parametrize(
    "text",
    [
        'path = "{}"\n[[series]]\nname = "a"\nfiles = "*.csv"',
        'zero = "{}/a.csv"\n[[series]]\nname = "a"\nfiles = "*.csv"',
        '[[series]]\nname = "a"\nfiles = ["*.csv", "{}/**/*"]',
        '[[series]]\nname = "a"\nfile = [{{ path = "{}/a.csv" }}]',
    ],
)
def test_every_path_of_a_file_lies_below_its_folder(tmp_path, monkeypatch, place, text):
    """Whoever runs the command names folders; a file from a stranger must not have the disk walked or read."""
    (tmp_path / "in").mkdir()
    record(tmp_path / "in" / "a.csv")
    (tmp_path / "in" / "set.toml").write_text(HEAD + text.format(place))
    monkeypatch.setattr(Path, "glob", lambda *_: pytest.fail("a folder was walked"))
    with pytest.raises(
        InputError, match=r"must lie below the folder of the file, not .*; or name it with --recordings"
    ):
        find_data_set(data_set=tmp_path / "in" / "set.toml")


def test_other_toml_files_beside_the_recordings_do_not_stop_the_search(tmp_path):
    """Pipes are not waited for, folders and other files are skipped; what is too large is reported and not read."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "sensor.toml").write_text("[array]")
    record(tmp_path / "a.csv")
    text = HEAD + '[[series]]\nname = "a"\nfiles = ["*.csv"]\n'
    (tmp_path / "set.toml").write_text(text)
    found = find_data_set(tmp_path)
    assert found is not None
    assert [file.path.name for file in found.files] == ["a.csv"]
    (tmp_path / "set.toml").write_text(text + "#" * 2**23)
    with pytest.raises(InputError, match="has more than the 4 MiB accepted"):
        find_data_set(tmp_path)
