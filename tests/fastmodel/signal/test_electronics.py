import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastmodel.errors import FastModelError
from fastmodel.signal.electronics import WTS_0614_34, Electronics, describe_calibration, grey_levels

PLAIN = Electronics(rate_hz=100.0, sensitivity=1000.0)


def test_the_line_of_the_2015_report():
    forces = np.array([0.0, 0.18, 0.19, 1.0, 1.64, 1.65, 5.0, -0.3])
    counts = WTS_0614_34.counts(forces)
    assert counts.tolist() == [0, 0, 13, 2172, 3878, 3895, 3895, 0]
    assert np.issubdtype(counts.dtype, np.integer)


def test_fifth_degree_characteristic_and_gains():
    chain = Electronics(rate_hz=100, sensitivity=1, characteristic=(10, 100, 5, 0, 0, -1), gains=(1.0, 2.0))
    assert chain.counts([2.0, 2.0]).tolist() == [198, 396]
    with pytest.raises(FastModelError, match="2 texels"):
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


def test_hysteresis_is_a_loop_of_the_stated_height_at_any_rate():
    electronics = dataclasses.replace(PLAIN, hysteresis_share=0.4, hysteresis_width=0.05)
    loading, play = follow(electronics, np.linspace(0, 1, 11), np.zeros(1))
    unloading = follow(electronics, np.linspace(1, 0, 11), play)[0][::-1]
    height = np.subtract(unloading, loading)[2:-2]
    np.testing.assert_allclose(height, 2 * 0.4 * 0.05)
    assert unloading[0] == pytest.approx(0.4 * 0.05)  # the remanence
    slow = follow(electronics, np.linspace(0, 1, 500), np.zeros(1))[1]
    assert slow == pytest.approx(follow(electronics, [1.0], np.zeros(1))[1])


def follow(electronics, path, play):
    """Force after hysteresis at every step of a path, and the play at its end."""
    found = []
    for force in path:
        delayed, play = electronics.apply_hysteresis(np.array([force]), play)
        found.append(delayed[0])
    return found, play


def test_temperature_scales_the_measured_force():
    warm = dataclasses.replace(PLAIN, temperature_coefficient=0.004, temperature_excess=25.0)
    forces = np.array([0.5, 1.0])
    np.testing.assert_array_equal(warm.counts(forces), PLAIN.counts(1.1 * forces))


@given(st.lists(st.floats(-1, 5), min_size=2, max_size=20), st.floats(0, 3000), st.floats(0, 300))
def test_counts_rise_with_force_within_their_range(forces, band, threshold):
    electronics = dataclasses.replace(WTS_0614_34, saturation_band=band, threshold=threshold)
    counts = electronics.counts(np.sort(forces))
    assert np.all(np.diff(counts) >= 0)
    assert counts.min() >= 0
    assert counts.max() <= electronics.output_max


def test_grey_levels_are_limited_and_black_without_a_full_scale():
    assert grey_levels([-1, 0, 0.5, 1, 2], 1.0).tolist() == [0, 0, 128, 255, 255]
    assert grey_levels([1.0], 0.0).tolist() == [0]
    assert grey_levels([0, 8, 9, 4095, 5000], 4095).tolist() == [0, 0, 1, 255, 255]


@pytest.mark.parametrize("characteristic", [None, (-400.0, 2500.0, 10.0, -30.0, 2.0, 0.5)])
def test_a_characteristic_calibrated_through_the_cover_is_one_of_the_applied_force(characteristic):
    """The texel measures three quarters of the tip's force; noise and gains keep their places."""
    applied = np.linspace(0, 2, 50)
    direct = dataclasses.replace(PLAIN, offset=-100, threshold=20, saturation_band=300, characteristic=characteristic)
    through = dataclasses.replace(direct, calibrated="through the cover, tip 0.75 mm", tip_share=0.75)
    np.testing.assert_array_equal(through.counts(0.75 * applied), direct.counts(applied))
    assert (through.tip_radius, direct.tip_radius) == (pytest.approx(0.75e-3), None)
    unknown = dataclasses.replace(through, tip_share=None)
    np.testing.assert_array_equal(unknown.counts(applied), direct.counts(applied))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"calibrated": "through the cover"}, "calibrated must be 'texel force' or 'through the cover, tip 1 mm'"),
        ({"calibrated": "through the cover, tip 1"}, "not 'through the cover, tip 1'"),
        ({"calibrated": "through the cover, tip -1 mm"}, "calibrated"),
        ({"calibrated": "through the cover, tip 0 mm"}, "calibrated"),
        ({"calibrated": "through the cover, tip 1e999 mm"}, "calibrated"),
        ({"calibrated": "Texel force"}, "calibrated"),
        ({"calibrated": 1}, "not 1"),
        ({"calibrated": "through the cover, tip 1 mm", "tip_share": 0.0}, "tip_share must be positive, not 0.0"),
        ({"calibrated": "through the cover, tip 1 mm", "tip_share": float("nan")}, "tip_share"),
        ({"tip_share": 0.8}, "tip_share must be left out"),
        ({"hysteresis_share": 1.5}, "hysteresis_share"),
        ({"hysteresis_width": -0.1}, "hysteresis_width"),
        ({"temperature_coefficient": -0.1, "temperature_excess": 20.0}, "temperature_coefficient"),
        ({"temperature_coefficient": 1.0, "temperature_excess": float("nan")}, "temperature_excess"),
        ({"characteristic": (1.0, 2.0)}, r"c0\.\.c5"),
        (
            {"rate_hz": 0, "sensitivity": -1, "output_max": 5000, "threshold": -3},
            r"rate_hz.*sensitivity.*output_max.*1..4095.*threshold",
        ),
    ],
)
def test_all_faults_are_named(wrong, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(PLAIN, **wrong)


def test_a_calibration_is_described_with_its_tip_and_share():
    through = dataclasses.replace(PLAIN, calibrated="through the cover, tip 0.75 mm")
    assert describe_calibration(PLAIN) == "counts are a function of the force on the texel"
    known, unknown = (describe_calibration(dataclasses.replace(through, tip_share=each)) for each in (0.71237, None))
    for text in (known, unknown):
        assert text.startswith("counts are a function of the force applied through the cover, tip 0.75 mm (radius of")
    assert known.endswith("of which the texel under the tip measures 0.7124")
    assert "is not known" in unknown
    assert "counts are too low" in unknown
