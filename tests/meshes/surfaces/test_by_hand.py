"""Limits and places of checks of surfaces, and the smooth surface of few triangles, computed by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from meshes.solids.shell import point_normals, select_base
from meshes.surfaces import triangles
from meshes.surfaces.files import read_tetrahedra, read_triangles
from meshes.surfaces.smooth import smooth_surface
from meshes.surfaces.triangles import (
    close_cracks,
    cluster,
    collapse_short_edges,
    describe,
    describe_borders,
    find_crossings,
    label_parts,
    list_border,
    list_edges,
    list_near_pairs,
    merge_corners,
    nearest_points,
    refuse_parts,
    refuse_seams,
)


def make_grid(x, y, z=lambda x, y: 0 * x):
    """Triangles on a grid, facing up."""
    x, y = np.meshgrid(x, y, indexing="ij")
    points = np.stack([x, y, z(x, y)], axis=-1)
    corner = [points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]]
    return np.concatenate(
        [np.stack([corner[i] for i in each], axis=2).reshape(-1, 3, 3) for each in ((0, 1, 2), (0, 2, 3))]
    )


@pytest.mark.parametrize(
    ("points", "distance", "expected"),
    [
        ([[0, 0, 0], [1, 0, 0], [1.9, 0, 0], [3, 0, 0]], 1.0, [0, 0, 0, 1]),  # a chain of gaps up to the distance
        ([[0, 0, 0], [0, 2, 0], [0.5, 2, 0], [0.5, 0, 0]], 1.0, [0, 1, 1, 0]),
        ([[0, 0, 5], [0, 0, 0], [0, 0, 9], [0, 0, 5.5]], 1.0, [1, 0, 2, 1]),
        # one cluster along y and along z until it is divided along x
        ([[0, 0, 0], [9, 0.9, 0], [0, 1.8, 0]], 1.0, [0, 2, 1]),
    ],
)
def test_clusters_have_gaps_of_at_most_a_distance_along_each_axis(points, distance, expected):
    np.testing.assert_array_equal(cluster(np.array(points, dtype=float), distance), expected)


def test_edges_of_two_triangles():
    edges, place, count = list_edges(np.array([[0, 1, 2], [2, 1, 3]]))
    assert edges.tolist() == [[0, 1, 2], [2, 1, 3], [1, 2, 0], [1, 3, 2], [2, 0, 1], [3, 2, 1]]
    assert count.tolist() == [1, 1, 2, 1, 1]
    assert place.tolist() == [0, 2, 2, 3, 1, 4]
    border = list_border(np.array([[0, 1, 2], [2, 1, 3]]), "pair")
    assert border.tolist() == [[0, 1, 2], [1, 3, 2], [2, 0, 1], [3, 2, 1]]


@pytest.mark.parametrize(("gap", "merged"), [(0.9e-6, True), (1.2e-6, False)])
def test_cracks_of_a_ten_thousandth_of_the_size_are_closed(gap, merged):
    """Two squares of 5 mm beside each other: 10 mm, so that 1 um is closed."""
    axis = np.linspace(0, 5e-3, 3)
    both = np.concatenate([make_grid(axis, axis), make_grid(axis + 5e-3 + gap, axis)])
    assert len(merge_corners(both)[0]) == 2 * 9
    closed = close_cracks(both)
    assert len(closed) == 16
    assert len(merge_corners(closed)[0]) == (15 if merged else 18)


def test_a_finely_divided_border_is_not_merged_and_a_crack_takes_its_slivers_along():
    """Corners 0.9 um apart along a border form a chain of 30 um, longer than 4 um."""
    fine = np.concatenate([np.linspace(0, 30 * 0.9e-6, 31), [10e-3]])
    strip = make_grid(fine, np.array([0, 5e-3]))
    points = len(merge_corners(strip)[0])
    assert len(merge_corners(close_cracks(strip))[0]) == points - 2 * 4  # all within 4 um of the first one
    sliver = np.array([[[0, 0, 0], [10e-3, 0, 0], [0, 0.8e-6, 0]], [[0, 0, 0], [0, -5e-3, 0], [10e-3, 0, 0]]])
    assert len(close_cracks(sliver)) == 1


@pytest.mark.parametrize(
    ("gap", "length", "found"),
    [
        (9e-6, 1e-3, True),  # nearer than a thousandth of 10 mm
        (11e-6, 0.1e-3, False),
        (90e-6, 1e-3, True),  # nearer than a tenth of an edge
        (110e-6, 1e-3, False),
    ],
)
def test_borders_beside_each_other_are_a_seam(gap, length, found):
    """Two strips of 2 mm whose long borders lie beside each other."""
    axis, across = np.arange(0, 5e-3 + length / 2, length), np.array([0, 5e-3])
    both = np.concatenate([make_grid(axis, across), make_grid(axis, across + 5e-3 + gap)])
    points, faces = merge_corners(both)
    border = list_border(faces, "pair")
    if not found:
        refuse_seams(points, border, "pair")
        return
    with pytest.raises(ValueError, match=rf"pair has a seam: \d+ edges .* within {1e3 * gap:.2g} mm .* as at \(.*, 5"):
        refuse_seams(points, border, "pair")


@pytest.mark.parametrize(("angle", "found"), [(40.0, True), (50.0, False)])
def test_a_seam_runs_the_other_way_along_the_other_border(angle, found):
    """Two edges that cross above each other at an angle: their directions have a cosine below -0.7 up to 45 degrees."""
    turn = np.radians(180 + angle)
    one = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0, 4, 0]])
    along = np.array([np.cos(turn), np.sin(turn), 0]) / 2
    other = np.array([-along, along, [0, -4.0, 0]]) + 0.05 * np.array([0, 0, 1])
    points, border = np.concatenate([one, other]), np.array([[0, 1, 2], [3, 4, 5]])
    if found:
        with pytest.raises(ValueError, match="2 edges of its border lie within 50 mm"):
            refuse_seams(points, border, "pair")
    else:
        refuse_seams(points, border, "pair")


def test_the_smallest_part_and_the_smallest_border_are_named():
    axis = np.array([0, 1e-3, 2e-3])
    big, small = make_grid(axis, axis), make_grid(axis[:2] + 7e-3, axis)
    points, faces = merge_corners(np.concatenate([big, small]))
    with pytest.raises(ValueError, match=r"both consists of 2 parts .* 33 % of the area near \(7\.5, 1, 0\) mm"):
        refuse_parts(points, faces, "both")
    refuse_parts(*merge_corners(big), "big")
    border = list_border(faces, "both")[:, :2]
    (note,) = describe_borders(points, border, "both")
    assert "both has 2 borders, the smallest 2 mm wide around (" in note
    assert describe_borders(points, border[:0], "none") == ()
    assert describe((1.234e-3, -0.0, -5.6789)) == "1.23, 0, -5678.9"


def test_parts_are_numbered_by_their_first_point():
    chain = np.array([[k, k + 1] for k in range(20, 0, -1)])
    assert label_parts(24, np.concatenate([chain, [[22, 23]]])).tolist() == [0, *[1] * 21, 22, 22]


def test_pairs_of_boxes_overlap_or_touch(monkeypatch):
    low = np.array([[0.0, 0, 0], [1, 0, 0], [1.5, 0, 5], [0.5, 0.5, 0], [9, 9, 9]])
    high = low + 1

    def pairs():
        return {tuple(sorted(pair)) for block in list_near_pairs(low, high) for pair in zip(*block, strict=True)}

    assert pairs() == {(0, 1), (0, 3), (1, 3)}
    monkeypatch.setattr(triangles, "_SURFACE", dataclasses.replace(triangles._SURFACE, pairs=1))
    assert pairs() == {(0, 1), (0, 3), (1, 3)}


@pytest.mark.parametrize(
    ("shift", "crosses"),
    [((0, 0, 0), True), ((0.3, 0.27, 0), True), ((0.3, 0.29, 0), True), ((0.31, 0.3, 0), False), ((-0.21, 0, 0), False),
     ((0, -0.21, 0), True), ((0, -0.23, 0), False), ((0, 0, 1.1), False), ((0, 0, -1.1), False)],
)  # fmt: skip
def test_an_edge_crosses_the_inside_of_a_triangle(shift, crosses):
    """A thin upright triangle meets the plane between (0.2, 0.2) and (0.2, 0.225)."""
    flat, thin = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0.2, 0.2, -1], [0.2, 0.2, 1], [0.2, 0.25, 1]]
    pair = np.array([flat, np.add(thin, shift)])
    assert find_crossings(pair) == ({(0, 1)} if crosses else set())
    assert find_crossings(pair[::-1]) == ({(0, 1)} if crosses else set())


@pytest.mark.parametrize("pairs", [2_000_000, 200])
def test_the_nearest_of_many_triangles_is_the_nearest_of_each(monkeypatch, pairs):
    """In one block, and in blocks of two points."""
    sheet = make_grid(np.linspace(0, 1, 6), np.linspace(0, 1, 6), lambda x, y: 0.3 * x)
    points = np.random.default_rng(3).uniform(-0.2, 1.2, (9, 3))
    each = np.array([nearest_points(points, one[None])[0] for one in sheet])
    monkeypatch.setattr(triangles, "_SURFACE", dataclasses.replace(triangles._SURFACE, pairs=pairs))
    found, owner = nearest_points(points, sheet)
    np.testing.assert_allclose(
        np.linalg.norm(found - points, axis=1), np.linalg.norm(each - points, axis=2).min(axis=0), rtol=1e-9
    )
    np.testing.assert_allclose(found, each[owner, np.arange(9)], atol=1e-12)


@pytest.mark.parametrize(("length", "left"), [(0.9, 16), (1.1, 6)])
def test_edges_below_a_length_are_collapsed_inside_the_border(length, left):
    """Four squares of 1 around a point, whose edges of 1 may collapse to the border."""
    points, faces = merge_corners(make_grid(np.arange(3.0), np.arange(3.0)))
    fewer, kept = collapse_short_edges(points, faces, length)
    assert len(kept) == (8 if left == 16 else left)
    assert len(fewer) == (9 if left == 16 else 8)
    corner = fewer[kept]
    assert np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() == 8


@pytest.mark.parametrize(("off", "on"), [(0.09e-3, True), (0.11e-3, False)])
def test_the_base_is_within_a_hundredth_of_the_size(off, on):
    sheet = make_grid(np.linspace(0, 10e-3, 3), np.linspace(0, 5e-3, 3))
    assert (select_base(sheet, sheet + np.array([0, 0, off])) == on).all()
    assert select_base(sheet, sheet[:2] + np.array([0, 0, off]), distance=0.2e-3).sum() == 2


def test_normals_at_points_are_weighted_by_angles():
    """At the corner of a cube made of one triangle and of two: 90 and 45 + 45 degrees weigh alike."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 4], [0, 4, 2]])
    np.testing.assert_allclose(point_normals(corner, faces)[0], -np.ones(3) / np.sqrt(3))


