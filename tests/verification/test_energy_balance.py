"""Work of the load along a path against the energy stored in the cover, at large strain."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.loading_path import LoadingPath
from meshes import Sphere
from tests.support.rubber import make_cover


@pytest.mark.slow
@pytest.mark.parametrize(("nu", "share"), [(0.3, 0.8), (0.45, 0.8), (0.5, 0.75)])
def test_a_ball_stores_the_work_of_its_load(nu, share):
    """Simpson's rule over twelve steps; the path ends at 80 % of the thickness, at nu = 0.5 at 75 %."""
    cover, steps = make_cover(nu), 12
    depths = share * cover.thickness * np.arange(1, steps + 1) / steps
    path = LoadingPath(cover=cover, indenter=Sphere(radius=4e-3), targets=tuple(depths), control="depth")
    states, _ = press_axisymmetric(path, elements_per_thickness=6, contact_radius=3.3e-3, fillet=0.05e-3, reach=30e-3)
    load = np.array([0.0, *(state.total_force for state in states)])
    work = depths[0] / 3 * (load[0] + 4 * load[1:-1:2].sum() + 2 * load[2:-1:2].sum() + load[-1])
    assert states[-1].depth == pytest.approx(share * cover.thickness)
    assert states[-1].energy == pytest.approx(work, rel=0.01)
