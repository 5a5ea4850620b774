"""Calibration on synthetic sensors with known parameters, and on the weight series."""

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from fastmodel import Electronics
from meshes import Box, Sphere, TexelArray
from validation.calibration.calibrate import calibrate, flat_shares
from validation.calibration.curve_fit import CurveForm, Observations, fit_curve
from validation.calibration.write_sensor import write_sensor
from validation.cli.entry import main
from validation.errors import InputError
from validation.json_values import json_text
from validation.recordings import tables
from validation.recordings.importing import open_recording, relabel
from validation.recordings.recording import Recording, RecordingError, Setup, make_array
from validation.recordings.series import STAMP_EDGE, THRESHOLD, find_recordings_folder, find_stamp_files
from validation.sensor_file import load as load_sensor

SHARES = np.array([0.3, 0.25, 0.2, 0.25])
GAINS = np.array([1.1, 0.95, 1.03, 0.92])
SENSOR = Electronics(
    rate_hz=271, sensitivity=2600, offset=-450, output_max=3700, saturation_band=500, gains=tuple(GAINS), noise=2.3e-3
)
FORM = CurveForm(degree=1, saturation=True, gains=True, temperature=False, threshold=0)
TRUTH = {
    "c0": -450,
    "c1": 2600,
    "output_max": 3700,
    "saturation_band": 500,
    "gain0": 1.1,
    "gain1": 0.95,
    "gain2": 1.03,
}


def _synthetic(seed, recordings=16):
    """What the fast model's own electronics deliver under six loads per recording."""
    random = np.random.default_rng(seed)
    loads = np.tile(np.linspace(1, 9, 6), recordings)
    counts = SENSOR.counts(np.outer(loads, SHARES), random)
    return Observations(
        loads=loads,
        counts=counts.astype(float),
        shares=SHARES,
        groups=tuple(str(number) for number in np.repeat(np.arange(recordings), 6)),
        temperatures=np.full(len(loads), np.nan),
    )


def _coverage(runs, *, shrink=1.0):
    """How often each interval holds the truth, and its median width."""
    hits, widths = [], []
    for seed in range(runs):
        fitted = fit_curve(_synthetic(seed), FORM)
        halves = np.array([fitted.interval(row) for row in np.eye(len(TRUTH))]) * shrink
        hits.append(np.abs(fitted.values - list(TRUTH.values())) <= halves)
        widths.append(2 * halves)
    return dict(zip(TRUTH, np.sum(hits, axis=0), strict=True)), dict(zip(TRUTH, np.median(widths, axis=0), strict=True))


def test_names_are_those_of_the_truth():
    assert FORM.names(4) == list(TRUTH)


def test_intervals_cover():
    hits, widths = _coverage(100)
    assert all(90 <= hit <= 99 for hit in hits.values()), hits
    assert widths["c1"] < 0.01 * TRUTH["c1"]
    assert widths["gain0"] < 0.01
    assert widths["output_max"] < 0.01 * TRUTH["output_max"]


def test_intervals_that_are_too_short_are_noticed():
    hits, _ = _coverage(30, shrink=0.4)
    assert max(hits.values()) < 27


def test_recordings_not_frames_are_the_evidence():
    """Ten copies of every observation tell nothing new."""
    once = _synthetic(1)
    many = Observations(
        loads=np.tile(once.loads, 10),
        counts=np.tile(once.counts, (10, 1)),
        shares=SHARES,
        groups=once.groups * 10,
        temperatures=np.tile(once.temperatures, 10),
    )
    slope = np.eye(len(TRUTH))[1]
    single = fit_curve(once, FORM).interval(slope)
    assert fit_curve(many, FORM).interval(slope) == pytest.approx(single, rel=0.05)


def test_a_polynomial_of_degree_five_is_found():
    truth = (-300.0, 2000.0, 500.0, -200.0, 50.0, -5.0)
    sensor = replace(SENSOR, characteristic=truth, saturation_band=0.0, output_max=4095, noise=0.0)
    loads = np.tile(np.linspace(1, 5, 12), 4)
    counts = sensor.counts(np.outer(loads, SHARES)).astype(float)
    groups = tuple(str(number) for number in np.repeat(np.arange(4), 12))
    observations = Observations(
        loads=loads, counts=counts, shares=SHARES, groups=groups, temperatures=np.full(len(loads), np.nan)
    )
    fitted = fit_curve(observations, replace(FORM, degree=5, saturation=False))
    assert fitted.residual < 0.5
    force = np.linspace(0.3, 1.4, 20)
    found = np.polynomial.polynomial.polyval(force, fitted.values[:6])
    assert np.allclose(found, np.polynomial.polynomial.polyval(force, truth), atol=3)


