"""Covers of tetrahedra in a shell, whose meshes are kept."""

import numpy as np
import pytest
import trimesh

from meshes.catalogue import MATERIALS
from meshes.solids.covers import make_shell_cover
from meshes.solids.shell import thicken
from meshes.solids.solid_mesh import LIMITS, check_quality

pytest.importorskip("pytetwild")


def cover_ball(*, radius, thickness, sizes, kept):
    """Make the cover of a ball, whose meshes are kept in a dictionary by their element size."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    shell = thicken(np.array(ball.triangles), thickness, "ball", inward=True)

    def keep(inputs, compute):
        if inputs["size"] not in kept:
            kept[inputs["size"]] = compute()
        return kept[inputs["size"]]

    return make_shell_cover(shell, MATERIALS["tpu"], "ball", sizes, keep)


@pytest.mark.slow
def test_meshes_are_kept_and_given_from_coarse_to_fine():
    kept = {}
    # The larger size comes last.
    first, second = (cover_ball(radius=10e-3, thickness=2e-3, sizes=(1.8e-3, 2.6e-3), kept=kept) for _ in range(2))
    meshes = first.meshes()
    counts = [len(mesh.cells) for mesh in meshes]
    assert counts == sorted(set(counts))
    assert [mesh.digest for mesh in second.meshes()] == [mesh.digest for mesh in meshes]


@pytest.mark.slow
def test_elements_that_are_too_few_through_the_thickness_are_made_smaller():
    """Large triangles of a file make the mesher exceed the wanted size."""
    kept = {}
    (mesh,) = cover_ball(radius=5e-3, thickness=1e-3, sizes=(0.9e-3,), kept=kept).meshes()
    assert check_quality(mesh).through >= LIMITS.through
    assert 1 < len(kept) <= 4
    assert np.diff(np.log(list(kept))) == pytest.approx(np.log(0.85), rel=0.05)
