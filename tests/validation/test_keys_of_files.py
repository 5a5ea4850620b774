"""Keys of all TOML files: which are required, and what stands for those that are left out."""

import importlib

import pytest
from pydantic import TypeAdapter, ValidationError

from validation.data_sets.tables import DataSetTables
from validation.sensor_file.faults import list_faults

#: Required keys and defaults other than None, by module and table.
ELECTRONICS = {"offset": 0.0, "bits": 12, "noise": 0.0, "threshold": 0.0, "saturation_band": 0.0}
ELECTRONICS |= {"calibrated": "texel force"}
KEYS = {
    "data_sets.tables": {
        "FileTable": (["path"], {}),
        "SeriesTable": (["name"], {"files": [], "file": [], "loads": {}, "use": ["fit", "score"]}),
        "SelectionTable": (["series"], {"files": []}),
        "SplitTable": (["name", "fit", "score"], {"place": [], "about": ""}),
        "DataSetTables": (["series"], {"split": [], "source": ""}),
    },
    "measured_force.case": {
        "PointTable": (["depth", "force", "use"], {}),
        "UncertaintyTable": ([], {}),
        "MeasurementTables": (["name", "indenter", "cover", "point"], {"source": "given by the user"}),
    },
    "sensor_file.curved_cover": {
        "CurvedCoverTable": (["material"], {}),
        "CurvedSensorTables": (["array", "cover"], {}),
    },
    "sensor_file.tables": {
        "ArrayTable": (["rows", "columns", "pitch"], {"project": False}),
        "MaterialTable": (["model"], {"name": "", "poisson_spread": 0.0}),
        "LayerTable": (["thickness", "material"], {}),
        "CoverTable": (["layer"], {"base": "bonded"}),
        "ContactTable": ([], {"friction": 0.0}),
        "FilterTable": (["cutoff"], {"order": 2}),
        "SpreadTable": (["sigma_x", "sigma_y", "ksize_x", "ksize_y"], {}),
        "ElectronicsTable": ([], ELECTRONICS),
        "SensorTables": (["array", "cover"], {}),
    },
}


@pytest.mark.parametrize(("module", "table"), [(module, table) for module in KEYS for table in KEYS[module]])
def test_required_keys_and_defaults(module, table):
    fields = getattr(importlib.import_module(f"validation.{module}"), table).__pydantic_fields__
    required = [name for name, field in fields.items() if field.is_required()]
    given = {
        name: field.get_default(call_default_factory=True) for name, field in fields.items() if name not in required
    }
    plain = {
        name: value
        for name, value in given.items()
        if value is None or isinstance(value, bool | int | float | str | list | dict)
    }
    assert (required, {name: value for name, value in plain.items() if value is not None}) == KEYS[module][table]


@pytest.mark.parametrize(("count", "lines"), [(20, 20), (21, 21), (22, 21)])
def test_at_most_twenty_faults_are_listed(count, lines):
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(DataSetTables).validate_python({"series": [{"name": 1}] * count})
    listed = list_faults(caught.value, DataSetTables)
    assert len(listed) == lines
    assert listed[0].startswith("series[0].name: ")
    assert (listed[-1] == f"and {count - 20} more") == (count > 20)