def _recording(number, load, *, temperature=30.0, slope=0.0, random=None, forces=None):
    """Fifteen seconds on a 2 x 2 array, the load put on after one."""
    times = np.arange(0, 15, 0.05)
    applied = np.where(times > 1, load, 0.0) if forces is None else forces(times)
    counts = SENSOR.counts(np.outer(applied, SHARES), random) * (1 + slope * (temperature - 35))
    return Recording(
        path=Path(f"{number}.mcap"),
        sha256="",
        serial="",
        started=datetime(2026, 1, 1, tzinfo=UTC),
        times=times,
        arrays=(make_array(2, 2, np.rint(counts).astype(np.int32)),),
        temperatures=np.array([[temperature]]),
        temperature_times=np.zeros(1),
        setup=Setup(load=None if forces else load, device={"threshold": 0}),
        gaps=(),
        complete=True,
        host_monotonic=np.zeros(len(times), dtype=np.int64),
        ticks=np.zeros(len(times), dtype=np.int64),
        forces=applied if forces else np.empty(0),
        force_times=times if forces else np.empty(0),
    )


def test_from_recordings_to_a_sensor_file(tmp_path):
    random = np.random.default_rng(0)
    loads = [1, 1, 2, 2, 3, 4, 5, 6, 7, 8, 9]
    found = calibrate([_recording(n, load, random=random) for n, load in enumerate(loads)], shares=SHARES)
    estimates = found.estimates
    for name, true in (("sensitivity", 2600), ("offset", -450), ("output_max", 3700), ("dead_force", 450 / 2600)):
        assert estimates[name].low <= true <= estimates[name].high, name
        assert estimates[name].fitted_on == "11 recordings, 1..9 N"
    assert np.allclose(found.gains, GAINS, atol=0.01)
    assert estimates["noise"].value == pytest.approx(2600 * 2.3e-3, rel=0.1)
    assert abs(estimates["drift"].value) < 0.01
    assert estimates["hysteresis"].value < 0.01
    assert found.polynomial is not None
    assert json_text(found.as_json())

    source, target = tmp_path / "a.toml", tmp_path / "b.toml"
    source.write_text(
        '[array]\nrows = 2\ncolumns = 2\npitch = "3.4 mm"\n[[cover.layer]]\nthickness = "2 mm"\n'
        'material = "dragon-skin-30"\n[electronics]\nrate = "271 Hz"\nsensitivity = "1 1/N"\n'
    )
    written = load_sensor(write_sensor(found, source, target)).electronics
    assert written.sensitivity == pytest.approx(2600, rel=0.01)
    assert written.output_max == pytest.approx(3700, abs=20)
    assert written.gains == pytest.approx(GAINS, abs=0.01)
    assert "from 11 recordings" in target.read_text()
    assert load_sensor(write_sensor(found, source, target, polynomial=True)).electronics.characteristic is not None
    with pytest.raises(InputError, match="softcover init"):
        write_sensor(found, tmp_path / "none.toml", target)
    other, unwritten = tmp_path / "other.toml", tmp_path / "unwritten.toml"
    other.write_text(source.read_text().replace("rows = 2", "rows = 3"))
    with pytest.raises(InputError, match=r"gains: takes one number per texel \(6\), not 4"):
        write_sensor(found, other, unwritten)
    assert not unwritten.exists()


def test_temperature():
    recordings = [
        _recording(f"{load}-{warm}", load, temperature=warm, slope=-0.01) for load in (2, 3, 4, 5) for warm in (30, 40)
    ]
    estimate = calibrate(recordings, shares=SHARES).estimates["temperature"]
    assert estimate.value == pytest.approx(-0.01, abs=5e-4)


def test_a_force_sensor_beside_the_frames_gives_the_loads():
    def ramp(times):
        return 4 + 3 * np.sin(times)

    found = calibrate([_recording(0, None, forces=ramp, random=np.random.default_rng(1))], shares=SHARES)
    sensitivity = found.estimates["sensitivity"]
    assert sensitivity.low <= 2600 <= sensitivity.high
    assert sensitivity.high - sensitivity.low < 100


