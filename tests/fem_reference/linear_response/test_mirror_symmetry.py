"""The quarter of a cover: texels by mirror images, element edges, and constraints by parity."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fem_reference.linear_response.finite_cover import (
    PARITIES,
    MirroredTexels,
    Resolution,
    constrain_parity,
    mesh_quarter,
)
from meshes import TexelArray


@given(columns=st.integers(1, 6), rows=st.integers(1, 6), pitch=st.floats(1e-3, 5e-3), thickness=st.floats(1e-3, 5e-3))
def test_mirrored_spans_give_every_texel_back(columns, rows, pitch, thickness):
    array = TexelArray.grid(rows, columns, (pitch, 1.3 * pitch), texel_size=(0.9 * pitch, pitch))
    texels = MirroredTexels.group(array, thickness)
    for axis in (0, 1):
        span = texels.spans[axis][texels.pairs[texels.pair, axis]] * thickness
        assert texels.side[:, axis] * span.mean(axis=1) == pytest.approx(array.centres[:, axis], abs=1e-11)
        assert np.diff(span, axis=1)[:, 0] == pytest.approx(np.full(array.count, array.texel_size[axis]))
    assert len(texels.pairs) == -(-columns // 2) * -(-rows // 2)


@pytest.mark.parametrize("parity", PARITIES)
@pytest.mark.parametrize("base", ["bonded", "sliding"])
def test_constrained_unknowns_have_unit_rows_and_leave_a_regular_matrix(bonded, parity, base):
    array = TexelArray.grid(2, 2, 2e-3)
    solid = mesh_quarter(bonded(0.45, size=(5e-3, 5e-3), base=base), array, Resolution(across=0.8, through=1))
    upper = solid.assemble_upper()
    matrix, constrained = constrain_parity(solid, upper, parity, sliding=base == "sliding")
    full = matrix.toarray()
    full += np.triu(full, 1).T
    assert (full[constrained] == np.eye(len(full))[constrained]).all()
    assert np.linalg.cond(full) < 1e6
    # displacements along z of a load that is odd vanish on the plane of symmetry, those of an even one do not
    normal = constrained[solid.offsets[2] : solid.offsets[3]].reshape(solid.field_shape(2))
    assert normal[0].all() == bool(parity[0])
    assert normal[:, 0].all() == bool(parity[1])
