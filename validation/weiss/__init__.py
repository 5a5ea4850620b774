"""Weiss WTS tactile arrays on a serial port: the protocol, a driver and a virtual sensor.

    with Sensor("/dev/ttyACM0") as sensor:
        print(sensor.read_matrix(), sensor.read_temperature())
        for event in sensor.stream():
            if isinstance(event, Gap):
                print(event)
            else:
                print(event.time, event.counts.max())

The bytes on the line are messages (`messages`), which `parser` finds in a stream that may be damaged.  Some messages
hold frames (`frames`).  `commands` lists the commands and the layout of their answers.  `unconfirmed` lists what is
assumed because no source confirms it.  `Sensor` asks the device on a port and yields a `Reading` for each frame and a
`Gap` for each place where frames are missing.  `VirtualSensor` answers as the device does, and `serve` runs it on a
port.  File formats are in `validation.recordings`; `validation.recordings.live_frames` converts readings to the frames
that a simulation yields.

Needs numpy and pyserial only.  Times of the host are monotonic [ns].  Times of the device are ticks of its own clock,
which are assumed to be milliseconds.
"""

from validation.weiss.continuity import Gap
from validation.weiss.frames import Reading
from validation.weiss.link import LinkLostError, PortError
from validation.weiss.sensor import NoAnswerError, Sensor, SensorError
from validation.weiss.serve import PseudoTerminal, SerialEnd, serve
from validation.weiss.virtual import Misbehaviour, VirtualSensor, show_frames, show_pattern, show_recording

__all__ = [
    "Gap",
    "LinkLostError",
    "Misbehaviour",
    "NoAnswerError",
    "PortError",
    "PseudoTerminal",
    "Reading",
    "Sensor",
    "SensorError",
    "SerialEnd",
    "VirtualSensor",
    "serve",
    "show_frames",
    "show_pattern",
    "show_recording",
]
