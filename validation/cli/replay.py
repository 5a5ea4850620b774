"""`softcover replay`."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from validation.cli.monitor import Monitor
from validation.cli.options import Json
from validation.cli.output import print_json, say
from validation.errors import InputError

if TYPE_CHECKING:
    from validation.recordings.recording import Recording

_File = Annotated[Path, Parameter(help="A recording: .mcap, .dsa, .csv, .bag, or a folder of ROS 2.")]
_Array = Annotated[int, Parameter(help="Which array, where the recording has several.")]
_Speed = Annotated[float, Parameter(help="How fast, 1 for the recording's own time; 0 shows no frames.")]
_Csv = Annotated[Path | None, Parameter(name="--csv", help="Also write the array's frames as CSV.")]
_Topic = Annotated[str | None, Parameter(help="Topic with the frames, in bags of other programs.")]


def replay(
    file: _File,
    *,
    array: _Array = 0,
    speed: _Speed = 1.0,
    csv: _Csv = None,
    topic: _Topic = None,
    json: Json = False,
) -> None:
    """Show a recording in the terminal, and what it says of itself."""
    from validation.recordings import tables
    from validation.recordings.importing import open_recording

    recording = open_recording(file, topic=topic)
    if not 0 <= array < len(recording.arrays):
        raise InputError(f"--array: there are {len(recording.arrays)} arrays; accepted: 0..{len(recording.arrays) - 1}")
    if not 0 <= speed < float("inf"):
        raise InputError(f"--speed: {speed} is no speed; accepted: 0 or more")
    if csv is not None:
        tables.write(recording, csv, array=array)
    if json:
        print_json(describe(recording))
        return
    if speed and sys.stderr.isatty():
        _play(recording, array, speed)
    _tell(recording)


def describe(recording: Recording) -> dict[str, Any]:
    """What a recording says of itself, for `--json`."""
    return {
        "path": str(recording.path),
        "sha256": recording.sha256,
        "serial": recording.serial,
        "started": recording.started.isoformat(),
        "frames": len(recording.times),
        "seconds": recording.seconds,
        "rate_hz": recording.frame_rate,
        "complete": recording.complete,
        "gaps": list(recording.gaps),
        "setup": {**vars(recording.setup), "device": dict(recording.setup.device)},
        "arrays": [
            {
                "name": array.texels.name,
                "rows": array.texels.rows,
                "columns": array.texels.columns,
                "active": int(array.texels.active.sum()),
                "full_scale": array.full_scale,
                "largest": int(array.counts.max(initial=0)),
            }
            for array in recording.arrays
        ],
        "force_readings": len(recording.forces),
    }


def _play(recording: Recording, array: int, speed: float) -> None:
    recorded = recording.arrays[array]
    start = time.monotonic()
    with Monitor(columns=recorded.texels.columns, full_scale=recorded.full_scale) as monitor:
        for moment, counts in zip(recording.times, recorded.counts, strict=True):
            time.sleep(max(0.0, moment / speed - (time.monotonic() - start)))
            if monitor.due:
                monitor.show(counts, f"{moment:6.1f} of {recording.seconds:.1f} s")


def _tell(recording: Recording) -> None:
    setup, seconds = recording.setup, recording.seconds
    load = "" if setup.load is None else f", {setup.load:.4g} N"
    arrays = ", ".join(f"{array.texels.columns} x {array.texels.rows}" for array in recording.arrays)
    say(f"{recording.path}: {len(recording.times)} frames in {seconds:.1f} s, arrays {arrays}")
    say(f"indenter {setup.indenter or 'not known'}{load}; {setup.note or 'no note'}")
    end = "closed properly" if recording.complete else "cut off: all but the last half second is there"
    say(f"{len(recording.gaps)} gaps; {end}")
