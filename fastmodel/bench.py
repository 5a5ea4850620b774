"""The guided rig: an indenter of the mass of its weight on a slide along the array's normal.

This is the bench experiment (a dead weight let down in a guide) as a model of its own, frictionless like the
reference and settled to rest.  What it returns is steady and before the electronics.  How far the indenter sinks
means nothing here: with rigid texels that is an engine setting.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.contact.boxes import ContactReader, Reading, TexelContact
from fastmodel.contact.methods import DEFAULT, choose
from fastmodel.errors import FastModelError, MissedArrayError
from fastmodel.parameters import Parameters
from fastmodel.pose import Pose, about_z
from fastmodel.sensor import recommend_options
from meshes import Indenter
from meshes.constants import STANDARD_GRAVITY

FloatArray = npt.NDArray[np.float64]

#: Step of the rig's own model [s].
TIMESTEP = 1e-3
#: Time that is given to come to rest [s].
SETTLE_TIME = 1.0
#: Time over which forces are averaged where contacts keep flickering [s].
AVERAGE_TIME = 1.0
#: Distance of the mean force from the load that still counts as carried [-].
CARRIED = 1e-3
#: Acceleration over gravity, and speed [m/s], below which the indenter rests [-].
REST = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class FastIndentation:
    """Steady forces of one indentation by the fast model.

    Attributes:
        contact_forces: Force that presses on each texel before spread, shape (n,) [N].
        texel_forces: After spread, shape (n,); masked texels are zero [N].
        outside: Force that no texel feels after spread [N].
        total_force: All force that presses on the array and its margin: the weight [N].
        chatter: Standard deviation of the total force over time where contacts flickered and forces are means,
            over the load; zero where the indenter came to rest [-].
        depth: Approach of the indenter from first touch of the undeformed cover; None where the method has none that
            means anything, or for several or tilting indenters [m].
        method: Name of the contact method, or its settings.
        seconds: Wall time [s].
    """

    contact_forces: FloatArray
    texel_forces: FloatArray
    outside: float
    total_force: float
    chatter: float
    depth: float | None
    method: str
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Placement:
    """One indenter of several that press at once.

    Attributes:
        indenter: The shape.
        load: Its weight [N].
        at: Its axis in the array's frame [m].
        yaw: Its turn about that axis [rad].
        guided: Whether it can only move along the array's normal; else it may tilt about both other axes as well.
        centre: Where its weight acts, from its axis, in its own frame [m].
    """

    indenter: Indenter
    load: float
    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    guided: bool = True
    centre: tuple[float, float] = (0.0, 0.0)


def indent(
    parameters: Parameters,
    indenter: Indenter,
    *,
    load: float,
    at: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    method: str | TexelContact = DEFAULT,
) -> FastIndentation:
    """Let an indenter down on the array, guided along the array's z axis, and wait until it rests.

    Args:
        parameters: The array and its cover.
        indenter: The shape.
        load: Its weight [N].
        at: Its axis in the array's frame [m].
        yaw: Its turn about that axis [rad].
        method: Contact method, by name (`fastmodel.METHODS`) or as settings; the best one that the parameters allow
            when not given.

    Raises:
        FastModelError: If the load is not positive or a number not finite.
        MissedArrayError: If the indenter finds no texel under it, or does not come to rest on them.
        UnknownNameError: If the method's name is unknown.
        ParametersError: If the method needs cover data that the parameters lack.
    """
    placement = Placement(indenter=indenter, load=load, at=at, yaw=yaw)
    return indent_together(parameters, [placement], method=method)


def indent_together(
    parameters: Parameters, placements: Sequence[Placement], *, method: str | TexelContact = DEFAULT
) -> FastIndentation:
    """Let several indenters down at once, guided or free to tilt.

    Args:
        parameters: The array and its cover.
        placements: The indenters; they must not touch one another.
        method: Contact method, as for `indent`.

    Raises:
        FastModelError: If a load is not positive or a number not finite.
        MissedArrayError: If an indenter finds no texel under it, or does not come to rest on them.
        UnknownNameError: If the method's name is unknown.
        ParametersError: If the method needs cover data that the parameters lack.
    """
    started = time.perf_counter()
    for each in placements:
        if not 0 < each.load < np.inf or not np.isfinite([*each.at, each.yaw, *each.centre]).all():
            raise FastModelError(
                f"load must be positive and at, yaw finite; not {each.load} N, {each.at} m, {each.yaw} rad"
            )
    name, chosen = choose(method, parameters)
    model = _model(parameters, placements, chosen)
    reader = chosen.bind(model, parameters.array, _ARRAY, cells=parameters.cells, native=False)
    reading, chatter = _settle(model, reader, sum(each.load for each in placements))
    texel_forces = reading.texel_forces
    if texel_forces is None:
        texel_forces = parameters.spread.operator(parameters.array) @ reading.contact_forces
    approach = reading.approach
    return FastIndentation(
        contact_forces=reading.contact_forces,
        texel_forces=texel_forces,
        outside=float(reading.carried - texel_forces.sum()),
        total_force=reading.carried,
        chatter=chatter,
        depth=float(approach[0]) if approach is not None and len(placements) == 1 and placements[0].guided else None,
        method=name,
        seconds=time.perf_counter() - started,
    )


def add_geoms(spec: Any, body: Any, indenter: Indenter, *, name: str = "indenter") -> None:  # noqa: ANN401 -- MjSpec, mjsBody
    """Make an indenter's solids massless geoms of a body.

    Args:
        spec: The `mujoco.MjSpec` to edit; shapes that no primitive gives become meshes of it.
        body: Its body.
        indenter: The shape.
        name: Prefix of the meshes' names.
    """
    for number, primitive in enumerate(indenter.primitives()):
        mesh = ""
        if primitive.vertices:
            mesh = f"{name}/part{number}"
            spec.add_mesh(name=mesh, uservert=np.ravel(primitive.vertices).tolist())
        body.add_geom(
            type=_GEOMS[primitive.kind],
            size=[*primitive.size, 0.0, 0.0, 0.0][:3],
            pos=primitive.position,
            quat=primitive.quaternion,
            meshname=mesh,
            mass=0.0,
        )


_ARRAY = "array"
_GEOMS = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}


def _model(parameters: Parameters, placements: Sequence[Placement], method: TexelContact) -> Any:  # noqa: ANN401 -- MjModel
    spec = mujoco.MjSpec()
    recommend_options(spec)
    spec.option.timestep = TIMESTEP
    spec.option.gravity = [0, 0, -STANDARD_GRAVITY]
    spec.option.tolerance = 1e-12
    here = Pose.of((0, 0, 0), (1, 0, 0, 0))
    method.attach(spec.worldbody, parameters.array, here, _ARRAY)
    for number, placement in enumerate(placements):
        _add_body(spec, parameters, placement, f"indenter{number}")
    for geom in spec.geoms:
        # Frictionless, like the reference: with friction an indenter's edge can hook on the side of a box and lift it.
        geom.condim = 1
    return spec.compile()


def _add_body(spec: Any, parameters: Parameters, placement: Placement, name: str) -> None:  # noqa: ANN401 -- MjSpec
    at = placement.at
    height = _touch_height(parameters, placement.indenter, at)
    body = spec.worldbody.add_body(name=name, pos=[at[0], at[1], height], quat=about_z(placement.yaw))
    body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    # The mass of its weight, as on the bench: a light indenter under a large force tunnels through the texels.
    mass = placement.load / STANDARD_GRAVITY
    body.mass, body.explicitinertial = mass, True
    body.inertia = [1e-6 * mass] * 3
    if not placement.guided:
        body.ipos = [*placement.centre, 0.0]
        for axis in ((1, 0, 0), (0, 1, 0)):
            body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
        body.inertia = [mass * max(placement.indenter.footprint) ** 2] * 3
    add_geoms(spec, body, placement.indenter, name=name)


def _touch_height(parameters: Parameters, indenter: Indenter, at: tuple[float, float]) -> float:
    """Height that keeps the indenter clear of a curved array; the surface itself on a flat one [m]."""
    array = parameters.array
    if array.planar:
        return 0.0
    reach = np.hypot(*indenter.footprint) + max(array.pitch)
    under = np.hypot(array.centres[:, 0] - at[0], array.centres[:, 1] - at[1]) <= reach
    return float(array.centres[under, 2].max(initial=0.0)) + max(array.pitch)


def _settle(model: Any, reader: ContactReader, load: float) -> tuple[Reading, float]:  # noqa: ANN401 -- MjModel
    """Step until the indenters rest: the reading there and its chatter.

    Where a face hovers at the edge of touching one more texel, contacts come and go for ever.  The mean over time
    is the steady force then, because it carries exactly the weight.
    """
    data = mujoco.MjData(model)
    for _ in range(int(SETTLE_TIME / TIMESTEP)):
        mujoco.mj_step(model, data)
        if data.ncon and np.abs(data.qacc).max() < REST * STANDARD_GRAVITY and np.abs(data.qvel).max() < REST:
            reading = reader.read(data)
            if reading.contact_forces.any():
                return reading, 0.0
    taken = [_step(model, data, reader) for _ in range(int(AVERAGE_TIME / TIMESTEP))]
    totals = np.array([each.carried for each in taken])
    felt = np.array([each.contact_forces for each in taken])
    if abs(totals.mean() / load - 1) > CARRIED or not felt.any():
        raise MissedArrayError(
            f"the indenter did not come to rest on the texels: they carry {felt.sum(axis=1).mean():.4g} N of "
            f"{load:.4g} N; 'at' must lie on the array"
        )
    spread = [each.texel_forces for each in taken if each.texel_forces is not None]
    mean = Reading(
        contact_forces=felt.mean(axis=0),
        texel_forces=np.mean(spread, axis=0) if spread else None,
        carried=float(totals.mean()),
        approach=taken[-1].approach,
    )
    return mean, float(totals.std() / load)


def _step(model: Any, data: Any, reader: ContactReader) -> Reading:  # noqa: ANN401 -- MjModel and MjData
    mujoco.mj_step(model, data)
    return reader.read(data)
