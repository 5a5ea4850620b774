import copy
import dataclasses

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from fastmodel import WTS_0614_34, Butterworth, Gaussian, Parameters
from fastmodel.signal.butterworth import BLOCK, FilterBank
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


@pytest.fixture(params=[False, True], ids=["numpy", "numba"])
def native(request):
    if request.param:
        pytest.importorskip("numba")
    return request.param


def samples(count, seed=0):
    """Random forces on each texel and their sum with something outside."""
    forces = np.random.default_rng(seed).uniform(0, 1.5, (count, ARRAY.count))
    return np.column_stack([forces, forces.sum(axis=1) + 0.25])


def chain(native, parameters=PARAMETERS, *, spreads=True):
    made = SignalChain(parameters, RATE, spreads=spreads, native=native)
    made.settle(np.zeros(ARRAY.count + 1))
    return made


def frames(made, signals, every):
    """A frame after so many samples each, and what is outside then."""
    found = []
    for k, signal in enumerate(signals):
        made.room()[:] = signal
        made.take()
        if (k + 1) % every == 0:
            found.append((made.frame(k / RATE), made.outside))
    return found


@pytest.mark.parametrize("every", [1, 3, BLOCK, BLOCK + 1, 3 * BLOCK - 1])
def test_samples_that_wait_are_filtered_as_if_one_by_one(native, every):
    signals = samples(4 * every)
    filtered = sosfilt(butter(5, 40.0, fs=RATE, output="sos"), signals, axis=0)[every - 1 :: every]
    operator = PARAMETERS.spread.operator(ARRAY)
    for (frame, outside), expected in zip(frames(chain(native), signals, every), filtered, strict=True):
        np.testing.assert_allclose(frame.texel_forces, operator @ expected[:-1], atol=1e-12)
        assert outside == pytest.approx(expected[-1] - frame.texel_forces.sum(), abs=1e-12)


def test_when_frames_are_made_changes_no_bit_of_those_made_later():
    pytest.importorskip("numba")
    signals = samples(24)
    often, rarely = (frames(chain(native=True), signals, every)[-1][0] for every in (2, 12))
    np.testing.assert_array_equal(often.texel_forces, rarely.texel_forces)


@pytest.mark.parametrize("spreads", [True, False])
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"gains": tuple(np.linspace(0.5, 1.5, 20)), "threshold": 30.0, "saturation_band": 500.0},
        {"characteristic": (-400.0, 2500.0, 10.0, -30.0, 2.0, 0.5)},
        {"noise": 0.01},
        {"hysteresis_share": 0.4, "hysteresis_width": 0.05},
        {"temperature_coefficient": 0.01, "temperature_excess": 8.0},
    ],
)
def test_compiled_and_numpy_chains_give_the_same_frames(changes, spreads):
    pytest.importorskip("numba")
    parameters = dataclasses.replace(PARAMETERS, electronics=dataclasses.replace(WTS_0614_34, **changes))
    plain, fast = (frames(chain(native, parameters, spreads=spreads), samples(40), 4) for native in (False, True))
    for (one, outside), (other, beside) in zip(plain, fast, strict=True):
        np.testing.assert_allclose(one.texel_forces, other.texel_forces, atol=1e-12)
        np.testing.assert_array_equal(one.counts, other.counts)
        np.testing.assert_array_equal(one.image, other.image)
        assert one.image.shape == other.image.shape == (5, 4)
        assert outside == pytest.approx(beside, abs=1e-12)


@pytest.mark.parametrize(
    "changes",
    [
        {"noise": 0.01},
        {"hysteresis_share": 0.4, "hysteresis_width": 0.05},
        {"temperature_coefficient": 0.01, "temperature_excess": 8.0},
    ],
)
def test_no_stage_is_left_out(changes, native):
    parameters = dataclasses.replace(PARAMETERS, electronics=dataclasses.replace(WTS_0614_34, **changes))
    bare, full = (frames(chain(native, given), samples(12), 4)[-1][0] for given in (PARAMETERS, parameters))
    np.testing.assert_allclose(bare.texel_forces, full.texel_forces, atol=1e-12)
    assert (bare.counts != full.counts).any()


def test_without_a_filter_the_latest_sample_passes(native):
    made = chain(native, dataclasses.replace(PARAMETERS, filter=None), spreads=False)
    signals = samples(2 * BLOCK + 3)
    for k, (frame, outside) in enumerate(frames(made, signals, 5)):
        np.testing.assert_array_equal(frame.texel_forces, signals[5 * k + 4, :-1])
        assert outside == pytest.approx(0.25)


def test_a_sample_that_was_not_taken_in_leaves_no_trace(native):
    made = chain(native)
    before = frames(made, samples(3), 3)[-1][0]
    made.room()[:] = np.nan
    np.testing.assert_array_equal(made.frame(0.0).texel_forces, before.texel_forces)


def test_frames_stay_as_they_were_handed_out(native):
    made = chain(native, spreads=False)
    first = frames(made, samples(3), 3)[-1][0]
    kept = [values.copy() for values in (first.texel_forces, first.counts, first.image)]
    frames(made, samples(3, seed=1), 3)
    for values, before in zip((first.texel_forces, first.counts, first.image), kept, strict=True):
        np.testing.assert_array_equal(values, before)
        assert not values.flags.writeable


def test_a_copy_of_a_filter_goes_on_like_the_original_and_alone(native):
    original = FilterBank(PARAMETERS.filter, RATE, 3, native=native)
    original.settle([1.0, 2.0, 3.0])
    twin = copy.deepcopy(original)
    for values in samples(5)[:, :3]:
        kept = twin.filtered.copy()
        filtered = original.step(values)
        np.testing.assert_array_equal(twin.filtered, kept)
        np.testing.assert_array_equal(twin.step(values), filtered)


def test_a_copy_of_a_chain_goes_on_with_the_samples_that_wait(native):
    original = chain(native)
    signals = samples(12)
    frames(original, signals[:6], 4)
    twin = copy.deepcopy(original)
    for (frame, outside), (other, beside) in zip(
        frames(original, signals[6:], 3), frames(twin, signals[6:], 3), strict=True
    ):
        np.testing.assert_array_equal(frame.texel_forces, other.texel_forces)
        np.testing.assert_array_equal(frame.counts, other.counts)
        assert outside == beside
        assert frame.texel_forces.sum() > 1
