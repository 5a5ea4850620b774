"""Every stage of the signal chain at once, against plain numbers texel by texel; values at the limits."""

import dataclasses
import math
import re

import numpy as np
import pytest
from scipy.signal import butter, sosfilt, sosfreqz
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from fastmodel import Butterworth, Electronics, FastModelError, Gaussian, Parameters
from fastmodel.errors import ParametersError
from fastmodel.signal.array_namespace import as_floats, check_floats, convert, find_namespace, round_half_to_even
from fastmodel.signal.butterworth import LowPass, list_sections
from fastmodel.signal.chain import ChainFunctions
from fastmodel.signal.creep import Creep
from fastmodel.signal.electronics import grey_levels, saturate
from fastmodel.signal.frame import Frame
from fastmodel.signal.point_spread import find_tangents, measure_offsets, sample_gaussian
from meshes import TexelArray
from tests.support.array_modules import open_module

ARRAY = TexelArray.grid(3, 4, (2e-3, 3e-3), active=np.arange(12) != 6)
RATE = 500.0
ELECTRONICS = Electronics(
    rate_hz=100.0,
    sensitivity=900.0,
    offset=-40.0,
    output_max=1500,
    bits=11,
    noise=0.02,
    threshold=15.0,
    saturation_band=400.0,
    gains=tuple(np.linspace(0.7, 1.4, 12)),
    hysteresis_share=0.4,
    hysteresis_width=0.07,
    temperature_coefficient=-0.004,
    temperature_excess=12.0,
    creep=0.15,
    calibrated="through the cover, tip 2.5 mm",
    tip_share=0.8,
)
CURVED = dataclasses.replace(ELECTRONICS, characteristic=(-30.0, 700.0, 120.0, -20.0, 3.0, 0.5), saturation_band=0.0)


def count(electronics, force, gain, noise):
    """Counts of one texel, a stage at a time."""
    measured = force * (1 + electronics.temperature_coefficient * electronics.temperature_excess)
    applied = (measured + electronics.noise * noise) / electronics.tip_share
    if electronics.characteristic is None:
        signal = electronics.sensitivity * applied + electronics.offset
    else:
        signal = sum(c * applied**k for k, c in enumerate(electronics.characteristic))
    signal = max(signal * gain - electronics.threshold, 0.0)
    band, most = electronics.saturation_band, electronics.output_max
    if band and signal > most - band:
        signal = most - band * math.exp(-(signal - (most - band)) / band)
    return round(min(signal, most))


@pytest.mark.parametrize("electronics", [ELECTRONICS, CURVED], ids=["line", "polynomial"])
def test_a_chain_with_every_stage_is_that_of_plain_numbers(electronics):
    """Forces rise and fall, so that the play operator opens; frames come after 5 samples, or 15."""
    random, design = np.random.default_rng(4), Butterworth(cutoff_hz=60.0, order=3)
    spread = Gaussian(sigma_x=0.6, sigma_y=0.8, ksize_x=3, ksize_y=3)
    functions = ChainFunctions(Parameters(array=ARRAY, spread=spread, electronics=electronics, filter=design), RATE)
    path = np.abs(np.sin(0.07 * np.arange(60)))[:, None] * random.uniform(0.5, 5.0, 12)
    start = np.full(12, 0.3)
    state = functions.settle(start)
    sections = butter(3, 60.0, fs=RATE, output="sos")
    filtered = start + sosfilt(sections, path - start, axis=0)
    operator = spread.operator(ARRAY)
    times = np.geomspace(0.1, 1e6, 15)
    weight = 0.15 * np.log(10) / 2
    instant = 1 - weight * (1 - np.exp(-2 / times)).sum()
    memory, play = (1 - np.exp(-2 / times))[:, None] * (operator @ start), np.zeros(12)
    largest = 0
    for k, sample in enumerate(path):
        state = functions.take(state, sample)
        if k % 5 != 4 or 20 < k < 33:
            continue
        frames = 3 if k == 34 else 1
        noise = random.standard_normal(12)
        state, output = functions.frame(state, noise, frames=frames)
        forces = operator @ filtered[k]
        np.testing.assert_allclose(output.texel_forces, forces, atol=1e-12)
        assert output.outside == pytest.approx(filtered[k].sum() - forces.sum(), abs=1e-12)
        kept = np.exp(-frames * 0.01 / times)[:, None]
        memory = forces + kept * (memory - forces)
        crept = instant * forces + weight * memory.sum(axis=0)
        play = np.minimum(np.maximum(play, crept - 0.07), crept + 0.07)
        delayed = 0.6 * crept + 0.4 * play
        expected = [
            count(electronics, *each) if active else 0
            for *each, active in zip(delayed, electronics.gains, noise, ARRAY.active, strict=True)
        ]
        assert output.counts.tolist() == expected
        np.testing.assert_array_equal(
            output.image, [[round(255 * min(c / 1500, 1)) for c in row] for row in output.counts.reshape(3, 4)]
        )
        largest = max(largest, *expected)
    assert largest > 1100  # within the bend


