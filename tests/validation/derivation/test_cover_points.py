"""The fast model of a curved cover against the reference from which it is derived."""

from __future__ import annotations

import numpy as np
import pytest

from fastmodel.contact.points import press_points as press_fast
from fem_reference import result_store
from fem_reference.curved_cover import texel_responses
from fem_reference.curved_cover.contact import MeshPress, TopCompliance
from fem_reference.curved_cover.pressure_shapes import GapSampler, evaluate_hats, spread_hats
from fem_reference.curved_cover.rays import find_touch
from fem_reference.curved_cover.responses import build_solid
from meshes import Box, Material, Sphere
from meshes.pose import Pose
from meshes.solids import phalanx
from meshes.solids.facets import split_facet
from validation.derivation import cover_points
from validation.derivation.cover_points import derive_points

RUBBER = Material(name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.49)


@pytest.fixture(scope="module")
def cover():
    return phalanx(angle=1.6, length=8e-3, rows=3, columns=3)


@pytest.fixture(scope="module")
def mesh(cover):
    return cover.mesh(1.6e-3, layers=2)


@pytest.mark.parametrize("direction", [(0, 0, -1.0), (-0.4, 0, -1.0), (0.2, 0.3, -1.0)])
@pytest.mark.parametrize("shape", [Sphere(radius=5e-3), Box(size=(5e-3, 4e-3, 4e-3))], ids=["ball", "box"])
def test_presses_agree_with_those_of_the_reference_on_the_same_mesh(cover, mesh, shape, direction):
    """Both have the same pressures; the fast model does not cut them at a sharp edge, as the reference does."""
    close = 1e-2 if isinstance(shape, Sphere) else 8e-2
    fast = derive_points(mesh, cover.texels, RUBBER)
    pose = Pose.facing(-20e-3 * np.array(direction) + np.array([0, 0, 5e-3]), direction)
    compliance = TopCompliance(build_solid(mesh, RUBBER))
    touch = find_touch(compliance.top, shape, pose)
    sampler = GapSampler(compliance.top, shape, pose, touch + 1e-3, 1e-3)
    known = MeshPress(compliance, sampler, pose.towards, touch, 1e-3).at_depth(0.25e-3)
    texel_forces = texel_responses([mesh], cover.texels, RUBBER).finest.texel_forces(known.nodal)
    found = press_fast(fast, shape, pose, load=known.load)
    assert np.abs(found.texel_forces - texel_forces).sum() < close * known.load
    np.testing.assert_allclose(found.force, known.nodal.sum(axis=0), atol=close * known.load)


def test_a_uniform_pressure_presses_on_the_texels_as_in_the_reference(cover, mesh):
    fast = derive_points(mesh, cover.texels, RUBBER)
    known = texel_responses([mesh], cover.texels, RUBBER).finest
    top = known.top
    # Points on the edge of the base do not yield; all others are points of the fast model.
    free = ~np.isin(top.index, mesh.base)
    np.testing.assert_array_equal(fast.points, top.nodes[free])
    _, parts, _ = top.split(8)
    hats = np.linalg.norm(parts, axis=2) @ evaluate_hats(9, split_facet(9, 8)[0])
    forces = np.bincount(top.facets.ravel(), hats.ravel(), len(top.nodes))
    expected = known.normal_influence @ top.areas
    bonded = known.normal_influence[:, ~free] @ (spread_hats(top) @ np.where(free, 0, forces))[~free]
    np.testing.assert_allclose(fast.influence @ forces[free] + bonded, expected, atol=1e-2 * expected.max())
    assert np.linalg.eigvalsh(fast.compliance).min() > 0


def test_a_compliance_of_other_code_is_not_taken_from_the_store(cover, mesh, monkeypatch, tmp_path):
    derive_points(mesh, cover.texels, RUBBER)
    other = tmp_path / "curved.py"
    other.write_text("# other formulas\n")
    with result_store.stored_only():
        derive_points(mesh, cover.texels, RUBBER)
        monkeypatch.setattr(cover_points, "__file__", str(other))
        with pytest.raises(result_store.NotStoredError, match="hat"):
            derive_points(mesh, cover.texels, RUBBER)
