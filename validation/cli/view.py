"""`softcover view`."""

from __future__ import annotations

import contextlib
import math
import sys
import time
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import numpy.typing as npt
from cyclopts import Parameter

from validation.campaign.comparison import METHODS
from validation.cli.monitor import Monitor, stoppable
from validation.cli.options import Json, MaterialName, Sensor, Thickness, collect, within
from validation.cli.output import print_json, say
from validation.cli.progress import Progress
from validation.cli.window import Window, why_no_window
from validation.errors import InputError, nearest
from validation.sensor_file import load as load_sensor
from validation.text.indenter import read_indenter, read_load

if TYPE_CHECKING:
    from validation.cli.sliding import Sliding

#: Where the live image can be shown.
DISPLAYS = ("auto", "window", "terminal")
#: Simulated time where nobody watches: down and once round [s].
_UNWATCHED = 5.0

_Shape = Annotated[str, Parameter(help="Shape, e.g. sphere:radius=5mm or box:size=10mmx10mmx5mm.")]
_Load = Annotated[str, Parameter(help="Force in N, or a weight in g: 4.9N, 500g.", allow_leading_hyphen=True)]
_Method = Annotated[str, Parameter(help="Contact: default, cover, foundation, area or boxes.")]
_Seconds = Annotated[
    float | None,
    Parameter(help="Simulated time [s]; until Ctrl-C when not given and watched.", allow_leading_hyphen=True),
]
_Display = Annotated[
    str,
    Parameter(help="Where: window (the MuJoCo viewer), terminal, or auto (the window if one can be opened)."),
]


def view(
    sensor: Sensor,
    *,
    indenter: _Shape,
    load: _Load,
    method: _Method = "default",
    material: MaterialName = None,
    thickness: Thickness = None,
    seconds: _Seconds = None,
    display: _Display = "auto",
    json: Json = False,
) -> None:
    """Show what the fast model feels while an indenter comes down and slides in a circle."""
    faults: list[str] = []
    description = collect(faults, lambda: load_sensor(sensor, material=material, thickness=thickness))
    shape = collect(faults, lambda: read_indenter(indenter))
    weight = collect(faults, lambda: read_load(load))
    collect(faults, lambda: within("--seconds", seconds))
    if method not in METHODS:
        faults.append(f"--method: unknown contact method {method!r}; {nearest(method, METHODS)}")
    shown = collect(faults, lambda: _display(display, quiet=json))
    if faults or not (description and shape and weight and shown):
        raise InputError(*faults)

    from validation.cli.sliding import Sliding
    from validation.derivation.derive import derive

    with Progress() as progress:
        parameters = derive(description, progress=progress).parameters
    scene = Sliding(parameters, shape, load=weight, method=method)
    # Ctrl-C is the way to end it, so that it is no failure: what was seen last is printed.
    with stoppable(), contextlib.suppress(KeyboardInterrupt):
        _play(scene, seconds, shown)
    if json:
        print_json(_describe(scene, indenter, weight))
    else:
        _print(scene, f"{indenter} on {description.name}, {weight:.4g} N")


def _display(wanted: str, *, quiet: bool) -> str:
    """Where to show: window, terminal or nowhere.

    Raises:
        InputError: If there is no such place, or a window was asked for where none can be opened.
    """
    if wanted not in DISPLAYS:
        raise InputError(f"--display: unknown place {wanted!r}; {nearest(wanted, DISPLAYS)}")
    watched = sys.stderr.isatty() and not quiet
    if wanted == "terminal" or (wanted == "auto" and not watched):
        return "terminal" if watched else "nowhere"
    reason = why_no_window()
    if reason is None:
        return "window"
    if wanted == "window":
        raise InputError(f"--display: no window can be opened ({reason}); use --display terminal")
    return "terminal"


def _play(scene: Sliding, seconds: float | None, shown: str) -> None:
    """Simulate: in real time with a picture where somebody watches, else as fast as it can."""
    if seconds is None:
        seconds = _UNWATCHED if shown == "nowhere" else math.inf
    if shown == "window":
        _play_in_window(scene, seconds)
        return
    watched = shown == "terminal"
    parameters = scene.sensor.parameters
    full_scale = parameters.electronics.output_max
    start = time.monotonic()
    with Monitor(columns=parameters.array.columns, full_scale=full_scale, quiet=not watched) as monitor:
        for moment in scene.run(seconds):
            if watched:
                time.sleep(max(0.0, moment - (time.monotonic() - start)))
            if monitor.due:
                monitor.show(scene.sensor.frame().counts, _line(scene))


def _play_in_window(scene: Sliding, seconds: float) -> None:
    """Simulate in real time until the window is closed or the time is over."""
    say("close the window or press Ctrl-C to end")
    start = time.monotonic()
    with Window(scene) as window:
        for moment in scene.run(seconds):
            time.sleep(max(0.0, moment - (time.monotonic() - start)))
            if not window.open:
                return
            if window.due:
                window.show(_line(scene).strip())
                if scene.data.time < moment:
                    # The viewer's own key for it.
                    scene.restart()
                    start = time.monotonic()


def _line(scene: Sliding) -> str:
    x, y = scene.place
    return f"{scene.sensor.frame().time:6.1f} s, {scene.sensor.carried():.2f} N at ({1e3 * x:.1f}, {1e3 * y:.1f}) mm"


def _forces(scene: Sliding) -> npt.NDArray[np.float64]:
    # A simulation's frames always have them.
    return np.asarray(scene.sensor.frame().texel_forces)


def _describe(scene: Sliding, indenter: str, load: float) -> dict[str, Any]:
    """The last frame, for `--json`."""
    frame, array = scene.sensor.frame(), scene.sensor.parameters.array
    return {
        "indenter": indenter,
        "load": load,
        "time": frame.time,
        "at": list(scene.place),
        "carried": scene.sensor.carried(),
        "outside": scene.sensor.outside(),
        "texel_forces": array.image(_forces(scene)),
        "counts": array.image(frame.counts),
        "image": frame.image,
    }


def _print(scene: Sliding, title: str) -> None:
    from rich.console import Console

    from validation.cli.tables import heat_maps

    console = Console()
    console.print(title, highlight=False)
    console.print(heat_maps(scene.sensor.parameters.array, [("fast model", _forces(scene))]))
    console.print(_line(scene).strip(), highlight=False)
