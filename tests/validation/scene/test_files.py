"""Pictures of covers: what is written where a machine can draw, and where it cannot."""

import json
import logging

import numpy as np
import pytest

from validation.cover_meshes import make_meshes
from validation.scene import rendering
from validation.scene.cover_scene import average_pressure, show_mesh, split_cells
from validation.scene.draw import lacks_picture, write_scene

pyvista = pytest.importorskip("pyvista")


@pytest.fixture
def scene(small_pad):
    return show_mesh(make_meshes(small_pad)[-1], small_pad.array, title="pad")


@pytest.fixture
def without_graphics(monkeypatch):
    monkeypatch.setattr(rendering, "_LIBRARIES", {"vtkEGLRenderWindow": ("libNone.so",)})
    rendering.find_window_without_display.cache_clear()
    yield
    rendering.find_window_without_display.cache_clear()


def test_without_graphics_one_line_says_what_is_missing(scene, tmp_path, without_graphics, caplog):
    with caplog.at_level(logging.WARNING):
        files = write_scene(scene, tmp_path)
    assert files == ("cover.vtu",)
    assert lacks_picture(files)
    assert [each.name for each in tmp_path.iterdir()] == ["cover.vtu"]
    (record,) = caplog.records
    assert "neither EGL nor OSMesa" in record.getMessage()
    assert "apt-get install libegl1" in record.getMessage()


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("import time; time.sleep(60)", "no picture within 0.5 s"),
        ("import sys; sys.exit('first\\n ' + 'x' * 300)", f" {'x' * 199}"),
        ("import sys; sys.exit(1)", "the picture is empty"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "the process was ended by signal 9"),
        ("pass", None),
    ],
)
def test_a_trial_picture_that_fails_says_why(monkeypatch, program, said):
    monkeypatch.setattr(rendering, "_PROBE", program)
    if "sleep" in program:
        monkeypatch.setattr(rendering, "_TIMEOUT", 0.5)
    assert rendering._try_to_draw("") == said


def test_hexahedra_of_27_nodes_are_split_without_gaps(small_pad):
    mesh = make_meshes(small_pad)[-1]
    cells = split_cells(mesh)
    assert len(cells) == 8 * len(mesh.cells)
    grid = pyvista.UnstructuredGrid({pyvista.CellType.HEXAHEDRON: cells}, mesh.nodes)
    assert grid.compute_cell_sizes()["Volume"].sum() == pytest.approx(9e-3 * 9e-3 * 2e-3, rel=1e-6)


def test_mean_pressures_carry_the_force():
    facets = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    pressure = average_pressure(facets, np.full(6, 0.5), np.array([2e-6, 2e-6]))
    assert pressure @ np.array([0.5, 1, 1, 0.5, 0.5, 0.5]) * 1e-6 == pytest.approx(3.0, rel=1e-6)


@pytest.mark.slow
def test_a_picture_shows_the_cover(scene, tmp_path):
    try:
        rendering.find_window_without_display()
    except rendering.RenderingError as error:
        pytest.skip(str(error))
    assert write_scene(scene, tmp_path) == ("cover.png", "cover.gltf", "cover.vtu")
    picture = pyvista.read(tmp_path / "cover.png").active_scalars
    assert len(np.unique(picture.reshape(-1, picture.shape[-1]), axis=0)) > 50
    assert json.loads((tmp_path / "cover.gltf").read_text())["asset"]["version"] == "2.0"
