"""One indentation of a curved cover by finite elements, for the command line and for files."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from meshes import Indenter, Pose, SolidCover
from meshes.solids.solid_mesh import check_quality
from validation.campaign.case import tabulate_pose
from validation.curved.fast import FastPress, derive_fast_model, press_fast
from validation.curved.places import CurvedPlaces, PoseText
from validation.errors import InputError
from validation.metrics import Score, published_line, score
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fem_reference import Indentation
    from meshes.solids import SolidMesh
    from validation.campaign.case import Case


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvedPress:
    """Result of one indentation of a curved cover.

    Attributes:
        sensor: The sensor.
        shape: The indenter as text.
        touch: Place and direction of the indenter.
        fem: Result of the finite elements.
        seconds: Wall time of the finite elements [s].
        wanted: Load [N] or depth [m] that was asked for, under the name `load` or `depth`.
        fast: Result of the fast model under the same load; None if not wanted or not possible.
    """

    sensor: SensorDescription
    shape: str
    touch: Pose
    fem: Indentation
    seconds: float
    wanted: Mapping[str, float]
    fast: FastPress | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the result as a dictionary, under the names that the command line prints as JSON."""
        from validation.campaign.results import Reference

        described = Reference.of(self.fem).as_json() | {
            "mesh": self.fem.mesh and describe_mesh(self.fem.mesh),
            "seconds": self.seconds,
        }
        return {
            "sensor": self.sensor.name,
            "cover": self.sensor.describe_cover(),
            "indenter": self.shape,
            "load": self.fem.total_force,
            "wanted": dict(self.wanted),
            "stopped": None,
            **tabulate_pose(self.touch),
            "models": {"fem": described} | ({"fast": self.fast.as_json()} if self.fast else {}),
            "scores": None if self.score is None else self.score.as_json(),
        }

    @cached_property
    def score(self) -> Score | None:
        """Score of the fast model against the finite elements; None without the fast model."""
        if self.fast is None:
            return None
        return score(
            self.fem.texel_forces,
            self.fast.texel_forces,
            load=self.fem.total_force,
            array=self.sensor.array,
            line=published_line(self.sensor.electronics),
        )


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
    from fem_reference import press

    coefficient = choose_friction(sensor, friction, finite=finite)
    started = time.perf_counter()
    meshes = make_meshes(sensor, progress)
    touch = CurvedPlaces(mesh=meshes[-1], texels=sensor.array).find(pose or PoseText())
    found = press(
        sensor.cover, sensor.array, indenter, touch, load=load, depth=depth, friction=coefficient,
        strain="finite" if finite else "small", progress=progress,
    )  # fmt: skip
    seconds = time.perf_counter() - started
    cover = derive_fast_model(sensor, meshes, progress) if fast else None
    model = press_fast(cover, indenter, touch, found.total_force, found) if cover is not None else None
    wanted = {name: value for name, value in (("load", load), ("depth", depth)) if value is not None}
    return CurvedPress(sensor=sensor, shape=shape, touch=touch, fem=found, seconds=seconds, wanted=wanted, fast=model)


def press_case(sensor: SensorDescription, case: Case) -> Indentation:
    """Compute one case by finite elements at small strain, or read the result from the store."""
    from fem_reference import press

    return press(sensor.cover, sensor.array, case.indenter, case.pose, load=case.load, friction=choose_friction(sensor))


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

    if not isinstance(sensor.cover, SolidCover):
        raise InputError(f"{sensor.source}: the cover is no solid; give cover.surface, cover.mesh or a thickness")
    try:
        meshes = sensor.cover.meshes(progress)
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
