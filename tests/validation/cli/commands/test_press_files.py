"""Files of `press --out` and `press --curve`: contact forces, fields and curves, whole, partial, or refused."""

from __future__ import annotations

import csv
import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference import IncompletePathError, press
from meshes import Box, Pose, TexelArray
from tests.support.indentations import make_indentation
from tests.support.rubber import make_cover
from validation.press_files import LoadCurve, write_vtu
from validation.pressing import read_request
from validation.scene.rendering import RenderingError
from validation.sensor_file import BUILT_IN

ARRAY = TexelArray.grid(4, 4, pitch=3.4e-3)
ESTIMATES = {"total_force": 0.01, "depth": 0.02, "peak_texel": 0.03, "contact_area": 0.04}
TOUCH = ("press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--load", "200g", "--model", "fem")


def trace(points, **options):
    """Trace a curve on a cover of small strain."""
    sensor = dataclasses.replace(
        BUILT_IN["wts-0614-34"], array=ARRAY, cover=make_cover(0.45, "linear-elastic"), source="a test"
    )
    return read_request(lambda _: sensor, "sphere:radius=4mm", models="fem", pose={}, **options).trace(points)


def refuse_to_draw():
    raise RenderingError("no graphics in this test")


@pytest.mark.slow
def test_out_writes_contact_and_fields_that_others_can_read(softcover, tmp_path, monkeypatch):
    pyvista = pytest.importorskip("pyvista")
    # nothing is drawn in three dimensions, which takes most of the time: `scene/test_draw.py` tests that
    monkeypatch.setattr("validation.scene.rendering.find_window_without_display", refuse_to_draw)
    folder = tmp_path / "pressed"
    status, out, _ = softcover(*TOUCH, "--out", str(folder), "--json")
    total = json.loads(out)["models"]["fem"]["total_force"]
    assert status == 3  # the picture of the cover is missing
    rows = list(csv.DictReader((folder / "contact.csv").open()))
    assert -sum(float(row["force_z_N"]) for row in rows) == pytest.approx(total)
    assert json.loads((folder / "press.json").read_text())["models"]["fem"]["total_force"] == total
    grid, arrays = pyvista.read(folder / "fields.vtu"), np.load(folder / "fields.npz")
    assert np.asarray(grid.points) == pytest.approx(arrays["position"])
    assert np.asarray(grid.point_data["stress"]).reshape(-1, 3, 3) == pytest.approx(arrays["stress"])
    cells = grid.cells.reshape(len(arrays["cells"]), -1)[:, 1:]
    assert (cells == arrays["cells"]).all()
    areas = grid.compute_cell_sizes(length=False, volume=False)["Area"]
    x, z = np.ptp(arrays["position"][:, [0, 2]], axis=0)
    assert areas.sum() == pytest.approx(x * z)


@pytest.mark.slow
def test_hexahedra_fill_the_block(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    box = Box(size=(4e-3, 3e-3, 4e-3))
    found = press(make_cover(0.45, "linear-elastic"), ARRAY, box, load=0.3, pose=Pose.planar(yaw=0.3), fields=True)
    write_vtu(found.fields, tmp_path / "fields.vtu")
    grid = pyvista.read(tmp_path / "fields.vtu")
    volumes = np.asarray(grid.compute_cell_sizes()["Volume"])
    assert (volumes > 0).all()
    inwards = np.asarray(grid.points) - found.fields.position.mean(axis=0)
    c, s = np.cos(0.3), np.sin(0.3)
    turned = inwards[:, :2] @ np.array([[c, -s], [s, c]])
    assert volumes.sum() == pytest.approx(np.prod(np.ptp(turned, axis=0)) * 2e-3)


@pytest.mark.slow
def test_a_curve_is_the_points_of_a_path_and_is_drawn(softcover, tmp_path):
    folder = tmp_path / "curve"
    status, out, _ = softcover(*TOUCH, "--curve", "2", "--out", str(folder), "--json")
    result = json.loads(out)
    assert status == 0
    assert [row["load_N"] for row in result["curve"]] == pytest.approx(np.arange(1, 3) / 2 * 0.2 * 9.80665)
    rows = list(csv.DictReader((folder / "curve.csv").open()))
    assert [float(row["depth_m"]) for row in rows] == [row["depth_m"] for row in result["curve"]]
    assert (np.diff([row["depth_m"] for row in result["curve"]]) > 0).all()
    assert (folder / "curve.png").read_bytes()[:4] == b"\x89PNG"


def test_a_path_that_stops_early_keeps_what_it_reached(monkeypatch, tmp_path):
    targets = []

    def stop(*_, depths, **__):
        targets.extend(depths)
        reached = [make_indentation(np.ones(16), depth=each, error_estimate=ESTIMATES) for each in depths[:2]]
        raise IncompletePathError("no convergence beyond 0.25 mm", reached)

    monkeypatch.setattr("fem_reference.press_path", stop)
    curve = trace(5, depth="0.4mm")
    assert curve.stopped == "no convergence beyond 0.25 mm"
    assert curve.note.startswith("2 of 5 points are reached")
    assert targets == pytest.approx(np.arange(1, 6) * 0.08e-3)
    assert [each.depth for each in curve.indentations] == pytest.approx([0.08e-3, 0.16e-3])
    assert curve.write(tmp_path)[0] == "curve.csv"


@pytest.mark.slow
def test_a_curve_follows_the_accuracy_and_keeps_warnings(monkeypatch, tmp_path):
    monkeypatch.setattr(
        "fem_reference.indentation.layered.LayerPress.count_refinements", lambda *_: 0
    )  # only the usual grids
    curve = trace(2, load="0.2N", accuracy=1e-4)
    rows = curve.as_json()["curve"]
    assert all("wanted, but the feasible grids reach" in row["warnings"][-1] for row in rows)
    assert [sentence[:8] for sentence in curve.warnings] == ["at 0.1 N", "at 0.2 N"]
    curve.write(tmp_path)
    written = list(csv.DictReader((tmp_path / "curve.csv").open()))
    assert [float(row["balance"]) for row in written] == [row["balance"] for row in rows]
    assert all("wanted" in row["warnings"] for row in written)


def test_warnings_of_a_curve_that_differ_in_numbers_are_one_with_their_ranges():
    said = {
        0.1: ("large estimated error: contact area 12%", "no side"),
        0.2: ("large estimated error: contact area 9%",),
    }
    said |= {0.3: (), 0.4: ("large estimated error: contact area 9%",)}
    points = [SimpleNamespace(total_force=load, warnings=each) for load, each in said.items()]
    assert LoadCurve(indentations=points, wanted=4).warnings == (
        "at 0.1 N to 0.4 N (3 of 4 points): large estimated error: contact area 9..12%",
        "at 0.1 N: no side",
    )


@pytest.mark.slow
def test_a_stiff_foil_that_pulls_texels_is_explained(softcover):
    foil = ("--thickness", "2mm", "--layer", "2:thickness=0.2mm,youngs_modulus=3GPa,poisson_ratio=0.35")
    assert "Negative forces on texels" in " ".join(softcover(*TOUCH, *foil)[1].split())
    assert "Negative forces" not in softcover(*TOUCH)[1]
