"""Terms of published models in time, against closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import butter, sosfilt

from validation.published.in_time import butterworth, mean_between, mean_of, recursion
from validation.published.rules import PUBLISHED

STEP = 1e-3


def test_graspit_falls_to_one_part_in_e_after_its_time_constant():
    """y = 0.1 f + 0.9 y every 2.5 ms: 0.9^n after n computations, 1/e at 2.5 ms / -ln 0.9 = 23.73 ms."""
    forces = np.concatenate([[1.0], np.zeros(200)])[:, None] * [2.0, 0.0]
    (term,) = PUBLISHED["tegin-2005"].terms.values()
    found = term(forces, 0.5e-3)
    assert found[0, 0] == pytest.approx(2.0)
    for count in (1, 4, 9, 39):
        assert found[5 * count : 5 * count + 5, 0] == pytest.approx(2 * 0.9**count)
    below = np.argmax(found[:, 0] < 2 / np.e) * 0.5e-3
    assert 23.73e-3 <= below <= 23.73e-3 + 2.5e-3
    assert not found[:, 1].any()


def test_a_recursion_with_steps_longer_than_its_interval_keeps_its_time_constant():
    """A step of 1 ms, computed every 0.25 ms: four computations with one sample."""
    found = recursion(0.02, 0.25e-3)(np.append(0.0, np.ones(100)), STEP)
    assert found[50] == pytest.approx(1 - 0.98 ** (4 * 50 - 3), abs=2e-3)


@pytest.mark.parametrize(("share", "interval"), [(0.1, 2.5e-3), (0.3, 1e-3), (0.04, 0.4e-3), (0.5, 7e-3)])
def test_a_recursion_takes_the_sample_at_each_computation(share, interval):
    """Computed one by one at multiples of the interval, with the sample then or the next one, and held between."""
    forces = np.random.default_rng(4).normal(size=60)
    value, count, wanted = forces[0], 0, []
    for k in range(len(forces)):
        while (count + 1) * interval <= k * STEP + 1e-12:
            count += 1
            value = share * forces[int(np.ceil(count * interval / STEP - 1e-9))] + (1 - share) * value
        wanted.append(value)
    assert recursion(share, interval)(forces, STEP) == pytest.approx(wanted, abs=1e-12)


def test_robworksim_has_the_time_constant_that_it_states():
    """alpha = dt / (tau + dt) with tau = 0.1 s and dt = 1 ms: (1 - alpha)^n of a step is left."""
    (term,) = PUBLISHED["robworksim-later"].terms.values()
    found = term(np.append(0.0, np.ones(400)), STEP)
    assert found[100] == pytest.approx(1 - (100 / 101) ** 100, rel=1e-9)


@pytest.mark.parametrize(("samples", "interval", "late"), [(10, 1e-3, 4.5e-3), (4, 2e-3, 3.5e-3), (1, 1e-3, 0.0)])
def test_a_mean_delays_a_ramp_by_half_its_length(samples, interval, late):
    times = STEP * np.arange(100)
    found = mean_of(samples, interval)(np.clip(times - 0.02, 0, None), STEP)
    assert found[60:] == pytest.approx(times[60:] - 0.02 - late, abs=1e-12)


@pytest.mark.parametrize(
    ("interval", "expected"),
    [
        (0.4e-3, [0, 1, 2, 3, 4, 5, 6, 7, 8]), (1e-3, [0, 1, 2, 3, 4, 5, 6, 7, 8]),
        (2.1e-3, [0, 0, 1.5, 1.5, 3.5, 3.5, 5.5, 5.5, 7.5]), (4e-3, [0, 0, 0, 0, 2.5, 2.5, 2.5, 2.5, 6.5]),
    ],
)  # fmt: skip
def test_a_read_is_the_mean_since_the_last_one_and_is_held(interval, expected):
    """Of a ramp; before the first sample there are copies of it, and reads between two samples are those samples."""
    assert mean_between(interval)(np.arange(9.0), STEP) == pytest.approx(expected)


@pytest.mark.parametrize(("order", "cutoff"), [(5, 20.0), (5, 8.0), (2, 5.0), (2, 2.0)])
def test_the_settings_of_the_2015_report_pass_a_sine_with_the_gain_of_a_butterworth_filter(order, cutoff):
    """|H| = (1 + r^2n)^-1/2 with r = tan(pi f / fs) / tan(pi fc / fs), the bilinear transform."""
    term = PUBLISHED["report-0.8-5x5"].terms[f"order {order}, {cutoff:g} Hz"]
    times = STEP * np.arange(20_000)
    for frequency in (0.5 * cutoff, cutoff, 2 * cutoff):
        found = term(np.sin(2 * np.pi * frequency * times), STEP)[10_000:]
        ratio = np.tan(np.pi * frequency * STEP) / np.tan(np.pi * cutoff * STEP)
        assert np.sqrt(2 * np.mean(found**2)) == pytest.approx((1 + ratio ** (2 * order)) ** -0.5, rel=2e-3)


def test_a_filter_begins_in_the_steady_state_and_equals_scipy():
    random = np.random.default_rng(2)
    forces = random.normal(size=(300, 3))
    found = butterworth(3, 30.0)(forces, STEP)
    held = np.concatenate([np.repeat(forces[:1], 5000, axis=0), forces])
    exact = sosfilt(butter(3, 30.0, fs=1 / STEP, output="sos"), held, axis=0)[5000:]
    assert found == pytest.approx(exact, abs=1e-10)


def test_the_reads_of_gazebo_ros_tactile_are_means_that_do_not_overlap():
    (term,) = PUBLISHED["gazebo-ros-tactile"].terms.values()
    samples = np.arange(35.0)
    found = term(samples[:, None] * [1.0, -2.0], STEP)
    assert found[:10] == pytest.approx(0.0)
    for read in (10, 20, 30):
        assert found[read : read + 5, 0] == pytest.approx([samples[read - 9 : read + 1].mean()] * 5)
    assert found[:, 1] == pytest.approx(-2 * found[:, 0])


def test_the_spring_of_skinsim_is_that_of_an_independent_integration():
    """m x'' + c x' + k x = f by an adaptive Runge-Kutta method; and the closed form of a step, damping ratio 0.508."""
    (term,) = PUBLISHED["skinsim-2014"].terms.values()
    k, c, m, times = 16.37, 0.130, 1e-3, STEP * np.arange(400)
    forces = 1 + np.sin(2 * np.pi * 7 * times) * (times < 0.3)

    def move(time, state):
        return [state[1], (np.interp(time, times, forces) - c * state[1] - k * state[0]) / m]

    exact = solve_ivp(move, (0, times[-1]), [1 / k, 0.0], t_eval=times, rtol=1e-9, atol=1e-12, max_step=STEP).y[0]
    found = term(forces[:, None] * [1.0, 3.0], STEP)
    assert found[:, 0] == pytest.approx(k * exact, abs=1e-4)
    assert found[:, 1] == pytest.approx(3 * found[:, 0])
    fine = term((np.arange(4000) > 0).astype(float), 1e-4)
    decay, own = c / (2 * m), np.sqrt(k / m - (c / (2 * m)) ** 2)
    after = 1e-4 * (np.arange(1, 4000) - 0.5)  # the ramp of one sample is centred between two
    closed = 1 - np.exp(-decay * after) * (np.cos(own * after) + decay / own * np.sin(own * after))
    assert fine[20:] == pytest.approx(closed[19:], abs=1e-3)


