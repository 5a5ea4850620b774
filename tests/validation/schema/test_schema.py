"""All formats of files: what is shipped is read, what is wrong is named with its place, and editors get a schema."""

import copy
import json
import tomllib
from importlib import resources
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.sensor_text import GOOD
from validation.errors import InputError
from validation.schema import parse, read
from validation.schema.__main__ import FORMATS, make_json_schema
from validation.schema.campaign import CaseTable
from validation.schema.data_set import DataSetTables
from validation.schema.sensor import SensorTables
from validation.sensor_file import parse as parse_sensor
from validation.sensor_file import read_template

ROOT = Path(__file__).parents[3]
PACKAGE = Path(str(resources.files("validation")))
#: Files that come with the package, by format.
SHIPPED = [
    ("campaign", PACKAGE / "campaign" / "default.toml"),
    ("campaign", PACKAGE / "campaign" / "curved.toml"),
    ("data-set", PACKAGE / "data_sets" / "kiechle-sdh2.toml"),
    ("measured-force", PACKAGE / "measured_force" / "gelsight-mini.toml"),
    ("sensor", PACKAGE / "sensor_file" / "template.toml"),
    ("baseline", ROOT / ".ci" / "wts-0614-34.json"),
]


@pytest.mark.parametrize("name", FORMATS)
def test_the_committed_json_schemas_are_current(name):
    """Write them anew with `python -m validation.schema docs/schema`; they also hold required keys and defaults."""
    stored = json.loads((ROOT / "docs" / "schema" / f"{name}.json").read_text())
    assert stored == json.loads(json.dumps(make_json_schema(FORMATS[name])))


@pytest.mark.parametrize(("name", "path"), SHIPPED, ids=lambda value: getattr(value, "name", value))
def test_files_of_the_package_fit_their_schema(name, path):
    assert read(path, FORMATS[name])


def test_every_key_has_a_meaning_in_the_json_schema():
    for name, table in FORMATS.items():
        found = make_json_schema(table)
        for part in (found, *found["definitions"].values()):
            for key, value in part.get("properties", {}).items():
                if part.get("description", "") != "Largest accepted values by metric.":
                    assert value.get("description"), (name, part["description"], key)


@pytest.mark.parametrize(("count", "lines"), [(20, 20), (21, 21), (22, 21)])
def test_at_most_twenty_faults_are_listed(count, lines):
    with pytest.raises(InputError) as caught:
        parse({"series": [{"name": 1}] * count}, DataSetTables, source="set.toml")
    assert len(caught.value.faults) == lines
    assert caught.value.faults[0] == 'set.toml: series[0].name: must be a text, not 1; write for example name = "room"'
    assert (caught.value.faults[-1] == f"set.toml: and {count - 20} more") == (count > 20)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"array": 3}, "array: must be a table, not 3; write for example the table [array]"),
        ({"cover": {"layer": 3}}, "cover.layer: must be a list, not 3; write for example the tables [[cover.layer]]"),
        ({"cover": {"layer": []}}, "cover.layer: must have at least 1 entries, not 0"),
        ({"cover": {"surface": "a.stl", "unit": "mm", "thickness": "1 mm"}}, "cover.material: is missing; write for"),
        ({"cover": {"surface": "a.stl", "shape": 1}}, "cover.shape: unknown key; did you mean 'surface'?"),
        ({"electronics": {"a b": 1}}, 'electronics."a b": unknown key; accepted: rate'),
        ({"electronics": {"gains": ["x"]}}, "electronics.gains[0]: must be a number in -1e+12..1e+12, not 'x'"),
        ({"electronics": {"bits": True}}, "electronics.bits: must be a whole number in 1..32, not True"),
        ({"name": 3}, "name: must be a text, not 3"),
    ],
)
def test_a_fault_has_its_place_and_a_remedy(change, fault):
    with pytest.raises(InputError) as caught:
        parse(tomllib.loads(GOOD) | change, SensorTables)
    assert any(line.startswith(fault) for line in caught.value.faults), caught.value.faults


def test_a_place_within_a_list_of_the_file_is_named():
    with pytest.raises(InputError) as caught:
        parse({"name": "ball", "indenter": "sphere:radius=1mm", "loads": ["1 N", "1 N"]}, CaseTable, place=("case", 3))
    assert caught.value.faults == ("case[3].loads[1]: 1 N is listed twice",)


def list_places(data, place=()):
    """All places of values in parsed tables."""
    inner = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [place, *(found for key, value in inner for found in list_places(value, (*place, key)))]


EXAMPLES = {
    "sensor": tomllib.loads(read_template()),
    "campaign": tomllib.loads((PACKAGE / "campaign" / "default.toml").read_text()),
    "data-set": tomllib.loads((PACKAGE / "data_sets" / "kiechle-sdh2.toml").read_text()),
    "measured-force": tomllib.loads((PACKAGE / "measured_force" / "gelsight-mini.toml").read_text()),
    "baseline": json.loads((ROOT / ".ci" / "wts-0614-34.json").read_text()),
}
VALUES = st.recursive(
    st.booleans() | st.integers(-(2**62), 2**62) | st.floats() | st.text(max_size=5) | st.sampled_from(["1 mm", "2 N"]),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=4,
)


@settings(deadline=None, max_examples=100)
@given(st.sampled_from(sorted(EXAMPLES)), st.data(), VALUES)
def test_any_value_at_any_place_is_read_or_bad_input(name, data, value):
    """Whatever stands in a file, it is read or refused in lines; no other error is raised."""
    tables = copy.deepcopy(EXAMPLES[name])
    place = data.draw(st.sampled_from(list_places(tables)[1:]))
    table = tables
    for key in place[:-1]:
        table = table[key]
    table[place[-1]] = value
    faults = ["file: "]
    try:
        parse(tables, FORMATS[name], source="file") if name != "sensor" else parse_sensor(tables, source=Path("file"))
    except InputError as error:
        faults = error.faults
    assert faults
    assert all(fault.startswith("file: ") and "\n" not in fault for fault in faults)
