import dataclasses
import re

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from fastmodel import WTS_0614_34, Butterworth, FastModelError, Gaussian, Parameters, load
from fastmodel.signal.chain import ChainFunctions
from meshes import TexelArray
from tests.support.array_modules import MODULES, open_module

ARRAY = TexelArray.grid(5, 4, 3e-3)
ARRAY = dataclasses.replace(ARRAY, active=np.arange(ARRAY.count) % 7 != 3)
ELECTRONICS = dataclasses.replace(
    WTS_0614_34,
    noise=0.01,
    threshold=20.0,
    saturation_band=2000.0,
    gains=tuple(np.linspace(0.8, 1.2, ARRAY.count)),
    hysteresis_share=0.3,
    hysteresis_width=0.04,
    temperature_coefficient=0.004,
    temperature_excess=10.0,
)
BENT = dataclasses.replace(ELECTRONICS, characteristic=(-400.0, 2500.0, 10.0, -30.0, 2.0, 0.5), saturation_band=0.0)
RATE = 1000.0
WORLDS, SAMPLES, EVERY = 7, 12, 3


def parameters(electronics=ELECTRONICS, **changes):
    values = {"array": ARRAY, "spread": Gaussian.from_sigma(0.7), "filter": Butterworth(cutoff_hz=40.0, order=5)}
    return Parameters(electronics=electronics, **{**values, **changes})


@pytest.fixture(params=MODULES)
def xp(request):
    return open_module(request.param)


def inputs():
    """Contact forces of every sample, total forces, and noise of every frame, for all worlds."""
    rng = np.random.default_rng(2)
    forces = rng.uniform(0, 2, (SAMPLES, WORLDS, ARRAY.count))
    return forces, forces.sum(axis=-1) + 0.25, rng.standard_normal((SAMPLES, WORLDS, ARRAY.count))


def run(functions, xp, forces, carried, noise):
    """The frames, made after every third sample."""
    state = functions.settle(xp.asarray(forces[0]), xp.asarray(carried[0]))
    made = []
    for k in range(len(forces)):
        state = functions.take(state, xp.asarray(forces[k]), xp.asarray(carried[k]))
        if k % EVERY == 0:
            state, output = functions.frame(state, xp.asarray(noise[k]))
            made.append(output)
    return made


@pytest.mark.parametrize("spreads", [True, False])
@pytest.mark.parametrize("electronics", [ELECTRONICS, BENT], ids=["line", "polynomial"])
def test_many_worlds_in_any_library_give_what_each_world_gives_alone(xp, electronics, spreads):
    forces, carried, noise = inputs()
    given = parameters(electronics)
    together = run(ChainFunctions(given, RATE, spreads=spreads), xp, forces, carried, noise)
    alone = ChainFunctions(given, RATE, spreads=spreads)
    for world in range(WORLDS):
        singles = run(alone, np, forces[:, world], carried[:, world], noise[:, world])
        for one, all_worlds in zip(singles, together, strict=True):
            mine = {name: np.asarray(values[world, ...]) for name, values in all_worlds._asdict().items()}
            np.testing.assert_allclose(mine["texel_forces"], one.texel_forces, atol=1e-12)
            np.testing.assert_allclose(mine["outside"], one.outside, atol=1e-12)
            np.testing.assert_array_equal(mine["counts"], one.counts)
            np.testing.assert_array_equal(mine["image"], one.image)
            assert mine["image"].shape == (5, 4)
            assert mine["image"].dtype == np.uint8
            assert mine["counts"].dtype == np.int64
            assert mine["counts"].any()


