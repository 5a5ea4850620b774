"""Derivation of the fast model's parameters from the description of a sensor, for every kind of cover."""

from validation.derivation import layers, solid
from validation.derivation.base import Derivation, Progress, derive_cover
from validation.sensor_file import SensorDescription

__all__ = ["KINDS", "Derivation", "derive"]

#: Derivations of the kinds of covers.  Their modules register the functions that compute them.
KINDS = (layers.LayeredDerivation, solid.SolidDerivation)


def derive(sensor: SensorDescription, *, progress: Progress | None = None) -> Derivation:
    """Compute the response of a sensor's cover by finite elements, and the parameters of its fast model.

    Args:
        sensor: Array, cover and electronics of the sensor.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If the array does not fit the cover, or the cover cannot be meshed, with one line per fault.
        ConvergenceError: If the finite-element solver did not converge.
    """
    return derive_cover(sensor.cover, sensor, progress)
