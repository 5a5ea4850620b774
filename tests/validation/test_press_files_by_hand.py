"""Files of one indentation and of a curve, whose numbers are made up: rows, units and pictures."""

import csv
import dataclasses
import json

import numpy as np
import pytest

from fem_reference.fields.cover_fields import CoverFields
from meshes import Pose, Sphere
from tests.support.indentations import make_indentation
from validation.campaign.case import Case
from validation.campaign.comparison import Comparison
from validation.press_files import LoadCurve, write_press, write_vtu
from validation.sensor_file import BUILT_IN

SENSOR = BUILT_IN["wts-0614-34"]
FORCES = np.arange(84) / 100 - 0.05


def read(path):
    with path.open() as file:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]


@pytest.fixture
def found():
    x = np.array([[0.0, 0, 0], [2e-3, 0, 0], [2e-3, 0, 2e-3], [0.0, 0, 2e-3]])
    fields = CoverFields(
        position=x, displacement=0.1 * x, stress=np.arange(36.0).reshape(4, 3, 3), cells=np.array([[0, 1, 2, 3]]),
        layer=np.array([0]), axisymmetric=True, error=0.02,
    )  # fmt: skip
    return make_indentation(
        FORCES, outside=0.25, fields=fields, depth=0.31e-3, contact_area=9e-6, energy=2e-4, balance=-0.003,
        contact_points=np.array([[1e-3, 2e-3, 2.1e-3], [3e-3, 4e-3, 2.2e-3], [5e-3, 6e-3, 2.3e-3]]),
        contact_forces=np.array([[0.1, 0.2, -3.0], [0.0, 0.0, 0.0], [0.0, 0.3, 0.0]]),
        error_estimate={"total_force": 0.01, "depth": 0.02, "peak_texel": 0.03},
    )  # fmt: skip


def test_the_files_of_a_press_hold_texels_and_the_points_that_carry_force(found, tmp_path, monkeypatch):
    monkeypatch.setattr("validation.scene.draw.write_scene", lambda *_: ())
    monkeypatch.setattr("validation.press_files.write_vtu", lambda *_: (_ for _ in ()).throw(ImportError))
    case = Case(
        name="press", indenter=Sphere(radius=5e-3), shape="sphere:radius=5mm", load=3.3,
        pose=Pose.planar(at=(1e-3, -2e-3), yaw=0.25),
    )  # fmt: skip
    comparison = Comparison(
        sensor=SENSOR, case=case, fem=found, fast=None, score=None, models=("fem",), wanted={"depth": 0.31e-3},
        stopped="at 3.3 N",
    )  # fmt: skip
    assert write_press(comparison, tmp_path) == ("press.json", "texels.csv", "contact.csv", "fields.npz", "press.png")
    texels = read(tmp_path / "texels.csv")
    assert list(texels[0]) == ["x_m", "y_m", "z_m", "nx", "ny", "nz", "force_N"]
    assert [row["force_N"] for row in texels] == FORCES.tolist()
    # texel 8 is in column 2 of 6 and row 1 of 14
    assert list(texels[8].values()) == pytest.approx([-0.5 * 3.4e-3, -5.5 * 3.4e-3, 0, 0, 0, 1, 0.03])
    assert read(tmp_path / "contact.csv") == [
        {"x_m": 1e-3, "y_m": 2e-3, "z_m": 2.1e-3, "force_x_N": 0.1, "force_y_N": 0.2, "force_z_N": -3.0},
        {"x_m": 5e-3, "y_m": 6e-3, "z_m": 2.3e-3, "force_x_N": 0.0, "force_y_N": 0.3, "force_z_N": 0.0},
    ]
    written = json.loads((tmp_path / "press.json").read_text())
    assert written["models"]["fem"]["texel_forces"] == FORCES.reshape(14, 6).tolist()
    assert written["models"]["fem"]["depth"] == 0.31e-3
    assert written["wanted"] == {"depth": 0.31e-3}
    assert (written["load"], written["stopped"], written["scores"]) == (3.3, "at 3.3 N", None)
    assert (written["at"], written["yaw"]) == ([1e-3, -2e-3, 0.0], 0.25)
    with np.load(tmp_path / "fields.npz") as arrays:
        for name in ("position", "displacement", "stress", "cells", "layer", "error"):
            np.testing.assert_array_equal(arrays[name], getattr(found.fields, name))


def test_without_finite_elements_no_file_is_written(tmp_path):
    case = Case(name="press", indenter=Sphere(radius=5e-3), shape="sphere:radius=5mm", load=3.3)
    none = Comparison(sensor=SENSOR, case=case, fem=None, fast=None, score=None, models=("fast",), wanted={"load": 3.3})
    assert write_press(none, tmp_path) == ()
    assert list(tmp_path.iterdir()) == []
    assert (none.warnings, none.indentations) == ((), ())


