"""The example of force control: gains, latency and reading against closed forms, and the loops as documented."""

from __future__ import annotations

import dataclasses
import importlib
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fastmodel import WTS_0614_34, Butterworth

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def control():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXAMPLES)
        yield importlib.import_module("force_control")


@pytest.fixture(scope="module")
def picture(control):
    return importlib.import_module("force_control_picture")


@pytest.mark.parametrize("rate", [31.0, 271.0])
def test_latency_is_half_a_frame_and_the_delay_and_grows_with_a_filter(control, rate):
    parameters = control.load_sensor(rate)[0]
    bare = control.measure_latency(parameters, 0.01)
    assert bare == pytest.approx(0.5 / rate + 0.01, rel=0.02)
    filtered = dataclasses.replace(parameters, filter=Butterworth(cutoff_hz=rate / 10, order=1))
    # A first-order low-pass reaches half of a step after ln 2 / (2 pi f).
    later = np.log(2) / (2 * np.pi * rate / 10)
    assert control.measure_latency(filtered, 0.01) - bare == pytest.approx(later, abs=0.05 / rate)


@pytest.mark.parametrize("period", [1 / 31, 1 / 271])
def test_gains_close_the_loop_with_one_pole(control, period):
    """A drive of first order and a reading of gain one: the error shrinks by one factor a frame."""
    latency, lag = period / 2, 0.02
    gains = control.derive_gains(period, latency, lag)
    tau = max(1.5 * latency, lag)
    command = place = last = 0.0
    errors = []
    for _ in range(6):
        error = 1.0 - place
        errors.append(error)
        command += gains.gain * (error - gains.kept * last)
        place, last = command + (place - command) * np.exp(-period / lag), error
    factor = 1 - period / (tau + latency)
    np.testing.assert_allclose(errors, factor ** np.arange(6), atol=1e-12)


def test_the_reading_is_continuous_and_true_above_twice_the_dead_zone(control):
    electronics = dataclasses.replace(WTS_0614_34, tip_share=0.7646)
    forces = np.linspace(0, 1.2, 2401)
    read = control.read_forces(electronics, electronics.counts(forces[:, None])[:, 0])
    dead = 493.87 / 2665.7 * 0.7646
    assert np.abs(np.diff(read)).max() < 3 * (forces[1] - forces[0])
    np.testing.assert_allclose(read[forces > 2 * dead + 1e-3], forces[forces > 2 * dead + 1e-3], atol=3e-4)
    assert not read[forces < dead].any()


@pytest.mark.slow
def test_loops_settle_in_time_with_the_fast_model_and_with_finite_elements(control):
    records = {}
    for row, record in control.settle_everywhere(("fast", "reference")):
        key = (row["place"], row["frames/s"], round(row["latency [ms]"] * row["frames/s"] / 1e3))
        records.setdefault(key, []).append(record)
        if row["place"] != "half beside":
            assert row["settles [ms]"] <= row["allowed [ms]"], row
            assert 5.5 < row["true [N]"] < 6.2  # the dead zones of the texels around the block
        else:
            assert row["true [N]"] > 8  # the array sees 65 % of the force
        assert row["reading [N]"] == pytest.approx(5.0, rel=0.01)
    for fast, reference in records.values():
        assert control.measure_misplaced(fast.forces, reference.forces) < 0.02
    one = records["centre", 31.0, 0][0]
    assert control.measure_misplaced(1.05 * one.forces, one.forces) > 0.02  # a planted difference


@pytest.mark.slow
def test_models_disagree_about_the_largest_texel_and_the_middle(control):
    found = {model: control.guide(model) for model in control.MODELS}
    for record, _ in found.values():
        assert record.largest[-1] == pytest.approx(control.LIMIT, rel=0.01)
        assert abs(record.middle[-1]) < 1e-4
    largest = {model: true[-1].max() / control.LIMIT for model, (_, true) in found.items()}
    assert largest["reference"] == pytest.approx(1, abs=0.01)
    assert largest["fast"] == pytest.approx(1, abs=0.03)
    assert largest["Gaussian"] == pytest.approx(1.05, abs=0.03)
    assert largest["boxes"] > 1.6
    fast, true = found["fast"]
    assert control.measure_misplaced(fast.forces, true) < 0.02
    own = found["reference"][0]
    assert control.measure_misplaced(fast.forces, own.forces) < 0.02
    assert abs(own.place[-1]) < 1e-4


@pytest.mark.slow
def test_with_creep_the_true_force_falls_while_the_reading_stays(picture):
    record, falls = picture.hold_with_creep()
    late = record.times > 2.0
    np.testing.assert_allclose(record.reading[late], 5.0, rtol=0.005)
    shape = record.true[late] / falls[late]
    # Superposed creep of the falling force itself leaves a slow drift from the logarithm.
    assert np.ptp(shape) / shape.mean() < 0.03
    assert record.true[late][0] / record.true[-1] == pytest.approx(1 + 0.12 * np.log(50), rel=0.03)
    still = picture.make_loop("centre", 31.0).run(20.0, lambda _: 5.0)
    assert np.ptp(still.true[still.times > 2.0]) < 0.01


@pytest.mark.slow
def test_saturated_texels_stop_the_reading_and_a_moved_object_is_corrected(picture):
    found = picture.make_ball().run(6.0, lambda now: 2.0 * now)
    assert found.reading[-1] < 5.5
    assert found.true[-1] > 11
    assert found.counts.max() == WTS_0614_34.output_max
    pushed = picture.make_loop("centre", 271.0).run(1.2, lambda _: 5.0, moved=lambda now: 1e-4 * (now >= 0.6))
    assert pushed.reading.max() > 5.5
    assert pushed.settling(0.6, 5.0) < 0.2


@pytest.mark.slow
def test_the_example_prints_and_draws_as_documented(tmp_path):
    command = [sys.executable, EXAMPLES / "force_control.py", "--out", "out"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)  # noqa: S603 -- ours
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"force-control.png", "force-control-models.png"}
    rows = re.findall(
        r"^(?:centre|off-centre|near the edge|half beside)  (?:fast|reference) ", done.stdout, re.MULTILINE
    )
    assert len(rows) == 32
