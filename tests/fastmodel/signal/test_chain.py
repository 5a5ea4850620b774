import copy
import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt

from fastmodel import WTS_0614_34, Butterworth, Gaussian, Parameters
from fastmodel.contact.interface import Reading
from fastmodel.signal.chain import SignalChain
from meshes import TexelArray

ARRAY = TexelArray.grid(5, 4, 3e-3)
ARRAY = dataclasses.replace(ARRAY, active=np.arange(ARRAY.count) % 7 != 3)
PARAMETERS = Parameters(
    array=ARRAY,
    spread=Gaussian.from_sigma(0.7),
    electronics=WTS_0614_34,
    filter=Butterworth(cutoff_hz=40.0, order=5),
)
RATE = 1000.0
#: Force beside the texels in every sample [N].
BESIDE = 0.25


def random_forces(count, seed=0):
    return np.random.default_rng(seed).uniform(0, 1.5, (count, ARRAY.count))


def resting_chain(parameters=PARAMETERS, *, spreads=True):
    chain = SignalChain(parameters, RATE, spreads=spreads)
    chain.settle(Reading(np.zeros(ARRAY.count), None, 0.0))
    return chain


def run(chain, forces, every):
    """A frame after every so many samples, and the force outside at that frame."""
    found = []
    for k, sample in enumerate(forces):
        chain.take(Reading(sample, None, sample.sum() + BESIDE))
        if (k + 1) % every == 0:
            found.append((chain.frame(k / RATE), chain.outside))
    return found


@pytest.mark.parametrize("every", [1, 3, 8])
def test_a_frame_is_the_filtered_sample_spread_by_the_operator(every):
    forces = random_forces(4 * every)
    signals = np.column_stack([forces, forces.sum(axis=1) + BESIDE])
    filtered = sosfilt(butter(5, 40.0, fs=RATE, output="sos"), signals, axis=0)[every - 1 :: every]
    operator = PARAMETERS.spread.operator(ARRAY)
    for (frame, outside), expected in zip(run(resting_chain(), forces, every), filtered, strict=True):
        np.testing.assert_allclose(frame.texel_forces, operator @ expected[:-1], atol=1e-12)
        assert outside == pytest.approx(expected[-1] - frame.texel_forces.sum(), abs=1e-12)


def test_making_frames_changes_no_bit_of_later_frames():
    forces = random_forces(24)
    often, seldom = (run(resting_chain(), forces, every)[-1][0] for every in (2, 12))
    np.testing.assert_array_equal(often.texel_forces, seldom.texel_forces)
    np.testing.assert_array_equal(often.counts, seldom.counts)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.floats(-3, 3))
def test_spread_and_filter_commute(seed, factor):
    """Filtering spread forces gives the same as spreading filtered forces, and both are linear."""
    forces = factor * random_forces(10, seed)
    operator = PARAMETERS.spread.operator(ARRAY)
    after = run(resting_chain(), forces, 10)[-1][0].texel_forces
    before = run(resting_chain(spreads=False), forces @ operator.T, 10)[-1][0].texel_forces
    np.testing.assert_allclose(after, before, atol=1e-12)


def test_forces_that_the_method_has_spread_are_not_spread_again():
    chain = resting_chain(spreads=False)
    spread = random_forces(1)[0]
    for _ in range(400):
        chain.take(Reading(np.zeros(ARRAY.count), spread, spread.sum() + BESIDE))
    np.testing.assert_allclose(chain.frame(0.4).texel_forces, spread, rtol=1e-6)
    assert chain.outside == pytest.approx(BESIDE, rel=1e-6)


