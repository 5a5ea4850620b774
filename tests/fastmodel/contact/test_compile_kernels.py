"""What `compile_kernels` lets a contact method see: one contact and then several, on the front of the array."""

import dataclasses

import mujoco
import numpy as np
import pytest

from fastmodel import BoxTexels, Plate
from fastmodel.contact.interface import TexelContact, compile_kernels
from meshes import TexelArray
from tests.support.bent_array import bent_array
from tests.support.cover_data import cells

ELLIPTIC, PYRAMIDAL = mujoco.mjtCone.mjCONE_ELLIPTIC, mujoco.mjtCone.mjCONE_PYRAMIDAL


def record(geoms):
    """A contact method with boxes or plates, of a type of its own, and what its readers are given."""
    bound, seen = [], []

    class Reader:
        def __init__(self, model):
            self._model = model

        def read(self, data):
            ids = data.contact.geom.ravel()
            names = {self._model.geom(each).name for each in ids} - {""}
            seen.append((data.ncon, names, data.xpos[1:].copy(), data.time))

    class Recorder(TexelContact):
        def attach(self, frame, array, name):
            geoms.attach(frame, array, name)

        def bind(self, model, array, name, *, surface=None):
            bound.append((model.opt.cone, surface, name))
            return Reader(model)

    return Recorder(), bound, seen


@pytest.mark.parametrize("surface", [None, cells()], ids=["bare", "covered"])
@pytest.mark.parametrize("array", [TexelArray.grid(2, 3, (2e-3, 5e-3)), bent_array()], ids=["flat", "bent"])
def test_a_reader_sees_one_contact_and_then_several(array, surface):
    """Bodies fall along the normal of the first texel, half a pitch large, from above the cover or from its top."""
    method, bound, seen = record(Plate(height=1e-3))
    compile_kernels(method, array, surface, ELLIPTIC)
    assert bound == [(ELLIPTIC, surface, "array")]
    counts = [ncon for ncon, *_ in seen]
    assert 1 in counts
    assert counts.index(1) < next(k for k, each in enumerate(counts) if each > 1)
    assert [each > 1 for each in counts[-3:]] == [True, True, False]
    assert counts[-1] == 1  # the last state is read twice, the second time with one contact
    assert seen[-2][3] == seen[-1][3]
    assert len(seen) < 301
    names = set.union(*(each[1] for each in seen))
    assert names
    assert all(each.startswith("array/plate") for each in names)
    places = (seen[0][2] - array.centres[0]) @ array.normals[0]
    top = 0.5 * min(array.pitch) + (2e-3 if surface else 0)
    np.testing.assert_allclose(places, [top, top + 1e-3], atol=5e-5)
    beside = seen[0][2] - array.centres[0] - np.outer(places, array.normals[0])
    np.testing.assert_allclose(beside, 0, atol=1e-12)
    assert surface is None or counts[0] == 0


def test_a_method_is_compiled_once_for_each_kind_of_cover_array_and_cone():
    method, bound, _ = record(BoxTexels())
    flat, surface = TexelArray.grid(2, 2, 3e-3), cells()
    for _ in range(2):
        compile_kernels(method, flat, None, ELLIPTIC)
    assert len(bound) == 1
    other = dataclasses.replace(flat, centres=flat.centres * 1.4)  # of the same kind as the bent one: not regular
    for array, cover, cone, count in (
        (flat, None, PYRAMIDAL, 2),
        (flat, surface, ELLIPTIC, 3),
        (bent_array(), None, ELLIPTIC, 4),
        (other, None, ELLIPTIC, 4),
        (flat, surface, ELLIPTIC, 4),
        (TexelArray.grid(3, 2, 4e-3), None, PYRAMIDAL, 4),
    ):
        compile_kernels(method, array, cover, cone)
        assert len(bound) == count
    again, anew, _ = record(BoxTexels())
    compile_kernels(again, flat, None, ELLIPTIC)
    assert len(anew) == 1
    assert not np.any([name != "array" for *_, name in bound])
