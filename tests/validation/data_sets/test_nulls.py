"""Null models with their nuisance terms: each predicts counts that it describes, and no term is without effect."""

from dataclasses import replace

import numpy as np
import pytest

from meshes import Box
from validation.calibration.model import Observations, Placement
from validation.data_sets.nulls import LINE, NULLS, NullModel, fit_polynomials

TEXELS, THRESHOLD, MOST = 12, 80.0, 3000.0
RANDOM = np.random.default_rng(3)
SLOPES, OFFSETS = RANDOM.uniform(60, 240, TEXELS), RANDOM.uniform(-200, 90, TEXELS)
PATTERN = RANDOM.uniform(0.2, 1.0, TEXELS)
PLACE = Placement(name="here", indenter=Box(size=(0.01, 0.01, 0.01)))


def observe(signal, loads, temperatures, ages, *, level=1.0, warm=0.0, creep=0.12, band=0.0):
    """Images whose signals at 40 degC and 2 s are those of `signal`, a function of the loads, shape (m, n)."""
    loads, temperatures, ages = (np.asarray(each, dtype=float) for each in (loads, temperatures, ages))
    factor = level * (1 + warm * (temperatures - 40)) * (1 + creep * np.log(ages / 2))
    counts = np.maximum(factor[:, None] * signal(loads) - THRESHOLD, 0)
    knee = MOST - band
    counts = np.minimum(counts, MOST) if not band else np.where(
        counts > knee, MOST - band * np.exp(-(counts - knee) / band), counts
    )  # fmt: skip
    return Observations(
        loads=loads,
        counts=counts,
        measured=np.ones(counts.shape, dtype=bool),
        placements=(PLACE,) * len(loads),
        groups=tuple(str(number) for number in range(len(loads))),
        temperatures=temperatures,
        ages=ages,
        thresholds=np.full(len(loads), THRESHOLD),
        creep=np.full(len(loads), creep),
    )


def follow_line(loads):
    return np.outer(loads, SLOPES) + OFFSETS


def follow_pattern(loads):
    return np.outer(400 + 150 * loads + 6 * loads**2, PATTERN)


def follow_ratio(loads):
    return np.outer(300 * loads, PATTERN)


#: Eight loads [N] at two temperatures [degC] and several ages [s].
STATES = (np.tile([2.0, 4.0, 6.0, 9.0], 2), np.repeat([30.0, 45.0], 4), [3, 7, 4, 8, 5, 6, 9, 3])
OTHER = ([3.0, 8.0, 12.0], [52.0, 52.5, 53.0], [4, 12, 7])


@pytest.mark.parametrize(
    ("name", "signal", "options"),
    [
        pytest.param("line per texel", follow_line, {}, marks=pytest.mark.slow),
        pytest.param("line per texel, saturating", follow_line, {"band": 1200.0}, marks=pytest.mark.slow),
        pytest.param("quadratic per texel", follow_line, {}, marks=pytest.mark.slow),
        ("mean pattern x load curve", follow_pattern, {}),
        ("heaviest image x load ratio, threshold added back", follow_ratio, {"band": 900.0}),
    ],
)
def test_a_null_model_predicts_another_temperature_age_and_level(name, signal, options):
    """Counts that follow its shape, with texels below the threshold, are predicted; without a term they are not."""
    fitted = observe(signal, *STATES, warm=0.015, **options)
    placed = observe(signal, [5.0], [52.0], [5.0], warm=0.015, level=1.2, **options)
    for level, images in ((1.0, None), (1.2, placed)):
        expected = observe(signal, *OTHER, warm=0.015, level=level, **options)
        found = NULLS[name].fit(fitted, images, MOST)(expected)
        assert np.abs(found - expected.counts).max() < 0.02 * expected.counts.max(), level
    later = replace(expected, ages=expected.ages * 3)
    assert (NULLS[name].fit(fitted, placed, MOST)(later) / np.maximum(found, 1)).max() > 1.02


def test_a_null_model_with_a_temperature_term_beats_one_without():
    fitted, expected = observe(follow_line, *STATES, warm=0.015), observe(follow_line, *OTHER, warm=0.015)
    assert (fitted.counts == 0).any()
    unknown = replace(fitted, temperatures=np.full(8, np.nan))
    with_term, without = (
        np.abs(LINE.fit(images, None, MOST)(expected) - expected.counts).mean() for images in (fitted, unknown)
    )
    assert with_term < 0.1 * without


def test_gains_of_a_new_session_are_taken_from_its_placing_image():
    """Texels change by different factors; only the model that scales each texel follows."""
    other = np.exp(RANDOM.normal(0, 0.3, TEXELS))
    fitted = observe(lambda loads: np.outer(loads, SLOPES) + 90, *STATES, warm=0.01)
    placed, expected = (
        observe(lambda loads: other * (np.outer(loads, SLOPES) + 90), *states, warm=0.01)
        for states in (([5.0], [52.0], [5.0]), OTHER)
    )
    errors = {
        name: np.abs(NULLS[name].fit(fitted, placed, MOST)(expected) - expected.counts).mean()
        for name in ("line per texel", "line per texel, each scaled to the placing image")
    }
    assert errors["line per texel, each scaled to the placing image"] < 1
    assert errors["line per texel"] > 20
    assert not NULLS["line per texel, each scaled to the placing image"].applies(fitted, None)


def test_a_temperature_for_each_texel_needs_known_temperatures():
    model = NullModel(shape=lambda *_: None, least_temperatures=2)
    seen = observe(follow_line, *STATES)
    assert model.applies(seen, None)
    assert not model.applies(replace(seen, temperatures=np.full(8, 30.0)), None)
    assert not model.applies(replace(seen, temperatures=np.r_[np.nan, seen.temperatures[1:]]), None)


def test_a_coefficient_of_temperature_for_each_texel_is_fitted():
    warm = RANDOM.uniform(-0.01, 0.02, TEXELS)

    def predict(loads, temperatures):
        return (1 + np.outer(temperatures - 40, warm)) * (np.outer(loads, SLOPES) + 90)

    loads, temperatures = STATES[:2]
    found = fit_polynomials(loads, temperatures, predict(loads, temperatures), degree=1, warm=True)
    other = np.array([3.0, 8.0]), np.array([50.0, 55.0])
    np.testing.assert_allclose(found(*other), predict(*other), rtol=1e-6)


def test_noise_about_the_zero_of_an_offset_is_not_taken_for_a_threshold():
    """The first texel is not pressed; without a threshold its noise has the mean zero, and so has its prediction."""
    fitted = observe(lambda loads: np.outer(loads, SLOPES) + 90, *STATES, creep=0.0)
    noise = 20.0 * np.array([1, -1, -1, 1, -1, 1, 1, -1])  # both signs at each load
    counts = np.column_stack([noise, fitted.counts[:, 1:]])
    fitted = replace(fitted, counts=counts, thresholds=np.zeros(8))
    found = NULLS["line per texel"].fit(fitted, None, MOST)(fitted)
    assert np.abs(found[:, 0]).max() < 1
