"""The command `softcover view`, which shows a live simulation of the fast model."""

from __future__ import annotations

import contextlib
import math
import sys
import time
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from validation.cli import options, output
from validation.cli.live_image import LiveImage
from validation.errors import Faults, InputError, check_choice
from validation.render import escape

if TYPE_CHECKING:
    from validation.cli.view_scene import Scene

#: Places for the live image, as a user names them.
DISPLAYS = ("auto", "window", "terminal")
#: Simulated time if nobody watches, because there is no terminal [s].  In this time the indenter comes down and slides
#: once around its circle.
_UNWATCHED_SECONDS = 5.0


def view(
    sensor: options.Sensor,
    *,
    indenter: options.Shape,
    load: options.Force,
    method: options.Method = "default",
    cover: options.CoverChanges = options.UNCHANGED,
    seconds: options.Time | None = None,
    display: Annotated[str, Parameter(metavar="DISPLAY")] = "auto",
    json: options.Json = False,
) -> None:
    """Show the live image of the fast model while an indenter comes down and slides in a circle.

    On a terminal the simulation runs in real time until Ctrl-C.  It is shown in the window of MuJoCo's viewer if there
    is a display, else in the terminal.  Without a terminal, 5 s are simulated as fast as possible.  At the end the last
    image is printed.

    Examples of use:

        softcover view wts-0614-34 --indenter sphere:radius=5mm --load 500g
        softcover view wts-0614-34 --indenter sphere:radius=5mm --load 500g --display terminal
        softcover view sensor.toml --indenter box:size=6mmx6mmx5mm --load 2N --method boxes --seconds 10

    Args:
        load: Force in N, or a weight in g: 4.9N, 500g.
        seconds: Simulated time, e.g. 10s; on a terminal until Ctrl-C when not given.
        display: Where: window (the MuJoCo viewer), terminal, or auto (the window if one can be opened).
    """
    from validation.campaign.comparison import METHODS
    from validation.cli.heat_map import draw_force_images
    from validation.cli.view_scene import Scene
    from validation.parameters import find_parameters
    from validation.text.indenter import read_indenter, read_load

    faults = Faults()
    found = faults.read(options.read_sensor, sensor, cover)
    shape = faults.read(read_indenter, indenter)
    weight = faults.read(read_load, load)
    faults.read(options.check_range, "--seconds", seconds)
    faults.read(check_choice, "--method", "contact method", method, METHODS)
    place = faults.read(_choose_display, display, quiet=json)
    faults.refuse()
    warnings = options.tell_unused(found)
    with output.Progress() as progress:
        parameters = find_parameters(found, progress)
    scene = Scene(parameters, shape, load=weight, method=method)
    # Ctrl-C is the normal way to end `softcover view`: it ends the simulation, and then the last image is printed.
    with contextlib.suppress(KeyboardInterrupt):
        _play(scene, seconds, place)
    frame, array = scene.sensor.frame(), parameters.array
    if json:
        result = {
            "indenter": indenter,
            "load": weight,
            "time": frame.time,
            "at": scene.position,
            "carried": scene.sensor.carried(),
            "outside": scene.sensor.outside(),
            "net_force": frame.net_force,
            "net_torque": frame.net_torque,
            "texel_forces": array.image(scene.texel_forces),
            "pressures": None if frame.pressures is None else array.image(frame.pressures),
            "tangential": None if frame.tangential is None else frame.tangential.reshape(array.rows, array.columns, 2),
            "tangential_source": frame.tangential_source,
            "counts": array.image(frame.counts),
            "image": frame.image,
        }
        output.print_json({**result, "warnings": warnings})
        return
    console = output.make_console()
    console.print(escape(f"{indenter} on {array.name}, {weight:.4g} N"), markup=False)
    console.print(draw_force_images(array, [("fast model", scene.texel_forces)]))
    console.print(_describe_state(scene).strip(), markup=False)


def _choose_display(wanted: str, *, quiet: bool) -> Literal["window", "terminal", "nowhere"]:
    """Choose where to show the live image.

    Args:
        wanted: Place that the user chose, one of `DISPLAYS`.
        quiet: Whether to show no live image, because the result is printed as JSON.

    Raises:
        InputError: If the place is unknown, or the user chose a window and none can be opened.
    """
    from validation.cli.view_window import find_window_fault

    check_choice("--display", "place", wanted, DISPLAYS)
    watched = sys.stderr.isatty() and not quiet
    if wanted == "terminal" or (wanted == "auto" and not watched):
        return "terminal" if watched else "nowhere"
    fault = find_window_fault()
    if fault is None:
        return "window"
    if wanted == "window":
        raise InputError(f"--display: no window can be opened ({fault}); use --display terminal")
    return "terminal"


def _play(scene: Scene, seconds: options.Time | None, place: str) -> None:
    """Run the simulation, in real time if the live image is shown, else as fast as possible.

    Args:
        scene: The simulation.
        seconds: Simulated time at which to stop [s]; None for no end, or for 5 s if the image is not shown.
        place: Where the live image is shown: `window`, `terminal` or `nowhere`.
    """
    if seconds is None:
        seconds = _UNWATCHED_SECONDS if place == "nowhere" else math.inf
    start = time.monotonic()
    parameters = scene.sensor.parameters
    if place == "window":
        from validation.cli.view_window import Window

        output.say("close the window or press Ctrl-C to end")
        shown: LiveImage | Window = Window(scene)
    else:
        columns, full_scale = parameters.array.columns, parameters.electronics.output_max
        shown = LiveImage(columns=columns, full_scale=full_scale, quiet=place == "nowhere")
    with shown as display:
        for now in scene.run(seconds):
            if place != "nowhere":
                time.sleep(max(0.0, now - (time.monotonic() - start)))
            if not display.is_open:
                return
            if display.is_due:
                display.show(scene.sensor.frame().counts, _describe_state(scene))
                if scene.data.time < now:
                    # The simulated time decreased, because the user reset the simulation in the viewer's window.
                    scene.restart()
                    start = time.monotonic()


def _describe_state(scene: Scene) -> str:
    (x, y), frame = scene.position, scene.sensor.frame()
    force = "" if frame.net_force is None else f", {output.describe_vector(frame.net_force)}"
    return f"{frame.time:6.1f} s, {scene.sensor.carried():.2f} N at ({1e3 * x:.1f}, {1e3 * y:.1f}) mm{force}"
