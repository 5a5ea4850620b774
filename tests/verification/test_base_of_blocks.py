"""Blocks of limited size: moments of the base pressure under normal loads and shear, blocks of loads, and fields."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import result_store
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation.linear_fields import solve_linear_fields
from fem_reference.linear_response import finite_cover
from fem_reference.linear_response.finite_cover import Resolution, SolidInfluence, solid_influence, solve_adjoint
from meshes import Box, TexelArray
from meshes.pose import Place, Pose
from tests.support.rubber import stack_layers

H = 2e-3
SIZE = (6e-3, 4e-3)
COVER = stack_layers((1.2e-3, 1e6, 0.4), (0.8e-3, 2e6, 0.3), size=SIZE)
#: Texels that cover the whole base.
WHOLE = TexelArray.grid(8, 12, (0.5e-3, 0.5e-3))


@pytest.fixture(scope="module")
def solved():
    return SolidInfluence(
        cover=COVER, array=WHOLE, grids=(solve_adjoint(COVER, WHOLE, Resolution(across=1.0, through=2)),)
    )


def measure(solved, loads, x=(-2.1e-3, 0.4e-3, 1.7e-3), y=(-1.2e-3, 0.9e-3)):
    """Texel forces, and force and moments of the base as sums over texels."""
    felt = solved.base_forces(WHOLE, np.array(x), np.array(y), loads)
    return felt, felt[:-1].sum(), felt[:-1] @ WHOLE.centres[:, :2]


def test_force_and_moments_of_loads_arrive_at_the_base(solved):
    """A normal load keeps its place on average, and a shear has the thickness of the cover as its lever."""
    x, y, rng = np.array([-2.1e-3, 0.4e-3, 1.7e-3]), np.array([-1.2e-3, 0.9e-3]), np.random.default_rng(8)
    loads = rng.uniform(-1, 1, (3, 3, 2))
    felt, force, moments = measure(solved, loads[0])
    assert force == pytest.approx(loads[0].sum(), abs=1e-8)
    assert felt[-1] == pytest.approx(0.0, abs=1e-8)
    scale = H * np.abs(loads[0]).sum()
    assert moments == pytest.approx([(loads[0].sum(axis=1) @ x), (loads[0].sum(axis=0) @ y)], abs=0.02 * scale)
    for component in (1, 2):
        sheared = np.zeros_like(loads)
        sheared[component] = loads[component]
        _, force, moments = measure(solved, sheared)
        exact = np.zeros(2)
        exact[component - 1] = H * loads[component].sum()
        assert force == pytest.approx(0.0, abs=1e-8)
        assert moments == pytest.approx(exact, abs=0.02 * scale)
    together = measure(solved, loads)[0]
    parts = sum(measure(solved, np.where(np.arange(3)[:, None, None] == k, loads, 0.0))[0] for k in range(3))
    np.testing.assert_allclose(together, parts, atol=1e-12)


@pytest.mark.parametrize("size", [1, 2, 4000])
def test_loads_are_summed_in_blocks_and_masked_texels_count_as_outside(solved, size, monkeypatch):
    monkeypatch.setattr(finite_cover, "_SETTINGS", replace(finite_cover.FiniteCoverSettings(), block=size))
    x, y = np.array([-2.1e-3, 0.4e-3, 1.7e-3]), np.array([-1.2e-3, 0.9e-3])
    loads = np.array([[1.0, 0.0], [0.3, -0.7], [0.0, 0.2]])
    places = np.array([(a, b) for a in x for b in y])
    masked = replace(WHOLE, active=np.arange(96) % 5 != 0)
    exact = loads.ravel() @ solved.texel_influence(masked, places)
    found = solved.base_forces(masked, x, y, loads)
    np.testing.assert_allclose(found[:-1], exact, atol=1e-12)
    assert found[-1] == pytest.approx(loads.sum() - exact.sum(), abs=1e-8)
    assert found[-1] == pytest.approx(loads.ravel() @ solved.outside(masked, places), abs=1e-8)


def test_three_grids_are_solved_coarsest_first_and_reported(monkeypatch):
    grids = tuple(Resolution(across=each, through=1) for each in (0.5, 1.0, 2.0))
    monkeypatch.setattr(finite_cover, "GRIDS", grids)
    monkeypatch.setattr(finite_cover, "_SETTINGS", replace(finite_cover.FiniteCoverSettings(), many=600))
    monkeypatch.setattr(result_store, "fetch", lambda _kind, _inputs, compute: compute())
    told = []
    one = TexelArray.grid(1, 1, 3e-3)
    found = solid_influence(COVER, one, progress=told.append)
    assert [text.endswith("minutes") for text in told] == [False, False, True]
    assert len(found.grids[0].x.edges) < len(found.grids[2].x.edges)
    for text, grid in zip(told, found.grids, strict=True):
        # The base is fixed: each of two layers has two nodes of its one element along z that move.
        unknowns = 3 * (2 * len(grid.x.edges) - 1) * (2 * len(grid.y.edges) - 1) * 5
        assert f"1 elements through the cover, {unknowns} unknowns" in text
        assert text.endswith("this takes minutes") is (unknowns > 600)
    for number, each in enumerate(found.on_grids):
        assert each.grids == (found.grids[number],)
    at = np.array([[0.0, 0.0], [1e-3, -1.5e-3]])
    np.testing.assert_allclose(found.on_grids[2].texel_influence(one, at), found.texel_influence(one, at))


def test_fields_of_a_sliding_column_under_even_pressure_are_those_of_a_bar():
    """Stress along z alone, equal to the pressure at every height, and the strains of it."""
    size, young, nu, mean = (3e-3, 2e-3), 1e6, 0.3, 5e3
    cover = stack_layers((H, young, nu), size=size, base="sliding")
    axes = [(np.arange(n) + 0.5) / n * edge - edge / 2 for n, edge in zip((24, 16), size, strict=True)]
    x, y = (each.ravel() for each in np.meshgrid(*axes, indexing="ij"))
    pose = Pose.planar(yaw=np.pi / 2)
    force = np.full(x.size, mean * size[0] * size[1] / x.size)
    contact = np.column_stack([*pose.to_indenter(x, y), force])
    path = LoadingPath(cover=cover, indenter=Box(size=(3e-3, 3e-3, 1e-3)), targets=(1e-4,), control="depth")
    fields = solve_linear_fields(path, contact, Place(array=WHOLE, pose=pose), depth=1e-4)
    x, y, z = fields.position.T
    assert (x.min(), x.max(), y.min(), y.max()) == pytest.approx((-1.5e-3, 1.5e-3, -1e-3, 1e-3))
    strain = mean / young
    moved = strain * np.column_stack([nu * x, nu * y, -z])
    np.testing.assert_allclose(fields.displacement, moved, atol=0.02 * strain * H)
    inner = (np.abs(x) < 1.2e-3) & (np.abs(y) < 0.8e-3) & (z < 0.8 * H)
    exact = np.broadcast_to(np.diag([0.0, 0.0, -mean]), (inner.sum(), 3, 3))
    np.testing.assert_allclose(fields.stress[inner], exact, atol=0.02 * mean)
