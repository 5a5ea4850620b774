import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from fastmodel.errors import FastModelError, ParametersError
from fastmodel.parameters import Parameters, list_sensors, load
from fastmodel.signal.butterworth import Butterworth
from fastmodel.signal.electronics import WTS_0614_34
from fastmodel.signal.point_spread import Gaussian, Tabulated
from meshes import TexelArray, atomic_file
from meshes.catalogue import ARRAYS


def make(**changes):
    return Parameters(
        **{
            "array": ARRAYS["sdh2-distal"],
            "spread": Gaussian.from_sigma(0.71, 0.52),
            "electronics": WTS_0614_34,
            "filter": Butterworth(cutoff_hz=30.0, order=3),
            "provenance": {
                "estimator": "least-squares-uniform",
                "error": {"sigma": np.float64(0.01), "x": None},
            },
            "tables": {"radius": np.linspace(0, 1e-2, 7)},
            **changes,
        }
    )


def assert_same(one, other):
    """Compare array, electronics and filter."""
    for name, value in vars(one.array).items():
        np.testing.assert_array_equal(getattr(other.array, name), value)
    assert (one.electronics, one.filter) == (other.electronics, other.filter)


def test_saved_parameters_are_loaded_unchanged(tmp_path):
    saved = make()
    path = saved.save(tmp_path / "new" / "folder")
    assert sorted(p.name for p in path.parent.iterdir()) == ["cover.npz", "parameters.toml"]
    back = load(path.parent)
    assert_same(back, saved)
    assert back.spread == saved.spread
    assert back.provenance == {"estimator": "least-squares-uniform", "error": {"sigma": 0.01}}
    assert np.array_equal(back.tables["radius"], saved.tables["radius"])


def test_the_width_of_the_cover_beyond_the_texels_is_kept_and_a_negative_one_is_refused(tmp_path):
    saved = make(array=TexelArray.grid(2, 3, 2e-3, margin=(1.2e-3, 0.0)))
    path = saved.save(tmp_path)
    assert load(tmp_path).array.margin == (1.2e-3, 0.0)
    path.write_text(path.read_text().replace("0.0012", "-0.0012"))
    with pytest.raises(ParametersError, match=r"\[array\] margin must be the width .*, 0 m or more, not"):
        load(tmp_path)


def test_operator_gains_and_free_layout_are_loaded_unchanged(tmp_path):
    angle = np.linspace(-0.5, 0.5, 6)
    normals = np.stack([np.sin(angle), np.zeros(6), np.cos(angle)], axis=1)
    grid = TexelArray.grid(1, 6, (1.6e-3, 2e-3), texel_size=(1e-3, 2e-3), name="bent")
    array = dataclasses.replace(grid, centres=8e-3 * (normals - [0, 0, 1]), normals=normals)
    gains, characteristic = (1.0, 0.9, 1.1, 1.0, 1.2, 0.8), (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
    electronics = dataclasses.replace(WTS_0614_34, gains=gains, characteristic=characteristic)
    spread = Tabulated(matrix=np.random.default_rng(0).random((6, 6)), source="finite elements")
    saved = make(array=array, spread=spread, electronics=electronics, filter=None)
    saved.save(tmp_path)
    back = load(tmp_path / "parameters.toml")
    assert_same(back, saved)
    assert np.array_equal(back.spread.matrix, spread.matrix)
    assert back.spread.source == "finite elements"


def test_same_parameters_give_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        make().save(tmp_path / name)
    for file in ("cover.npz", "parameters.toml"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("sigma_x = 0.71", "sigma_x = -1.0"), r"\[spread\] sigma must be positive"),
        (("sigma_x = 0.71", "sigma_q = 0.71"), r"\[spread\].*sigma_q"),
        (('kind = "gaussian"', 'kind = "boxcar"'), r"\[spread\] kind is 'boxcar'; it must be"),
        (("rows = 13", "rows = 12"), r"\[array\]"),
        (("rows = 13", ""), r"array\.rows is missing"),
        (("format = 1", "format = 99"), "format is 99; this version reads 1"),
        (("bits = 12", "bits = 8"), r"\[electronics\] output_max must lie in 1\.\.255"),
        (("cutoff_hz = 30.0", "cutoff_hz = -30.0"), r"\[filter\] cutoff_hz"),
        (("[array]", "[array"), "not readable as TOML"),
        (('file = "cover.npz"', "file = 3"), r"\[cover\] file must be 'cover\.npz'"),
        (("sensitivity = 2665.7", "sensitivity = inf"), r"\[electronics\] sensitivity"),
    ],
)
def test_bad_toml_is_reported_in_one_line(tmp_path, change, message):
    path = make().save(tmp_path)
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    with pytest.raises(ParametersError, match=message) as caught:
        load(tmp_path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value).split("TOML:")[0]


