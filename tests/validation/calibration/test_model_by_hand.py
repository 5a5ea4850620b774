"""Which contacts are solved for a fit, how shares lie between them, and images by hand."""

from dataclasses import replace

import numpy as np
import pytest

import fastmodel
from meshes import Box, Sphere, TexelArray, tilt_indenter
from validation.calibration.model import (
    ContactMethod,
    CountCurve,
    Observations,
    Placement,
    Pose,
    join_observations,
    make_fast_method,
    make_reference_method,
    seat_unevenly,
)
from validation.sensor_file import load
from validation.text.indenter import read_indenter

ARRAY = TexelArray.grid(1, 2, (4e-3, 6e-3))
FACE, BALL = Box(size=(3e-3, 3e-3, 2e-3)), Sphere(radius=4e-3)
DISC = read_indenter("cylinder:radius=3mm", place="")


class Lattice:
    """A contact method whose shares are of second order in the place and the yaw, and what it was asked."""

    def __init__(self):
        self.asked = []
        self.method = ContactMethod(name="made up", about="", array=ARRAY, solve=self.solve)

    @staticmethod
    def share(pose):
        x, y = 1e3 * pose.x, 1e3 * pose.y
        first = 0.4 + 0.03 * x - 0.02 * y + 0.01 * x * y + 0.004 * x**2 - 0.006 * y**2 + 0.5 * pose.yaw
        return np.array([first + 2 * pose.yaw**2 - 0.1 * pose.yaw * x, 1 - 0.3 * first])

    def solve(self, _indenter, newtons, pose):
        self.asked.append((newtons, pose))
        return newtons * self.share(pose)


@pytest.mark.parametrize(
    ("pose", "corner", "solved"),
    [
        (Pose(1.3e-3, -0.9e-3, 0.13), (3, -2, 2), 64),
        (Pose(-0.25e-3, 2.5e-3, -0.01), (-1, 4, -1), 64),
        (Pose(1.3e-3, -0.9e-3, 0.0), (3, -2, 0), 16),
    ],
)
def test_shares_are_interpolated_between_a_lattice_of_poses(pose, corner, solved):
    """Steps of 0.4 mm, 0.6 mm and 0.05 rad; a cubic convolution is exact for polynomials of second order."""
    made, loads = Lattice(), np.array([2.0, 0.0, 5.0])
    found = made.method.texel_forces(FACE, loads, pose, smooth=True)
    np.testing.assert_allclose(found, np.outer(loads, made.share(pose)), rtol=1e-9, atol=1e-12)
    assert len(made.asked) == solved
    assert {newtons for newtons, _ in made.asked} == {1.0}
    places = np.array([(each.x, each.y, each.yaw) for _, each in made.asked]) / [0.4e-3, 0.6e-3, 0.05]
    np.testing.assert_allclose(places, np.round(places), atol=1e-9)
    steps = [np.unique(np.round(column)).astype(int).tolist() for column in places.T]
    axes = [[node + k for k in (-1, 0, 1, 2)] for node in corner]
    assert steps == [*axes[:2], axes[2] if solved == 64 else [0]]
    near = Pose(pose.x + 1e-5, pose.y + 1e-5, pose.yaw)
    np.testing.assert_allclose(made.method.texel_forces(FACE, loads[:1], near, smooth=True)[0], 2 * made.share(near))
    assert len(made.asked) == solved  # the same square of the lattice
    made.method.texel_forces(FACE, loads, pose)
    assert made.asked[-1] == (1.0, pose)
    assert len(made.asked) == solved + 1


def test_a_round_face_has_no_yaw_and_another_face_its_own_lattice():
    made = Lattice()
    pose = Pose(0.1e-3, 0.2e-3, 0.13)
    found = made.method.texel_forces(DISC, np.ones(1), pose, smooth=True)
    assert len(made.asked) == 16
    level = made.share(replace(pose, yaw=made.asked[0][1].yaw))
    np.testing.assert_allclose(found[0], level)
    made.method.texel_forces(FACE, np.ones(1), pose, smooth=True)
    assert len(made.asked) == 80
    made.method.texel_forces(FACE, np.ones(1), Pose(0.5e-3, 0.2e-3, 0.13), smooth=True)
    assert len(made.asked) == 80 + 16  # a column of new nodes; the others are known


def test_no_load_needs_no_contact():
    made = Lattice()
    assert made.method.texel_forces(BALL, np.zeros(3), Pose(0.0, 0.0)).tolist() == [[0.0, 0.0]] * 3
    assert made.asked == []


def test_a_changed_method_forgets_what_was_solved():
    made = Lattice()
    made.method.texel_forces(BALL, np.ones(1), Pose(0.0, 0.0))
    other = replace(made.method, solve=lambda *_: np.array([0.25, 0.75]))
    assert other.texel_forces(BALL, np.ones(1), Pose(0.0, 0.0)).tolist() == [[0.25, 0.75]]
    assert (made.method.gain_error, made.method.rescale) == (0.0, None)
    assert np.isnan(made.method.thickness)


@pytest.mark.parametrize("count", [8, 20])
def test_loads_between_seven_solved_ones_have_shares_in_the_logarithm(count):
    """The share is a broken line in ln(load) between nodes in even ratios."""

    def solve(_indenter, newtons, _pose):
        return newtons * np.array([np.sin(newtons), np.cos(newtons)])

    method = ContactMethod(name="wave", about="", array=ARRAY, solve=solve)
    loads = np.linspace(0.3, 9.0, count)[::-1]
    found = method.texel_forces(BALL, loads, Pose(0.0, 0.0))
    nodes = 0.3 * 30 ** (np.arange(7) / 6)
    shares = [np.interp(np.log(loads), np.log(nodes), wave(nodes)) for wave in (np.sin, np.cos)]
    np.testing.assert_allclose(found, loads[:, None] * np.column_stack(shares))


