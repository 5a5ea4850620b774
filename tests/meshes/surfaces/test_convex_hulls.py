"""Convex hulls that make up the underside of a body."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial import cKDTree

from meshes import read_stl
from meshes.surfaces import underside
from meshes.surfaces.underside import _Underside


def limit(monkeypatch, **changes):
    monkeypatch.setattr(underside, "HULLS", dataclasses.replace(underside.HULLS, **changes))


def test_two_balls_are_made_of_a_few_hulls_that_are_computed_once(write_stl):
    body = read_stl(write_stl("two-balls"))
    assert 2 <= len(body.primitives()) <= 20
    assert body.primitives() is body.primitives()


def test_every_hull_contains_only_corners_at_or_above_the_underside(write_stl):
    """No corner of a hull reaches below the body; the lowest of all is the body's lowest point."""
    body = read_stl(write_stl("two-balls"))
    corners = np.concatenate([hull.vertices for hull in body.primitives()])
    gap = body.gap(corners[:, 0], corners[:, 1])
    known = np.isfinite(gap)
    assert known.mean() > 0.5
    assert (corners[known, 2] >= gap[known] - 1e-6).all()
    assert corners[:, 2].min() == pytest.approx(0, abs=1e-9)


def test_a_warning_tells_that_the_hulls_do_not_reach_the_tolerance(write_stl, monkeypatch, caplog):
    limit(monkeypatch, most=2)
    assert len(read_stl(write_stl("cup")).primitives()) == 2
    assert "2 hulls of the body from a file fill up to" in caplog.text
    caplog.clear()
    read_stl(write_stl("pyramid")).primitives()
    assert not caplog.text


def test_a_large_tolerance_leaves_one_hull(write_stl, monkeypatch):
    limit(monkeypatch, tolerance=1.0)
    assert len(read_stl(write_stl("two-balls")).primitives()) == 1


def test_of_too_many_corners_the_outermost_are_kept(write_stl, monkeypatch):
    """The lowest corner stays; elsewhere a sphere of 200 corners lies at most 2 % of its radius further in."""
    limit(monkeypatch, most_corners=200)
    (hull,) = read_stl(write_stl("sphere")).primitives()
    corners = np.array(hull.vertices)
    assert 150 < len(corners) <= 200
    assert corners[:, 2].min() == pytest.approx(0, abs=1e-9)
    directions = np.random.default_rng(0).normal(size=(500, 3)) * [1, 1, -1]
    directions = directions[directions[:, 2] < 0]
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    extent = ((corners - [0, 0, 5e-3]) @ directions.T).max(axis=0)
    assert 5e-3 - extent.min() < 0.02 * 5e-3


@pytest.mark.slow
def test_the_corners_that_are_kept_of_a_ball_are_spread_evenly():
    """Below its middle no point is farther from a kept corner than 1.6 times the reach of a hexagonal lattice."""
    random = np.random.default_rng(0)
    points = random.normal(size=(30_000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    kept = underside._keep_outermost(points)
    assert 0.9 * underside.HULLS.most_corners < len(kept) <= underside.HULLS.most_corners
    apart = cKDTree(kept).query(points[points[:, 2] < 0])[0].max()
    share = 2 * np.pi / (0.8 * underside.HULLS.most_corners)  # area of the lower half per direction below the middle
    assert apart < 1.6 * np.sqrt(2 * share / (3 * np.sqrt(3)))


def test_a_cut_lies_one_step_before_the_nearest_wall_and_never_behind_the_point():
    """A floor of 1 mm with a wall down to 0 at x = 3 mm; points are 1 mm apart along x, and 0.5 mm along y."""
    x, y = (each.ravel() for each in np.meshgrid(1e-3 * np.arange(6), 0.5e-3 * np.arange(4)))
    height = np.where(x < 2.5e-3, 1e-3, 0.0)
    sampled = _Underside(
        x=x, y=y, height=height, levels=np.zeros(1), beside=np.zeros((1, 24)), top=2e-3, step=1e-3, tolerance=1e-6
    )
    point = int(np.flatnonzero((x == 0) & (y == 0.5e-3))[0])
    np.testing.assert_allclose(sampled.find_wall(point, 0.0), [2e-3, 0.5e-3])
    # below another point half a step away: the point itself, not beyond it
    near = dataclasses.replace(sampled, height=np.where(y < 0.2e-3, 0.0, 1e-3))
    np.testing.assert_allclose(near.find_wall(point, 0.0), [0.0, 0.5e-3])
    np.testing.assert_allclose(near.find_wall(0, 0.0), [0.0, 0.0])
    assert sampled.find_wall(point, -1.0).tolist() == [0.0, 0.5e-3]
