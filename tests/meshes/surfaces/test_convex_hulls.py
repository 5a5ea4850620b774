"""Convex hulls that make up the underside of a body."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from meshes import read_stl
from meshes.indenters import triangle_mesh


def limit(monkeypatch, **changes):
    monkeypatch.setattr(triangle_mesh, "HULLS", dataclasses.replace(triangle_mesh.HULLS, **changes))


@pytest.mark.slow
def test_every_hull_contains_only_corners_at_or_above_the_underside(write_stl):
    """No corner of a hull reaches below the body; the lowest of all is the body's lowest point."""
    body = read_stl(write_stl("two-balls"))
    corners = np.concatenate([hull.vertices for hull in body.primitives()])
    gap = body.gap(corners[:, 0], corners[:, 1])
    known = np.isfinite(gap)
    assert known.mean() > 0.5
    assert (corners[known, 2] >= gap[known] - 1e-6).all()
    assert corners[:, 2].min() == pytest.approx(0, abs=1e-9)


@pytest.mark.slow
def test_a_warning_tells_that_the_hulls_do_not_reach_the_tolerance(write_stl, monkeypatch, caplog):
    limit(monkeypatch, most=2)
    assert len(read_stl(write_stl("cup")).primitives()) == 2
    assert "2 hulls of the body from a file fill up to" in caplog.text
    caplog.clear()
    read_stl(write_stl("pyramid")).primitives()
    assert not caplog.text


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
