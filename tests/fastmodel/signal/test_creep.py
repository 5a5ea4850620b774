"""Creep of the transducer, against its formula and against superposition."""

import dataclasses

import numpy as np
import pytest
from scipy.special import gamma

import fastmodel
from fastmodel import ChainFunctions, Electronics
from fastmodel.errors import FastModelError
from fastmodel.signal import creep as creep_module
from fastmodel.signal.creep import Creep
from validation.sensor_file import load

PARAMETERS = fastmodel.load("wts-0614-34")


def hold(creep, load, seconds, interval):
    """Readings of a load that is put down at rest and held, at the ends of the intervals."""
    force, states, found = np.array([load]), creep.settle(np.zeros(1)), []
    for _ in range(round(seconds / interval)):
        reading, states = creep.step(states, force, interval)
        found.append(float(reading[0]))
    return interval * np.arange(1, len(found) + 1), np.array(found)


@pytest.mark.parametrize(
    "coefficient", [pytest.param(0.03, marks=pytest.mark.slow), 0.12, pytest.param(0.2, marks=pytest.mark.slow)]
)
def test_a_held_load_grows_with_the_logarithm_of_time(coefficient):
    """1 + c ln(t / 2 s) from 1 s on; two states a decade, so that the ripple is far below 0.1 %."""
    times, found = hold(Creep(coefficient), 3.0, 100.0, 0.05)
    late = times >= 1
    assert found[late] == pytest.approx(3 * (1 + coefficient * np.log(times[late] / 2)), rel=1e-3)
    assert found[np.isclose(times, 2)] == pytest.approx(3.0, rel=1e-12)


def test_the_ripple_is_that_of_a_ladder_of_time_constants(monkeypatch):
    """2 c |Gamma(i w)| with w = 2 pi / ln b, in the middle of 12 decades: one and two states a decade.

    The part of the readings at w over an integer number of its periods, free of the logarithm.
    """
    monkeypatch.setattr(creep_module, "_SHORTEST", 1e-5)
    monkeypatch.setattr(creep_module, "_LONGEST", 1e7)
    for per_decade in (1, 2):
        monkeypatch.setattr(creep_module, "_PER_DECADE", per_decade)
        creep, turn = Creep(0.12), 2 * np.pi * per_decade / np.log(10)
        logs = np.log(10) * (2 * np.arange(4096) / 4096)
        readings = creep.instant + creep.weight * -np.expm1(-np.exp(logs)[:, None] / creep.times).sum(axis=1)
        rest = readings - 0.12 * logs
        ripple = 2 * abs(np.mean((rest - rest.mean()) * np.exp(-1j * turn * logs)))
        assert ripple == pytest.approx(2 * 0.12 * abs(gamma(1j * turn)), rel=0.01)


def test_the_interval_has_no_effect():
    fine, coarse = hold(Creep(0.12), 1.7, 20.0, 0.01)[1], hold(Creep(0.12), 1.7, 20.0, 0.5)[1]
    assert fine[49::50] == pytest.approx(coarse, rel=1e-12)


def test_loads_superpose_and_a_lifted_load_leaves_its_memory():
    creep = Creep(0.15)
    states = creep.settle(np.zeros(2))
    for _ in range(50):
        _, states = creep.step(states, np.array([2.0, 0.0]), 0.1)
    reading, _ = creep.step(states, np.array([0.0, 0.0]), 3.0)
    grown = creep.weight * (np.exp(-3 / creep.times) - np.exp(-8 / creep.times)).sum()
    assert reading == pytest.approx([2 * grown, 0.0])
    assert reading[0] > 0.1


def make(coefficient):
    electronics = dataclasses.replace(PARAMETERS.electronics, creep=coefficient, sensitivity=500.0, offset=0.0)
    return dataclasses.replace(PARAMETERS, electronics=electronics)


def test_counts_of_the_chain_creep_and_its_texel_forces_do_not():
    functions, plain = (ChainFunctions(make(c), 1000.0) for c in (0.12, 0.0))
    forces = np.zeros((2, 84))
    forces[:, 38] = [4.0, 2.0]
    state = functions.settle(np.zeros_like(forces))
    state = functions.take(state, forces)
    _, still = plain.frame(plain.settle(forces))
    for _ in range(10 * 271):
        state, output = functions.frame(state)
    assert output.texel_forces == pytest.approx(still.texel_forces)
    lit = still.counts > 200
    assert lit.any()
    assert output.counts[lit] == pytest.approx(still.counts[lit] * (1 + 0.12 * np.log(5)), rel=2e-3, abs=1)


def test_a_frame_after_several_intervals_equals_several_frames():
    functions, forces = ChainFunctions(make(0.1), 1000.0), np.full(84, 0.7)
    state = functions.take(functions.settle(np.zeros(84)), forces)
    one, once = functions.frame(state, frames=40)
    for _ in range(40):
        state, many = functions.frame(state)
    assert one.creep == pytest.approx(state.creep, rel=1e-12)
    assert (once.counts == many.counts).all()


def test_a_settled_load_reads_its_force():
    functions, forces = ChainFunctions(make(0.2), 1000.0), np.full(84, 0.9)
    _, output = functions.frame(functions.settle(forces), frames=0)
    _, plain = ChainFunctions(make(0.0), 1000.0).frame(ChainFunctions(make(0.0), 1000.0).settle(forces))
    assert (output.counts == plain.counts).all()


@pytest.mark.parametrize("coefficient", [-0.01, 0.21, float("nan")])
def test_a_coefficient_out_of_range_is_refused(coefficient):
    with pytest.raises(FastModelError, match=r"creep must lie in 0\.\.0\.2"):
        Creep(coefficient)
    with pytest.raises(ValueError, match="creep"):
        Electronics(rate_hz=100.0, sensitivity=1.0, creep=coefficient)


def test_a_sensor_file_and_a_folder_of_parameters_keep_it(tmp_path):
    text = '[array]\nrows = 2\ncolumns = 3\npitch = "3 mm"\n[[cover.layer]]\nthickness = "2 mm"\nmaterial = "tpu"\n'
    (tmp_path / "sensor.toml").write_text(text + '[electronics]\nsensitivity = "1000 1/N"\ncreep = 0.11\n')
    assert load(tmp_path / "sensor.toml").electronics.creep == 0.11
    make(0.07).save(tmp_path / "folder")
    assert fastmodel.load(tmp_path / "folder").electronics.creep == 0.07
