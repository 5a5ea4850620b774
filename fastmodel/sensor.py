"""A tactile array in a MuJoCo model.

A sensor is made in two phases.  `attach` edits a `mujoco.MjSpec` before the spec is compiled, and `Sensor.bind` finds
the array in the compiled model.  Then `Sensor.step` is called after every `mj_step`, and `Sensor.frame` returns the
latest frame.

Three rates are distinct.  The physics runs with its timestep.  Contact forces are sampled and filtered on every n-th
physics step.  Frames are made at the sensor's own rate, and each frame contains the simulation time of its sample: at
271 frames/s and a timestep of 1 ms, successive frames are 3 or 4 ms apart.
"""

from __future__ import annotations

import math
import re
import warnings

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.check import list_options, warn_of_options
from fastmodel.compiled import report_slow_compilation
from fastmodel.contact.geoms import NameInModel
from fastmodel.contact.interface import ContactReader, Reading, TexelContact
from fastmodel.errors import LifeCycleError, StateError, check_type
from fastmodel.parameters import Parameters
from fastmodel.signal.chain import SignalChain
from fastmodel.signal.frame import Frame
from meshes.array_types import FloatArray

#: Tolerance for comparisons of times, as a share of a physics step or of a frame period; it allows for rounding [-].
_CLOCK_TOLERANCE = 1e-3
#: Lowest sampling rate of costly contact methods over the filter's cut-off [-].  With this value the highest frequency
#: that samples can represent, which is half the sampling rate, is at least twice the cut-off.
_SAMPLES_PER_CUTOFF = 4.0


class RangeWarning(UserWarning):
    """Warn that a contact lies beyond the range in which the fast model agrees with the finite elements."""


