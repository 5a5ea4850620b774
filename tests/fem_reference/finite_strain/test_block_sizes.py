"""Element sizes of blocks under an indenter against rules that are written out by hand."""

from itertools import pairwise

import numpy as np
import pytest

from fem_reference.finite_strain.block_path import lay_out_block, lay_out_cover
from fem_reference.finite_strain.loading_path import LoadingPath
from meshes import Box, Cylinder, Sphere
from meshes.pose import Pose
from tests.support.rubber import make_cover


def lay_out(shape, half, *, fillet, count, reach=9e-3):
    """Element edges along x and y from the middle outwards [thicknesses of 2.5 mm]."""
    cover = make_cover(0.45, thickness=2.5e-3)
    path = LoadingPath(cover=cover, indenter=shape, targets=(1e-4,), control="depth")
    block = lay_out_block(path, elements_per_thickness=count, contact_half=half, fillet=fillet, reach=reach)
    return block.size, [side[side >= -1e-12] for side in block.sides]


@pytest.mark.parametrize(
    ("shape", "half", "fillet", "count", "sizes"),
    [
        # A rectangular face: 0.6 rounded edges at the edge, 1.2 regular sizes within; at most one thickness counts.
        (Box(size=(6e-3, 8e-3, 4e-3)), (3e-3, 4e-3), 0.5e-3, 4, (0.25, 0.6 * 0.2, 0.3)),
        (Box(size=(2e-3, 8e-3, 4e-3)), (1e-3, 4e-3), 0.25e-3, 3, (0.8 / 3, 0.6 * 0.1, 1.2 * 0.8 / 3)),
        # A curved indenter: half the regular size at the edge, whatever the rounded edge.
        (Sphere(radius=9e-3), (1e-3, 1e-3), 0.5e-3, 2, (0.4, 0.2, 0.48)), (Sphere(radius=9e-3),
        (3e-3, 3e-3), 0, 5, (0.2, 0.1, 0.24)),
        # A round face: 1.3 rounded edges everywhere, no more than the regular size, no less than 1 / (6 n) of the half.
        (Cylinder(radius=2e-3), (2e-3, 2e-3), 0.25e-3, 4, (0.25, 0.13, 0.13)),
        (Cylinder(radius=2e-3), (2e-3, 2e-3), 0.75e-3, 4, (0.25, 0.25, 0.25)),
        (Cylinder(radius=5e-3), (5e-3, 5e-3), 0.1e-3, 3, (1 / 3, 2 / 18, 2 / 18)),
    ],
)  # fmt: skip
def test_elements_at_and_within_the_contact_have_their_sizes(shape, half, fillet, count, sizes):
    size, fine, most = sizes
    found, sides = lay_out(shape, half, fillet=fillet, count=count)
    assert found == pytest.approx(size)
    for side, middle in zip(sides, half, strict=True):
        edge = int(np.argmin(np.abs(side - middle / 2.5e-3)))
        assert side[edge] == pytest.approx(middle / 2.5e-3)
        steps = np.diff(side)
        assert steps[edge] == pytest.approx(fine, rel=1e-9)
        # Steps within are stretched or shrunk together so that they fill the contact.
        assert steps[:edge].max() <= 1.6 * most
        assert steps[:edge].min() == pytest.approx(fine, rel=0.45)
        assert side[-1] >= (middle + 9e-3) / 2.5e-3 - 1e-9


def fill(low, high, spacing):
    """Places of elements whose number is the integral of 1 / spacing, by the midpoint rule."""
    x = np.linspace(low, high, 40_001)
    middle = (x[1:] + x[:-1]) / 2
    counted = np.append(0.0, np.cumsum(np.diff(x) / spacing(middle)))
    count = max(1, round(counted[-1]))
    return np.interp(np.arange(count + 1) * counted[-1] / count, counted, x)


@pytest.mark.parametrize(
    ("shape", "at", "yaw", "count", "fillet"),
    [
        (Box(size=(3e-3, 5e-3, 4e-3)), (1.1e-3, -0.7e-3), 0.0, 4, 0.4e-3), (Sphere(radius=9e-3),
        (0.6e-3, 0.9e-3), 0.0, 3, 0.0),
        (Box(size=(3e-3, 5e-3, 4e-3)), (0.2e-3, 0.3e-3), 0.4, 3, 0.4e-3),
        (Box(size=(3e-3, 5e-3, 4e-3)), (4.7e-3, -2.0e-3), 0.0, 4, 0.4e-3),
        (Box(size=(3e-3, 5e-3, 4e-3)), (-4.5e-3, -2.0e-3), 0.0, 4, 0.4e-3),
    ],
)  # fmt: skip
def test_elements_of_a_cover_with_sides_follow_the_distances_from_contact_and_sides(shape, at, yaw, count, fillet):
    """Twelve millimetres by nine, 2 mm thick: fine + 0.4 d at the contact's edge, 1.5 sizes + 0.4 d at a side."""
    cover = make_cover(0.45, size=(12e-3, 9e-3))
    path = LoadingPath(cover=cover, indenter=shape, targets=(1e-4,), control="depth")
    half = shape.footprint if isinstance(shape, Box) else (1.2e-3, 1.2e-3)
    corners = np.array([[i * half[0], j * half[1]] for i in (-1, 1) for j in (-1, 1)])
    pose = Pose.planar(at=at, yaw=yaw)
    block = lay_out_cover(path, pose, corners, elements_per_thickness=count, fillet=fillet)
    turned = corners @ np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) + at
    ends = np.array([3.0, 2.25])
    low, high = (np.clip(each / 2e-3, -ends, ends) for each in (turned.min(axis=0), turned.max(axis=0)))
    size = min(1.0, (high - low).min()) / count
    fine = 0.6 * fillet / 2e-3 if isinstance(shape, Box) and not yaw else 0.5 * size
    assert block.size == pytest.approx(size)
    assert block.free
    for axis, side in enumerate(block.sides):
        a, b, end = low[axis], high[axis], ends[axis]
        edges = [each for each in (a, b) if abs(each) < end * (1 - 1e-8)]

        def spacing(x, a=a, b=b, end=end, edges=edges):
            at_edge = fine + 0.4 * np.min([np.abs(x - each) for each in edges], axis=0)
            beside = np.maximum(np.maximum(a - x, x - b), 0)
            at_side = 1.5 * size + 0.4 * np.minimum(end - x, end + x)
            return np.minimum(at_edge, np.minimum(1.2 * size + 0.4 * beside, at_side))

        marks = [-end, *edges, end]
        parts = [fill(*part, spacing)[1:] for part in pairwise(marks)]
        expected = np.concatenate([[-end], *parts])
        assert side == pytest.approx(expected, abs=2e-4)
