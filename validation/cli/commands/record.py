"""The command `softcover record`, which records the frames of a real sensor."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli import options, output
from validation.cli.live_image import LiveImage
from validation.errors import InputError

if TYPE_CHECKING:
    from validation.weiss.protocol import Reading
    from validation.weiss.stream import Gap


def record(
    port: str,
    *,
    out: options.File = Path(),
    seconds: options.Time | None = None,
    labels: options.Labels = options.UNLABELLED,
    threshold: options.Counts | None = None,
    gain: int | None = None,
    tare: bool = False,
    run_length: bool = False,
    interval_ms: Annotated[int, Parameter(metavar="MILLISECONDS")] = 0,
    reconnect: options.Time = 0.0,
    baud_rate: Annotated[int, Parameter(metavar="BAUD")] = 115_200,
    json: options.Json = False,
) -> None:
    """Record a real sensor in an MCAP file, with a live image.

    The file holds the raw bytes, the frames, images that ROS 2 tools can show, and a description of the measurement.

    Examples of use:

        softcover record /dev/ttyACM0 --indenter sphere:radius=5mm --load 500g --seconds 10
        softcover record /dev/ttyACM0 --out touch.mcap --note 'third trial' --reconnect 5

    Args:
        port: Port of the sensor, e.g. /dev/ttyACM0, or a pyserial URL.
        out: New .mcap file, or a folder for a file named by the time.
        seconds: How long, e.g. 10s; until Ctrl-C when not given.
        threshold: Set the sensor's threshold first.
        gain: Set the sensor's front-end gain first.
        tare: Let the sensor take the image at the start as zero.
        run_length: Ask for run-length encoded frames, for slow lines.
        interval_ms: Time between frames; 0 for as fast as the sensor can.
        reconnect: How long to wait for a lost port to return, e.g. 5s.
        baud_rate: Speed of a true UART; USB ports ignore it.
    """
    from validation import api

    # Interval and threshold have 16 bits in the protocol, the gain has 8 bits.
    options.check_range("--interval-ms", interval_ms, 0xFFFF)
    options.check_range("--threshold", threshold, 0xFFFF)
    options.check_range("--gain", gain, 0xFF)
    options.check_range("--seconds", seconds)
    options.check_range("--reconnect", reconnect)
    if seconds is not None and interval_ms * 1e-3 > seconds:
        raise InputError(f"--interval-ms: no frame would come within --seconds {seconds:g}; give a shorter interval")
    if out.suffix not in {"", ".mcap"} and not out.is_dir():
        raise InputError(f"--out: {out} does not end in .mcap and is no folder; write {out.stem}.mcap")
    path = out if out.suffix == ".mcap" else out / time.strftime("touch-%Y%m%d-%H%M%S.mcap")
    with LiveImage(quiet=json) as live:
        done = api.record(
            port, path, **vars(labels), seconds=seconds, threshold=threshold, gain=gain,
            tare=tare, run_length=run_length, interval_ms=interval_ms, reconnect=reconnect, baud_rate=baud_rate,
            on_start=lambda matrix: live.set_up(matrix.columns, matrix.full_scale), on_event=_make_display(live),
        )  # fmt: skip
    if json:
        residual = {
            f"{key}_s" if isinstance(value, float) else key: value for key, value in vars(done.residual).items()
        }
        output.print_json({**vars(done), "path": str(done.path), "rate_hz": done.rate, "residual": residual})
    else:
        output.say(
            f"wrote {done.path}: {done.frames} frames, {done.rate:.1f} frames/s, {done.gaps} gaps ({done.ended})"
        )
        output.say(str(done.residual))
        if done.unknown:
            output.say(f"unknown, because the sensor did not answer: {', '.join(done.unknown)}")


def _make_display(live: LiveImage) -> Callable[[Reading | Gap], None]:
    """Make a function that counts the frames and gaps of a recording and shows the latest frame as a live image."""
    frames = gaps = shown = 0
    start = then = time.monotonic()

    def show(event: Reading | Gap) -> None:
        nonlocal frames, gaps, shown, then
        counts = getattr(event, "counts", None)
        if counts is None:
            gaps += 1
            return
        frames += 1
        if live.is_due:
            now = time.monotonic()
            rate = f"{(frames - shown) / (now - then):.1f} frames/s  " if shown else ""
            shown, then = frames, now
            live.show(counts, f"{now - start:6.1f} s  {frames} frames  {rate}{gaps} gaps")

    return show
