"""From a calibration of a made-up sensor to a sensor file."""

import numpy as np
import pytest

from tests.support.laboratory import draw_gains, make_curve, observe_presses, uniform_method
from validation.calibration.calibrate import calibrate
from validation.calibration.write_sensor import write_sensor
from validation.errors import InputError
from validation.sensor_file import load as load_sensor

SOURCE = """
[array]
rows = 8
columns = 10
pitch = "5 mm"
[[cover.layer]]
thickness = "2 mm"
material = "dragon-skin-30"
[electronics]
rate = "271 Hz"
sensitivity = "1 1/N"
calibrated = "through the cover, tip 1 mm"
"""


def test_a_sensor_file_holds_the_calibrated_electronics(tmp_path):
    random = np.random.default_rng(0)
    loads = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
    seen, _ = observe_presses(random, make_curve(draw_gains(random)), places=2, loads=loads, known=True)
    found = calibrate(seen, uniform_method(), noise=[4.0, 5.0, 6.0])
    source, target = tmp_path / "a.toml", tmp_path / "b.toml"
    source.write_text(SOURCE)
    written = load_sensor(write_sensor(found, source, target)).electronics
    estimates = found.estimates
    assert written.sensitivity == pytest.approx(estimates["sensitivity"].value, rel=1e-5)
    assert written.offset == pytest.approx(estimates["offset"].value, abs=1e-3)
    assert written.output_max == pytest.approx(4095, rel=0.01)
    assert written.gains == pytest.approx(found.gains, abs=1e-5)
    assert written.noise == pytest.approx(5 / estimates["sensitivity"].value, rel=1e-3)
    assert written.calibrated == "texel force"  # the fit is one of texel forces
    assert f"from {14} recordings" in target.read_text()
    # The written electronics predict what was recorded, without gains that the data do not determine.
    pressed = np.isin(np.arange(80), found.texels)
    row = int(np.argmax(seen.loads == 30.0))
    forces = uniform_method().texel_forces(
        seen.placements[row].indenter, np.array([30.0]), found.fit.poses[seen.placements[row].name]
    )[0]
    lit = pressed & (seen.counts[row] > 100)
    assert written.counts(forces)[lit] == pytest.approx(seen.counts[row][lit], rel=0.03)
    assert load_sensor(write_sensor(found, source, target, polynomial=True)).electronics.characteristic is not None


def test_what_cannot_be_written_is_refused(tmp_path):
    random = np.random.default_rng(0)
    seen, _ = observe_presses(random, make_curve(draw_gains(random)), places=1, known=True)
    found = calibrate(seen, uniform_method())
    source, target = tmp_path / "a.toml", tmp_path / "b.toml"
    with pytest.raises(InputError, match="softcover init"):
        write_sensor(found, tmp_path / "none.toml", target)
    source.write_text(SOURCE.replace("rows = 8", "rows = 9"))
    with pytest.raises(InputError, match=r"gains: takes one number per texel \(90\), not 80"):
        write_sensor(found, source, target)
    source.write_text(SOURCE)
    with pytest.raises(InputError, match="at least 7 loads"):
        write_sensor(found, source, target, polynomial=True)
    assert not target.exists()