@pytest.fixture
def curve(found):
    low = dataclasses.replace(
        found, texel_forces=-FORCES[::-1] / 2, total_force=1.5, depth=0.1e-3, warnings=("large estimated error: 3%",)
    )
    high = dataclasses.replace(found, total_force=4.0, warnings=("large estimated error: 12%", "a side is near"))
    return LoadCurve(indentations=(low, high), wanted=3, stopped="no convergence", note="2 of 3")


def test_a_row_of_a_curve_holds_one_press_in_si_units(curve, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **__: drawn.append(figure))
    assert curve.write(tmp_path) == ("curve.csv", "curve.png")
    rows = list(csv.DictReader((tmp_path / "curve.csv").open()))
    expected = {
        "load_N": [1.5, 4.0], "depth_m": [0.1e-3, 0.31e-3], "contact_area_m2": [9e-6, 9e-6], "energy_J": [2e-4, 2e-4],
        "peak_texel_N": [0.39, 0.78], "outside_N": [0.25, 0.25], "balance": [-0.003, -0.003],
        "error_total_force": [0.01, 0.01], "error_depth": [0.02, 0.02], "error_peak_texel": [0.03, 0.03],
    }  # fmt: skip
    assert list(rows[0]) == [*expected, "warnings"]
    for name, values in expected.items():
        assert [float(row[name]) for row in rows] == pytest.approx(values), name
    assert [row["warnings"] for row in rows] == [
        "large estimated error: 3%", "large estimated error: 12%; a side is near",
    ]  # fmt: skip
    assert curve.as_json()["wanted"] == 3
    assert curve.as_json()["stopped"] == "no convergence"
    assert dataclasses.replace(curve, stopped="").as_json()["stopped"] is None
    assert curve.warnings == (
        "at 1.5 N to 4 N (2 of 2 points): large estimated error: 3..12%", "at 4 N: a side is near",
    )  # fmt: skip
    (axes,) = drawn[0].axes
    for container, label, forces, share in zip(
        axes.containers, ("load", "largest texel force"), ([1.5, 4.0], [0.39, 0.78]), (0.01, 0.03), strict=True
    ):
        line, _, (across, along) = container.lines
        assert container.get_label() == label
        np.testing.assert_allclose(line.get_xdata(), [0, 0.1, 0.31])
        np.testing.assert_allclose(line.get_ydata(), [0, *forces])
        # bars from -error to +error: 2 % of the depth [mm], and the share of the force
        for number, force in enumerate(forces):
            depth = (0.1, 0.31)[number]
            np.testing.assert_allclose(np.ptp(across.get_segments()[number + 1][:, 0]), 2 * 0.02 * depth)
            np.testing.assert_allclose(np.ptp(along.get_segments()[number + 1][:, 1]), 2 * share * force)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("depth [mm]", "force [N]")
    assert (axes.get_xlim()[0], axes.get_ylim()[0]) == (0, 0)
    assert axes.get_title().endswith("; the path stopped")


@pytest.mark.parametrize(("corners", "kind"), [(4, 9), (8, 12)])
def test_a_vtk_file_holds_fields_at_nodes_and_layers_of_cells(tmp_path, corners, kind):
    """A quadrilateral is cell type 9 of VTK, a hexahedron 12."""
    pyvista = pytest.importorskip("pyvista")
    x = np.array([[i, j, k] for k in (0.0, 2.0) for i, j in ((0, 0), (3, 0), (3, 1), (0, 1))])[:corners]
    fields = CoverFields(
        position=x, displacement=0.1 * x + [0.5, 0.0, -0.25], stress=np.arange(9.0 * corners).reshape(-1, 3, 3),
        cells=np.arange(corners)[None], layer=np.array([3]), axisymmetric=corners == 4, error=0.02,
    )  # fmt: skip
    write_vtu(fields, tmp_path / "fields.vtu")
    grid = pyvista.read(tmp_path / "fields.vtu")
    assert grid.celltypes.tolist() == [kind]
    np.testing.assert_allclose(grid.points, x)
    np.testing.assert_allclose(grid.point_data["displacement"], fields.displacement)
    np.testing.assert_allclose(grid.point_data["stress"], np.arange(9.0 * corners).reshape(corners, 9))
    np.testing.assert_allclose(grid.point_data["von_mises"], fields.von_mises)
    assert grid.cell_data["layer"].tolist() == [3]


def test_a_curve_that_reached_its_target_has_no_reason_and_one_point_no_range(found):
    one = dataclasses.replace(found, total_force=2.5, warnings=("error: 3% of 7 N", "error: 5% of 7 N"))
    curve = LoadCurve(indentations=(one,), wanted=1)
    assert (curve.stopped, curve.note, curve.as_json()["stopped"]) == ("", "", None)
    assert curve.warnings == ("at 2.5 N (2 of 1 points): error: 3..5% of 7 N",)
    assert curve.rows()[0]["peak_texel_N"] == pytest.approx(0.78)
    assert LoadCurve(indentations=(), wanted=1).warnings == ()
