"""Recordings as CSV."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.recordings import recordings
from validation.recordings import RecordingError, tables

CSV = """# rows = 2
# columns = 3
# load = 1.5
# indenter = sphere:radius=5mm
time,force,temperature,a,b,c,d,e,f
10.0,0.1,30.5,0,1,2,3,4,5
10.5,0.2,30.6,6,7,8,9,10,4095
"""


def test_frames_forces_temperatures_and_labels_are_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(CSV)
    recording = tables.read(path)
    assert recording.arrays[0].counts.tolist() == [[0, 1, 2, 3, 4, 5], [6, 7, 8, 9, 10, 4095]]
    assert recording.times.tolist() == recording.force_times.tolist() == [0, 0.5]
    assert recording.forces.tolist() == [0.1, 0.2]
    assert recording.temperatures.tolist() == [[30.5], [30.6]]
    assert (recording.setup.load, recording.setup.indenter) == (1.5, "sphere:radius=5mm")
    times, forces = tables.read_forces(path)
    assert (times.tolist(), forces.tolist()) == ([10, 10.5], [0.1, 0.2])


@settings(max_examples=40, deadline=None)
@given(recordings(), st.data())
def test_written_frames_and_labels_come_back(tmp_path_factory, recording, data):
    """Masks, names and the pitch along y have no place in a CSV file."""
    index = data.draw(st.integers(0, len(recording.arrays) - 1))
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    tables.write(recording, path, array=index)
    back = tables.read(path)
    array, old = back.arrays[0], recording.arrays[index]
    assert np.array_equal(array.counts, old.counts)
    assert np.allclose(back.times, recording.times, rtol=0, atol=2e-6)
    assert abs((back.started - recording.started).total_seconds()) < 1e-5
    assert (array.texels.rows, array.texels.columns) == (old.texels.rows, old.texels.columns)
    assert (array.texels.pitch[0], array.full_scale) == (old.texels.pitch[0], old.full_scale)
    assert (back.setup.indenter, back.setup.load) == (recording.setup.indenter, recording.setup.load)
    assert back.setup.note == recording.setup.note


def test_a_file_is_replaced_at_once_or_not_at_all(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(CSV)
    recording = tables.read(path)
    tables.write(recording, path)
    assert tables.read(path).arrays[0].counts.tolist() == recording.arrays[0].counts.tolist()
    assert [file.name for file in tmp_path.iterdir()] == ["a.csv"]
    with pytest.raises(OSError, match="nowhere"):
        tables.write(recording, tmp_path / "nowhere" / "a.csv")


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("10.5,0.2", "9.5,0.2", "line 7: time 9.5 s comes before"),
        ("9,10,4095", "9,10,x", "line 7: not a number"),
        ("9,10,4095", "9,10", "line 7: 8 columns; expected 9"),
        ("9,10,4095", "9,10,-1", "line 7: counts must be whole"),
        ("9,10,4095", "9,10,0.5", "line 7: counts must be whole"),
        ("9,10,4095", "9,10,nan", "line 7: counts must be whole"),
        ("time,force", "force,time", "line 5: expected the columns"),
        ("# rows = 2\n", "# rows = 4\n", "6 texels are not 4 rows x 3 columns"),
        ("# rows = 2\n# columns = 3\n", "", "name both"),
        ("# load = 1.5", "# load = heavy", "not a number"),
    ],
)
def test_faults_are_refused_with_their_line(tmp_path, old, new, what):
    path = tmp_path / "a.csv"
    path.write_text(CSV.replace(old, new))
    with pytest.raises(RecordingError, match=what):
        tables.read(path)


@given(text=st.text(max_size=60) | st.text("time,0123456789.#=\n -", max_size=60))
def test_any_text_is_read_or_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    path.write_text(text, encoding="utf-8")
    with suppress(RecordingError):
        assert len(tables.read(path).times) > 0
