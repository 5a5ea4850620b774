"""Presses at finite strain: the limit of small loads, paths, deep indentations, and estimates against finer grids."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import press, press_path
from meshes import Box, Cylinder, Sphere
from tests.support.rubber import make_cover


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.5])
def test_small_loads_reach_the_linear_solution(bonded, wts, nu):
    """The limit to 0.2 %, from 2 mN on a sphere that sinks in by less than 1 % of the thickness."""
    linear = press(bonded(nu), wts, Sphere(radius=4e-3), load=2e-3)
    finite = press(make_cover(nu), wts, Sphere(radius=4e-3), load=2e-3)
    assert finite.assumptions["strain"] == "finite"
    assert finite.texel_forces == pytest.approx(linear.texel_forces, abs=2e-3 * 2e-3)
    assert finite.depth == pytest.approx(linear.depth, rel=5e-3)


@pytest.mark.slow
def test_a_load_has_the_same_result_alone_as_on_a_path(wts):
    both = press_path(make_cover(0.45), wts, Sphere(radius=4e-3), loads=[0.3, 0.9])
    alone = press(make_cover(0.45), wts, Sphere(radius=4e-3), load=0.9)
    assert both[1].depth == pytest.approx(alone.depth, rel=2e-3)
    assert both[1].texel_forces == pytest.approx(alone.texel_forces, abs=1e-3 * 0.9)


@pytest.mark.slow
def test_a_result_states_that_edges_are_rounded(wts):
    found = press(make_cover(0.4), wts, Cylinder(radius=3e-3), load=0.2)
    assert "rounded" in found.assumptions["edge"]
    assert found.texel_forces.sum() + found.outside == pytest.approx(0.2, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.45])
def test_estimates_cover_the_change_to_much_finer_grids(wts, nu, monkeypatch):
    usual = press(make_cover(nu), wts, Sphere(radius=4e-3), depth=0.6e-3)
    monkeypatch.setattr("fem_reference.indentation.finite_strain.GRIDS", (12, 18, 27))
    fine = press(make_cover(nu), wts, Sphere(radius=4e-3), depth=0.6e-3)
    peak = int(np.argmax(fine.texel_forces))
    true = {
        "total_force": abs(usual.total_force / fine.total_force - 1),
        "peak_texel": abs(usual.texel_forces[peak] / fine.texel_forces[peak] - 1),
    }
    for name, error in true.items():
        assert error <= usual.error_estimate[name]


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.5])
def test_a_deep_indentation_by_a_sphere_has_small_error_estimates(wts, nu):
    found = press(make_cover(nu), wts, Sphere(radius=4e-3), depth=0.8e-3)
    assert found.error_estimate["total_force"] <= 0.01
    assert found.error_estimate["peak_texel"] <= 0.02


@pytest.mark.slow
@pytest.mark.bench
def test_a_box_at_a_small_load_reaches_the_linear_solution(bonded, wts):
    shape = Box(size=(6e-3, 6e-3, 5e-3))
    linear = press(bonded(0.45), wts, shape, load=0.05)
    finite = press(make_cover(0.45), wts, shape, load=0.05)
    assert np.abs(finite.texel_forces - linear.texel_forces).sum() / 2 < 0.04 * 0.05
