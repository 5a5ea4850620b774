"""Every field of a CSV recording, with values of its own, and the file that is written, line by line."""

import hashlib
import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from meshes import TexelArray
from validation.recordings import RecordingError, tables
from validation.recordings.recording import Recording, Setup, make_array


def put(folder, text, name="a.csv"):
    path = folder / name
    path.write_bytes(text.encode())
    return path


FULL = """\ufeff# rows = 2
#columns=3
# pitch = 0.0042
# full_scale = 900
# indenter = sphere:radius=5mm
#  load  =  1.25
# note = left = palm
# mass [g]/a-b.c = 500
# 1st = no key, which starts with a letter
# a comment
time_ms,Force [N],temperature (degC),A,B,C,D,E,F

250,0.5,20.5,1,2,3,4,5,900
# between
1500,-1.5,21.5,-7,8,9,10,11,12
"""


def test_every_field_is_read(tmp_path):
    path = put(tmp_path, FULL)
    found = tables.read(str(path))
    digest = hashlib.sha256(FULL.encode()).hexdigest()
    (array,) = found.arrays
    assert array.counts.tolist() == [[1, 2, 3, 4, 5, 900], [-7, 8, 9, 10, 11, 12]]
    assert array.counts.dtype == np.int32
    assert (array.texels.rows, array.texels.columns, array.texels.pitch) == (2, 3, (0.0042, 0.0042))
    assert (array.full_scale, array.texels.active.all(), array.enabled.all()) == (900, True, True)
    assert (found.times.tolist(), found.started) == ([0, 1.25], datetime.fromtimestamp(0.25, UTC))
    assert (found.forces.tolist(), found.force_times.tolist()) == ([0.5, -1.5], [0, 1.25])
    assert (found.temperatures.tolist(), found.temperature_times.tolist()) == ([[20.5], [21.5]], [0, 1.25])
    assert found.setup == Setup(indenter="sphere:radius=5mm", load=1.25, note="left = palm", source="a.csv",
                                source_sha256=digest, other={"mass [g]/a-b.c": "500"})  # fmt: skip
    assert (found.path, found.sha256) == (path, digest)
    times, forces = tables.read_forces(str(path))
    assert (times.tolist(), forces.tolist()) == ([0.25, 1.5], [0.5, -1.5])


def test_what_a_file_does_not_state_has_these_defaults(tmp_path):
    found = tables.read(put(tmp_path, "time,a\n5,4095\n"), rows=1, columns=1)
    array = found.arrays[0]
    assert (array.full_scale, array.texels.pitch, array.texels.name) == (4095, (3.4e-3, 3.4e-3), "tactile")
    assert found.setup.other == {"pitch assumed": "3.4 mm"}
    assert (found.setup.load, found.setup.indenter, found.setup.note) == (None, "", "")
    assert (found.temperatures.shape, found.temperature_times.shape) == ((0, 0), (0,))
    assert (found.forces.shape, found.force_times.shape, found.started.timestamp()) == ((0,), (0,), 5.0)


