"""Keys of a data-set file by their precedence, faults by their words, and scores of counts computed by hand."""

import math
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import fastmodel
from meshes import Box, Sphere, TexelArray
from validation.data_sets import data_set as data_sets
from validation.data_sets.data_set import (
    DataFile,
    build_data_set,
    describe_files,
    describe_unused_recordings,
    find_data_set,
)
from validation.data_sets.results import (
    CountScore,
    RecordingRow,
    RecordingScores,
    compare_with_nulls,
    find_best_null,
    find_difference,
    group_by_metric,
    score_counts,
)
from validation.data_sets.score import list_methods, propose_splits
from validation.errors import InputError
from validation.pooling import pool
from validation.recordings import RecordingError
from validation.schema import read
from validation.schema.data_set import CommonKeys, DataSetTables
from validation.sensor_file import load

BOX = "indenter = 'box:size=16mmx12mmx5mm'\n"


def build(folder, text, names=("a1.csv", "a2.csv", "b1.csv")):
    """A data set of files of these names, which are not opened."""
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).touch()
    source = folder / "my set.toml"
    source.write_text(text)
    return build_data_set(read(source, DataSetTables), source=source, folder=folder)


def test_what_a_file_does_not_state_has_these_defaults(tmp_path):
    found = build(tmp_path, f"{BOX}[[series]]\nname = 's'\nfiles = '*.csv'\n")
    assert (found.name, found.source, found.sensor, found.folder) == ("my set", "", "", tmp_path)
    assert (found.splits, dict(found.required), found.problems) == (None, {}, ())
    assert [file.path for file in found.files] == [tmp_path / name for name in ("a1.csv", "a2.csv", "b1.csv")]
    file = found.files[0]
    assert (file.name, file.series, file.load, file.temperature, file.array) == ("s a1.csv", "s", "labels", None, None)
    assert (file.threshold, file.zero, file.window, file.temperature_channel) == (None, "rest", (6.0, 9.0), -1)
    assert file.uses == ("fit", "score")
    place = file.placement
    assert (place.name, place.at, place.yaw, place.tilt) == ("s", None, None, (0.0, 0.0))
    assert place.indenter == Box(size=(16e-3, 12e-3, 5e-3))
    plain = DataFile(path=Path("x"), name="n", series="s", placement=place)
    assert (plain.load, plain.zero, plain.window, plain.temperature_channel) == ("labels", "rest", (6.0, 9.0), -1)
    assert (plain.uses, plain.array, plain.threshold, plain.temperature) == (("fit", "score"), None, None, None)


KEYS = """
name = "n"
source = "who"
sensor = "pad"
indenter = "sphere:radius=8mm"
load = "1 N"
array = 1
threshold = 2.5
zero = "zero.csv"
window = [1, 2]
temperature_channel = 3
at = ["1 mm", "2 mm"]
yaw = "90 deg"
tilt = ["2 deg", "-1 deg"]
[[series]]
name = "one"
files = "a*.csv"
[[series]]
name = "two"
indenter = "sphere:radius=9mm"
load = "force"
array = 0
threshold = 0
zero = "none"
window = [3, 4]
temperature_channel = 0
at = "fitted"
tilt = "fitted"
yaw = "0 deg"
placement = "there"
loads = { "b1*" = "5 N", "b*" = "6 N" }
[[series.file]]
path = "b2.csv"
[[series.file]]
path = "b1.csv"
load = "7 N"
temperature = 0.0
at = ["3 mm", "4 mm"]
[[series.file]]
path = "b3.csv"
yaw = "180 deg"
placement = "own"
[[series.file]]
path = "b4.csv"
at = "fitted"
"""


