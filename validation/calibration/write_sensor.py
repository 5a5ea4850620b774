"""Write a sensor file with calibrated electronics."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from validation.calibration.calibrate import Calibration
from validation.errors import InputError
from validation.sensor_file import parse

#: Keys of `[electronics]` that a calibrated characteristic replaces.
_CHARACTERISTIC = ("sensitivity", "offset", "characteristic")


def write_sensor(calibration: Calibration, sensor: str | Path, out: str | Path, *, polynomial: bool = False) -> Path:
    """Write a copy of a sensor file with the calibrated electronics.

    Args:
        calibration: The calibration.
        sensor: The sensor file to start from; it does not change unless it is also `out`.
        out: The file to write.
        polynomial: Whether to write the polynomial of degree 5 instead of the line.

    Raises:
        InputError: If the sensor file cannot be read or describes another array, or the polynomial was not fitted.
    """
    source, target = Path(sensor), Path(out)
    try:
        tables = tomllib.loads(source.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{source}: cannot be read: {error}; accepted: a sensor file (`softcover init`)") from error
    kept = {name: value for name, value in tables.get("electronics", {}).items() if name not in _CHARACTERISTIC}
    tables["electronics"] = {**kept, **_calibrated_electronics(calibration, polynomial=polynomial)}
    # Check before anything is written: a sensor file for another array is refused here.
    parse(tables, source=source)
    notes = "".join(
        f"# {name} {estimate.value:.5g} [{estimate.low:.5g}, {estimate.high:.5g}] {estimate.unit}, "
        f"from {estimate.fitted_on}\n"
        for name, estimate in calibration.estimates.items()
    )
    head = f"# electronics calibrated; {calibration.confidence:.0%} intervals:\n{notes}\n"
    target.write_text(head + tomli_w.dumps(tables), encoding="utf-8")
    return target


def _calibrated_electronics(calibration: Calibration, *, polynomial: bool) -> dict[str, Any]:
    """Keys and values of the table `[electronics]`."""
    curve = calibration.polynomial if polynomial else calibration.line
    if curve is None:
        raise InputError("a polynomial of degree 5 needs recordings under at least 7 loads; there were fewer")
    electronics: dict[str, Any] = {
        "threshold": float(curve.form.threshold),
        "gains": [round(gain, 5) for gain in calibration.gains.tolist()],
    }
    if polynomial:
        electronics["characteristic"] = curve.values[: curve.form.degree + 1].tolist()
    else:
        electronics |= {"sensitivity": f"{curve.value('c1'):.6g} 1/N", "offset": round(curve.value("c0"), 3)}
    if curve.form.saturation:
        electronics["output_max"] = round(curve.value("output_max"))
        electronics["saturation_band"] = round(abs(curve.value("saturation_band")), 1)
    noise = calibration.estimates.get("noise")
    if noise is not None:
        electronics["noise"] = f"{noise.value / calibration.line.value('c1'):.4g} N"
    return electronics