@pytest.mark.parametrize(
    ("head", "options", "shape"),  # of twelve texels; a sensor of 6 x 2 texels
    [
        ("# rows = 3\n", {}, (3, 4)),
        ("# columns = 3\n", {}, (4, 3)),
        ("# rows = 3\n# columns = 4\n", {"rows": 2, "columns": 6}, (2, 6)),
        ("# rows = 2\n", {"columns": 6}, (2, 6)),
        ("", {"rows": 12}, (12, 1)),
        ("", {"columns": 12}, (1, 12)),
        ("", {"sensor": True}, (6, 2)),
        ("# rows = 3\n", {"sensor": True}, (3, 4)),
        ("# columns = 3\n", {"sensor": True}, (4, 3)),
        ("", {"sensor": True, "columns": 4}, (3, 4)),
        ("# rows = 5\n", {}, "12 texels are not 5 rows x 2 columns"),
        ("# rows = 13\n", {}, "12 texels are not 13 rows x 0 columns"),
        ("# columns = 13\n", {}, "12 texels in an unknown number of rows"),
        ("# rows = 0\n", {}, "# rows = 0: expected a whole number of 1 to 10000"),
        ("# columns = 10001\n", {}, "# columns = 10001: expected a whole number of 1 to 10000"),
        ("# rows = 2.5\n", {}, "# rows = 2.5: expected a whole number of 1 to 10000"),
        ("# pitch = 0\n", {"rows": 3}, "# pitch = 0: expected a number of 1e-06 to 1"),
        ("# load = 1e999\n", {"rows": 3}, "# load = 1e999: expected a number of 0 to inf"),
        ("# load = nan\n", {"rows": 3}, "# load = nan: expected a number of 0 to inf"),
        ("# load = 5 N\n", {"rows": 3}, "# load = 5 N: not a number; expected a number of 0 to inf"),
        ("# load = 1_0\n", {"rows": 3}, "# load = 1_0: not a number"),
    ],
)
def test_rows_and_columns_follow_from_options_file_and_sensor_in_this_order(tmp_path, head, options, shape):
    text = f"{head}time,{','.join(f't{number}' for number in range(12))}\n0{',1' * 12}\n"
    sensor = TexelArray.grid(6, 2, (2e-3, 3e-3), active=np.arange(12) != 5) if options.get("sensor") else None
    options = {**options, "sensor": sensor}
    if isinstance(shape, str):
        with pytest.raises(RecordingError, match=re.escape(shape)):
            tables.read(put(tmp_path, text), **options)
        return
    found = tables.read(put(tmp_path, text), **options)
    texels = found.arrays[0].texels
    assert (texels.rows, texels.columns) == shape
    assert texels.pitch == ((2e-3, 3e-3) if sensor else (3.4e-3, 3.4e-3))
    assert ("pitch assumed" in found.setup.other) == (sensor is None)
    assert texels.active.all() == (shape != (6, 2))


@pytest.mark.parametrize(
    ("name", "first", "seconds", "label"),  # a second line is later by 2000 of its unit
    [
        ("time", "99999999", (0, 2000), None),
        ("time", "100000000", (0, 2000), None),
        ("time", "1e11", (0, 2), "ms since 1970"),
        ("time", "1e14", (0, 2e-3), "us since 1970"),
        ("time", "1.0e17", (0, 2e-6), "ns since 1970"),
        ("time_s", "1e9", (0, 2000), None),
        ("time[ms]", "1e11", (0, 2), None),
        ("time (us)", "5", (0, 2e-3), None),
        ("TIME_NS", "5", (0, 2e-6), None),
    ],
)
def test_units_of_time_by_name_or_size(tmp_path, name, first, seconds, label):
    second = int(float(first)) + 2000
    found = tables.read(put(tmp_path, f"# rows = 1\n# pitch = 1\n{name},a\n{first},1\n{second},2\n"))
    assert found.times == pytest.approx(seconds, abs=1e-12, rel=2e-2)
    assert found.setup.other == ({"time unit": label} if label else {})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,a\n9e9,1\n", None),
        ("time,a\n-9e9,1\n", None),
        ("time_s,a\n9000000001,1\n", "line 3: times, forces and temperatures must lie within 9e+09"),
        ("time,temperature,a\n0,-9.1e9,1\n", "line 3: times, forces and temperatures must lie within"),
        ("time,a\n1,1\n1,1\n0.5,1\n", "line 5: time 0.5 s comes before 1 s of the line above"),
        ("time,a\n1,inf\n", "line 3: all numbers must be finite"),
        ("time,a\n1\n", "line 3: 1 columns; expected 2 as in the first line"),
        ("time,a\n1,1,1\n", "line 3: 3 columns; expected 2 as in the first line"),
        ("time,a\n\n1,1_0\n", "line 4: not a number: could not convert string to float: '1x0'"),
        ("time;a\n1,5;1.000,5\n", "line 3: not a number"),
        ("time\n1\n", ": 0 texels are not 1 rows x 0 columns"),
        ("a,time\n1,1\n", "line 2: 2 columns between commas, 'a, time'"),
        ("time;x;x\n", "line 2: 3 columns between semicolons"),
        ("time\tx\tx\n", "line 2: 3 columns between tabs"),
        ("time,a,force\n1,2,3\n", "line 2: 3 columns between commas"),
        ("time,temperature,force,a\n1,2,3,4\n", None),
        ("time_h,a\n1,1\n", "line 2: 2 columns between commas"),
        ("# a = 1\n# a =\ntime,a\n1,1\n", "line 3: `# a = ` stands twice; expected one value"),
    ],
)  # fmt: skip
def test_lines_are_named_from_the_first_line_of_the_file_on(tmp_path, text, words):
    path = put(tmp_path, f"# rows = 1\n{text}")
    if words is None:
        assert len(tables.read(path).times) == 1
        return
    with pytest.raises(RecordingError) as caught:
        tables.read(path)
    assert re.match(f"{re.escape(str(path))}[,:] ", str(caught.value))
    assert words in str(caught.value)


