import dataclasses

import numpy as np
import pytest

from fastmodel.errors import ShapeError
from fastmodel.signal.electronics import WTS_0614_34, Electronics

PLAIN = Electronics(rate_hz=100.0, sensitivity=1000.0)


def test_the_reports_line():
    forces = np.array([0.0, 0.18, 0.19, 1.0, 1.64, 1.65, 5.0, -0.3])
    counts = WTS_0614_34.counts(forces)
    assert counts.tolist() == [0, 0, 13, 2172, 3878, 3895, 3895, 0]
    assert np.issubdtype(counts.dtype, np.integer)


def test_image_is_grey_of_full_output():
    image = WTS_0614_34.image([[0, 3895], [1948, 1]])
    assert image.dtype == np.uint8
    assert image.tolist() == [[0, 255], [128, 0]]


def test_fifth_degree_characteristic_and_gains():
    chain = Electronics(rate_hz=100, sensitivity=1, characteristic=(10, 100, 5, 0, 0, -1), gains=(1.0, 2.0))
    assert chain.counts([2.0, 2.0]).tolist() == [198, 396]
    with pytest.raises(ShapeError, match="2 texels"):
        chain.counts([1.0, 1.0, 1.0])


def test_threshold_is_subtracted_as_the_firmware_does():
    chain = Electronics(rate_hz=100, sensitivity=1000, threshold=100)
    assert chain.counts([0.05, 0.1, 0.101, 0.3]).tolist() == [0, 0, 1, 200]


def test_soft_saturation_is_smooth_monotonic_and_bounded():
    chain = Electronics(rate_hz=100, sensitivity=1000, output_max=4000, saturation_band=800)
    force = np.linspace(0, 20, 4001)
    counts = chain.counts(force)
    assert np.array_equal(counts[force <= 3.2], np.rint(1000 * force[force <= 3.2]))
    assert np.all(np.diff(counts) >= 0)
    assert np.abs(np.diff(counts, 2)).max() <= 2
    assert counts.max() == 4000


def test_noise_is_seeded_and_has_the_stated_width():
    chain = dataclasses.replace(WTS_0614_34, noise=0.01)
    force = np.full((2000, 84), 1.0)
    first = chain.counts(force, np.random.default_rng(3))
    again = chain.counts(force, np.random.default_rng(3))
    assert np.array_equal(first, again)
    assert first.std() == pytest.approx(26.657, rel=0.01)
    assert chain.counts(force).std() == 0


def test_every_fault_is_listed():
    with pytest.raises(ValueError, match=r"rate_hz.*sensitivity.*output_max.*1..4095.*threshold"):
        Electronics(rate_hz=0, sensitivity=-1, output_max=5000, threshold=-3)
    with pytest.raises(ValueError, match=r"c0\.\.c5"):
        Electronics(rate_hz=1, sensitivity=1, characteristic=(1.0, 2.0))


def test_hysteresis_is_a_loop_of_the_stated_height_that_knows_no_rate():
    electronics = dataclasses.replace(PLAIN, hysteresis_share=0.4, hysteresis_width=0.05)
    play = np.zeros(1)
    loading = [electronics.lag(np.array([f]), play)[0] for f in np.linspace(0, 1, 11)]
    unloading = [electronics.lag(np.array([f]), play)[0] for f in np.linspace(1, 0, 11)][::-1]
    height = np.subtract(unloading, loading)[2:-2]
    np.testing.assert_allclose(height, 2 * 0.4 * 0.05)
    assert unloading[0] == pytest.approx(0.4 * 0.05)  # what stays when the load has gone
    slow, quick = np.zeros(1), np.zeros(1)
    for f in np.linspace(0, 1, 500):
        electronics.lag(np.array([f]), slow)
    electronics.lag(np.ones(1), quick)
    assert slow == pytest.approx(quick)


def test_without_hysteresis_forces_pass_as_they_are():
    forces, play = np.array([0.3, -0.1]), np.zeros(2)
    assert PLAIN.lag(forces, play) is forces


def test_warmth_scales_the_felt_force():
    warm = dataclasses.replace(PLAIN, temperature_coefficient=0.004, temperature_excess=25.0)
    forces = np.array([0.5, 1.0])
    np.testing.assert_array_equal(warm.counts(forces), PLAIN.counts(1.1 * forces))


@pytest.mark.parametrize(
    "wrong",
    [
        {"hysteresis_share": 1.5},
        {"hysteresis_width": -0.1},
        {"temperature_coefficient": -0.1, "temperature_excess": 20.0},
        {"temperature_excess": float("nan"), "temperature_coefficient": 1.0},
    ],
)
def test_stages_that_make_no_sense_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        dataclasses.replace(PLAIN, **wrong)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"characteristic": (-400.0, 2500.0, 10.0, -30.0, 2.0, 0.5)},
        {"gains": tuple(np.linspace(0.5, 1.5, 40)), "threshold": 30.0},
        {"saturation_band": 500.0, "temperature_coefficient": 0.01, "temperature_excess": 5.0},
    ],
)
def test_the_compiled_conversion_is_the_same(changes):
    pytest.importorskip("numba")
    chain = dataclasses.replace(WTS_0614_34, **changes)
    active = np.arange(40) % 7 != 3
    felt = chain.felt(np.linspace(-0.1, 3.0, 40))
    plain, fast = (chain.converter(active, native=native)(felt) for native in (False, True))
    np.testing.assert_array_equal(fast[0], plain[0])
    np.testing.assert_array_equal(fast[1], plain[1])
    assert fast[1].dtype == plain[1].dtype
    np.testing.assert_array_equal(plain[0], np.where(active, chain.counts(np.linspace(-0.1, 3.0, 40)), 0))
