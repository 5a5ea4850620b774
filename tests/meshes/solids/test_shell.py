"""Closed surfaces of covers from outer surface, base and thickness."""

import numpy as np
import pytest

from meshes.solids.shell import join, select_base, thicken
from meshes.surfaces.triangles import (
    check_closed,
    collapse_short_edges,
    enclosed_volume,
    merge_corners,
    normal_vectors,
)


def make_cap(radius, rings=8, around=24):
    """Half a sphere around the origin with z >= 0, facing outwards."""
    turn, latitude = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.linspace(0, np.pi / 2, rings + 1))
    grid = [np.sin(latitude) * np.cos(turn), np.sin(latitude) * np.sin(turn), np.cos(latitude)]
    grid = radius * np.stack(grid, axis=-1)
    following = np.roll(grid, -1, axis=1)
    lower = np.stack([grid[:-1], grid[1:], following[1:]], axis=2).reshape(-1, 3, 3)
    upper = np.stack([grid[:-1], following[1:], following[:-1]], axis=2).reshape(-1, 3, 3)[around:]
    return np.concatenate([lower, upper])


CAP, CORE = make_cap(10e-3), make_cap(8e-3)
BALL = np.concatenate([CAP, (CAP * [1, 1, -1])[:, ::-1]])
INNER = np.concatenate([CORE, (CORE * [1, 1, -1])[:, ::-1]])


def area(triangles):
    return np.linalg.norm(normal_vectors(triangles), axis=1).sum() / 2


def faces_into_the_cover(base):
    """Whether the triangles of a base around the origin face away from it."""
    return ((normal_vectors(base) * base.mean(axis=1)).sum(axis=1) > 0).all()


def test_a_cap_is_thickened_inwards_and_outwards():
    for surface, inward in ((CAP, True), (CORE, False)):
        shell = thicken(surface, 2e-3, "cap", inward=inward)
        check_closed(shell.surface, "shell")
        volume = 2 / 3 * np.pi * (10**3 - 8**3) * 1e-9
        assert enclosed_volume(shell.surface) == pytest.approx(volume, rel=0.06)
        assert area(shell.base) == pytest.approx(2 * np.pi * 64e-6, rel=0.06)
        assert faces_into_the_cover(shell.base)
        assert shell.notes == ()


@pytest.mark.parametrize(("bend", "stated"), [(0.0, True), (0.01, False), (-0.01, None)])
def test_the_side_that_counts_as_outside_is_told_where_a_surface_hardly_bends(bend, stated):
    """A sheet of 10 x 10 mm; one that bends the other way than it faces is refused."""
    x, y = np.meshgrid(np.linspace(-5, 5, 11), np.linspace(-5, 5, 11), indexing="ij")
    points = 1e-3 * np.stack([x, y, 10 * bend * (50 - x**2 - y**2)], axis=-1)
    corner = [points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]]
    sheet = np.concatenate(
        [np.stack([corner[i] for i in each], axis=2).reshape(-1, 3, 3) for each in ((0, 1, 2), (0, 2, 3))]
    )
    if stated is None:
        with pytest.raises(ValueError, match="inside out"):
            thicken(sheet, 1e-3, "sheet", inward=True)
        return
    shell = thicken(sheet, 1e-3, "sheet", inward=True)
    assert any("hardly bends" in note and "it faces (0, 0, 1)" in note for note in shell.notes) == stated
    assert shell.base[..., 2].mean() < sheet[..., 2].mean() - 0.7e-3


def test_an_outer_surface_and_a_base_are_joined_at_their_borders():
    shell, offset = join(CAP, CORE), thicken(CAP, 2e-3, "cap", inward=True)
    check_closed(shell.surface, "shell")
    assert enclosed_volume(shell.surface) == pytest.approx(enclosed_volume(offset.surface), rel=2e-2)
    for outer in (CAP, CAP[:, ::-1]):  # open surfaces may face either way
        for base in (CORE, CORE[:, ::-1]):
            turned = join(outer, base)
            check_closed(turned.surface, "shell")
            assert enclosed_volume(turned.surface) == pytest.approx(enclosed_volume(shell.surface))
            assert faces_into_the_cover(turned.base)


def test_a_core_inside_a_closed_surface_makes_a_hollow_body():
    shell = join(BALL, INNER)
    check_closed(shell.surface, "shell")
    assert enclosed_volume(shell.surface) == pytest.approx(enclosed_volume(BALL) - enclosed_volume(INNER))
    assert len(shell.base) == len(INNER)


def test_the_base_is_found_on_the_surface_of_a_body():
    body = thicken(CAP, 2e-3, "cap", inward=True)
    for core in (CORE, INNER):
        found = join(body.surface, core, distance=0.3e-3)
        assert area(found.base) == pytest.approx(area(body.base), rel=1e-6)
    assert not select_base(body.surface, CORE + np.array([0, 0, 50e-3])).any()


UP = np.array([0, 0, 1e-3])
HIGH = CAP[CAP[:, :, 2].min(axis=1) > 5e-3]
MIXED = np.concatenate([CAP[:1, ::-1], CAP[1:]])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: join(CAP, INNER), "the outer surface is open and the base is closed"),
        pytest.param(
            lambda: join(BALL, INNER + 100 * UP),
            "neither lies on the closed outer surface nor inside",
            marks=pytest.mark.slow,
        ),
        (lambda: join(BALL, INNER + 5 * UP), r"reaches through the outer surface; .* cross, as at \("),
        (lambda: join(CAP, CORE + 4 * UP), "the outer surface and the base cross each other; .* end both where"),
        (lambda: join(HIGH, 0.98 * CAP), "sides between the borders .* cut both along the same outline"),
        (lambda: thicken(CAP[:, ::-1], 1e-3, "cap", inward=True), "cap is inside out: its triangles face inwards"),
        (lambda: thicken(MIXED, 1e-3, "cap", inward=True), "face different ways"),
        pytest.param(
            lambda: thicken(CAP, 12e-3, "cap", inward=True),
            r"bends more sharply than a thickness of 12 mm allows, as at \(.* mm; round the edges",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_bad_surfaces_and_surfaces_that_do_not_fit_are_refused_in_words(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_short_edges_are_collapsed_to_a_closed_surface():
    points, faces = merge_corners(BALL)
    fewer, kept = collapse_short_edges(points, faces, 2e-3)
    assert len(kept) < 0.8 * len(faces)
    check_closed(fewer[kept], "ball")
    assert enclosed_volume(fewer[kept]) == pytest.approx(enclosed_volume(BALL), rel=0.1)
