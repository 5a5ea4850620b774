"""Parameters of a sensor's fast model: read from the package, or derived by finite elements."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import fastmodel
from fastmodel import Parameters
from validation.extras import require
from validation.sensor_file import BUILT_IN, CURVED, PUBLISHED, SensorDescription


def holds_parameters(sensor: str) -> bool:
    """Return whether a user's name of a sensor is the path of a folder with parameters, or of its `parameters.toml`."""
    path = Path(sensor)
    return sensor not in (*BUILT_IN, *PUBLISHED, *CURVED) and (
        path.name == "parameters.toml" or (path / "parameters.toml").is_file()
    )


def find_parameters(
    sensor: SensorDescription | Parameters, progress: Callable[[str], None] | None = None
) -> Parameters:
    """Find the parameters of a sensor's fast model.

    Parameters that were read from a folder are returned unchanged.  The parameters of a built-in sensor come with the
    package.  The parameters of any other sensor are derived by finite elements.

    Args:
        sensor: Description of a sensor, or parameters.
        progress: Called with the name of each stage of the derivation.

    Raises:
        ConvergenceError: If the finite elements did not converge.
        MissingExtraError: If finite elements are needed and not installed.
    """
    if isinstance(sensor, Parameters):
        return sensor
    if sensor is BUILT_IN.get(sensor.name):
        return fastmodel.load(sensor.name)
    require("skfem")
    from validation.derivation.derive import derive

    return derive(sensor, progress=progress).parameters
