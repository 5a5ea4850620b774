"""Flat faces with friction at finite strain: what rounded edges leave of the effect of sharp ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import press
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation import layered
from meshes import Cylinder, TexelArray
from tests.support.rubber import make_cover

ARRAY = TexelArray.grid(6, 6, pitch=3.4e-3)
PUNCH = Cylinder(radius=2e-3)
COVER = make_cover(0.49)


@pytest.mark.bench
@pytest.mark.slow
@pytest.mark.parametrize(("depth", "friction"), [(0.25e-3, 0.4)])
def test_three_dimensions_agree_with_the_plane_of_the_axis_within_their_estimate(depth, friction, monkeypatch):
    """The sides of the pad are four thicknesses away; meshes, radii of edges and baselines differ."""
    monkeypatch.setattr(layered, "_FAR_SIDES", {"bonded": np.inf})  # else the pad is solved as a wide cover
    pad = press(replace(COVER, size=(20.4e-3, 20.4e-3)), ARRAY, PUNCH, depth=depth, friction=friction)
    wide = press(COVER, ARRAY, PUNCH, depth=depth, friction=friction)
    assert "free" in pad.assumptions["sides"]
    estimate = pad.error_estimate["total_force"]
    assert pad.total_force == pytest.approx(wide.total_force, rel=estimate)
    assert estimate < 0.05
    assert pad.texel_forces.max() == pytest.approx(wide.texel_forces.max(), rel=pad.error_estimate["peak_texel"])


@pytest.mark.slow
@pytest.mark.parametrize("depth", [0.1e-3, 0.2e-3, 0.3e-3])
def test_half_the_radius_changes_about_as_much_as_all_smaller_radii(depth):
    """The safety factor on this change under edges on mesh lines is 2."""
    path = LoadingPath(cover=COVER, indenter=PUNCH, targets=(depth,), control="depth", friction=np.inf)
    sticks, slides = path.at_model_strain, replace(path.baseline, friction=0.0)
    effects = []
    for fillet in (0.4e-3, 0.2e-3, 0.1e-3, 0.05e-3):
        loads = []
        for each in (sticks, slides):
            states, _ = press_axisymmetric(
                each, elements_per_thickness=9, contact_radius=PUNCH.radius, fillet=fillet, reach=16e-3
            )
            loads.append(states[0].total_force)
        effects.append(loads[0] / loads[1])
    changes = np.diff(effects)
    assert (changes > 0).all()
    rest = changes[1] + 2 * changes[2]  # the last change stands for all radii below a fortieth of the thickness too
    assert 0.8 * changes[0] < rest < 2.3 * changes[0]
