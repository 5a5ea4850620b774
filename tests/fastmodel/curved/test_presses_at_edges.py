"""Presses on curved covers: directions, bodies beside the cover, thicknesses that vary, and widths of contacts."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fastmodel.contact.points import ChartCells, find_first_contact, pose_indenter, press_points, solve_pressure
from fastmodel.errors import FastModelError, MissedArrayError
from fastmodel.pressure.solvers import Load
from meshes import Box, Nut, Sphere
from meshes.pose import Pose
from tests.support.cover_data import make_dome, make_half_space

DOWN = [0, 0, -1]


def make_bed(half=8e-3, count=17, thickness=2e-3, **changes):
    """A flat half space with points 1 mm apart."""
    x, y = (each.ravel() for each in np.meshgrid(*[np.linspace(-half, half, count)] * 2))
    up = np.tile([0.0, 0, 1], (len(x), 1))
    bed = make_half_space(np.stack([x, y, 0 * x], axis=1), up, thickness=thickness)
    return dataclasses.replace(bed, **changes)


BED = make_bed()


def press_down(force):
    up = np.array([0.0, 0, 1])
    return Load.along_free_directions(force * up, np.zeros(3), up[None], rotates=False)


@pytest.mark.parametrize("load", [0.0, -0.3, np.inf, np.nan])
def test_a_load_that_is_not_positive_is_refused_with_its_value(load):
    with pytest.raises(FastModelError, match=f"^load must be positive, not {load} N$"):
        press_points(BED, Sphere(radius=3e-3), Pose.facing([0, 0, 5e-3], DOWN), load=load)


@pytest.mark.parametrize("direction", [None, (0, 0, -7.0), (0.0, 0.9, -1.2)])
def test_the_direction_is_that_of_the_pose_unless_another_of_any_length_is_given(direction):
    """A guide bears what acts across; the ball meets the bed where its path leads."""
    pose = Pose.facing([0.3e-3, -0.2e-3, 4e-3], DOWN)
    found = press_points(BED, Sphere(radius=3e-3), pose, load=0.4, direction=direction)
    along = np.array(direction or DOWN) / np.linalg.norm(direction or DOWN)
    assert found.force @ along == pytest.approx(0.4, rel=1e-6)
    np.testing.assert_allclose(found.force, [0, 0, -0.4 / -along[2]], atol=1e-9)  # forces are normal to the bed
    middle = pose.position - np.array(DOWN) * 3e-3
    middle = middle + ((3e-3 - middle[2]) / along[2] + found.depth) * along  # of the ball, under load
    np.testing.assert_allclose(found.pressure.footprint.middle, [*middle[:2], 0], atol=8e-5)


@pytest.mark.parametrize("beside", [(9.9e-3, 0.2e-3), (-9.9e-3, 0.3e-3), (0.1e-3, 9.9e-3), (8.9e-3, 9.7e-3)])
def test_a_pin_beside_the_cover_reaches_its_edge_up_to_two_spacings(beside):
    pin, at = Sphere(radius=5e-5), np.array(beside)
    (found,) = find_first_contact(BED, pin, Pose.facing([*at, 5e-3], DOWN), DOWN, within=1e-4)
    apart = np.linalg.norm(BED.points[:, :2] - at, axis=1)
    assert apart[found] == apart.min()
    far = np.sign(at) * np.where(np.abs(at) > 8e-3, np.abs(at) + 0.3e-3, np.abs(at))
    with pytest.raises(MissedArrayError, match="never touches the cover; check its position and direction"):
        find_first_contact(BED, pin, Pose.facing([*far, 5e-3], DOWN), DOWN, within=1e-4)


def test_a_body_that_comes_from_behind_never_touches():
    pose = Pose.facing([0, 0, 5e-3], DOWN)
    for direction in ([0, 0, 1.0], [1.0, 0, 0]):
        with pytest.raises(MissedArrayError):
            find_first_contact(BED, Sphere(radius=3e-3), pose, direction, within=1e-4)


@pytest.mark.parametrize("height", [-3e-3, 2e-3, 80e-3])
def test_the_start_on_the_path_does_not_matter(height):
    """Below the top, just above it, or far above."""
    found = press_points(BED, Sphere(radius=4e-3), Pose.facing([0.6e-3, 0.2e-3, height], DOWN), load=0.3)
    known = press_points(BED, Sphere(radius=4e-3), Pose.facing([0.6e-3, 0.2e-3, 9e-3], DOWN), load=0.3)
    assert found.depth == pytest.approx(known.depth, rel=1e-3)
    np.testing.assert_allclose(found.pressure.footprint.middle, known.pressure.footprint.middle, atol=1e-6)


@pytest.mark.parametrize("share", [0.6, 1.7])
def test_a_half_space_is_the_same_at_any_thickness(share):
    """Its top yields by the size of the contact alone; the cells are those of another thickness."""
    thick = dataclasses.replace(BED, heights=share * BED.heights)
    pose = Pose.facing([0.4e-3, 0.3e-3, 9e-3], DOWN)
    for shape in (Sphere(radius=4e-3), Box(size=(2e-3, 3e-3, 4e-3))):
        one, other = (press_points(cover, shape, pose, load=0.5) for cover in (BED, thick))
        assert other.depth == pytest.approx(one.depth, rel=0.02)
        spread = [
            np.average(((each.pressure.place - [0.4e-3, 0.3e-3, 0]) ** 2)[:, :2], axis=0, weights=each.pressure.forces)
            for each in (one, other)
        ]
        np.testing.assert_allclose(*spread, rtol=0.04)


@pytest.mark.parametrize("size", [(4e-3, 1.5e-3), (1.5e-3, 4e-3), (3e-3, 0.4e-3)])
@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_a_footprint_is_as_wide_as_the_face_along_its_edges(size, yaw):
    """To a cell, of which about fourteen lie across; the face itself is covered, and nothing beside it."""
    found = press_points(BED, Box(size=(*size, 4e-3)), Pose(point=(0.2e-3, 0.1e-3, 9e-3), yaw=yaw), load=0.2).pressure
    half = np.array(size) / 2
    np.testing.assert_allclose(found.footprint.half, half, rtol=0.12)
    turn = Rotation.from_rotvec([0, 0, yaw]).as_matrix()
    local = np.abs((found.place - [0.2e-3, 0.1e-3, 0]) @ turn)[found.forces > 0]
    assert (local[:, :2].max(axis=0) < 1.02 * half).all()
    assert (local[:, :2].max(axis=0) > 0.9 * half).all()
    assert 100 < (found.forces > 0).sum() < 25**2
    np.testing.assert_allclose(found.footprint.middle, [0.2e-3, 0.1e-3, 0], atol=0.1 * half.min())


def test_a_flat_punch_sinks_as_boussinesq_says():
    """A ring of six prisms is flat too; a square of edge a sinks by 0.88 F / (E' a), within the width of a cell."""
    found = press_points(BED, Box(size=(3e-3, 3e-3, 4e-3)), Pose.facing([0.1e-3, 0.2e-3, 9e-3], DOWN), load=0.6)
    assert found.depth == pytest.approx(0.877 * 0.6 / (1e6 * 3e-3), rel=0.04)
    nut = press_points(BED, Nut(across=6e-3, bore=3e-3), Pose.facing([0, 0, 9e-3], DOWN), load=0.6).pressure
    away = np.hypot(nut.place[:, 0], nut.place[:, 1])[nut.forces > 0]
    assert away.min() > 1.35e-3
    assert away.max() < 3.6e-3
    np.testing.assert_allclose(nut.forces @ nut.place[:, :2], 0, atol=0.6 * 5e-5)


@pytest.mark.parametrize(
    ("half", "thickness", "numbers", "edges"),
    [
        ((2e-3, 0.7e-3), 2e-3, (-6, -9), (1 / 8, 1 / 16 / np.sqrt(2))),  # below 1/7 and 1/20
        ((0.3e-3, 5e-3), 1.3e-3, (-10, -2), (1 / 32, 1 / 2)),  # below 3/91 and 50/91
        ((3.5e-3, 5e-3), 2e-3, (-4, -3), (1 / 4, 1 / 2 / np.sqrt(2))),  # at 1/4, below 5/14
    ],
)
def test_cells_of_a_chart_are_the_next_smaller_of_a_series_of_sizes(half, thickness, numbers, edges):
    """A cell is at most a fourteenth of the contact; the sizes, over the thickness, are 1, 1 / sqrt(2), 1 / 2 ..."""
    cells = ChartCells.around(np.zeros(3), np.eye(3), np.zeros(2), np.array(half), thickness)
    assert cells.numbers == numbers
    np.testing.assert_allclose(cells.edge, thickness * np.array(edges), rtol=1e-12)


def test_bodies_that_do_not_meet_change_nothing_of_each_other():
    """A far one moves the other by its force over the distance, in the order in which they are given or not."""
    wide = make_bed(half=16e-3, count=33)
    places, forces = ([-9e-3, 0.2e-3], [9e-3, -0.3e-3]), (0.2, 0.5)
    bodies = [pose_indenter(Sphere(radius=4e-3), Pose.facing([*each, 0], DOWN)) for each in places]
    loads = [press_down(each) for each in forces]
    both = solve_pressure(wide, bodies, loads)
    turned = solve_pressure(wide, bodies[::-1], loads[::-1])[::-1]
    apart = np.linalg.norm(np.subtract(*places))
    for k, (one, other) in enumerate(zip(both, turned, strict=True)):
        assert one.footprint.travel == pytest.approx(other.footprint.travel, rel=2e-3)
        (alone,) = solve_pressure(wide, [bodies[k]], [loads[k]])
        moved = wide.top_compliance * forces[1 - k] / apart
        assert one.footprint.travel - alone.footprint.travel == pytest.approx(moved, rel=0.05)
        np.testing.assert_allclose(one.forces.sum(), forces[k], rtol=1e-6)
    again = solve_pressure(wide, bodies, loads, [each.footprint for each in both])
    for one, other in zip(both, again, strict=True):
        assert one.footprint.travel == pytest.approx(other.footprint.travel, rel=2e-3)
    assert solve_pressure(make_dome(), [], []) == []
