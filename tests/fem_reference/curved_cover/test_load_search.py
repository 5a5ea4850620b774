"""The search for the depth under a load."""

import types

import numpy as np
import pytest

from fem_reference.curved_cover.contact import MeshPress
from fem_reference.errors import ConvergenceError


class PressByLaw(MeshPress):
    """A press whose load [N] is a function of the depth [m], up to 1 mm."""

    def __init__(self, law):
        super().__init__(None, None, None, 0.0, 1e-3)
        self.law, self.tried = law, []

    def at_depth(self, depth):
        self.tried.append(depth)
        slope = (self.law(1.01 * depth) - self.law(depth)) / (0.01 * depth)
        return types.SimpleNamespace(load=self.law(depth), stiffness=slope, forces=np.ones(9))


@pytest.mark.parametrize(
    ("law", "depth"),
    [
        (lambda depth: 1e4 * depth, 1e-4),
        (lambda depth: 1e6 * depth**1.5, 1e-4),
        (lambda depth: (depth / 2e-4) ** 12, 2e-4),
        (lambda depth: depth / 9e-4 * 1e-3 if depth < 9e-4 else 1e-3 + 1e5 * (depth - 9e-4), 9e-4 + 0.999e-5),
        (lambda depth: 1 - np.exp(-depth / 1e-5) + 1e-5, 1e-5 * np.log(1e5)),
    ],
)
def test_the_depth_under_a_load_is_found_whatever_the_law(law, depth):
    press = PressByLaw(law)
    assert press.to(1.0, "load").load == pytest.approx(1, rel=1e-7)
    assert press.tried[-1] == pytest.approx(depth, rel=1e-2)
    assert len(press.tried) <= 40


def test_a_load_that_no_depth_reaches_is_told_after_sixty_steps():
    press = PressByLaw(lambda depth: 0.5 if depth < 3e-4 else 2.0)
    with pytest.raises(ConvergenceError, match="the depth under 1 N was not found in 60 steps"):
        press.to(1.0, "load")
    assert len(press.tried) == 1 + 60  # one depth to start from
    assert press.tried[-1] == pytest.approx(3e-4, rel=1e-2)
