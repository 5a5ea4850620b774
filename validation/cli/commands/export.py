"""The command `softcover export`, which writes a sensor for other simulators."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from validation.cli import options, output
from validation.errors import Faults

#: Advice on the next step after a model is written, by format of the model.
_NEXT = {
    "mjcf": "look at it: python -m mujoco.viewer --mjcf={path}; put it on a robot: fastmodel.attach(spec, body, "
    "fastmodel.load('{out}')), which also computes texel forces and counts",
    "gazebo": "paste the element into the <link> or <model> of a Gazebo world that loads the plugin of the 2015 report",
    "sdf": "include {path} in a world; its contact sensors publish the forces on the rigid boxes, before the cover "
    "spreads them: fastmodel.load('{out}') holds the spread, filter and electronics that make counts of them",
    "urdf": "join the link {name} to a link of your robot by a fixed joint; the forces on its boxes are those before "
    "the cover spreads them: fastmodel.load('{out}') holds the spread, filter and electronics that make counts of them",
}


def export(
    sensor: options.Sensor,
    *,
    format: Annotated[str, Parameter(metavar="FORMAT")] = "mjcf",  # noqa: A002
    method: Annotated[str, Parameter(metavar="METHOD")] = "default",
    mass: options.Mass | None = None,
    load: Annotated[str | None, Parameter(metavar="FROM:TO", allow_leading_hyphen=True)] = None,
    out: options.Folder = Path("softcover-out"),
    cover: options.CoverChanges = options.UNCHANGED,
    json: options.Json = False,
) -> None:
    """Write the sensor for other simulators: a model in MJCF, SDF or URDF, and the fast model's parameters.

    The model holds rigid boxes: a plate, or one box per texel with `--method boxes`.  What the cover does with the
    forces on them is in the parameters, which `fastmodel` reads.

    The formats drake, newton, genesis, isaac, lerobot and ros2 hold the value that the simulator asks for, fitted to
    finite elements over a range of loads, with its error, the shapes it was scored with, and where it does not hold.

    Examples of use:

        softcover export wts-0614-34 --format mjcf --out wts
        softcover export wts-0614-34 --format urdf --mass 20g
        softcover export wts-0614-34 --format sdf --method boxes
        softcover export wts-0614-34 --format mjcf --method boxes --json
        softcover export sensor.toml --format mjcf --material dragon-skin-30 --thickness 2mm
        softcover export derived --format gazebo
        softcover export wts-0614-34 --format drake --load 1N:5N

    Args:
        format: What to write: mjcf, sdf, urdf, gazebo (the plugin block of 2015), or scored values for drake, newton,
            genesis, isaac (and FlexiTac), lerobot, ros2.
        method: Contact method that the model is for: default, cover or foundation (one plate for the array), or
            boxes (one box per texel).
        mass: Mass of the array for sdf and urdf, e.g. 20g; without it sdf is static and urdf has no inertia.
        load: Range of loads for scored values, e.g. 1N:5N; when not given, from the load of a point that gives a texel
            a count to the load that saturates it.
        out: Folder for the files; an earlier result is replaced.
    """
    from validation import api
    from validation.simulator_models import read_options

    faults = Faults()
    faults.read(read_options, format, method, mass, load)
    found = faults.read(options.read_sensor, sensor, cover)
    faults.refuse()
    options.tell_unused(found)
    with output.Progress() as progress:
        done = api.export(
            found, out, format=format, method=method, mass=mass, load=load, changes=cover.words, progress=progress
        )
    if json:
        output.print_json(done.as_json())
        return
    model = done.files[0]
    output.say(f"wrote {', '.join(done.files)} to {out}")
    if done.scores:
        _show(done.scores)
    else:
        output.say(_NEXT[format].format(path=out / model, out=out, name=Path(model).stem))


def _show(scores: Mapping[str, Any]) -> None:
    """Print the values and their errors, the written ones first."""
    low, high = scores["loads"]
    output.show(f"force on a wrong texel, loads from {low:.4g} N to {high:.4g} N; the first row is written:\n")
    rows = [
        [row["name"]]
        + [f"{100 * row[key]:.1f}" if row[key] is not None else "" for key in ("mean", "worst", "unseen")]
        + [", ".join(f"{value:.3g} {row['units'].get(key, '')}".strip() for key, value in row["parameters"].items())]
        for row in scores["rows"]
    ]
    values = ", ".join(scores["rows"][0]["parameters"])
    output.print_table(("law", "mean [%]", "worst [%]", "unseen shapes [%]", values), rows, lines=False)
