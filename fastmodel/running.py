"""A sensor that is bound to a model: its clocks, its contact reader and its signal chain."""

from __future__ import annotations

import math
from collections.abc import Mapping

import mujoco
import numpy as np

from fastmodel.check import list_options
from fastmodel.contact.interface import ContactReader, Reading
from fastmodel.errors import FastModelError, LifeCycleError, check_type, warn_user
from fastmodel.parameters import Parameters
from fastmodel.signal.chain import SignalChain
from fastmodel.signal.frame import Frame
from fastmodel.state import State, join, make_generator, pack, select, take_array, unpack
from meshes.array_types import FloatArray

#: Tolerance for comparisons of times, as a share of a physics step or of a frame period; it allows for rounding [-].
CLOCK_TOLERANCE = 1e-3


class RangeWarning(UserWarning):
    """Warn that a contact lies beyond the range in which the fast model agrees with the finite elements."""


class RunningSensor:
    """The clocks, contact reader and signal chain of a sensor that is bound to a model.

    Attributes:
        model: The model.
        every: Number of physics steps between two samples of the contact forces [-].
        data: The state of the simulation that was stepped last; None before the first step.
        reading: The contact forces of the latest sample.
        chain: The signal chain: filter, point spread and electronics.
        frame: The latest frame.
    """

    def __init__(
        self, name: str, parameters: Parameters, reader: ContactReader, model: mujoco.MjModel, every: int
    ) -> None:
        """Build the signal chain, and start at rest.

        Args:
            name: Name of the sensor in the model.
            parameters: The array and its cover.
            reader: Reader of the contact forces.
            model: The compiled model.
            every: Number of physics steps between two samples of the contact forces [-].
        """
        self._name, self._count, self._reader, self.model = name, parameters.array.count, reader, model
        self.every, self._timestep = every, float(model.opt.timestep)
        self._options = list_options(model)
        self._tolerance, self._rate = CLOCK_TOLERANCE * self._timestep, parameters.electronics.rate_hz
        self.data: mujoco.MjData | None = None
        self._validity = parameters.validity
        spreads = reader.at_rest(np.zeros(self._count)).texel_forces is None
        self.chain = SignalChain(parameters, 1.0 / (every * self._timestep), spreads=spreads)
        self.seed(parameters.electronics.seed)
        self.reset(np.zeros(()))

    def seed(self, seed: int | np.random.SeedSequence) -> None:
        """Restart the noise from a seed; see `make_generator`."""
        self.chain.noise = make_generator(seed, self._name)

    def reset(self, contact_forces: FloatArray) -> None:
        """Restart the sensor under constant contact forces, see `Sensor.reset`."""
        if contact_forces.shape not in {(), (self._count,)}:
            raise FastModelError(
                f"sensor {self._name!r}: contact_forces to start from must be a number or one force for each of "
                f"{self._count} texels, not of shape {contact_forces.shape}"
            )
        settled = np.broadcast_to(contact_forces, (self._count,))
        if not (np.isfinite(settled) & (settled >= 0)).all():
            raise FastModelError(f"sensor {self._name!r}: contact forces to start from must be finite and not negative")
        self.reading: Reading = self._reader.at_rest(settled)
        self.chain.settle(self.reading)
        self._steps = self._frames = 0
        self._time = self._start = math.nan
        self._sampled_at = 0.0
        self.frame: Frame = self.chain.frame(self._sampled_at, noisy=False)

    def step(self, data: mujoco.MjData) -> bool:
        """Update the sensor after one physics step, see `Sensor.step`."""
        if data is not self.data:
            self._check_data(data)
        now = data.time
        if not abs(now - self._time - self._timestep) <= self._tolerance:
            self._check_clock(now)
        self._time = now
        if self._steps % self.every == 0:
            reading = self._reader.read(data)
            if not math.isfinite(reading.carried):
                raise FastModelError(f"sensor {self._name!r}: contact forces are not finite at t = {now:g} s")
            self.chain.take(reading)
            self.reading, self._sampled_at = reading, now
            if self._validity is not None and self._validity.is_exceeded(reading):
                message = f"sensor {self._name!r}: {self._validity.describe_excess(reading)}"
                warn_user(message, RangeWarning)
                self._validity = None  # warn once
        self._steps += 1
        due = self._count_due(self._sampled_at)
        if due <= self._frames:
            return False
        self._frames = due
        self.frame = self.chain.frame(self._sampled_at)
        return True

    def _count_due(self, time: float) -> int:
        """Return the number of frames that are due until a time [s]."""
        return int((time - self._start) * self._rate + CLOCK_TOLERANCE)

    def get_state(self) -> State:
        """Return the state of the sensor, see `Sensor.get_state`."""
        clock = [self._steps, self._frames, self._time, self._start, self._sampled_at]
        return {
            "clock": np.array(clock, dtype=np.float64),
            "method": np.array(type(self._reader).__name__),
            **pack("reading", self.reading),
            **pack("frame", self.frame),
            **join(chain=self.chain.get_state(), contact=self._reader.get_state()),
        }

    def set_state(self, state: State) -> None:
        """Restore a state of the sensor, or leave it as it is and raise an error; see `Sensor.set_state`."""
        check_type("state", state, Mapping, "a dict as Sensor.get_state() returns it")
        before = self.get_state()
        try:
            self._restore(state)
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            self._restore(before)
            raise error if isinstance(error, FastModelError) else FastModelError(f"state: {error}") from error

    def _restore(self, state: State) -> None:
        """Restore a state of the sensor."""
        clock = take_array(state, "clock", np.zeros(5)).tolist()
        method, own = str(take_array(state, "method")), type(self._reader).__name__
        if method != own:
            raise FastModelError(f"state: it belongs to a sensor with a {method}; this sensor has a {own}")
        for name, like in (("reading/contact_forces", np.zeros(self._count)), ("frame/counts", self.frame.counts)):
            if not np.isfinite(take_array(state, name, like)).all():
                raise FastModelError(f"state: {name!r} is not finite")
        reading, frame = (unpack(state, name, (Reading, Frame)) for name in ("reading", "frame"))
        if not isinstance(reading, Reading) or not isinstance(frame, Frame) or not math.isfinite(reading.carried):
            raise FastModelError("state: reading or frame is not complete or not finite")
        steps, frames = int(clock[0]), int(clock[1])
        self.chain.set_state(select(state, "chain"))
        self._reader.set_state(select(state, "contact"))
        self.reading, self.frame = reading, frame
        self._steps, self._frames = steps, frames
        self._time, self._start, self._sampled_at = clock[2:]

    def is_outdated(self) -> bool:
        """Return whether options of the model have changed since the sensor was bound."""
        return list_options(self.model) != self._options

    def _check_data(self, data: mujoco.MjData) -> None:
        """Check that another state belongs to the bound model, and store the state for later comparison."""
        check_type("data", data, mujoco.MjData, "the mujoco.MjData that was stepped")
        if data.model is not self.model and not _are_equal(data.model, self.model):
            raise LifeCycleError(f"sensor {self._name!r} is bound to another model; call bind(model) again")
        self.data = data

    def _check_clock(self, now: float) -> None:
        """Start the clock of the sensor on its first step; on a later step raise an error about a jump in time."""
        if self.model.opt.timestep != self._timestep:
            raise LifeCycleError(
                f"sensor {self._name!r}: the timestep has changed from {self._timestep:g} s to "
                f"{self.model.opt.timestep:g} s, but filter and rates belong to the former; call reset(), which "
                f"follows the new one"
            )
        if not math.isnan(self._time):
            raise LifeCycleError(
                f"sensor {self._name!r}: time went from {self._time:g} s to {now:g} s; call step after every mj_step "
                f"of {self._timestep:g} s, and reset() when the simulation is reset (MuJoCo resets an unstable one)"
            )
        self._start = now - self._timestep


def _are_equal(one: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Return whether two models are equal in every byte, as MuJoCo's copies are.

    `copy.deepcopy` and `pickle` give every copied `MjData` a copy of its own of the model.
    """
    size = mujoco.mj_sizeModel(one)
    if size != mujoco.mj_sizeModel(other):
        return False
    first, second = np.empty(size, dtype=np.uint8), np.empty(size, dtype=np.uint8)
    mujoco.mj_saveModel(one, None, first)
    mujoco.mj_saveModel(other, None, second)
    return bool((first == second).all())
