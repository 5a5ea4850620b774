"""A tactile array in a MuJoCo model: attach, bind, step, frame.

The life has two phases, as `mujoco.MjSpec` wants it.  `attach` edits a spec before it is compiled; `bind` finds
the array in the compiled model; then `step` follows every `mj_step`, and `frame` is the latest frame.

Three clocks run.  Contact forces are formed on every n-th physics step, and the filter runs at that rate.  Frames
fall due at the sensor's own rate and carry the true time of the values in them: 271 frames/s on a 1 ms clock come
3 and 4 ms apart.  Spread and filter commute, so the spread runs once per frame.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.contact.boxes import ContactReader, Reading, TexelContact
from fastmodel.contact.methods import DEFAULT, choose
from fastmodel.contact.overlap import refuse_overlaps
from fastmodel.errors import FastModelError, LifeCycleError, StateError, UnknownNameError
from fastmodel.parameters import Parameters
from fastmodel.pose import Pose
from fastmodel.signal.chain import SignalChain
from fastmodel.signal.frame import Frame

FloatArray = npt.NDArray[np.float64]

#: Share of a time step by which clocks may disagree [-].
_TICK = 1e-3


class OptionWarning(UserWarning):
    """The model's own options cost accuracy; nothing was changed."""


def attach(
    spec: Any,  # noqa: ANN401 -- MjSpec
    body: Any,  # noqa: ANN401 -- str or mjsBody
    parameters: Parameters,
    *,
    name: str = "sensor",
    position: npt.ArrayLike = (0.0, 0.0, 0.0),
    quaternion: npt.ArrayLike = (1.0, 0.0, 0.0, 0.0),
    contact: str | TexelContact = DEFAULT,
    every: int | None = None,
    native: bool | None = None,
) -> Sensor:
    """Put a tactile array on a body of a spec that is not compiled yet.

    Nothing that belongs to the whole model is changed: no solver, cone, integrator or timestep.

    Args:
        spec: The `mujoco.MjSpec` to edit.
        body: A body of it, or its name; "world" for the fixed world.
        parameters: The array and its cover.
        name: What to call it; geoms are named after it.
        position: Origin of the array's frame in the body's, shape (3,) [m].
        quaternion: Orientation of the array's frame in the body's, scalar first, shape (4,) [-].
        contact: Contact method, by name (`fastmodel.METHODS`) or as settings; the best one that the parameters allow
            when not given.
        every: Form contact forces on every n-th physics step; when not given on every one with the boxes, else as
            rarely as the frame rate and four times the filter's cut-off allow [-].
        native: True for numba kernels, False for numpy, None for whichever is there.

    Raises:
        UnknownNameError: If the body or the contact method does not exist.
        OverlapError: If texels lie on top of one another.
        FastModelError: If the name is taken, `every` is not a positive whole number, or the pose is not one.
    """
    _, method = choose(contact, parameters)
    if every is not None and (every != int(every) or every < 1):
        raise FastModelError(f"every must be a whole number of physics steps from 1 on, not {every}")
    if any(geom.name.startswith(f"{name}/") for geom in spec.geoms):
        raise FastModelError(f"a sensor named {name!r} is on this spec already; choose another name")
    refuse_overlaps(parameters.array)
    method.attach(_find_body(spec, body), parameters.array, _pose(position, quaternion), name)
    return Sensor(name=name, parameters=parameters, contact=method, every=every, native=native)


def recommend_options(spec: Any) -> None:  # noqa: ANN401 -- MjSpec
    """Set the solver options under which contact forces are steadiest, for who asks for it.

    Elliptic cones, Newton and impratio 10: the total force of a sliding indenter then varies by 0.13 %, against
    1.7 % with MuJoCo's defaults.

    Args:
        spec: The `mujoco.MjSpec` to edit.
    """
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.impratio = 10.0


