"""Adding tactile arrays to a `mujoco.MjSpec`, before the spec is compiled."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.contact.interface import TexelContact
from fastmodel.contact.methods import DEFAULT, choose_method
from fastmodel.contact.overlap import refuse_overlaps
from fastmodel.errors import FastModelError, UnknownNameError, check_type
from fastmodel.parameters import Parameters
from fastmodel.pose import Pose
from fastmodel.sensor import Sensor


def attach(
    spec: mujoco.MjSpec,
    body: str | mujoco.MjsBody,
    parameters: Parameters,
    *,
    name: str = "sensor",
    position: npt.ArrayLike = (0.0, 0.0, 0.0),
    quaternion: npt.ArrayLike = (1.0, 0.0, 0.0, 0.0),
    contact: str | TexelContact = DEFAULT,
    every: int | None = None,
) -> Sensor:
    """Add a tactile array to a body of a spec, before the spec is compiled.

    Options of the whole model (solver, cone, integrator, timestep) stay as they are; see `recommend_options`.

    Args:
        spec: The spec to edit.
        body: The body that carries the array, or its name; "world" for the fixed world.
        parameters: The array and its cover.
        name: Name of the sensor, and prefix of the names of its geoms.
        position: Origin of the array's frame in the body's frame, shape (3,) [m].
        quaternion: Orientation of the array's frame in the body's frame, scalar first, shape (4,) [-].
        contact: Contact method, by name (`fastmodel.METHODS`) or as settings.  By default `cover` if the parameters
            hold the cover's cells, otherwise `boxes`.
        every: Number of physics steps between two samples of the contact forces [-].  By default 1 for
            the method `boxes`, and for the other methods the largest number that frame rate and filter allow.

    Returns:
        The sensor, which must be bound to the compiled model.

    Raises:
        ArgumentTypeError: If an argument has a wrong type.
        UnknownNameError: If the body or the contact method does not exist.
        OverlapError: If texels overlap.
        FastModelError: If the body belongs to another spec, another sensor has this name, `every` is not a positive
            whole number, or position and quaternion are not a pose.
    """
    _check_spec(spec)
    check_type("parameters", parameters, Parameters, "a fastmodel.Parameters, for example fastmodel.load(folder)")
    check_type("name", name, str, "a str")
    _, method = choose_method(contact, parameters)
    if every is not None:
        check_type("every", every, (int, float, np.integer), "a whole number of physics steps")
        if not math.isfinite(every) or every != int(every) or every < 1:
            raise FastModelError(f"every must be a whole number of physics steps from 1 on, not {every}")
    if any(geom.name.startswith(f"{name}/") for geom in spec.geoms):
        raise FastModelError(f"a sensor named {name!r} is on this spec already; choose another name")
    refuse_overlaps(parameters.array)
    method.attach(_find_body(spec, body), parameters.array, Pose.of(position, quaternion), name)
    return Sensor(name=name, parameters=parameters, contact=method, every=every)


def recommend_options(spec: mujoco.MjSpec) -> None:
    """Set the solver options of a spec that give the steadiest contact forces: elliptic cones, Newton, impratio 10.

    The total force of a sliding indenter then has a standard deviation of 0.13 % of its mean, compared with 1.7 % under
    MuJoCo's defaults.

    Args:
        spec: The spec to edit.

    Raises:
        ArgumentTypeError: If the argument has a wrong type.
    """
    _check_spec(spec)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.impratio = 10.0


def _check_spec(spec: mujoco.MjSpec) -> None:
    """Check that an argument is a spec."""
    check_type("spec", spec, mujoco.MjSpec, "a mujoco.MjSpec, for example mujoco.MjSpec.from_file('robot.xml')")


def _find_body(spec: mujoco.MjSpec, body: str | mujoco.MjsBody) -> mujoco.MjsBody:
    """Return a body of a spec, given by its name or as the body itself."""
    check_type("body", body, (str, mujoco.MjsBody), "the name of a body or a mujoco.MjsBody (a site has it as .parent)")
    if isinstance(body, str):
        found = spec.body(body)
        if found is None:
            raise UnknownNameError("body", body, [known.name for known in spec.bodies])
        return found
    if body not in spec.bodies:
        raise FastModelError(f"body {body.name!r} belongs to another spec than the one to attach to")
    return body
