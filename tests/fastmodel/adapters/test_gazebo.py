import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastmodel import WTS_0614_34, Butterworth, FastModelError, Gaussian, Parameters
from fastmodel.adapters.gazebo import write_block
from fastmodel.signal.electronics import Electronics
from meshes import TexelArray
from meshes.catalogue import ARRAYS
from tests.support.plugin_block import read_block

WTS = Parameters(
    array=ARRAYS["wts-0614-34"],
    spread=Gaussian(sigma_x=0.6, sigma_y=0.7, ksize_x=5, ksize_y=5),
    electronics=WTS_0614_34,
    filter=Butterworth(cutoff_hz=30.0, order=4),
)


def test_the_reports_own_spelling_and_numbers():
    text = write_block(WTS)
    names = (
        "rows columns rangeMin rangeMax satMin satMax tactile_rate liniaritySensibility liniarityOfset dataTopicName"
    )
    names += " imageTopicName cutFrequency orderFilter sigmax sigmay ksizex ksizey"
    assert [line.split(">")[0].strip(" <") for line in text.splitlines()[1:-1]] == names.split()
    assert "<liniarityOfset>-493.87</liniarityOfset>" in text
    # zero below 0.185 N, saturated from 1.646 N
    assert float(text.split("<rangeMin>")[1].split("<")[0]) == pytest.approx(0.185, abs=5e-4)
    assert float(text.split("<rangeMax>")[1].split("<")[0]) == pytest.approx(1.646, abs=5e-4)
    assert "<dataTopicName>tactile/data</dataTopicName>" in text


def test_the_line_in_the_block_is_that_of_the_force_on_a_texel():
    known = dataclasses.replace(WTS_0614_34, tip_share=0.8)
    text = write_block(dataclasses.replace(WTS, electronics=known))
    back = read_block(text, pitch=3.4e-3).electronics
    forces = np.linspace(0, 2, 40)
    np.testing.assert_array_equal(back.counts(forces), known.counts(forces))
    assert (back.calibrated, back.sensitivity) == ("texel force", pytest.approx(2665.7 / 0.8))
    assert float(text.split("<rangeMin>")[1].split("<")[0]) == pytest.approx(0.8 * 0.185, abs=5e-4)
    assert 'calibrated="through the cover, tip 1 mm"' in write_block(WTS)


def test_parameters_that_the_block_cannot_hold_are_named():
    bent = dataclasses.replace(WTS_0614_34, characteristic=(0, 1, 0, 0, 0, 0))
    with pytest.raises(FastModelError, match="straight line; no texel may be masked"):
        write_block(dataclasses.replace(WTS, array=ARRAYS["sdh2-distal"], electronics=bent))


@given(
    st.integers(1, 30),
    st.integers(1, 30),
    st.builds(Gaussian.from_sigma, st.floats(0.05, 5), st.floats(0.05, 5)),
    st.none() | st.builds(Butterworth, cutoff_hz=st.floats(1e-3, 1e3), order=st.integers(1, 20)),
    st.builds(
        Electronics,
        rate_hz=st.floats(1e-2, 1e4),
        sensitivity=st.floats(1e-3, 1e6),
        offset=st.floats(-1e4, 1e4),
        output_max=st.integers(1, 4095),
    ),
)
def test_any_block_is_read_back_exactly(rows, columns, spread, low_pass, electronics):
    written = Parameters(
        array=TexelArray.grid(rows, columns, 2e-3),
        spread=spread,
        electronics=electronics,
        filter=low_pass,
    )
    back = read_block(write_block(written), pitch=2e-3)
    assert (back.spread, back.filter, back.electronics) == (written.spread, written.filter, written.electronics)
    np.testing.assert_array_equal(back.array.centres, written.array.centres)
