"""One indentation of a curved cover by finite elements, for the command line and for files."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from meshes import Indenter, Pose
from meshes.solids.solid_mesh import check_quality
from validation.campaign.case import tabulate_pose
from validation.curved.fast import FastPress, derive_fast_model, press_fast
from validation.curved.places import CurvedPlaces, PoseText
from validation.errors import InputError
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fem_reference.curved_cover import CurvedIndentation
    from meshes.solids import SolidMesh


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvedPress:
    """Result of one indentation of a curved cover.

    Attributes:
        sensor: The sensor.
        shape: The indenter as text.
        touch: Place and direction of the indenter.
        fem: Result of the finite elements.
        seconds: Wall time of the finite elements [s].
        fast: Result of the fast model under the same load; None if not wanted or not possible.
    """

    sensor: SensorDescription
    shape: str
    touch: Pose
    fem: CurvedIndentation
    seconds: float
    fast: FastPress | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the result as a dictionary, under the names that the command line prints as JSON."""
        found = self.fem
        vectors = ("force", "moment", "base_force", "base_moment", "unmeasured")
        return {
            "sensor": self.sensor.name,
            "cover": self.sensor.describe_cover(),
            "indenter": self.shape,
            **tabulate_pose(self.touch),
            "load": found.load,
            "models": {
                "fem": {
                    "texel_forces": found.texel_forces,
                    **{name: getattr(found, name) for name in vectors},
                    "depth": found.depth,
                    "contact_area": found.contact_area,
                    "error_estimate": dict(found.error_estimate),
                    "assumptions": dict(found.assumptions),
                    "warnings": list(found.warnings),
                    "mesh": describe_mesh(found.mesh),
                    "seconds": self.seconds,
                },
                **({"fast": self.fast.as_json()} if self.fast else {}),
            },
        }


def press_sensor(
    sensor: SensorDescription,
    indenter: Indenter,
    *,
    shape: str,
    load: float | None = None,
    depth: float | None = None,
    pose: PoseText | None = None,
    finite: bool = False,
    friction: float | None = None,
    fast: bool = False,
    progress: Callable[[str], None] | None = None,
) -> CurvedPress:
    """Press a rigid indenter on a curved cover by finite elements.

    Args:
        sensor: A sensor with a curved cover.
        indenter: The indenter.
        shape: The indenter as text.
        load: Force along the direction [N]; give either load or depth.
        depth: Distance from the first touch [m].
        pose: Place, direction and rotation of the indenter; above the middle of the array and along its normal if
            None.
        finite: Whether strains are finite; else small.
        friction: 0, or inf for no slip; that of the sensor file if None [-].
        fast: Whether the fast model presses too.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If the mesh, a texel, the place, the direction or the friction cannot be used, with one line per
            fault.
        PiercedError: If the indenter would go through most of the cover.
        ConvergenceError: If the contact is not found.
    """
    coefficient = choose_friction(sensor, friction, finite=finite)
    from fem_reference.curved_cover import press_curved, press_curved_finite

    started = time.perf_counter()
    meshes = make_meshes(sensor, progress)
    touch = CurvedPlaces(mesh=meshes[-1], texels=sensor.array).find(pose or PoseText())
    solve = press_curved_finite if finite else press_curved
    found = solve(
        meshes,
        sensor.array,
        sensor.cover.layers[0].material,
        indenter,
        touch,
        load=load,
        depth=depth,
        friction=coefficient,
        progress=progress,
    )
    seconds = time.perf_counter() - started
    cover = derive_fast_model(sensor, meshes, progress) if fast else None
    model = press_fast(cover, indenter, touch, found.load, found) if cover is not None else None
    return CurvedPress(sensor=sensor, shape=shape, touch=touch, fem=found, seconds=seconds, fast=model)


def choose_friction(sensor: SensorDescription, given: float | None = None, *, finite: bool = False) -> float:
    """Return the coefficient of friction of a press on a curved cover, 0 or inf for no slip [-].

    Args:
        sensor: The sensor, whose file may state one.
        given: Coefficient of the command line, if any [-].
        finite: Whether strains are finite.

    Raises:
        InputError: If curved covers do not have this friction.
    """
    coefficient = sensor.friction if given is None else given
    place = f"{sensor.source}: contact.friction" if given is None else "--friction"
    if coefficient not in (0.0, math.inf):
        raise InputError(f"{place}: {coefficient:g} is not computed on curved covers; accepted: 0 and no-slip")
    if coefficient and finite:
        raise InputError(f"{place}: on curved covers no slip is computed at small strain only; write --strain small")
    return coefficient


def make_meshes(sensor: SensorDescription, progress: Callable[[str], None] | None = None) -> tuple[SolidMesh, ...]:
    """Make the meshes of a sensor's curved cover, coarsest first, and check them and the texels.

    Raises:
        InputError: If the cover cannot be meshed, a mesh cannot be used, or a texel is not on the base.
    """
    from meshes.solids.solid_mesh import check_texels

    if sensor.body is None:
        raise InputError(
            f"{sensor.source}: the cover has no curved body; give cover.surface, cover.mesh or a thickness"
        )
    try:
        meshes = sensor.body.meshes(progress)
        for mesh in meshes:
            check_quality(mesh).require()
        check_texels(meshes[-1], sensor.array)
    except ValueError as error:
        faults = error.faults if isinstance(error, InputError) else str(error).splitlines()
        raise InputError(*(f"{sensor.source}: {line}" for line in faults)) from None
    return meshes


def describe_mesh(mesh: SolidMesh) -> dict[str, Any]:
    """Describe a mesh and its quality as a dictionary of JSON values."""
    quality = check_quality(mesh)
    return {
        "digest": mesh.digest,
        "source": mesh.source,
        "settings": dict(mesh.settings),
        "elements": quality.elements,
        "kind": quality.kind,
        "nodes": quality.nodes,
        "volume_m3": quality.volume,
        "thickness_m": quality.thickness,
        "scaled_jacobian": quality.scaled_jacobian,
        "inverted": quality.inverted,
        "slivers": quality.slivers,
        "through": quality.through,
    }