def test_keys_of_the_file_the_series_and_the_recording_in_rising_precedence(tmp_path):
    found = build(tmp_path, KEYS, ("a1.csv", "b1.csv", "b2.csv", "b3.csv", "b4.csv"))
    assert (found.name, found.source, found.sensor, found.problems) == ("n", "who", "pad", ())
    one, second, first, third, fourth = found.files
    assert (one.load, one.array, one.threshold, one.zero) == (1.0, 1, 2.5, tmp_path / "zero.csv")
    assert (one.window, one.temperature_channel, one.placement.name) == ((1.0, 2.0), 3, "one")
    assert (one.placement.at, one.placement.yaw) == ((1e-3, 2e-3), pytest.approx(math.pi / 2))
    assert one.placement.tilt == pytest.approx((math.radians(2), -math.radians(1)))
    assert one.placement.indenter == Sphere(radius=8e-3)
    assert second.placement.indenter.radius == pytest.approx(9e-3)
    for each in (second, first, third, fourth):  # in the order of the file
        assert (each.array, each.threshold, each.zero, each.window) == (0, 0.0, "none", (3.0, 4.0))
        assert (each.temperature_channel, each.placement.tilt) == (0, None)
    assert [each.load for each in (second, first, third, fourth)] == [6.0, 7.0, 6.0, 6.0]
    assert [each.temperature for each in (second, first, third)] == [None, 0.0, None]
    assert [each.placement.name for each in (second, first, third, fourth)] == [
        "there",
        "there, b1.csv",
        "own",
        "there",
    ]
    assert [each.placement.at for each in (second, first, third, fourth)] == [None, (3e-3, 4e-3), None, None]
    assert [each.placement.yaw for each in (second, first, third)] == [0.0, 0.0, pytest.approx(math.pi)]
    assert [each.name for each in (one, first)] == ["one a1.csv", "two b1.csv"]


@pytest.mark.parametrize(
    ("keys", "yaw"),
    [("at = 'fitted'", None), ("at = ['0 mm', '0 mm']", 0.0), ("yaw = '1 rad'", 1.0), ("yaw = 'fitted'", None),
     ("at = ['0 mm', '0 mm']\nyaw = 'fitted'", None), ("", None)],
)  # fmt: skip
def test_a_yaw_is_zero_where_the_position_is_known_and_fitted_elsewhere(tmp_path, keys, yaw):
    found = build(tmp_path, f"{BOX}{keys}\n[[series]]\nname = 's'\nfiles = 'a1.csv'\n")
    assert found.files[0].placement.yaw == yaw


PLACED = """[[series]]
name = 's'
files = 'a*'
[[series]]
name = 't'
files = 'b*'
use = 'score'
[[split]]
name = 'p'
fit = 's'
place = 't'
score = 's'
"""


@pytest.mark.parametrize(
    ("text", "problems"),
    [
        ("[[series]]\nname = 's'\nfiles = '*.csv'\n",
         ["series 's': no indenter; write for example indenter = 'box:size=10mmx10mmx5mm'; it is left out"]),
        (f"{BOX}[[series]]\nname = 's'\nfiles = 'a*'\n[[series]]\nname = 't'\nfiles = 'x*'\n",
         ["my set.toml: series 't': no recordings in {0}; it is left out"]),
        (f"{BOX}[[series]]\nname = 's'\nfiles = 'x*'\n", []),
        (f"{BOX}[[series]]\nname = 's'\nfiles = ['a1*', 'a*']\nfile = [{{ path = 'x.csv' }}]\n",
         ["series 's': {0}/x.csv: no such file; it is left out"]),
        (f"{BOX}[[series]]\nname = 's'\nfiles = ['a***x', 'a*']\n", None),
        (f"{BOX}[[series]]\nname = 's'\nfiles = 'a*'\nuse = 'score'\n[[split]]\nname = 'p'\nfit = 't'\nscore = 's'\n",
         ["my set.toml: split 'p': unknown series 't'; "]),
        (f"{BOX}[[series]]\nname = 's'\nfiles = 'a*'\nuse = 'score'\n[[split]]\nname = 'p'\nfit = 's'\nscore = 's'\n",
         ["my set.toml: split 'p': series 's' has use = ['score'], which does not allow 'fit'; it is left out"]),
        (f"{BOX}[[series]]\nname = 's'\nfiles = 'a*'\nuse = 'fit'\n[[split]]\nname = 'p'\nfit = 's'\nscore = 's'\n",
         ["my set.toml: split 'p': series 's' has use = ['fit'], which does not allow 'score'; it is left out"]),
        (f"{BOX}{PLACED}", ["series 't' has use = ['score'], which does not allow 'fit'"]),
    ],
    ids=range(9),
)  # fmt: skip
def test_a_fault_costs_its_part_and_is_told_in_a_line(tmp_path, text, problems):
    found = build(tmp_path, text)
    if problems is None:
        assert all("is not a pattern below" in each for each in found.problems)
        return
    assert len(found.problems) == len(problems)
    for line, words in zip(found.problems, problems, strict=True):
        assert words.format(tmp_path) in line
    assert bool(found.files) == (("no indenter" not in "".join(problems) and "'x*'" not in text) or "'t'" in text)
    assert found.splits == (() if "[[split]]" in text else None)
    assert [each.path.name for each in found.files if each.series == "s" and "['a1*'" in text] == (
        ["a1.csv", "a2.csv"] if "['a1*'" in text else []
    )


