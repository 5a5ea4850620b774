"""Poses that a fit lends to placements without one."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from meshes import Sphere
from validation.calibration import forward_fit
from validation.calibration.forward_fit import borrow_poses
from validation.calibration.model import Observations, Placement, Pose

BALL, TIP = Sphere(radius=5e-3), Sphere(radius=2e-3)


def observe(*placements):
    m = len(placements)
    return Observations(
        loads=np.ones(m),
        counts=np.ones((m, 4)),
        measured=np.ones((m, 4), dtype=bool),
        placements=placements,
        groups=tuple(each.name for each in placements),
        temperatures=np.full(m, np.nan),
        ages=np.full(m, np.nan),
        thresholds=np.zeros(m),
    )


@pytest.fixture
def fit(monkeypatch):
    """A fit of two placements of the ball and one of the tip."""
    monkeypatch.setattr(forward_fit, "replace", lambda fit, **changes: SimpleNamespace(**(vars(fit) | changes)))
    fitted = observe(*(Placement(name=name, indenter=shape) for name, shape in (("a", BALL), ("b", BALL), ("c", TIP))))
    poses = {name: Pose(k * 1e-3, 0.0, 0.0, 0.0, 0.0) for k, name in enumerate("abc")}
    return SimpleNamespace(poses=poses, observations=fitted)


def test_a_placement_without_a_pose_gets_the_last_fitted_one_of_its_indenter(fit):
    known = Placement(name="known", indenter=BALL, at=(1e-3, 2e-3), yaw=0.0)
    lent, said = borrow_poses(
        fit, observe(Placement(name="d", indenter=BALL), Placement(name="a", indenter=BALL), known)
    )
    assert lent.poses == {**fit.poses, "d": fit.poses["b"]}
    assert said == ["no recording places the indenter in 'd'; its pose is that of 'b'"]


def test_an_indenter_without_a_fitted_pose_is_refused(fit):
    other = dataclasses.replace(BALL, radius=1e-3)
    with pytest.raises(ValueError, match="'e' is not known: no recording of its indenter was fitted"):
        borrow_poses(fit, observe(Placement(name="e", indenter=other)))
