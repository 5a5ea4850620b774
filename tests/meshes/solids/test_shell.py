"""Closed surfaces of covers from outer surface, base and thickness."""

import numpy as np
import pytest

from meshes.solids.shell import join, select_base, thicken
from meshes.surfaces.triangles import check_closed, collapse_short_edges, enclosed_volume, merge_corners


def make_cap(radius, rings=8, around=24):
    """Half a sphere around the origin with z >= 0, facing outwards."""
    latitude = np.linspace(0, np.pi / 2, rings + 1)
    turn = np.arange(around) * 2 * np.pi / around
    grid = radius * np.stack(
        [
            np.sin(latitude)[:, None] * np.cos(turn),
            np.sin(latitude)[:, None] * np.sin(turn),
            np.broadcast_to(np.cos(latitude)[:, None], (rings + 1, around)),
        ],
        axis=-1,
    )
    following = np.roll(grid, -1, axis=1)
    lower = np.stack([grid[:-1], grid[1:], following[1:]], axis=2).reshape(-1, 3, 3)
    upper = np.stack([grid[:-1], following[1:], following[:-1]], axis=2).reshape(-1, 3, 3)[around:]
    return np.concatenate([lower, upper])


CAP, CORE = make_cap(10e-3), make_cap(8e-3)
BALL = np.concatenate([CAP, (CAP * [1, 1, -1])[:, ::-1]])
INNER = np.concatenate([CORE, (CORE * [1, 1, -1])[:, ::-1]])


def area(triangles):
    return (
        np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1).sum() / 2
    )


def test_a_cap_is_thickened_inwards_and_outwards():
    for surface, inward in ((CAP, True), (CORE, False)):
        shell = thicken(surface, 2e-3, "cap", inward=inward)
        check_closed(shell.surface, "shell")
        volume = 2 / 3 * np.pi * (10**3 - 8**3) * 1e-9
        assert enclosed_volume(shell.surface) == pytest.approx(volume, rel=0.06)
        assert area(shell.base) == pytest.approx(2 * np.pi * 64e-6, rel=0.06)
        normals = np.cross(shell.base[:, 1] - shell.base[:, 0], shell.base[:, 2] - shell.base[:, 0])
        assert ((normals * shell.base.mean(axis=1)).sum(axis=1) > 0).all()  # into the cover
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
            normals = np.cross(turned.base[:, 1] - turned.base[:, 0], turned.base[:, 2] - turned.base[:, 0])
            assert ((normals * turned.base.mean(axis=1)).sum(axis=1) > 0).all()  # into the cover


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


@pytest.mark.parametrize(
    ("outer", "base", "said"),
    [
        (CAP, INNER, "the outer surface is open and the base is closed"),
        (BALL, INNER + np.array([0, 0, 0.1]), "neither lies on the closed outer surface nor inside"),
        (BALL, INNER + np.array([0, 0, 5e-3]), r"reaches through the outer surface; .* cross, as at \("),
        (CAP, CORE + np.array([0, 0, 4e-3]), "the outer surface and the base cross each other; .* end both where"),
        (
            CAP[CAP[:, :, 2].min(axis=1) > 5e-3],
            0.98 * CAP,
            "sides between the borders .* cut both along the same outline",
        ),
    ],
)
def test_surfaces_that_do_not_fit_are_refused(outer, base, said):
    with pytest.raises(ValueError, match=said):
        join(outer, base)


def test_bad_surfaces_are_refused_in_words():
    with pytest.raises(ValueError, match="cap is inside out: its triangles face inwards"):
        thicken(CAP[:, ::-1], 1e-3, "cap", inward=True)
    mixed = CAP.copy()
    mixed[5] = mixed[5, ::-1]
    with pytest.raises(ValueError, match="face different ways"):
        thicken(mixed, 1e-3, "cap", inward=True)
    with pytest.raises(
        ValueError, match=r"bends more sharply than a thickness of 12 mm allows, as at \(.* mm; round the edges"
    ):
        thicken(CAP, 12e-3, "cap", inward=True)


def test_short_edges_are_collapsed_to_a_closed_surface():
    points, faces = merge_corners(BALL)
    fewer, kept = collapse_short_edges(points, faces, 2e-3)
    assert len(kept) < 0.8 * len(faces)
    check_closed(fewer[kept], "ball")
    assert enclosed_volume(fewer[kept]) == pytest.approx(enclosed_volume(BALL), rel=0.1)
