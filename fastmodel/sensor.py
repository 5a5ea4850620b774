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
from collections.abc import Mapping
from typing import Any, NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.check import (
    OptionWarning,
    check_calibration,
    check_options,
    check_surroundings,
    find_geoms_of,
    list_options,
)
from fastmodel.compiled import report_slow_compilation
from fastmodel.contact.bodies import NameInModel
from fastmodel.contact.interface import Reading, TexelContact, compile_kernels
from fastmodel.errors import FastModelError, LifeCycleError, check_type, warn_user
from fastmodel.parameters import Parameters
from fastmodel.signal.chain import ChainFunctions, ChainState
from fastmodel.signal.frame import Frame
from fastmodel.signal.point_spread import find_tangents
from fastmodel.state import State, make_generator, pack, pack_generator, take_array, unpack, unpack_generator
from fastmodel.validity import RangeWarning, describe_end, describe_offset, find_offset, goes_on
from meshes.array_types import FloatArray

#: Lowest sampling rate of costly contact methods over the filter's cut-off [-].  Half the sampling rate, the highest
#: frequency that samples can represent, is then at least twice the cut-off.
_SAMPLES_PER_CUTOFF = 4.0
#: Tolerance for comparisons of times, over a physics step or a frame period [-]; it allows for the rounding of times.
_CLOCK_TOLERANCE = 1e-3


class TexelPoses(NamedTuple):
    """Places of the n texels of an array in the world.

    Attributes:
        positions: Centres of the texels, on the top of a flat cover, shape (n, 3) [m].
        normals: Outward normals, shape (n, 3) [-].
        frames: Axes of each texel as columns: its two tangents and its normal, shape (n, 3, 3) [-].
    """

    positions: FloatArray
    normals: FloatArray
    frames: FloatArray