def test_recordings_without_a_file_are_one_series(tmp_path):
    for name, indenter in (("a.csv", "# indenter = sphere:radius=5mm\n"), ("b.csv", "")):
        (tmp_path / name).write_text(f"{indenter}# rows = 1\n# columns = 2\ntime,a,b\n0,1,2\n")
    (tmp_path / "bad.csv").write_text("time\n")
    a, b, bad = (tmp_path / name for name in ("a.csv", "b.csv", "bad.csv"))
    found = describe_files([a, bad], CommonKeys(window=[2, 4], array=1))
    (file,) = found.files
    assert (file.name, file.series, file.placement.name) == ("a.csv", "recordings", "tool")
    assert (file.placement.indenter, file.window, file.array) == (Sphere(radius=5e-3), (2.0, 4.0), 1)
    assert len(found.problems) == 1
    assert found.problems[0].endswith("; left out")
    assert (found.name, found.folder, found.splits) == ("files", Path(), None)
    both = describe_files([a, b], CommonKeys(indenter="sphere:radius=5mm"), moved=True)
    assert [each.placement.name for each in both.files] == ["a.csv", "b.csv"]
    assert {each.placement.indenter for each in both.files} == {Sphere(radius=5e-3)}
    with pytest.raises(InputError, match=r"b\.csv: its labels name no tool; give --indenter, such as box"):
        describe_files([b], CommonKeys())
    (tmp_path / "set.toml").write_text(f"{BOX}[[series]]\nname = 's'\nfiles = 'a.csv'\n")
    assert describe_files([tmp_path / "set.toml"], CommonKeys()).files[0].series == "s"
    with pytest.raises(InputError, match=r"set\.toml: a data-set file stands alone"):
        describe_files([tmp_path / "set.toml", a], CommonKeys())


def test_the_folder_of_the_variable_is_named_where_it_is_not_used(tmp_path, monkeypatch):
    monkeypatch.delenv("SOFTCOVER_RECORDINGS", raising=False)
    assert describe_unused_recordings() is None
    with pytest.raises(RecordingError, match="kiechle-sdh2: the recordings are not part of the package"):
        find_data_set(data_set="kiechle-sdh2")
    monkeypatch.setenv("SOFTCOVER_RECORDINGS", str(tmp_path / "my data"))
    assert describe_unused_recordings().endswith(f"add --recordings '{tmp_path}/my data'")
    (tmp_path / "my data").mkdir()
    with pytest.raises(InputError, match=r"kiechle-sdh2\.toml: no recordings of it in .*my data; give their folder"):
        find_data_set(data_set="kiechle-sdh2")
    one, two = tmp_path / "my data" / "a.toml", tmp_path / "my data" / "b.toml"
    for path in (one, two):
        path.write_text(f"{BOX}[[series]]\nname = 's'\nfiles = '*.csv'\n")
    with pytest.raises(
        InputError, match=r"holds several data-set files \(a\.toml, b\.toml\); name one with --data-set"
    ):
        find_data_set(tmp_path / "my data")
    with pytest.raises(InputError, match=r"a\.toml and .*b\.toml are both data-set files; name one"):
        find_data_set(one, two)
    (tmp_path / "my data" / "x.csv").touch()
    assert find_data_set(tmp_path / "my data", two).name == "b"
    assert find_data_set(None, two).name == "b"
    assert data_sets.BUILT_IN == ("kiechle-sdh2",)


