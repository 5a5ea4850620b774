"""Sensors whose cover has free side edges: what is derived, written, shown and refused."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import fastmodel
from fastmodel import Tabulated
from fastmodel.attachment import choose_method
from fastmodel.pressure.cell_grid import BaseForces, CellGrid
from meshes import Sphere
from validation.cli import main
from validation.derivation.derive import derive
from validation.json_values import json_text
from validation.sensor_file import load

SENSOR = """
[array]
rows = 2
columns = 2
pitch = "3.4 mm"

[[cover.layer]]
thickness = "4 mm"
material = { model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.45 }

[cover]
size = "7.6 mm"

[electronics]
rate = "271 Hz"
sensitivity = "2665.7 1/N"
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("sensor") / "pad.toml"
    path.write_text(SENSOR, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def derivation(path):
    return derive(load(path))


def test_spread_is_what_even_forces_on_each_texel_do_where_they_are(derivation):
    array, spread = derivation.parameters.array, derivation.parameters.spread
    assert isinstance(spread, Tabulated)
    image = array.image(spread.matrix[:, array.middle])
    assert image == pytest.approx(derivation.texel_response_uniform)
    assert image.sum() + derivation.outside[1] == pytest.approx(1, abs=1e-5)
    # a square pad turned by a quarter is itself
    assert spread.matrix[0, 1] == pytest.approx(spread.matrix[0, 2], rel=1e-9)
    assert spread.matrix[0, 0] == pytest.approx(spread.matrix[3, 3], rel=1e-9)


def test_cells_of_a_texel_do_together_what_the_texel_does(derivation):
    cells, matrix = derivation.parameters.surface, derivation.parameters.spread.matrix
    s = cells.per_texel
    for texel, (row, column) in enumerate(np.ndindex(2, 2)):
        own = cells.table[:, s * row : s * (row + 1), s * column : s * (column + 1)]
        assert own.mean(axis=(1, 2)) == pytest.approx(matrix[:, texel], abs=1e-4)


def test_written_folder_carries_the_sides_to_the_fast_model(derivation, tmp_path):
    array, cells = derivation.parameters.array, derivation.parameters.surface
    derivation.parameters.save(tmp_path)
    again = fastmodel.load(tmp_path)
    assert np.array_equal(again.surface.table, cells.table)
    assert np.array_equal(again.spread.operator(array), derivation.parameters.spread.matrix)
    name, method = choose_method("default", again)
    assert name == "cover"
    assert method.plate.count_pitches(again.array) == pytest.approx([0.4 / 3.4] * 2)  # 7.6 mm over 2 x 3.4 mm
    bare = dataclasses.replace(again, array=dataclasses.replace(array, margin=None))
    assert choose_method("default", bare)[1].plate.margin == 0
    pressed = fastmodel.indent(again, Sphere(radius=4e-3), load=0.5)
    assert pressed.texel_forces.sum() + pressed.outside == pytest.approx(0.5, rel=1e-3)
    assert pressed.texel_forces == pytest.approx(pressed.texel_forces[0], rel=1e-3)


@pytest.mark.parametrize("margin", [0, 1])
def test_forces_on_cells_go_through_the_table_and_nothing_is_felt_beyond_the_array(derivation, margin):
    array, cells = derivation.parameters.array, derivation.parameters.surface
    grid = CellGrid.over(array, cells.per_texel, margin)
    base = BaseForces(cells, grid, array)
    forces = np.random.default_rng(0).uniform(0, 1, (grid.rows, grid.columns))
    edge = grid.margin[0]
    inner = forces[edge : grid.rows - edge, edge : grid.columns - edge]
    expected = np.einsum("nrc,rc->n", cells.table, inner)
    assert base.from_window(forces, (0, 0)) == pytest.approx(expected)
    part = base.from_window(forces[1:4, 2:7], (1, 2))
    alone = np.zeros_like(forces)
    alone[1:4, 2:7] = forces[1:4, 2:7]
    assert part == pytest.approx(base.from_window(alone, (0, 0)), abs=1e-12)


def test_what_only_a_wide_cover_has_is_left_out_plainly(derivation, path, capsys):
    result = json.loads(json_text(derivation.result.as_json()))
    assert result["cover"]["size_m"] == pytest.approx([7.6e-3, 7.6e-3])
    assert result["point_response"] is None
    assert result["resolution"] is None
    assert result["sensitivity"] == {}
    assert result["psf"]["sigma_x"] == pytest.approx(result["psf"]["sigma_y"], rel=1e-6)
    with pytest.raises(SystemExit) as done:
        main(["derive", str(path)])
    assert done.value.code == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "free: the spread differs from place to place" in shown
    assert "resolution" not in shown


@pytest.mark.slow
def test_budget_below_one_case_is_refused_in_one_line_before_any_work(path, tmp_path, capsys):
    with pytest.raises(SystemExit) as left:
        main(["validate", str(path), "--budget", "2 s", "--out", str(tmp_path / "report")])
    assert left.value.code == 2
    faults = [line for line in capsys.readouterr().err.splitlines() if "--budget" in line]
    assert len(faults) == 1
    assert "less than one case" in faults[0]
    assert not (tmp_path / "report").exists()