class Sensor:
    """A tactile array that `attach` added to a spec.  A model may have several sensors, which are independent.

    Attributes:
        name: Name of the sensor.
        parameters: The array and its cover.
    """

    def __init__(
        self,
        *,
        name: str,
        parameters: Parameters,
        contact: TexelContact,
        every: int | None,
        prefix: str = "",
        suffix: str = "",
    ) -> None:
        """Store the settings; `attach` and `bind` describe them."""
        self.name = name
        self.parameters = parameters
        self._contact = contact
        self._every = every
        self._prefix, self._suffix = prefix, suffix
        self._running: _RunningSensor | None = None

    def twin(self, *, prefix: str | None = None, suffix: str | None = None) -> Sensor:
        """Make another, unbound sensor of the same array.

        A twin reads another state of the same model (see `Batch`), or another copy of the array in the model.  If a
        spec with an array is attached twice to another spec, the two copies of the array are two sensors:

            left, right = sensor.twin(prefix="left_"), sensor.twin(prefix="right_")

        Args:
            prefix: Prefix of the array's names in the model, see `bind`; by default as in this sensor.
            suffix: Suffix of the array's names in the model, see `bind`; by default as in this sensor.
        """
        return Sensor(
            name=self.name,
            parameters=self.parameters,
            contact=self._contact,
            every=self._every,
            prefix=self._prefix if prefix is None else prefix,
            suffix=self._suffix if suffix is None else suffix,
        )

    def bind(self, model: mujoco.MjModel, *, prefix: str | None = None, suffix: str | None = None) -> Sensor:
        """Find the array in the compiled model, compile the kernels, and reset the sensor to its state at rest.

        The first call on a machine compiles the kernels, which may take several seconds; later processes load them
        from disk.  What `check` finds in the model is given as warnings.

        Args:
            model: The model that was compiled from the spec with this array.
            prefix: Prefix of the array's names in the model.  Names have one if the spec with the array was attached to
                another one, `spec.attach(child, prefix="left_")`.  The sensor keeps prefix and suffix for later calls
                and for its twins.
            suffix: Suffix of the array's names in the model, likewise.

        Returns:
            The sensor itself.

        Raises:
            ArgumentTypeError: If an argument has a wrong type.
            LifeCycleError: If the model was not compiled from the spec with this array, or names in the model have
                another prefix or suffix.
            ParametersError: If the contact method needs cover data that the parameters lack.
            FilterError: If the filter's cut-off is not below half the sampling rate.
        """
        check_type("model", model, mujoco.MjModel, "a mujoco.MjModel, as spec.compile() returns it")
        prefix = self._prefix if prefix is None else prefix
        suffix = self._suffix if suffix is None else suffix
        check_type("prefix", prefix, str, "a str, as in spec.attach(child, prefix='left_')")
        check_type("suffix", suffix, str, "a str, as in spec.attach(child, suffix='_left')")
        name, parameters = NameInModel(f"{prefix}{self.name}", suffix), self.parameters
        try:
            reader = self._contact.bind(model, parameters.array, name, cells=parameters.cells)
        except LifeCycleError as error:
            raise LifeCycleError(f"{error}{self._suggest_names(model, prefix, suffix)}") from error
        with report_slow_compilation(f"sensor {self.name!r}"):
            reader.compile_kernels(mujoco.MjData(model))
        self._prefix, self._suffix = prefix, suffix
        every = self._every or _choose_interval(parameters, self._contact, model.opt.timestep)
        self._running = _RunningSensor(f"{name}{suffix}", parameters, reader, model, every)
        warn_of_options(parameters, model, every)
        return self

    def step(self, data: mujoco.MjData) -> bool:
        """Update the sensor after one physics step; call this after every `mj_step`.

        Args:
            data: The state of the simulation after the step.

        Returns:
            Whether the sensor made a new frame.

        Raises:
            ArgumentTypeError: If the argument has a wrong type.
            LifeCycleError: If the sensor is not bound to the model of this state, or the simulation time did not
                advance by one timestep since the previous call.
            StateError: If a contact force is not finite.
        """
        return self._bound().step(data)

    def frame(self) -> Frame:
        """Return the latest frame, or a frame of the unloaded array if no frame has been made yet.

        Raises:
            LifeCycleError: If the sensor is not bound to a compiled model.
        """
        return self._bound().frame

    def contact_forces(self) -> FloatArray:
        """Return the contact force on each texel at the latest sample, before filter and spread, shape (n,) [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        return self._bound().reading.contact_forces.copy()

    def carried(self) -> float:
        """Return the total force that pressed on the array and its margin at the latest sample [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        return self._bound().reading.carried

    def outside(self) -> float:
        """Return the part of the filtered contact force that no texel measures, at the latest frame [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        return self._bound().chain.outside

    def reset(self, contact_forces: npt.ArrayLike = 0.0) -> None:
        """Restart clocks, filter, hysteresis and noise; call this after `mj_resetData`.

        If options of the model (timestep, solver, flags) have changed since `bind`, the sensor follows them from here
        on, and warns of them as `bind` does.

        Args:
            contact_forces: Constant force on each texel, a number or shape (n,); the filter starts in its steady
                state under these forces [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
            StateError: If a force is not finite.
            FilterError: If the timestep of the model has changed, and the filter's cut-off is not below half the
                new sampling rate.
        """
        running = self._bound()
        if running.is_outdated():
            self.bind(running.model)
        self._bound().reset(np.array(contact_forces, dtype=np.float64))

    def _suggest_names(self, model: mujoco.MjModel, prefix: str, suffix: str) -> str:
        """Return advice if the model has an array of this name with another prefix or suffix, otherwise no text."""
        part = re.compile(rf"(.*){re.escape(self.name)}/(?:plate|texel)\d*(.*)")
        matches = (part.fullmatch(model.geom(geom).name) for geom in range(model.ngeom))
        others = sorted({match.groups() for match in matches if match} - {(prefix, suffix)})
        calls = [
            f"bind(model, prefix={before!r})" if not after else f"bind(model, prefix={before!r}, suffix={after!r})"
            for before, after in others
        ]
        return f".  Arrays of this name are in the model: {', '.join(calls)}" if calls else ""

    def _bound(self) -> _RunningSensor:
        """Return the state of the bound sensor, or raise an error if the sensor is not bound."""
        if self._running is None:
            raise LifeCycleError(f"sensor {self.name!r} is not bound; call bind(model) after compiling")
        return self._running


class _RunningSensor:
    """The clocks, contact reader and signal chain of a sensor that is bound to a model.

    Attributes:
        model: The model.
        reading: The contact forces of the latest sample.
        chain: The signal chain: filter, point spread and electronics.
        frame: The latest frame.
    """

    def __init__(
        self, name: str, parameters: Parameters, reader: ContactReader, model: mujoco.MjModel, every: int
    ) -> None:
        self._name, self._count, self._reader, self.model = name, parameters.array.count, reader, model
        self._every, self._timestep = every, float(model.opt.timestep)
        self._options = list_options(model)
        self._tolerance, self._rate = _CLOCK_TOLERANCE * self._timestep, parameters.electronics.rate_hz
        self._data: mujoco.MjData | None = None
        self._validity = parameters.validity
        spreads = reader.at_rest(np.zeros(self._count)).texel_forces is None
        self.chain = SignalChain(parameters, 1.0 / (every * self._timestep), spreads=spreads)
        self.reset(np.zeros(()))

    def reset(self, contact_forces: FloatArray) -> None:
        """Restart the sensor under constant contact forces, see `Sensor.reset`."""
        settled = np.broadcast_to(contact_forces, (self._count,))
        if not np.isfinite(settled).all():
            raise StateError("contact forces to start from must be finite")
        self.reading: Reading = self._reader.at_rest(settled)
        self.chain.settle(self.reading)
        self._steps = self._frames = 0
        self._time = self._start = math.nan
        self._sampled_at = 0.0
        self.frame: Frame = self.chain.frame(self._sampled_at, noisy=False)

    def step(self, data: mujoco.MjData) -> bool:
        """Update the sensor after one physics step, see `Sensor.step`."""
        if data is not self._data:
            self._check_data(data)
        now = data.time
        if not abs(now - self._time - self._timestep) <= self._tolerance:
            self._check_clock(now)
        self._time = now
        if self._steps % self._every == 0:
            reading = self._reader.read(data)
            if not math.isfinite(reading.carried):
                raise StateError(f"sensor {self._name!r}: contact forces are not finite at t = {now:g} s")
            self.chain.take(reading)
            self.reading, self._sampled_at = reading, now
            if self._validity is not None and self._validity.is_exceeded(reading):
                message = f"sensor {self._name!r}: {self._validity.describe_excess(reading)}"
                warnings.warn(message, RangeWarning, stacklevel=3)
                self._validity = None  # warn once
        self._steps += 1
        due = int((self._sampled_at - self._start) * self._rate + _CLOCK_TOLERANCE)
        if due <= self._frames:
            return False
        self._frames = due
        self.frame = self.chain.frame(self._sampled_at)
        return True

    def is_outdated(self) -> bool:
        """Return whether options of the model have changed since the sensor was bound."""
        return list_options(self.model) != self._options

    def _check_data(self, data: mujoco.MjData) -> None:
        """Check that another state belongs to the bound model, and store the state for later comparison."""
        check_type("data", data, mujoco.MjData, "the mujoco.MjData that was stepped")
        if data.model is not self.model:
            raise LifeCycleError(f"sensor {self._name!r} is bound to another model; call bind(model) again")
        self._data = data

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


def _choose_interval(parameters: Parameters, contact: TexelContact, timestep: float) -> int:
    """Choose the number of physics steps between two samples of the contact forces [-]."""
    if not contact.costly:
        return 1
    wanted = parameters.electronics.rate_hz
    if parameters.filter is not None:
        wanted = max(wanted, _SAMPLES_PER_CUTOFF * parameters.filter.cutoff_hz)
    return max(1, int((1 + _CLOCK_TOLERANCE) / (wanted * timestep)))
