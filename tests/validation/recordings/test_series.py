"""Finding a labelled series, and saying what is wrong with one."""

import pytest

from validation.recordings import RecordingError
from validation.recordings.series import find_recordings_folder, find_stamp_files


def create_files(root, *names):
    for name in names:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")
    return root


def test_loads_follow_from_the_names_of_files(tmp_path):
    files = find_stamp_files(create_files(tmp_path, "a/b/room/A1.dsa", "a/b/room/A2.dsa", "a/b/operating/H1.dsa"))
    assert [file.name for file in files] == ["room A1", "room A2", "operating H1"]
    assert [file.mass for file in files] == pytest.approx([0.2, 0.2, 0.9])
    assert files[-1].load == pytest.approx(0.9 * 9.80665)
    assert files[0].weight == files[1].weight
    assert files[0].path == tmp_path / "a/b/room/A1.dsa"


@pytest.mark.parametrize("name", ["room/I1.dsa", "room/A0.dsa", "room/A10.dsa", "operating/a1.dsa"])
def test_a_name_outside_the_series_is_refused(tmp_path, name):
    create_files(tmp_path, "room/A1.dsa", name)
    with pytest.raises(RecordingError, match=r"expected A1\.dsa \.\. H9\.dsa"):
        find_stamp_files(tmp_path)


def test_a_folder_without_a_series_is_refused_with_the_expected_names(tmp_path):
    with pytest.raises(RecordingError, match=r"no weight series; expected room/A1\.dsa"):
        find_stamp_files(create_files(tmp_path, "grasps/tennisball.dsa"))


def test_the_folder_is_the_given_one_then_that_of_the_environment(tmp_path, monkeypatch):
    named, other = create_files(tmp_path, "x/1", "y/1") / "x", tmp_path / "y"
    monkeypatch.setenv("SOFTCOVER_RECORDINGS", str(other))
    assert find_recordings_folder(named) == named
    assert find_recordings_folder() == other
    monkeypatch.setenv("SOFTCOVER_RECORDINGS", str(tmp_path / "none"))
    with pytest.raises(RecordingError, match="no such folder"):
        find_recordings_folder()
    monkeypatch.delenv("SOFTCOVER_RECORDINGS")
    monkeypatch.chdir(named)
    assert find_recordings_folder() is None
