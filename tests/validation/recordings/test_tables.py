"""Recordings as CSV."""

import json
import re
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshes import TexelArray
from tests.support.recordings import recordings
from validation.recordings import RecordingError, tables
from validation.recordings.importing import open_recording
from validation.recordings.live_frames import replay_frames

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


def test_what_a_file_does_not_state_is_that_of_the_sensor(tmp_path):
    sensor = TexelArray.grid(3, 2, (4e-3, 5e-3))
    path = tmp_path / "a.csv"
    path.write_text(CSV.replace("# rows = 2\n# columns = 3\n", ""))
    found = tables.read(path, sensor=sensor)
    assert found.arrays[0].has_layout_of(sensor)
    assert open_recording(path, sensor=sensor).arrays[0].has_layout_of(sensor)
    (tmp_path / "b.csv").write_text(CSV.replace("# rows = 2\n# columns = 3\n", ""))
    given = open_recording(tmp_path / "b.csv", rows=3, columns=2).arrays[0].texels
    assert (given.rows, given.columns) == (3, 2)
    assert "pitch assumed" not in found.setup.other
    path.write_text("# pitch = 0.002\n" + CSV)
    stated = tables.read(path, sensor=sensor).arrays[0].texels
    assert (stated.rows, stated.columns, stated.pitch) == (2, 3, (2e-3, 2e-3))


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


