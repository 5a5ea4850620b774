"""Comparison errors on recordings: every part of u_val by hand for one load."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from meshes import Box, Cover, Layer, TexelArray
from meshes.catalogue import MATERIALS
from tests.support.straight_line import StraightLine
from validation.calibration.model import ContactMethod, Placement, Pose
from validation.campaign.campaign_file import Inputs
from validation.credibility.recorded import compare_loads
from validation.data_sets.images import observe

ARRAY = TexelArray.grid(9, 9, 3e-3, name="square")
RUBBER = next(each for each in MATERIALS.values() if each.spread and not each.poisson_spread)
COVER = Cover(layers=(Layer(thickness=1.5e-3, material=RUBBER),))
#: Only the position is uncertain, by 0.1 mm along x and along y.
POSITION = Inputs(modulus=0.0, poisson_ratio=0.0, thickness=0.0, position=1e-4, yaw=0.0, friction=0.0)
PLACEMENT = Placement(name="here", indenter=Box(size=(8e-3, 8e-3, 5e-3)), at=(0.0, 0.0), yaw=0.0)
LOAD, SLOPE, CREEP, NOISE, THRESHOLD = 10.0, 1200.0, 0.12, 2.5, 40.0
ROUNDING = 1 / math.sqrt(12)


def even_forces(_indenter, load, _pose):
    """Equal forces on the 3 x 3 texels in the middle."""
    inside = np.abs(ARRAY.centres[:, :2]).max(axis=1) < 4e-3
    return load * inside / inside.sum()


LINE = StraightLine(ContactMethod(name="even", about="", array=ARRAY, solve=even_forces), SLOPE)


def make_image(factor, placement=PLACEMENT, load=LOAD, creep=CREEP):
    """A recorded image: the prediction with a factor."""
    counts = factor * SLOPE * even_forces(None, load, None)
    return SimpleNamespace(
        load=load, counts=counts, measured=np.ones(81, dtype=bool), temperature=30.0, age=7.5, creep=creep,
        threshold=THRESHOLD, floor=np.zeros(81), noise=NOISE, case=f"{placement.name} {load:g} N",
        file=SimpleNamespace(placement=placement, name="a.csv", window=(6.0, 9.0)),
    )  # fmt: skip


def compare(factors=(0.96, 0.98), cover=COVER, inputs=POSITION):
    found = compare_loads(LINE, [make_image(each) for each in factors], cover, inputs)
    return {each.quantity.split(" [")[0]: each for each in found}


@pytest.mark.slow
def test_u_val_of_one_load_by_hand():
    found = compare()
    total = LOAD * SLOPE
    recorded = 0.97 * total
    error = found["sum of counts"]
    assert error.error == pytest.approx(0.03 * total)
    assert error.u_num == pytest.approx(2e-4 * total)
    repeats = 0.02 * total / 2  # standard deviation of two repeats over the root of two
    creep = CREEP * math.log(9 / 6) * ROUNDING * (recorded + 9 * THRESHOLD)
    noise = 3 * math.hypot(NOISE, ROUNDING)  # of nine lit texels
    assert error.u_data == pytest.approx(math.sqrt(repeats**2 + creep**2 + noise**2), rel=1e-6)
    assert error.u_val == pytest.approx(math.sqrt(error.u_num**2 + error.u_input**2 + error.u_data**2))
    assert error.least_error == pytest.approx(error.error - 2 * error.u_val)

    centre = found["centre of counts x"]
    # The centre moves with the indenter; repeats and creep act on all texels alike.  The effect of the position is that
    # of the pressure on this cover, not of the even forces here.
    assert centre.u_input == pytest.approx(1e-4, rel=0.1)
    lever = math.sqrt(6) * 3e-3  # three texels on either side
    assert centre.u_data == pytest.approx(lever * math.hypot(NOISE, ROUNDING) / recorded, rel=1e-3)
    assert centre.u_num == pytest.approx(2e-4 * 3e-3, rel=1e-3)  # on the first of nine equal texels
    assert centre.resolved is False


@pytest.mark.slow
def test_an_error_beyond_u_val_is_resolved():
    assert compare((0.5, 0.5))["sum of counts"].resolved is True


@pytest.mark.slow
def test_an_assumed_cover_enters_with_its_range_of_ignorance():
    """The thickness of an assumed cover counts from half to three times, instead of the 2.5 % of a measured one."""
    inputs = dataclasses.replace(POSITION, position=0.0, thickness=0.025)
    known, assumed = (compare(cover=dataclasses.replace(COVER, assumed=each), inputs=inputs) for each in (False, True))
    assert known["largest texel"].u_input > 0
    assert assumed["largest texel"].u_input > 3 * known["largest texel"].u_input


def test_an_assumed_cover_without_a_range_has_no_interval():
    bare = dataclasses.replace(RUBBER, spread=0.0, spread_above=0.0)
    cover = Cover(layers=(Layer(thickness=1.5e-3, material=bare),), assumed=True)
    for error in compare(cover=cover).values():
        assert math.isnan(error.u_val)
        assert math.isnan(error.largest_error)
        assert error.resolved is None


@pytest.mark.slow
def test_a_fitted_pose_has_the_u_input_of_the_same_known_pose():
    """At a fitted pose the forces are interpolated in a lattice of poses, which a fit has computed before."""
    at, yaw = (0.4e-3, -0.7e-3), 0.2
    inputs = dataclasses.replace(POSITION, thickness=0.05)
    known = dataclasses.replace(PLACEMENT, at=at, yaw=yaw)
    fitted = dataclasses.replace(PLACEMENT, at=None, yaw=None)
    line = dataclasses.replace(LINE, poses={fitted.name: Pose(*at, yaw)})
    line.predict(observe([make_image(1.0, fitted)]))  # fills the lattice
    one, two = (compare_loads(line, [make_image(1.0, each)], COVER, inputs) for each in (known, fitted))
    for expected, found in zip(one, two, strict=True):
        assert found.u_input == pytest.approx(expected.u_input, rel=0.1)
        assert found.u_input > 0


def test_the_scatter_of_repeats_is_relative_to_the_load():
    """Repeats differ by 4 % at every load; a load without repeats has the same relative scatter."""
    images = [make_image(factor, load=load, creep=0.0) for load in (1.0, 40.0) for factor in (0.94, 0.98)]
    images.append(make_image(0.96, load=10.0, creep=0.0))
    compared = compare_loads(LINE, images, COVER, POSITION)
    found = {each.case: each for each in compared if each.quantity == "sum of counts"}
    noise = 3 * math.hypot(NOISE, ROUNDING)
    deviation = 0.04 / math.sqrt(2)
    for load, repeats in ((1.0, 2), (40.0, 2), (10.0, 1)):
        expected = math.hypot(deviation * SLOPE * load / math.sqrt(repeats), noise)
        assert found[f"here {load:g} N"].u_data == pytest.approx(expected, rel=1e-6)


def test_sum_largest_texel_and_centre_are_those_of_the_mean_of_repeats():
    """Counts of two repeats on two texels, one of them with 30 and 70, and an unmeasured one with more."""
    images = [make_image(1.0), make_image(1.0)]
    for image, (one, other) in zip(images, ((30.0, 40.0), (70.0, 20.0)), strict=True):
        image.counts = np.zeros(81)
        image.counts[[40, 41, 50]] = one, other, 900.0
        image.measured = np.arange(81) != 50
    found = {each.quantity.split(" [")[0]: each for each in compare_loads(LINE, images, COVER, POSITION)}
    values = {name: each.factor * each.reference for name, each in found.items()}
    # texels 40 and 41 lie in the middle and a pitch of 3 mm beside it
    expected = {
        "sum of counts": 80.0,
        "largest texel": 50.0,
        "centre of counts x": 30 / 80 * 3,
        "centre of counts y": 0,
    }
    assert values == pytest.approx(expected)
    assert found["largest texel"].fast == pytest.approx(SLOPE * LOAD / 9)


def test_a_repeat_with_unknown_creep_leaves_the_creep_of_the_others():
    one, two = (
        compare_loads(LINE, [make_image(0.97), make_image(0.97, creep=creep)], COVER, POSITION)[0].u_data
        for creep in (CREEP, math.nan)
    )
    assert two == pytest.approx(one)
