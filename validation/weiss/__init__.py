"""Driver, protocol and virtual sensor for Weiss WTS tactile arrays on a serial port.

Print the frames of a sensor:

    with Sensor("/dev/ttyACM0") as sensor:
        print(sensor.read_matrix(), sensor.read_temperature())
        for event in sensor.stream():
            if isinstance(event, Gap):
                print(event)
            else:
                print(event.time, event.counts.max())

`Sensor` is in the module `sensor`, `Gap` in `stream`.  The module `protocol` defines messages, commands, answers and
frames (the counts of all texels at one instant) as bytes; its `Parser` finds messages in a byte stream that may be
damaged.  `inquiry` lists assumptions about the protocol that no source confirms.  `Sensor` sends commands to the device
on a port, and yields a `Reading` for each frame and a `Gap` for each place where frames are missing.  In `virtual`,
`VirtualSensor` answers commands as the device does, and `serve` runs a virtual sensor on a port.  File formats are in
`validation.recordings`; `validation.recordings.live_frames` converts readings to the type of frame that a simulation
yields.

The package needs numpy and pyserial only.  Times of the host come from its monotonic clock [ns].  Times of the device
come from the device's own clock; one tick is assumed to be a millisecond.
"""
