"""Covers of limited size: mesh lines, texel forces from base reactions, and covers that could slide away."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import press
from fem_reference.finite_strain.block_path import BlockState, recover_nodal_pressure
from fem_reference.indentation.finite_cover import _grade_side, integrate_nodal
from meshes import Sphere, TexelArray
from meshes.pose import Pose
from tests.support.rubber import make_cover

BALL = Sphere(radius=4e-3)


def test_texels_carry_exactly_the_reactions_of_the_base():
    """The base pressure integrates to the reactions, mirrored halves included."""
    array = TexelArray.grid(2, 3, (4e-3, 5e-3))
    half = np.linspace(0, 6e-3, 9)
    whole = np.linspace(-5e-3, 5e-3, 7)
    forces = np.random.default_rng(2).uniform(0, 1, (9, 7))
    state = BlockState(
        depth=1e-3,
        load=1.0,
        area=1e-6,
        overlap=0.0,
        lines=(half, whole),
        forces=forces,
        symmetric=(True, False),
        contact=np.empty((0, 5)),
        energy=0.0,
    )
    felt = integrate_nodal(recover_nodal_pressure(state), array, Pose())
    assert felt.sum() == pytest.approx(2 * forces.sum(), rel=1e-12)
    assert array.image(felt[:-1])[:, ::-1] == pytest.approx(array.image(felt[:-1]))


@pytest.mark.parametrize("mirror", [True, False])
def test_mesh_lines_run_from_side_to_side_and_hold_the_ends_of_the_contact(mirror):
    low, high = (-0.8, 0.8) if mirror else (0.4, 2.0)
    nodes = _grade_side((low, high), 2.5, fine=0.05, coarse=0.3, symmetric=mirror)
    assert nodes[0] == (0 if mirror else -2.5)
    assert nodes[-1] == 2.5
    assert (np.diff(nodes) > 0).all()
    assert np.abs(nodes - high).min() < 1e-12
    assert np.diff(nodes)[np.argmin(np.abs(nodes - high)) - 1] < 0.1


def test_sliding_cover_that_would_slip_away_is_refused():
    with pytest.raises(ValueError, match="slides on its base stays where it is only under a shape that mirrors"):
        press(
            make_cover(0.45, thickness=4e-3, size=(8e-3, 6e-3), base="sliding"),
            TexelArray.grid(1, 2, 3e-3),
            BALL,
            load=1.0,
            pose=Pose.planar(at=(1e-3, 0.0)),
        )
