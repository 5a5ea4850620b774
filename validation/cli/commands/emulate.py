"""The command `softcover emulate`, which replaces a real sensor by a program that speaks the sensor's protocol."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from validation.cli import options, output
from validation.errors import InputError, at, nearest

if TYPE_CHECKING:
    from validation.weiss.virtual import Misbehaviour

#: Names of the tactile images that the emulated sensor can show without a recording or a model.
_PATTERNS = ("blob", "ramp", "corner", "zero")


def emulate(
    port: str | None = None,
    *,
    show: Annotated[str, Parameter(metavar="IMAGE")] = "blob",
    array: options.PressedArrayIndex = None,
    indenter: Annotated[str | None, Parameter(metavar="INDENTER")] = None,
    load: options.Force | None = None,
    rate: Annotated[float, Parameter(metavar="HERTZ")] = 271.0,
    fault: Annotated[list[str] | None, Parameter(metavar="FAULT=SHARE")] = None,
    pause: Annotated[list[str] | None, Parameter(metavar="FROM:TO")] = None,
    seconds: options.Time | None = None,
    seed: int = 0,
    tag: options.Text = "softcover",
    json: options.Json = False,
) -> None:
    """Emulate a sensor on a serial port, for tests without the device.

    Examples of use:

        softcover emulate /tmp/wts
        softcover emulate /tmp/wts --show touch.mcap --fault lose=0.01
        softcover emulate /tmp/wts --show wts-0614-34 --indenter sphere:radius=5mm --load 8N

    Args:
        port: A new name, which becomes a link to a pseudo-terminal, or an existing port.
        show: What the sensor shows: a pattern (blob, ramp, corner, zero), a recording, or the fast model of a sensor
            file, a built-in sensor or a folder that `derive --out` wrote.
        indenter: Shape of the indenter that presses on the fast model; sphere:radius=8mm when not given.
        load: Largest load of that indenter; 5N when not given.
        rate: Frames per second when free-running.
        fault: A fault and how often, e.g. lose=0.01; may be repeated.
        pause: Send no frames in this time, e.g. 2s:3s; may be repeated.
        seconds: Unplug after this time, e.g. 10s; until Ctrl-C when not given.
        seed: Seed of the random numbers of faults.
        tag: Name that the sensor gives as its device tag; some clients wait for one.
    """
    from validation.extras import require

    require("serial", useful=("skfem",) if show.endswith(".toml") else ())
    from validation.weiss.virtual import PseudoTerminal, SerialEnd, VirtualSensor, serve

    options.check_range("--seconds", seconds)
    if not rate > 0:
        raise InputError(f"--rate: must be positive, not {rate:g}; write for example --rate 100")
    misbehaviour = _read_misbehaviour(fault or [], pause or [], seed)
    with at(""):
        shown = _find_shown(show, array, indenter, load)
        sensor = VirtualSensor(**shown, rate=rate, tag=tag, misbehaviour=misbehaviour)
    is_device = port and ("://" in port or port.startswith(("/dev/", "COM")))
    with contextlib.closing(SerialEnd(port) if port and is_device else PseudoTerminal(port)) as end:
        if json:
            output.print_json({"port": end.name, "rate_hz": rate, "show": show, "type": sensor.type, "tag": tag})
        else:
            output.say(f"a sensor of type {sensor.type} answers on {end.name} (Ctrl-C unplugs it)")
        with contextlib.suppress(KeyboardInterrupt):
            serve(sensor, end, seconds=seconds)
    output.say(f"{sensor.frames_sent} frames sent")


def _read_misbehaviour(faults: list[str], pauses: list[str], seed: int) -> Misbehaviour:
    from validation.weiss.virtual import FAULTS, Misbehaviour

    rates = {}
    for text in faults:
        name, _, rate = text.partition("=")
        if name in rates:
            raise InputError(f"--fault: {name} is given twice; give each fault once")
        try:
            rates[name] = float(rate)
        except ValueError as error:
            known = f"accepted: {', '.join(FAULTS)}"
            raise InputError(f"--fault: {text!r} is no fault and how often, such as lose=0.01; {known}") from error
    spans = tuple(options.read_time_span("--pause", text, "2s:3s") for text in pauses)
    with at("--fault: "):
        return Misbehaviour(rates=rates, pauses=spans, seed=seed)


def _find_shown(show: str, array: int | None, indenter: str | None, load: str | None) -> dict[str, Any]:
    """Find the frames that the sensor shows and the properties of its array, as options of `VirtualSensor`.

    Args:
        show: Name of a pattern or of a built-in sensor, or path of a recording, a sensor file or a folder that
            `softcover derive` wrote.
        array: Index of the array in a recording; None for the one that is pressed most.
        indenter: Shape of the indenter that presses on the fast model.
        load: Largest load of this indenter, with its unit.

    Raises:
        InputError: If nothing of this name exists, a recording holds no frames, or counts do not fit the protocol.
    """
    from validation.sensor_file import BUILT_IN, CURVED
    from validation.weiss.protocol import LARGEST_COUNT, MatrixInfo
    from validation.weiss.virtual import show_frames, show_pattern, show_recording

    path = Path(show)
    is_pressed = show in BUILT_IN or show.endswith(".toml") or (path / "parameters.toml").exists()
    if (show in _PATTERNS or is_pressed) and array is not None:
        raise InputError(f"--array: is for recordings; leave it out with --show {show}")
    if not is_pressed and (indenter or load):
        raise InputError(f"--indenter, --load: press on the fast model of a sensor; leave them out with --show {show}")
    if show in _PATTERNS:
        return {"source": show_pattern(show)}
    if show in CURVED:
        raise InputError(
            f"--show: {show} has a curved cover; run softcover derive {show} --out FOLDER and name the folder"
        )
    if show not in BUILT_IN and not path.exists():
        known = nearest(show, (*_PATTERNS, *BUILT_IN))
        raise InputError(f"--show: no pattern, sensor, recording or folder {show!r}; {known}")
    if is_pressed:
        from validation.parameters import find_parameters
        from validation.recordings.live_frames import simulate_frames
        from validation.text.indenter import read_indenter, read_load

        found = options.read_sensor(show)
        shape, weight = read_indenter(indenter or "sphere:radius=8mm"), read_load(load or "5N")
        options.tell_unused(found)
        with output.Progress() as progress:
            parameters = find_parameters(found, progress)
        texels, full_scale, active = parameters.array, parameters.electronics.output_max, parameters.array.active
        frames = simulate_frames(parameters, shape, load=weight)
        source = show_frames(frame.counts for frame in frames)
    else:
        from validation.recordings.importing import open_recording

        recording = open_recording(path)
        from validation.recordings.recording import choose_array

        if not len(recording.times):
            raise InputError(f"--show: {path} holds no frames to show")
        recorded = recording.arrays[choose_array(recording, array)]
        texels, full_scale, active = recorded.texels, recorded.full_scale, recorded.texels.active & recorded.enabled
        source = show_recording(recording.times, recorded.counts)
    if full_scale > LARGEST_COUNT:
        raise InputError(f"--show: {show} has counts up to {full_scale}; the protocol has 12 bits, 0..{LARGEST_COUNT}")
    matrix = MatrixInfo(texels.columns, texels.rows, *texels.pitch, full_scale=full_scale)
    return {"source": source, "matrix": matrix, "active": active}
