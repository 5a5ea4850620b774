import math

import pytest

from meshes import Box, RoundedTip, Sphere
from meshes.indenter import SHAPES
from validation.errors import InputError
from validation.indenter_text import _EXAMPLES, read_indenter, read_position, read_yaw


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_has_an_example_that_is_accepted(shape):
    assert isinstance(read_indenter(_EXAMPLES[shape]), SHAPES[shape])


def test_lengths_are_si():
    assert read_indenter("sphere:radius=5mm") == Sphere(radius=5e-3)
    assert read_indenter("box:size=10mmx8mmx5mm") == Box(size=(10e-3, 8e-3, 5e-3))
    assert read_indenter("tip") == RoundedTip(radius=1e-3)


def test_pose():
    assert read_position("0.7mm,-1.1mm") == pytest.approx((0.7e-3, -1.1e-3))
    assert read_yaw("-31deg") == pytest.approx(math.radians(-31))


def test_all_faults_of_one_indenter_at_once():
    with pytest.raises(InputError) as caught:
        read_indenter("box:sise=1mm,size=3mm")
    assert len(caught.value.faults) == 2
    assert "did you mean 'size'" in caught.value.faults[0]
    assert "write for example '2mmx2mmx2mm'" in caught.value.faults[1]
