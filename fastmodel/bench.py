"""Simulated bench tests in MuJoCo: an indenter of given weight slides in a guide onto the array and comes to rest.

The mass of the indenter is its weight over standard gravity.  A slide joint guides the indenter along the array's
normal.  Contacts are frictionless, as in the finite-element reference.  Results are steady forces before the
electronics.  With box texels the depth to which the indenter sinks has no meaning, because it follows from the softness
of MuJoCo's contacts and not from the cover.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
from scipy.optimize import brentq

from fastmodel.attachment import DEFAULT, choose_method, recommend_options
from fastmodel.compiled import report_slow_compilation
from fastmodel.contact.bodies import add_geoms
from fastmodel.contact.interface import ContactReader, Reading, TexelContact, compile_kernels
from fastmodel.contact.points import press_points
from fastmodel.errors import FastModelError, MissedArrayError, check_type
from fastmodel.parameters import Parameters
from fastmodel.validity import describe_limits
from meshes import Indenter
from meshes.array_types import FloatArray
from meshes.constants import STANDARD_GRAVITY
from meshes.pose import Pose
from meshes.tilt import tilt_indenter

#: Timestep of the simulated bench tests [s].
TIMESTEP = 1e-3
#: Simulated time after which the simulation no longer waits for the indenters to come to rest [s].
SETTLE_TIME = 1.0
#: Simulated time over which forces are averaged if the indenters do not come to rest [s].
AVERAGE_TIME = 1.0
#: Relative difference between the mean force on the array and the load, up to which the array carries the load [-].
LOAD_TOLERANCE = 1e-3
#: An indenter counts as at rest if its acceleration over standard gravity [-] and its speed [m/s or rad/s] are both
#: below this number.
REST = 1e-6
#: Tolerance of MuJoCo's constraint solver in simulated bench tests [-].
SOLVER_TOLERANCE = 1e-12
#: Radius of gyration from which the inertia of a guided indenter is computed [m].  The guide prevents rotation, so the
#: value has no effect.
GYRATION_RADIUS = 1e-3
#: Smallest accepted load [N].  With a radius of gyration of 1 mm, MuJoCo refuses the inertia of a load below 1e-8 N.
_LEAST_LOAD = 1e-7
#: Heights at which a resting guided indenter is sought, from the start downwards [m].
_HEIGHTS = np.linspace(0, -1e-3, 11)
#: Number of points along each side of a body's footprint at which its reach is measured [-].
_SAMPLES = 41
#: Name of the sensor in a simulated bench test, which is the prefix of the names of its geoms.
_ARRAY = "array"


@dataclass(frozen=True, kw_only=True, eq=False)
class FastIndentation:
    """Steady forces of one indentation, computed by the fast model.

    Attributes:
        contact_forces: Force that presses on each texel before spread, shape (n,) [N].
        texel_forces: Force on each texel after spread, shape (n,); masked texels are zero [N].
        outside: Force after spread that no texel measures [N].  It is zero for a press along a direction, where texels
            have different normals.
        total_force: Total force that presses on the array and its margin; it equals the weight of the indenters [N].
        chatter: Standard deviation of the total force over time, divided by the load [-].  Zero if the indenters came
            to rest; otherwise all forces are means over time.
        depth: Approach of the indenter since its first touch of the undeformed cover [m]; None for methods without a
            meaningful depth, and for several or tilting indenters.
        method: Name of the contact method, or its settings as text.
        fewest_cells: Smallest number of cells under pressure of any indenter [-]; None for methods without cells.
        warnings: Sentences about reasons not to rely on the result.
        seconds: Wall-clock time of the simulation [s].
        force: Force of the indenter on the cover, shape (3,); None for a simulation [N].
    """

    contact_forces: FloatArray
    texel_forces: FloatArray
    outside: float
    total_force: float
    chatter: float
    depth: float | None
    method: str
    fewest_cells: int | None
    warnings: tuple[str, ...]
    seconds: float
    force: FloatArray | None = None


@dataclass(frozen=True, kw_only=True)
class Placement:
    """One of several indenters that press at once.

    Attributes:
        indenter: The shape.
        load: Weight of the indenter [N].
        at: Position of the indenter's axis in the array's frame [m].
        yaw: Rotation of the indenter about its axis [rad].
        guided: Whether the indenter moves along the array's normal only.  Otherwise the indenter may also tilt about
            the x and y axes of the array.
        centre: x and y of the centre of gravity in the indenter's frame, relative to the indenter's axis [m].
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
    pose: Pose | None = None,
    contact: str | TexelContact = DEFAULT,
) -> FastIndentation:
    """Press one guided indenter on the array until it rests under a load.

    At a pose, and for a cover of points, the indenter moves along the pose's direction without a simulation.  Otherwise
    a simulation lowers it along the normal of the array, with its weight as the load.

    Args:
        parameters: The array and its cover.
        indenter: The shape.
        load: Force along the direction of motion [N].
        at: Position of the indenter's axis in the array's frame, without a pose [m].
        yaw: Rotation of the indenter about its axis, without a pose [rad].
        pose: Place, direction of motion and orientation of the indenter.
        contact: Contact method, by name (`fastmodel.METHODS`) or as settings.  By default the best method that the
            parameters allow (see `choose_method`).

    Raises:
        FastModelError: If an argument has a wrong type, the load is not positive, a number is not finite, no contact
            method has this name, the method needs cover data that the parameters lack, no texel is under the indenter,
            the texels do not carry the load, or the pose has another direction than the normal and the cover no points.
    """
    check_type("parameters", parameters, Parameters, "a fastmodel.Parameters, for example fastmodel.load(folder)")
    check_type("pose", pose, (Pose, type(None)), "a meshes.Pose")
    name, chosen = choose_method(contact, parameters)
    surface = chosen.pressed_points
    if pose is None or surface is None:
        if pose is not None:
            if pose.direction != Pose().direction:
                raise FastModelError(f"the contact method {name!r} presses along the normal, not {pose.direction}")
            at, yaw, indenter = pose.at, pose.yaw, tilt_indenter(indenter, pose.tilt) if any(pose.tilt) else indenter
        return indent_together(parameters, [Placement(indenter=indenter, load=load, at=at, yaw=yaw)], contact=contact)
    started, array = time.perf_counter(), parameters.array
    found = press_points(surface, indenter, pose, load=load)
    pressed = found.pressure
    below = surface.find_texels(array)[pressed.nearest]
    reading = Reading(
        np.bincount(below, pressed.forces, array.count).astype(np.float64),
        found.texel_forces,
        load,
        np.array([found.depth]),
        fewest_cells=int((pressed.forces > 0).sum()),
    )
    result = _describe(parameters, name, reading, found.depth, started)
    return replace(result, outside=0.0, force=found.force)


