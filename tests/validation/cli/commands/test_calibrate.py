"""`softcover calibrate` on recordings of a made-up WTS array, with texel forces by finite elements."""

import dataclasses
import json

import numpy as np
import pytest

from meshes import Box
from tests.support.laboratory import draw_gains, make_curve, press, write
from validation.calibration.model import Pose, make_reference_method
from validation.sensor_file import load

WTS = load("wts-0614-34")
METHOD = make_reference_method(WTS.cover, WTS.array)
TOOL = "box:size=10mmx10mmx5mm"
POSE = Pose(1e-3, -2e-3)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Paths of recordings under five loads as CSV and MCAP, and the true gains."""
    folder = tmp_path_factory.mktemp("recordings")
    random = np.random.default_rng(2)
    curve = make_curve(draw_gains(random, count=WTS.array.count))
    paths = []
    for number, newtons in enumerate((2.0, 4.0, 6.0, 8.0, 10.0)):
        recording = press(METHOD, curve, newtons, POSE, indenter=Box(size=(10e-3, 10e-3, 5e-3)), random=random)
        paths.append(write(recording, folder / f"{number}.{'csv' if number % 2 else 'mcap'}"))
    return paths, curve.gains


def test_gains_of_a_known_pose(softcover, recordings):
    paths, gains = recordings
    arguments = ("--indenter", TOOL, "--at", "1mm,-2mm", "--sensor", "wts-0614-34")
    status, out, err = softcover("calibrate", *paths, *arguments, "--json")
    assert status == 0, err
    told = json.loads(out)
    texels = told["texels"]
    mean = gains[texels].mean()
    assert told["estimates"]["sensitivity"]["unit"] == "counts/N"
    assert told["estimates"]["sensitivity"]["value"] == pytest.approx(917 * mean, rel=0.01)
    assert np.array(told["gains"])[texels] == pytest.approx(gains[texels] / mean, rel=0.02)
    assert told["poses"]["tool"]["x_m"] == [1e-3, 0.0]
    assert told["hold_out"]["image_changed_percent"] < 0.2
    assert told["report_line"]["sensitivity"] == 2665.7


@pytest.mark.slow
def test_the_pose_is_fitted(softcover, recordings):
    paths, _ = recordings
    status, out, _ = softcover("calibrate", *paths, "--indenter", TOOL, "--sensor", "wts-0614-34", "--json")
    assert status == 0
    (x, width), (y, _) = (json.loads(out)["poses"]["tool"][name] for name in ("x_m", "y_m"))
    assert abs(x - POSE.x) < width
    assert (x, y) == pytest.approx((POSE.x, POSE.y), abs=1e-3)  # gains take up a shift: one stamp in one place


@pytest.mark.slow
def test_a_data_set_file_stands_for_its_recordings(softcover, recordings, tmp_path):
    paths, _ = recordings
    data_set = paths[0].parent / "set.toml"
    data_set.write_text(
        f"indenter = '{TOOL}'\nat = ['1 mm', '-2 mm']\n[[series]]\nname = 'weights'\nfiles = ['*.csv', '*.mcap']\n"
        f"use = 'fit'\n"
    )
    status, out, _ = softcover("calibrate", data_set, "--sensor", "wts-0614-34", "--json")
    assert status == 0
    assert set(json.loads(out)["poses"]) == {"weights"}
    status, _, err = softcover("calibrate", data_set, paths[0], "--sensor", "wts-0614-34")
    assert status == 2
    assert "a data-set file stands alone" in err


def test_a_recording_that_cannot_be_used_costs_itself(softcover, recordings, tmp_path):
    paths, _ = recordings
    (tmp_path / "damaged.csv").write_text("time,a\n0,x\n")
    arguments = ("--indenter", TOOL, "--at", "1mm,-2mm", "--sensor", "wts-0614-34", "--json")
    status, out, err = softcover("calibrate", *paths, "damaged.csv", *arguments)
    assert status == 0
    assert "damaged.csv, line 2: not a number" in err
    assert "5 recordings" in json.loads(out)["estimates"]["sensitivity"]["fitted_on"]


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        (("--tip", "1mm"), "--tip, --texel: give both"),
        (("--indenter", "bxo:size=1mm"), "unknown indenter 'bxo'; did you mean 'box'?"),
        (("--method", "covr"), "did you mean 'cover'?"),
        (("--threshold", "-1"), "--threshold"),
    ],
)
def test_bad_options_end_in_one_line(softcover, recordings, options, fault):
    status, _, err = softcover("calibrate", *recordings[0], "--sensor", "wts-0614-34", *options)
    assert status == 2
    assert fault in err


def test_recordings_with_an_offset_and_no_frames_at_rest_are_refused(softcover, tmp_path):
    made = press(METHOD, make_curve(np.ones(WTS.array.count)), 6.0, POSE, indenter=Box(size=(10e-3, 10e-3, 5e-3)))
    late = made.times > 1.5
    array = dataclasses.replace(made.arrays[0], counts=25000 + made.arrays[0].counts[late], full_scale=2**16)
    path = write(dataclasses.replace(made, times=made.times[late], arrays=(array,)), tmp_path / "offset.csv")
    status, out, err = softcover("calibrate", path, "--indenter", TOOL, "--at", "1mm,-2mm", "--sensor", "wts-0614-34")
    assert (status, out) == (2, "")
    assert "offset.csv" in err
    assert "no frames at rest" in err