# Scores of counts: texels at x = 0, 2, 4 mm, of which the last one does not measure.

PAD = TexelArray.grid(1, 4, (2e-3, 3e-3), active=np.arange(4) < 3)


def test_counts_are_scored_over_measured_texels():
    """Grey levels of 510: 50 and 51, 100 and 75 of 255."""
    recorded, predicted = np.array([100.0, 200.0, 0.0, 999.0]), np.array([102.0, 150.0, 0.0, 0.0])
    found = score_counts(recorded, predicted, full_scale=510, array=PAD)
    assert found.image_changed_percent == pytest.approx(100 * (1 + 25 + 0) / 255 / 3)
    assert found.pixels_changed == 2
    assert found.relative_l2 == pytest.approx(np.hypot(2, 50) / np.hypot(100, 200))
    assert found.total_counts_error == pytest.approx(48 / 300)
    centres = 2e-3 * 200 / 300, 2e-3 * 150 / 252
    assert found.centre_of_pressure_m == pytest.approx(centres[0] - centres[1])
    assert found.wasserstein_m == pytest.approx(centres[0] - centres[1])
    assert found.active_area_iou == 1.0
    alone = score_counts(recorded, predicted, full_scale=510, array=PAD, measured=np.arange(4) == 0)
    assert (alone.total_counts_error, alone.pixels_changed) == (pytest.approx(0.02), 1)
    faint = score_counts(recorded, np.array([102.0, 19.0, 0.0, 0.0]), full_scale=510, array=PAD)
    assert faint.active_area_iou == 0.5  # a tenth of 200 counts is not reached
    assert score_counts(
        recorded, predicted + np.array([0, 0, 21, 0]), full_scale=510, array=PAD
    ).active_area_iou == pytest.approx(2 / 3)
    assert math.isnan(score_counts(0 * recorded, predicted, full_scale=510, array=PAD).total_counts_error)


def make_score(value):
    names = [each.name for each in fields(CountScore)]
    return CountScore(**{name: value + number for number, name in enumerate(names)})


def make_row(model, values, *, kind="null", gains=False):
    scores = {f"c{number}": make_score(value) for number, value in enumerate(values)}
    return RecordingRow(split="p", model=model, kind=kind, texel_gains=gains, fitted=(), parameters={}, per_case=scores,
                        pooled={"image_changed_percent": pool(list(values))}, skill={}, electronics=None)  # fmt: skip


def test_scores_are_grouped_by_metric():
    assert group_by_metric([make_score(1.0), make_score(5.0)]) == {
        "image_changed_percent": (1, 5), "pixels_changed": (2, 6), "relative_l2": (3, 7), "total_counts_error": (4, 8),
        "centre_of_pressure_m": (5, 9), "wasserstein_m": (6, 10), "active_area_iou": (7, 11),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("own", "verdict"),
    [((1.5, 2.6, 3.5, 4.6, 5.5), "it is behind"), ((0.5, 1.4, 2.5, 3.4, 4.5), "it is ahead"),
     ((0.5, 2.5, 2.5, 4.5, 5.0), "these recordings do not tell the two apart"),
     ((1.5, 2.6, 3.5, 4.6), "too few cases")],
)  # fmt: skip
def test_the_first_model_with_gains_is_compared_with_the_best_null_model(own, verdict):
    null = [1.0, 2.0, 3.0, 4.0, 5.0][: len(own)]
    none = [0.0] * len(own)
    rows = [make_row("worse", [9.0] * len(own)), make_row("best", null), make_row("plain", none, kind="model"),
            make_row("mine", own, kind="model", gains=True), make_row("later", none, kind="model", gains=True),
            make_row("repeat", none, kind="floor")]  # fmt: skip
    assert find_best_null(rows).model == "best"
    mine, best, found = find_difference(rows)
    difference = np.mean(own) - np.mean(null)
    assert (mine.model, best.model, found.cases) == ("mine", "best", len(own))
    assert found.mean == pytest.approx(difference)
    text = compare_with_nulls(rows)
    assert text.startswith(
        f"mine with texel gains changes the image by {np.mean(own):.2f} %, the best null model (best) by "
        f"{np.mean(null):.2f} %: {verdict}"
    )
    assert f"(difference {difference:+.2f} %, " in text