def indent_together(
    parameters: Parameters, placements: Sequence[Placement], *, contact: str | TexelContact = DEFAULT
) -> FastIndentation:
    """Simulate several indenters on the array at once, each guided or free to tilt, until all are at rest.

    Args:
        parameters: The array and its cover.
        placements: The indenters; they must not touch one another.
        contact: Contact method, as for `indent`.

    Raises:
        FastModelError: If an argument has a wrong type.
        FastModelError: If a load is not positive or a number is not finite.
        MissedArrayError: If no texel is under an indenter, or the texels do not carry the load.
        FastModelError: If no contact method has this name.
        ParametersError: If the method needs cover data that the parameters lack.
    """
    bench = Bench(parameters, placements, contact=contact)
    return bench.press([(*placement.at, placement.yaw) for placement in placements])


class Bench:
    """An array with indenters of given weights, compiled once; the arguments are those of `indent_together`."""

    def __init__(
        self, parameters: Parameters, placements: Sequence[Placement], *, contact: str | TexelContact = DEFAULT
    ) -> None:
        """Compile the model.

        MuJoCo computes a higher stiffness of contacts for indenters at the origin of the array than for all others.
        """
        check_type("parameters", parameters, Parameters, "a fastmodel.Parameters, for example fastmodel.load(folder)")
        if not placements:
            raise FastModelError("give at least one placement of an indenter")
        for placement in placements:
            check_type("placement", placement, Placement, "a fastmodel.Placement")
            _check_placement(placement)
        self._parameters, self._placements = parameters, placements
        self._name, self._chosen = choose_method(contact, parameters)
        height = np.inf if parameters.surface is None else parameters.surface.thickness
        self._outlines = [_list_points(placement.indenter, height) for placement in placements]
        self._compile(self._hold([(*placement.at, placement.yaw) for placement in placements]))

    def _hold(self, places: Sequence[tuple[float, float, float]]) -> TexelContact:
        """Return the contact method with a cover that goes on beyond the array as far as bodies at places reach."""
        array = self._parameters.array
        if self._parameters.ends_at_texels:
            return self._chosen
        middle, far = (array.centres[:, :2].min(axis=0) + array.centres[:, :2].max(axis=0)) / 2, np.zeros(2)
        for (x, y), (*at, yaw) in zip(self._outlines, places, strict=True):
            cosine, sine = np.cos(yaw), np.sin(yaw)
            turned = np.array([cosine * x - sine * y, sine * x + cosine * y])
            far = np.maximum(far, np.abs(np.subtract(at, middle)[:, None] + turned).max(axis=1, initial=0.0))
        return self._chosen.hold(array, (float(far[0]), float(far[1])))

    def _compile(self, method: TexelContact) -> None:
        """Compile the model for a contact method."""
        self._method, array, surface = method, self._parameters.array, self._parameters.surface
        self._model = _build_model(self._parameters, self._placements, method)
        self._reader = method.bind(self._model, array, _ARRAY, surface=surface)
        with report_slow_compilation("simulated bench test"):
            compile_kernels(method, array, surface, self._model.opt.cone)
        self._start, self._data = self._reader.get_state(), mujoco.MjData(self._model)

    @cached_property
    def _spread(self) -> FloatArray:
        return self._parameters.spread.operator(self._parameters.array)

    def press(self, places: Sequence[tuple[float, float, float]]) -> FastIndentation:
        """Press until the indenters are at rest.

        Args:
            places: Position x, y [m] and yaw [rad] of the axis of each indenter.

        Raises:
            FastModelError: If a number is not finite, or the number of places is not that of the indenters.
        """
        started = time.perf_counter()
        self._place(places)
        load = sum(placement.load for placement in self._placements)
        reading, chatter = _settle(self._model, self._data, self._reader, load)
        if reading.texel_forces is None:
            reading = reading._replace(texel_forces=self._spread @ reading.contact_forces)
        depth = None
        if reading.approach is not None and len(places) == 1 and self._placements[0].guided:
            depth = float(reading.approach[0])
        return replace(_describe(self._parameters, self._name, reading, depth, started), chatter=chatter)

    def drop(self, places: Sequence[tuple[float, float, float]], height: float, steps: int) -> list[Reading]:
        """Let the indenters fall on the array, and read the contact forces of each step of `TIMESTEP`.

        Args:
            places: Position x, y [m] and yaw [rad] of the axis of each indenter.
            height: Height of their lowest points over the array at rest [m].
            steps: Number of steps [-].
        """
        self._place(places, height)
        readings = []
        for _ in range(steps):
            mujoco.mj_step(self._model, self._data)
            readings.append(self._reader.read(self._data))
        return readings

    def _place(self, places: Sequence[tuple[float, float, float]], height: float = 0.0) -> None:
        """Place the indenters at rest above the array, and forget the presses before; refuse wrong places."""
        if np.shape(places) != (len(self._placements), 3) or not np.isfinite(places).all():
            raise FastModelError(f"give {len(self._placements)} places of finite x, y [m] and yaw [rad]; not {places}")
        if (method := self._hold(places)) != self._method:
            self._compile(method)
        array = self._parameters.array
        for number, (placement, (x, y, yaw)) in enumerate(zip(self._placements, places, strict=True)):
            reach = np.hypot(*placement.indenter.footprint) + max(array.pitch)
            body = self._model.body(f"indenter{number}")
            body.pos = x, y, self._method.find_start(array, (x, y), reach) + height
            body.quat = np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)
        self._reader.set_state(self._start)
        mujoco.mj_resetData(self._model, self._data)