class Sensor:
    """A tactile array that `attach` added to a spec.  A model may have several sensors, which are independent.

    Sensors can be pickled or copied with `copy.deepcopy`, together with the model and data that they are bound to.
    After a copy of `(model, data, sensor)`, the copied sensor continues with the copied model and data.

    The filter runs on every sample of the contact forces.  Without a filter, contact methods other than `boxes` are
    sampled only when a frame is due.  Point spread and electronics run once per frame, on the
    latest filtered sample.  Filter and point spread are linear and all texels have the same filter, so their order has
    no effect on the result.

    Attributes:
        name: Name of the sensor.
        parameters: The array and its cover.
    """

    #: The model that the sensor is bound to.
    _model: mujoco.MjModel | None = None

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
        """Store the settings, which `attach` and `bind` describe, in an unbound sensor."""
        self.name, self.parameters = name, parameters
        self._contact, self._every, self._prefix, self._suffix = contact, every, prefix, suffix
        self._data: mujoco.MjData | None = None
        #: Warnings that this sensor and its twins gave, and those that it does not give again: of a twin, the same.
        self._told: set[str] = set()
        self._heard: set[str] = set()

    def twin(self, *, prefix: str | None = None, suffix: str | None = None) -> Sensor:
        """Make another, unbound sensor of the same array.

        A twin reads another state of the same model (see `Batch`), or another copy of the array in the model.  If a
        spec with an array is attached twice to another spec, the two copies of the array are two sensors:

            left, right = sensor.twin(prefix="left_"), sensor.twin(prefix="right_")

        Args:
            prefix: Prefix of the array's names in the model, see `bind`; by default as in this sensor.
            suffix: Suffix of the array's names in the model, see `bind`; by default as in this sensor.
        """
        twin = Sensor(
            name=self.name,
            parameters=self.parameters,
            contact=self._contact,
            every=self._every,
            prefix=self._prefix if prefix is None else prefix,
            suffix=self._suffix if suffix is None else suffix,
        )
        twin._told = twin._heard = self._told
        return twin

    def bind(self, model: mujoco.MjModel, *, prefix: str | None = None, suffix: str | None = None) -> Sensor:
        """Find the array in the compiled model, compile the kernels, and reset the sensor to its state at rest.

        The first call on a machine compiles the kernels, which may take several seconds; later processes load them from
        disk.  The findings of `check` are given as warnings; a twin leaves out those
        that its sensor or another twin gave.

        Args:
            model: The model that was compiled from the spec with this array.
            prefix: Prefix of the array's names in the model.  Names have a prefix if the spec with the array was
                attached to another spec by `spec.attach(child, prefix="left_")`.  The sensor keeps prefix and suffix
                for later calls and for its twins.
            suffix: Suffix of the array's names in the model, see `prefix`.

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
        self._start_in(model, prefix, suffix)
        for sentence in self.check(model):
            if sentence not in self._heard:
                warn_user(sentence, OptionWarning)
            self._told.add(sentence)
        return self

    def _start_in(self, model: mujoco.MjModel, prefix: str, suffix: str) -> None:
        """Find the array in a model, compile the kernels, and start the sensor at rest; see `bind`."""
        name, parameters = NameInModel(f"{prefix}{self.name}", suffix), self.parameters
        try:
            reader = self._contact.bind(model, parameters.array, name, surface=parameters.surface)
        except LifeCycleError as error:
            raise LifeCycleError(f"{error}{self._suggest_names(model, prefix, suffix)}") from error
        with report_slow_compilation(f"sensor {self.name!r}"):
            compile_kernels(self._contact, parameters.array, parameters.surface, model.opt.cone)
        interval, timestep = self._choose_interval(model), float(model.opt.timestep)
        functions = ChainFunctions(parameters, 1.0 / (interval * timestep), spreads=not self._computes_spread)
        # The sensor is changed only from here on, so that errors raised above leave it as it was.
        self._prefix, self._suffix, self._label = prefix, suffix, f"{name}{suffix}"
        self._model, self._data, self._options, self._timestep = model, None, list_options(model), timestep
        self._interval, self._reader, self._functions = interval, reader, functions
        self._geoms = find_geoms_of(model, name, suffix)
        unfiltered = parameters.filter is None and parameters.electronics.high_pass_hz is None
        self._waits = self._every is None and self._contact.costly and unfiltered
        self._remembers = parameters.electronics.hysteresis_share > 0 or parameters.electronics.creep > 0
        self._validity = parameters.validity
        #: Distance of centres of pressure above which a warning is given, half a pitch [m]; None after the warning.
        self._farthest: float | None = 0.5 * min(parameters.array.pitch)
        self._at_end = False
        self._noise = make_generator(parameters.electronics.seed, self._label)
        self._settle(0.0)

    @property
    def _computes_spread(self) -> bool:
        """Whether the contact method computes the texel forces after spread."""
        return self._contact.computes_spread and self.parameters.surface is not None

    def _choose_interval(self, model: mujoco.MjModel) -> int:
        """Choose the number of physics steps between two samples of the contact forces [-]."""
        if self._every or not self._contact.costly:
            return self._every or 1
        if self.parameters.filter is None:  # A high-pass without it takes all steps.
            return 1  # of these steps, only those at which a frame is due are sampled
        wanted = max(self.parameters.electronics.rate_hz, _SAMPLES_PER_CUTOFF * self.parameters.filter.cutoff_hz)
        return max(1, int((1 + _CLOCK_TOLERANCE) / (wanted * model.opt.timestep)))

    def check(self, model: mujoco.MjModel) -> tuple[str, ...]:
        """Find properties of a model that reduce the accuracy of this sensor or the force that it measures.

        Four kinds of properties are found.  First, options and flags of the model.  Second, a Gaussian point spread
        that contradicts the calibration of the electronics.  Third, geoms: colliding geoms that move with the array and
        are flush with its top, above it, or less than 1 mm below, where they carry part of the force; objects or
        facing arrays that can never touch the array; and concave meshes, which MuJoCo fills.  Fourth, the place of the
        array: far from the geoms of its body, facing them, or sticking out beyond them. `bind` gives each sentence as
        an `OptionWarning`.

        Args:
            model: The model that was compiled from the spec with this array; prefix and suffix are those of `bind`.

        Returns:
            One sentence for each finding, with a remedy; empty if nothing is found.

        Raises:
            FastModelError: If the argument has a wrong type.
            LifeCycleError: If the array is not in the model.
        """
        check_type("model", model, mujoco.MjModel, "a mujoco.MjModel, as spec.compile() returns it")
        name = f"{self._prefix}{self.name}"
        geoms = find_geoms_of(model, name, self._suffix)
        name += self._suffix
        if not len(geoms):
            advice = self._suggest_names(model, self._prefix, self._suffix)
            raise LifeCycleError(f"array {name!r} is not in this model{advice}")
        around = check_surroundings(model, geoms, name, self._contact, self.parameters.array)
        spread = () if self._computes_spread else check_calibration(self.parameters)
        return (*check_options(self.parameters, model, self._choose_interval(model), geoms), *spread, *around)

    def _suggest_names(self, model: mujoco.MjModel, prefix: str, suffix: str) -> str:
        """Return advice if the model has an array of this name with another prefix or suffix, otherwise no text."""
        part = re.compile(rf"(.*){re.escape(self.name)}/(?:plate|texel)\d*(.*)")
        matches = (part.fullmatch(model.geom(geom).name) for geom in range(model.ngeom))
        others = sorted({match.groups() for match in matches if match} - {(prefix, suffix)})
        names = [f"prefix={before!r}" + (f", suffix={after!r}" if after else "") for before, after in others]
        calls = [f"bind(model, {each})" for each in names]
        return f".  Arrays of this name are in the model: {', '.join(calls)}" if calls else ""

    def _require_model(self) -> mujoco.MjModel:
        """Return the model, or raise an error if the sensor is not bound."""
        if self._model is None:
            raise LifeCycleError(f"sensor {self.name!r} is not bound; call bind(model) after compiling")
        return self._model

    def _settle(self, contact_forces: npt.ArrayLike) -> None:
        """Restart clocks, filter and hysteresis in the steady state under constant contact forces.

        Args:
            contact_forces: Force on each of n texels, shape (n,), or one number for all texels, shape () [N].

        Raises:
            FastModelError: If there is not one force for each texel, or a force is negative or not finite.
        """
        count = self.parameters.array.count
        accepted = f"sensor {self._label!r}: contact_forces must be a number or one force for each of {count} texels"
        try:
            settled = np.broadcast_to(np.array(contact_forces, dtype=np.float64), (count,))
        except (TypeError, ValueError) as error:
            raise FastModelError(f"{accepted} [N]") from error
        if not (np.isfinite(settled) & (settled >= 0)).all():
            raise FastModelError(f"{accepted}, finite and not negative [N]")
        self._reading = self._reader.at_rest(settled)
        self._state = self._functions.settle(*_list_signals(self._reading))
        self._steps = self._frames = self._asked = 0
        self._pressing = np.zeros(0, dtype=np.int64)
        self._time = self._start = math.nan
        self._sampled_at = 0.0
        self._make_frame(None)

    def _make_frame(self, noise: np.random.Generator | None, frames: int = 0) -> None:
        """Make a frame from the latest filtered sample, `frames` intervals after the last one."""
        self._state, made = self._functions.frame(self._state, noise, frames=frames)
        vectors = _name_vectors(self._reading, made.others)
        self._frame = Frame(
            time=self._sampled_at,
            counts=made.counts,
            texel_forces=made.texel_forces,
            image=made.image,
            texel_area=math.prod(self.parameters.array.texel_size),
            **vectors,
            outside=float(made.outside),
            tangential_source=self._reading.tangential_source,
        )

    def step(self, data: mujoco.MjData, *, skip: bool = False) -> bool:
        """Update the sensor after one physics step; call this after every `mj_step`.

        Args:
            data: The state of the simulation after the step.
            skip: Whether a frame that is due now is left out, without reading contacts, because a later one is wanted
                alone.  It has no effect if filter, hysteresis, creep or `every` need all samples.

        Returns:
            Whether a new frame was due, and made unless it was left out.

        Raises:
            FastModelError: If the argument has a wrong type.
            LifeCycleError: If the sensor is not bound to the model of this state, or the simulation time did not
                advance by one timestep since the previous call.
            FastModelError: If a contact force is not finite.
        """
        model = self._require_model()
        if data is not self._data:
            check_type("data", data, mujoco.MjData, "the mujoco.MjData that was stepped")
            if data.model is not model and not _are_equal(data.model, model):
                raise LifeCycleError(f"sensor {self._label!r} is bound to another model; call bind(model) again")
            self._data = data
        now = data.time
        if not abs(now - self._time - self._timestep) <= _CLOCK_TOLERANCE * self._timestep:
            self._check_clock(now)
        self._time = now
        is_due = self._count_due(now) > self._frames
        if skip and is_due and self._waits and not self._remembers:
            self._steps, self._frames = self._steps + 1, self._count_due(now)
            return True
        if is_due if self._waits else self._steps % self._interval == 0:
            reading = self._read(data)
            if not math.isfinite(reading.carried):
                raise FastModelError(f"sensor {self._label!r}: contact forces are not finite at t = {now:g} s")
            self._state = self._functions.take(self._state, *_list_signals(reading))
            self._reading, self._sampled_at = reading, now
            self._warn_of_limits(reading)
        self._steps += 1
        due = self._count_due(self._sampled_at)
        if due <= self._frames:
            return False
        passed, self._frames = due - self._frames, due
        self._make_frame(self._noise, passed)
        return True

    def _read(self, data: mujoco.MjData) -> Reading:
        """Read the contact forces, or return the last ones while all that pressed on the array sleeps.

        Bodies that sleep have no contacts in MuJoCo.
        """
        model = self._require_model()
        if not model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
            return self._reader.read(data)
        pairs = data.contact.geom[np.isin(data.contact.geom, self._geoms).any(axis=1)]
        if not len(pairs) and len(self._pressing) and (data.tree_asleep[self._pressing] >= 0).all():
            return self._reading
        trees = np.unique(model.body_treeid[model.geom_bodyid[pairs[pairs >= 0]]])
        self._pressing = trees[trees >= 0].astype(np.int64)
        return self._reader.read(data)

    def _count_due(self, time: float) -> int:
        """Return the number of frames that are due up to a time [-]."""
        return int((time - self._start) * self.parameters.electronics.rate_hz + _CLOCK_TOLERANCE)

    def frame(self) -> Frame:
        """Return the latest frame, or a frame of the unloaded array if no frame has been made yet.

        A second such call without any step gives an `OptionWarning`.

        Raises:
            LifeCycleError: If the sensor is not bound to a compiled model.
        """
        self._require_model()
        if not self._steps and not self._reading.carried:
            self._asked += 1
            if self._asked == 2:  # noqa: PLR2004 -- the frame before the simulation may be wanted once
                advice = "step(data) was not called since bind or reset; call it after every mj_step"
                warn_user(f"sensor {self._label!r}: the frame is that of the unloaded array: {advice}", OptionWarning)
        return self._frame

    def texel_forces(self) -> FloatArray:
        """Return the filtered and spread force on each texel at the latest frame, shape (n,) [N]; see `Frame`.

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        self._require_model()
        return np.array(self._frame.texel_forces)

    def pressures(self) -> FloatArray:
        """Return the mean pressure on each texel at the latest frame, shape (n,) [Pa].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        self._require_model()
        return np.array(self._frame.pressures)

    def texel_poses(self, data: mujoco.MjData) -> TexelPoses:
        """Compute positions, normals and axes of the texels in the world.

        Args:
            data: A state with the poses of bodies.

        Raises:
            LifeCycleError: If the sensor is not bound, or the model was compiled without the site of the array.
        """
        array, name = self.parameters.array, f"{self._prefix}{self.name}/origin{self._suffix}"
        site = mujoco.mj_name2id(self._require_model(), mujoco.mjtObj.mjOBJ_SITE, name)
        if site < 0:
            raise LifeCycleError(f"the model has no site {name!r}, which fastmodel.attach adds; attach the array anew")
        axes = data.site_xmat[site].reshape(3, 3)
        frames = axes @ np.stack([*find_tangents(array), array.normals], axis=-1)
        return TexelPoses(data.site_xpos[site] + array.centres @ axes.T, frames[:, :, 2], frames)

    def draw(self, scene: mujoco.MjvScene, data: mujoco.MjData, *, white: float = 0.5) -> None:
        """Add the texels to a scene of MuJoCo's visualisation, from black without force to white.

        Active texels are added as far as the scene has room, for example to `viewer.user_scn` after
        `viewer.user_scn.ngeom = 0`.

        Args:
            scene: The scene.
            data: The state that the scene shows.
            white: Texel force that is shown white [N].

        Raises:
            LifeCycleError: As from `texel_poses`.
        """
        (positions, normals, frames), array = self.texel_poses(data), self.parameters.array
        box, half = mujoco.mjtGeom.mjGEOM_BOX, np.array([*(0.45 * np.array(array.texel_size)), 1e-4])
        shades = np.clip(self.texel_forces() / white, 0.0, 1.0)
        for k in array.active.nonzero()[0][: scene.maxgeom - scene.ngeom].tolist():
            place, colour = positions[k] + 2e-4 * normals[k], np.array([*[shades[k]] * 3, 1.0], dtype=np.float32)
            mujoco.mjv_initGeom(scene.geoms[scene.ngeom], box, half, place, frames[k].ravel(), colour)
            scene.ngeom += 1

    def contact_forces(self) -> FloatArray:
        """Return the contact force on each texel at the latest sample, before filter and spread, shape (n,) [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        self._require_model()
        return self._reading.contact_forces.copy()

    def carried(self) -> float:
        """Return the total force that pressed on the array and its margin at the latest sample [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        self._require_model()
        return self._reading.carried

    def outside(self) -> float:
        """Return the part of the filtered contact force that no texel measures, at the latest frame [N].

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        self._require_model()
        return float(self._frame.outside or 0.0)

    def reset(self, contact_forces: npt.ArrayLike = 0.0, *, seed: int | np.random.SeedSequence | None = None) -> None:
        """Restart clocks, filter and hysteresis; call this after `mj_resetData`.

        If options of the model (timestep, solver, flags) have changed since `bind`, the sensor follows them from here
        on, and warns of them as `bind` does.

        Args:
            contact_forces: Constant force on each texel, a number or shape (n,); the filter starts in its steady
                state under these forces [N].
            seed: Seed from which the noise restarts.  Equal seeds give equal frames; sensors with different names have
                different noise.  By default the noise continues; after `bind` it starts from `Electronics.seed`.

        Raises:
            FastModelError: If the seed has a wrong type.
            LifeCycleError: If the sensor is not bound.
            FastModelError: If a force is negative or not finite, or there is not one force for each texel.
            FastModelError: If the seed is negative.
            FastModelError: If the timestep of the model has changed, and the filter's cut-off is not below half the
                new sampling rate.
        """
        model = self._require_model()
        if self._options != list_options(model):
            noise = self._noise
            self.bind(model)
            self._noise = noise
        self._settle(contact_forces)
        if seed is not None:
            self._noise = make_generator(seed, self._label)

    def get_state(self) -> State:
        """Return the state of the sensor as arrays by name, which `numpy.savez` writes.

        The state belongs to the state of the simulation at the same time, which `mujoco.mj_getState` returns with
        `mjSTATE_INTEGRATION`.  It contains clocks, filter, hysteresis, creep, noise, start values of the contact
        solver, the latest contact forces and the latest frame.  Its arrays are copies.  Some of their shapes depend on
        the contacts.

        Raises:
            LifeCycleError: If the sensor is not bound.
        """
        self._require_model()
        clock = [self._steps, self._frames, self._time, self._start, self._sampled_at]
        return {
            "clock": np.array(clock, dtype=np.float64),
            "method": np.array(type(self._reader).__name__),
            "pressing": self._pressing,
            **pack("reading", self._reading),
            **pack("frame", self._frame),
            **self._get_chain(),
            **{f"contact/{name}": array for name, array in self._reader.get_state().items()},
        }

    def _get_chain(self) -> State:
        """Return the states of filter, hysteresis, creep and noise, as arrays by name."""
        arrays = {f"chain/{name}": np.array(each) for name, each in self._state._asdict().items()}
        return {**arrays, "chain/noise": pack_generator(self._noise)}

    def set_state(self, state: State) -> None:
        """Restore a state that `get_state` returned, also that of another sensor of the same array and model.

        After `mujoco.mj_setState`, the next frames are those that followed the stored state, bit for bit.

        Args:
            state: The arrays by name.

        Raises:
            LifeCycleError: If the sensor is not bound.
            FastModelError: If an array is missing or has a wrong shape; the sensor is not changed then.
        """
        before = self.get_state()
        check_type("state", state, Mapping, "a dict as Sensor.get_state() returns it")
        try:
            self._restore(state)
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            self._restore(before)
            raise error if isinstance(error, FastModelError) else FastModelError(f"state: {error}") from error

    def _restore(self, state: State) -> None:
        """Restore a state that `get_state` returned; an error may leave the sensor half restored."""
        clock = take_array(state, "clock", np.zeros(5)).tolist()
        method, own = str(take_array(state, "method")), type(self._reader).__name__
        if method != own:
            raise FastModelError(f"state: it belongs to a sensor with a {method}; this sensor has a {own}")
        forces, counts = self._reading.contact_forces, self._frame.counts
        for name, like in (("reading/contact_forces", forces), ("frame/counts", counts)):
            if not np.isfinite(take_array(state, name, like)).all():
                raise FastModelError(f"state: {name!r} is not finite")
        reading, frame = (unpack(state, name, (Reading, Frame)) for name in ("reading", "frame"))
        if not isinstance(reading, Reading) or not isinstance(frame, Frame) or not math.isfinite(reading.carried):
            raise FastModelError("state: reading or frame is not complete or not finite")
        filtered, play, creep, noise = (take_array(state, name, like) for name, like in self._get_chain().items())
        steps, frames = int(clock[0]), int(clock[1])
        self._reader.set_state({k.removeprefix("contact/"): v for k, v in state.items() if k.startswith("contact/")})
        self._state, self._pressing = ChainState(filtered, play, creep), take_array(state, "pressing").astype(np.int64)
        self._noise = unpack_generator(noise)
        self._reading, self._frame = reading, frame
        self._steps, self._frames = steps, frames
        self._time, self._start, self._sampled_at = clock[2:]

    def __getstate__(self) -> tuple[dict[str, Any], tuple[Any, ...] | None]:
        """Return the settings, and model, data and state of a bound sensor, for `pickle` and `copy`."""
        bound = None if self._model is None else (self._model, self._data, self.get_state())
        return vars(self.twin()), bound

    def __setstate__(self, stored: tuple[dict[str, Any], tuple[Any, ...] | None]) -> None:
        """Restore what `__getstate__` returned; a bound sensor is bound again, without the warnings of `bind`."""
        settings, bound = stored
        vars(self).update(settings)
        if bound is not None:
            model, data, state = bound
            self._start_in(model, self._prefix, self._suffix)
            self._restore(state)
            self._data = data

    def _warn_of_limits(self, reading: Reading) -> None:
        """Warn of a reading that lies beyond what the model can compute, once for each kind of limit."""
        if self._validity is not None and self._validity.is_exceeded(reading):
            warn_user(f"sensor {self._label!r}: {self._validity.describe_excess(reading)}", RangeWarning)
            self._validity = None
        if self._farthest is not None and find_offset(reading) > self._farthest:
            warn_user(f"sensor {self._label!r}: {describe_offset(reading)}", RangeWarning)
            self._farthest = None
        if not self._at_end and goes_on(reading.at_end):
            warn_user(f"sensor {self._label!r}: {describe_end(reading.at_end)}", RangeWarning)
            self._at_end = True

    def _check_clock(self, now: float) -> None:
        """Start the clock of the sensor on its first step; on a later step raise an error about a jump in time."""
        timestep = self._require_model().opt.timestep
        if timestep != self._timestep:
            raise LifeCycleError(
                f"sensor {self._label!r}: the timestep has changed from {self._timestep:g} s to {timestep:g} s, but "
                f"filter and rates belong to the former; call reset(), which follows the new one"
            )
        if not math.isnan(self._time):
            raise LifeCycleError(
                f"sensor {self._label!r}: time went from {self._time:g} s to {now:g} s; call step after every mj_step "
                f"of {self._timestep:g} s, and reset() when the simulation is reset (MuJoCo resets an unstable one)"
            )
        self._start = now - self._timestep


def _are_equal(one: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Return whether two models are equal in every byte, as MuJoCo's copies are.

    `copy.deepcopy` and `pickle` give every copied `MjData` a copy of its own of the model.
    """
    stored = [np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8) for model in (one, other)]
    for model, buffer in zip((one, other), stored, strict=True):
        mujoco.mj_saveModel(model, None, buffer)
    return np.array_equal(stored[0], stored[1])


def _list_signals(reading: Reading) -> tuple[FloatArray, np.float64, FloatArray | None]:
    """Return the signals of a reading with n texels that the filter takes.

    They are the texel forces, at the base of the cover if the contact method computes them, shape (n,) [N]; the total
    force [N]; and net force and net torque, the torques of the pressure, and the tangential forces, shape (m,)
    [N, N m], as far as the reading has them.
    """
    pressing = reading.contact_forces if reading.texel_forces is None else reading.texel_forces
    parts = (reading.wrench, reading.torques, reading.tangential)
    vectors = [each.reshape(-1) for each in parts if each is not None]
    return pressing, np.float64(reading.carried), np.concatenate(vectors) if vectors else None


def _name_vectors(reading: Reading, vectors: FloatArray) -> dict[str, FloatArray]:
    """Divide the filtered vectors of `_list_signals`, shape (m,), among the fields of a `Frame`."""
    names = ["net_force", "net_torque"] if reading.wrench is not None else []
    names += ["pressure_torque", "missed_torque"] if reading.torques is not None else []
    named = {name: vectors[3 * k : 3 * k + 3].copy() for k, name in enumerate(names)}
    if reading.tangential is not None:
        named["tangential"] = vectors[3 * len(names) :].reshape(-1, 2).copy()
    return named