def test_noise_from_a_generator_is_that_of_the_same_numbers_as_an_array():
    forces = np.random.default_rng(0).uniform(0, 1, (3, 12))
    drawn = np.random.default_rng(7).standard_normal((3, 12))
    found = ELECTRONICS.counts(forces, np.random.default_rng(7))
    np.testing.assert_array_equal(found, ELECTRONICS.counts(forces, drawn))
    quiet = dataclasses.replace(ELECTRONICS, noise=0.0)
    generator = np.random.default_rng(7)
    np.testing.assert_array_equal(quiet.counts(forces, generator), ELECTRONICS.counts(forces))
    assert generator.standard_normal() == drawn[0, 0]  # a sensor without noise draws nothing


@pytest.mark.parametrize(
    ("counts", "band", "expected"),
    [
        (599.0, 400, 599.0),
        (600.0, 400, 600.0),
        (1000.0, 400, 1000 - 400 / np.e),
        (2000.0, 0, 1000.0),
        (1000, 0, 1000.0),
    ],
)
def test_counts_bend_from_the_knee_on(counts, band, expected):
    assert saturate(np.array([counts], dtype=float), 1000, band)[0] == pytest.approx(expected, rel=1e-12)


def test_a_bend_narrower_than_a_millionth_of_a_count_is_a_clip():
    values = np.array([999.0, 1000.0, 1001.0])
    np.testing.assert_array_equal(saturate(values, 1000, 0.9e-6), [999, 1000, 1000])
    assert saturate(values, 1000, 2e-6)[1] < 1000


def test_halves_are_rounded_to_even_numbers():
    plain = Electronics(rate_hz=10.0, sensitivity=1.0)
    assert plain.counts([0.5, 1.5, 2.5, 3.5, 2.500001]).tolist() == [0, 2, 2, 4, 3]
    assert grey_levels([1, 3, 5], 510).tolist() == [0, 2, 2]  # halves of a level
    assert round_half_to_even(np, np.array([-0.5, 4.5])).tolist() == [0, 4]


@pytest.mark.parametrize(
    "settings",
    [
        {"bits": 1, "output_max": 1},
        {"bits": 32, "output_max": 2**32 - 1},
        {"hysteresis_share": 1.0},
        {"creep": 0.2},
        {"saturation_band": 4094.9},
        {"offset": -1e9},
        {"high_pass_hz": 49.9},
        {"gains": (0.0, 1.0)},
        {"characteristic": (0.0,) * 6},
        {"temperature_coefficient": -0.099, "temperature_excess": 10.0},
        {"calibrated": "through the cover, tip 0.5 mm", "tip_share": 1e-9},
        {"calibrated": "through the cover, tip 2.5e-1 mm"},
    ],
)
def test_values_at_their_limits_are_accepted(settings):
    found = Electronics(**{"rate_hz": 100.0, "sensitivity": 1.0, **settings})
    assert {name: getattr(found, name) for name in settings} == settings


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"bits": 0}, "bits must be a whole number 1..32, not 0"),
        ({"bits": 33}, "bits"),
        ({"bits": 12.0}, "bits"),
        ({"bits": 1, "output_max": 2}, "output_max must lie in 1..1 "),
        ({"output_max": 4096}, "output_max must lie in 1..4095"),
        ({"output_max": 0}, "output_max"),
        ({"rate_hz": np.inf}, "rate_hz"),
        ({"sensitivity": 0.0}, "sensitivity"),
        ({"sensitivity": np.inf}, "sensitivity"),
        ({"offset": np.inf}, "offset must be finite"),
        ({"hysteresis_share": -1e-9}, "hysteresis_share"),
        ({"hysteresis_width": np.inf}, "hysteresis_width"),
        ({"noise": -1e-9}, "noise"),
        ({"noise": np.inf}, "noise"),
        ({"threshold": np.inf}, "threshold"),
        ({"saturation_band": 4095}, "saturation_band"),
        ({"saturation_band": -1e-9}, "saturation_band"),
        ({"high_pass_hz": 50.0}, "high_pass_hz"),
        ({"high_pass_hz": 0.0}, "high_pass_hz"),
        ({"gains": (1.0, -0.1)}, "gains"),
        ({"gains": (1.0, np.inf)}, "gains"),
        ({"characteristic": (0.0,) * 5}, "characteristic"),
        ({"characteristic": (0.0,) * 7}, "characteristic"),
        ({"characteristic": (0.0, np.nan, 0.0, 0.0, 0.0, 0.0)}, "characteristic"),
        ({"temperature_coefficient": -0.1, "temperature_excess": 10.0}, "the gain is 0.0"),
        ({"calibrated": "through the cover, tip 1 mm", "tip_share": np.inf}, "tip_share must be positive"),
    ],
)
def test_values_just_beyond_their_limits_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        Electronics(**{"rate_hz": 100.0, "sensitivity": 1.0, **settings})