def _list_points(indenter: Indenter, height: float) -> tuple[FloatArray, FloatArray]:
    """List x and y of points of a footprint at which the indenter is at most so high over its lowest point [m]."""
    x, y = np.meshgrid(*(half * np.linspace(-1, 1, _SAMPLES) for half in indenter.footprint))
    near = indenter.gap(x, y) <= height
    return x[near], y[near]


def _describe(
    parameters: Parameters, method: str, reading: Reading, depth: float | None, started: float
) -> FastIndentation:
    """Make the result of a press from its reading; the chatter of the forces is set to zero.

    Args:
        parameters: The array and its cover.
        method: Name of the contact method, or its settings as text.
        reading: Contact forces and texel forces.
        depth: Approach of the indenter since its first touch of the cover [m]; None if it has no meaning.
        started: Value of `time.perf_counter` when the press began [s].
    """
    texel_forces = np.asarray(reading.texel_forces)
    return FastIndentation(
        contact_forces=reading.contact_forces,
        texel_forces=texel_forces,
        outside=float(reading.carried - texel_forces.sum()),
        total_force=reading.carried,
        chatter=0.0,
        depth=depth,
        method=method,
        fewest_cells=reading.fewest_cells,
        warnings=describe_limits(reading, parameters.validity),
        seconds=time.perf_counter() - started,
    )


