"""Blocks under an indenter: symmetry, mesh lines, constraints, and the base pressure from reactions."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.finite_strain.block_path import (
    BlockState,
    describe_state,
    find_constrained,
    lay_out_block,
    mesh_block,
    recover_gauss_pressure,
    recover_nodal_pressure,
)
from fem_reference.finite_strain.contact_problem import ContactEquilibrium
from fem_reference.finite_strain.loading_path import LoadingPath, Units
from meshes import Box, Roller
from tests.support.rubber import make_cover

COVER = make_cover(0.45)
UNITS = Units.of(COVER)


def lay_out(shape, count=2):
    path = LoadingPath(cover=COVER, indenter=shape, targets=(1e-4,), control="depth")
    return lay_out_block(path, elements_per_thickness=count, contact_half=shape.footprint, fillet=0.4e-3, reach=15e-3)


def make_state(lines, forces, symmetric=(False, False)):
    return BlockState(
        depth=1e-4,
        load=1.0,
        area=1e-6,
        overlap=0.0,
        lines=lines,
        forces=forces,
        symmetric=symmetric,
        contact=np.empty((0, 5)),
        energy=0.0,
    )


class Wedge:
    """A surface that rises along x."""

    axisymmetric = False
    is_flat = False
    mirror_symmetry = (False, True)
    footprint = (1e-3, 1e-3)

    def gap(self, x, y):
        return 0.1 * (x + 1e-3) + 0 * y


def test_half_a_symmetric_side_is_meshed_and_all_of_another():
    block = lay_out(Wedge())
    assert block.symmetric == (False, True)
    assert block.sides[0] == pytest.approx(-block.sides[0][::-1])
    assert block.sides[1][0] == 0
    assert block.multiple == 2


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


@pytest.mark.parametrize("shape", [Box(size=(6e-3, 6e-3, 5e-3)), Roller(radius=3e-3, length=6e-3)])
@pytest.mark.parametrize("count", [2, 3, 4])
def test_every_reaction_belongs_to_the_node_it_acts_on(shape, count):
    """Nodes on one mesh line differ by rounding; a reaction must not move to a neighbouring node for that."""
    block = lay_out(shape, count)
    elements = mesh_block(block, UNITS.scale_cover(COVER), count)
    x, y, _ = elements.nodes.T
    reaction = np.zeros(elements.displacements + elements.pressures)
    reaction[2 : elements.displacements : 3] = 10 * x + y
    contact = SimpleNamespace(
        area=0.0,
        overlap=0.0,
        pressure=np.zeros((1, 1)),
        weight=np.ones((1, 1)),
        position=np.zeros((1, 1, 3)),
        traction=None,
    )
    reached = ContactEquilibrium(
        state=np.zeros_like(reaction), depth=0.1, load=1.0, reaction=reaction, iterations=1, contact=contact
    )
    solid = SimpleNamespace(elements=elements, energy=lambda _: 0.0)
    state = describe_state(solid, UNITS, reached, block)
    expected = 10 * state.lines[0][:, None] + state.lines[1]
    assert state.forces / UNITS.force == pytest.approx(expected / UNITS.length, abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), symmetric=st.tuples(st.booleans(), st.booleans()))
def test_nodal_pressure_integrates_to_the_reactions_and_is_mirrored(seed, symmetric):
    rng = np.random.default_rng(seed)
    edges = [np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, n))]) for n in (4, 3)]
    lines = tuple(np.sort(np.concatenate([e, (e[1:] + e[:-1]) / 2])) for e in edges)
    forces = rng.standard_normal((9, 7))
    x, y, pressure = recover_nodal_pressure(make_state(lines, forces, symmetric))
    total = _integrate(x) @ pressure @ _integrate(y)
    assert total == pytest.approx(forces.sum() * (1 + symmetric[0]) * (1 + symmetric[1]))
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
    x, y, pressure = recover_gauss_pressure(make_state((nodes, nodes), mass @ value @ mass))
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
