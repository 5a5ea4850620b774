import dataclasses
import warnings

import mujoco
import numpy as np
import pytest
from scipy.signal import butter, sosfilt

import fastmodel
from fastmodel import WTS_0614_34, Butterworth, FastModelError, Gaussian, OptionWarning, Parameters
from fastmodel.errors import LifeCycleError
from meshes import TexelArray
from meshes.catalogue import ARRAYS
from tests.support.quaternions import rotate
from tests.support.scenes import add_body, make_spec, run, simulate

WTS = ARRAYS["wts-0614-34"]
PARAMETERS = Parameters(
    array=WTS,
    spread=Gaussian.from_sigma(0.6),
    electronics=dataclasses.replace(WTS_0614_34, noise=0.002),
    filter=Butterworth(cutoff_hz=40.0, order=4),
)
IDENTITY = np.array([1.0, 0, 0, 0])


def ball_on_array(parameters=PARAMETERS, turn=IDENTITY, timestep=1e-3, **settings):
    """A 100 g ball on a slide over an array, the whole scene turned by a quaternion."""
    spec = make_spec(timestep, gravity=rotate(turn, np.array([[0, 0, -9.80665]]))[0])
    holder = spec.worldbody.add_body(name="holder", quat=turn)
    sensor = fastmodel.attach(spec, "holder", parameters, **settings)
    add_body(spec, "sphere", [6e-3], [0.5e-3, 1e-3, 6.5e-3], slides="z", parent=holder, mass=0.1)
    model = spec.compile()
    # The ball's body is a child of the holder, which MuJoCo takes for the fixed world: contacts stay on.
    return sensor.bind(model), model, mujoco.MjData(model)


def test_frames_carry_their_true_time_at_the_sensors_rate():
    frames = run(*ball_on_array(), 2000)
    times = np.array([frame.time for frame in frames])
    assert len(frames) == 542
    assert set(np.rint(np.diff(times) * 1000).astype(int)) == {3, 4}
    assert np.allclose(times * 1000, np.rint(times * 1000), atol=1e-6)
    due = np.arange(1, 543) / 271.0
    assert np.all((times - due > -1e-5) & (times - due < 1e-3))


def test_a_frame_is_the_filtered_and_spread_contact_force():
    sensor, model, data = ball_on_array()
    forces, frames = [], []
    for _ in range(400):
        mujoco.mj_step(model, data)
        new = sensor.step(data)
        forces.append(sensor.contact_forces())
        if new:
            frames.append((len(forces) - 1, sensor.frame()))
    filtered = sosfilt(butter(4, 40.0, fs=1000.0, output="sos"), forces, axis=0)
    operator = PARAMETERS.spread.operator(WTS)
    for index, frame in frames:
        assert np.allclose(frame.texel_forces, operator @ filtered[index], atol=1e-9)
    assert forces[-1].sum() == pytest.approx(0.980665, rel=1e-3)
    assert frames[-1][1].texel_forces.sum() + sensor.outside() == pytest.approx(0.980665, rel=1e-3)


def test_counts_and_image_are_the_sensors_integers_and_zero_before_the_first_frame():
    sensor, model, data = ball_on_array()
    first = sensor.frame()
    assert first.counts.sum() == first.time == 0
    frame = run(sensor, model, data, 600)[-1]
    assert frame.counts.shape == (84,)
    assert np.issubdtype(frame.counts.dtype, np.integer)
    assert frame.counts.min() == 0
    assert 0 < frame.counts.max() <= 3895
    assert frame.image.shape == (14, 6)
    assert np.array_equal(frame.image.ravel(), np.rint(255 * frame.counts / 3895))
    with pytest.raises(ValueError, match="read-only"):
        frame.counts[0] = 1


def test_forces_may_be_formed_on_every_nth_step_and_a_reset_under_load_starts_settled():
    sensor, model, data = ball_on_array(every=3)
    frames = run(sensor, model, data, 900)
    assert len(frames) == pytest.approx(271 * 0.9, abs=2)
    assert {round(1e3 * frame.time) % 3 for frame in frames} == {1}
    assert frames[-1].texel_forces.sum() + sensor.outside() == pytest.approx(0.980665, rel=1e-3)
    mujoco.mj_step(model, data)
    sensor.reset(sensor.contact_forces())
    for frame in run(sensor, model, data, 50):
        assert frame.texel_forces.sum() + sensor.outside() == pytest.approx(0.980665, rel=1e-3)


@pytest.mark.slow
def test_two_arrays_squeeze_one_free_mesh_between_moving_fingers():
    """Two arrays of one model on moving bodies, each at its own pose, measure the same grip force from both sides."""
    array = TexelArray.grid(4, 4, 3e-3)
    parameters = Parameters(array=array, spread=Gaussian.from_sigma(0.5), electronics=WTS_0614_34)
    spec = make_spec(gravity=[0, 0, 0])
    corners = 4e-3 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    spec.add_mesh(name="cube", uservert=corners.ravel())
    sensors = []
    for sign in (-1, 1):
        finger = add_body(spec, "sphere", [1e-3], [sign * 5e-3, 0, 0], slides="x", damping=2.0, mass=0.05)
        finger.geoms[0].pos = [sign * 0.02, 0, 0]
        turn = [np.sqrt(0.5), 0, -sign * np.sqrt(0.5), 0]
        sensors.append(fastmodel.attach(spec, finger, parameters, name=f"side {sign}", quaternion=turn))
    add_body(spec, "mesh", [], free=True, meshname="cube", density=8000)

    def push(data):
        data.qfrc_applied[:2] = 0.7, -0.7

    simulate(spec, sensors, 1500, push)
    for sensor in sensors:
        assert sensor.contact_forces().sum() == pytest.approx(0.7, rel=2e-3)


