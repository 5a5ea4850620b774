"""Paths that stop early return what they reached."""

from __future__ import annotations

import pytest

from fem_reference import IncompletePathError, press_path
from meshes import Cone
from tests.support.rubber import make_cover


@pytest.mark.slow
def test_a_path_that_stops_returns_its_results(wts):
    shape = Cone(angle=0.7, radius=3e-3)
    with pytest.raises(IncompletePathError, match="of the thickness") as stopped:
        press_path(make_cover(0.45), wts, shape, depths=[0.1e-3, 1.9e-3])
    first, last = stopped.value.reached
    assert first.depth == pytest.approx(0.1e-3)
    assert 0.1e-3 < last.depth < 1.9e-3
    assert last.texel_forces.sum() + last.outside == pytest.approx(last.total_force, rel=2e-3)
    assert "\n" not in str(stopped.value)
