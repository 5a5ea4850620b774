"""The table of scores against recordings: each row holds what its name says, and no model sees what it is scored on."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import least_squares

import fastmodel
from tests.support.laboratory import (
    ARRAY,
    STAMP_TEXT,
    draw_gains,
    make_curve,
    press,
    uniform_method,
    write,
    write_data_set,
)
from validation.calibration.cross_validation import choose_options
from validation.calibration.forward_fit import Options, fit_forward
from validation.calibration.model import Pose
from validation.calibration.uncertainty import describe_fit
from validation.data_sets import score
from validation.data_sets.images import observe, read_images
from validation.data_sets.results import compare_with_nulls
from validation.errors import InputError
from validation.sensor_file import load

pytestmark = pytest.mark.slow

SENSOR = dataclasses.replace(load("wts-0614-34"), array=ARRAY)
#: Largest count in the recordings and largest that the sensor gives [-].
WHITE, MOST = 4095, SENSOR.electronics.output_max
#: Loads of the series [N]; letters of those that are fitted and of those that are scored.
LOADS = {letter: 1.0 + number for number, letter in enumerate("ABCDEFGH")}
FITTED, SCORED = "ACEG", "BDFH"
FILE = f"""
name = "made up"
indenter = "{STAMP_TEXT}"
window = [4, 8]
[[series]]
name = "weights"
files = "*.mcap"
at = ["0.5 mm", "-1 mm"]
[[split]]
name = "between"
fit = {{ series = "weights", files = ["[{FITTED}]*"] }}
score = {{ series = "weights", files = ["[{SCORED}]*"] }}
"""


def record(folder, corrupt=""):
    """Write two noisy recordings per load at varying temperatures, those of the loads in `corrupt` in another pose."""
    random = np.random.default_rng(5)
    curve = make_curve(draw_gains(random), warm=0.01)
    folder.mkdir()
    for letter, newtons in LOADS.items():
        for repeat in (1, 2):
            pose = Pose(4e-3, 2e-3) if letter in corrupt else Pose(0.5e-3, -1e-3)
            degrees = 25.0 + 4.0 * random.random()
            options = {"temperature": degrees, "random": random, "scatter": 0.02, "seconds": 10.0, "rate": 3.0}
            write(press(uniform_method(), curve, newtons, pose, **options), folder / f"{letter}{repeat}.mcap")
    return write_data_set(folder, FILE)


def score_set(data_set, name="uniform"):
    """Score a data set by one forward model, of uniform pressure."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(score, "list_methods", lambda *_: {name: uniform_method()})
        return score.score_recordings(data_set, SENSOR, fastmodel.load("wts-0614-34"))


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A data set and its scores."""
    data_set = record(tmp_path_factory.mktemp("score") / "plain")
    return data_set, score_set(data_set)


def read(data_set, letters):
    return [image for image in read_images(data_set, ARRAY)[0] if image.file.path.name[0] in letters]


def fit(data_set, *, gains):
    options = Options(output_max=MOST, heights=True, sessions=True)
    seen = observe(read(data_set, FITTED))
    chosen = choose_options(uniform_method(), seen, options, observe(read(data_set, SCORED)))[0]
    chosen = dataclasses.replace(chosen, gains=gains, heights=gains and chosen.heights)
    return fit_forward(uniform_method(), seen, chosen)


def test_models_and_null_models_do_not_see_what_they_are_scored_on(tmp_path, plain):
    """Fits and predictions are the same with another place in the scored recordings, not in the fitted."""
    data_set, found = plain
    blind = score_set(record(tmp_path / "blind", corrupt=SCORED))
    wrong = score_set(record(tmp_path / "wrong", corrupt="G"))
    assert found.problems == ()
    # what the fitted recordings determine is said of the fast model only, which this one is not
    assert [len(each) for each in found.notes.values()] == [1]
    assert {name for row in found.rows for name in row.fitted} == {image.file.name for image in read(data_set, FITTED)}
    for gains in (False, True):
        rows = [each.row("between", "uniform", texel_gains=gains) for each in (found, blind, wrong)]
        assert rows[0].parameters == fit(data_set, gains=gains).parameters()
        assert rows[1].parameters == rows[0].parameters
        assert rows[2].parameters != rows[0].parameters
        np.testing.assert_array_equal(rows[1].electronics.gains, rows[0].electronics.gains)
        assert rows[1].pooled["image_changed_percent"].mean > 2 * rows[0].pooled["image_changed_percent"].mean
    assert set(found.examples[0].predicted) > {row.model for row in found.rows if row.kind == "null"}
    for name, image in found.examples[0].predicted.items():
        np.testing.assert_array_equal(image, blind.examples[0].predicted[name])
        assert name == "zeros" or (image != wrong.examples[0].predicted[name]).any()


def test_what_the_fitted_recordings_determine_is_said_of_the_fast_model(plain):
    data_set, _ = plain
    found = score_set(data_set, score.FAST)
    compared, errors, *determined = found.notes["between"]
    assert compared == compare_with_nulls(found.rows)
    left_out = found.left_out["between"]["even seat"]
    assert f"power 0, 1, 8: even seat {', '.join(f'{each:.0f}' for each in left_out)}" in errors
    assert determined == list(describe_fit(fit(data_set, gains=True)))


def predict_nulls(images):
    """Compute null models anew: function from load and temperature to counts, by name.

    The recordings have one age and no threshold, and their temperatures vary too little for a common coefficient.
    """
    loads, counts = np.array([image.load for image in images]), np.array([image.counts for image in images])
    mean, heaviest = counts.mean(axis=0), counts[loads == loads.max()].mean(axis=0)
    sizes = np.polyfit(loads, counts @ mean / (mean @ mean), 2)
    degrees = np.array([image.temperature for image in images])
    middle = degrees.mean()
    line, parabola = (fit_censored(counts, np.vander(loads, degree + 1)) for degree in (1, 2))
    warm = fit_censored(
        counts, np.column_stack([loads, np.ones_like(loads), loads * (degrees - middle), degrees - middle])
    )
    return {
        "zeros": lambda load, _: 0 * mean,
        "mean pattern x load curve": lambda load, _: np.polyval(sizes, load) * mean,
        "line per texel": lambda load, _: line @ [load, 1],
        "quadratic per texel": lambda load, _: parabola @ [load**2, load, 1],
        "line per texel x temperature per texel": (
            lambda load, degrees: warm @ [load, 1, load * (degrees - middle), degrees - middle]
        ),
        "heaviest image x load ratio": lambda load, _: heaviest * load / loads.max(),
    }


def fit_censored(counts, terms):
    """Least squares of every texel, shape (n, terms); a count of zero only bounds the signal above."""

    def misfit(part, recorded):
        signal = terms @ part
        return np.where(recorded > 0, signal - recorded, np.maximum(signal, 0))

    start = np.linalg.lstsq(terms, counts, rcond=None)[0].T
    return np.array([least_squares(misfit, one, args=(each,)).x for one, each in zip(start, counts.T, strict=True)])


def change(images, predicted):
    """Mean absolute difference of grey levels over white [%], by case the mean of its repeats."""
    cases = {}
    for image, counts in zip(images, predicted, strict=True):
        grey, other = (np.rint(255 * np.maximum(each, 0) / WHITE) for each in (image.counts, counts))
        cases.setdefault(image.case, []).append(100 / 255 * np.abs(grey - other).mean())
    return {case: np.mean(values) for case, values in cases.items()}


def test_each_row_scores_the_model_that_it_names(plain):
    data_set, found = plain
    scored = read(data_set, SCORED)
    nulls = predict_nulls(read(data_set, FITTED))
    errors = {
        (name, False): change(scored, [np.minimum(predict(image.load, image.temperature), MOST) for image in scored])
        for name, predict in nulls.items()
    }
    for gains in (False, True):
        errors["uniform", gains] = change(scored, fit(data_set, gains=gains).predict(observe(scored)))
    saturating = {("line per texel, saturating", False), ("heaviest image x load ratio, threshold added back", False)}
    shown = {(row.model, row.texel_gains) for row in found.rows if row.kind != "floor"}
    assert shown == set(errors) | saturating
    for (name, gains), expected in errors.items():
        row = found.row("between", name, texel_gains=gains)
        values = {case: each.image_changed_percent for case, each in row.per_case.items()}
        assert values == pytest.approx(expected, abs=0.01), name  # two grey levels of one texel
        mean = np.mean(list(values.values()))
        assert row.pooled["image_changed_percent"].mean == pytest.approx(mean, rel=1e-6)
        for null, value in row.skill.items():
            other = found.row("between", null).pooled["image_changed_percent"].mean
            assert value.mean == pytest.approx(1 - mean / other, rel=1e-6)
    firsts, seconds = scored[::2], scored[1::2]
    assert [image.file.path.stem for image in firsts] == [f"{letter}1" for letter in SCORED]
    sums = [first.counts.sum() / second.counts.sum() for first, second in zip(firsts, seconds, strict=True)]
    for name, ratios in (("repeat of the same load", np.ones(4)), ("repeat, scaled to the same sum", sums)):
        expected = change(firsts, [ratio * image.counts for ratio, image in zip(ratios, seconds, strict=True)])
        row = found.row("between", name)
        assert {case: each.image_changed_percent for case, each in row.per_case.items()} == pytest.approx(expected)


def test_the_example_shows_the_heaviest_scored_recording(plain):
    data_set, found = plain
    (example,), heaviest = found.examples, read(data_set, "H")[0]
    assert example.load == LOADS["H"]
    assert example.case == heaviest.file.name
    counts = {
        "uniform, texel gains": fit(data_set, gains=True).predict(observe([heaviest]))[0],
        "uniform": fit(data_set, gains=False).predict(observe([heaviest]))[0],
    }
    shape = (ARRAY.rows, ARRAY.columns)
    for name, expected in counts.items():
        np.testing.assert_array_equal(example.predicted[name], np.rint(255 * expected / WHITE).reshape(shape))
    np.testing.assert_array_equal(example.recorded, np.rint(255 * heaviest.counts / WHITE).reshape(shape))


@pytest.mark.parametrize("change", [lambda counts: 0 * counts, lambda counts: -counts])
def test_recordings_that_show_no_load_are_named(plain, monkeypatch, change):
    real = score.read_images

    def read_changed(*options):
        images, faults = real(*options)
        return [dataclasses.replace(each, counts=change(each.counts)) for each in images], faults

    monkeypatch.setattr(score, "read_images", read_changed)
    with pytest.raises(InputError, match=r"A1\.mcap.* show no load"):
        score_set(plain[0])