def test_a_ring_is_divided_at_the_middles_of_its_arcs():
    """Twelve facets of a cylinder of radius 10: a sag of R (1 - cos 15 degrees) = 0.34, and 0.086 after a division."""
    turn = np.radians(np.arange(0, 361, 30))
    ring = make_grid(turn, np.array([0, 9.0]))
    given = np.stack([10 * np.cos(ring[..., 0]), 10 * np.sin(ring[..., 0]), ring[..., 1]], axis=-1)
    sag, after = (10 * (1 - np.cos(np.radians(each))) for each in (15, 7.5))
    smooth, found, error = smooth_surface(given, 0.2)
    assert (found, error) == pytest.approx((sag, after + sag / 4))
    radius, height = np.hypot(smooth[..., 0], smooth[..., 1]), smooth[..., 2]
    np.testing.assert_allclose(radius[height != 4.5], 10)
    np.testing.assert_allclose(radius, 10, atol=0.014)
    assert set(np.unique(height)) == {0, 4.5, 9}  # diagonals are divided as well
    assert len(smooth) == 3 * len(given)
    kept, _, error = smooth_surface(given, 0.35)
    assert (len(kept), error) == (len(given), pytest.approx(1.25 * sag))
    assert len(smooth_surface(given, 0.05)[0]) == 3 * len(smooth)
    for crease, many in ((29.0, False), (31.0, True)):
        assert (len(smooth_surface(given, 0.2, crease=crease)[0]) > len(given)) == many


