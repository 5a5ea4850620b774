"""`softcover record`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.monitor import Monitor, stoppable
from validation.cli.options import Json, within
from validation.cli.output import print_json, say
from validation.errors import InputError
from validation.text.indenter import read_indenter, read_load

if TYPE_CHECKING:
    from validation.recordings.capture import Captured
    from validation.weiss.continuity import Gap
    from validation.weiss.sensor import Reading

_Port = Annotated[str, Parameter(help="Port of the sensor, e.g. /dev/ttyACM0, or a pyserial URL.")]
_Out = Annotated[Path, Parameter(help="New .mcap file, or a folder for a file named by the time.")]
_Seconds = Annotated[float | None, Parameter(help="How long [s]; until Ctrl-C when not given.")]
_Indenter = Annotated[str, Parameter(help="What presses, e.g. sphere:radius=5mm; kept in the file.")]
_Load = Annotated[
    str | None, Parameter(help="Its force or weight, e.g. 4.9N or 500g; kept in the file.", allow_leading_hyphen=True)
]
_Note = Annotated[str, Parameter(help="Anything else to keep in the file.")]
_Threshold = Annotated[int | None, Parameter(help="Set the sensor's threshold first [counts].")]
_Gain = Annotated[int | None, Parameter(help="Set the sensor's front-end gain first.")]
_Tare = Annotated[bool, Parameter(help="Take the image at the start as zero, in the sensor.")]
_RunLength = Annotated[bool, Parameter(help="Ask for run-length encoded frames, for slow lines.")]
_Interval = Annotated[int, Parameter(help="Time between frames [ms]; 0 for as fast as the sensor can.")]
_Reconnect = Annotated[float, Parameter(help="How long to wait for a port that went away [s].")]
_Baud = Annotated[int, Parameter(help="Speed of a true UART; USB ports ignore it.")]


def record(
    port: _Port,
    *,
    out: _Out = Path(),
    seconds: _Seconds = None,
    indenter: _Indenter = "",
    load: _Load = None,
    note: _Note = "",
    threshold: _Threshold = None,
    gain: _Gain = None,
    tare: _Tare = False,
    run_length: _RunLength = False,
    interval_ms: _Interval = 0,
    reconnect: _Reconnect = 0.0,
    baud_rate: _Baud = 115_200,
    json: Json = False,
) -> None:
    """Record a sensor as MCAP: raw bytes, frames, images that ROS 2 tools show, and the set-up."""
    from validation.recordings.capture import record as capture
    from validation.recordings.recording import Setup
    from validation.weiss.sensor import Sensor

    if indenter:
        read_indenter(indenter)
    setup = Setup(indenter=indenter, load=None if load is None else read_load(load), note=note)
    within("--seconds", seconds)
    within("--reconnect", reconnect)
    within("--interval-ms", interval_ms, 0xFFFF)
    within("--threshold", threshold, 0xFFFF)
    within("--gain", gain, 0xFF)
    path = out if out.suffix == ".mcap" else out / time.strftime("touch-%Y%m%d-%H%M%S.mcap")
    if path.exists():
        raise InputError(f"--out: {path} exists; name a new file")
    path.parent.mkdir(parents=True, exist_ok=True)
    with stoppable(), Sensor(port, baud_rate=baud_rate) as sensor:
        if threshold is not None:
            sensor.set_threshold(threshold)
        if gain is not None:
            sensor.set_gain(gain)
        if tare:
            sensor.tare()
        matrix = sensor.matrix()
        with Monitor(columns=matrix.columns, full_scale=matrix.full_scale, quiet=json) as monitor:
            done = capture(
                sensor,
                path,
                setup=setup,
                seconds=seconds,
                run_length=run_length,
                interval_ms=interval_ms,
                reconnect=reconnect,
                on_event=_Shown(monitor),
            )
    _tell(done, as_json=json)


class _Shown:
    """Counts what comes and shows it now and then."""

    def __init__(self, monitor: Monitor) -> None:
        self._monitor = monitor
        self._frames = self._gaps = 0
        self._start = time.monotonic()
        #: Frames and seconds when something was shown last.
        self._before = (0, 0.0)

    def __call__(self, event: Reading | Gap) -> None:
        """Take one reading or gap."""
        counts = getattr(event, "counts", None)
        self._gaps += counts is None
        self._frames += counts is not None
        if counts is not None and self._monitor.due:
            seconds = time.monotonic() - self._start
            (frames, then), self._before = self._before, (self._frames, seconds)
            rate = f"{(self._frames - frames) / (seconds - then):.1f} frames/s  " if frames else ""
            self._monitor.show(counts, f"{seconds:6.1f} s  {self._frames} frames  {rate}{self._gaps} gaps")


def _tell(done: Captured, *, as_json: bool) -> None:
    if as_json:
        print_json({**vars(done), "path": str(done.path), "rate_hz": done.rate})
    else:
        say(f"wrote {done.path}: {done.frames} frames, {done.rate:.1f} frames/s, {done.gaps} gaps ({done.ended})")