def test_force_and_temperature_come_back_at_the_times_of_the_frames(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("# rows = 1\n# columns = 2\ntime,force,temperature,a,b\n0,1.5,20,1,2\n1,2.5,21,3,4\n2,3.5,23,5,6\n")
    recording = tables.read(path)
    times, values = np.array([0.0, 1.0, 2.0]), np.array([[20.0, 1], [np.nan, 1], [23.0, 1]])
    changed = replace(recording, temperatures=values, temperature_times=times)
    tables.write(changed, path)
    back = tables.read(path)
    assert back.forces.tolist() == [1.5, 2.5, 3.5]
    assert back.temperatures[:, 0].tolist() == [20.0, 21.5, 23.0]


@given(text=st.text(max_size=60) | st.text("time,0123456789.#=\n -", max_size=60))
def test_any_text_is_read_or_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    path.write_text(text, encoding="utf-8")
    with suppress(RecordingError):
        assert len(tables.read(path).times) > 0


TARED = """# rows = 1
# pitch = 0.0034
# mass = 500
# operator name = A. B.
# a comment without a value
# https://example.org/?query=1 is a comment as well
time,a,b,c
0,-12.25,100.5,0
1,-300,4095,7
"""


def test_a_pitch_that_no_file_states_is_told(tmp_path, softcover):
    (tmp_path / "a.csv").write_text(CSV)
    assert tables.read(tmp_path / "a.csv").setup.other == {"pitch assumed": "3.4 mm"}
    status, _, errors = softcover("import", "a.csv", "--out", "a.mcap")
    assert status == 0
    assert "states no pitch; assumed: 3.4 mm" in errors
    (tmp_path / "b.csv").write_text(f"# pitch = 0.004\n{CSV}")
    assert tables.read(tmp_path / "b.csv").setup.other == {}


def test_unknown_keys_fractions_and_negative_counts_are_kept_everywhere(tmp_path, softcover):
    """From CSV to MCAP, to CSV and back; the counts are rounded once, and the file says so."""
    (tmp_path / "a.csv").write_text(TARED)
    counts = [[-12, 100, 0], [-300, 4095, 7]]
    other = {"mass": "500", "operator name": "A. B.", "counts rounded": "by at most 0.5"}
    for words in (
        ["import", "a.csv", "--out", "a.mcap"],
        ["replay", "a.mcap", "--csv", "b.csv"],
        ["import", "b.csv", "--out", "b.mcap"],
    ):
        assert softcover(*words)[0] == 0
    errors = softcover("replay", "b.mcap")[2]
    assert "other labels: mass = 500; operator name = A. B.; counts rounded = by at most 0.5" in errors
    for name in ("a.csv", "a.mcap", "b.csv", "b.mcap"):
        back = open_recording(tmp_path / name)
        assert back.arrays[0].counts.tolist() == counts, name
        assert back.setup.other == other, name
        assert replay_frames(back).__next__().image.tolist() == [[0, 6, 0]]
    assert json.loads(softcover("replay", "b.mcap", "--json")[1])["setup"]["other"] == other


@pytest.mark.parametrize(
    ("text", "old", "new", "what"),
    [
        (CSV, "10.5,0.2", "9.5,0.2", "line 7: time 9.5 s comes before"),
        (CSV, "9,10,4095", "9,10,x", "line 7: not a number"),
        (CSV, "9,10,4095", "9,10", "line 7: 8 columns; expected 9"),
        (CSV, "9,10,4095", "9,10,nan", "line 7: all numbers must be finite"),
        (CSV, "time,force", "force,time", "line 5: 9 columns between commas, 'force, time"),
        (CSV, "time,force,temperature", "time,Kraft [N],temperature", "line 5: 9 columns between commas"),
        (CSV, "time,force,temperature", "time,force,Druck [kPa]", "the column 'druck [kpa]' has another unit"),
        (CSV, "# rows = 2\n", "# rows = 4\n", "6 texels are not 4 rows x 3 columns"),
        (CSV, "# rows = 2\n# columns = 3\n", "", "6 texels in an unknown number of rows and columns"),
        (CSV, "# load = 1.5", "# load = heavy", "not a number"),
        (TARED, "0,-12.25,100.5,0\n1,-300,4095,7", "0,0.1,0.4,0.93", "rounding would change them by up to 0.4"),
        (TARED, "-300,4095", "-300,65535", "exceeds the full scale of 4095"),
        (TARED, "-300,4095", "-300,9e300", "exceeds the full scale"),
        (TARED, "-300,4095", "-4096,4095", "a count of 4096 exceeds"),
        (TARED, "# rows = 1", "# rows = 1\n" + "".join(f"# k{n} = 1\n" for n in range(99)), "64 keys"),
        (TARED, "# mass = 500", "# mass = 500\n# mass = 600", "line 4: `# mass = ` stands twice"),
        (TARED, "# rows = 1", "# rows = 1\n# rows = 2", "line 2: `# rows = ` stands twice"),
    ],
)
def test_faults_and_values_that_would_be_changed_are_refused_with_their_line(tmp_path, text, old, new, what):
    assert old in text
    (tmp_path / "a.csv").write_text(text.replace(old, new))
    with pytest.raises(RecordingError, match=re.escape(what)):
        tables.read(tmp_path / "a.csv")


def test_counts_that_span_more_than_16_bits_are_not_saved(tmp_path, softcover):
    (tmp_path / "a.csv").write_text("# rows = 1\n# full_scale = 65535\ntime,a,b\n0,-300,65400\n")
    status, _, errors = softcover("import", "a.csv", "--out", "a.mcap")
    assert status == 2
    assert "counts from -300 to 65400 do not fit an MCAP file" in errors
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.parametrize(("unit", "factor"), [("s", 1), ("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
def test_times_since_1970_are_read_in_every_unit(tmp_path, softcover, unit, factor):
    lines = [f"{(1_700_000_000 + 2 * n) * factor},{n},0" for n in range(4)]
    path = tmp_path / "a.csv"
    path.write_text("# rows = 1\ntime,a,b\n" + "\n".join(lines))
    found = open_recording(path)
    assert found.started.timestamp() == pytest.approx(1_700_000_000, abs=1e-3)
    assert found.times == pytest.approx([0, 2, 4, 6], abs=1e-6)
    status, _, err = softcover("import", path, "--out", tmp_path / "a.mcap")
    assert status == 0
    assert (f"the times are taken as {unit} since 1970" in err) == (unit != "s")
    (tmp_path / "f.csv").write_text("time,force\n" + "\n".join(line.rsplit(",", 1)[0] for line in lines))
    assert tables.read_forces(tmp_path / "f.csv")[0] == pytest.approx(1_700_000_000 + np.arange(0, 8, 2), abs=1e-3)


@pytest.mark.parametrize(
    ("text", "times"),
    [
        ("# rows = 1\ntime\ta\tb\n0.5\t1\t2\n1.5\t3\t4\n", [0, 1]),
        ("# rows = 1\nTime_ms,a,b\n500,1,2\n750,3,4\n", [0, 0.25]),
        ("# rows = 1\ntime [us];a;b\n500,5;1;2\n1500,5;3;4\n", [0, 1e-3]),
        ("# rows = 1\ntime (s),a,b\n5,1,2\n7,3,4\n", [0, 2]),
    ],
)
def test_tabs_and_stated_units_of_time(tmp_path, text, times):
    path = tmp_path / "a.csv"
    path.write_text(text)
    found = open_recording(path)
    assert found.times == pytest.approx(times)
    assert found.arrays[0].counts.tolist() == [[1, 2], [3, 4]]
    assert found.setup.other == {"pitch assumed": "3.4 mm"}


@pytest.mark.parametrize(("rows", "columns", "texels"), [(12, 12, 144), (8, 6, 48), (7, 1, 7)])
def test_a_missing_layout_comes_with_one_that_fits(tmp_path, rows, columns, texels):
    path = tmp_path / "a.csv"
    path.write_text(f"time,{','.join(f't{n}' for n in range(texels))}\n" + ",".join(["0"] * (texels + 1)))
    with pytest.raises(RecordingError, match=f"`# rows = {rows}` and `# columns = {columns}`"):
        open_recording(path)


@pytest.mark.parametrize(
    "names", ["force [N],temperature [°C]", "Force_N,Temperature (degC)", "force(N),temperature [deg C]"]
)
def test_stated_units_of_force_and_temperature_make_no_texels(tmp_path, names):
    (tmp_path / "a.csv").write_text(CSV.replace("force,temperature", names))
    (tmp_path / "b.csv").write_text(CSV)
    found, plain = tables.read(tmp_path / "a.csv"), tables.read(tmp_path / "b.csv")
    assert found.forces.tolist() == plain.forces.tolist()
    assert found.temperatures.tolist() == plain.temperatures.tolist()
    assert found.arrays[0].counts.tolist() == plain.arrays[0].counts.tolist()


def test_indices_of_texels_in_brackets_are_no_units(tmp_path):
    (tmp_path / "a.csv").write_text("# rows = 1\ntime,t[a],t[b],t(1)\n0,1,2,3\n1,3,4,5\n")
    assert tables.read(tmp_path / "a.csv").arrays[0].counts.tolist() == [[1, 2, 3], [3, 4, 5]]


def test_semicolons_come_with_decimal_commas(tmp_path):
    german = CSV.replace(",", ";").replace(".", ",")
    (tmp_path / "a.csv").write_text(CSV)
    (tmp_path / "b.csv").write_text(german)
    plain, found = (tables.read(tmp_path / name) for name in ("a.csv", "b.csv"))
    assert (found.arrays[0].counts == plain.arrays[0].counts).all()
    assert (found.times == plain.times).all()
    assert (found.forces == plain.forces).all()
    assert found.setup.load == 1.5
    (tmp_path / "c.csv").write_text(german.replace("30,5", "1.030,5"))
    with pytest.raises(RecordingError, match=r"line \d+: not a number"):
        tables.read(tmp_path / "c.csv")


PATTERNS = ["{axis}{texel}", "taxel_{texel}_{axis}", "{texel}{axis}", "{axis}_{texel}", "B{axis}[{texel}]"]


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("by_axis", [False, True])
def test_one_of_three_axes_is_read_and_must_be_named(tmp_path, softcover, pattern, by_axis):
    names = [(axis, texel) for axis in "xyz" for texel in range(6)]
    names = names if by_axis else sorted(names, key=lambda pair: pair[1])
    header = ",".join(pattern.format(axis=axis, texel=texel) for axis, texel in names)
    values = ",".join(str(100 * "xyz".index(axis) + texel) for axis, texel in names)
    path, out = tmp_path / "a.csv", tmp_path / "a.mcap"
    path.write_text(f"# rows = 2\ntime,{header}\n0,{values}\n")
    with pytest.raises(RecordingError, match=r"6 texels with three axes .*--axis z"):
        tables.read(path)
    assert open_recording(path, axis="y").arrays[0].counts.tolist() == [[100, 101, 102, 103, 104, 105]]
    assert softcover("import", path, "--axis", "z", "--out", out)[0] == 0
    assert open_recording(out).arrays[0].counts.tolist() == [[200, 201, 202, 203, 204, 205]]
    path.write_text("# axis = x\n" + path.read_text())
    assert tables.read(path).arrays[0].counts.tolist() == [[0, 1, 2, 3, 4, 5]]
    (tmp_path / "b.csv").write_text(CSV)
    with pytest.raises(RecordingError, match="one column per texel"):
        open_recording(tmp_path / "b.csv", axis="z")
    with pytest.raises(RecordingError, match="--axis"):
        open_recording(out, axis="z")


def test_texels_in_no_rectangle_are_refused_with_the_remedy(tmp_path):
    for text in ("texel,x,y\n0,1.0,2.0\n", CSV.replace("# rows = 2\n# columns = 3\n", "# rows = 4\n")):
        (tmp_path / "a.csv").write_text(text)
        with pytest.raises(RecordingError, match="column of zeros"):
            tables.read(tmp_path / "a.csv")


def test_masked_texels_are_those_of_the_sensor(tmp_path):
    sensor = TexelArray.grid(2, 3, (4e-3, 5e-3), active=np.array([True] * 5 + [False]))
    (tmp_path / "a.csv").write_text(CSV)
    assert tables.read(tmp_path / "a.csv", sensor=sensor).arrays[0].texels.active.tolist() == [True] * 5 + [False]
