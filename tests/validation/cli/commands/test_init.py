import pytest


@pytest.mark.parametrize("more", [(), ("--force",)])
def test_init_asks_for_a_file_where_a_folder_is_named(softcover, tmp_path, more):
    folder = tmp_path / "folder"
    folder.mkdir()
    status, _, err = softcover("init", str(folder), *more)
    assert (status, err) == (
        2,
        f"softcover: {folder}: is a folder; name a file, for example {folder / 'sensor.toml'}\n",
    )


def test_init_never_overwrites(softcover, tmp_path):
    sensor = tmp_path / "sensor.toml"
    assert softcover("init")[0] == 0
    sensor.write_text("mine")
    status, _, err = softcover("init")
    assert status == 2
    assert "exists already" in err
    assert sensor.read_text() == "mine"
    assert softcover("init", "--force")[0] == 0
