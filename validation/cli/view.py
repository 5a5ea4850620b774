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

from validation.cli.monitor import Monitor, stoppable
from validation.cli.options import Json, MaterialName, Sensor, Thickness, collect, within
from validation.cli.output import print_json
from validation.cli.progress import Progress
from validation.errors import InputError, nearest
from validation.indenter_text import read_indenter, read_load
from validation.sensor_file import load as load_sensor

if TYPE_CHECKING:
    from validation.sliding import Sliding

_METHODS = ("default", "cover", "foundation", "area", "boxes")
#: Simulated time where nobody watches: down and once round [s].
_UNWATCHED = 5.0

_Shape = Annotated[str, Parameter(help="Shape, e.g. sphere:radius=5mm or box:size=10mmx10mmx5mm.")]
_Load = Annotated[str, Parameter(help="Force in N, or a weight in g: 4.9N, 500g.", allow_leading_hyphen=True)]
_Method = Annotated[str, Parameter(help="Contact: default, cover, foundation, area or boxes.")]
_Seconds = Annotated[
    float | None,
    Parameter(help="Simulated time [s]; on a terminal until Ctrl-C when not given.", allow_leading_hyphen=True),
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
    json: Json = False,
) -> None:
    """Show what the fast model feels while an indenter comes down and slides in a circle."""
    faults: list[str] = []
    description = collect(faults, lambda: load_sensor(sensor, material=material, thickness=thickness))
    shape = collect(faults, lambda: read_indenter(indenter))
    weight = collect(faults, lambda: read_load(load))
    collect(faults, lambda: within("--seconds", seconds))
    if method not in _METHODS:
        faults.append(f"--method: unknown contact method {method!r}; {nearest(method, _METHODS)}")
    if faults or not (description and shape and weight):
        raise InputError(*faults)

    from validation.derive import derive
    from validation.sliding import Sliding

    with Progress() as progress:
        parameters = derive(description, progress=progress).parameters
    scene = Sliding(parameters, shape, load=weight, method=method)
    # Ctrl-C is the way to end it, so that it is no failure: what was seen last is printed.
    with stoppable(), contextlib.suppress(KeyboardInterrupt):
        _play(scene, seconds, quiet=json)
    if json:
        print_json(_describe(scene, indenter, weight))
    else:
        _print(scene, f"{indenter} on {description.name}, {weight:.4g} N")


def _play(scene: Sliding, seconds: float | None, *, quiet: bool) -> None:
    """Simulate: in real time with a picture where somebody watches, else as fast as it can."""
    watched = sys.stderr.isatty() and not quiet
    if seconds is None:
        seconds = math.inf if watched else _UNWATCHED
    parameters = scene.sensor.parameters
    full_scale = parameters.electronics.output_max
    start = time.monotonic()
    with Monitor(columns=parameters.array.columns, full_scale=full_scale, quiet=not watched) as monitor:
        for moment in scene.run(seconds):
            if watched:
                time.sleep(max(0.0, moment - (time.monotonic() - start)))
            if monitor.due:
                monitor.show(scene.sensor.frame().counts, _line(scene))


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
