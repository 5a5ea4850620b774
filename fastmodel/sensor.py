"""A tactile array in a MuJoCo model.

A sensor is made in two phases.  `attach` edits a `mujoco.MjSpec` before the spec is compiled, and `Sensor.bind` finds
the array in the compiled model.  Then `Sensor.step` is called after every `mj_step`, and `Sensor.frame` returns the
latest frame.

Three rates are distinct.  The physics runs with its timestep.  Contact forces are sampled and filtered on every n-th
physics step.  Frames are made at the sensor's own rate, and each frame contains the simulation time of its sample: at
271 frames/s and a timestep of 1 ms, successive frames are 3 or 4 ms apart.
"""

from __future__ import annotations

import re
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.check import OptionWarning, check_calibration, check_options, check_surroundings, find_geoms_of
from fastmodel.compiled import report_slow_compilation
from fastmodel.contact.cover import CoverContact, Foundation
from fastmodel.contact.geoms import NameInModel
from fastmodel.contact.interface import TexelContact
from fastmodel.contact.mesh import MeshContact
from fastmodel.errors import FastModelError, LifeCycleError, check_type, warn_user
from fastmodel.parameters import Parameters
from fastmodel.running import CLOCK_TOLERANCE, RunningSensor
from fastmodel.signal.frame import Frame
from fastmodel.state import State
from meshes.array_types import FloatArray

#: Lowest sampling rate of costly contact methods over the filter's cut-off [-].  With this value the highest frequency
#: that samples can represent, which is half the sampling rate, is at least twice the cut-off.
_SAMPLES_PER_CUTOFF = 4.0
#: Distance of the points at which `Sensor.check` examines the top of the array, over the pitch [-].
_POINTS_APART = 0.5


