"""Finite strain: derivatives, the small-load limit, deep indentations, and what happens where a path ends."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import press, press_path
from meshes import Box, Cover, Cylinder, Layer, Material, Sphere


def rubber(nu, thickness=2e-3):
    """A bonded neo-Hookean cover with a Young's modulus of 1 MPa."""
    material = Material(
        name="rubber", model="neo-hookean", parameters={"shear_modulus": 1e6 / (2 * (1 + nu))}, poisson_ratio=nu
    )
    return Cover(layers=(Layer(thickness=thickness, material=material),))


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.45, 0.5])
def test_small_loads_reach_the_linear_solution(bonded, wts, nu):
    """The limit to 0.2 %, from 2 mN on a sphere that sinks in by less than 1 % of the thickness."""
    linear = press(bonded(nu), wts, Sphere(radius=4e-3), load=2e-3)
    finite = press(rubber(nu), wts, Sphere(radius=4e-3), load=2e-3)
    assert finite.assumptions["strain"] == "finite"
    assert finite.texel_forces == pytest.approx(linear.texel_forces, abs=2e-3 * 2e-3)
    assert finite.depth == pytest.approx(linear.depth, rel=5e-3)


@pytest.mark.slow
def test_loads_of_one_path_are_those_pressed_alone(wts):
    both = press_path(rubber(0.45), wts, Sphere(radius=4e-3), loads=[0.3, 0.9])
    alone = press(rubber(0.45), wts, Sphere(radius=4e-3), load=0.9)
    assert both[1].depth == pytest.approx(alone.depth, rel=2e-3)
    assert both[1].texel_forces == pytest.approx(alone.texel_forces, abs=1e-3 * 0.9)


@pytest.mark.slow
def test_edges_are_rounded_and_the_result_says_so(wts):
    found = press(rubber(0.4), wts, Cylinder(radius=3e-3), load=0.2)
    assert "rounded" in found.assumptions["edge"]
    assert found.texel_forces.sum() + found.outside == pytest.approx(0.2, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.45, 0.5])
def test_estimates_cover_the_change_to_much_finer_grids(wts, nu, monkeypatch):
    usual = press(rubber(nu), wts, Sphere(radius=4e-3), depth=0.6e-3)
    monkeypatch.setattr("fem_reference.indentation.finite_strain.GRIDS", (12, 18, 27))
    fine = press(rubber(nu), wts, Sphere(radius=4e-3), depth=0.6e-3)
    peak = int(np.argmax(fine.texel_forces))
    true = {
        "total_force": abs(usual.total_force / fine.total_force - 1),
        "peak_texel": abs(usual.texel_forces[peak] / fine.texel_forces[peak] - 1),
    }
    for name, error in true.items():
        assert error <= usual.error_estimate[name]


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.45, 0.5])
def test_a_sphere_of_twice_the_thickness_sinks_in_by_two_fifths(wts, nu):
    found = press(rubber(nu), wts, Sphere(radius=4e-3), depth=0.8e-3)
    assert found.error_estimate["total_force"] <= 0.01
    assert found.error_estimate["peak_texel"] <= 0.02


@pytest.mark.slow
def test_a_box_in_space_spreads_like_the_linear_one_at_small_load(bonded, wts):
    shape = Box(size=(6e-3, 6e-3, 5e-3))
    linear = press(bonded(0.45), wts, shape, load=0.05)
    finite = press(rubber(0.45), wts, shape, load=0.05)
    assert np.abs(finite.texel_forces - linear.texel_forces).sum() / 2 < 0.04 * 0.05
