"""Temperatures of recordings, and whether their effect can be told from that of the load."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from meshes.array_types import FloatArray
from validation.calibration.model import Observations

#: Smallest range of temperature for which temperature coefficients are fitted [K].
_RANGE = 5.0
#: Largest squared correlation of temperature and load for which temperature coefficients are fitted [-].  Above it
#: temperature and load increase together, and the coefficients would describe the load.
_MOST_CONFOUNDED = 0.8


def describe_confounding(observations: Observations) -> str:
    """State why temperature coefficients cannot be fitted; empty if they can."""
    warm, loads, least = observations.temperatures, observations.loads, _RANGE
    if not np.isfinite(warm).all():
        return "the temperature is not known in every recording"
    if (span := float(np.ptp(warm))) < least:
        return f"the temperature varies by {span:.1f} K only; {least:g} K are needed"
    together = float(np.corrcoef(warm, loads)[0, 1] ** 2) if np.ptp(loads) > 0 else 0.0
    if together > _MOST_CONFOUNDED:
        return f"temperature and load rise together (squared correlation {together:.2f})"
    return ""


def find_warmth(observations: Observations) -> dict[str, float]:
    """Return the mean temperature of each session, by its name, if temperature and load rise together in one [degC].

    A temperature that rises with the load in every session would describe the load.  The temperature coefficient then
    follows from the differences between sessions.  Empty if temperature and load vary apart.
    """
    found, together = {}, False
    for placement in observations.distinct_placements:
        rows = observations.rows_of(placement)
        warm, loads = observations.temperatures[rows], observations.loads[rows]
        found[placement.name] = float(warm.mean())
        if np.ptp(loads) > 0 and np.ptp(warm) > 0:
            together |= bool(np.corrcoef(warm, loads)[0, 1] ** 2 > _MOST_CONFOUNDED)
    return found if together and len(found) > 1 else {}


def settle_temperatures(observations: Observations, warmth: Mapping[str, float]) -> FloatArray:
    """Replace temperatures by that of the session, or by the mean over a session that was not fitted, shape (m,)."""
    temperatures = observations.temperatures.copy()
    for placement in observations.distinct_placements if warmth else ():
        rows = observations.rows_of(placement)
        temperatures[rows] = warmth.get(placement.name, float(temperatures[rows].mean()))
    return temperatures