def test_shares_under_a_flat_face():
    array = TexelArray.grid(4, 4, 3.4e-3)
    whole = flat_shares(array, Box(size=(13.6e-3, 13.6e-3, 5e-3)))
    assert np.allclose(whole, 1 / 16)
    half = flat_shares(array, Box(size=(3.4e-3, 3.4e-3, 5e-3)), at=(0.0, 1.7e-3))
    assert half.sum() == pytest.approx(1)
    assert np.count_nonzero(half) == 2
    with pytest.raises(ValueError, match="no flat face"):
        flat_shares(array, Sphere(radius=1e-3), at=(50e-3, 0))


def test_too_little_is_refused():
    with pytest.raises(RecordingError, match="its load is not known"):
        calibrate([replace(_recording(0, 2.0), setup=Setup())], shares=SHARES)
    with pytest.raises(ValueError, match="at least 3 recordings"):
        calibrate([_recording(0, 2.0), _recording(1, 3.0)], shares=SHARES)
    with pytest.raises(ValueError, match="no recordings"):
        calibrate([], shares=SHARES)
    with pytest.raises(RecordingError, match="expected 5"):
        calibrate([_recording(0, 2.0)], shares=np.full(5, 0.2))
    other = replace(_recording(1, 3.0), setup=Setup(load=3.0, device={"threshold": 9}))
    wide = replace(_recording(2, 3.0), arrays=(make_array(1, 4, np.zeros((300, 4), dtype=np.int32)),))
    with pytest.raises(RecordingError, match=r"2\.mcap: array 0 is not laid out as that of 0\.mcap"):
        calibrate([_recording(0, 2.0), wide], shares=SHARES)
    empty = replace(_recording(2, 3.0), times=np.empty(0))
    with pytest.raises(RecordingError, match=r"2\.mcap: holds no frames"):
        calibrate([_recording(0, 2.0), empty], shares=SHARES)
    with pytest.raises(RecordingError, match="several thresholds"):
        calibrate([_recording(0, 2.0), other], shares=SHARES)


@pytest.fixture(scope="module")
def weights():
    folder = find_recordings_folder()
    if folder is None:
        pytest.skip("the recordings are not here")
    files = [file for file in find_stamp_files(folder) if file.condition == "room"]
    return {file: relabel(open_recording(file.path), Setup(load=file.load)) for file in files}


def test_odd_weights_predict_even_ones(weights):
    """Better than the null that knows no sensor: a quadratic per texel misses by 0.75 % of full scale."""
    odd = [recording for file, recording in weights.items() if file.letter in "ACEG"]
    even = [recording for file, recording in weights.items() if file.letter in "BDFH"]
    array = odd[0].arrays[1].texels
    shares = flat_shares(array, Box(size=(STAMP_EDGE, STAMP_EDGE, 5e-3)), at=(-0.7e-3, 11.1e-3))
    found = calibrate(odd, shares=shares, array=1, threshold=THRESHOLD)
    misfit = []
    for recording in even:
        steady = recording.arrays[1].counts[-200:-100, found.texels].mean(axis=0)
        one = replace(
            found.observations,
            loads=np.array([recording.setup.load]),
            counts=steady[None],
            groups=("x",),
            temperatures=np.zeros(1),
        )
        misfit.append(np.abs(found.line.predict(one) - steady).sum() / (4095 * 68))
    assert np.mean(misfit) < 0.0075
    assert found.estimates["hysteresis"].low > 0
    assert found.estimates["sensitivity"].low > 1000


def test_the_command(weights, tmp_path, capsys):
    files = []
    for number, load in enumerate((1.0, 2.0, 3.0, 5.0, 8.0)):
        recording = _recording(number, load)
        tables.write(recording, tmp_path / f"{number}.csv")
        files.append(str(tmp_path / f"{number}.csv"))
    with pytest.raises(SystemExit) as caught:
        main(["calibrate", *files, "--indenter", "box:size=6.8mmx6.8mmx5mm", "--at", "0mm,0mm", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert caught.value.code == 0
    assert told["estimates"]["sensitivity"]["unit"] == "counts/N"
    assert told["report_line"]["sensitivity"] == 2665.7
    with pytest.raises(SystemExit) as caught:
        main(["calibrate", files[0], "--indenter", "box:size=6.8mmx6.8mmx5mm", "--window", "9:6"])
    assert caught.value.code == 2
    assert "must run from an earlier" in capsys.readouterr().err
