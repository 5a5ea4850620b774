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
    choose_grids,
    constrain_parity,
    mesh_quarter,
)
from fem_reference.linear_response.surface_compliance import decay_length
from meshes import TexelArray
from tests.support.rubber import stack_layers


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


def test_a_wide_cover_ends_twelve_decay_lengths_beyond_its_texels():
    """A foil on foam spreads loads over more than the thickness; the number of columns tells x and y apart."""
    cover = stack_layers((2e-3, 1e5, 0.3), (0.1e-3, 1e11, 0.3))
    array = TexelArray.grid(2, 3, (3e-3, 2e-3), texel_size=(2.4e-3, 1.6e-3))
    assert decay_length(cover) > 1.2 * cover.thickness
    x, y, _ = mesh_quarter(cover, array, Resolution(across=0.7, through=1)).lines
    far = 12 * decay_length(cover)
    assert (x.edges[-1], y.edges[-1]) == pytest.approx(
        ((3e-3 + 1.2e-3 + far) / cover.thickness, (1e-3 + 0.8e-3 + far) / cover.thickness)
    )
    for line, edges in ((x, (1.2e-3, 1.8e-3, 4.2e-3)), (y, (0.2e-3, 1.8e-3))):
        for edge in edges:
            assert np.abs(line.edges - edge / cover.thickness).min() < 1e-8


def test_an_array_too_large_for_the_memory_is_refused_with_its_unknowns(bonded):
    with pytest.raises(ValueError, match=r"the array is too large for the three-dimensional solution: \d{7,} unknowns"):
        choose_grids(bonded(0.3), TexelArray.grid(150, 150, 20e-3))
