"""The guided rig: an indenter of the mass of its weight on a slide along the array's normal.

This is the bench experiment (a dead weight let down in a guide) as a model of its own, frictionless like the
reference and settled to rest.  What it returns is steady and before the electronics.  How far the indenter sinks
means nothing here: with rigid texels that is an engine setting.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.contact import ContactReader, TexelContact, choose
from fastmodel.errors import FastModelError, MissedArrayError
from fastmodel.parameters import Parameters
from fastmodel.pose import Pose, about_z
from fastmodel.sensor import recommend_options
from meshes import Indenter, Primitive

FloatArray = npt.NDArray[np.float64]

#: Standard gravity [m/s2].
STANDARD_GRAVITY = 9.80665
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
_GEOMS = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class FastIndentation:
    """Steady forces of one indentation by the fast model.

    Attributes:
        contact_forces: Force that presses on each texel before spread, shape (n,) [N].
        texel_forces: After spread, shape (n,); masked texels are zero [N].
        outside: Contact force that no texel feels after spread [N].
        total_force: Sum of the contact forces: the weight [N].
        chatter: Standard deviation of the total force over time where contacts flickered and forces are means,
            over the load; zero where the indenter came to rest [-].
        depth: Approach of the indenter; None where the method has none that means anything [m].
        method: Name or settings of the contact method.
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


def indent(
    parameters: Parameters,
    indenter: Indenter,
    *,
    load: float,
    at: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    method: str | TexelContact = "boxes",
) -> FastIndentation:
    """Let an indenter down on the array, guided along the array's z axis, and wait until it rests.

    Args:
        parameters: The array and its cover.
        indenter: The shape.
        load: Its weight [N].
        at: Its axis in the array's frame [m].
        yaw: Its turn about that axis [rad].
        method: Contact method, by name or as settings.

    Raises:
        FastModelError: If the load is not positive or a number not finite.
        MissedArrayError: If the indenter finds no texel under it, or does not come to rest on them.
        UnknownNameError: If the method's name is unknown.
    """
    started = time.perf_counter()
    if not 0 < load < np.inf or not np.isfinite([*at, yaw]).all():
        raise FastModelError(f"load must be positive and at, yaw finite; not {load} N, {at} m, {yaw} rad")
    chosen = choose(method)
    model = _model(parameters, indenter, chosen, load=load, at=at, yaw=yaw)
    contact, chatter = _settle(model, chosen.bind(model, parameters.array, _ARRAY, native=False), load)
    texel_forces = parameters.spread.operator(parameters.array) @ contact
    return FastIndentation(
        contact_forces=contact,
        texel_forces=texel_forces,
        outside=float(contact.sum() - texel_forces.sum()),
        total_force=float(contact.sum()),
        chatter=chatter,
        depth=None,
        method=method if isinstance(method, str) else repr(method),
        seconds=time.perf_counter() - started,
    )


_ARRAY = "array"


def _model(
    parameters: Parameters,
    indenter: Indenter,
    method: TexelContact,
    *,
    load: float,
    at: tuple[float, float],
    yaw: float,
) -> Any:  # noqa: ANN401 -- MjModel
    spec = mujoco.MjSpec()
    recommend_options(spec)
    spec.option.timestep = TIMESTEP
    spec.option.gravity = [0, 0, -STANDARD_GRAVITY]
    spec.option.tolerance = 1e-12
    here = Pose.of((0, 0, 0), (1, 0, 0, 0))
    method.attach(spec.worldbody, parameters.array, here, _ARRAY)
    body = spec.worldbody.add_body(
        name="indenter", pos=[at[0], at[1], _touch_height(parameters, indenter, at)], quat=about_z(yaw)
    )
    body.add_joint(name="guide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    # The mass of its weight, as on the bench: a light indenter under a large force tunnels through the texels.
    mass = load / STANDARD_GRAVITY
    body.mass, body.inertia, body.explicitinertial = mass, [1e-6 * mass] * 3, True
    for primitive in indenter.primitives():
        _add_geom(body, primitive)
    for geom in spec.geoms:
        # Frictionless, like the reference: with friction an indenter's edge can hook on the side of a box and lift it.
        geom.condim = 1
    return spec.compile()


def _add_geom(body: Any, primitive: Primitive) -> None:  # noqa: ANN401 -- mjsBody
    body.add_geom(
        type=_GEOMS[primitive.kind],
        size=[*primitive.size, 0.0, 0.0][:3],
        pos=primitive.position,
        quat=primitive.quaternion,
        mass=0.0,
    )


def _touch_height(parameters: Parameters, indenter: Indenter, at: tuple[float, float]) -> float:
    """Height that keeps the indenter clear of a curved array; the surface itself on a flat one [m]."""
    array = parameters.array
    if array.planar:
        return 0.0
    reach = np.hypot(*indenter.footprint) + max(array.pitch)
    under = np.hypot(array.centres[:, 0] - at[0], array.centres[:, 1] - at[1]) <= reach
    return float(array.centres[under, 2].max(initial=0.0)) + max(array.pitch)


def _settle(model: Any, reader: ContactReader, load: float) -> tuple[FloatArray, float]:  # noqa: ANN401 -- MjModel
    """Step until the indenter rests: its contact forces and their chatter.

    Where a face hovers at the edge of touching one more texel, contacts come and go for ever.  The mean over time
    is the steady force then, because it carries exactly the weight.
    """
    data = mujoco.MjData(model)
    for _ in range(int(SETTLE_TIME / TIMESTEP)):
        mujoco.mj_step(model, data)
        if data.ncon and abs(data.qacc[0]) < REST * STANDARD_GRAVITY and abs(data.qvel[0]) < REST:
            return reader.forces(data), 0.0
    taken = np.array([_step(model, data, reader) for _ in range(int(AVERAGE_TIME / TIMESTEP))])
    totals = taken.sum(axis=1)
    if abs(totals.mean() / load - 1) > CARRIED:
        raise MissedArrayError(
            f"the indenter did not come to rest on the texels: they carry {totals.mean():.4g} N of {load:.4g} N; "
            f"'at' must lie on the array"
        )
    return taken.mean(axis=0), float(totals.std() / load)


def _step(model: Any, data: Any, reader: ContactReader) -> FloatArray:  # noqa: ANN401 -- MjModel and MjData
    mujoco.mj_step(model, data)
    return reader.forces(data)