def test_texels_are_lit_above_their_floor_where_they_are_measured():
    counts = np.array([[0.0, 1.0, 5.0], [-2.0, 8.0, 9.0]])
    measured = np.array([[True, True, True], [True, True, False]])
    places = [Placement(name=name, indenter=BALL) for name in "ab"]
    seen = Observations(
        loads=np.array([1.0, 2.0]), counts=counts, measured=measured, placements=tuple(places), groups=("x", "y"),
        temperatures=np.zeros(2), ages=np.zeros(2), thresholds=np.zeros(2),
    )  # fmt: skip
    assert seen.lit.tolist() == [[False, True, True], [False, True, False]]
    floored = replace(seen, floors=np.array([[0.0, 1.0, 4.0], [-3.0, 7.0, 0.0]]))
    assert floored.lit.tolist() == [[False, False, True], [True, True, False]]
    assert seen.largest_count == 8.0
    both = join_observations([seen, seen])
    assert both.distinct_placements == tuple(places)
    assert both.rows_of(places[1]).tolist() == [False, True, False, True]


def test_a_placement_is_level_unless_it_says_otherwise():
    place = Placement(name="a", indenter=BALL, at=(1e-3, 2e-3), yaw=0.3)
    assert place.pose == Pose(1e-3, 2e-3, 0.3, 0.0, 0.0)
    assert Placement(name="a", indenter=BALL).pose is None
    assert Pose(1.0, 2.0).vector.tolist() == [1.0, 2.0, 0.0, 0.0, 0.0]
    assert Pose(1.0, 2.0, 3.0, 4.0, 5.0).vector.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_the_fast_model_is_asked_with_the_tilted_indenter():
    parameters = fastmodel.load("wts-0614-34")
    pose = Pose(1e-3, -2e-3, 0.2, 0.02, -0.03)
    found = make_fast_method(parameters, "foundation").solve(FACE, 3.0, pose)
    tilted = tilt_indenter(FACE, (0.02, -0.03))
    alone = fastmodel.indent(parameters, tilted, load=3.0, at=(1e-3, -2e-3), yaw=0.2, contact="foundation")
    np.testing.assert_allclose(found, alone.texel_forces, atol=1e-6)
    assert found.sum() > 0.5


def test_finite_elements_are_named_and_have_no_known_error():
    sensor = load("wts-0614-34")
    method = make_reference_method(sensor.cover, sensor.array)
    assert (method.name, method.gain_error, method.array) == ("reference", 0.0, sensor.array)
    assert method.thickness == sensor.cover.thickness


CURVE = CountCurve(
    sensitivity=300.0, dead_force=0.2, gain_temperature=-0.01, dead_temperature=0.03, reference_temperature=15.0,
    creep=0.2, reference_age=4.0, output_max=500.0, saturation_band=200.0, gains=np.array([1.5, 0.5]),
    heights=np.array([0.0, 1.0]),
)  # fmt: skip


def test_an_uneven_warm_aged_and_saturated_image_follows_the_formula():
    """The seat first, then the line, creep, gain and threshold, and last the knee."""
    forces = np.array([[2.0, 1.0], [0.5, 4.0], [0.0, 0.0]])
    warm, ages, cut = np.array([25.0, np.nan, 9.0]), np.array([10.0, 3.0, np.nan]), np.array([30.0, 10.0, 0.0])
    found = CURVE.predict(forces, temperatures=warm, ages=ages, thresholds=cut)
    for row, (degrees, age) in enumerate(zip([25.0, 15.0, 9.0], [10.0, 3.0, 4.0], strict=True)):
        f = seat_unevenly(forces[[row]], CURVE.heights)[0]
        crept = (1 + 0.2 * np.log(age / 2)) / (1 + 0.2 * np.log(2))
        offset = cut[row] - 300 * (0.2 + 0.03 * (degrees - 15))
        signal = CURVE.gains * (1 - 0.01 * (degrees - 15)) * crept * (300 * f + offset) - cut[row]
        signal = np.maximum(signal, 0)
        bent = np.where(signal > 300, 500 - 200 * np.exp(-(signal - 300) / 200), signal)
        assert found[row] == pytest.approx(bent)
    assert found.max() > 300


@pytest.mark.parametrize(
    ("forces", "heights", "expected"),
    [
        # three springs of shares 0.5, 0.3 and 0.2 of 10 N: 0.5 p + 0.3 (p - 4) = 10 where p < 20
        ((5.0, 3.0, 2.0), (0.0, 4.0, 20.0), (7.0, 3.0, 0.0)),
        ((5.0, 3.0, 2.0), (1.0, 4.0, 2.0), (5.55, 2.43, 2.02)),  # p = 12.1 reaches all three
        ((5.0, 3.0, 0.0), (30.0, 0.0, -5.0), (0.0, 8.0, 0.0)),  # a texel without a share carries nothing
    ],
)
def test_springs_carry_by_how_far_they_are_reached(forces, heights, expected):
    found = seat_unevenly(np.array([forces]), np.array(heights))[0]
    assert found.sum() == pytest.approx(sum(forces))
    assert found == pytest.approx(expected)
