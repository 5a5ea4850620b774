"""Covers of tetrahedra in a shell, whose meshes are kept."""

import numpy as np
import pytest
import trimesh

from meshes.catalogue import MATERIALS
from meshes.solids.covers import make_shell_cover
from meshes.solids.shell import thicken
from meshes.solids.solid_mesh import check_quality, measure_area
from meshes.surfaces.smooth import smooth_surface

pytest.importorskip("pytetwild")


def cover_ball(*, element_size, kept):
    """Make the cover of a ball, whose coarse meshes are kept in a dictionary by their element size."""
    ball = smooth_surface(np.array(trimesh.creation.icosphere(subdivisions=1, radius=10e-3).triangles), 1e-5)[0]
    shell = thicken(ball, 2e-3, "ball", inward=True)

    def keep(inputs, compute):
        if inputs["size"] not in kept:
            kept[inputs["size"]] = compute()
        return kept[inputs["size"]]

    return make_shell_cover(shell, MATERIALS["tpu"], "ball", keep, element_size=element_size)


@pytest.mark.slow
def test_a_kept_mesh_is_refined_once_and_both_have_the_sizes_of_the_ball():
    kept = {}
    first, second = (cover_ball(element_size=1.7e-3, kept=kept) for _ in range(2))
    coarse, fine = first.meshes()
    assert len(fine.cells) == 8 * len(coarse.cells)
    assert [mesh.digest for mesh in second.meshes()] == [coarse.digest, fine.digest]
    for mesh in (coarse, fine):
        check_quality(mesh).require()
        assert measure_area(mesh, "top") == pytest.approx(4 * np.pi * 10e-3**2, rel=3e-3)
        assert measure_area(mesh, "base") == pytest.approx(4 * np.pi * 8e-3**2, rel=5e-3)


@pytest.mark.slow
def test_elements_that_are_too_small_are_refused_before_the_mesher_starts():
    with pytest.raises(ValueError, match=r"element_size: 0.2 mm would make .* take larger elements"):
        cover_ball(element_size=0.2e-3, kept={}).meshes()
