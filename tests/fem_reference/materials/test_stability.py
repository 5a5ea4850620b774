"""Stretches at which rubber-like materials lose their stability, against closed forms."""

from __future__ import annotations

import pytest

from fem_reference.materials import describe_instability, find_unstable_stretches, warn_of_instability
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