class Sensor:
    """An attached array.  Made by `attach`; several may live in one model, each on its own.

    Attributes:
        name: What it is called.
        parameters: The array and its cover.
    """

    def __init__(
        self, *, name: str, parameters: Parameters, contact: TexelContact, every: int | None, native: bool | None
    ) -> None:
        """Remember the settings; `attach` is the way in."""
        self.name = name
        self.parameters = parameters
        self._contact = contact
        self._every = every
        self._native = native
        self._running: _Running | None = None

    def twin(self) -> Sensor:
        """The same array once more, not bound: for another copy of the world, see `Batch`."""
        return Sensor(
            name=self.name, parameters=self.parameters, contact=self._contact, every=self._every, native=self._native
        )

    def bind(self, model: Any) -> Sensor:  # noqa: ANN401 -- MjModel
        """Find the array in the compiled model and start at rest.

        Args:
            model: The compiled `mujoco.MjModel`.

        Returns:
            The sensor itself.

        Raises:
            LifeCycleError: If the model was not compiled from the spec with this array.
            FilterError: If the filter's cut-off is not below half the rate it runs at.
        """
        parameters = self.parameters
        reader = self._contact.bind(model, parameters.array, self.name, cells=parameters.cells, native=self._native)
        every = self._every or _rarely(parameters, self._contact, model)
        self._running = _Running(parameters, reader, model, every, native=self._native)
        _warn(parameters, model, every)
        return self

    def step(self, data: Any) -> bool:  # noqa: ANN401 -- MjData
        """Take in one physics step; call it after every `mj_step`.

        Args:
            data: The `mujoco.MjData` that was stepped.

        Returns:
            Whether a new frame is there.

        Raises:
            LifeCycleError: If the sensor is not bound to this data's model, or the step does not follow the
                last one on the clock.
            StateError: If a contact force is not finite.
        """
        return (self._running or self._bound()).step(data, self.name)

    def frame(self) -> Frame:
        """The latest frame; before the first one, that of the array at rest.

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        return self._bound().latest

    def contact_forces(self) -> FloatArray:
        """Contact force on each texel at the last sample, before filter and spread, shape (n,) [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        return self._bound().reading.contact_forces.copy()

    def carried(self) -> float:
        """Everything that pressed on the array and its margin at the last sample [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        return self._bound().reading.carried

    def outside(self) -> float:
        """Filtered contact force of the latest frame that no texel feels [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        return self._bound().chain.outside

    def reset(self, contact_forces: npt.ArrayLike = 0.0) -> None:
        """Start again, as after `mj_resetData`: clocks, filter, noise.

        Args:
            contact_forces: Force on each texel under which the filter has long been at rest, a number or
                shape (n,) [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        self._bound().reset(np.asarray(contact_forces, dtype=np.float64))

    def _bound(self) -> _Running:
        if self._running is None:
            raise LifeCycleError(f"sensor {self.name!r} is not bound; call bind(model) after compiling")
        return self._running


class _Running:
    """The state of a bound sensor."""

    def __init__(
        self,
        parameters: Parameters,
        reader: ContactReader,
        model: Any,  # noqa: ANN401 -- MjModel
        every: int,
        *,
        native: bool | None,
    ) -> None:
        self._array = parameters.array
        self._reader = reader
        self._model = model
        self._data: Any = None
        self._every = every
        self._timestep = float(model.opt.timestep)
        self._slack, self._rate = _TICK * self._timestep, parameters.electronics.rate_hz
        spreads = reader.at_rest(np.zeros(parameters.array.count)).texel_forces is None
        self.chain = SignalChain(parameters, 1.0 / (every * self._timestep), spreads=spreads, native=native)
        self.reset(np.zeros(()))

    def reset(self, contact_forces: FloatArray) -> None:
        settled = np.broadcast_to(contact_forces, (self._array.count,))
        if not np.isfinite(settled).all():
            raise StateError("contact forces to start from must be finite")
        signals = np.empty(self._array.count + 1)
        self._rests: Reading | None = self._reader.at_rest(settled)
        self._rests.fill(signals)
        self.chain.settle(signals)
        self._steps = 0
        self._time = self._start = np.nan
        self._frames = 0
        self._sampled_at = 0.0
        self.latest = self.chain.frame(self._sampled_at, noisy=False)

    @property
    def reading(self) -> Reading:
        """That of the last sample; before the first one, that of the array at rest."""
        return self._reader.latest if self._rests is None else self._rests

    def step(self, data: Any, name: str) -> bool:  # noqa: ANN401 -- MjData
        now = data.time
        # as a rule nothing is wrong: then one comparison tells
        if data is not self._data or not abs(now - self._time - self._timestep) <= self._slack:
            self._check_clock(data, now, name)
        self._time = now
        if self._steps % self._every == 0:
            if not math.isfinite(self._reader.sample(data, self.chain.room())):
                raise StateError(f"sensor {name!r}: contact forces are not finite at t = {now:g} s")
            self._rests = None
            self.chain.take()
            self._sampled_at = now
        self._steps += 1
        due = int((self._sampled_at - self._start) * self._rate + _TICK)
        if due <= self._frames:
            return False
        self._frames = due
        self.latest = self.chain.frame(self._sampled_at)
        return True

    def _check_clock(self, data: Any, now: float, name: str) -> None:  # noqa: ANN401 -- MjData
        if data.model is not self._model:
            raise LifeCycleError(f"sensor {name!r} is bound to another model; call bind(model) again")
        self._data = data
        if math.isnan(self._time):
            self._start = now - self._timestep
        elif not abs(now - self._time - self._timestep) <= self._slack:
            raise LifeCycleError(
                f"sensor {name!r}: time went from {self._time:g} s to {now:g} s; call step after every mj_step of "
                f"{self._timestep:g} s, and reset() when the simulation is reset (MuJoCo resets an unstable one)"
            )


def _rarely(parameters: Parameters, contact: TexelContact, model: Any) -> int:  # noqa: ANN401 -- MjModel
    """Physics steps between readings of a method: one, or as many as frames and filter allow where reading is dear."""
    if not contact.costly:
        return 1
    wanted = parameters.electronics.rate_hz
    if parameters.filter is not None:
        wanted = max(wanted, 4 * parameters.filter.cutoff_hz)
    return max(1, int((1 + _TICK) / (wanted * model.opt.timestep)))


def _find_body(spec: Any, body: Any) -> Any:  # noqa: ANN401 -- mjsBody
    if not isinstance(body, str):
        return body
    found = spec.body(body)
    if found is None:
        raise UnknownNameError("body", body, [known.name for known in spec.bodies])
    return found


def _pose(position: npt.ArrayLike, quaternion: npt.ArrayLike) -> Pose:
    try:
        return Pose.of(position, quaternion)
    except ValueError as error:
        raise FastModelError(str(error)) from error


def _warn(parameters: Parameters, model: Any, every: int) -> None:  # noqa: ANN401 -- MjModel
    """Say what costs accuracy; change nothing."""
    rate = parameters.electronics.rate_hz
    sampled = 1.0 / (every * model.opt.timestep)
    messages = []
    if model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL or model.opt.solver != mujoco.mjtSolver.mjSOL_NEWTON:
        messages.append(
            "forces of sliding contacts are unsteady without Newton and elliptic cones; "
            "fastmodel.recommend_options(spec) sets them"
        )
    if parameters.filter is not None and parameters.filter.cutoff_hz > rate / 2:
        messages.append(f"cutoff_hz {parameters.filter.cutoff_hz:g} exceeds half the frame rate of {rate:g} Hz")
    if rate > sampled * (1 + _TICK):
        messages.append(f"frames come at {sampled:g} Hz, not {rate:g} Hz: forces are formed no more often")
    for message in messages:
        warnings.warn(message, OptionWarning, stacklevel=3)
