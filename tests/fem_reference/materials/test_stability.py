"""Stretches at which rubber-like materials lose their stability, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_reference.materials import describe_instability, find_unstable_stretches, measure_stress, warn_of_instability
from meshes import Material


def make_mooney(c10: float, c01: float) -> Material:
    return Material(name="rubber", model="mooney-rivlin", parameters={"c10": c10, "c01": c01}, poisson_ratio=0.5)


def test_mooney_rivlin_loses_stability_where_its_closed_form_does():
    """d/d(ln l) of (l^2 - l^-4) (c10 + c01 l^2) in equibiaxial tension is zero; planar stress has c10 + c01 > 0."""
    found = find_unstable_stretches(make_mooney(1.0, -0.2))
    stretch = found["equibiaxial tension"]
    for factor, sign in ((0.99, 1), (1.01, -1)):
        x = stretch * factor
        slope = 2 * x**2 + 4 * x**-4 - 0.2 * (4 * x**4 + 2 * x**-2)
        assert slope * sign > 0
    assert "planar tension" not in found
    assert found["uniaxial compression"] == pytest.approx(stretch**-2, rel=0.01)


def test_a_stable_material_is_not_named():
    rubber = Material(name="r", model="neo-hookean", parameters={"shear_modulus": 1.0}, poisson_ratio=0.5)
    assert find_unstable_stretches(rubber) == {}
    assert describe_instability(rubber) == ""
    assert warn_of_instability(rubber, 0.2) == ""


def test_a_result_is_warned_of_beyond_the_stretch():
    rubber = make_mooney(1.0, -0.2)
    assert warn_of_instability(rubber, 0.5) == ""
    assert "loses stability in uniaxial compression at a stretch of 0.37" in warn_of_instability(rubber, 0.3)


def equibiaxial_stress(stretch, thickness, bulk):
    """True stresses along axes 1 and 3 of Mooney-Rivlin rubber, c10 = 1 and c01 = -0.2, by its invariants."""
    squares = np.array([stretch, stretch, thickness]) ** 2
    volume, first, second = stretch**2 * thickness, squares.sum(), (squares.sum() ** 2 - (squares**2).sum()) / 2
    deviator = 2 * (squares - first / 3) * volume ** (-2 / 3)
    deviator += -0.2 * (2 * squares * (first - squares) - 4 / 3 * second) * volume ** (-4 / 3)
    return (deviator / volume + bulk * (volume - 1))[[0, 2]]


@pytest.mark.slow
def test_a_compressible_material_is_stretched_without_lateral_stress():
    material = Material(name="f", model="mooney-rivlin", parameters={"c10": 1.0, "c01": -0.2}, poisson_ratio=0.3)
    bulk = 2 * 1.6 * 1.3 / (3 * 0.4)
    stretches = find_unstable_stretches(material)["equibiaxial tension"] * np.array([0.97, 0.99, 1.01, 1.03])
    stresses = []
    for stretch in stretches:
        thickness = brentq(lambda t, s=stretch: equibiaxial_stress(s, t, bulk)[1], 0.25, 1.0)
        stresses.append(equibiaxial_stress(stretch, thickness, bulk)[0])
    rises = np.diff(stresses)
    assert rises[0] > 0 > rises[-1]
    at = float(stretches[1])
    limit = brentq(lambda t: equibiaxial_stress(at / 0.99, t, bulk)[1], 0.25, 1.0)  # thickness at the loss of stability
    assert limit > 1.2 * (at / 0.99) ** -2
    assert warn_of_instability(material, limit + 0.01) == ""
    assert "equibiaxial tension at a stretch of 1.8" in warn_of_instability(material, limit - 0.01)


@pytest.mark.slow
def test_a_compressed_material_whose_sides_jump_loses_its_stability():
    """Solved strain by strain, each from the one before, the sides jump inwards at a stretch of 0.3174."""
    material = Material(name="m", model="mooney-rivlin", parameters={"c10": 6e4, "c01": -1e4}, poisson_ratio=0.3)
    assert find_unstable_stretches(material)["uniaxial compression"] == pytest.approx(0.3174, abs=2e-3)
    # just before the jump the sides still bulge
    _, stretches = measure_stress(material, -np.linspace(0, 1.14, 300)[1:], np.array([1, -0.5, -0.5]))
    assert np.abs(np.diff(np.log(stretches[:, 1]))).max() < 0.02
    assert stretches[-1, 1] == pytest.approx(np.exp(0.21), abs=0.02)
