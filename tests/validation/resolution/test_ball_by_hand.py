"""A ball on one layer by the rows of its table: units, powers of small loads, borders, and stated errors."""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from meshes import Layer, Material
from validation.resolution import ball

RATIOS, RADII, DEPTHS = ball.RATIOS, ball.RADII, ball.DEPTHS
#: Rows of the table: Poisson ratio, radius, depth, linear load, contact radius, ratio of loads.
TABLE = np.array([
    [float(each) for each in line.split(",")] for line in ball.PATH.read_text().splitlines() if not line.startswith("#")
]).reshape(len(RATIOS), len(RADII), len(DEPTHS), 6)  # fmt: skip
THICKNESS, SHEAR = 3e-3, 2e5
UNIT = SHEAR * THICKNESS**2


def make_layer(ratio, thickness=THICKNESS, shear=SHEAR):
    material = Material(name="x", model="neo-hookean", parameters={"shear_modulus": shear}, poisson_ratio=ratio)
    return Layer(thickness=thickness, material=material)


def press(i, j, load, **options):
    return ball.press_ball(make_layer(RATIOS[i], **options), RADII[j] * options.get("thickness", THICKNESS), load)


def test_the_table_has_a_row_for_each_ratio_radius_and_depth():
    for axis, nodes in enumerate((RATIOS, RADII, DEPTHS)):
        shape = [1, 1, 1]
        shape[axis] = len(nodes)
        assert (TABLE[..., axis] == np.reshape(nodes, shape)).all()


@pytest.mark.parametrize(("i", "j", "k"), [(0, 0, 0), (1, 3, 4), (3, 6, 7), (5, 8, 8), (2, 2, 3)])
def test_a_row_of_the_table_is_given_back(i, j, k):
    """The contact radius belongs to the load of the linear solution, the depth to that at finite strain."""
    _, _, depth, linear, contact, ratio = TABLE[i, j, k]
    most = TABLE[i, j, -1, 3] * TABLE[i, j, -1, 5]
    assert press(i, j, UNIT * linear).contact == pytest.approx(THICKNESS * contact, rel=1e-6)
    found = press(i, j, UNIT * linear * ratio)
    assert found.depth == pytest.approx(THICKNESS * depth, rel=1e-6)
    assert found.most == pytest.approx(UNIT * most, rel=1e-6)
    double = press(i, j, 12 * UNIT * linear * ratio, thickness=2 * THICKNESS, shear=3 * SHEAR)
    assert double == pytest.approx((2 * found.contact, 2 * found.depth, 12 * found.most))


def test_below_the_least_depth_radius_and_depth_follow_the_powers_of_hertz():
    least = UNIT * TABLE[4, 2, 0, 3] * TABLE[4, 2, 0, 5]
    for factor in (8.0, 1000.0):
        found = press(4, 2, least / factor)
        assert found.depth == pytest.approx(THICKNESS * DEPTHS[0] * factor ** (-2 / 3), rel=1e-6)
        # the contact radius is that of the linear solution
        within = UNIT * TABLE[4, 2, 0, 3] / factor
        assert press(4, 2, within).contact == pytest.approx(THICKNESS * TABLE[4, 2, 0, 4] * factor ** (-1 / 3))


@pytest.mark.parametrize(("factor", "known"), [(1 - 1e-9, True), (1 + 1e-9, False)])
def test_beyond_thirty_percent_of_the_thickness_only_the_largest_load_is_known(factor, known):
    most = press(1, 4, 1e-3).most
    found = press(1, 4, factor * most)
    assert found.most == most
    assert [math.isfinite(each) for each in found] == [known, known, True]
    if known:
        assert found.depth == pytest.approx(0.3 * THICKNESS, rel=1e-6)


@pytest.mark.parametrize(
    ("ratio", "radius", "known"),
    [
        (0.4, 0.5, True), (0.5, 8.0, True), (0.4, 8.0, True), (0.5, 0.5, True), (0.3999, 2.0, False),
        (0.45, 0.4999, False), (0.45, 8.001, False), (0.39, 9.0, False),
    ],
)  # fmt: skip
def test_outside_the_table_nothing_is_told(ratio, radius, known):
    assert (ball.press_ball(make_layer(ratio, 2.0**-8), radius * 2.0**-8, 0.1) is not None) == known


def test_between_rows_the_logarithms_are_cubic_in_the_logarithm_of_the_radius():
    """The Poisson ratio is a node; load by depth, and depth by the load, at a radius between nodes."""
    rows = np.log(TABLE[3, :, :, 3:])
    linear, contact, ratio = np.moveaxis(CubicSpline(np.log(RADII), rows)(math.log(1.17)), -1, 0)
    load = UNIT * math.exp(linear[5] + ratio[5])
    found = ball.press_ball(make_layer(RATIOS[3]), 1.17 * THICKNESS, load)
    assert found.depth == pytest.approx(THICKNESS * DEPTHS[5], rel=1e-6)
    assert found.most == pytest.approx(UNIT * math.exp(linear[-1] + ratio[-1]), rel=1e-6)
    expected = math.exp(CubicSpline(linear, contact)(math.log(load / UNIT)))
    assert found.contact == pytest.approx(THICKNESS * expected, rel=1e-6)


def test_stated_errors_are_those_of_rows_that_are_left_out():
    """Each inner ratio or radius is interpolated from the others, over -log(0.505 - ratio) or the log of the radius."""
    worst = np.zeros(3)
    for axis, nodes in ((0, -np.log(0.505 - np.array(RATIOS))), (1, np.log(RADII))):
        for out in range(1, len(nodes) - 1):
            kept = [k for k in range(len(nodes)) if k != out]
            guess = np.exp(CubicSpline(nodes[kept], np.log(TABLE.take(kept, axis)[..., 3:]), axis=axis)(nodes[out]))
            off = np.abs(guess / TABLE.take(out, axis)[..., 3:] - 1)
            worst = np.maximum(worst, off.max(axis=(0, 1)))
    assert ball.estimate_errors() == pytest.approx(worst, rel=1e-6)
