"""Comparison errors on recordings of uneven counts: every part of each quantity by hand, with made-up effects."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from meshes import Sphere, TexelArray
from tests.support.rubber import make_cover
from tests.support.straight_line import StraightLine
from validation.calibration.model import ContactMethod, Placement, Pose
from validation.campaign.campaign_file import Inputs
from validation.credibility.recorded import compare_loads

ARRAY = TexelArray.grid(2, 3, (2e-3, 3e-3), name="small")
X, Y = ARRAY.centres[:, 0], ARRAY.centres[:, 1]
COVER = make_cover(0.45, "linear-elastic", size=(30e-3, 20e-3))
PLACEMENT = Placement(name="here", indenter=Sphere(radius=4e-3), at=(1e-3, -0.5e-3), yaw=0.3)
SLOPE, THRESHOLD, ROUNDING = 100.0, 30.0, 1 / math.sqrt(12)
SHARES = np.array([0.1, 0.2, 0.05, 0.3, 0.25, 0.1])
EFFECTS = {
    "position x [m]": np.array([0.02, -0.01, 0.0, 0.03, 0.01, 0.0]),
    "position y [m]": np.array([0.0, 0.04, -0.02, 0.01, 0.0, 0.05]),
}
INPUTS = Inputs(modulus=0.0, poisson_ratio=0.0, thickness=0.0, position=1e-4, yaw=0.0, friction=0.4)


LINE = StraightLine(
    ContactMethod(name="uneven", about="", array=ARRAY, solve=lambda _body, load, _pose: load * SHARES), SLOPE
)


@pytest.fixture
def asked(monkeypatch):
    """Effects of the inputs are made up, in proportion to the load; returns the cases and inputs asked for."""
    asked = []

    def propagate(cover, array, case, inputs):
        asked.append((cover.size, array, case.load, case.pose, inputs.friction))
        return SimpleNamespace(effects={name: case.load * each for name, each in EFFECTS.items()})

    monkeypatch.setattr("validation.credibility.recorded.propagate_inputs", propagate)
    return asked


def make_image(counts, *, load=4.0, creep=0.08, noise=2.0, window=(5.0, 8.0), measured=(True,) * 6, place=PLACEMENT):
    return SimpleNamespace(
        load=load, counts=np.array(counts), measured=np.array(measured), temperature=30.0, age=7.5, creep=creep,
        threshold=THRESHOLD, floor=np.zeros(6), noise=noise, case=f"{place.name} {load:g} N",
        file=SimpleNamespace(placement=place, name="a.csv", window=window),
    )  # fmt: skip


FIRST, SECOND = (
    np.array([30.0, 90.0, 0.0, 130.0, 80.0, 44.0]),
    np.array([34.0, 80.0, 0.0, 118.0, 96.0, 40.0]),
)


def quantities(measured, peak):
    """Sum, largest texel and centre of counts of the texels that are measured."""
    kept = np.array(measured, dtype=float)
    return (
        lambda c: (c * kept).sum(), lambda c: c[peak], lambda c: (c * kept) @ X / (c * kept).sum(),
        lambda c: (c * kept) @ Y / (c * kept).sum(),
    )  # fmt: skip


def add(quantity, base, effects):
    return math.sqrt(sum((quantity(base + each) - quantity(base)) ** 2 for each in effects))


@pytest.mark.parametrize("measured", [(True,) * 6, (True, True, True, False, True, True)])
def test_each_part_of_each_quantity_of_two_repeats(asked, measured):
    images = [make_image(FIRST, measured=measured), make_image(SECOND, noise=3.0, creep=0.12, measured=measured)]
    found = compare_loads(LINE, images, COVER, INPUTS)
    mean, predicted = (FIRST + SECOND) / 2, SLOPE * 4.0 * SHARES
    peak = 3 if measured[3] else 4
    if measured[3]:
        assert mean[3] > mean[4]
    lit = np.array([1, 1, 0, 1, 1, 1])
    creep = 0.10 * math.log(8 / 5) * ROUNDING * (mean + THRESHOLD) * lit
    noise = np.diag(lit * math.hypot(3.0, ROUNDING))
    iteration = np.where(np.arange(6) == 3, 2e-4 * predicted.sum(), 0.0)
    names = ("sum of counts", "largest texel [counts]", "centre of counts x [mm]", "centre of counts y [mm]")
    for error, name, factor, quantity in zip(
        found, names, (1.0, 1.0, 1e3, 1e3), quantities(measured, peak), strict=True
    ):
        assert (error.case, error.quantity, error.factor) == ("here 4 N", name, factor)
        assert (error.fast, error.reference) == pytest.approx((quantity(predicted), quantity(mean)))
        repeats = np.var([quantity(FIRST), quantity(SECOND)], ddof=1) / 2
        drifts = add(quantity, mean, [creep, *noise])
        assert error.u_data == pytest.approx(math.sqrt(repeats + drifts**2), rel=1e-9), name
        assert error.u_num == pytest.approx(add(quantity, predicted, [iteration])), name
        effects = [SLOPE * 4.0 * each for each in EFFECTS.values()]
        assert error.u_input == pytest.approx(add(quantity, predicted, effects)), name
    (size, array, load, pose, friction), *more = asked
    assert (size, array, load, friction) == (None, ARRAY, 4.0, 0.0)
    assert (pose.at, pose.yaw, pose.tilt) == ((1e-3, -0.5e-3), 0.3, (0.0, 0.0))
    assert more == []  # both inputs share one result


@pytest.mark.parametrize(
    ("options", "share"),
    [({"creep": 0.08}, 0.08 * math.log(1.6)), ({"creep": math.nan}, 0.0), ({"creep": 0.08, "window": (0.0, 8.0)}, 0.0),
     ({"creep": 0.0}, 0.0), ({"creep": 0.08, "window": (0.5, 8.0)}, 0.08 * math.log(16))],
)  # fmt: skip
@pytest.mark.usefixtures("asked")
def test_creep_counts_where_it_and_the_window_are_known(options, share):
    total = compare_loads(LINE, [make_image(FIRST, **options)], COVER, INPUTS)[0]
    creep = share * ROUNDING * (FIRST.sum() + 5 * THRESHOLD)
    assert total.u_data == pytest.approx(math.hypot(creep, math.sqrt(5) * math.hypot(2.0, ROUNDING)))


@pytest.mark.usefixtures("asked")
def test_scatter_is_pooled_over_the_loads_by_their_squared_size():
    """Sums of 374 and 368 at 4 N, and of twice 374 and 300 at 8 N; one image at 2 N has the pooled relative scatter."""
    options = {"creep": 0.0, "noise": 0.0}
    images = [
        make_image(FIRST, **options), make_image(SECOND, **options), make_image(2 * FIRST, load=8.0, **options),
        make_image(2 * FIRST * 300 / 374, load=8.0, **options), make_image(FIRST / 2, load=2.0, **options),
    ]  # fmt: skip
    found = {each.case: each for each in compare_loads(LINE, images, COVER, INPUTS) if each.quantity == "sum of counts"}
    relative = (6.0**2 / 2 + 148.0**2 / 2) / (371.0**2 + 674.0**2)
    for case, size, count in (("here 4 N", 371.0, 2), ("here 8 N", 674.0, 2), ("here 2 N", 187.0, 1)):
        rounding = 5 / 12
        assert found[case].u_data == pytest.approx(math.sqrt(relative * size**2 / count + rounding), rel=1e-9), case


def test_an_effect_at_a_fitted_pose_is_computed_there(asked):
    place = Placement(name="fitted", indenter=PLACEMENT.indenter, at=None, yaw=None)
    line = dataclasses.replace(LINE, poses={"fitted": Pose(0.4e-3, -0.7e-3, 0.2, 0.01, -0.02)})
    found = compare_loads(line, [make_image(FIRST, place=place)], COVER, INPUTS)
    pose = asked[0][3]
    assert (pose.at, pose.yaw, pose.tilt) == ((0.4e-3, -0.7e-3), 0.2, (0.01, -0.02))
    total = SLOPE * 4.0 * math.hypot(*(each.sum() for each in EFFECTS.values()))
    assert found[0].u_input == pytest.approx(total)
    bare = compare_loads(line, [make_image(FIRST, place=place)], make_cover(0.45, assumed=True), INPUTS)
    assert math.isnan(bare[0].u_input)