def test_a_row_is_found_by_split_model_and_gains():
    rows = (make_row("a", [1.0]), make_row("a", [2.0], gains=True), make_row("b", [3.0]))
    scores = RecordingScores(name="n", rows=rows, examples=(), about={}, notes={}, files={}, noise=1.0, source="",
                             problems=())  # fmt: skip
    assert scores.row("p", "a") is rows[0]
    assert scores.row("p", "a", texel_gains=True) is rows[1]
    for split, model, gains in (("q", "a", False), ("p", "c", False), ("p", "b", True)):
        with pytest.raises(KeyError, match=rf"no row '{model}' in split '{split}'; rows: \['a', 'b'\]"):
            scores.row(split, model, texel_gains=gains)
    assert (dict(scores.errors), dict(scores.left_out)) == ({}, {})


class Pressed:
    """What a proposal of splits asks of an image."""

    def __init__(self, name, load, series="s", uses=("fit", "score")):
        self.load = load
        self.file = DataFile(path=Path(name), name=name, series=series, uses=uses, placement=None)


def list_sides(split):
    return [[(each.series, each.files) for each in side] for side in (split.fit, split.score)]


@pytest.mark.parametrize(
    ("loads", "light", "heavy"),
    [
        ((1.0, 2.0, 3.0, 4.0), "ab", "cd"),
        ((1.0, 2.0, 3.0), "a", "bc"),
        ((1.0, 1.05, 3.0), "ab", "c"),  # a twentieth more is the same load
        ((1.0, 1.06, 3.0), "a", "bc"),
        ((2.0, 2.05), None, None),
        ((0.0, 3.0), None, None),  # no load is none
        ((3.0, 1.0), "b", "a"),
    ],
)
def test_heavier_halves_are_predicted_from_lighter_ones(loads, light, heavy):
    images = [Pressed("abcd"[number], load) for number, load in enumerate(loads)]
    images += [Pressed("a", loads[0] / 2), Pressed("z", 9.0, series="t")]
    splits = propose_splits(images)
    if light is None:
        assert splits == ()
        return
    (split,) = splits
    assert (split.name, split.about) == ("s heavier", "s: light loads to heavy ones")
    assert list_sides(split) == [[("s", tuple(light))], [("s", tuple(heavy))]]


def test_series_to_score_are_predicted_from_those_to_fit():
    images = [Pressed("a", 1.0), Pressed("b", 2.0, "t", ("score",)), Pressed("c", 3.0, "u", ("fit",)),
              Pressed("d", 2.0, "v", ("score",)), Pressed("e", 5.0)]  # fmt: skip
    (split,) = propose_splits(images)
    assert (split.name, split.about) == ("other series", "s, u to t, v")
    assert list_sides(split) == [[("s", ()), ("u", ())], [("t", ()), ("v", ())]]
    assert propose_splits([images[1]]) == propose_splits([]) == ()


def test_the_methods_are_the_fast_model_its_boxes_and_finite_elements():
    sensor, parameters = load("wts-0614-34"), fastmodel.load("wts-0614-34")
    methods = list_methods(sensor, parameters)
    assert list(methods) == ["fast model", "fast model, boxes", "reference"]
    words = ("solved cell by cell", "boxes share the load", "finite elements")
    assert all(word in method.about for word, method in zip(words, methods.values(), strict=True))
    assert list(list_methods(sensor, replace(parameters, surface=None))) == ["fast model", "reference"]


def test_requirements_of_a_file_are_kept_by_the_name_of_their_metric(tmp_path):
    found = build(tmp_path, f"{BOX}[required]\nrelative_l2 = '25 %'\n[[series]]\nname = 's'\nfiles = '*.csv'\n")
    assert {key: value for key, value in found.required.items() if value is not None} == {"relative_l2": 0.25}
