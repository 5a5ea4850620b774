"""Gains in two levels: a made-up laboratory whose gains change from session to session by known factors."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.laboratory import ARRAY, STAMP, draw_gains, make_curve, uniform_method
from validation.calibration.cross_validation import SEATS, choose_options, list_folds
from validation.calibration.forward_fit import Options, fit_forward
from validation.calibration.model import Observations, Placement, Pose, join_observations, seat_unevenly

METHOD = uniform_method()
LOADS = np.array([4.0, 6.0, 8.0, 10.0, 12.0])
PLACES = [Placement(name=name, indenter=STAMP) for name in ("first", "second", "third")]
POSE = Pose(0.4e-3, -0.8e-3)
OPTIONS = Options(sessions=True, creep=0.0)


def observe(random, gains, placement, *, loads=LOADS, temperature=30.0, heights=None):
    """Images of one session, with errors of 1 % of each texel and 3 counts."""
    curve = make_curve(gains, warm=0.01)
    forces = METHOD.texel_forces(STAMP, loads, POSE)
    counts = curve.predict(
        forces if heights is None else seat_unevenly(forces, heights),
        temperatures=np.full(len(loads), temperature),
        ages=np.full(len(loads), 2.0),
        thresholds=np.zeros(len(loads)),
    )
    noise = 1 + 0.01 * random.standard_normal(counts.shape)
    return Observations(
        loads=loads,
        counts=np.maximum(counts * noise + 3 * random.standard_normal(counts.shape) * (counts > 0), 0),
        measured=np.ones(counts.shape, dtype=bool),
        placements=(placement,) * len(loads),
        groups=tuple(f"{placement.name} {load:g}" for load in loads),
        temperatures=np.full(len(loads), temperature),
        ages=np.full(len(loads), 2.0),
        thresholds=np.zeros(len(loads)),
        creep=np.full(len(loads), np.nan),
    )


def join(*parts):
    return join_observations(parts)


@pytest.mark.parametrize(
    "spread", [pytest.param(0.1, marks=pytest.mark.slow), pytest.param(0.4, marks=pytest.mark.slow)]
)
def test_the_spread_between_sessions_is_estimated_and_a_placing_image_reduces_the_error(spread):
    random = np.random.default_rng(7)
    gains = draw_gains(random)
    sessions = [gains * np.exp(spread * random.standard_normal(len(gains))) for _ in PLACES]
    seen = [observe(random, own, place) for own, place in zip(sessions, PLACES, strict=True)]
    third = seen[2]
    placing, scored = third.select(third.loads == 8), third.select(third.loads != 8)
    without = fit_forward(METHOD, join(*seen[:2]), OPTIONS)
    found = fit_forward(METHOD, join(*seen[:2], placing), OPTIONS)
    lit = int((third.counts > 0).any(axis=0).sum())
    # Two sessions determine the spread to about 1 / sqrt(2 x texels); twice that and the steps of the search.
    assert found.session_spread == pytest.approx(spread, rel=2 / np.sqrt(2 * lit) + 0.16)
    assert without.session_spread == pytest.approx(spread, rel=2 / np.sqrt(lit) + 0.16)
    placed = replace(without, poses={**without.poses, "third": POSE})
    errors = [np.abs(each.predict(scored) - scored.counts).mean() for each in (placed, found)]
    assert errors[1] < 0.5 * errors[0]


def test_images_are_predicted_with_the_gains_of_their_own_session_and_strange_ones_with_the_common():
    random = np.random.default_rng(3)
    gains = draw_gains(random)
    sessions = [gains * np.exp(0.3 * random.standard_normal(len(gains))) for _ in PLACES[:2]]
    seen = [observe(random, own, place, loads=LOADS[1::2]) for own, place in zip(sessions, PLACES, strict=False)]
    found = fit_forward(METHOD, join(*seen), OPTIONS)
    one, two = (found.predict(each) for each in seen)
    lit = (seen[0].counts > 50).all(axis=0) & (seen[1].counts > 50).all(axis=0)
    for made, own, other in ((one, *seen), (two, *seen[::-1])):
        assert np.abs(made[:, lit] / own.counts[:, lit] - 1).max() < 0.1
        assert np.abs(made[:, lit] / other.counts[:, lit] - 1).mean() > 0.2
    np.testing.assert_array_equal(found.predict(join(*seen)), np.vstack([one, two]))
    common = found.curve.predict(
        METHOD.texel_forces(STAMP, LOADS[1::2], POSE, smooth=True),
        temperatures=np.full(2, 30.0), ages=np.full(2, 2.0), thresholds=np.zeros(2),
    )  # fmt: skip
    strange = replace(found, poses={**found.poses, "third": POSE})
    third = replace(seen[0], placements=(PLACES[2],) * 2)
    assert strange.predict(third) == pytest.approx(common)


def test_one_session_alone_is_fitted_without_changes_of_gains():
    random = np.random.default_rng(2)
    gains = draw_gains(random)
    seen = observe(random, gains, PLACES[0])
    found, plain = (fit_forward(METHOD, seen, replace(OPTIONS, sessions=each)) for each in (True, False))
    np.testing.assert_array_equal(found.predict(seen), plain.predict(seen))
    assert np.isnan(found.session_spread)


def test_a_temperature_that_rises_with_the_load_is_that_of_the_session():
    """The coefficient is found from two sessions, although in each the temperature rises with the load."""
    random = np.random.default_rng(4)
    gains = draw_gains(random)
    parts = []
    for place, degrees in zip(PLACES[:2], (30.0, 45.0), strict=True):
        part = observe(random, gains, place, temperature=degrees)
        parts.append(replace(part, temperatures=degrees + 0.4 * (LOADS - LOADS.mean())))
    found = fit_forward(METHOD, join(*parts), OPTIONS)
    assert found.warmth == pytest.approx({"first": 30.0, "second": 45.0})
    assert found.curve.gain_temperature == pytest.approx(0.01 / 1.075, rel=0.1)


def choose(heights):
    random = np.random.default_rng(1)
    seen = observe(random, draw_gains(random), PLACES[0], loads=np.arange(3.0, 12.0), heights=heights)
    fitted, scored = (seen.select(np.arange(9) % 2 == odd) for odd in (0, 1))
    return choose_options(METHOD, fitted, replace(OPTIONS, heights=True), scored)


@pytest.mark.slow
def test_cross_validation_takes_heights_for_an_uneven_seat_only_where_they_predict_better():
    uneven = np.random.default_rng(9).uniform(0, 3.0, ARRAY.count)
    chosen, errors = choose(uneven)
    assert chosen.heights
    assert min(errors[SEATS[True]]) < 0.8 * errors[SEATS[False]][1]
    assert [len(each) for each in errors.values()] == [3, 3]
    even = choose(None)[1]
    assert min(map(min, even.values())) > 0.8 * even[SEATS[False]][1]


def test_left_out_images_are_to_the_others_as_the_scored_ones_to_the_fitted():
    random = np.random.default_rng(1)
    gains = draw_gains(random)
    one, two = (observe(random, gains, place) for place in PLACES[:2])

    def left_out(seen, loads, place):
        return [sorted(set(seen.loads[out].tolist())) for out in list_folds(seen, np.array(loads), [place])]

    assert left_out(one, [14.0], PLACES[0]) == [[12.0]]
    assert left_out(one, [2.0], PLACES[0]) == [[4.0]]
    assert left_out(one, [5.0, 14.0], PLACES[0]) == [[6.0], [8.0], [10.0], [12.0]]
    two = observe(random, gains, PLACES[1], loads=np.array([3.0, 5.0, 14.0]))
    folds = list_folds(join(one, two), LOADS, [PLACES[2]])
    assert [out.tolist() for out in folds] == [
        [True, True, False, True, True] + [False] * 3, [False] * 5 + [True, False, True]
    ]  # fmt: skip


def test_an_uneven_seat_shares_the_load_and_carries_nothing_without_one():
    heights = np.array([0.0, 0.5, 5.0])
    even = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 2.0]])
    with np.errstate(all="raise"):
        found = seat_unevenly(even, heights)
    assert found[0].tolist() == [0.0, 0.0, 0.0]
    assert found[1] == pytest.approx([0.25 * 6.625, 0.25 * 6.125, 0.5 * 1.625])  # springs under one approach of 6.625
