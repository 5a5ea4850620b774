"""Yields frames of a sensor on a port, of a recording or of a simulation, all as objects of type `fastmodel.Frame`.

The type is the same for all three sources, so that a program can use any of them. `softcover emulate` sends simulated
frames through an emulated Weiss sensor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from fastmodel.signal.electronics import grey_levels
from fastmodel.signal.frame import Frame
from meshes import Indenter
from validation.recordings.recording import Recording, find_pressed_array
from validation.weiss.sensor import Sensor
from validation.weiss.stream import Gap

if TYPE_CHECKING:
    from fastmodel.parameters import Parameters

#: Time step of the simulation [s].
_TIMESTEP = 1e-3
#: Period of the simulated load [s].
_LOAD_PERIOD = 4.0
#: Largest share of the weight of the simulated indenter that an upward force compensates [-].  It is below 1, so that
#: the indenter stays in contact.
_LARGEST_LIFT = 0.95


def stream_frames(sensor: Sensor, *, reconnect: float = 0.0) -> Iterator[Frame]:
    """Yield the frames of a real sensor when they arrive.

    Lost frames are not reported.  They can be recognised by longer steps between the times of successive frames.

    Args:
        sensor: An open sensor.
        reconnect: Longest time during which a lost port is opened again and again [s].

    Raises:
        LinkLostError: If the port is lost and cannot be opened again within `reconnect`.
    """
    matrix = sensor.read_matrix()
    for event in sensor.stream(reconnect=reconnect):
        if not isinstance(event, Gap):
            image = grey_levels(event.counts, matrix.full_scale).reshape(-1, matrix.columns)
            yield Frame(time=event.time, counts=event.counts.astype(np.int64), image=image)


def replay_frames(recording: Recording, *, array: int | None = None) -> Iterator[Frame]:
    """Yield the frames of one array of a recording, without waiting; with forces if the array was simulated.

    Args:
        recording: A recording opened by any reader of `validation.recordings`.
        array: Index of the array in the recording; the array with the largest change of counts if not given.
    """
    recorded = recording.arrays[find_pressed_array(recording) if array is None else array]
    for number, time in enumerate(recording.times.tolist()):
        yield recorded.make_frame(number, time)


def simulate_frames(parameters: Parameters, indenter: Indenter, *, load: float) -> Iterator[Frame]:
    """Yield frames of the fast model without end, under an indenter whose load rises and falls periodically.

    Args:
        parameters: Parameters of the fast model of the sensor, from `derive`.
        indenter: The indenter, which is guided along the normal of the array.
        load: Largest load [N].
    """
    import mujoco

    from fastmodel.attachment import attach, recommend_options
    from fastmodel.bench import add_indenter

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
