"""Weiss WTS tactile arrays on a serial port: protocol, driver and a stand-in for the device.

    with Sensor("/dev/ttyACM0") as sensor:
        print(sensor.matrix(), sensor.temperature())
        for event in sensor.stream():
            if isinstance(event, Gap):
                print(event)
            else:
                print(event.time, event.counts.max())

Bytes on the wire are messages (`messages`), found in a damaged stream by `parser`; some messages hold frames
(`frames`).  `commands` lists what can be asked and how answers are laid out; what no source confirms is named once, in
`unconfirmed`.  `Sensor` talks to a port and hands out `Reading`s and `Gap`s; `VirtualSensor` answers like the device
and `serve` puts it on a port.  Nothing here knows file formats: `validation.recordings` writes and reads them, and
`validation.recordings.live_frames` makes of readings the same frames that a simulation gives.

Needs numpy and pyserial only.  Times of the host are monotonic [ns]; times of the device are its own ticks, which
most likely are milliseconds.
"""

from validation.weiss.continuity import Gap
from validation.weiss.link import LinkLostError, PortError
from validation.weiss.sensor import NoAnswerError, Reading, Sensor, SensorError
from validation.weiss.serve import PseudoTerminal, SerialEnd, serve
from validation.weiss.virtual import Misbehaviour, VirtualSensor, from_frames, pattern, playback

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
    "from_frames",
    "pattern",
    "playback",
    "serve",
]