@pytest.mark.parametrize("every", [1, 3, 8])
def test_a_frame_is_the_filtered_sample_spread_by_the_operator(every):
    forces = np.random.default_rng(0).uniform(0, 1.5, (4 * every, ARRAY.count))
    signals = np.column_stack([forces, forces.sum(axis=1) + 0.25])
    filtered = sosfilt(butter(5, 40.0, fs=RATE, output="sos"), signals, axis=0)
    operator, functions = parameters().spread.operator(ARRAY), ChainFunctions(parameters(), RATE)
    spread = ChainFunctions(parameters(), RATE, spreads=False)
    state, before = functions.settle(np.zeros(ARRAY.count)), spread.settle(np.zeros(ARRAY.count))
    for sample in forces:
        state = functions.take(state, sample, np.float64(sample.sum() + 0.25))
        before = spread.take(before, operator @ sample)
    _, output = functions.frame(state)
    np.testing.assert_allclose(output.texel_forces, operator @ filtered[-1, :-1], atol=1e-12)
    assert output.outside == pytest.approx(filtered[-1, -1] - output.texel_forces.sum(), abs=1e-12)
    np.testing.assert_allclose(spread.frame(before)[1].texel_forces, output.texel_forces, atol=1e-12)  # they commute


def test_an_unknown_share_of_the_calibration_tip_is_said_once(caplog):
    array = dataclasses.replace(ARRAY, name="never built before")
    for _ in range(2):
        ChainFunctions(parameters(WTS_0614_34, array=array), RATE)
    (record,) = caplog.records
    assert "never built before" in record.message
    assert "counts are too low" in record.message
    known = dataclasses.replace(WTS_0614_34, tip_share=0.77)
    direct = dataclasses.replace(WTS_0614_34, calibrated="texel force")
    for electronics in (known, direct):
        ChainFunctions(parameters(electronics, array=dataclasses.replace(array, name="another")), RATE)
    assert len(caplog.records) == 1


def test_other_signals_pass_the_filter_alone(xp):
    """Tangential forces of every world, shape (worlds, 2 texels), give what the filter gives for each of them."""
    forces, carried, _ = inputs()
    shear = np.random.default_rng(5).uniform(-1, 1, (SAMPLES, WORLDS, 2 * ARRAY.count))
    functions = ChainFunctions(parameters(), RATE)
    state = functions.settle(xp.asarray(forces[0]), xp.asarray(carried[0]), xp.asarray(shear[0]))
    for sample, total, other in zip(forces, carried, shear, strict=True):
        state = functions.take(state, xp.asarray(sample), xp.asarray(total), xp.asarray(other))
    _, output = functions.frame(state)
    expected = sosfilt(parameters().filter.sections(RATE), shear - shear[0], axis=0)[-1] + shear[0]
    np.testing.assert_allclose(np.asarray(output.others), expected, atol=1e-12)
    plain = run(ChainFunctions(parameters(), RATE), xp, forces, carried, np.zeros_like(forces))
    assert plain[0].others.shape == (WORLDS, 0)
    assert np.asarray(output.texel_forces).any()


@pytest.mark.slow
def test_jax_compiles_the_functions_and_differentiates_them():
    open_module("jax")
    import jax

    functions = ChainFunctions(parameters(), RATE)
    forces, carried, noise = (jax.numpy.asarray(values) for values in inputs())
    plain = run(functions, jax.numpy, forces, carried, noise)[-1]

    @jax.jit
    def roll(forces, carried, noise):
        return run(functions, jax.numpy, forces, carried, noise)[-1]

    compiled = roll(forces, carried, noise)
    np.testing.assert_allclose(compiled.texel_forces, plain.texel_forces, atol=1e-12)
    np.testing.assert_array_equal(compiled.counts, plain.counts)
    # the sum of texel forces after one sample is linear in this sample: its gradient is the same for any sample
    state = functions.settle(forces[0])
    slope = jax.grad(lambda sample: functions.frame(functions.take(state, sample))[1].texel_forces.sum())(forces[1])
    low_pass = parameters().filter.sections(RATE)
    gain = np.prod(low_pass[:, 0])  # of the newest sample, through all sections
    share = parameters().spread.operator(ARRAY).sum(axis=0)
    np.testing.assert_allclose(slope, np.broadcast_to(gain * share, slope.shape), rtol=1e-9)


def test_with_32_bits_the_results_have_32_bits_and_differ_little(xp):
    forces, carried, noise = inputs()
    exact = run(ChainFunctions(parameters(), RATE), np, forces, carried, noise)[-1]
    small = [each.astype(np.float32) for each in (forces, carried, noise)]
    rough = run(ChainFunctions(parameters(), RATE), xp, *small)[-1]
    assert rough.texel_forces.dtype == xp.float32
    np.testing.assert_allclose(np.asarray(rough.texel_forces), exact.texel_forces, atol=1e-5)
    assert np.abs(np.asarray(rough.counts) - exact.counts).max() <= 1


