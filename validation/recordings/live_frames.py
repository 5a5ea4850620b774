"""Streams of `fastmodel.Frame` from a sensor on a port, from a recording or from a simulation.

All three yield objects of the same type, so a program can use any of them.  `softcover emulate` sends the simulated
frames through an emulated Weiss sensor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fastmodel.signal.electronics import grey_levels
from fastmodel.signal.frame import Frame
from meshes import Indenter
from validation.recordings.recording import Recording
from validation.weiss.continuity import Gap
from validation.weiss.sensor import Sensor

if TYPE_CHECKING:
    from fastmodel.parameters import Parameters

#: Time step of the simulation [s].
_TIMESTEP = 1e-3
#: Period of the simulated load [s].
_LOAD_PERIOD = 4.0
#: Largest share of the weight that is lifted; the rest keeps the indenter in contact [-].
_LARGEST_LIFT = 0.95


def stream_frames(sensor: Sensor, *, reconnect: float = 0.0) -> Iterator[Frame]:
    """Frames of a real sensor as they arrive.

    Lost frames are left out; they show as gaps in the times of the others.

    Args:
        sensor: An open sensor.
        reconnect: How long to try to open the port again after it went away [s].

    Raises:
        LinkLostError: If the port goes away and does not come back in time.
    """
    matrix = sensor.read_matrix()
    for event in sensor.stream(reconnect=reconnect):
        if not isinstance(event, Gap):
            yield _make_frame(event.time, event.counts, matrix.full_scale, matrix.columns)


def replay_frames(recording: Recording, *, array: int = 0) -> Iterator[Frame]:
    """Yield the frames of one array of a recording, without waiting between them.

    Args:
        recording: A recording opened by any reader of `validation.recordings`.
        array: Index of the array in the recording.
    """
    recorded = recording.arrays[array]
    for time, counts in zip(recording.times, recorded.counts, strict=True):
        yield _make_frame(float(time), counts, recorded.full_scale, recorded.texels.columns)


def simulate_frames(parameters: Parameters, indenter: Indenter, *, load: float) -> Iterator[Frame]:
    """Endless stream of frames of the fast model, under an indenter whose load rises and falls.

    Args:
        parameters: The sensor, from `derive`.
        indenter: The indenter, guided along the normal of the array.
        load: Largest load [N].
    """
    import mujoco

    from fastmodel.bench import add_indenter
    from fastmodel.sensor import attach, recommend_options

    spec = mujoco.MjSpec()
    recommend_options(spec)
    spec.option.timestep = _TIMESTEP
    body = add_indenter(spec, indenter, load)
    sensor = attach(spec, spec.worldbody, parameters)
    model = spec.compile()
    data = mujoco.MjData(model)
    sensor.bind(model)
    number = model.body(body.name).id
    while True:
        lift = _LARGEST_LIFT * (1 - math.cos(2 * math.pi * data.time / _LOAD_PERIOD)) / 2
        data.xfrc_applied[number, 2] = lift * load
        mujoco.mj_step(model, data)
        if sensor.step(data):
            yield sensor.frame()


def _make_frame(time: float, counts: npt.NDArray[np.integer], full_scale: int, columns: int) -> Frame:
    image = grey_levels(counts, full_scale).reshape(-1, columns)
    return Frame(time=time, counts=counts.astype(np.int64), image=image)
