"""Sensor files: one TOML file describes array, cover and electronics of a sensor.

`load` reads such a file or a built-in sensor, and returns a `SensorDescription` in SI units.
"""

from validation.sensor_file.sensor import BUILT_IN, SensorDescription, load, parse, read_template

__all__ = ["BUILT_IN", "SensorDescription", "load", "parse", "read_template"]
