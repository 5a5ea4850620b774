"""The command `softcover record`, which records the frames of a real sensor."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from validation.cli.live_image import LiveImage
from validation.cli.options import Json, Note, RecordedIndenter, RecordedLoad, check_range, read_setup
from validation.cli.output import print_json, say
from validation.errors import InputError

if TYPE_CHECKING:
    from validation.recordings.capture import Captured
    from validation.weiss.protocol import Reading
    from validation.weiss.stream import Gap

#: Largest values of the sensor's settings that have 16 bits (interval, threshold) and 8 bits (gain).
_MOST_16_BIT, _MOST_8_BIT = 0xFFFF, 0xFF


def record(
    port: str,
    *,
    out: Path = Path(),
    seconds: float | None = None,
    indenter: RecordedIndenter = "",
    load: RecordedLoad = None,
    note: Note = "",
    threshold: int | None = None,
    gain: int | None = None,
    tare: bool = False,
    run_length: bool = False,
    interval_ms: int = 0,
    reconnect: float = 0.0,
    baud_rate: int = 115_200,
    json: Json = False,
) -> None:
    """Record a real sensor in an MCAP file, with a live image.

    The file holds the raw bytes, the frames, images that ROS 2 tools can show, and a description of the measurement.

    Examples of use:

        softcover record /dev/ttyACM0 --indenter sphere:radius=5mm --load 500g --seconds 10
        softcover record /dev/ttyACM0 --out touch.mcap --note 'third trial' --reconnect 5

    Args:
        port: Port of the sensor, e.g. /dev/ttyACM0, or a pyserial URL.
        out: New .mcap file, or a folder for a file named by the time.
        seconds: How long [s]; until Ctrl-C when not given.
        threshold: Set the sensor's threshold first [counts].
        gain: Set the sensor's front-end gain first.
        tare: Let the sensor take the image at the start as zero.
        run_length: Ask for run-length encoded frames, for slow lines.
        interval_ms: Time between frames [ms]; 0 for as fast as the sensor can.
        reconnect: How long to wait for a lost port to return [s].
        baud_rate: Speed of a true UART; USB ports ignore it.
    """
    from validation.recordings.capture import record as capture
    from validation.weiss.sensor import Sensor

    setup = read_setup(indenter, load, note)
    check_range("--seconds", seconds)
    check_range("--reconnect", reconnect)
    check_range("--interval-ms", interval_ms, _MOST_16_BIT)
    if seconds is not None and interval_ms * 1e-3 > seconds:
        raise InputError(f"--interval-ms: no frame would come within --seconds {seconds:g}; give a shorter interval")
    check_range("--threshold", threshold, _MOST_16_BIT)
    check_range("--gain", gain, _MOST_8_BIT)
    path = _make_path(out)
    with Sensor(port, baud_rate=baud_rate) as sensor:
        if threshold is not None:
            sensor.set_threshold(threshold)
        if gain is not None:
            sensor.set_gain(gain)
        if tare:
            sensor.tare()
        matrix = sensor.read_matrix()
        with LiveImage(columns=matrix.columns, full_scale=matrix.full_scale, quiet=json) as live:
            done = capture(
                sensor,
                path,
                setup=setup,
                seconds=seconds,
                run_length=run_length,
                interval_ms=interval_ms,
                reconnect=reconnect,
                on_event=_EventDisplay(live),
            )
    _show_summary(done, json=json)


def _show_summary(done: Captured, *, json: bool) -> None:
    """Print how a recording ended, as text or as JSON."""
    if json:
        residual = {
            f"{name}_s" if isinstance(value, float) else name: value for name, value in vars(done.residual).items()
        }
        print_json({**vars(done), "path": str(done.path), "rate_hz": done.rate, "residual": residual})
    else:
        say(f"wrote {done.path}: {done.frames} frames, {done.rate:.1f} frames/s, {done.gaps} gaps ({done.ended})")
        say(str(done.residual))


def _make_path(out: Path) -> Path:
    """Return the path of the new file, and make its folder.

    Args:
        out: Path of an .mcap file; or a folder, in which the file is named by date and time.

    Raises:
        InputError: If the file exists.
    """
    path = out if out.suffix == ".mcap" else out / time.strftime("touch-%Y%m%d-%H%M%S.mcap")
    if path.exists():
        raise InputError(f"--out: {path} exists; name a new file")
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


class _EventDisplay:
    """Counts the frames and gaps of a recording, and shows the latest frame whenever the live image is due.

    Args:
        live: The live image.
    """

    def __init__(self, live: LiveImage) -> None:
        self._live = live
        self._frames = self._gaps = 0
        self._start = time.monotonic()
        #: Number of frames and time since the start [s] when the latest live image was shown.
        self._shown = (0, 0.0)

    def __call__(self, event: Reading | Gap) -> None:
        """Count one frame or gap; show the frame if the live image is due."""
        counts = getattr(event, "counts", None)
        if counts is None:
            self._gaps += 1
            return
        self._frames += 1
        if self._live.is_due:
            seconds = time.monotonic() - self._start
            (frames, then), self._shown = self._shown, (self._frames, seconds)
            rate = f"{(self._frames - frames) / (seconds - then):.1f} frames/s  " if frames else ""
            self._live.show(counts, f"{seconds:6.1f} s  {self._frames} frames  {rate}{self._gaps} gaps")
