"""The door through which real and simulated frames come alike.

`frames` makes of a sensor on a port, and `recorded` of a recording, the same stream of `fastmodel.Frame` that a
simulation gives; `simulated` is a simulation that never ends, for a virtual sensor to show.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fastmodel.signal.frame import Frame
from meshes import Indenter
from meshes.constants import STANDARD_GRAVITY
from validation.recordings.recording import Recording
from validation.weiss.commands import MatrixInfo
from validation.weiss.continuity import Gap
from validation.weiss.sensor import Reading, Sensor

if TYPE_CHECKING:
    from fastmodel.parameters import Parameters

_WHITE = 255
_TIMESTEP = 1e-3
#: Period in which the simulated load comes and goes [s].
_PERIOD = 4.0


def to_frame(reading: Reading, matrix: MatrixInfo) -> Frame:
    """A reading of a real sensor as a frame.

    Args:
        reading: The reading.
        matrix: What the sensor says of its array; its full scale becomes white.
    """
    counts = reading.counts.astype(np.int64)
    return Frame(time=reading.time, counts=counts, image=_grey(counts, matrix.full_scale, matrix.columns))


def recorded(recording: Recording, *, array: int = 0) -> Iterator[Frame]:
    """Frames of one array of a recording, as fast as they are asked for.

    Args:
        recording: From any reader of `validation.recordings`.
        array: Which of its arrays.
    """
    source = recording.arrays[array]
    for time, values in zip(recording.times, source.counts, strict=True):
        counts = values.astype(np.int64)
        yield Frame(time=float(time), counts=counts, image=_grey(counts, source.full_scale, source.texels.columns))


def _grey(counts: npt.NDArray[np.int64], full_scale: int, columns: int) -> npt.NDArray[np.uint8]:
    grey = np.rint(_WHITE * counts / full_scale)
    return np.minimum(grey, _WHITE).astype(np.uint8).reshape(-1, columns)


def frames(sensor: Sensor, *, reconnect: float = 0.0) -> Iterator[Frame]:
    """Frames of a real sensor as they come; gaps are left out, so look at the times.

    Args:
        sensor: An open sensor.
        reconnect: How long to try to open the port again after it went away [s].

    Raises:
        LinkLostError: If the port goes away and does not come back in time.
    """
    matrix = sensor.matrix()
    for event in sensor.stream(reconnect=reconnect):
        if not isinstance(event, Gap):
            yield to_frame(event, matrix)


def simulated(parameters: Parameters, indenter: Indenter, *, load: float) -> Iterator[Frame]:
    """Frames of the fast model under an indenter whose load comes and goes, for ever.

    Args:
        parameters: The sensor, from `derive`.
        indenter: What presses, guided along the array's normal.
        load: Its largest load [N].
    """
    import mujoco

    from fastmodel.sensor import attach, recommend_options

    spec = mujoco.MjSpec()
    recommend_options(spec)
    spec.option.timestep = _TIMESTEP
    body = _indenter(mujoco, spec, indenter, load)
    sensor = attach(spec, spec.worldbody, parameters)
    model = spec.compile()
    data = mujoco.MjData(model)
    sensor.bind(model)
    number = model.body(body).id
    while True:
        # what lifts leaves a twentieth of the load, so that the indenter stays in touch
        share = 0.95 * (1 - math.cos(2 * math.pi * data.time / _PERIOD)) / 2
        data.xfrc_applied[number, 2] = share * load
        mujoco.mj_step(model, data)
        if sensor.step(data):
            yield sensor.frame()


def _indenter(mujoco: Any, spec: Any, indenter: Indenter, load: float) -> str:  # noqa: ANN401 -- MuJoCo is untyped
    """Hang an indenter of the mass of its load over the array; return its body's name."""
    from fastmodel.bench import add_geoms

    body = spec.worldbody.add_body(name="indenter", pos=[0, 0, 0])
    body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    mass = load / STANDARD_GRAVITY
    body.mass, body.inertia, body.explicitinertial = mass, [1e-6 * mass] * 3, True
    add_geoms(spec, body, indenter)
    return "indenter"
