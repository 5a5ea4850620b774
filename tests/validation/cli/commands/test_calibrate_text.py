"""What `softcover calibrate` prints of a calibration whose numbers all differ."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from validation.calibration.estimates import Estimate
from validation.calibration.point_load import PointLoadCalibration
from validation.cli.commands.calibrate import _calibrate_point, _print, _print_point
from validation.derivation.calibration_tip import TipShare

SHARE = TipShare(radius=1.5e-3, share=0.76, largest_load=1.25, saturation_load=2.5, lightest=0.81, heaviest=0.72)
ESTIMATES = {
    "sensitivity_applied": Estimate(value=2100.25, low=2050.5, high=2150.75, unit="counts/N", fitted_on="3 trials"),
    "noise": Estimate(value=1.5, low=1.25, high=1.75, unit="counts", fitted_on="5 recordings"),
}


@pytest.fixture
def printed(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")

    def read(print_it, *arguments):
        print_it(*arguments)
        return [line.rstrip() for line in capsys.readouterr().out.splitlines() if line.strip(" ─━┡╇┩┏┳┓└┴┘")]

    return read


def test_of_a_texel_under_a_tip(printed):
    found = PointLoadCalibration(
        texel=39, share=SHARE, names=("one", "two"), slopes=np.array([2000.0, 2280.0]), offsets=np.array([-50.0, 30.5]),
        saturation_forces=np.array([np.nan, 1.625]), estimates=ESTIMATES,
    )  # fmt: skip
    title, head, *rows = printed(_print_point, found)
    assert title.strip() == "Texel 39 under a tip of 1.5 mm"
    columns = ["trial", "counts/N applied", "counts/N on the texel", "offset [counts]", "saturates at [N]"]
    assert [each.strip() for each in head.strip("┃").split("┃")] == columns
    cells = [[each.strip() for each in row.strip("│").split("│")] for row in rows[:2]]
    assert cells == [
        ["one", "2000", f"{2000 / 0.76:.5g}", "-50", ""],
        ["two", "2280", "3000", "30.5", "1.625"],
    ]
    assert rows[0].startswith("│ one   │             2000 │")  # names on the left, numbers on the right
    assert rows[2:] == [
        "the texel measures 0.7600 of the applied force (finite elements; 0.8100 under light loads, 0.7200 at 1.25 N)",
        "sensitivity applied: 2100.2 [2050.5, 2150.8] counts/N",
        "noise: 1.5 [1.25, 1.75] counts",
    ]
    assert found.as_json() == {
        "texel": 39, "tip_share": 0.76, "tip_share_light": 0.81, "tip_share_heavy": 0.72,
        "trials": [
            {"name": "one", "slope": 2000.0, "offset": -50.0, "saturation_force": None},
            {"name": "two", "slope": 2280.0, "offset": 30.5, "saturation_force": 1.625},
        ],
        "estimates": {name: vars(each) for name, each in ESTIMATES.items()},
    }  # fmt: skip


@pytest.mark.parametrize("name", ["wts-0614-34", "other"])
def test_of_an_array(printed, name):
    found = SimpleNamespace(
        estimates=ESTIMATES, confidence=0.9, report_line=(2665.7, -493.87), notes=("a note",),
        poses={"tool": ((1e-3, -2e-3, 0.5), (0.1e-3, 0.25e-3, 0.01))},
        fit=SimpleNamespace(method=SimpleNamespace(name="cover", about="some words"), rms=3.25),
        hold_out=SimpleNamespace(summary="image changed 1 %"),
    )  # fmt: skip
    title, head, *rows = printed(_print, found, SimpleNamespace(name=name))
    assert title.strip() == f"Calibration of {name}"
    assert head.split("  ")[0] == ""
    assert " ".join(head.split()) == "value 90% interval unit fitted on"
    assert rows[:2] == [
        " sensitivity applied  2100   2050..2151    counts/N  3 trials",
        " noise                1.5    1.25..1.75    counts    5 recordings",
    ]
    line = ["published line of this sensor (2015 report): 2665.7 counts/N, offset -493.87 counts"]
    assert rows[2:] == (line if name == "wts-0614-34" else []) + [
        "tool: x 1.00 +- 0.10 mm, y -2.00 +- 0.25 mm, yaw 28.6 deg",
        "shares by cover: some words; residual 3.2 counts",
        "left-out recordings: image changed 1 %",
        "- a note",
    ]


@pytest.mark.parametrize(
    ("names", "trials"), [(["a", "b"], ["all recordings"] * 2), (["a", "a", "b"], ["a", "a", "b"])]
)
def test_recordings_with_a_force_channel_are_a_trial_each(monkeypatch, capsys, names, trials):
    found = PointLoadCalibration(
        texel=7, share=SHARE, names=("one",), slopes=np.array([2000.0]), offsets=np.array([-50.0]),
        saturation_forces=np.array([np.nan]), estimates={},
    )  # fmt: skip
    asked = []

    def fit(seen, given, sensor, *, radius, texel):
        asked.append((seen, given, sensor, radius, texel))
        return found

    monkeypatch.setattr("validation.calibration.point_load.calibrate_point_load", fit)
    monkeypatch.setattr("validation.data_sets.images.observe", len)
    images = [SimpleNamespace(file=SimpleNamespace(name=name)) for name in names]
    _calibrate_point(images, "sensor", "1.5mm", 7, json=False)
    assert "Texel 7 under a tip of 1.5 mm" in capsys.readouterr().out
    _calibrate_point(images, "sensor", "1.5mm", 7, json=True)
    assert json.loads(capsys.readouterr().out)["tip_share"] == 0.76
    assert asked == [(len(names), trials, "sensor", pytest.approx(1.5e-3), 7)] * 2