def test_more_texels_than_a_dense_operator_takes():
    array = TexelArray.grid(26, 20, 2e-3)
    given = parameters(WTS_0614_34, array=array)
    forces = np.random.default_rng(0).uniform(0, 1, (3, array.count))
    functions = ChainFunctions(given, RATE)
    _, made = functions.frame(functions.settle(forces))
    np.testing.assert_allclose(made.texel_forces, forces @ given.spread.operator(array).T, atol=1e-12)
    assert made.image.shape == (3, 26, 20)


def test_constants_follow_the_type_and_library_of_the_forces(xp):
    """One object takes 32 and 64 bits of any library, and lists of the library that it was made for."""
    functions = ChainFunctions(parameters(), RATE, namespace=xp)
    for dtype in (xp.float32, xp.float64):
        state = functions.settle(xp.ones((2, ARRAY.count), dtype=dtype))
        state, output = functions.frame(functions.take(state, xp.ones((2, ARRAY.count), dtype=dtype)))
        assert state.filter.dtype == output.texel_forces.dtype == dtype
    assert isinstance(functions.settle([0.5] * ARRAY.count).filter, type(state.filter))


def test_wrong_arrays_are_refused_in_one_line(xp):
    functions, forces = ChainFunctions(parameters(), RATE), xp.ones((2, ARRAY.count))
    state = functions.settle(forces)
    cases = {
        "forces has shape (2, 19); its last dimension must be the 20 texels": (forces[:, 1:],),
        "forces has elements of type": (xp.astype(forces, xp.int64),),
        "carried has shape (3,); give shape (2,)": (forces, xp.ones(3)),
        "others has elements of type": (forces, None, xp.ones((2, 5), dtype=xp.int64)),
        "state.filter has shape": (forces[:1, :],),
    }
    for message, arguments in cases.items():
        with pytest.raises(FastModelError, match=re.escape(message)) as raised:
            functions.take(state, *arguments)
        assert "\n" not in str(raised.value)
    with pytest.raises(FastModelError, match="noise has shape"):
        functions.frame(state, xp.ones((2, 3)))


@pytest.mark.slow
def test_arrays_of_two_libraries_or_devices_are_refused():
    torch = open_module("torch")
    functions = ChainFunctions(parameters(), RATE)
    with pytest.raises(FastModelError, match="carried is an array of torch; convert it to one of numpy"):
        functions.settle(np.ones((2, ARRAY.count)), torch.ones(2))
    with pytest.raises(FastModelError, match=r"carried lies on meta; move it with .to\('cpu'\)"):
        functions.settle(torch.ones((2, ARRAY.count)), torch.ones(2, device="meta"))


def test_a_held_load_decays_behind_a_high_pass_and_the_state_is_stored(tmp_path):
    """exp(-2 pi f t) after a step, within the first sample; the cut-off comes back from the file of the parameters."""
    array = TexelArray.grid(3, 3, pitch=3e-3)
    electronics = dataclasses.replace(WTS_0614_34, high_pass_hz=0.5)
    sensor = Parameters(
        array=array, spread=Gaussian(sigma_x=0.5, sigma_y=0.5, ksize_x=3, ksize_y=3), electronics=electronics
    )
    sensor.save(tmp_path / "piezo")
    assert load(tmp_path / "piezo").electronics.high_pass_hz == 0.5
    chain, plain = (
        ChainFunctions(sensor, 1000.0),
        ChainFunctions(dataclasses.replace(sensor, electronics=WTS_0614_34), 1000.0),
    )
    state, forces = chain.settle(np.zeros(9)), np.arange(9.0)
    for _ in range(1000):
        state = chain.take(state, forces)
    _, found = chain.frame(state)
    _, held = plain.frame(plain.settle(forces))
    assert found.texel_forces == pytest.approx(np.exp(-np.pi) * held.texel_forces, rel=5e-3)
    with pytest.raises(ValueError, match="below half of rate_hz"):
        dataclasses.replace(WTS_0614_34, high_pass_hz=200.0)
