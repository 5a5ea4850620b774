def test_init_never_overwrites(softcover, tmp_path):
    sensor = tmp_path / "sensor.toml"
    assert softcover("init")[0] == 0
    sensor.write_text("mine")
    status, _, err = softcover("init")
    assert status == 2
    assert "exists already" in err
    assert sensor.read_text() == "mine"
    assert softcover("init", "--force")[0] == 0
