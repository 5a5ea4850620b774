"""Fixtures that several test modules share."""

import dataclasses

import pytest

from validation.cli import main


@pytest.fixture
def softcover(capsys, tmp_path, monkeypatch):
    """Run one command in an empty folder: (exit status, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return left.value.code, captured.out, captured.err

    return run


@pytest.fixture
def plug_in(monkeypatch):
    """Put virtual sensors on ports; they are unplugged at the end of the test."""
    pytest.importorskip("pty", reason="pseudo-terminals need Linux or macOS")
    from tests.support.virtual_port import VirtualPort

    # closing a port waits for its reader: let that take a moment only
    monkeypatch.setattr("validation.weiss.sensor._READ_TIMEOUT", 0.01)
    ports = []

    def start(source=None, **options):
        ports.append(VirtualPort(source, **options))
        return ports[-1]

    yield start
    for port in ports:
        port.unplug()


@pytest.fixture(scope="session")
def small_pad():
    """A small pad with free sides on one coarse mesh, as a sensor with a curved cover."""
    from meshes.solids import flat_pad
    from validation.sensor_file import CURVED

    pad = flat_pad(size=(9e-3, 9e-3), rows=3, pitch=3e-3)
    sensor = CURVED["flat-pad"]
    cover = dataclasses.replace(
        sensor.cover, source="small pad", make=lambda *_: (pad.mesh(1.5e-3, layers=2),), refine=None, _made={}
    )
    return dataclasses.replace(sensor, name="small pad", array=pad.texels, cover=cover)
