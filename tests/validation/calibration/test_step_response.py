"""The filter from a step of the load: its step response, coverage of the intervals, and refusals."""

import dataclasses
import json
import tomllib

import numpy as np
import pytest
from scipy.signal import butter, lsim, sosfilt, step

from fastmodel.signal.creep import Creep
from meshes import TexelArray
from validation.calibration.step_response import fit_step, respond, sum_pressed
from validation.errors import InputError
from validation.recordings.recording import RecordedArray


def record(order, cutoff, rate, seed, *, noise=10.0, delay=0.004, creep=0.1):
    """Sums of counts at the frames of a sensor with a filter, a delay and creep; the step lies between two frames."""
    random, fine = np.random.default_rng([order, round(10 * cutoff), seed]), 20e3
    at, times = 1.0 + random.uniform(0, 1 / rate), np.arange(int(2 * fine)) / fine
    ladder = Creep(creep)
    after = np.clip(times - at - delay, 0, None)[:, None]
    load = ladder.instant + ladder.weight * (1 - np.exp(-after / ladder.times)).sum(axis=1)
    passed = sosfilt(butter(order, cutoff, fs=fine, output="sos"), 2000 * load * (times >= at + delay))
    frames = np.arange(int(2 * rate)) / rate
    return frames, 500 + np.interp(frames, times, passed) + random.normal(0, noise, len(frames)), at


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_the_step_response_equals_that_of_scipy(order):
    times = np.linspace(0, 12, 50)
    b, a = butter(order, 1.0, analog=True)
    _, exact = step((b, a), T=times)
    assert respond(order, times) == pytest.approx(exact, abs=1e-6)
    assert not respond(order, -times).any()


def test_a_filter_is_found_with_its_order_and_delay():
    found = fit_step(*record(2, 12.0, 271.0, 2))
    assert found.orders == (2,)
    assert found.cutoff.value == pytest.approx(12.0, rel=0.03)
    assert found.cutoff.low < 12 < found.cutoff.high < 1.1 * found.cutoff.low
    assert found.delay.value == pytest.approx(4e-3, abs=1e-3)
    assert not found.reason


@pytest.mark.slow
def test_an_interval_is_symmetric_in_the_logarithm_and_the_noise_is_that_of_the_fit():
    """Noise of 10 counts; frames from half a second before the step to a second after it."""
    found = fit_step(*record(2, 12.0, 271.0, 2))
    assert found.cutoff.low * found.cutoff.high == pytest.approx(found.cutoff.value**2)
    assert found.delay.low + found.delay.high == pytest.approx(2 * found.delay.value)
    assert found.noise == pytest.approx(10.0, rel=0.15)
    assert abs(found.frames - 1.5 * 271) <= 1
    assert found.cutoff.fitted_on == f"{found.frames} frames about the step"
    louder = fit_step(*record(2, 12.0, 271.0, 2, noise=20.0))
    width, wider = (np.log(each.cutoff.high / each.cutoff.low) for each in (found, louder))
    assert wider == pytest.approx(2 * width, rel=0.2)


@pytest.mark.parametrize(
    ("changes", "kept"),
    [
        # change of each texel, which rests at 100: texels from 30 % of the largest change on are summed
        ((100, 31, 29, 0), [0, 1]),
        ((-90, 28, 26, 0), [0, 1]),
        ((10, 0, 0, 0), [0]),
    ],
)
def test_the_texels_that_the_step_changes_are_summed_where_none_reads_zero(changes, kept):
    times = np.arange(100) / 50
    counts = 100 + np.outer(times > 1.0, changes)
    counts[::10, 3] = 0  # not pressed
    counts[3, kept[0]] = 0
    counts[times < 0.5] += [0, 0, 500, 0]  # more than half a second before
    array = RecordedArray(texels=TexelArray.grid(2, 2, pitch=3e-3), enabled=np.ones(4, dtype=bool),
                          counts=counts.astype(np.int32), full_scale=4095)  # fmt: skip
    found, sums = sum_pressed(array, times, 1.0)
    assert found == pytest.approx(np.delete(times, 3))
    assert sums[-1] == sum(100 + changes[texel] for texel in kept)
    on = np.arange(4) != kept[-1]
    masked = dataclasses.replace(array, enabled=on)
    if len(kept) > 1:
        assert sum_pressed(masked, times, 1.0)[1][-1] == 100 + changes[0]
    assert sum_pressed(array, times, 5.0)[1][-1] == counts[-1].sum()
    with pytest.raises(InputError, match="every texel of the array is switched off"):
        sum_pressed(dataclasses.replace(array, enabled=np.zeros(4, dtype=bool)), times, 1.0)