def test_attach_leaves_the_models_options_alone_and_warns():
    spec, plain = mujoco.MjSpec(), mujoco.MjSpec().option
    sensor = fastmodel.attach(spec, "world", PARAMETERS)
    for name in ("cone", "solver", "timestep", "impratio", "integrator"):
        assert getattr(spec.option, name) == getattr(plain, name)
    with pytest.warns(OptionWarning, match="recommend_options"):
        sensor.bind(spec.compile())


def test_warnings_name_rates_that_do_not_fit():
    fast = dataclasses.replace(PARAMETERS, filter=Butterworth(cutoff_hz=200.0))
    with pytest.warns(OptionWarning, match="half the frame rate of 271"):
        ball_on_array(fast)
    with pytest.warns(OptionWarning, match="frames come at 200 Hz"):
        ball_on_array(timestep=5e-3)
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        ball_on_array()
    assert given == []


def test_wrong_use_raises_an_error_that_names_the_fault():
    spec = mujoco.MjSpec()
    spec.worldbody.add_body(name="palm")
    with pytest.raises(FastModelError, match="no body named 'plam'; valid names: palm, world"):
        fastmodel.attach(spec, "plam", PARAMETERS)
    with pytest.raises(FastModelError, match="every"):
        fastmodel.attach(spec, "palm", PARAMETERS, every=0)
    with pytest.raises(FastModelError, match="pose"):
        fastmodel.attach(spec, "palm", PARAMETERS, quaternion=(0, 0, 0, 0))
    sensor = fastmodel.attach(spec, "palm", PARAMETERS)
    with pytest.raises(FastModelError, match="'sensor' is on this spec already"):
        fastmodel.attach(spec, "palm", PARAMETERS, contact="boxes")
    for name in ("frame", "texel_forces", "pressures", "contact_forces", "carried", "outside", "reset", "get_state"):
        with pytest.raises(LifeCycleError, match="not bound"):
            getattr(sensor, name)()
    with pytest.raises(LifeCycleError, match="not bound"):
        sensor.texel_poses(None)
    with pytest.raises(LifeCycleError, match="sensor/texel0"):
        sensor.bind(mujoco.MjModel.from_xml_string("<mujoco/>"))
    with pytest.raises(FastModelError, match="half the sampling rate of 50"):
        ball_on_array(timestep=20e-3)


def test_another_model_a_skipped_step_a_reset_and_a_broken_state_are_refused():
    sensor, model, data = ball_on_array()
    _, other, foreign = ball_on_array(timestep=0.9e-3)
    mujoco.mj_step(other, foreign)
    with pytest.raises(LifeCycleError, match="another model"):
        sensor.step(foreign)
    run(sensor, model, data, 5)
    mujoco.mj_step(model, data, nstep=2)
    with pytest.raises(LifeCycleError, match="after every mj_step"):
        sensor.step(data)
    sensor.reset()
    run(sensor, model, data, 5)
    data.qpos[0] = np.nan
    mujoco.mj_step(model, data)
    with pytest.raises(LifeCycleError, match="reset"):
        sensor.step(data)
    mujoco.mj_resetData(model, data)
    sensor.reset()
    run(sensor, model, data, 200)
    mujoco.mj_step(model, data)
    data.efc_force[:] = np.nan
    with pytest.raises(FastModelError, match="not finite"):
        sensor.step(data)


@pytest.mark.parametrize("stepped", [0, pytest.param(5, marks=pytest.mark.slow)])
def test_a_changed_timestep_is_refused_by_step_and_followed_by_reset(stepped):
    sensor, model, data = ball_on_array()
    run(sensor, model, data, stepped)
    model.opt.timestep = 2e-3
    mujoco.mj_step(model, data)
    with pytest.raises(LifeCycleError, match=r"timestep has changed from 0\.001 s to 0\.002 s.*reset"):
        sensor.step(data)
    mujoco.mj_resetData(model, data)
    sensor.reset()
    fresh = ball_on_array(timestep=2e-3)
    same = zip(run(sensor, model, data, 300), run(*fresh, 300), strict=True)
    assert all(a.time == b.time and np.array_equal(a.texel_forces, b.texel_forces) for a, b in same)


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("cone", mujoco.mjtCone.mjCONE_PYRAMIDAL, "recommend_options"),
        ("solver", mujoco.mjtSolver.mjSOL_CG, "recommend_options"),
        ("disableflags", mujoco.mjtDisableBit.mjDSBL_CONTACT, "measures nothing"),
        ("enableflags", mujoco.mjtEnableBit.mjENBL_OVERRIDE, "o_solref"),
    ],
)
def test_a_reset_warns_of_options_that_have_changed(option, value, message):
    sensor, model, _ = ball_on_array()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sensor.reset()
    setattr(model.opt, option, value)
    with pytest.warns(OptionWarning, match=message):
        sensor.reset()
    model.opt.timestep = 5e-2
    with pytest.raises(FastModelError, match="half the sampling rate of 20"):
        sensor.reset()


def test_warnings_name_the_line_outside_the_package():
    sensor, model, _ = ball_on_array()
    model.opt.solver = mujoco.mjtSolver.mjSOL_CG
    for call in (sensor.reset, lambda: sensor.bind(model)):
        with pytest.warns(OptionWarning) as given:
            call()
        assert [each.filename for each in given] == [__file__]