def test_a_grid_of_many_points_is_thinned_out(tmp_path):
    """123 points along an edge: every third of them, 41; 61 are kept."""
    for count, left in ((61, 61), (62, 31), (123, 41)):
        x, y = np.meshgrid(np.arange(5.0) + 1, np.arange(count) + 1.0)
        np.save(tmp_path / "grid.npy", np.stack([x, y, 0 * x], axis=-1))
        step = -(-count // 61)
        found = read_triangles(tmp_path / "grid.npy", 1e-3)
        assert len(found) == 2 * (left - 1) * (-(-5 // step) - 1)
        assert found[..., 1].max() == pytest.approx(1e-3 * (1 + step * (left - 1)))


@pytest.mark.parametrize(
    ("start", "jump", "lost"),
    [(0, 1.9, 0), (0, 2.1, 1), (-3, 1.0, 0), (-3, 1.9, 0), (-3, 2.1, 4), (-5, 1.9, 0), (-5, 2.1, 1)],
)  # fmt: skip
def test_a_single_point_at_the_origin_is_one_if_it_is_near_its_neighbours(tmp_path, start, jump, lost):
    """Neighbours at less than twice the spacing of the grid; those beyond do not count."""
    grid = np.stack(np.meshgrid(np.arange(6.0) + start, np.arange(6.0) + start), axis=-1)
    grid = np.concatenate([grid, np.zeros((6, 6, 1))], axis=2)
    beside = -start + (1 if start == 0 else -1)
    grid[beside, beside] = np.array([jump, 0, 0])
    np.save(tmp_path / "grid.npy", grid)
    assert len(read_triangles(tmp_path / "grid.npy", 1.0)) == 2 * (25 - lost)


def test_lines_of_a_tet_file_hold_nodes_and_tetrahedra_in_their_unit(tmp_path):
    path = tmp_path / "two.tet"
    path.write_text("v 0 0 0 7 7\nv 1 0 0\nv 0 2 0\nv 0 0 3\nv 1 1 1\nt 0 1 2 3 9\nt 1 2 3 4\n")
    nodes, cells = read_tetrahedra(path, 1e-2)
    np.testing.assert_allclose(nodes, 1e-2 * np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [1, 1, 1]]))
    assert cells.tolist() == [[0, 1, 2, 3], [1, 2, 3, 4]]
    assert len(read_triangles(path, 1e-2)) == 6