@pytest.mark.parametrize(
    "changes",
    [
        {"noise": 0.01},
        {"hysteresis_share": 0.4, "hysteresis_width": 0.05},
        {"temperature_coefficient": 0.01, "temperature_excess": 8.0},
        {"gains": tuple(np.linspace(0.5, 1.5, 20))},
        {"threshold": 30.0},
        {"saturation_band": 3000.0},
        {"characteristic": (-400.0, 2500.0, 10.0, -30.0, 2.0, 0.5)},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_every_stage_of_the_electronics_changes_counts_and_no_force(changes):
    parameters = dataclasses.replace(PARAMETERS, electronics=dataclasses.replace(WTS_0614_34, **changes))
    bare, full = (run(resting_chain(given), random_forces(120), 40)[-1][0] for given in (PARAMETERS, parameters))
    np.testing.assert_array_equal(bare.texel_forces, full.texel_forces)
    assert (bare.counts != full.counts).any()


def test_without_a_filter_the_latest_sample_passes():
    forces = random_forces(19)
    for k, (frame, outside) in enumerate(
        run(resting_chain(dataclasses.replace(PARAMETERS, filter=None), spreads=False), forces, 5)
    ):
        np.testing.assert_array_equal(frame.texel_forces, forces[5 * k + 4])
        assert outside == pytest.approx(BESIDE)


def test_masked_texels_count_nothing_and_the_others_do():
    frame, _ = run(resting_chain(spreads=False), np.ones((40, ARRAY.count)), 40)[0]
    assert np.all(frame.counts[~ARRAY.active] == 0)
    assert np.all(frame.counts[ARRAY.active] > 0)
    np.testing.assert_array_equal(frame.image, WTS_0614_34.image(frame.counts).reshape(5, 4))


def test_settling_resets_hysteresis_and_continues_the_noise():
    electronics = dataclasses.replace(WTS_0614_34, noise=0.05, hysteresis_share=0.5, hysteresis_width=0.2)
    chain = resting_chain(dataclasses.replace(PARAMETERS, electronics=electronics))
    runs = []
    for again in (False, True, False):
        chain.settle(Reading(np.zeros(ARRAY.count), None, 0.0))
        if again:
            chain.noise = np.random.default_rng(electronics.seed)
        runs.append([frame.counts for frame, _ in run(chain, random_forces(12), 4)])
    np.testing.assert_array_equal(runs[0], runs[1])
    assert (np.array(runs[1]) != runs[2]).any()


def test_a_settled_chain_remembers_no_heavier_load():
    electronics = dataclasses.replace(WTS_0614_34, hysteresis_share=0.5, hysteresis_width=0.2)
    fresh, pressed, kept = (resting_chain(dataclasses.replace(PARAMETERS, electronics=electronics)) for _ in range(3))
    light, heavy = np.full((40, ARRAY.count), 0.3), np.full((40, ARRAY.count), 2.0)
    for chain in (pressed, kept):
        run(chain, heavy, 4)
    pressed.settle(Reading(np.zeros(ARRAY.count), None, 0.0))
    last = [run(chain, light, 4)[-1][0].counts for chain in (fresh, pressed, kept)]
    np.testing.assert_array_equal(last[0], last[1])
    assert (last[2] > last[0])[ARRAY.active].all()


def test_frames_stay_as_they_were_returned():
    chain = resting_chain(spreads=False)
    first = run(chain, random_forces(3), 3)[-1][0]
    kept = [values.copy() for values in (first.texel_forces, first.counts, first.image)]
    run(chain, random_forces(3, seed=1), 3)
    for values, before in zip((first.texel_forces, first.counts, first.image), kept, strict=True):
        np.testing.assert_array_equal(values, before)
        assert not values.flags.writeable


def test_a_copy_of_a_chain_continues_like_the_original_and_on_its_own():
    original = resting_chain()
    forces = random_forces(12)
    run(original, forces[:6], 4)
    twin = copy.deepcopy(original)
    for (frame, outside), (other, beside) in zip(run(original, forces[6:], 3), run(twin, forces[6:], 3), strict=True):
        np.testing.assert_array_equal(frame.texel_forces, other.texel_forces)
        np.testing.assert_array_equal(frame.counts, other.counts)
        assert outside == beside
        assert frame.texel_forces.sum() > 1


def test_an_unknown_share_of_the_calibration_tip_is_said_once(caplog):
    array = dataclasses.replace(ARRAY, name="never built before")
    for _ in range(2):
        resting_chain(dataclasses.replace(PARAMETERS, array=array))
    (record,) = caplog.records
    assert "never built before" in record.message
    assert "counts are too low" in record.message
    known = dataclasses.replace(WTS_0614_34, tip_share=0.77)
    direct = dataclasses.replace(WTS_0614_34, calibrated="texel force")
    for electronics in (known, direct):
        other = dataclasses.replace(array, name="another")
        resting_chain(dataclasses.replace(PARAMETERS, array=other, electronics=electronics))
    assert len(caplog.records) == 1