class Sensor:
    """A tactile array that `attach` added to a spec.  A model may have several sensors, which are independent.

    Sensors pickle, and `copy.deepcopy` copies them, with the model and data that they are bound to: copy or pickle
    `(model, data, sensor)` together, and the copy of the sensor continues with the copies of model and data.

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
        self._running: RunningSensor | None = None

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
            FastModelError: If an argument has a wrong type.
            LifeCycleError: If the model was not compiled from the spec with this array, or names in the model have
                another prefix or suffix.
            ParametersError: If the contact method needs cover data that the parameters lack.
            FastModelError: If the filter's cut-off is not below half the sampling rate.
        """
        check_type("model", model, mujoco.MjModel, "a mujoco.MjModel, as spec.compile() returns it")
        prefix = self._prefix if prefix is None else prefix
        suffix = self._suffix if suffix is None else suffix
        check_type("prefix", prefix, str, "a str, as in spec.attach(child, prefix='left_')")
        check_type("suffix", suffix, str, "a str, as in spec.attach(child, suffix='_left')")
        self._running = self._start(model, prefix, suffix)
        self._prefix, self._suffix = prefix, suffix
        for sentence in self.check(model):
            warn_user(sentence, OptionWarning)
        return self

    def _start(self, model: mujoco.MjModel, prefix: str, suffix: str) -> RunningSensor:
        """Find the array in a model, compile the kernels, and start the sensor at rest; see `bind`."""
        name, parameters = NameInModel(f"{prefix}{self.name}", suffix), self.parameters
        try:
            reader = self._contact.bind(model, parameters.array, name, surface=parameters.surface)
        except LifeCycleError as error:
            raise LifeCycleError(f"{error}{self._suggest_names(model, prefix, suffix)}") from error
        with report_slow_compilation(f"sensor {self.name!r}"):
            reader.compile_kernels(mujoco.MjData(model))
        every = self._every or _choose_interval(parameters, self._contact, model.opt.timestep)
        return RunningSensor(f"{name}{suffix}", parameters, reader, model, every)

    def check(self, model: mujoco.MjModel) -> tuple[str, ...]:
        """Find what makes this sensor measure less, or less accurately, than it could in a model.

        These are: options and flags of the model; a Gaussian point spread that contradicts the calibration of the
        electronics; colliding geoms that move with the array and are flush with its top, above it, or less than 1 mm
        below, where they carry part of the force; objects and facing arrays that can never touch the array.  `bind`
        gives each sentence as an `OptionWarning`.

        Args:
            model: The model that was compiled from the spec with this array; prefix and suffix are those of `bind`.

        Returns:
            One sentence for each finding, which also says what to do; none if nothing was found.

        Raises:
            FastModelError: If the argument has a wrong type.
            LifeCycleError: If the array is not in the model.
        """
        check_type("model", model, mujoco.MjModel, "a mujoco.MjModel, as spec.compile() returns it")
        array, name = self.parameters.array, f"{self._prefix}{self.name}"
        geoms = find_geoms_of(model, name, self._suffix)
        if not len(geoms):
            advice = self._suggest_names(model, self._prefix, self._suffix)
            raise LifeCycleError(f"array {name + self._suffix!r} is not in this model{advice}")
        every = self._every or _choose_interval(self.parameters, self._contact, model.opt.timestep)
        pitch = min(array.pitch)
        margin = self._contact.plate.margin if isinstance(self._contact, CoverContact | Foundation) else 0
        cover = self._contact.surface if isinstance(self._contact, MeshContact) else None
        around = check_surroundings(
            model, geoms, f"{name}{self._suffix}", inset=margin * pitch, spacing=_POINTS_APART * pitch, cover=cover
        )
        spread = () if self._contact.computes_spread else check_calibration(self.parameters)
        return (*check_options(self.parameters, model, every, geoms), *spread, *around)

    def step(self, data: mujoco.MjData) -> bool:
        """Update the sensor after one physics step; call this after every `mj_step`.

        Args:
            data: The state of the simulation after the step.

        Returns:
            Whether the sensor made a new frame.

        Raises:
            FastModelError: If the argument has a wrong type.
            LifeCycleError: If the sensor is not bound to the model of this state, or the simulation time did not
                advance by one timestep since the previous call.
            FastModelError: If a contact force is not finite.
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

    def reset(self, contact_forces: npt.ArrayLike = 0.0, *, seed: int | np.random.SeedSequence | None = None) -> None:
        """Restart clocks, filter and hysteresis; call this after `mj_resetData`.

        If options of the model (timestep, solver, flags) have changed since `bind`, the sensor follows them from here
        on, and warns of them as `bind` does.

        Args:
            contact_forces: Constant force on each texel, a number or shape (n,); the filter starts in its steady
                state under these forces [N].
            seed: Seed from which the noise restarts: equal seeds give equal frames, and sensors of other names other
                noise.  By default the noise continues; after `bind` it starts from `Electronics.seed`.

        Raises:
            FastModelError: If the seed has a wrong type.
            LifeCycleError: If the sensor is not bound.
            FastModelError: If a force is negative or not finite, or there is not one force for each texel.
            FastModelError: If the seed is negative.
            FastModelError: If the timestep of the model has changed, and the filter's cut-off is not below half the
                new sampling rate.
        """
        running = self._bound()
        if running.is_outdated():
            noise = running.chain.noise
            self.bind(running.model)
            running = self._bound()
            running.chain.noise = noise
        try:
            forces = np.array(contact_forces, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise FastModelError(
                f"sensor {self.name!r}: contact_forces must be numbers, not {contact_forces!r}"
            ) from error
        running.reset(forces)
        if seed is not None:
            running.seed(seed)

    def get_state(self) -> State:
        """Return the state of the sensor as arrays by name, which `numpy.savez` writes.

        The state belongs to the state of the simulation at the same time, which `mujoco.mj_getState` returns with
        `mjSTATE_INTEGRATION`.  It contains clocks, filter, hysteresis, noise, the start of the contact solver, the
        latest contact forces and the latest frame.  Its arrays are copies; some of their shapes depend on the contacts.

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        return self._bound().get_state()

    def set_state(self, state: State) -> None:
        """Restore a state that `get_state` returned, also that of another sensor of the same array and model.

        After `mujoco.mj_setState`, the next frames are those that followed the stored state, bit for bit.

        Args:
            state: The arrays by name.

        Raises:
            LifeCycleError: If the sensor is not bound.
            FastModelError: If an array is missing or has a wrong shape.
        """
        self._bound().set_state(state)

    def __getstate__(self) -> tuple[dict[str, Any], tuple[Any, ...] | None]:
        """Return the settings, and model, data and state of a bound sensor, for `pickle` and `copy`."""
        settings, running = dict(vars(self)), self._running
        settings["_running"] = None
        return settings, None if running is None else (running.model, running.data, running.get_state())

    def __setstate__(self, stored: tuple[dict[str, Any], tuple[Any, ...] | None]) -> None:
        """Restore what `__getstate__` returned; a bound sensor is bound again, without the warnings of `bind`."""
        settings, bound = stored
        vars(self).update(settings)
        if bound is not None:
            model, data, state = bound
            self._running = self._start(model, self._prefix, self._suffix)
            self._running.set_state(state)
            self._running.data = data

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

    def _bound(self) -> RunningSensor:
        """Return the state of the bound sensor, or raise an error if the sensor is not bound."""
        if self._running is None:
            raise LifeCycleError(f"sensor {self.name!r} is not bound; call bind(model) after compiling")
        return self._running


def _choose_interval(parameters: Parameters, contact: TexelContact, timestep: float) -> int:
    """Choose the number of physics steps between two samples of the contact forces [-]."""
    if not contact.costly:
        return 1
    wanted = parameters.electronics.rate_hz
    if parameters.filter is not None:
        wanted = max(wanted, _SAMPLES_PER_CUTOFF * parameters.filter.cutoff_hz)
    return max(1, int((1 + CLOCK_TOLERANCE) / (wanted * timestep)))
