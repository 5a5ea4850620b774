"""Transfer between tensor meshes: what is exact, and that pressures keep to their region."""

from __future__ import annotations

import numpy as np
import pytest
import skfem
from hypothesis import given, settings
from hypothesis import strategies as st

from fem_reference.elements.taylor_hood import prepare_elements
from fem_reference.finite_strain.contact_problem import locate_pressures, transfer_state


def make_mesh(count, *, layers=1):
    """A square ring of `count` x `count` elements, in horizontal layers of different material."""
    lines = np.linspace(0.5, 1.5, count + 1), np.linspace(0, 1, count + 1)
    mesh = skfem.MeshQuad.init_tensor(*lines)
    region = (mesh.p[1][mesh.t].mean(axis=0) * layers).astype(int)
    return prepare_elements(mesh, region=region, axisymmetric=True)


def evaluate_field(elements, displacement, pressure):
    moved = np.stack([displacement(*elements.nodes.T), -displacement(*elements.nodes.T)], axis=1).ravel()
    return np.concatenate([moved, pressure(*locate_pressures(elements).T)])


@settings(max_examples=15, deadline=None)
@given(c=st.tuples(*[st.floats(-2, 2)] * 4), coarse=st.integers(1, 4), fine=st.integers(1, 6))
def test_bilinear_fields_are_transferred_exactly(c, coarse, fine):
    def field(r, z):
        return c[0] + c[1] * r + c[2] * z + c[3] * r * z

    source, target = make_mesh(coarse), make_mesh(fine)
    found = transfer_state(source, target, evaluate_field(source, field, field))
    assert found == pytest.approx(evaluate_field(target, field, field), abs=1e-7)


def test_pressure_keeps_its_jump_between_regions():
    source, target = make_mesh(2, layers=2), make_mesh(4, layers=2)

    def jump(elements):
        state = np.zeros(elements.displacements + elements.pressures)
        for cells, region in zip(elements.pressure_cells, elements.region, strict=True):
            state[elements.displacements + cells] = 1.0 if region else -1.0
        return state

    assert transfer_state(source, target, jump(source)) == pytest.approx(jump(target))
