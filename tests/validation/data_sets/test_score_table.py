"""The table of scores of a few made-up images, whose errors are known by hand."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import fastmodel
from meshes import TexelArray
from tests.support.laboratory import STAMP, make_curve, uniform_method
from validation.calibration.model import Placement, Pose
from validation.data_sets import score
from validation.data_sets.data_set import DataFile, DataSet
from validation.data_sets.images import Image
from validation.data_sets.results import score_counts
from validation.errors import InputError
from validation.schema.data_set import SelectionTable, SplitTable
from validation.sensor_file import load

ARRAY = TexelArray.grid(3, 4, 5e-3, name="made up")
SENSOR = dataclasses.replace(load("wts-0614-34"), array=ARRAY)
METHOD = uniform_method(ARRAY)
AT = (0.5e-3, -1e-3)
CURVE = make_curve(np.ones(12))


def make_image(name, newtons, factor=1.0, *, series="s", noise=3.0, uses=("fit", "score"), sha256=None):
    """An image of the made-up sensor whose counts are a factor times the right ones."""
    forces = METHOD.texel_forces(STAMP, np.array([newtons]), Pose(*AT))
    state = {"temperatures": np.full(1, 30.0), "ages": np.full(1, 2.0), "thresholds": np.zeros(1)}
    place = Placement(name="here", indenter=STAMP, at=AT, yaw=0.0)
    return Image(
        file=DataFile(path=Path(name), name=f"{series} {name}", series=series, placement=place, uses=uses),
        load=newtons, counts=factor * CURVE.predict(forces, **state)[0], floor=np.zeros(12), sign=1,
        measured=np.ones(12, dtype=bool), temperature=30.0, age=2.0, creep=np.nan, threshold=0.0, noise=noise,
        full_scale=4000, sha256=sha256 or name,
    )  # fmt: skip


FITTED = [make_image(f"fit{newtons}", float(newtons), noise=4.0) for newtons in (2, 4, 6, 8)]
#: Of three scored loads one was recorded twice; its second image is a fifth brighter.
SCORED = [make_image("one", 3.0), make_image("two", 7.0), make_image("again", 7.0, 1.2), make_image("three", 5.0)]


def make_split(name, fit, scored, place=()):
    sides = {"fit": fit, "score": scored, "place": place}
    chosen = {side: tuple(SelectionTable(series="s", files=each) for each in names) for side, names in sides.items()}
    return SplitTable.model_construct(name=name, about="", **chosen)


GOOD = make_split("good", ["fit*"], ["one", "two", "again", "three"])


def score_images(images, splits, monkeypatch, name="uniform"):
    monkeypatch.setattr(score, "read_images", lambda *_: (images, ["a.csv: is damaged"]))
    monkeypatch.setattr(score, "list_methods", lambda *_: {name: METHOD})
    data_set = DataSet(
        name="set", folder=Path(), files=(), splits=splits, source="who", sensor="pad", problems=("first",)
    )
    return score.score_recordings(data_set, SENSOR, fastmodel.load("wts-0614-34"))


def change(counts, others):
    """Mean absolute difference of whole grey levels, of which 255 are 4000 counts [%]."""
    grey = (np.rint(255 * np.minimum(each, 4000) / 4000) for each in (counts, others))
    return 100 / 255 * np.abs(np.subtract(*grey)).mean()


def test_rows_hold_what_their_names_say(monkeypatch):
    bad = [
        make_split("seen", ["fit*", "one"], ["one"]),
        make_split("placed", ["fit*"], ["one"], place=["fit2"]),
        make_split("both", ["fit*"], ["one", "two"], place=["two"]),
        make_split("nothing", ["fit*"], ["none"]),
        make_split("no place", ["fit*"], ["one"], place=["none"]),
        make_split("no fit", ["none"], ["one"]),
    ]
    found = score_images([*FITTED, *SCORED], (GOOD, *bad), monkeypatch)
    assert found.problems[:2] == ("first", "a.csv: is damaged")
    faults = [
        "split 'seen': s one would be scored, and is fitted or placed too",
        "split 'placed': s fit2 is fitted and placed",
        "split 'both': s two would be scored",
        "split 'nothing': no usable recording to score",
        "split 'no place': no usable recording to place",
        "split 'no fit': no usable recording to fit",
    ]
    assert [told.startswith(fault) for told, fault in zip(found.problems[2:], faults, strict=True)] == [True] * 6
    assert (found.source, found.name) == ("who", "set")
    assert found.noise == pytest.approx(((16 * 4 + 9 * 4) / 8) ** 0.5)
    assert found.files["s two"] == "two"
    assert (found.about["good"], found.about["uniform"]) == ("good", "uniform pressure")
    assert {row.split for row in found.rows} == {"good"}

    one, two, again, three = (image.counts for image in SCORED)
    model = found.row("good", "uniform", texel_gains=True)
    cases = {case: each.image_changed_percent for case, each in model.per_case.items()}
    expected = {"here 3 N": 0.0, "here 7 N": change(again, two) / 2, "here 5 N": 0.0}
    assert cases == pytest.approx(expected, abs=0.1)
    assert list(cases) == list(expected)
    assert model.fitted == tuple(image.file.name for image in FITTED)
    assert model.electronics.sensitivity == pytest.approx(917, rel=0.03)
    assert model.electronics.rate_hz == SENSOR.electronics.rate_hz
    assert model.parameters["dead_force_N"] == pytest.approx(0.02, abs=0.01)
    zeros = found.row("good", "zeros")
    dark = {case: each.image_changed_percent for case, each in zeros.per_case.items()}
    assert dark == pytest.approx({
        "here 3 N": change(one, 0 * one), "here 7 N": (change(two, 0 * one) + change(again, 0 * one)) / 2,
        "here 5 N": change(three, 0 * one),
    })  # fmt: skip
    assert (zeros.kind, zeros.texel_gains, zeros.electronics) == ("null", False, None)
    assert zeros.fitted == model.fitted
    skill = 1 - np.mean(list(cases.values())) / np.mean(list(dark.values()))
    assert model.skill["zeros"].mean == pytest.approx(skill)
    assert set(model.skill) == {row.model for row in found.rows if row.kind == "null"}
    repeat, scaled = (found.row("good", f"repeat{more}") for more in (" of the same load", ", scaled to the same sum"))
    assert {case: each.image_changed_percent for case, each in repeat.per_case.items()} == pytest.approx(
        {"here 7 N": change(two, again)}
    )
    assert scaled.per_case["here 7 N"].image_changed_percent == pytest.approx(0)
    assert (repeat.kind, repeat.fitted, repeat.skill) == ("floor", (), {})
    (example,) = found.examples
    assert (example.case, example.load, example.split) == ("s two", 7.0, "good")
    assert example.recorded.tolist() == np.rint(255 * two / 4000).reshape(3, 4).tolist()
    assert {"zeros", "uniform", "uniform, texel gains"} <= set(example.predicted)
    assert len(found.notes["good"]) == 1
    assert "uniform with texel gains changes the image by" in found.notes["good"][0]
    assert found.errors == {"good": ()}
    with pytest.raises(KeyError, match="no row 'none' in split 'good'"):
        found.row("good", "none")
    assert not found.row("good", "uniform").texel_gains


@pytest.mark.parametrize(
    ("images", "splits", "words"),
    [
        ([], (GOOD,), "set: no recording can be used; they are of pad"),
        (FITTED, (GOOD,), "set: no split can be scored"),
        (FITTED[:1], None, "set: no split can be scored"),
    ],
)
def test_a_data_set_without_images_or_splits_is_refused_with_its_problems(monkeypatch, images, splits, words):
    with pytest.raises(InputError) as caught:
        score_images(images, splits, monkeypatch)
    assert caught.value.faults[:2] == ("first", "a.csv: is damaged")
    assert caught.value.faults[-1].startswith(words)


@pytest.mark.parametrize(
    ("loads", "light"),
    [
        ((1.0, 2.0, 3.0, 4.0), {"0", "1"}),
        ((1.0, 2.0, 3.0), {"0"}),  # the heavier half holds the middle load
        ((1.0, 1.04, 2.0), {"0", "1"}),  # within 5 % loads are equal
        ((1.0, 1.06, 2.0), {"0"}),
        ((1.0, 1.04), None),
    ],
)
def test_without_splits_the_lighter_half_of_different_loads_is_fitted(loads, light):
    images = [make_image(str(number), newtons) for number, newtons in enumerate(loads)]
    splits = score.propose_splits(images)
    assert len(splits) == (light is not None)
    for split in splits:
        sides = [{i.file.path.name for i in images if any(s.takes("s", i.file.path.name, i.load) for s in side)}
                 for side in (split.fit, split.score)]  # fmt: skip
        assert sides == [light, set(map(str, range(len(loads)))) - light]
        assert (split.name, split.about) == ("s heavier", "s: light loads to heavy ones")


def test_counts_are_scored_over_measured_texels():
    """Two of three texels, 4 mm apart, at a full scale of 255."""
    array = TexelArray.grid(1, 3, 4e-3)
    measured = np.array([True, True, False])
    recorded, predicted = np.array([30.0, 10.0, 200.0]), np.array([20.0, 12.0, 0.0])
    found = score_counts(recorded, predicted, full_scale=255, array=array, measured=measured)
    centre = 4e-3 * abs(12 / 32 - 10 / 40)
    assert dataclasses.asdict(found) == pytest.approx({
        "image_changed_percent": 100 * 6 / 255, "pixels_changed": 2, "relative_l2": (104 / 1000) ** 0.5,
        "total_counts_error": 8 / 40, "centre_of_pressure_m": centre, "wasserstein_m": centre, "active_area_iou": 1,
    })  # fmt: skip
    dark = score_counts(0 * recorded, predicted, full_scale=255, array=array)
    assert np.isnan(dark.total_counts_error)
    assert score_counts(recorded, recorded, full_scale=255, array=array).pixels_changed == 0
