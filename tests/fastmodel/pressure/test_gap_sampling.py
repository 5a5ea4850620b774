from dataclasses import replace

import numpy as np
import pytest

from fastmodel.pressure.gap import BodyShape, Solid, sample_gap
from meshes import Box, Cylinder, LetterH, Nut, Sphere
from tests.support.posed_bodies import GRID, pose_body

AREAS = {
    "box": (Box(size=(12e-3, 6e-3, 5e-3)), 72e-6),
    "circle": (Cylinder(radius=5e-3), np.pi * 25e-6),
    "nut": (Nut(across=13e-3, bore=8e-3), (np.sqrt(3) / 2 * 169 - np.pi * 16) * 1e-6),
    "h": (LetterH(size=(12e-3, 16e-3), bar=4e-3), 144e-6),
    "blade": (Box(size=(0.3e-3, 15e-3, 5e-3)), 4.5e-6),
}
FIELDS = ("row", "column", "coverage", "x", "y", "gap")


@pytest.mark.parametrize("name", AREAS)
def test_covered_area_is_that_of_the_face(name):
    """Parts that share an edge over one cell count once; a thin blade is not missed."""
    indenter, area = AREAS[name]
    for yaw in (0.0, 0.3, np.pi / 4):
        found = sample_gap(GRID, [pose_body(indenter, yaw=yaw)], [1e-3])
        tolerance = 0.45 if name == "blade" else 0.03  # a blade is 1.4 points wide
        assert found.coverage.sum() * GRID.edge[0] * GRID.edge[1] == pytest.approx(area, rel=tolerance)
        assert len(set(zip(found.row.tolist(), found.column.tolist(), strict=True))) == found.count


def test_centroid_of_covered_parts_is_that_of_the_face():
    found = sample_gap(GRID, [pose_body(Box(size=(7e-3, 5e-3, 5e-3)), yaw=0.5)], [1e-3])
    assert np.average(found.x, weights=found.coverage) == pytest.approx(0.7e-3, abs=2e-5)
    assert np.average(found.y, weights=found.coverage) == pytest.approx(-1.1e-3, abs=2e-5)


def test_gap_under_a_sphere_is_its_height_averaged_over_each_cell():
    radius, at = 5e-3, (0.3e-3, -0.4e-3)
    found = sample_gap(GRID, [pose_body(Sphere(radius=radius), at=at)], [1e-3])
    whole = (found.coverage == 1) & (found.gap < found.gap.min() + 1e-3)
    square = (found.x - at[0]) ** 2 + (found.y - at[1]) ** 2
    mean = radius - np.sqrt(radius**2 - square - GRID.edge[0] ** 2 / 6)  # mean square distance within a cell
    np.testing.assert_allclose(found.gap[whole], mean[whole], atol=3e-6)


def test_bodies_beside_the_cells_have_no_samples():
    bodies = [pose_body(Sphere(radius=2e-3), at=(0.1, 0.0)), pose_body(Sphere(radius=2e-3))]
    found = sample_gap(GRID, bodies, [1e-3, 1e-3])
    assert found.bodies_found == [1]
    assert sample_gap(GRID, bodies[:1], [1e-3]).bodies_found == []


@pytest.mark.parametrize("tilt", [0.0, 0.1])
def test_a_smaller_reach_keeps_the_cells_with_the_smallest_gaps_and_their_neighbours(tilt):
    """Cells far above the contact are not sampled; those that are kept are as if all had been."""
    turned = np.array([[np.cos(tilt), 0, -np.sin(tilt)], [0, 1, 0], [np.sin(tilt), 0, np.cos(tilt)]])
    wide = Box(size=(100e-3, 100e-3, 5e-3))  # than the cells; where it is turned, gaps rise from cell to cell
    for indenter in (Sphere(radius=8e-3), Box(size=(12e-3, 6e-3, 5e-3)), wide):
        body = pose_body(indenter)
        body = replace(body, rotation=turned @ body.rotation, position=body.position @ turned.T)
        every, reach = sample_gap(GRID, [body], [np.inf]), 2e-4
        low = every.gap <= every.gap.min() + reach
        beside = np.abs(np.subtract.outer(every.row, every.row[low])) <= 1
        kept = (beside & (np.abs(np.subtract.outer(every.column, every.column[low])) <= 1)).any(axis=1)
        assert 5 < kept.sum() < every.count or not tilt
        for field in FIELDS:
            np.testing.assert_array_equal(
                getattr(sample_gap(GRID, [body], [reach]), field), getattr(every, field)[kept]
            )


def list_solids(shape):
    planes = np.split(shape.planes, shape.starts[1:-1])
    return zip(shape.kinds, shape.sizes, planes, shape.centres, shape.halves, strict=True)


def test_parts_far_above_the_contact_do_not_lift_the_cells_at_its_edge():
    foot, roof = pose_body(Box(size=(7e-3, 5e-3, 5e-3)), yaw=0.5), pose_body(Box(size=(16e-3, 16e-3, 5e-3)))
    both = replace(
        foot,
        shape=BodyShape.of([Solid(*solid) for body in (foot, roof) for solid in list_solids(body.shape)]),
        rotation=np.concatenate([foot.rotation, roof.rotation]),
        position=np.concatenate([foot.position, roof.position + np.array([0, 0, 20e-3])]),
    )
    expected, found = (sample_gap(GRID, [body], [1e-3]) for body in (foot, both))
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(found, field), getattr(expected, field))
