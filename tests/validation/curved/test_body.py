"""Meshes of tetrahedra of a shell, kept in the store of results."""

import numpy as np
import pytest
import trimesh

from meshes.solids.shell import thicken
from meshes.solids.solid_mesh import LIMITS, check_quality
from validation.curved.body import CoverBody, mesh_shell

pytest.importorskip("pytetwild")


@pytest.mark.slow
def test_meshes_are_kept_and_given_from_coarse_to_fine(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    ball = trimesh.creation.icosphere(subdivisions=2, radius=10e-3)
    shell = thicken(np.array(ball.triangles), 2e-3, "ball", inward=True)
    # The larger size comes last.
    first, second = (
        CoverBody(
            source="ball", thickness=2e-3, make=lambda _, tell: mesh_shell(shell, "ball", (1.8e-3, 2.6e-3), 0.0, tell)
        )
        for _ in range(2)
    )
    meshes = first.meshes()
    counts = [len(mesh.cells) for mesh in meshes]
    assert counts == sorted(set(counts))
    assert [mesh.digest for mesh in second.meshes()] == [mesh.digest for mesh in meshes]


@pytest.mark.slow
def test_elements_that_are_too_few_through_the_thickness_are_made_smaller(tmp_path, monkeypatch):
    """Large triangles of a file make the mesher exceed the wanted size."""
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    ball = trimesh.creation.icosphere(subdivisions=2, radius=5e-3)
    shell = thicken(np.array(ball.triangles), 1e-3, "ball", inward=True)
    told = []
    (mesh,) = mesh_shell(shell, "ball", (0.9e-3,), 0.0, told.append)
    assert check_quality(mesh).through >= LIMITS.through
    sizes = [float(line.split()[2]) for line in told]
    assert 1 < len(sizes) <= 4
    assert np.diff(np.log(sizes)) == pytest.approx(np.log(0.85), rel=0.05)
