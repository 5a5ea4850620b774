"""A small pad with free sides on one coarse mesh, as a sensor with a curved cover."""

import dataclasses

import pytest

from meshes.solids import flat_pad
from validation.curved.body import CoverBody
from validation.sensor_file import CURVED


@pytest.fixture(scope="session")
def small_pad():
    pad = flat_pad(size=(9e-3, 9e-3), rows=3, pitch=3e-3)
    body = CoverBody(source="small pad", thickness=pad.thickness, make=lambda *_: (pad.mesh(1.5e-3, layers=2),))
    return dataclasses.replace(CURVED["flat-pad"], name="small pad", array=pad.texels, body=body)
