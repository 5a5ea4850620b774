"""A small pad with free sides on one coarse mesh, as a sensor with a curved cover."""

import dataclasses

import pytest

from meshes.solids import flat_pad
from validation.sensor_file import CURVED


@pytest.fixture(scope="session")
def small_pad():
    pad = flat_pad(size=(9e-3, 9e-3), rows=3, pitch=3e-3)
    sensor = CURVED["flat-pad"]
    cover = dataclasses.replace(
        sensor.cover, source="small pad", make=lambda *_: (pad.mesh(1.5e-3, layers=2),), refine=None, _made={}
    )
    return dataclasses.replace(sensor, name="small pad", array=pad.texels, cover=cover)
