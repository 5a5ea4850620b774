"""`softcover press`."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from meshes import TexelArray
from validation.campaign.case import Case
from validation.campaign.comparison import METHODS, MODELS, Comparison, compare_models
from validation.cli.options import Json, MaterialName, Sensor, Thickness, collect
from validation.cli.output import print_json
from validation.cli.progress import Progress
from validation.errors import InputError, nearest
from validation.sensor_file import load as load_sensor
from validation.text.indenter import read_depth, read_indenter, read_load, read_position, read_yaw

_Shape = Annotated[str, Parameter(help="Shape, e.g. sphere:radius=5mm or box:size=10mmx10mmx5mm.")]
_Load = Annotated[str | None, Parameter(help="Force in N, or a weight in g: 4.9N, 500g.", allow_leading_hyphen=True)]
_Depth = Annotated[
    str | None, Parameter(help="Approach from first touch, instead of a load: 0.3mm.", allow_leading_hyphen=True)
]
_At = Annotated[str, Parameter(help="Indenter's axis in the array's frame.", allow_leading_hyphen=True)]
_Yaw = Annotated[str, Parameter(help="Rotation about that axis.", allow_leading_hyphen=True)]
_Friction = Annotated[
    str,
    Parameter(
        help="Between indenter and cover, in the finite elements: Coulomb's coefficient, or no-slip.",
        allow_leading_hyphen=True,
    ),
]
_Model = Annotated[str, Parameter(help="Which models: fem, fast, or both.")]
_Method = Annotated[str, Parameter(help="The fast model's contact: default, cover, foundation, area or boxes.")]


def press(
    sensor: Sensor,
    *,
    indenter: _Shape,
    load: _Load = None,
    depth: _Depth = None,
    at: _At = "0mm,0mm",
    yaw: _Yaw = "0deg",
    friction: _Friction = "0",
    model: _Model = "fem,fast",
    method: _Method = "default",
    material: MaterialName = None,
    thickness: Thickness = None,
    json: Json = False,
) -> None:
    """One indentation by the finite elements and by the fast model, and how far they agree."""
    faults: list[str] = []
    description = collect(faults, lambda: load_sensor(sensor, material=material, thickness=thickness))
    shape = collect(faults, lambda: read_indenter(indenter))
    place = collect(faults, lambda: read_position(at))
    angle = collect(faults, lambda: read_yaw(yaw))
    sticking = collect(faults, lambda: _read_friction(friction))
    models = collect(faults, lambda: _read_models(model))
    if method not in METHODS:
        faults.append(f"--method: unknown contact method {method!r}; {nearest(method, METHODS)}")
    force, approach = collect(faults, lambda: _read_force(load, depth)) or (None, None)
    if description and place:
        faults.extend(_beside(description.array, place))
    if sticking and models and "fem" not in models and depth is None:
        faults.append("--friction: the fast model has none; leave it out, or let --model name fem")
    if faults or not (description and shape and place and models) or angle is None or sticking is None:
        raise InputError(*faults)
    case = Case(
        # With a depth the load follows from the reference.
        name="press",
        indenter=shape,
        shape=indenter,
        load=force or 0.0,
        at=place,
        yaw=angle,
    )
    with Progress() as progress:
        comparison = compare_models(
            description,
            case,
            depth=approach,
            friction=sticking,
            models=models,
            method=method,
            progress=progress,
        )
    if json:
        print_json(comparison.as_json())
    else:
        _print(comparison)


def _beside(array: TexelArray, place: tuple[float, float]) -> list[str]:
    """A fault if the indenter's axis is not over the array."""
    low = array.centres[:, :2].min(axis=0) - np.array(array.texel_size) / 2
    high = array.centres[:, :2].max(axis=0) + np.array(array.texel_size) / 2
    if ((low <= place) & (place <= high)).all():
        return []
    x, y = (f"{1e3 * low[i]:.4g}..{1e3 * high[i]:.4g} mm" for i in (0, 1))
    return [f"--at: ({1e3 * place[0]:.4g}, {1e3 * place[1]:.4g}) mm is not on the array; accepted: x {x}, y {y}"]


def _read_models(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(","))
    unknown = [f"--model: unknown model {name!r}; {nearest(name, MODELS)}" for name in names if name not in MODELS]
    if unknown:
        raise InputError(*unknown)
    return names


def _read_friction(text: str) -> float:
    if text.strip() == "no-slip":
        return math.inf
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value < math.inf:
        raise InputError(f"--friction: {text!r} is not zero, a positive number or no-slip; for example --friction 0.4")
    return value


def _read_force(load: str | None, depth: str | None) -> tuple[float | None, float | None]:
    if (load is None) == (depth is None):
        raise InputError("--load, --depth: give one of them, for example --load 4.9N or --depth 0.3mm")
    return (None, read_depth(depth)) if load is None else (read_load(load), None)  # type: ignore[arg-type]


def _print(comparison: Comparison) -> None:
    from rich.console import Console

    from validation.cli.tables import comparison_table, cover_text, heat_maps

    console = Console()
    case, sensor = comparison.case, comparison.sensor
    console.print(f"{case.shape} on {sensor.name}, {case.load:.4g} N at {case.pose}", highlight=False)
    console.print(f"cover: {cover_text(sensor.cover)}\n", highlight=False)
    images = []
    if comparison.fem is not None and "fem" in comparison.models:
        images.append(("finite elements", comparison.fem.texel_forces))
    if comparison.fast is not None:
        images.append(("fast model", comparison.fast.texel_forces))
    console.print(heat_maps(sensor.array, images, width=console.width))
    console.print(comparison_table(comparison))
