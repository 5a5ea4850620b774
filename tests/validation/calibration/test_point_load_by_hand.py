"""Lines of trials under a tip at the exact edges of saturation, and the texels and trials that are refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from meshes import RoundedTip, TexelArray
from validation.calibration import point_load
from validation.calibration.model import Observations, Placement
from validation.calibration.point_load import calibrate_point_load
from validation.sensor_file import load

WTS = load("wts-0614-34")
SENSOR = replace(WTS, array=TexelArray.grid(1, 3, 3e-3, active=[[1, 1, 0]]))


def observe(trials):
    """Images of rows of loads and counts of the second texel, by the name of the trial."""
    rows = [(name, newtons, count) for name, (loads, counts) in trials.items()
            for newtons, count in zip(loads, counts, strict=True)]  # fmt: skip
    counts = np.zeros((len(rows), 3))
    counts[:, 1] = [count for *_, count in rows]
    counts[:, 0] = 5000.0  # a neighbour that does not count
    nothing = np.full(len(rows), np.nan)
    tip = Placement(name="tip", indenter=RoundedTip(radius=1e-3), at=(0.0, 0.0), yaw=0.0)
    seen = Observations(
        loads=np.array([newtons for _, newtons, _ in rows]), counts=counts, measured=counts >= 0,
        placements=(tip,) * len(rows), groups=tuple(name for name, *_ in rows), temperatures=nothing, ages=nothing,
        thresholds=np.zeros(len(rows)),
    )  # fmt: skip
    return seen, [name for name, *_ in rows]


@pytest.fixture
def asked(monkeypatch):
    """What the share of a tip was computed for: 0.4 of the force."""
    found = []
    share = SimpleNamespace(share=0.4, lightest=0.5, heaviest=0.3, radius=1.1e-3, largest_load=2.2)
    monkeypatch.setattr("fem_reference.point_spread", lambda cover: ("wide", cover))
    monkeypatch.setattr(
        "fem_reference.linear_response.finite_cover.solid_influence", lambda cover, array: ("sides", cover, array)
    )
    monkeypatch.setattr(point_load, "compute_tip_share", lambda *given, **more: found.append((*given, more)) or share)
    return found


def calibrate(trials, sensor=SENSOR, texel=1):
    return calibrate_point_load(*observe(trials), sensor, radius=1e-3, texel=texel)


LOADS = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


@pytest.mark.parametrize(
    ("counts", "saturates", "used"),
    [
        # three counts above 97 % of 1000, and the line of those below 850
        ([200, 500, 849, 971, 1000, 980], True, [0, 1, 2]),
        ([200, 500, 850, 971, 1000, 980], True, [0, 1]),
        # one of the three lies just at 970: no saturation, and all are used
        ([200, 500, 849, 970, 1000, 980], False, range(6)),
        ([200, 500, 849, 860, 1000, 980], False, range(6)),
        ([0, 500, 849, 971, 1000, 980], True, [1, 2]),  # at rest under the smallest load
    ],
)
@pytest.mark.usefixtures("asked")
def test_a_trial_saturates_from_three_images_above_97_percent_on(counts, saturates, used):
    (trial,) = calibrate({"t": (LOADS, counts)}).trials
    rows = list(used)
    slope, offset = np.polyfit(np.array(LOADS)[rows], np.array(counts)[rows], 1)
    assert (trial.slope, trial.offset) == pytest.approx((slope, offset))
    assert trial.saturation_force == (pytest.approx((1000 - offset) / slope) if saturates else None)


@pytest.mark.parametrize(("top", "expected"), [(1000.4, 1000 * 6 / 1000.4), (1.2, 6.0), (0.5, 6.0), (2.6, 3 * 6 / 2.6)])
def test_the_share_is_fitted_up_to_the_load_of_the_largest_whole_count(asked, top, expected):
    """A largest count below 2 counts as 2."""
    found = calibrate({"t": (LOADS, np.array(LOADS) * top / 6)})
    ((cover, array, influence, more),) = asked
    assert more == {"radius": 1e-3, "saturation": pytest.approx(expected)}
    assert (cover, array) == (SENSOR.cover, SENSOR.array)
    assert influence[0] == "wide"
    assert (found.texel, found.tip_radius, found.tip_share) == (1, 1.1e-3, 0.4)
    assert (found.tip_share_light, found.tip_share_heavy, found.largest_load) == (0.5, 0.3, 2.2)
    assert found.estimates == {}


def test_a_cover_with_sides_has_its_own_influence(asked):
    sized = replace(SENSOR, cover=replace(WTS.cover, size=(20e-3, 30e-3)))
    calibrate({"t": (LOADS, [10, 20, 30, 40, 50, 60])}, sized)
    assert asked[0][2] == ("sides", sized.cover, sized.array)


@pytest.mark.usefixtures("asked")
def test_means_over_three_trials_have_the_interval_of_student():
    """Slopes of 200, 210 and 250 counts/N that saturate at 800, 840 and 1000 counts, 4 N."""
    loads = [1.0, 2.0, 3.0, 5.0, 6.0, 7.0]
    trials = {f"t{k}": (loads, np.minimum(k * np.array(loads), 4.0 * k)) for k in (200.0, 210.0, 250.0)}
    found = calibrate(trials)
    half = 4.30265273 * np.std([200, 210, 250], ddof=1) / 3**0.5
    for name, factor, unit in (("sensitivity_applied", 1.0, "counts/N applied"),
                               ("sensitivity", 0.4, "counts/N on the texel")):  # fmt: skip
        each = found.estimates[name]
        assert (each.value, each.high - each.value) == pytest.approx((220 / factor, half / factor))
        assert (each.unit, each.fitted_on) == (unit, "3 recordings")
    force = found.estimates["saturation_force"]
    assert (force.value, force.low, force.high, force.unit) == (
        pytest.approx(4.0), pytest.approx(4.0), pytest.approx(4.0), "N applied"
    )  # fmt: skip
    assert [each.name for each in found.trials] == ["t200.0", "t210.0", "t250.0"]


@pytest.mark.parametrize("texel", [-1, 2, 3])
def test_a_texel_that_does_not_exist_or_is_off_is_refused(texel):
    with pytest.raises(ValueError, match=rf"texel {texel} is not an active texel of wts-0614-34; accepted: 0\.\.2"):
        calibrate({"t": (LOADS, LOADS)}, texel=texel)


@pytest.mark.parametrize(
    ("loads", "counts", "accepted"),
    [([1.0, 2.0], [5, 9], True), ([1.0], [5], False), ([2.0, 2.0], [5, 9], False), ([1.0, 2.0, 3.0], [0, 0, 9], False)],
)
@pytest.mark.usefixtures("asked")
def test_a_line_needs_two_images_under_two_loads(loads, counts, accepted):
    if accepted:
        assert calibrate({"first": (loads, counts)}).trials[0].slope == pytest.approx(4.0)
        return
    with pytest.raises(ValueError, match="first: texel 1 is lit below saturation under fewer than two loads; no line"):
        calibrate({"first": (loads, counts)})


@pytest.mark.usefixtures("asked")
def test_texel_zero_is_a_texel():
    with pytest.raises(ValueError, match="texel 0 is lit"):  # its counts saturate under all loads
        calibrate({"t": (LOADS, LOADS)}, texel=0)
