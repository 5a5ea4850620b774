"""Blocks under an indenter: symmetry, mesh lines, constraints, and the base pressure from reactions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.finite_strain.block_path import (
    BlockReactions,
    GaussBase,
    find_constrained,
    lay_out_block,
    mesh_block,
)
from fem_reference.finite_strain.loading_path import LoadingPath, Units
from meshes import Box, TexelArray
from meshes.pose import Pose
from tests.support.rubber import make_cover

COVER = make_cover(0.45)
UNITS = Units.of(COVER)


def lay_out(shape, count=2):
    path = LoadingPath(cover=COVER, indenter=shape, targets=(1e-4,), control="depth")
    return lay_out_block(path, elements_per_thickness=count, contact_half=shape.footprint, fillet=0.4e-3, reach=15e-3)


def recover(lines, forces, *, symmetric=(False, False), free=True):
    """The base pressure at points along x and y."""
    found = BlockReactions(
        lines=lines, forces=forces, contact=np.empty((0, 5)), symmetric=symmetric, pose=Pose(), free=free
    ).recover_base()
    return found, found.x, found.y, found.pressure


def test_base_sides_and_planes_of_symmetry_are_constrained():
    block = lay_out(Box(size=(4e-3, 4e-3, 4e-3)))
    elements = mesh_block(block, UNITS.scale_cover(COVER), 2)
    x, y, z = elements.nodes.T
    end = block.sides[0][-1]
    for bonded in (True, False):
        held = np.zeros(elements.displacements, dtype=bool)
        held[find_constrained(block, elements, bonded=bonded)] = True
        along_x, along_y, along_z = held.reshape(-1, 3).T
        across_x, across_y = x > end - 1e-6, y > end - 1e-6
        outer = (across_x | across_y) & bonded
        base = z < 1e-6
        assert (along_z == (base | outer)).all()
        assert (along_x == (across_x | outer | (base & bonded) | (x < 1e-6))).all()
        assert (along_y == (across_y | outer | (base & bonded) | (y < 1e-6))).all()


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), symmetric=st.tuples(st.booleans(), st.booleans()))
def test_nodal_pressure_integrates_to_the_reactions_and_is_mirrored(seed, symmetric):
    rng = np.random.default_rng(seed)
    edges = [np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, n))]) for n in (4, 3)]
    lines = tuple(np.sort(np.concatenate([e, (e[1:] + e[:-1]) / 2])) for e in edges)
    forces = rng.standard_normal((9, 7))
    base, x, y, pressure = recover(lines, forces, symmetric=symmetric)
    total = _integrate(x) @ pressure @ _integrate(y)
    assert total == pytest.approx(forces.sum() * (1 + symmetric[0]) * (1 + symmetric[1]))
    felt = base.forces(TexelArray.grid(2, 3, (0.7, 0.9)), Pose())
    assert felt.sum() == pytest.approx(total, abs=1e-9)
    if symmetric[0]:
        assert pressure == pytest.approx(pressure[::-1])
    if symmetric[1]:
        assert pressure == pytest.approx(pressure[:, ::-1])


@settings(max_examples=30, deadline=None)
@given(a=st.floats(-2, 2), b=st.floats(-2, 2), c=st.floats(-2, 2))
def test_a_bilinear_pressure_is_recovered_at_gauss_points(a, b, c):
    """Its nodal forces are computed by the elements' mass, and the pressure comes back from them."""
    nodes = np.linspace(0, 2, 9)
    value = 1 + a * nodes[:, None] + b * nodes + c * nodes[:, None] * nodes
    mass = _mass(nodes)
    _, x, y, pressure = recover((nodes, nodes), mass @ value @ mass, free=False)
    assert pressure == pytest.approx(1 + a * x[:, None] + b * y + c * x[:, None] * y, abs=1e-10)


def _mass(nodes):
    """Mass of quadratic elements between every other node."""
    out = np.zeros((len(nodes), len(nodes)))
    for first in range(0, len(nodes) - 2, 2):
        length = nodes[first + 2] - nodes[first]
        block = np.array([[4, 2, -1], [2, 16, 2], [-1, 2, 4]]) / 30
        out[first : first + 3, first : first + 3] += length * block
    return out


def _integrate(nodes):
    """Simpson weights of quadratic elements, shape (n,)."""
    return _mass(nodes).sum(axis=0)


ARRAY = TexelArray.grid(2, 3, (4e-3, 5e-3), active=np.arange(6) != 4, texel_size=(3e-3, 4.4e-3))


def pressure(x, y):
    return 1e3 * (2 + 100 * x - 50 * y + 2e4 * x * y + 3e4 * x**2)


@pytest.mark.parametrize("pose", [Pose.planar(at=(0.3e-3, -0.2e-3), yaw=0.3), Pose.planar(at=(5e-3, 0.0))])
def test_a_polynomial_pressure_is_integrated_over_oblong_texels_and_the_rest(pose):
    grid = np.linspace(-8e-3, 8e-3, 21), np.linspace(-7e-3, 7e-3, 15)
    felt = GaussBase(x=grid[0], y=grid[1], pressure=pressure(*np.meshgrid(*grid, indexing="ij"))).forces(ARRAY, pose)
    assert felt.shape == (7,)
    steps = [((np.arange(200) + 0.5) / 200 - 0.5) * edge for edge in ARRAY.texel_size]
    for force, centre, active in zip(felt, ARRAY.centres, ARRAY.active, strict=False):
        x, y = pose.to_indenter(*np.meshgrid(centre[0] + steps[0], centre[1] + steps[1]))
        inside = (np.abs(x) < 8e-3) & (np.abs(y) < 7e-3)
        expected = np.where(inside, pressure(x, y), 0.0).mean() * np.prod(ARRAY.texel_size)
        assert force == pytest.approx(expected if active else 0.0, rel=1e-4 if inside.all() else 0.08)
    whole = 1e3 * (2 * 16e-3 * 14e-3 + 3e4 * 14e-3 * 2 * (8e-3) ** 3 / 3)
    assert felt.sum() == pytest.approx(whole)
