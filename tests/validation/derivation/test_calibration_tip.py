"""A characteristic that was calibrated through the cover gives its own line back when the calibration is repeated."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import WTS_0614_34, Electronics
from fem_reference.closed_form.contact import indent as indent_exactly
from meshes import Pose, RoundedTip
from validation.derivation.contact_range import compute_tip_share, find_middle, find_saturation
from validation.sensor_file import BUILT_IN

#: Forces on the tip over the range of the published line, which is zero at 0.185 N and saturates at 1.646 N [N].
LOADS = np.linspace(0.2, 1.64, 7)
LINE = 2665.7 * LOADS - 493.87
COVER = BUILT_IN["wts-0614-34"].cover


@pytest.fixture(scope="module")
def under_the_tip():
    """Exact forces on all texels, by integral equations, under a tip over the middle texel."""
    array = BUILT_IN["wts-0614-34"].array
    centre = tuple(array.centres[array.middle, :2])
    tip = RoundedTip(radius=1e-3)
    return np.array([indent_exactly(COVER, tip, load=load).texel_forces(array, centre) for load in LOADS])


@pytest.mark.slow
def test_a_calibration_through_the_cover_gives_back_the_line(under_the_tip):
    parameters = fastmodel.load("wts-0614-34")
    counts = parameters.electronics.counts(under_the_tip)[:, parameters.array.middle]
    # within 1 % of the full scale: the share falls from 0.785 to 0.759 over the range
    np.testing.assert_allclose(counts, LINE, atol=0.01 * 3895)
    # the force on the texel itself, without the share, is a quarter too dark
    dark = dataclasses.replace(parameters.electronics, calibrated="texel force", tip_share=None)
    assert (dark.counts(under_the_tip)[:, parameters.array.middle] < 0.8 * LINE).all()


def test_derive_finds_the_share_of_the_tip_and_says_so(wts_derivation, under_the_tip):
    texel = wts_derivation.sensor.array.middle
    forces = under_the_tip[:, texel]
    tip = wts_derivation.tip
    assert tip.share == pytest.approx(LOADS @ forces / (LOADS @ LOADS), abs=0.002)
    assert (tip.lightest, tip.heaviest) == pytest.approx((0.797, forces[-1] / LOADS[-1]), abs=1e-3)
    assert (tip.radius, tip.largest_load, tip.saturation_load) == pytest.approx((1e-3, 1.6464, 1.6464), rel=1e-3)
    assert wts_derivation.parameters.electronics.tip_share == tip.share
    assert wts_derivation.parameters.provenance["calibration_tip"]["share"] == tip.share
    told = wts_derivation.result.as_json()["calibration"]
    assert told["calibrated"] == "through the cover, tip 1 mm"
    assert told["tip"]["share"] == tip.share


@pytest.mark.slow
def test_the_share_is_that_of_the_tip_that_was_used(wts_derivation):
    sensor = wts_derivation.sensor
    found = compute_tip_share(
        sensor.cover, sensor.array, wts_derivation.influence, radius=2.5e-3, saturation=find_saturation(WTS_0614_34)
    )
    assert found.radius == 2.5e-3
    assert found.share < wts_derivation.tip.share - 0.02


@pytest.mark.slow
def test_a_tip_that_leaves_nothing_on_a_texel_is_named_with_the_remedy():
    from fem_reference import point_spread

    sensor = BUILT_IN["wts-0614-34"]
    thick = dataclasses.replace(COVER, layers=(dataclasses.replace(COVER.layers[0], thickness=1.0),))
    with pytest.raises(ValueError, match="a cover of 1000 mm puts too little of the tip's force on a texel; give"):
        compute_tip_share(thick, sensor.array, point_spread(thick), radius=1e-3, saturation=None)


def test_a_calibration_in_mujoco_gives_back_the_line_as_far_as_cells_resolve_the_tip():
    """Four cells of the fast model carry the tip; they spread its force a little wider than the tip does."""
    parameters = fastmodel.load("wts-0614-34")
    texel = parameters.array.middle
    centre = tuple(parameters.array.centres[texel, :2])
    for load in (0.5, 1.5):
        spec = mujoco.MjSpec()
        fastmodel.recommend_options(spec)
        sensor = fastmodel.attach(spec, "world", parameters)
        fastmodel.add_indenter(spec, RoundedTip(radius=1e-3), load, at=centre)
        model = spec.compile()
        data = mujoco.MjData(model)
        sensor.bind(model)
        for _ in range(300):
            mujoco.mj_step(model, data)
            sensor.step(data)
        counts = sensor.frame().counts[texel]
        # 3.8 % of the applied force is missing; without the share it would be 26 %
        assert (counts + 493.87) / 2665.7 == pytest.approx(load, rel=0.045)


def test_saturation_is_where_the_characteristic_reaches_the_largest_count():
    assert find_saturation(WTS_0614_34) == pytest.approx((3895 + 493.87) / 2665.7)
    firmware = Electronics(rate_hz=100.0, sensitivity=1000.0, output_max=900, threshold=100.0)
    assert find_saturation(firmware) == pytest.approx(1.0)
    square = Electronics(rate_hz=1.0, sensitivity=1.0, characteristic=(0, 0, 1000.0, 0, 0, 0), output_max=4000)
    assert find_saturation(square) == pytest.approx(2.0)
    assert find_saturation(dataclasses.replace(square, characteristic=(0, 1.0, -1.0, 0, 0, 0))) is None


@pytest.mark.bench
@pytest.mark.slow
def test_with_free_side_edges_the_share_is_that_of_the_cover_itself():
    from fem_reference.indentation.press import press
    from fem_reference.linear_response.finite_cover import solid_influence
    from meshes import TexelArray

    array = TexelArray.grid(2, 2, 3.4e-3)
    cover = dataclasses.replace(COVER, size=(7.2e-3, 7.2e-3))
    saturation = find_saturation(WTS_0614_34)
    tip = compute_tip_share(cover, array, solid_influence(cover, array), radius=1e-3, saturation=saturation)
    texel = find_middle(array)
    at = tuple(array.centres[texel, :2])
    reference = (
        press(cover, array, RoundedTip(radius=1e-3), load=0.8, pose=Pose.planar(at=at)).texel_forces.ravel()[texel]
        / 0.8
    )
    assert tip.heaviest < reference < tip.lightest
    assert tip.share == pytest.approx(reference, abs=0.01)
