"""Sensor files of strangers: limits on size, depth and counts, and no content of other files in messages."""

import dataclasses
import os
import re
import tracemalloc

import pytest

from tests.support.bounded import bounded
from tests.support.sensor_text import GOOD
from validation.errors import InputError
from validation.schema.sensor import (
    ArrayTable,
    ElectronicsTable,
    FilterTable,
    FlatCoverTable,
    SensorTables,
    SpreadTable,
)
from validation.schema.types import LayerTable
from validation.sensor_file import load, read_template

SPREAD = "[spread]\nsigma_x = 1.0\nsigma_y = 1.0\nksize_x = 4294967295\nksize_y = 1"
#: Replacements in a good sensor file, and a part of the message that refuses the result.
HOSTILE = {
    "too many texels": ("rows = 3\ncolumns = 2", "rows = 100000\ncolumns = 100000", "must lie in 1..10000"),
    "too many together": ("rows = 3\ncolumns = 2", "rows = 10000\ncolumns = 10000", "at most 10000 texels"),
    "no rows": ("rows = 3", "rows = 0", "array.rows: must lie in 1..10000, not 0"),
    "rows of a float": ("rows = 3", "rows = 3.0", "array.rows: "),
    "a long number": ("rows = 3", "rows = 0x" + "f" * 5000, "whole number of more than 64 bits"),
    "more digits than Python reads": ("rows = 3", "rows = " + "9" * 5000, "not a TOML file"),
    "deep lists": ("[array]", "x = " + "[" * 5000 + "]" * 5000 + "\n[array]", "deep"),
    "deep tables": ("[array]", "x = " + "{a=" * 50 + "1" + "}" * 50 + "\n[array]", "more than 32 deep"),
    "deep keys": ("[array]", "a." * 100_000 + "b = 1\n[array]", "more than 100 dots"),
    "a large file": ("[array]", "#" * 2**20 + "\n[array]", "more than the 1 MiB accepted"),
    "a wide kernel": ("[electronics]", f"{SPREAD}\n[electronics]", "must lie in 1..10000"),
    "many faults": ('rate = "271 Hz"', 'rate = "271 Hz"\ngains = [' + '"x",' * 5_000 + "]", "and 4980 more"),
    "a list for a text": ('pitch = "3.4 mm"', "pitch = [" + "1," * 20_000 + "]", "array.pitch: "),
    "a long text": ('pitch = "3.4 mm"', f'pitch = "{"1" * 100_000} mm"', "longer than the 80 characters"),
}  # fmt: skip


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_sensor_files_are_refused_at_once(tmp_path, case):
    old, new, message = HOSTILE[case]
    path = tmp_path / "s.toml"
    path.write_text(GOOD.replace(old, new, 1))
    with bounded(400, memory=200e6), pytest.raises(InputError, match=re.escape(message)) as caught:
        load(path)
    assert len(str(caught.value)) < 6000


def test_a_pipe_or_device_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "s.toml")
    for path in (tmp_path / "s.toml", "/dev/zero"):
        with pytest.raises(InputError, match="is no regular file"):
            load(path)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-8"])
def test_a_byte_order_mark_is_accepted(tmp_path, encoding):
    (tmp_path / "s.toml").write_text(GOOD, encoding=encoding)
    assert load(tmp_path / "s.toml").array.count == 6


def with_positions(tmp_path, name):
    path = tmp_path / "s.toml"
    path.write_text(GOOD.replace("rows = 3\ncolumns = 2", f'positions = "{name}"'))
    return path


