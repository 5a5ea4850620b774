"""Scores of counts show planted defects, and the table of scores prints what its names say."""

import dataclasses

import numpy as np
import pytest

from tests.support.stamp import ARRAY, OUTPUT_MAX, by_name, case_of, synthetic
from validation.calibration.stamp import score, score_counts, score_recordings
from validation.calibration.stamp.fit import fit


def test_count_scores_see_planted_defects_and_ignore_masked_texels():
    counts = synthetic((-0.5e-3, 11.3e-3, 0.0, np.log(0.7)), "H")[0].counts
    same = score_counts(counts, counts.copy(), full_scale=4095, array=ARRAY)
    assert dataclasses.astuple(same) == (0, 0, 0, 0, 0, 0, 1)
    on_mask = counts.copy()
    on_mask[0] = 4000
    assert score_counts(counts, on_mask, full_scale=4095, array=ARRAY) == same
    shifted = score_counts(counts, np.roll(counts, 1), full_scale=4095, array=ARRAY)
    assert shifted.centre_of_pressure_m > 1e-3
    assert shifted.wasserstein_m > 1e-3
    assert shifted.active_area_iou < 1
    louder = score_counts(counts, 1.1 * counts, full_scale=4095, array=ARRAY)
    assert louder.total_counts_error == pytest.approx(0.1)
    assert louder.relative_l2 == pytest.approx(0.1)
    white = score_counts(np.where(np.arange(78) == 50, 4095, 0), np.full(78, 4095.0), full_scale=4095, array=ARRAY)
    assert white.image_changed_percent == pytest.approx(100 * 67 / 68)
    assert white.pixels_changed == 67


#: Loads of the weights A..H [N], and what is fitted and scored in the first split.
LOADS = {letter: 9.80665 * (0.2 + 0.1 * number) for number, letter in enumerate("ABCDEFGH")}
FITTED, SCORED = "ACEG", "BDFH"


def record(*, corrupt="", seed=5):
    """Noisy frames of two recordings per weight; the recordings of the weights in `corrupt` hold nonsense."""
    random = np.random.default_rng(seed)
    cases = {}
    for repeat in (1, 2):
        for case in synthetic((-0.5e-3, 11.3e-3, 0.1, np.log(0.7)), "ABCDEFGH"):
            counts = np.where(case.counts > 0, case.counts * random.normal(1, 0.05, 78), 0.0)
            nonsense = random.uniform(0, 3000, 78)
            letter = case.file.letter
            cases[letter, repeat] = case_of(letter, nonsense if letter in corrupt else counts, repeat)
    return cases


def score_series(monkeypatch, folder, cases):
    """Score a folder of recordings whose frames are those of `cases`, by one fast forward model."""
    (folder / "room").mkdir(exist_ok=True)
    for letter, repeat in cases:
        (folder / "room" / f"{letter}{repeat}.dsa").touch()
    monkeypatch.setattr(score, "read_case", lambda file, _array: cases[file.letter, file.repeat])
    monkeypatch.setattr(score, "models", lambda _array: (by_name("uniform pressure"),))
    monkeypatch.setattr(score, "SPLITS", score.SPLITS[:1])
    return score_recordings(folder)


@pytest.fixture
def scores(monkeypatch, tmp_path):
    return score_series(monkeypatch, tmp_path, record())


def choose(cases, letters):
    return [cases[key] for key in sorted(cases) if key[0] in letters]


def compare_greys(cases, predict):
    """Mean grey difference over white [%]: mean over the weights of the mean over the repeats of each weight."""
    grey = {
        key: abs(np.rint(255 * case.counts / 4095) - np.rint(255 * predict(key) / 4095))
        for key, case in cases.items()
        if key[0] in SCORED
    }
    return [100 / 255 * np.mean([grey[letter, repeat][ARRAY.active].mean() for repeat in (1, 2)]) for letter in SCORED]