def test_damaged_toml_raises_a_parameters_error(tmp_path):
    """Bytes and values at random: it loads or raises the one error type."""
    path = make().save(tmp_path)
    whole = path.read_bytes()
    lines = whole.decode().split("\n")
    places = [k for k, line in enumerate(lines) if " = " in line and not line.endswith("[")]
    values = ('"x"', "-1", "1e400", "nan", "[]", "{}", "0", "99999")
    damaged = [
        "\n".join([*lines[:k], f"{lines[k].split(' = ')[0]} = {value}", *lines[k + 1 :]]).encode()
        for k in places
        for value in values
    ]
    rng = np.random.default_rng(0)
    for _ in range(60):
        noisy = np.frombuffer(whole, np.uint8).copy()
        noisy[rng.integers(len(noisy), size=2)] = rng.integers(256, size=2)
        damaged.append(noisy.tobytes())
    refused = 0
    for content in damaged:
        path.write_bytes(content)
        try:
            load(tmp_path)
        except ParametersError:
            refused += 1
    assert refused > 0.5 * len(damaged)


def test_a_sensor_file_is_no_folder_of_parameters(tmp_path):
    path = tmp_path / "sensor.toml"
    path.write_text("[array]\nrows = 2\n")
    with pytest.raises(ParametersError, match="describes a sensor; run `softcover derive "):
        load(path)


def test_missing_truncated_and_foreign_files_are_named(tmp_path):
    with pytest.raises(ParametersError, match=r"nowhere: no such folder; .* sdh2-distal, wts-0614-34"):
        load(tmp_path / "nowhere")
    make().save(tmp_path)
    tables = tmp_path / "cover.npz"
    whole = tables.read_bytes()
    tables.write_bytes(whole[:-20])
    with pytest.raises(ParametersError, match="sha256 differs"):
        load(tmp_path)
    tables.unlink()
    with pytest.raises(ParametersError, match=r"cover\.npz: No such file"):
        load(tmp_path)


@pytest.mark.parametrize("failing", range(9))
def test_a_matching_pair_remains_when_any_rename_or_flush_fails(tmp_path, monkeypatch, failing):
    """Three files, the copy of the old tables among them: each is flushed and renamed, then its folder is flushed."""
    make(spread=Gaussian.from_sigma(0.5)).save(tmp_path)
    calls = iter(range(100))

    def sometimes(real):
        def call(*arguments):
            if next(calls) == failing:
                raise OSError(28, "No space left on device")
            return real(*arguments)

        return call

    monkeypatch.setattr(os, "fsync", sometimes(os.fsync))
    monkeypatch.setattr(os, "replace", sometimes(os.replace))
    with pytest.raises(OSError, match="No space"):
        make(spread=Gaussian.from_sigma(1.5)).save(tmp_path)
    assert load(tmp_path).spread.sigma_x == (0.5 if failing < 8 else 1.5)
    assert atomic_file.temporary_files(tmp_path) == []
    monkeypatch.undo()
    make(spread=Gaussian.from_sigma(1.5)).save(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cover.npz", "parameters.toml"]


def test_parts_that_do_not_fit_are_refused():
    with pytest.raises(FastModelError, match="78 texels"):
        make(spread=Tabulated(matrix=np.eye(84)))
    with pytest.raises(FastModelError, match="gains for 3"):
        make(electronics=dataclasses.replace(WTS_0614_34, gains=(1.0, 1.0, 1.0)))
    with pytest.raises(ParametersError, match="must not be named"):
        make(tables={"operator": np.eye(78)})


def test_sensors_that_come_with_the_package_load_by_name():
    assert list_sensors() == ("sdh2-distal", "wts-0614-34")
    for name in list_sensors():
        parameters = load(name)
        np.testing.assert_array_equal(parameters.array.centres, ARRAYS[name].centres)
        np.testing.assert_array_equal(parameters.array.active, ARRAYS[name].active)
        assert parameters.surface is not None


def test_a_path_means_a_folder_even_if_a_sensor_has_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    load("sdh2-distal").save("wts-0614-34")
    assert load("wts-0614-34").array.name == "wts-0614-34"
    assert load("./wts-0614-34").array.name == load(Path("wts-0614-34")).array.name == "sdh2-distal"


def test_what_counts_were_calibrated_against_is_stored_and_its_absence_is_said(tmp_path, caplog):
    known = dataclasses.replace(WTS_0614_34, tip_share=0.77)
    make(electronics=known).save(tmp_path)
    assert load(tmp_path).electronics == known
    text = (tmp_path / "parameters.toml").read_text()
    assert 'calibrated = "through the cover, tip 1 mm"\ntip_share = 0.77\n' in text
    assert not caplog.records
    earlier = text.replace('calibrated = "through the cover, tip 1 mm"\ntip_share = 0.77\n', "")
    (tmp_path / "parameters.toml").write_text(earlier)
    assert load(tmp_path).electronics.calibrated == "texel force"
    assert "[electronics] has no `calibrated`" in caplog.text
    (tmp_path / "parameters.toml").write_text(text.replace("tip 1 mm", "tip 1"))
    with pytest.raises(ParametersError, match=r"parameters.toml: \[electronics\] calibrated must be 'texel force' or"):
        load(tmp_path)
