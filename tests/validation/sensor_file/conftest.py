"""Sensor files of the tests."""

import pytest

from validation.errors import InputError
from validation.sensor_file import load


@pytest.fixture
def sensor(tmp_path):
    def write(text):
        path = tmp_path / "sensor.toml"
        path.write_text(text)
        return path

    return write


@pytest.fixture
def faults(tmp_path):
    """The faults of a sensor file, without the file's own path."""

    def read(path):
        with pytest.raises(InputError) as caught:
            load(path)
        return [fault.removeprefix(f"{path}: ") for fault in caught.value.faults]

    return read