def test_the_hysteresis_of_genesis_relaxes_after_a_step_and_lags_a_cycle():
    """1 + s exp(-t / tau); a cycle at 1 / tau has gain |1 + s i w tau / (1 + i w tau)|; none as shipped."""
    none, term = PUBLISHED["genesis-taxel"].terms.values()
    step = np.append(0.0, np.ones(300))
    assert none(step, STEP).tolist() == step.tolist()
    assert term(step, STEP)[1:] == pytest.approx(1 + 0.5 * np.exp(-STEP * np.arange(300) / 0.1))
    wave = np.sin(np.arange(20_000) * 1e-4 / 0.1)
    late = term(wave, 1e-4)[12_000:]
    assert np.sqrt(2 * np.mean(late[: int(2 * np.pi * 1000)] ** 2)) == pytest.approx(abs(1 + 0.25 * (1 + 1j)), rel=2e-3)


def test_a_damper_of_genesis_changes_no_force_under_a_given_load():
    """f = s (k + c v): a rigid body has one v, so that forces scaled to the load do not contain c."""
    depths = np.array([1.0, 0.4, 0.1])
    for speed in (-0.05, 0.0, 0.1):
        forces = depths * (1000 + 1.0 * speed)
        assert forces / forces.sum() == pytest.approx(depths / depths.sum())


def test_models_with_a_term_in_time_say_so_in_words():
    for model in PUBLISHED.values():
        assert not model.terms or model.in_time


@pytest.mark.parametrize("term", [mean_of(10, 1e-3), mean_between(10e-3)])
def test_a_mean_over_less_than_a_step_is_the_sample(term):
    forces = np.random.default_rng(3).normal(size=(7, 2))
    assert term(forces, 50e-3) == pytest.approx(forces)
