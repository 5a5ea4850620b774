"""Interface of the derivations of all kinds of cover, and the choice of a derivation by the type of the cover."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import singledispatch
from typing import TYPE_CHECKING, Any, Protocol

from meshes.array_types import FloatArray
from validation.results.derivation import Responses
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fastmodel.parameters import Parameters

Progress = Callable[[str], None]


class Derivation(Protocol):
    """The finite-element response of a sensor's cover, and the parameters of the sensor's fast model."""

    @property
    def sensor(self) -> SensorDescription:
        """Description of the sensor."""

    @property
    def parameters(self) -> Parameters:
        """Parameters of the fast model."""

    @property
    def error_estimate(self) -> Mapping[str, float]:
        """Estimated relative errors of the finite elements, by name [-]."""

    @property
    def sigma(self) -> float:
        """Standard deviation of the fitted Gaussian along the first axis [m]."""

    @property
    def maps(self) -> Mapping[str, FloatArray]:
        """Forces on the n texels under a unit force over one of them, shape (n,) [-], by caption.

        The last two entries are the forces under a uniform load and those of the fitted Gaussian.
        """

    @property
    def own_share(self) -> Mapping[str, float]:
        """Share of a load over the middle texel that this texel measures [-], for the loads `point` and `uniform`."""

    @property
    def verification(self) -> Mapping[str, float]:
        """Differences of the response from closed forms, by name [-]; empty if no closed form is known."""

    @property
    def result(self) -> Responses:
        """Results of the derivation that are written to files."""

    def explain(self) -> Iterator[str]:
        """Yield sentences that explain the results to the user."""


def describe_provenance(sensor: SensorDescription) -> dict[str, Any]:
    """Return the provenance of the parameters of a fast model, for any kind of cover."""
    from importlib.metadata import version

    return {
        "softcover": version("softcover"),
        "sensor": sensor.name,
        "cover": " + ".join(f"{1e3 * layer.thickness:.4g} mm {layer.material.name}" for layer in sensor.cover.layers),
        "cover_thickness": sensor.cover.thickness,
        "cover_assumed": sensor.cover.assumed,
        "electronics_assumed": sensor.assumed_electronics,
    }


@singledispatch
def derive_cover(cover: object, sensor: SensorDescription, progress: Progress | None = None) -> Derivation:
    """Compute the response of a cover by finite elements, and the parameters of the sensor's fast model.

    Each kind of cover registers its own function.

    Args:
        cover: The cover of the sensor.
        sensor: Array, cover and electronics of the sensor.
        progress: Called with a line of text before each step.

    Raises:
        TypeError: If no function is registered for the cover.
    """
    del sensor, progress
    raise TypeError(f"no derivation is registered for {type(cover).__name__}")
