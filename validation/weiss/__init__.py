"""Weiss WTS tactile arrays on a serial port: protocol, driver and a stand-in for the device.

Bytes on the wire are messages (`messages`), found in a damaged stream by `Parser`; some messages hold frames
(`frames`).  `commands` lists what can be asked and how answers are laid out; what no source confirms is
named once, in `unconfirmed`.  `Sensor` talks to a port and hands out `Reading`s and `Gap`s; `VirtualSensor`
answers like the device and `serve` puts it on a port.  Nothing here knows file formats:
`validation.recordings` writes and reads them.

Needs numpy and pyserial only.  Times of the host are monotonic [ns]; times of the device are its own ticks,
which most likely are milliseconds.
"""
