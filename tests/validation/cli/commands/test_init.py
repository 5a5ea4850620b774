import pytest


def test_init_never_overwrites(softcover, tmp_path):
    sensor = tmp_path / "sensor.toml"
    assert softcover("init")[0] == 0
    sensor.write_text("mine")
    status, _, err = softcover("init")
    assert status == 2
    assert "exists already" in err
    assert sensor.read_text() == "mine"
    assert softcover("init", "--force")[0] == 0


@pytest.mark.parametrize("words", [["own.toml"], ["--out", "own.toml"], ["--out=own.toml"], ["--force", "own.toml"]])
def test_init_names_its_file_as_other_commands_do(softcover, tmp_path, words):
    status, _, err = softcover("init", *words)
    assert status == 0
    assert [path.name for path in tmp_path.glob("*.toml")] == ["own.toml"]
    assert "next: softcover derive own.toml" in err