def test_the_tip_radius_is_read_in_millimetres():
    radius = Electronics(rate_hz=1.0, sensitivity=1.0, calibrated="through the cover, tip 2.5e-1 mm").tip_radius
    assert radius == pytest.approx(0.25e-3)
    assert ELECTRONICS.applied_share == 0.8
    assert Electronics(rate_hz=1.0, sensitivity=1.0).applied_share == 1.0
    assert ELECTRONICS.temperature_gain == pytest.approx(0.952)


def test_the_whole_force_may_pass_the_play_operator():
    """Within half the width of the last output nothing changes."""
    whole = Electronics(rate_hz=1.0, sensitivity=1.0, hysteresis_share=1.0, hysteresis_width=0.2)
    forces, play = np.array([0.5, 0.9, 1.3]), np.array([0.6, 0.6, 0.6])
    delayed, after = whole.apply_hysteresis(forces, play)
    np.testing.assert_allclose(delayed, [0.6, 0.7, 1.1])
    np.testing.assert_allclose(after, delayed)
    off = dataclasses.replace(whole, hysteresis_share=0.0)
    assert off.apply_hysteresis(forces, play)[0] is forces


@pytest.mark.parametrize("order", [1, 4, 20])
def test_each_section_passes_constant_forces_and_all_together_3_db_at_the_cutoff(order):
    sections = Butterworth(cutoff_hz=30.0, order=order).sections(400.0)
    assert sections.shape == ((order + 1) // 2, 6)
    np.testing.assert_allclose(sections[:, :3].sum(axis=1), sections[:, 3:].sum(axis=1), rtol=1e-9)
    _, gain = sosfreqz(sections, [0.0, 30.0], fs=400.0)
    np.testing.assert_allclose(np.abs(gain), [1, np.sqrt(0.5)], rtol=1e-6)


@pytest.mark.parametrize(
    ("cutoff", "order", "accepted"),
    [
        (199.9, 2, True),
        (200.0, 2, False),
        (0.0, 2, False),
        (np.inf, 2, False),
        (10.0, 20, True),
        (10.0, 21, False),
        (10.0, 1.5, False),
    ],
)
def test_filters_at_their_limits(cutoff, order, accepted):
    if accepted:
        assert len(Butterworth(cutoff_hz=cutoff, order=order).sections(400.0))
    else:
        with pytest.raises(FastModelError):
            Butterworth(cutoff_hz=cutoff, order=order).sections(400.0)


@pytest.mark.parametrize(("high_pass", "accepted"), [(1e-3, True), (199.9, True), (200.0, False), (0.0, False)])
def test_a_high_pass_lies_below_half_the_rate(high_pass, accepted):
    if accepted:
        np.testing.assert_allclose(
            list_sections(None, 400.0, high_pass), butter(1, high_pass, "highpass", fs=400.0, output="sos")
        )
    else:
        with pytest.raises(FastModelError, match="high_pass_hz must lie below half"):
            list_sections(None, 400.0, high_pass)


@pytest.mark.parametrize("shape", [(), (3,), (2, 3), (2, 1, 3)])
@pytest.mark.parametrize("design", [None, Butterworth(cutoff_hz=20.0, order=3)])
def test_signals_of_any_shape_are_filtered_one_by_one(design, shape):
    random, low_pass = np.random.default_rng(2), LowPass(design, 300.0, 1.5)
    samples = random.normal(size=(20, *shape)) + 2
    states = low_pass.settle(samples[0])
    assert states.shape == (7 if design else 3, *shape)  # two for each section, and the filtered sample
    found = []
    for sample in samples[1:]:
        states = low_pass.step(states, sample)
        found.append(states[-1])
    sections = list_sections(design, 300.0, 1.5)
    expected = sosfilt(sections, samples[1:] - samples[0], axis=0)  # what is held reads zero
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_creep_has_two_time_constants_a_decade_from_a_tenth_of_a_second_to_a_million():
    creep = Creep(0.12)
    np.testing.assert_allclose(creep.times, 10 ** np.linspace(-1, 6, 15))
    assert creep.weight == pytest.approx(0.12 * np.log(np.sqrt(10)))
    assert creep.instant == pytest.approx(1 - creep.weight * (1 - np.exp(-2 / creep.times)).sum())
    none = Creep(0.0)
    assert none.times.size == 0
    assert none.settle(np.ones((2, 3))).shape == (0, 2, 3)
    forces, states = np.ones(3), np.zeros((0, 3))
    assert none.step(states, forces, 1.0) == (forces, states)


def test_offsets_and_operator_of_texels_in_any_pose_pair_by_pair():
    """Some texels look away from each other, one looks along x, one is masked; full columns sum to one at most."""
    random = np.random.default_rng(3)
    normals = Rotation.random(9, random_state=2).apply([0, 0, 1.0])
    normals[:5] = np.abs(normals[:5])
    normals[0] = [1.0, 0, 0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    array = TexelArray(
        centres=random.uniform(-1.5e-3, 1.5e-3, (9, 3)), normals=normals, texel_size=(1e-3, 1e-3), pitch=(1e-3, 2e-3),
        rows=1, columns=9, active=np.arange(9) != 4,
    )  # fmt: skip
    spread = Gaussian(sigma_x=0.9, sigma_y=0.7, ksize_x=3, ksize_y=5)
    first, second = find_tangents(array)
    np.testing.assert_array_equal(first[0], [0, 1, 0])
    expected, sides = np.zeros((9, 9)), np.zeros((2, 9, 9))
    for texel, loaded in np.ndindex(9, 9):
        normal = normals[loaded]
        along = np.array([1.0, 0, 0]) - normal[0] * normal
        along = np.array([0, 1.0, 0]) if loaded == 0 else along / np.linalg.norm(along)
        np.testing.assert_allclose(first[loaded], along, atol=1e-12)
        np.testing.assert_allclose(second[loaded], np.cross(normal, along), atol=1e-12)
        apart = array.centres[texel] - array.centres[loaded]
        x, y = apart @ along / 1e-3, apart @ np.cross(normal, along) / 2e-3
        sides[:, texel, loaded] = x, y
        if abs(x) < 1.5 and abs(y) < 2.5 and normals[texel] @ normal > 0 and texel != 4:
            weights = (
                [np.exp(-0.5 * (k / 0.9) ** 2) for k in (-1, 0, 1)],
                [np.exp(-0.5 * (k / 0.7) ** 2) for k in range(-2, 3)],
            )
            expected[texel, loaded] = (
                np.exp(-0.5 * ((x / 0.9) ** 2 + (y / 0.7) ** 2)) / sum(weights[0]) / sum(weights[1])
            )
    full = expected.sum(axis=0) > 1
    assert 0 < full.sum() < 9
    expected[:, full] /= expected.sum(axis=0)[full]
    np.testing.assert_allclose(measure_offsets(array), sides, atol=1e-9)
    np.testing.assert_allclose(spread.operator(array), expected, atol=1e-12)


def test_a_kernel_ends_at_half_its_width():
    """Up to it the values are those of a Gaussian, at it and beyond they are zero."""
    values = sample_gaussian([0.0, 1.0, 1.499, 1.5, -1.5, -1.2], 0.8, 3)
    total = 1 + 2 * np.exp(-0.5 / 0.64)
    expected = np.exp(-0.5 * np.array([0, 1.0, 1.499, 0, 0, 1.2]) ** 2 / 0.64) / total
    expected[3:5] = 0
    np.testing.assert_allclose(values, expected)


def test_arrays_are_checked_by_library_type_and_shape():
    like = np.zeros(3, dtype=np.float32)
    assert check_floats("x", [1, 2.0, 3]).dtype == np.float64
    assert check_floats("x", 2.0, like, ()).dtype == np.float32
    assert check_floats("x", [1.0, 2.0, 3.0], like, (3,)).dtype == np.float32
    given = np.ones((2, 3))
    assert check_floats("x", given) is given
    assert check_floats("x", given, given, (2, 3)) is given
    for values, wanted, shape, message in (
        (given, like, None, "x has elements of type float64; convert them to float32"),
        (np.ones(3, dtype=np.float16), None, None, "float32 or float64"),
        (given, None, (3, 2), "x has shape (2, 3); give shape (3, 2)"),
        (np.float64(2), given, (1,), "x has shape (); give shape (1,)"),
        ("text", given, None, "x is no array of numbers"),
    ):
        with pytest.raises(FastModelError, match=re.escape(message)):
            check_floats("x", values, wanted, shape)


def test_constants_and_numbers_are_converted_to_what_is_wanted():
    assert convert(np.ones(3), np.zeros(2, dtype=np.float32)).dtype == np.float32
    constant = np.ones(3)
    assert convert(constant, np.zeros(2)) is constant
    assert as_floats(np, [1, 2]).dtype == np.float64
    single = np.ones(2, dtype=np.float32)
    assert as_floats(np, single) is single
    assert find_namespace([1.0]) is np
    assert find_namespace(2.0, "otherwise") == "otherwise"
    strict = open_module("strict")
    assert find_namespace(strict.ones(2)).__name__ == strict.__name__


@pytest.mark.parametrize("area", [None, 4e-6])
def test_a_frame_has_pressures_where_forces_and_area_are_known(area):
    frame = Frame(
        time=0.5,
        counts=np.array([1, 2]),
        image=np.zeros((1, 2), np.uint8),
        texel_forces=np.array([0.2, 0.6]),
        texel_area=area,
    )
    if area is None:
        assert frame.pressures is None
        assert dataclasses.replace(frame, texel_forces=None, texel_area=1.0).pressures is None
    else:
        np.testing.assert_allclose(frame.pressures, [5e4, 15e4])
    with pytest.raises(ValueError, match="read-only"):
        frame.texel_forces[0] = 1


def test_a_name_that_the_format_uses_is_no_name_of_a_table():
    for name in ("operator", "cells_compliance", "curved_points"):
        with pytest.raises(ParametersError, match=f"must not be named '{name}'"):
            Parameters(array=ARRAY, spread=Gaussian.from_sigma(0.5), electronics=ELECTRONICS, tables={name: np.eye(2)})


def test_arrays_of_numpy_and_sparse_constants_follow_another_library():
    strict = open_module("strict")
    like = strict.zeros(3, dtype=strict.float32)
    for given in (np.array([1.0, 2.0, 3.0]), [1, 2, 3]):
        found = check_floats("x", given, like, (3,))
        assert (type(found), found.dtype) == (type(like), strict.float32)
        np.testing.assert_array_equal(np.asarray(found), [1, 2, 3])
    sparse = convert(csr_array(np.diag([0.5, 0.0, 0.25])), like)
    assert (type(sparse), sparse.dtype) == (type(like), strict.float32)
    np.testing.assert_array_equal(np.asarray(sparse), np.diag([0.5, 0.0, 0.25]))
    kept = csr_array(np.eye(2))
    assert convert(kept, np.zeros(2)) is kept
    with pytest.raises(FastModelError, match="x is an array of array_api_strict; convert it to one of numpy"):
        check_floats("x", like, np.zeros(3))
    with pytest.raises(FastModelError, match=r"x has shape \(3,\); give shape \(2,\)"):
        check_floats("x", np.ones(3), like, (2,))
