"""From recordings of a synthetic sensor to a sensor file."""

import numpy as np
import pytest

from tests.support.calibration import GAINS, SHARES, make_recording
from validation.calibration.calibrate import calibrate
from validation.calibration.write_sensor import write_sensor
from validation.errors import InputError
from validation.json_values import json_text
from validation.sensor_file import load as load_sensor


def test_from_recordings_to_a_sensor_file(tmp_path):
    random = np.random.default_rng(0)
    loads = [1, 1, 2, 2, 3, 4, 5, 6, 7, 8, 9]
    found = calibrate([make_recording(n, load, random=random) for n, load in enumerate(loads)], shares=SHARES)
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
        'calibrated = "through the cover, tip 1 mm"\n'
    )
    written = load_sensor(write_sensor(found, source, target)).electronics
    assert written.sensitivity == pytest.approx(2600, rel=0.01)
    assert written.output_max == pytest.approx(3700, abs=20)
    assert written.gains == pytest.approx(GAINS, abs=0.01)
    assert written.calibrated == "texel force"  # the fit is one of texel forces
    assert "from 11 recordings" in target.read_text()
    assert load_sensor(write_sensor(found, source, target, polynomial=True)).electronics.characteristic is not None
    with pytest.raises(InputError, match="softcover init"):
        write_sensor(found, tmp_path / "none.toml", target)
    other, unwritten = tmp_path / "other.toml", tmp_path / "unwritten.toml"
    other.write_text(source.read_text().replace("rows = 2", "rows = 3"))
    with pytest.raises(InputError, match=r"gains: takes one number per texel \(6\), not 4"):
        write_sensor(found, other, unwritten)
    assert not unwritten.exists()
