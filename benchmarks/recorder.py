"""Record an emulated sensor for minutes with every kind of fault at once, and compare the file with the device's clock.

    python benchmarks/recorder.py --seconds 600 --out recorder.mcap

The emulator runs in a process of its own.  It takes a frame every 1/271 s and stamps it by its clock, in whole
milliseconds, so that the clock tells how many frames are missing between any two that arrived.  The script prints the
largest relative error of the gaps of 100 frames or more, the number of shorter gaps that are told wrong, and the 95 %
quantile of the distance between header stamps and the device's clock.  It ends with status 1 if a limit is missed.
"""

from __future__ import annotations

import argparse
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from validation.recordings import mcap_reader
from validation.recordings.capture import record
from validation.recordings.recording import Recording
from validation.weiss.sensor import Sensor
from validation.weiss.virtual import FAULTS

#: Frames per second and probability of each kind of fault for each message.
_RATE, _SHARE = 271.0, 0.01
#: Length of the pauses [s], which repeat, and time between their starts [s].
_PAUSES, _EVERY = (0.05, 0.4, 1.0, 3.0, 8.0), 20.0
#: Largest relative error of a gap, and largest distance of a stamp from the device's clock [s], for 95 % of the frames.
_LARGEST_GAP_ERROR, _LARGEST_STAMP_ERROR = 0.01, 2e-3
#: Number of missing frames from which a gap counts as long.
_LONG = 100


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """How a recording compares with the clock of the device.

    Attributes:
        frames: Number of recorded frames.
        missing: Number of missing frames by the device's clock.
        told: Number of missing frames that the recording tells.
        long: Number of gaps of 100 frames or more.
        long_error: Largest relative error of the frames that such a gap tells [-].
        short_errors: Number of shorter gaps whose number of frames is told wrong, or that are not told, or not there.
        stamp_error: 95 % quantile of the distance between stamps and the device's clock, median removed [s].
        arrival_error: The same of the arrival times [s].
    """

    frames: int
    missing: int
    told: int
    long: int
    long_error: float
    short_errors: int
    stamp_error: float
    arrival_error: float

    @property
    def is_good(self) -> bool:
        """Whether every gap is told within 1 % and 95 % of the stamps lie within 2 ms of the device's clock."""
        right = self.long_error <= _LARGEST_GAP_ERROR and not self.short_errors
        return right and self.stamp_error <= _LARGEST_STAMP_ERROR


def compare(recording: Recording, rate: float = _RATE) -> Comparison:
    """Compare gaps and stamps of a recording with the clock of a device that takes `rate` frames per second [Hz]."""
    told: dict[int, int] = {}
    for gap in recording.gaps:
        if found := re.match(r"frames missing, after tick (\d+), (\d+) frames", gap):
            told[int(found[1])] = int(found[2])
    steps = [
        (before, round((after - before) * 1e-3 * rate) - 1)
        for before, after in pairwise(recording.ticks.tolist())
        if after != before  # a repeated frame
    ]
    long = [(before, count) for before, count in steps if count >= _LONG]
    short = [(before, count) for before, count in steps if count < _LONG]
    taken = recording.ticks * 1e-3
    arrival = (recording.host_monotonic - recording.host_monotonic[0]) * 1e-9
    stamp_error, arrival_error = (
        float(np.quantile(np.abs(errors - np.median(errors)), 0.95))
        for errors in (recording.times - taken, arrival - taken)
    )
    return Comparison(
        frames=len(taken),
        missing=sum(count for _, count in steps),
        told=sum(told.values()),
        long=len(long),
        long_error=max((abs(told.get(before, 0) / count - 1) for before, count in long), default=0.0),
        short_errors=sum(told.get(before, 0) != count for before, count in short),
        stamp_error=stamp_error,
        arrival_error=arrival_error,
    )


def emulate(port: Path, seconds: float, seed: int) -> subprocess.Popen[bytes]:
    """Start an emulator with every kind of fault and pauses, and wait until its port is there."""
    words = ["emulate", str(port), "--show", "ramp", "--rate", str(_RATE), "--seed", str(seed)]
    words += [word for name in FAULTS for word in ("--fault", f"{name}={_SHARE}")]
    starts = np.arange(2.0, seconds, _EVERY)
    words += [
        word
        for number, start in enumerate(starts)
        for word in ("--pause", f"{start:.3f}:{start + _PAUSES[number % len(_PAUSES)]:.3f}")
    ]
    code = "import sys; from validation.cli.entry import main; main(sys.argv[1:])"
    run = subprocess.Popen([sys.executable, "-c", code, *words])
    while not port.exists():
        if run.poll() is not None:
            raise RuntimeError(f"the emulator ended with status {run.returncode}")
        time.sleep(0.05)
    return run


def main() -> None:
    """Record, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0, help="duration of the recording [s]")
    parser.add_argument("--out", type=Path, default=Path("recorder.mcap"), help="new file of the recording")
    parser.add_argument("--seed", type=int, default=0, help="seed of the faults")
    options = parser.parse_args()
    port = options.out.with_suffix(".port")
    run = emulate(port, options.seconds, options.seed)
    try:
        with Sensor(str(port)) as sensor:
            done = record(sensor, options.out, seconds=options.seconds)
    finally:
        run.send_signal(signal.SIGTERM)
        run.wait()
    found = compare(mcap_reader.read(options.out))
    print(f"{done.seconds:.1f} s, {found.frames} frames, {done.gaps} gaps; {done.residual}")
    print(f"missing frames: {found.missing} by the device's clock, {found.told} told")
    print(f"{found.long} gaps of {_LONG} frames or more, largest error {100 * found.long_error:.2f} %")
    print(f"{found.short_errors} shorter gaps told wrong")
    print(f"95 % of stamps within {1e3 * found.stamp_error:.2f} ms of the device's clock, ", end="")
    print(f"of arrivals within {1e3 * found.arrival_error:.2f} ms")
    print(f"emulator ended with status {run.returncode}; {'passed' if found.is_good else 'FAILED'}")
    if not found.is_good or run.returncode:
        sys.exit(1)


if __name__ == "__main__":
    main()
