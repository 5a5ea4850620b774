"""Cracks, seams, loose parts and fine tessellations of surfaces from CAD."""

import numpy as np
import pytest

from meshes.solids.shell import thicken
from meshes.surfaces.triangles import (
    check_closed,
    close_cracks,
    enclosed_volume,
    merge_corners,
)


def make_dome(around=24, rings=12, *, start=0.0, stop=np.pi / 2):
    """Half of a hemisphere around y, as a revolved profile: all meridians meet at a point on the border."""
    turn, latitude = np.meshgrid(np.linspace(-np.pi / 2, np.pi / 2, around), np.linspace(start, stop, rings))
    grid = 8e-3 * np.stack(
        [np.cos(latitude) * np.sin(turn), np.sin(latitude), np.cos(latitude) * np.cos(turn)], axis=-1
    )
    corner = [grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]]
    first, second = (np.stack([corner[i] for i in each], axis=2).reshape(-1, 3, 3) for each in ((0, 1, 2), (0, 2, 3)))
    return np.concatenate([first, second[: -(around - 1)] if stop == np.pi / 2 else second])


DOME = make_dome()


def test_cracks_between_faces_are_closed():
    rounding = np.random.default_rng(1).normal(scale=1e-8, size=DOME.shape)
    assert len(merge_corners(DOME + rounding)[0]) > len(merge_corners(DOME)[0])
    whole, cracked = (thicken(close_cracks(each), 2e-3, "dome", inward=True) for each in (DOME, DOME + rounding))
    check_closed(cracked.surface, "dome")
    assert enclosed_volume(cracked.surface) == pytest.approx(enclosed_volume(whole.surface), rel=1e-3)


@pytest.mark.parametrize("shift", [0.0, 0.31, 0.3126, 0.3128])
def test_corners_that_differ_by_the_last_digit_are_merged_wherever_they_lie(shift):
    corners = DOME + 1e-7 * 8e-3 * shift
    assert len(merge_corners(corners * (1 + 1e-12 * np.arange(3)[:, None]))[0]) == len(merge_corners(DOME)[0])


@pytest.mark.parametrize("around", [8, 60])
def test_a_seam_is_found_where_one_side_overlaps_the_other(around):
    seamed = np.concatenate([make_dome(24, start=0.6), make_dome(around, rings=5, stop=0.6)])
    with pytest.raises(ValueError, match="dome has a seam"):
        thicken(seamed, 1e-3, "dome", inward=True)


@pytest.mark.parametrize(("length", "width"), [(60e-3, 4e-3), (150e-3, 10e-3)])
@pytest.mark.parametrize("count", [1, 6])
def test_a_long_narrow_strip_has_no_seam(length, width, count):
    """CAD programs divide a cylinder across its axis only, so that the edges of the border are as long as the strip."""
    turn = np.linspace(-0.5, 0.5, count + 1) * width / 10e-3
    one = 10e-3 * np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=-1)
    other = one + np.array([0, length, 0])
    triangles = [[one[:-1], one[1:], other[1:]], [one[:-1], other[1:], other[:-1]]]
    strip = np.concatenate([np.stack(each, axis=1) for each in triangles])
    assert thicken(strip, 1e-3, "strip", inward=True).nominal == 1e-3


def test_loose_parts_are_refused_with_their_place():
    loose = 0.2 * DOME + [0.0, 20e-3, 0.0]
    with pytest.raises(ValueError, match=r"2 parts .* 3\.8 % of the area near \(0, 2"):
        thicken(np.concatenate([DOME, loose]), 1e-3, "dome", inward=True)


def test_a_hole_is_stated():
    shell = thicken(np.delete(DOME, 60, axis=0), 1e-3, "dome", inward=True)
    assert any("2 borders" in note and "fill holes" in note for note in shell.notes)
    assert thicken(DOME, 1e-3, "dome", inward=True).notes == ()


@pytest.mark.parametrize("around", [24, pytest.param(64, marks=pytest.mark.slow)])
def test_a_fine_tessellation_is_thickened_like_a_coarse_one(around):
    """The triangles at the pole are slivers, and the border keeps all its points."""
    shell = thicken(make_dome(around, rings=24), 2e-3, "dome", inward=True)
    assert shell.notes == ()
    assert enclosed_volume(shell.surface) == pytest.approx(np.pi / 3 * (8**3 - 6**3) * 1e-9, rel=0.02)
