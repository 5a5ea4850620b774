"""`softcover emulate`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.monitor import stoppable
from validation.cli.options import Json, within
from validation.cli.output import print_json, say
from validation.errors import InputError, nearest
from validation.text.indenter import read_indenter, read_load

if TYPE_CHECKING:
    from meshes import TexelArray
    from validation.weiss.commands import MatrixInfo
    from validation.weiss.serve import PseudoTerminal, SerialEnd
    from validation.weiss.virtual import Misbehaviour, Source

_PATTERNS = ("blob", "ramp", "corner", "zero")
_Port = Annotated[str | None, Parameter(help="Where: a new name, for a link to a pseudo-terminal, or a real port.")]
_Show = Annotated[
    str, Parameter(help="A pattern (blob, ramp, corner, zero), a recording, or a folder written by `derive`.")
]
_Array = Annotated[int, Parameter(help="Which array of a recording.")]
_Indenter = Annotated[str, Parameter(help="What presses, when the fast model is shown.")]
_Load = Annotated[str, Parameter(help="Its largest load, when the fast model is shown.")]
_Rate = Annotated[float, Parameter(help="Frames per second when free-running.")]
_Fault = Annotated[list[str] | None, Parameter(help="A fault and how often, e.g. lose=0.01; may be repeated.")]
_Pause = Annotated[list[str] | None, Parameter(help="From when to when no frames come, e.g. 2:3 [s].")]
_Seconds = Annotated[float | None, Parameter(help="Unplug after so long [s]; until Ctrl-C when not given.")]
_Seed = Annotated[int, Parameter(help="Start of the random numbers of faults.")]


def emulate(
    port: _Port = None,
    *,
    show: _Show = "blob",
    array: _Array = 0,
    indenter: _Indenter = "sphere:radius=8mm",
    load: _Load = "5N",
    rate: _Rate = 271.0,
    fault: _Fault = None,
    pause: _Pause = None,
    seconds: _Seconds = None,
    seed: _Seed = 0,
    json: Json = False,
) -> None:
    """Stand in for a sensor: a port that speaks the WTS protocol and shows a pattern, a recording or the model."""
    from validation.weiss.serve import serve
    from validation.weiss.virtual import WTS_0614_34, VirtualSensor

    within("--seconds", seconds)
    wrong = _misbehaviour(fault or [], pause or [], seed)
    source, matrix = _shown(show, array, indenter, load)
    sensor = VirtualSensor(source, matrix=matrix or WTS_0614_34, rate=rate, misbehaviour=wrong)
    with stoppable(), contextlib.ExitStack() as stack:
        end = _end(port)
        stack.callback(end.close)
        if json:
            print_json({"port": end.name, "rate_hz": rate, "show": show})
        else:
            say(f"a WTS sensor answers on {end.name} (Ctrl-C unplugs it)")
        with contextlib.suppress(KeyboardInterrupt):
            serve(sensor, end, seconds=seconds)
    say(f"{sensor.frames_sent} frames sent")


def _end(port: str | None) -> PseudoTerminal | SerialEnd:
    from validation.weiss.serve import PseudoTerminal, SerialEnd

    if port and ("://" in port or port.startswith(("/dev/", "COM"))):
        return SerialEnd(port)
    return PseudoTerminal(port)


def _misbehaviour(faults: list[str], pauses: list[str], seed: int) -> Misbehaviour:
    from validation.weiss.virtual import Misbehaviour

    try:
        rates = {name: float(rate) for name, _, rate in (text.partition("=") for text in faults)}
    except ValueError as error:
        raise InputError(f"--fault: {error}; write a fault and how often, for example lose=0.01") from error
    return Misbehaviour(rates=rates, pauses=tuple(_pauses(pauses)), seed=seed)


def _pauses(texts: list[str]) -> Iterator[tuple[float, float]]:
    for text in texts:
        start, _, end = text.partition(":")
        try:
            yield float(start), float(end)
        except ValueError as error:
            raise InputError(f"--pause: {text!r} is no time from:to in seconds; for example 2:3") from error


def _shown(show: str, array: int, indenter: str, load: str) -> tuple[Source, MatrixInfo | None]:
    """What to show, and the array that shows it; None for the default one."""
    from validation.weiss.virtual import from_frames, pattern, playback

    if show in _PATTERNS:
        return pattern(show), None
    place = Path(show)
    if not place.exists():
        raise InputError(f"--show: no pattern, recording or folder {show!r}; {nearest(show, _PATTERNS)}")
    if place.name == "parameters.toml" or (place / "parameters.toml").exists():
        import fastmodel
        from validation.recordings.live_frames import simulate_frames

        parameters = fastmodel.load(place)
        frames = simulate_frames(parameters, read_indenter(indenter), load=read_load(load))
        return from_frames(frames), _matrix(parameters.array, parameters.electronics.output_max)
    from validation.recordings.importing import open_recording

    recording = open_recording(place)
    if not 0 <= array < len(recording.arrays):
        raise InputError(f"--array: accepted: 0..{len(recording.arrays) - 1}, not {array}")
    if not len(recording.times):
        raise InputError(f"--show: {place} holds no frames to show")
    recorded = recording.arrays[array]
    return playback(recording.times, recorded.counts), _matrix(recorded.texels, recorded.full_scale)


def _matrix(texels: TexelArray, full_scale: int) -> MatrixInfo:
    from validation.weiss.commands import MatrixInfo

    width, height = texels.pitch
    return MatrixInfo(
        columns=texels.columns, rows=texels.rows, cell_width=width, cell_height=height, full_scale=full_scale
    )