def test_a_file_has_at_most_these_characters_keys_and_numbers(tmp_path, monkeypatch):
    assert (tables.MOST_CHARACTERS, tables.MOST_VALUES) == (2**18, 25_000_000)
    line = f"#{'x' * (2**18 - 2)}\n"
    assert tables.read(put(tmp_path, f"# rows = 1\ntime,a\n{line}0,1\n")).arrays[0].counts.tolist() == [[1]]
    with pytest.raises(RecordingError, match="line 3: more than the 262144 characters accepted in a line"):
        tables.read(put(tmp_path, f"# rows = 1\ntime,a\n#{line}0,1\n"))
    keys = "".join(f"# k{number} = 1\n" for number in range(63))
    assert len(tables.read(put(tmp_path, f"# rows = 1\n{keys}time,a\n0,1\n")).setup.other) == 64  # and the pitch
    with pytest.raises(RecordingError, match="line 65: more than the 64 keys accepted"):
        tables.read(put(tmp_path, f"# rows = 1\n{keys}# more = 1\ntime,a\n0,1\n"))
    monkeypatch.setattr(tables, "MOST_VALUES", 6)
    assert len(tables.read(put(tmp_path, "# rows = 1\ntime,a,b\n0,1,2\n1,2,3\n")).times) == 2
    with pytest.raises(RecordingError, match="line 5: more than the 6 numbers accepted"):
        tables.read(put(tmp_path, "# rows = 1\ntime,a,b\n0,1,2\n1,2,3\n2,3,4\n"))


@pytest.mark.parametrize(
    ("key", "kept"),
    [("a" * 60, True), ("a" * 61, False), ("Z9 _-.[]/", True), ("9a", False), ("a:b", False), ("_a", False)],
)
def test_keys_begin_with_a_letter_and_have_60_characters(tmp_path, key, kept):
    other = tables.read(put(tmp_path, f"# rows = 1\n# pitch = 1\n# {key} = v\ntime,a\n0,1\n")).setup.other
    assert other == ({key: "v"} if kept else {})


@pytest.mark.parametrize(
    ("values", "counts", "label"),  # a change of up to one percent of the largest value
    [
        ((40, 0.4), [40, 0], "by at most 0.4"),
        ((-40, 0.4), [-40, 0], "by at most 0.4"),
        ((39, 0.4), None, "values up to 39 with fractions are no counts: rounding would change them by up to 0.4;"),
        ((100, 2.75), [100, 3], "by at most 0.25"),
        ((100, -2.75), [100, -3], "by at most 0.25"),
        ((0, 0), [0, 0], None),
        ((7, 3), [7, 3], None),
    ],
)
def test_fractions_are_rounded_up_to_one_percent_of_the_largest(tmp_path, values, counts, label):
    path = put(tmp_path, f"# rows = 1\n# pitch = 1\ntime,a,b\n0,{values[0]},{values[1]}\n")
    if counts is None:
        with pytest.raises(RecordingError, match=label):
            tables.read(path)
        return
    found = tables.read(path)
    assert found.arrays[0].counts.tolist() == [counts]
    assert found.setup.other == ({"counts rounded": label} if label else {})


@pytest.mark.parametrize(
    ("header", "axis", "counts"),  # values 1, 2, 3, ... from left to right
    [
        ("x0,y0,z0,x1,y1,z1", "x", [1, 4]),
        ("x0,y0,z0,x1,y1,z1", "z", [3, 6]),
        ("x0,x1,y0,y1,z0,z1", "y", [3, 4]),
        ("x0,y0,z0,x1,y1,z1", "w", "2 texels with three axes (x0, y0, z0, ...) and axis = w; name the normal one"),
        ("x0,y0,z0,x1,y1,z1", None, "2 texels with three axes (x0, y0, z0, ...) and axis = None"),
        ("x0,y0,x1,y1", None, [1, 2, 3, 4]),
        ("x0,y0,z0,a", None, [1, 2, 3, 4]),
        ("x0,y0,z0,x1", None, [1, 2, 3, 4]),
        ("a,b,c", "z", "one column per texel (a, b, c, ...) and axis = z; leave the axis out"),
        ("x0,y0,z0,x1", "z", "one column per texel (x0, y0, z0, ...) and axis = z; leave the axis out"),
    ],
)
def test_an_axis_is_read_where_every_texel_has_three(tmp_path, header, axis, counts):
    values = ",".join(str(number + 1) for number in range(header.count(",") + 1))
    path = put(tmp_path, f"# rows = 1\ntime,force,{header}\n0,99,{values}\n")
    if isinstance(counts, str):
        with pytest.raises(RecordingError, match=re.escape(counts)):
            tables.read(path, axis=axis)
        return
    assert tables.read(path, axis=axis).arrays[0].counts.tolist() == [counts]


