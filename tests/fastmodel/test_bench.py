import dataclasses
import itertools
import re

import numpy as np
import pytest

import fastmodel
from fastmodel import WTS_0614_34, FastModelError, Gaussian, Parameters, Placement, bench, indent
from fastmodel.bench import Bench
from fastmodel.errors import MissedArrayError
from meshes import Box, Cylinder, LetterH, Nut, RoundedTip, Sphere, TexelArray, tilt_indenter
from meshes.catalogue import ARRAYS
from tests.support.bent_array import bent_array

WTS = ARRAYS["wts-0614-34"]
PARAMETERS = Parameters(array=WTS, spread=Gaussian.from_sigma(0.6), electronics=WTS_0614_34)
SHAPES = (
    Sphere(radius=5e-3),
    Cylinder(radius=5e-3),
    Box(size=(10e-3, 10e-3, 5e-3)),
    Box(size=(6e-3, 18e-3, 5e-3)),
    RoundedTip(),
)
# Over a corner, a centre, an edge of texels, and off the grid.
PLACES = ((0.0, 0.0), (1.7e-3, 1.7e-3), (1.7e-3, 0.0), (0.7e-3, -1.1e-3))
YAWS = (0.0, np.pi / 4)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_contact_force_before_spread_is_the_weight(shape):
    worst = 0.0
    for load, at, yaw in itertools.product((0.098, 4.9), PLACES, YAWS):
        result = indent(PARAMETERS, shape, load=load, at=at, yaw=yaw)
        worst = max(worst, abs(result.total_force / load - 1))
        assert np.all(result.contact_forces >= 0)
        assert np.isfinite(result.texel_forces).all()
        assert result.texel_forces.sum() + result.outside == pytest.approx(load, rel=1e-3)
    assert worst < 1e-3


def test_force_lands_under_the_indenter_and_nowhere_else():
    at = WTS.centres[20, :2]
    result = indent(PARAMETERS, RoundedTip(), load=1.0, at=(at[0], at[1]))
    assert np.flatnonzero(result.contact_forces).tolist() == [20]
    assert np.allclose(result.texel_forces, Gaussian.from_sigma(0.6).operator(WTS)[:, 20], rtol=1e-3)


@pytest.mark.parametrize("method", ["boxes", "foundation"])
@pytest.mark.parametrize("at", [(0.2e-3, 1.8e-3), (-0.2e-3, 1.6e-3), (0.2e-3, -1.8e-3)])
def test_force_lands_on_texels_that_are_not_square(method, at):
    array = TexelArray.grid(3, 5, (2e-3, 5e-3))
    parameters = dataclasses.replace(PARAMETERS, array=array)
    found = indent(parameters, Sphere(radius=2e-3), load=0.02, at=at, contact=method)
    assert found.contact_forces[array.middle] > 0.9 * 0.02


def test_face_on_whole_texels_is_shared_evenly():
    shape = Box(size=(3.3 * 3.4e-3, 3.3 * 3.4e-3, 5e-3))
    result = indent(PARAMETERS, shape, load=9.0, at=(1.7e-3, 1.7e-3))
    assert result.contact_forces.max() == pytest.approx(result.contact_forces[result.contact_forces > 0].min())


@pytest.mark.parametrize("method", ["cover", "foundation"])
@pytest.mark.parametrize(
    ("shape", "at", "yaw"),
    [
        (Box(size=(11e-3, 16e-3, 8e-3)), (-9e-3, 21e-3), 0.0),
        (LetterH(size=(14e-3, 17e-3), bar=4e-3), (11e-3, 5e-3), 0.6),
        (Sphere(radius=60e-3), (0.0, 25e-3), 0.0),
        (Nut(across=16e-3, bore=10e-3), (-9e-3, 0.0), 0.3),
    ],
)
def test_a_body_beyond_the_array_presses_on_a_cover_that_goes_on(shape, at, yaw, method):
    """Without a stated margin the cover goes on, as in the finite elements: like one with a wide stated margin."""
    parameters = fastmodel.load("wts-0614-34")
    wide = dataclasses.replace(parameters.array, margin=(40e-3, 40e-3))
    found = indent(parameters, shape, load=3.0, at=at, yaw=yaw, contact=method)
    known = indent(dataclasses.replace(parameters, array=wide), shape, load=3.0, at=at, yaw=yaw, contact=method)
    assert found.texel_forces == pytest.approx(known.texel_forces, abs=1e-4 * 3.0)
    assert found.outside == pytest.approx(known.outside, abs=1e-3 * 3.0)
    assert found.outside > 0.1 * 3.0
    assert not any("end of the plate" in each for each in found.warnings)


def test_a_bench_presses_beyond_the_array_like_one_that_is_made_there_and_back_inside_as_before():
    parameters, face = fastmodel.load("wts-0614-34"), Box(size=(20e-3, 20e-3, 8e-3))
    ready = Bench(parameters, [Placement(indenter=face, load=5.0)])
    inside = ready.press([(0.0, 0.0, 0.0)]).texel_forces
    beyond = ready.press([(10e-3, 20e-3, 0.4)]).texel_forces
    alone = indent(parameters, face, load=5.0, at=(10e-3, 20e-3), yaw=0.4).texel_forces
    assert beyond == pytest.approx(alone, abs=1e-6)  # MuJoCo's stiffness depends on the place at which it compiles
    assert np.array_equal(ready.press([(0.0, 0.0, 0.0)]).texel_forces, inside)


