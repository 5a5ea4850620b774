"""Paths that stop early return what they reached."""

from __future__ import annotations

import pytest

from fem_reference import IncompletePathError, press_path
from meshes import Cylinder
from tests.support.rubber import make_cover


@pytest.mark.slow
def test_a_path_that_stops_returns_its_results(wts):
    with pytest.raises(IncompletePathError, match="of the thickness") as stopped:
        press_path(make_cover(0.5), wts, Cylinder(radius=1e-3), loads=[0.1, 100.0])
    first, last = stopped.value.reached
    assert first.total_force == 0.1
    assert 0.1 < last.total_force < 100.0
    for each in (first, last):
        assert each.texel_forces.sum() + each.outside == pytest.approx(each.total_force, rel=2e-3)
    assert "\n" not in str(stopped.value)
