"""Where a calibration starts and what it expects: starts, bounds and Gaussian priors of its parameters, by hand."""

import numpy as np
import pytest

from meshes import Box, Sphere, TexelArray
from validation.calibration.contact import Pose
from validation.calibration.observations import Observations, Placement
from validation.calibration.parameters import Layout, Options

ARRAY = TexelArray.grid(2, 3, pitch=(4e-3, 3e-3))
BLOCK = Placement(name="block", indenter=Box(size=(6e-3, 4e-3, 5e-3)), tilt=None)
BALL = Placement(name="ball", indenter=Sphere(radius=4e-3), at=(1e-3, 0.0))


@pytest.fixture
def seen():
    """Two images: slopes of 110 and 95 counts/N with the thresholds added; one texel was not measured, one is dark."""
    counts = np.array([[10.0, 20, 30, 40, 0, 999], [30, 40, 50, 60, 0, 999]])
    return Observations(
        loads=np.array([1.0, 2.0]), counts=counts, measured=counts < 900, placements=(BLOCK, BALL), groups=("1", "2"),
        temperatures=np.array([20.0, 24.0]), ages=np.array([np.nan, 30.0]), thresholds=np.array([2.5, 2.5]),
    )  # fmt: skip


def lay_out(seen, **options):
    guesses = {BLOCK: Pose(1e-3, 2e-3, 0.4, 0.01, 0.0), BALL: Pose(1e-3, 0.0)}
    layout = Layout.build(seen, Options(temperature=False, **options), ARRAY, guesses, None)
    keys = ("start", "lower", "upper", "scale", "centre", "prior")
    rows = np.array([getattr(layout, key) for key in keys]).T
    return layout, {name: dict(zip(keys, row, strict=True)) for name, row in zip(layout.names, rows, strict=True)}


def test_poses_stay_near_the_array_and_turns_are_expected_small(seen):
    _, rows = lay_out(seen)
    assert [name for name in rows if "block" in name] == [
        f"block {part}" for part in ("x", "y", "yaw", "tilt x", "tilt y")
    ]
    assert not any("ball" in name for name in rows)
    x, y, yaw, tilt = (rows[f"block {part}"] for part in ("x", "y", "yaw", "tilt x"))
    for row, start, limit, scale in ((x, 1e-3, 4e-3 + 4e-3, 4e-3), (y, 2e-3, 1.5e-3 + 3e-3, 3e-3)):
        assert row == pytest.approx(
            {"start": start, "lower": -limit, "upper": limit, "scale": scale, "centre": 0, "prior": 0}
        )
    assert yaw == pytest.approx(
        {"start": 0.4, "lower": -np.pi / 2, "upper": np.pi / 2, "scale": 0.1, "centre": 0, "prior": 0.3**-2}
    )
    assert tilt == pytest.approx(
        {"start": 0.01, "lower": -0.1, "upper": 0.1, "scale": 0.01, "centre": 0, "prior": 0.02**-2}
    )


def test_gains_of_lit_texels_are_expected_near_one(seen):
    layout, rows = lay_out(seen)
    assert layout.gain_texels.tolist() == [0, 1, 2, 3]
    assert [name for name in rows if name.startswith("gain") and name[4:].isdigit()] == [
        "gain0",
        "gain1",
        "gain2",
        "gain3",
    ]
    assert rows["gain2"]["start"] == rows["gain2"]["centre"] == 0


def test_the_first_curve_is_a_line_through_the_sums_without_saturation(seen):
    curve = lay_out(seen)[0].fixed
    assert curve.sensitivity == pytest.approx((110 + 95) / 2)
    assert (curve.dead_force, curve.gain_temperature, curve.dead_temperature, curve.creep) == (0, 0, 0, 0)
    assert (curve.reference_temperature, curve.reference_age) == (22, 30)
    assert (curve.output_max, curve.saturation_band) == (np.inf, 0)
    assert (curve.gains == 1).all()
    assert (curve.heights == 0).all()
    assert lay_out(seen, output_max=None)[0].fixed.output_max == pytest.approx(1.05 * 60)


def test_only_the_level_is_fitted_where_indenters_are_placed(seen):
    layout, rows = lay_out(seen, placing=True)
    assert [name for name in rows if "block" not in name] == ["ln_sensitivity"]
    level = rows["ln_sensitivity"]
    assert level["start"] == level["centre"] == pytest.approx(np.log(102.5))
    assert level["prior"] > 0
    assert layout.gain_texels.size == layout.height_texels.size == 0
