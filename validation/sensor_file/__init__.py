"""Sensor files: a TOML file that describes the array, the cover and the electronics of a tactile sensor.

`load` reads a sensor file or a built-in sensor, and returns a `SensorDescription` in SI units.
"""

from validation.sensor_file.sensor import BUILT_IN, CURVED, PUBLISHED, SensorDescription, load, parse, read_template

__all__ = ["BUILT_IN", "CURVED", "PUBLISHED", "SensorDescription", "load", "parse", "read_template"]
