"""`softcover hand`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from validation.cli.options import Json
from validation.cli.output import print_json, say
from validation.cli.progress import Progress
from validation.errors import InputError, nearest

if TYPE_CHECKING:
    from validation.hand_picture import Run

#: Whose pitch, cover and electronics all arrays have.
_SENSOR = "wts-0614-34"
_FILES = ("hand.mcap", "hand.png")

_Out = Annotated[Path, Parameter(help="Folder for recording and picture; an earlier result is replaced.")]
_Method = Annotated[str, Parameter(help="Contact: default, cover, foundation, area or boxes.")]


def hand(*, out: _Out = Path("softcover-hand"), method: _Method = "default", json: Json = False) -> None:
    """A Shadow hand with 132 texels grasps a grip and turns over: recorded, drawn, and timed."""
    if not os.environ.get("DISPLAY"):
        # Has to be said before MuJoCo is loaded; without a display only this draws.
        os.environ.setdefault("MUJOCO_GL", "egl")
    from fastmodel.contact.methods import choose
    from validation.campaign.comparison import METHODS
    from validation.derivation.derive import derive
    from validation.hand import Hand, find_assets
    from validation.hand_picture import draw, record
    from validation.output_folder import new_folder
    from validation.sensor_file import load

    if method not in METHODS:
        raise InputError(f"--method: unknown contact method {method!r}; {nearest(method, METHODS)}")
    find_assets()
    with new_folder(out) as folder, Progress() as progress:
        parameters = derive(load(_SENSOR), progress=progress).parameters
        used, _ = choose(method, parameters)
        progress("the hand, once for a tenth of a second to compile what is compiled")
        for _ in Hand(parameters, method=used).run(0.1):
            pass
        progress("the hand")
        scene = Hand(parameters, method=used)
        run = record(scene, folder / _FILES[0], note=f"softcover hand --method {used}")
        draw(scene, run, folder / _FILES[1])
    result = _describe(run, used, out)
    if json:
        print_json(result)
    else:
        _tell(result)
    if run.moments[0].picture is None:
        say("the scene itself is not drawn: MuJoCo found no OpenGL (apt install libegl1)")


def _describe(run: Run, method: str, out: Path) -> dict[str, Any]:
    from validation.hand import PLACES

    largest = run.carried.max(axis=0).tolist()
    return {
        "method": method,
        "texels": sum(place.rows * place.columns for place in PLACES),
        "frames": len(run.times),
        "simulated": float(run.times[-1]),
        "seconds": run.seconds,
        "processor_seconds": run.processor_seconds,
        "real_time_factor": run.real_time_factor,
        "largest_force": {place.body: force for place, force in zip(PLACES, largest, strict=True)},
        "out": str(out),
        "files": list(_FILES),
    }


def _tell(result: dict[str, Any]) -> None:
    forces = ", ".join(f"{name} {force:.1f}" for name, force in result["largest_force"].items())
    say(f"{result['texels']} texels, {result['frames']} frames, contact {result['method']}")
    say(
        f"{result['simulated']:.1f} s in {result['seconds']:.1f} s: {result['real_time_factor']:.1f} x real time "
        f"({result['processor_seconds']:.1f} s of processor time)"
    )
    say(f"largest force on each array [N]: {forces}")
    say(f"wrote {', '.join(result['files'])} to {result['out']}; `softcover replay` shows the recording")
