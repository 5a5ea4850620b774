"""Recordings for tests, and their comparison."""

import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from meshes import TexelArray
from validation.recordings.recording import RecordedArray, Recording, Setup

#: Folder of the published recordings, where it is named and exists.
RECORDINGS = Path(os.environ["SOFTCOVER_RECORDINGS"]) if os.environ.get("SOFTCOVER_RECORDINGS") else None
#: Text that a user may write: any characters of one line.
LINES = st.text(st.characters(exclude_categories=["C", "Z"]), max_size=20)
_LENGTHS = st.floats(1e-4, 0.1)
_ANGLES = st.floats(-10, 10)


def find_differences(back, recording):
    """Names of the values of a recording that did not come back as they were."""
    same = {
        "times": np.allclose(back.times, recording.times, rtol=0, atol=1e-8),
        "started": back.started == recording.started,
        "serial": back.serial == recording.serial,
        "temperatures": np.array_equal(back.temperatures, recording.temperatures),
        "temperature_times": np.allclose(back.temperature_times, recording.temperature_times, rtol=0, atol=1e-6),
        "forces": np.array_equal(back.forces, recording.forces),
        "force_times": np.allclose(back.force_times, recording.force_times, rtol=0, atol=1e-6),
    }
    for number, (mine, theirs) in enumerate(zip(back.arrays, recording.arrays, strict=True)):
        same[f"counts {number}"] = np.array_equal(mine.counts, theirs.counts)
        same |= {f"{name} {number}": kept for name, kept in compare_arrays(mine, theirs).items()}
    return [name for name, kept in same.items() if not kept]


def compare_arrays(mine, theirs):
    """Whether each property of two arrays is the same, without their frames."""
    same = {"enabled": np.array_equal(mine.enabled, theirs.enabled), "layout": mine.has_layout_of(theirs.texels)}
    same["names"] = mine.texels.name == theirs.texels.name
    for name in ("full_scale", "unit", "centre", "rotation"):
        same[name] = getattr(mine, name) == getattr(theirs, name)
    return same


@st.composite
def recorded_arrays(draw, frames=0):
    """An array of any size up to 4 x 4 texels with masks and that many frames."""
    rows, columns = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    masks = arrays(bool, rows * columns)
    active = draw(masks.filter(lambda mask: mask.any()))
    pitch = (draw(_LENGTHS), draw(_LENGTHS))
    full_scale = draw(st.integers(1, 65535))
    return RecordedArray(
        texels=TexelArray.grid(rows, columns, pitch, active=active, name=draw(LINES)),
        enabled=draw(masks),
        counts=draw(arrays(np.int32, (frames, rows * columns), elements=st.integers(0, full_scale))),
        full_scale=full_scale,
        unit=draw(LINES),
        centre=tuple(draw(st.tuples(_ANGLES, _ANGLES, _ANGLES))),
        rotation=tuple(draw(st.tuples(_ANGLES, _ANGLES, _ANGLES))),
    )


def setups():
    """A set-up with any labels."""
    return st.builds(
        Setup,
        indenter=LINES,
        load=st.none() | st.floats(0, 1e6),
        note=LINES,
        source=LINES,
        device=st.dictionaries(LINES, LINES | st.integers(-(2**31), 2**31) | st.floats(-1e9, 1e9), max_size=3),
    )


@st.composite
def recordings(draw):
    """A recording with up to two arrays, temperatures and forces, with times in microseconds.

    It starts before 2038: the seconds of a ROS 2 time have 32 bits.
    """
    frames = draw(st.integers(1, 5))
    steps = draw(st.lists(st.integers(0, 10_000_000), min_size=frames - 1, max_size=frames - 1))
    times = np.cumsum([0, *steps]) * 1e-6
    readings, channels = draw(st.integers(0, 3)), draw(st.integers(1, 2))
    floats = st.floats(-1e6, 1e6)
    return Recording(
        path=Path("generated"),
        sha256="",
        serial=draw(LINES),
        started=draw(st.datetimes(datetime(1971, 1, 1), datetime(2037, 12, 31))).replace(tzinfo=UTC),  # noqa: DTZ001
        times=times,
        arrays=tuple(draw(recorded_arrays(frames)) for _ in range(draw(st.integers(1, 2)))),
        temperatures=draw(arrays(float, (readings, channels), elements=floats)) if readings else np.empty((0, 0)),
        temperature_times=np.arange(readings) * 0.5,
        setup=draw(setups()),
        gaps=tuple(draw(st.lists(LINES, max_size=2))),
        host_monotonic=np.arange(frames, dtype=np.int64),
        ticks=np.arange(frames, dtype=np.int64) * 4,
        forces=draw(arrays(float, readings, elements=floats)),
        force_times=np.arange(readings) * 0.25,
    )
