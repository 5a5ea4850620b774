from dataclasses import replace

import pytest

import fastmodel
from validation.cli.options import CoverChanges, read_sensor
from validation.parameters import find_parameters
from validation.sensor_file import BUILT_IN, CURVED


@pytest.fixture
def folder(tmp_path):
    parameters = fastmodel.load("sdh2-distal")
    array = replace(parameters.array, name="mine")
    return replace(parameters, array=array).save(tmp_path / "derived").parent


def test_a_derived_folder_stands_for_a_sensor(folder):
    for path in (folder, folder / "parameters.toml"):
        found = read_sensor(str(path))
        assert found.array.name == "mine"
        assert find_parameters(found, print) is found


def test_built_in_sensors_need_no_finite_elements(without_reference):
    assert tuple(sorted(BUILT_IN)) == fastmodel.list_sensors()
    for name in BUILT_IN:
        assert find_parameters(read_sensor(name), print).array.name == name


def test_another_cover_is_derived_anew(without_reference):
    with pytest.raises(AssertionError, match="the finite elements were asked"):
        find_parameters(read_sensor("wts-0614-34", CoverChanges(thickness="1mm")), lambda _: None)


def test_a_built_in_name_means_the_sensor_even_beside_such_a_folder(folder, monkeypatch):
    monkeypatch.chdir(folder.parent)
    folder.rename("wts-0614-34")
    assert read_sensor("wts-0614-34") is BUILT_IN["wts-0614-34"]
    assert read_sensor("./wts-0614-34").array.name == "mine"
    (folder.parent / "phalanx").mkdir()
    assert read_sensor("phalanx", any_cover=True).cover is CURVED["phalanx"].cover