def test_a_model_is_fitted_without_the_recordings_that_it_is_scored_on(monkeypatch, tmp_path, scores):
    """The fit is the same without the scored recordings, and with nonsense in them."""
    found = [scores.row("between", "uniform pressure", texel_gains=gains) for gains in (False, True)]
    assert {name[:-1] for name in found[0].fitted} == {f"room {letter}" for letter in FITTED}
    assert set(found[0].per_case) == {f"room {letter}" for letter in SCORED}
    alone = fit(by_name("uniform pressure"), choose(record(), FITTED), ARRAY, output_max=OUTPUT_MAX)
    blind = score_series(monkeypatch, tmp_path, record(corrupt=SCORED))
    for row, expected in zip(found, alone, strict=True):
        assert row.parameters == expected.parameters() | {"rms_counts": expected.rms}
        other = blind.row("between", "uniform pressure", texel_gains=row.texel_gains)
        assert other.parameters == row.parameters
        np.testing.assert_array_equal(other.electronics.gains, row.electronics.gains)
        assert other.pooled["image_changed_percent"].mean > 2 * row.pooled["image_changed_percent"].mean
    wrong = score_series(monkeypatch, tmp_path, record(corrupt="A")).row("between", "uniform pressure")
    assert wrong.parameters != found[0].parameters


def test_each_row_scores_the_model_that_it_names(scores):
    """Every null model is computed anew, from the frames by numpy."""
    cases = record()
    fitted = choose(cases, FITTED)
    loads, counts = np.array([LOADS[case.file.letter] for case in fitted]), np.array([case.counts for case in fitted])
    mean = counts.mean(axis=0)
    sizes = np.polyfit(loads, counts @ mean / (mean @ mean), 2)
    tables = {degree: np.polyfit(loads, counts, degree) for degree in (1, 2)}
    plain, gained = fit(by_name("uniform pressure"), fitted, ARRAY, output_max=OUTPUT_MAX)
    predictions = {
        ("zeros", False): lambda load: np.zeros(78),
        ("mean pattern x load curve", False): lambda load: np.polyval(sizes, load) * mean,
        ("line per texel", False): lambda load: load * tables[1][0] + tables[1][1],
        ("quadratic per texel", False): lambda load: load**2 * tables[2][0] + load * tables[2][1] + tables[2][2],
        ("uniform pressure", False): plain.counts,
        ("uniform pressure", True): gained.counts,
    }
    errors = {
        key: compare_greys(cases, lambda place, predict=predict: np.clip(predict(LOADS[place[0]]), 0, OUTPUT_MAX))
        for key, predict in predictions.items()
    }
    assert {(row.model, row.texel_gains) for row in scores.rows if row.kind != "floor"} == set(errors)
    for (name, gains), expected in errors.items():
        row = scores.row("between", name, texel_gains=gains)
        values = [row.per_case[f"room {letter}"].image_changed_percent for letter in SCORED]
        assert values == pytest.approx(expected, rel=1e-9)
        assert row.pooled["image_changed_percent"].mean == pytest.approx(np.mean(expected))
        for null, value in row.skill.items():
            assert value.mean == pytest.approx(1 - np.mean(expected) / np.mean(errors[null, False]))
    (floor,) = [row for row in scores.rows if row.kind == "floor"]
    firsts = {(letter, repeat): cases[letter, 1] for letter, repeat in cases}
    differences = compare_greys(firsts, lambda place: cases[place[0], 2].counts)
    assert floor.pooled["image_changed_percent"].mean == pytest.approx(np.mean(differences))


def test_the_example_shows_the_heaviest_scored_recording_and_what_each_model_predicts(scores):
    (example,), cases = scores.examples, record()
    plain, gained = fit(by_name("uniform pressure"), choose(cases, FITTED), ARRAY, output_max=OUTPUT_MAX)
    assert example.case == "room H1"
    assert example.load == pytest.approx(LOADS["H"])
    shown = {
        "recorded": (example.recorded, cases["H", 1].counts),
        "plain": (example.predicted["uniform pressure"], plain.counts(LOADS["H"])),
        "gained": (example.predicted["uniform pressure, texel gains"], gained.counts(LOADS["H"])),
    }
    for image, counts in shown.values():
        grey = np.where(ARRAY.active, np.rint(255 * counts / 4095), 0).reshape(13, 6)
        np.testing.assert_array_equal(image, grey)
