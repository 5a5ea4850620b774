"""The fast model of a curved cover against the reference from which it is derived."""

from __future__ import annotations

import numpy as np
import pytest

from fastmodel.contact.points import press_points as press_fast
from fem_reference import press, result_store
from meshes import Box, Material, Sphere
from meshes.pose import Pose
from meshes.solids import flat_pad, phalanx
from meshes.solids.covers import take_meshes
from validation.derivation import cover_points
from validation.derivation.cover_points import derive_points

RUBBER = Material(name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.49)


@pytest.fixture(scope="module")
def cover():
    return phalanx(angle=1.6, length=8e-3, rows=3, columns=3)


@pytest.fixture(scope="module")
def mesh(cover):
    return cover.mesh(1.2e-3, layers=3)


@pytest.fixture(scope="module")
def fast(cover, mesh):
    return derive_points(mesh, cover.texels, RUBBER)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "tilt", "direction"),
    [
        (Sphere(radius=5e-3), 0.0, (0.2, 0.3, -1.0)),
        (Sphere(radius=0.5e-3), 0.0, (0, 0, -1.0)),
        (Box(size=(3e-3, 2e-3, 4e-3)), 0.0, (-0.4, 0, -1.0)),
        (Box(size=(5e-3, 4e-3, 4e-3)), 0.2, (0, 0, -1.0)),
    ],
    ids=["ball", "small ball", "box", "edge of a box"],
)
def test_presses_agree_with_the_reference_on_the_same_mesh(cover, mesh, fast, shape, tilt, direction):  # noqa: PLR0917
    pose = Pose(point=tuple(-20e-3 * np.array(direction) + [0, 0, 5e-3]), direction=direction, tilt=(0.0, tilt))
    load = 0.02 if shape == Sphere(radius=0.5e-3) else 0.3
    known = press(take_meshes([mesh], RUBBER), cover.texels, shape, pose, load=load)
    found = press_fast(fast, shape, pose, load=load)
    assert np.abs(found.texel_forces - known.texel_forces).sum() < 2 * 0.015 * load
    assert found.depth == pytest.approx(known.depth, rel=0.08)
    np.testing.assert_allclose(found.force, known.force, atol=1e-2 * load)


@pytest.mark.slow
def test_in_the_middle_of_a_pad_no_remainder_is_left():
    """There the elements and the layer, which is solved in the wave-number domain, describe the same cover."""
    cover = flat_pad(size=(24e-3, 24e-3), rows=2)
    fast = derive_points(cover.mesh(1.6e-3, layers=2), cover.texels, RUBBER)
    assert fast.thickness == pytest.approx(cover.thickness)
    middle = np.flatnonzero(np.abs(fast.centres[:, :2]).max(axis=1) < 4e-3)
    apart = np.linalg.norm(fast.centres[middle, None] - fast.centres[middle], axis=2)
    far = fast.move_layer(np.maximum(apart, 1e-3))
    assert np.abs(fast.remainder[np.ix_(middle, middle)]).max() < 0.02 * far.max()
    np.testing.assert_allclose(fast.top_compliance, (1 - 0.49) / (2 * np.pi * RUBBER.shear_modulus))


def test_forces_are_shared_with_their_moments(fast, mesh):
    """Where loads surround a point, they have its resultant and its centre."""
    inner = np.flatnonzero(np.abs(fast.points[:, 0]) < 2e-3)
    inner = inner[np.abs(fast.points[inner, 1]) < 1.5e-3]
    centres = np.einsum("nq,nqc->nc", fast.shares[inner], fast.centres[fast.shared[inner]])
    np.testing.assert_allclose(centres[:, :2], fast.points[inner, :2], atol=0.06e-3)
    np.testing.assert_allclose(fast.shares.sum(axis=1), 1.0)


def test_a_remainder_of_other_code_is_not_taken_from_the_store(cover, mesh, fast, monkeypatch, tmp_path):
    other = tmp_path / "curved.py"
    other.write_text("# other formulas\n")
    with result_store.stored_only():
        derive_points(mesh, cover.texels, RUBBER)
        monkeypatch.setattr(cover_points, "__file__", str(other))
        with pytest.raises(result_store.NotStoredError, match="remainder"):
            derive_points(mesh, cover.texels, RUBBER)
