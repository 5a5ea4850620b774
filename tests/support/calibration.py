"""Recordings of a synthetic sensor with known electronics, under known loads."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from fastmodel import Electronics
from validation.recordings.recording import Recording, Setup, make_array

SHARES = np.array([0.3, 0.25, 0.2, 0.25])
GAINS = np.array([1.1, 0.95, 1.03, 0.92])
SENSOR = Electronics(
    rate_hz=271, sensitivity=2600, offset=-450, output_max=3700, saturation_band=500, gains=tuple(GAINS), noise=2.3e-3
)


def make_recording(number, load, *, temperature=30.0, slope=0.0, random=None, forces=None):
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