@pytest.mark.parametrize(
    "content",
    [
        "root:x:0:0:secret\n",
        "x,y,z\n0,0,0\nroot:x:0:secret,1,2\n",
        "x,y,z\n0,0,0\n1,secret\n",
        "secret" * 10**6,
        "x,y,z\n" + "0,0,0\n" * 10_001 + "secret",
        "x,y,z\n0,0,1e300\nsecret",
        "x,y,z\n0,0,nan\nsecret",
        "x,y,z\n" + '"' + "secret" * 30_000,
        "x,y,z\n",
        "",
        "\ufeffx,y,z,secret\n",
    ],
    ids=lambda text: text[:12],
)
def test_positions_do_not_bring_the_content_of_files_into_messages(tmp_path, content):
    (tmp_path / "p.csv").write_text(content)
    with pytest.raises(InputError, match=r"array.positions: ") as caught:
        load(with_positions(tmp_path, tmp_path / "p.csv"))
    assert "secret" not in str(caught.value)
    assert "root" not in str(caught.value).replace(str(tmp_path), "")


def test_positions_are_a_regular_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "/dev/zero", "."):
        with pytest.raises(InputError, match=r"array.positions: "):
            load(with_positions(tmp_path, name))


def test_ten_thousand_texels_in_one_place_are_refused_at_once(tmp_path):
    lines = "".join(f"{k * 1e-9!r},0,0\n" for k in range(10_000))
    (tmp_path / "p.csv").write_text(f"x,y,z\n{lines}")
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="overlap"):
            load(with_positions(tmp_path, "p.csv"))
        assert tracemalloc.get_traced_memory()[1] < 100e6
    finally:
        tracemalloc.stop()


TEMPLATE = read_template().splitlines()
#: Numbers of the lines that are commented out: a key, or a layer.
OFF = [number for number, line in enumerate(TEMPLATE) if re.match(r"# (\w+ = |\{ thickness)", line)]
#: Keys that exclude each other.
EXCLUDING = ("# sensitivity", "# characteristic", "# range")


def switch_on(tmp_path, numbers):
    lines = [line[2:] if number in numbers else line for number, line in enumerate(TEMPLATE)]
    (tmp_path / "s.toml").write_text("\n".join(lines))
    return load(tmp_path / "s.toml")


@pytest.mark.parametrize("number", OFF, ids=lambda n: TEMPLATE[n][2:30])
def test_every_line_of_the_template_that_is_commented_out_is_accepted_alone(tmp_path, number):
    found, plain = switch_on(tmp_path, {number}), switch_on(tmp_path, set())
    fields = [field.name for field in dataclasses.fields(found) if field.name not in ("array", "source")]
    changed = [getattr(found, name) != getattr(plain, name) for name in fields]
    texels = [(array.texel_size, array.margin, array.active.tolist()) for array in (found.array, plain.array)]
    assert any(changed) or texels[0] != texels[1]


@pytest.mark.parametrize("kept", EXCLUDING)
def test_all_lines_that_are_commented_out_are_accepted_together(tmp_path, kept):
    assert len(OFF) >= 18
    found = switch_on(
        tmp_path, {number for number in OFF if not TEMPLATE[number].startswith(tuple({*EXCLUDING} - {kept}))}
    )
    assert found.assumed_electronics == (("a straight line of counts up to the stated range",) * (kept == "# range"))
    with pytest.raises(InputError, match="not both"):
        switch_on(tmp_path, set(OFF))


def test_every_material_that_the_template_offers_is_accepted(tmp_path):
    given = '{ model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.49 }'
    offers = re.findall(r'^#   ("[^"]*"|\{.*\})', read_template(), flags=re.MULTILINE)
    assert len(offers) == 6
    for offer in offers:
        (tmp_path / "s.toml").write_text(read_template().replace(given, offer, 1))
        assert load(tmp_path / "s.toml").cover.layers[0].material.youngs_modulus > 0


def test_every_key_of_a_sensor_file_is_in_the_template():
    text = read_template()
    for table in (SensorTables, ArrayTable, FlatCoverTable, LayerTable, FilterTable, SpreadTable, ElectronicsTable):
        for name in table.model_fields:
            if name != "free_edges":  # refused with an explanation
                assert re.search(rf"\b{name}\b", text), name