@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("rate", [0.2, 1.7])
def test_the_response_to_a_decaying_load_equals_that_of_scipy(order, rate):
    times = np.linspace(0, 10, 2001)
    b, a = butter(order, 1.0, analog=True)
    _, exact, _ = lsim((b, a), np.exp(-rate * times), times)
    found = respond(order, times, np.array([rate, 0.0]))
    assert found == pytest.approx(exact + respond(order, times), abs=1e-4)


@pytest.mark.slow
def test_frames_that_cannot_tell_the_filter_bound_it():
    found = fit_step(*record(1, 100.0, 31.0, 3))
    assert "do not tell the filter from a jump" in found.reason
    assert found.cutoff.high == np.inf
    assert np.isnan(found.cutoff.value)
    assert 3 < found.cutoff.low < 100


@pytest.mark.bench
@pytest.mark.slow
@pytest.mark.parametrize(("rate", "least"), [(271.0, 0.8), (31.0, 0.8)])
def test_intervals_cover_over_orders_and_cutoffs(rate, least):
    """Pooled over orders 1 to 4 and cut-offs of 2 to 100 Hz; 32 steps."""
    held = [
        found.cutoff.low <= cutoff <= found.cutoff.high
        for order in (1, 2, 3, 4)
        for cutoff in (2.0, 10.0, 30.0, 100.0)
        for seed in range(2)
        for found in [fit_step(*record(order, cutoff, rate, seed))]
    ]
    assert np.mean(held) >= least


@pytest.mark.parametrize(
    "spoil",
    [
        lambda times, sums, at: np.where(times > at + 0.5, 500, sums),
        pytest.param(lambda _times, sums, _at: np.roll(sums, -14), marks=pytest.mark.slow),
        pytest.param(
            lambda times, sums, at: np.where((times > at + 0.1) & (times < at + 0.3), sums + 300, sums),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["lifted after half a second", "50 ms late", "a second touch"],
)
def test_counts_that_no_filter_describes_are_refused(spoil):
    times, sums, at = record(2, 12.0, 271.0, 1)
    with pytest.raises(InputError, match=r"no filter describes|do not change"):
        fit_step(times, spoil(times, sums, at), at)


def test_counts_of_zero_before_the_step_are_refused():
    counts = np.array([[0, 0]] * 20 + [[50, 30]] * 40)
    texels = TexelArray.grid(1, 2, pitch=3e-3)
    array = RecordedArray(
        texels=texels, enabled=np.ones(2, dtype=bool), counts=counts.astype(np.int32), full_scale=4095
    )
    with pytest.raises(InputError, match="preload"):
        sum_pressed(array, np.arange(60) / 100, 0.2)
    times, sums = sum_pressed(dataclasses.replace(array, counts=array.counts + 7), np.arange(60) / 100, 0.2)
    assert len(times) == 60
    assert sums[[0, -1]].tolist() == [14, 94]


@pytest.mark.parametrize(
    ("at", "words"),
    [(5.0, "outside the recording"), (-1.0, "outside"), (0.01, "fewer than 5 frames before"), (0.5, "do not change")],
)
def test_a_wrong_instant_is_refused(at, words):
    times, sums, _ = record(2, 12.0, 271.0, 1)
    with pytest.raises(InputError, match=words):
        fit_step(times, sums, at)


def test_the_command_prints_the_filter_of_a_recording(softcover, tmp_path):
    times, sums, at = record(2, 12.0, 271.0, 5)
    share = np.array([[0.6, 0.3, 0.1, 0.0]])
    counts = np.round(sums[:, None] * share).astype(int)
    lines = ["time," + ",".join(f"texel{k}" for k in range(4))]
    lines += [f"{time:.6f}," + ",".join(map(str, row)) for time, row in zip(times, counts.tolist(), strict=True)]
    (tmp_path / "step.csv").write_text("\n".join(lines))
    (tmp_path / "sensor.toml").write_text(
        '[array]\nrows = 2\ncolumns = 2\npitch = "3 mm"\n[[cover.layer]]\nthickness = "2 mm"\nmaterial = "tpu"\n'
    )
    arguments = ("calibrate", "step.csv", "--sensor", "sensor.toml", "--step")
    status, out, _ = softcover(*arguments, f"{at:.5f}s", "--json")
    assert status == 0
    assert json.loads(out)["cutoff"]["value"] == pytest.approx(12.0, rel=0.05)
    status, out, _ = softcover(*arguments, f"{at:.5f}s")
    written = tomllib.loads(out[out.index("[filter]") :])["filter"]
    assert written == {"cutoff": "11.86 Hz", "order": 2}
    status, _, err = softcover(*arguments, "1s", "--out", "new.toml")
    assert status == 2
    assert "--out: has no effect with --step" in err
    status, _, err = softcover(*arguments, "7s")
    assert status == 2
    assert "outside the recording" in err
    status, _, err = softcover("calibrate", "step.csv", "step.csv", "--sensor", "sensor.toml", "--step", "1s")
    assert status == 2
    assert "takes one recording" in err
