import pytest


@pytest.fixture
def sensor(tmp_path, softcover):
    assert softcover("init")[0] == 0
    return tmp_path / "sensor.toml"


def test_init_never_overwrites(softcover, sensor):
    sensor.write_text("mine")
    status, _, err = softcover("init")
    assert status == 2
    assert "exists already" in err
    assert sensor.read_text() == "mine"
    assert softcover("init", "--force")[0] == 0