def add_indenter(
    spec: mujoco.MjSpec,
    indenter: Indenter,
    load: float,
    *,
    at: tuple[float, float] = (0.0, 0.0),
    height: float = 0.0,
    yaw: float = 0.0,
    name: str = "indenter",
) -> mujoco.MjsBody:
    """Add an indenter to the world of a spec, as a body on a slide joint along z whose mass is its load over gravity.

    The mass matters: a light body under a large applied force would pass through the texels within two physics steps.

    Args:
        spec: The spec to edit.
        indenter: The shape.
        load: Weight of the indenter [N].
        at: Position of the indenter's axis in the world, x and y [m].
        height: Height of the indenter's lowest point in the world [m].
        yaw: Rotation of the indenter about its axis [rad].
        name: Name of the body and of its slide joint, and prefix of the names of its meshes.

    Returns:
        The added body.
    """
    body = spec.worldbody.add_body(name=name, pos=[*at, height], quat=[np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    body.mass, body.explicitinertial = load / STANDARD_GRAVITY, True
    body.inertia[:] = body.mass * GYRATION_RADIUS**2
    add_geoms(spec, body, indenter, name=name)
    return body


def _check_placement(placement: Placement) -> None:
    """Check the types and values of an indenter's load and pose."""
    numbers = [placement.load, *placement.at, placement.yaw, *placement.centre]
    for number in numbers:
        check_type("load, at, yaw or centre", number, (int, float, np.number), "a number in N, m or rad")
    if not hasattr(placement.indenter, "primitives"):
        check_type("indenter", placement.indenter, (), "a shape such as meshes.Sphere(radius=5e-3)")
    if 0 < placement.load < _LEAST_LOAD:
        raise FastModelError(
            f"a load of {placement.load:.3g} N is too light for the physics engine; accepted: from {_LEAST_LOAD:g} N on"
        )
    if not placement.load > 0 or not np.isfinite(numbers).all():
        raise FastModelError(
            f"load must be positive and at, yaw finite; not {placement.load} N, {placement.at} m, {placement.yaw} rad"
        )


def _build_model(parameters: Parameters, placements: Sequence[Placement], method: TexelContact) -> mujoco.MjModel:
    """Build the model of a simulated bench test: the array on the fixed world, and the indenters above the array."""
    spec = mujoco.MjSpec()
    recommend_options(spec)
    spec.option.timestep = TIMESTEP
    spec.option.gravity[:] = [0, 0, -STANDARD_GRAVITY]
    spec.option.tolerance = SOLVER_TOLERANCE
    method.attach(spec.worldbody.add_frame(), parameters.array, _ARRAY)
    for number, placement in enumerate(placements):
        shape, name = placement.indenter, f"indenter{number}"
        body = add_indenter(spec, shape, placement.load, at=placement.at, yaw=placement.yaw, name=name)
        if not placement.guided:
            body.ipos[:] = [*placement.centre, 0.0]
            for axis in ((1, 0, 0), (0, 1, 0)):
                body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
            body.inertia[:] = body.mass * max(placement.indenter.footprint) ** 2
    for geom in spec.geoms:
        # No friction: otherwise the edge of an indenter can hook on the side of a box texel and pull it upwards.
        geom.condim = 1
    return spec.compile()


def _lower(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Lower one guided indenter to the first height at which it stays at rest; if there is none, leave it in place.

    There is none where a contact opens and closes, because the acceleration then jumps over zero.
    """

    def accelerate(height: float) -> float:
        data.qpos[0] = height
        mujoco.mj_forward(model, data)
        return float(data.qacc[0])

    heights = _HEIGHTS.tolist()
    stops = next((k for k, height in enumerate(heights) if accelerate(height) > 0), 0)
    root = brentq(accelerate, heights[stops - 1], heights[stops], xtol=1e-16) if stops else 0.0
    if not abs(accelerate(root)) < REST * STANDARD_GRAVITY:
        mujoco.mj_resetData(model, data)


def _settle(model: mujoco.MjModel, data: mujoco.MjData, reader: ContactReader, load: float) -> tuple[Reading, float]:
    """Simulate until the indenters are at rest; return the reading and the chatter of the total force [-].

    The chatter is the standard deviation of the total force over time, divided by the load.

    An indenter whose face barely touches a texel can open and close this contact indefinitely.  The result is then the
    mean over time, because the mean total force equals the weight.

    Args:
        model: The model with array and indenters.
        data: Its state at the start.
        reader: Contact method bound to the model.
        load: Weight of all indenters [N].

    Raises:
        MissedArrayError: If the texels do not carry the load.
    """
    if model.nv == 1:
        _lower(model, data)
    for _ in range(int(SETTLE_TIME / TIMESTEP)):
        mujoco.mj_step(model, data)
        if data.ncon and np.abs(data.qacc).max() < REST * STANDARD_GRAVITY and np.abs(data.qvel).max() < REST:
            reading = reader.read(data)
            if reading.contact_forces.any():
                return reading, 0.0
    readings = []
    for _ in range(int(AVERAGE_TIME / TIMESTEP)):
        mujoco.mj_step(model, data)
        readings.append(reader.read(data))
    totals = np.array([reading.carried for reading in readings])
    contact_forces = np.mean([reading.contact_forces for reading in readings], axis=0)
    if abs(totals.mean() / load - 1) > LOAD_TOLERANCE or not contact_forces.any():
        raise MissedArrayError(
            f"the indenter did not come to rest on the texels: they carry {contact_forces.sum():.4g} N of "
            f"{load:.4g} N; 'at' must lie on the array, and the shape must touch a texel there; finite elements alone "
            "(--model fem) need no texel"
        )
    spread = [reading.texel_forces for reading in readings if reading.texel_forces is not None]
    mean = Reading(
        contact_forces=contact_forces,
        texel_forces=np.mean(spread, axis=0) if spread else None,
        carried=float(totals.mean()),
        approach=readings[-1].approach,
        fewest_cells=readings[-1].fewest_cells,
    )
    return mean, float(totals.std() / load)
