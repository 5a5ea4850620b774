"""Writes a copy of a sensor file (TOML) in which the table `[electronics]` holds the results of a calibration."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from fastmodel.signal.electronics import TEXEL_FORCE
from validation.calibration.calibrate import Calibration
from validation.errors import InputError
from validation.output_folder import write_text
from validation.schema import read_raw
from validation.schema.sensor import SensorTables
from validation.sensor_file import parse

#: Keys of the table `[electronics]` of a sensor file that a calibrated characteristic replaces.
_CHARACTERISTIC = ("sensitivity", "offset", "characteristic")


def write_sensor(calibration: Calibration, sensor: str | Path, out: str | Path, *, polynomial: bool = False) -> Path:
    """Write a copy of a sensor file with calibrated electronics.

    Args:
        calibration: Result of the calibration.
        sensor: The sensor file that is copied; it is unchanged unless `out` names the same file.
        out: The file to write; an existing file is replaced.
        polynomial: Whether to write the polynomial of degree 5 instead of the straight line.

    Returns:
        Path of the written file.

    Raises:
        InputError: If the sensor file cannot be read or describes another array, or if the polynomial is requested and
            was not fitted.
    """
    source, target = Path(sensor), Path(out)
    try:
        tables = read_raw(source, SensorTables)
    except (OSError, ValueError) as error:
        raise InputError(f"{source}: cannot be read: {error}; accepted: a sensor file (`softcover init`)") from error
    kept = {name: value for name, value in tables.get("electronics", {}).items() if name not in _CHARACTERISTIC}
    tables["electronics"] = {**kept, **_calibrated_electronics(calibration, polynomial=polynomial)}
    # `parse` raises InputError if the sensor file describes another array; nothing has been written yet.
    parse(tables, source=source)
    notes = "".join(
        f"# {name} {estimate.value:.5g} [{estimate.low:.5g}, {estimate.high:.5g}] {estimate.unit}, "
        f"from {estimate.fitted_on}\n"
        for name, estimate in calibration.estimates.items()
    )
    head = f"# electronics calibrated; {calibration.confidence:.0%} intervals:\n{notes}\n"
    write_text(target, head + tomli_w.dumps(tables))
    return target


def _calibrated_electronics(calibration: Calibration, *, polynomial: bool) -> dict[str, Any]:
    """Return keys and values for the table `[electronics]` of a sensor file, from a calibration."""
    electronics: dict[str, Any] = {
        "threshold": calibration.threshold,
        "gains": [round(gain, 5) for gain in calibration.gains.tolist()],
        "calibrated": TEXEL_FORCE,
    }
    sensitivity = calibration.estimates["sensitivity"].value
    if polynomial:
        if calibration.polynomial is None:
            raise InputError("a polynomial of degree 5 needs recordings under at least 7 loads; there were fewer")
        electronics["characteristic"] = calibration.polynomial.tolist()
    else:
        offset = calibration.estimates["offset"].value
        electronics |= {"sensitivity": f"{sensitivity:.6g} 1/N", "offset": round(offset, 3)}
    curve = calibration.fit.curve
    if np.isfinite(curve.output_max):
        electronics["output_max"] = round(curve.output_max)
        electronics["saturation_band"] = round(curve.saturation_band, 1)
    noise = calibration.estimates.get("noise")
    if noise is not None:
        electronics["noise"] = f"{noise.value / sensitivity:.4g} N"
    return electronics