def test_a_face_that_lies_half_beyond_the_array_loads_the_texels_by_half():
    """A foundation bears a flat face evenly: the middle of 7 x 14 mm lies on the edge of the array."""
    array = TexelArray.grid(8, 6, pitch=3.5e-3)
    parameters = Parameters(
        array=array, spread=Gaussian(sigma_x=0.5, sigma_y=0.5, ksize_x=3, ksize_y=3), electronics=WTS_0614_34
    )
    found = indent(parameters, Box(size=(7e-3, 14e-3, 5e-3)), load=3.0, at=(0.0, 14e-3), contact="foundation")
    assert found.contact_forces.sum() == pytest.approx(1.5, rel=0.02)
    assert found.total_force == pytest.approx(3.0, rel=1e-3)


def test_a_body_far_beyond_the_widest_plate_is_said_to_go_on():
    parameters = fastmodel.load("wts-0614-34")
    found = indent(parameters, Box(size=(0.4, 0.4, 0.01)), load=50.0)
    assert any("reaches the end of the plate" in each for each in found.warnings)
    stated = dataclasses.replace(parameters, array=dataclasses.replace(parameters.array, margin=(2e-3, 2e-3)))
    assert not indent(stated, Box(size=(0.4, 0.4, 0.01)), load=50.0).warnings


def test_a_bent_array_carries_the_weight():
    parameters = dataclasses.replace(PARAMETERS, array=bent_array(), spread=Gaussian.from_sigma(0.4))
    result = indent(parameters, Sphere(radius=5e-3), load=2.0, at=(0.3e-3, 0.2e-3))
    assert result.total_force == pytest.approx(2.0, rel=1e-3)
    assert result.contact_forces.argmax() == 4


@pytest.mark.parametrize(
    "method",
    [pytest.param("boxes", marks=pytest.mark.slow), pytest.param("foundation", marks=pytest.mark.slow), "cover"],
)
def test_a_simulated_fall_ends_at_the_height_at_which_the_indenter_is_set_down(monkeypatch, method):
    sensor = fastmodel.load("sdh2-distal")
    shapes = (Box(size=(9e-3, 7e-3, 5e-3)), tilt_indenter(Box(size=(9e-3, 7e-3, 5e-3)), (0.02, 0.01)), RoundedTip())
    places = [(1.2e-3, -0.7e-3, 0.2), (0.0, 0.4e-3, 0.0)]
    benches = [Bench(sensor, [Placement(indenter=each, load=3.0, at=(1e-3, 0.0))], contact=method) for each in shapes]
    found = [each.press([place]).texel_forces for each in benches for place in places]
    monkeypatch.setattr(bench, "_lower", lambda *_: None)
    fallen = [
        indent(sensor, each, load=3.0, at=(x, y), yaw=yaw, contact=method).texel_forces
        for each in shapes
        for x, y, yaw in places
    ]
    assert np.allclose(found, fallen, rtol=0, atol=3e-5)


def test_forces_that_do_not_settle_are_averaged(monkeypatch):
    """With a shortened settling time the mean force still equals the weight, and `chatter` is positive."""
    shape = Cylinder(radius=5e-3)
    settled = indent(PARAMETERS, shape, load=0.952)
    monkeypatch.setattr(bench, "_lower", lambda *_: None)
    monkeypatch.setattr(bench, "SETTLE_TIME", 0.1)
    averaged = indent(PARAMETERS, shape, load=0.952)
    assert settled.chatter == 0
    assert 0 < averaged.chatter < 1e-3
    assert averaged.total_force == pytest.approx(0.952, rel=1e-3)
    assert np.allclose(averaged.contact_forces, settled.contact_forces, atol=1e-3)


@pytest.mark.parametrize(("steps", "share"), [(2, 0.54), (6, 0.89), (20, 0.99)])
def test_a_load_of_which_a_part_is_missing_is_refused(monkeypatch, steps, share):
    """Averaged from the first touch on, the texels carry a part of the load only."""
    monkeypatch.setattr(bench, "_lower", lambda *_: None)
    monkeypatch.setattr(bench, "SETTLE_TIME", 0.0)
    monkeypatch.setattr(bench, "AVERAGE_TIME", (steps + 0.5) * bench.TIMESTEP)
    with pytest.raises(bench.MissedArrayError, match="of 2 N; 'at' must lie on the array") as refused:
        indent(PARAMETERS, Sphere(radius=5e-3), load=2.0, contact="boxes")
    carried = float(re.search(r"carry ([\d.]+) N", str(refused.value))[1])
    assert carried / 2 == pytest.approx(share, abs=0.02)


def test_bad_input_raises_an_error_that_names_the_fault():
    sphere = Sphere(radius=5e-3)
    with pytest.raises(FastModelError, match="load must be positive"):
        indent(PARAMETERS, sphere, load=0.0)
    with pytest.raises(FastModelError, match="finite"):
        indent(PARAMETERS, sphere, load=1.0, at=(np.nan, 0.0))
    with pytest.raises(MissedArrayError, match="'at' must lie on the array"):
        indent(PARAMETERS, sphere, load=1.0, at=(0.1, 0.0))
    ready = Bench(PARAMETERS, [Placement(indenter=sphere, load=1.0)])
    for places in ([(np.nan, 0.0, 0.0)], [(0.0, 0.0, np.inf)], [], [(0.0, 0.0)], [(0.0, 0.0, 0.0)] * 2):
        with pytest.raises(FastModelError, match="give 1 places of finite x"):
            ready.press(places)
