"""What every reader returns: frames of counts over time, per array, with where they came from."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]


class RecordingError(ValueError):
    """A recording cannot be read or used; the message says file, place and what would be accepted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedArray:
    """One texel array of a recording and its frames.

    Attributes:
        texels: The array; texels that the hardware lacks are not active.
        enabled: Texels that were switched on when recording (the dynamic mask), shape (n,).
        counts: The sensor's integers, shape (frames, n) [-].
        full_scale: Largest value that the converter can give [-].
        unit: What the file calls the unit of a count.
        centre: Where the array sits in the sensor's own drawing, (x, y, z) [m].
        rotation: How it is turned there, about x, y and z [rad].
    """

    texels: TexelArray
    enabled: BoolArray
    counts: IntArray
    full_scale: int
    unit: str
    centre: tuple[float, float, float]
    rotation: tuple[float, float, float]

    def has_layout_of(self, array: TexelArray) -> bool:
        """Whether rows, columns, texel centres and missing texels are those of `array` (to 1 um)."""
        mine = self.texels
        return (
            (mine.rows, mine.columns) == (array.rows, array.columns)
            and np.allclose(mine.centres, array.centres, rtol=0, atol=1e-6)
            and bool((mine.active == array.active).all())
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """Frames of one file.

    Attributes:
        path: The file.
        sha256: Hash of the file's bytes, hexadecimal.
        serial: The sensor's serial number.
        started: Host clock at the first frame, UTC.
        times: Time of each frame after the first, shape (frames,) [s].
        arrays: The arrays in the file's order.
        temperatures: Shape (readings, channels) [degC].
        temperature_times: Time of each reading after the first frame, shape (readings,) [s].
    """

    path: Path
    sha256: str
    serial: str
    started: datetime
    times: FloatArray
    arrays: tuple[RecordedArray, ...]
    temperatures: FloatArray
    temperature_times: FloatArray

    @property
    def seconds(self) -> float:
        """From the first frame to the last; 0 without frames [s]."""
        return float(self.times[-1]) if len(self.times) else 0.0

    @property
    def frame_rate(self) -> float:
        """Mean frames per second; NaN for fewer than two frames [Hz]."""
        span = self.times[-1] - self.times[0] if len(self.times) > 1 else 0.0
        return float((len(self.times) - 1) / span) if span > 0 else float("nan")
