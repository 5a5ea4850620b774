"""A calibration as JSON values, and written into a sensor file."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from validation.calibration.calibrate import Calibration
from validation.calibration.curve_fit import FittedCurve
from validation.errors import InputError
from validation.sensor_file import parse

#: Keys of a sensor file's electronics of which one form replaces the other.
_CHARACTERISTIC = ("sensitivity", "offset", "characteristic")


def as_json(calibration: Calibration) -> dict[str, Any]:
    """Everything that was found, with the report's own line beside it."""
    sensitivity, offset = calibration.report_line
    return {
        "confidence": calibration.confidence,
        "estimates": {name: vars(estimate) for name, estimate in calibration.estimates.items()},
        "gains": calibration.gains.tolist(),
        "gain_half_widths": calibration.gain_intervals.tolist(),
        "texels": calibration.texels.tolist(),
        "line": _curve(calibration.line),
        "polynomial": None if calibration.polynomial is None else _curve(calibration.polynomial),
        "report_line": {"sensitivity": sensitivity, "offset": offset},
    }


def _curve(curve: FittedCurve) -> dict[str, Any]:
    names = curve.form.names(1)
    halves = [curve.interval(row) for row in np.eye(len(curve.values))]
    return {
        "residual_rms_counts": curve.residual,
        "recordings": curve.recordings,
        "threshold": curve.form.threshold,
        "reference_temperature": curve.reference if curve.form.temperature else None,
        "parameters": {
            name: {"value": float(value), "half_width": half}
            for name, value, half in zip(names, curve.values, halves, strict=False)
        },
    }


def write_sensor(calibration: Calibration, sensor: str | Path, out: str | Path, *, polynomial: bool = False) -> Path:
    """Write a sensor file whose electronics are those that were found.

    Args:
        calibration: What was found.
        sensor: The sensor file to start from; it is not changed unless it is `out`.
        out: The file to write.
        polynomial: Whether to write the polynomial of degree 5 instead of the line.

    Raises:
        InputError: If the sensor file cannot be read or describes another array, or the polynomial was not fitted.
    """
    source = Path(sensor)
    try:
        tables = tomllib.loads(source.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{source}: cannot be read: {error}; accepted: a sensor file (`softcover init`)") from error
    kept = {name: value for name, value in tables.get("electronics", {}).items() if name not in _CHARACTERISTIC}
    tables["electronics"] = {**kept, **_electronics(calibration, polynomial=polynomial)}
    # a file for another array, or with other faults, is refused before anything is written
    parse(tables, source=source)
    notes = "".join(
        f"# {name} {found.value:.5g} [{found.low:.5g}, {found.high:.5g}] {found.unit}, from {found.fitted_on}\n"
        for name, found in calibration.estimates.items()
    )
    head = f"# electronics calibrated; {calibration.confidence:.0%} intervals:\n{notes}\n"
    target = Path(out)
    target.write_text(head + tomli_w.dumps(tables), encoding="utf-8")
    return target


def _electronics(calibration: Calibration, *, polynomial: bool) -> dict[str, Any]:
    curve = calibration.polynomial if polynomial else calibration.line
    if curve is None:
        raise InputError("a polynomial of degree 5 needs recordings under at least 7 loads; there were fewer")
    values = dict(zip(curve.form.names(1), curve.values.tolist(), strict=False))
    electronics: dict[str, Any] = {
        "threshold": float(curve.form.threshold),
        "gains": [round(gain, 5) for gain in calibration.gains.tolist()],
    }
    if polynomial:
        electronics["characteristic"] = curve.values[: curve.form.degree + 1].tolist()
    else:
        electronics |= {"sensitivity": f"{values['c1']:.6g} 1/N", "offset": round(values["c0"], 3)}
    if curve.form.saturation:
        electronics["output_max"] = round(values["output_max"])
        electronics["saturation_band"] = round(abs(values["saturation_band"]), 1)
    noise = calibration.estimates.get("noise")
    if noise is not None:
        electronics["noise"] = f"{noise.value / calibration.line.values[1]:.4g} N"
    return electronics