@pytest.mark.parametrize(
    ("header", "odd"),
    [("a [mV],b [mV],c", "c"), ("a (mV),b [kPa],c [kPa]", "a (mv)"), ("a [mV],b [kPa]", None), ("a [mV],b [mV]", None)],
)
def test_a_column_of_another_unit_than_the_others_is_named(tmp_path, header, odd):
    path = put(tmp_path, f"# rows = 1\ntime,{header}\n0{',1' * (header.count(',') + 1)}\n")
    if odd is None:
        assert len(tables.read(path).times) == 1
    else:
        with pytest.raises(RecordingError, match=re.escape(f"the column '{odd}' has another unit")):
            tables.read(path)


def test_a_file_of_forces_needs_its_column(tmp_path):
    for text in ("time,a\n0,1\n", "time,force\n"):
        with pytest.raises(RecordingError, match="no forces; expected the columns `time` and `force` and at least"):
            tables.read_forces(put(tmp_path, text))


def test_text_that_is_not_utf_8_or_has_a_broken_quote_is_refused(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"time,a\n0,\xff\n")
    with pytest.raises(RecordingError, match=r"a\.csv: not text in UTF-8; expected a CSV file, saved as UTF-8"):
        tables.read(tmp_path / "a.csv")
    for kind, read in (("a recording", tables.read), ("a CSV file with a history", tables.read_history)):
        with pytest.raises(RecordingError, match=f"no such file; expected {kind}"):
            read(tmp_path / "none.csv")


def make():
    """Two arrays and readings at times between the frames, of which one is not known."""
    return Recording(
        path=Path("x"), sha256="", started=datetime.fromtimestamp(1_600_000_000.25, UTC),
        times=np.array([0.0, 1.0, 2.5]),
        arrays=(make_array(1, 1, np.zeros((3, 1), dtype=np.int32)),
                make_array(2, 1, np.array([[1, -2], [3, 4], [5, 600]]), pitch=(4e-3, 4e-3), full_scale=700)),
        setup=Setup(indenter="sphere:radius=5mm", load=0.0, note="two\n  words",
                    other={"mass": "5\n6", "rows": "9", "1": "no", "a:b": "no"}),
        forces=np.array([10.0, np.nan, 30.0]), force_times=np.array([0.0, 1.0, 2.0]),
        temperatures=np.array([[20.0, 1.0], [40.0, 2.0]]), temperature_times=np.array([0.5, 2.5]),
    )  # fmt: skip


def test_a_written_file_has_these_lines(tmp_path):
    put(tmp_path, "old")
    tables.write(make(), str(tmp_path / "a.csv"), array=1)
    assert (tmp_path / "a.csv").read_text().splitlines() == [
        "# rows = 2", "# columns = 1", "# pitch = 0.004", "# full_scale = 700", "# indenter = sphere:radius=5mm",
        "# load = 0.0", "# note = two words", "# mass = 5 6", "time,force,temperature,texel_0,texel_1",
        "1600000000.250000,10.0,20.0,1,-2", "1600000001.250000,20.0,25.0,3,4", "1600000002.750000,30.0,40.0,5,600",
    ]  # fmt: skip


def test_what_is_not_known_is_not_written(tmp_path):
    bare = replace(make(), setup=Setup(), forces=np.full(3, np.nan), temperatures=np.empty((0, 0)),
                   temperature_times=np.empty(0))  # fmt: skip
    tables.write(bare, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().splitlines()[:5] == [
        "# rows = 1", "# columns = 1", "# pitch = 0.0034", "# full_scale = 4095", "time,texel_0",
    ]  # fmt: skip
