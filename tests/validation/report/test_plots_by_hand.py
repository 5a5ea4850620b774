"""Labels, colours and legends of the report's plots, and the files of derivations of both kinds of cover."""

import dataclasses
import json
import logging
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure

from meshes import TexelArray
from meshes.solids.solid_mesh import SolidMesh, read_mesh
from validation.derivation.layers import LayeredDerivation
from validation.derivation.solid import SolidDerivation
from validation.moving.results import MovingResult, MovingScore
from validation.render.figure import COLOURS
from validation.report import figures
from validation.report.figures import (
    draw_campaign,
    draw_cases,
    draw_derivation,
    draw_left_out,
    draw_moving,
    plot_responses,
    write_derivation,
)
from validation.scene.rendering import RenderingError


def is_above(legend, axes):
    """Whether a legend begins at the upper left corner of its axes and extends upwards, where it covers no curve."""
    axes.figure.canvas.draw()
    box, frame = legend.get_window_extent(), axes.get_window_extent()
    return abs(box.x0 - frame.x0) < 3 and abs(box.y0 - frame.y1) < 3


def is_beside(legend, axes):
    """Whether a legend stands to the right of its axes."""
    axes.figure.canvas.draw()
    box, frame = legend.get_window_extent(), axes.get_window_extent()
    return frame.x1 < box.x0 < frame.x1 + 0.05 * frame.width and abs(box.y1 - frame.y1) < 3


@pytest.fixture
def layered():
    """A made-up derivation of planar layers under 3 rows of 5 texels, with pressures that are known functions."""
    array = TexelArray.grid(3, 5, 2e-3)
    uniform, point = np.arange(15.0).reshape(3, 5) / 100, np.arange(15.0).reshape(3, 5) / 50
    operator = np.outer(np.arange(15.0), np.ones(15)) + np.arange(15.0) / 7
    sensor = SimpleNamespace(array=array, name="pad", cover=None, layered_cover="layers")
    spread = SimpleNamespace(reach=11e-3, pressure=lambda radius: 1e6 * (1 - 10 * radius))
    gaussian = SimpleNamespace(operator=lambda given: operator if given is array else None)
    return SimpleNamespace(
        sensor=sensor, point_spread=spread, sigma=1.5e-3, texel_response_uniform=uniform, texel_response=point,
        fit=SimpleNamespace(gaussian=gaussian), operator=operator,
    )  # fmt: skip


def layer(thickness, name):
    return SimpleNamespace(thickness=thickness, material=SimpleNamespace(name=name))


def cover(*layers, assumed=False, thickness=2e-3):
    return SimpleNamespace(layers=layers, assumed=assumed, thickness=thickness)


@pytest.fixture
def plots(layered, monkeypatch):
    monkeypatch.setattr(
        "fem_reference.closed_form.point_response", lambda given, r: 2e6 * r if given == "layers" else None
    )

    def draw(thickness=2e-3, spread=True):
        layered.sensor.cover = cover(thickness=thickness)
        if not spread:
            layered.point_spread = None
        found = {}
        for name, (caption, plot) in plot_responses.dispatch(LayeredDerivation)(layered).items():
            axes = Figure().subplots()
            plot(axes)
            found[name] = axes
            assert caption
        return found

    return draw


def test_the_forces_on_the_middle_column_are_drawn_along_y(plots, layered):
    axes = plots()["texel-plot"]
    expected = (
        ("reference, uniform texel load", 100 * layered.texel_response_uniform[:, 2], "fem", "o", "-"),
        ("reference, point load", 100 * layered.texel_response[:, 2], "exact", "D", "-"),
        ("fitted kernel", 100 * layered.operator[2::5, 7], "fit", "s", "--"),
    )
    for line, (label, values, colour, marker, style) in zip(axes.lines, expected, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), [-1, 0, 1])
        np.testing.assert_allclose(line.get_ydata(), values)
        assert (line.get_label(), line.get_color()) == (label, COLOURS[colour])
        assert (line.get_marker(), line.get_linestyle()) == (marker, style)
    assert axes.get_xlabel() == "texels from the loaded one, along y"
    assert axes.get_ylabel() == "force on the texel [% of the load]"
    axes.set_xlim(-1.2, 1.2)
    assert all(float(tick).is_integer() for tick in axes.get_xticks())
    assert [each.get_text() for each in axes.get_legend().get_texts()] == [label for label, *_ in expected]
    assert is_above(axes.get_legend(), axes)


@pytest.mark.parametrize(("thickness", "reach"), [(2e-3, 11.0), (1.5e-3, 9.0)])
def test_the_pressure_is_drawn_up_to_its_reach_or_six_times_the_thickness(plots, thickness, reach):
    axes = plots(thickness)["psf-plot"]
    radius = np.linspace(0, reach, 300)
    expected = (
        ("finite elements", 1 - 10 * radius / 1e3, "fem", "-"),
        ("exact layer solution", 2 * radius / 1e3, "exact", ":"),
        ("Gaussian fitted to texel forces", np.exp(-((radius / 1.5) ** 2) / 2) / (2 * np.pi * 2.25), "fit", "--"),
    )
    for line, (label, values, colour, style) in zip(axes.lines, expected, strict=True):
        np.testing.assert_allclose(line.get_xdata(), radius, atol=1e-12)
        np.testing.assert_allclose(line.get_ydata(), values, atol=1e-12)
        assert (line.get_label(), line.get_color(), line.get_linestyle()) == (label, COLOURS[colour], style)
    assert axes.get_xlabel() == "distance from the load [mm]"
    assert axes.get_ylabel() == "base pressure per force [1/mm\u00b2]"
    assert is_above(axes.get_legend(), axes)


def test_a_cover_without_a_point_spread_has_no_plot_of_its_pressure(plots):
    assert list(plots(spread=False)) == ["texel-plot"]
    assert plot_responses(object()) == {}


@pytest.mark.parametrize(
    "case",
    [
        ((layer(2e-3, "foam"), layer(0.254e-3, "tape")), False, "pad under 2 mm foam + 0.254 mm tape"),
        ((layer(2e-3, "foam"),), True, "pad under 2 mm foam (assumed)"),
        ((layer(1.23456e-3, "assumed foam"),), True, "pad under 1.23 mm assumed foam"),
    ],
)
def test_a_derivation_of_layers_is_drawn_under_its_layers(monkeypatch, tmp_path, layered, case):
    layers, assumed, title = case
    monkeypatch.setattr("fem_reference.closed_form.point_response", lambda _, r: 2e6 * r)
    saved = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, *_, **given: saved.append((figure, given)))
    layered.sensor.cover = cover(*layers, assumed=assumed)
    monkeypatch.setattr(figures, "plot_responses", plot_responses.dispatch(LayeredDerivation))
    draw_derivation.dispatch(LayeredDerivation)(layered, tmp_path, "svg")
    ((figure, given),) = saved
    assert given["format"] == "svg"
    assert (tmp_path / "psf.svg").exists()
    *plots, image, bar = figure.axes
    assert figure.get_suptitle() == title
    assert [axes.get_xlabel()[:6] for axes in plots] == ["texels", "distan"]
    (drawn,) = image.images
    np.testing.assert_allclose(drawn.get_array(), 100 * layered.texel_response_uniform)
    assert drawn.get_clim() == pytest.approx((0, 14))
    assert bar.get_ylabel() == "uniform load on one texel [% of the load]"
    assert figure.get_size_inches().tolist() == [7.2, 3.3]
    assert image.get_subplotspec().get_gridspec().get_width_ratios() == (2, 2, 1)


def test_without_matplotlib_a_derivation_of_layers_has_no_plot(monkeypatch, tmp_path, layered, caplog):
    def fail(*_, **__):
        raise ImportError

    layered.sensor.cover = cover(layer(1e-3, "foam"))
    monkeypatch.setattr(figures, "open_figure", fail)
    with caplog.at_level(logging.WARNING):
        draw_derivation.dispatch(LayeredDerivation)(layered, tmp_path, "png")
    assert "no plot" in caplog.text
    assert list(tmp_path.iterdir()) == []


def test_the_marks_of_a_campaign_have_the_colours_of_their_models_and_readable_labels():
    models = ("fast", "foundation", "boxes", "no-spread", "zeros")
    cases = [
        SimpleNamespace(
            case=SimpleNamespace(name=name),
            predictions={
                model: SimpleNamespace(score=SimpleNamespace(misplaced_force=share * (k + 1)))
                for k, model in enumerate(models)
            },
        )
        for name, share in (("a", 0.001), ("b", 0.02), ("c", 0.15))
    ]
    axes = Figure(figsize=(8, 3)).subplots()
    draw_campaign(SimpleNamespace(models=models, cases=cases), axes)
    assert [line.get_color() for line in axes.lines] == [COLOURS[model] for model in models]
    assert [line.get_linestyle() for line in axes.lines] == ["None"] * 5
    assert len({line.get_marker() for line in axes.lines}) == 5
    assert [each.get_text() for each in axes.get_legend().get_texts()] == list(models)
    assert is_beside(axes.get_legend(), axes)
    labels = axes.get_xticklabels()
    assert [label.get_text() for label in labels] == ["a", "b", "c"]
    assert {(label.get_rotation(), label.get_ha(), label.get_rotation_mode()) for label in labels} == {
        (35.0, "right", "anchor")
    }
    assert [axes.yaxis.get_major_formatter()(each) for each in (0.1, 10.0)] == ["0.1", "10"]
    rulers = axes.yaxis.get_gridlines()
    assert rulers[0].get_visible()
    assert not axes.xaxis.get_gridlines()[0].get_visible()
    assert rulers[0].get_linewidth() < 0.8
    assert rulers[0].get_alpha() < 1


def test_the_true_forces_are_a_broad_line_behind_those_of_the_models():
    numbers = dict.fromkeys(
        ("error", "misplaced", "misplaced_high", "touching", "sliding", "overshoot", "latency", "latency_worst"), 0.1
    )
    delays = {"fast": 0.0, "a": 0.05, "b, 2 Hz": 0.02, "b, 3 Hz": 0.01, "c": 0.04, "d": 0.03, "e": 0.001, "f": -0.01}
    scores = tuple(
        MovingScore(case="x", model=name, chain="", delay=delay, **numbers) for name, delay in delays.items()
    )
    totals = {name: np.full(2, k) for k, name in enumerate(("truth", *delays))}
    result = MovingResult(name="x", indenter="", states=1, interpolation_error=0, fastest=1, resonance=1, warnings=(),
                          scores=scores, times=np.array([0.0, 1.0]), totals=totals)  # fmt: skip
    axes = Figure(figsize=(8, 3)).subplots()
    draw_moving(result, axes)
    found = [(line.get_label(), line.get_color(), line.get_linestyle(), line.get_linewidth()) for line in axes.lines]
    assert found[:2] == [("finite elements", "black", "-", 2), ("fast", COLOURS["fast"], "-", 1)]
    # the four models of the largest delays, each in its slowest setting, by decreasing delay
    assert [label for label, *_ in found[2:]] == ["a", "c", "d", "b, 2 Hz"]
    assert {(style, width) for _, _, style, width in found[2:]} == {("--", 1)}
    assert len(axes.get_legend().get_texts()) == 6
    assert is_beside(axes.get_legend(), axes)


def test_left_out_errors_are_marked_and_named():
    axes = Figure(figsize=(4, 2.2)).subplots()
    draw_left_out({"even seat": (3.0, 2.0, 4.0)}, axes)
    (line,) = axes.lines
    assert (line.get_marker(), line.get_linestyle()) == ("o", "-")
    assert axes.get_xlabel() == "weight of an image: power of its load"
    assert axes.get_ylabel() == "left-out images [counts]"
    assert is_above(axes.get_legend(), axes)


def make_mesh():
    nodes = np.stack(np.meshgrid(*[np.linspace(0, 1e-3, 3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)[:, ::-1].copy()
    cells = np.arange(27)[None]
    return SolidMesh(nodes=nodes, cells=cells, base=cells[:, :9], top=cells[:, 18:],
                     left_out=np.empty((0, 9), dtype=int), source="a cube")  # fmt: skip


def test_a_derivation_of_a_solid_has_its_mesh_its_responses_and_its_scene(monkeypatch, tmp_path):
    scenes = []
    monkeypatch.setattr("validation.scene.draw.write_scene", lambda scene, folder: scenes.append((scene, folder)))
    mesh = make_mesh()
    top = SimpleNamespace(nodes=np.random.default_rng(1).random((9, 3)), normals=np.eye(3)[[2] * 9])
    influence = np.random.default_rng(2).random((4, 27))
    array = TexelArray.grid(2, 2, 1e-3)
    grid = SimpleNamespace(top=top, influence=influence, mesh=mesh)
    derivation = SimpleNamespace(
        responses=SimpleNamespace(finest=grid), sensor=SimpleNamespace(array=array, name="cube")
    )
    draw_derivation.dispatch(SolidDerivation)(derivation, tmp_path, "png")
    with np.load(tmp_path / "responses.npz") as stored:
        assert set(stored) == {"points", "normals", "influence"}
        np.testing.assert_array_equal(stored["points"], top.nodes)
        np.testing.assert_array_equal(stored["normals"], top.normals)
        np.testing.assert_array_equal(stored["influence"], influence)
    assert read_mesh(tmp_path / "mesh.npz").digest == mesh.digest
    ((scene, folder),) = scenes
    assert (folder, scene.title, scene.texels) == (tmp_path, "cube", array)
    np.testing.assert_array_equal(scene.position, mesh.nodes)


@pytest.mark.parametrize("options", [{}, {"picture": "svg"}])
def test_a_derivation_is_written_with_its_parameters_and_its_numbers(monkeypatch, tmp_path, options):
    @dataclasses.dataclass
    class Numbers:
        sigma_m: float = 1.5e-3
        name: str = "\u00b5"

    drawn, saved = [], []
    monkeypatch.setattr(figures, "draw_derivation", lambda *given: drawn.append(given))
    monkeypatch.setattr(figures, "json_text", lambda result: json.dumps(dataclasses.asdict(result), ensure_ascii=False))
    derivation = SimpleNamespace(parameters=SimpleNamespace(save=saved.append), result=Numbers())
    write_derivation(derivation, tmp_path, **options)
    assert saved == [tmp_path]
    assert json.loads((tmp_path / "derive.json").read_text(encoding="utf-8")) == {"sigma_m": 1.5e-3, "name": "\u00b5"}
    assert drawn == [(derivation, tmp_path, options.get("picture", "png"))]


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (RenderingError("no driver"), "no pictures in three dimensions: no driver"),
        (ImportError("x"), "no pictures in three dimensions: "),
    ],
)
def test_where_nothing_can_be_drawn_the_report_says_why(monkeypatch, tmp_path, caplog, fault, said):
    def fail(*_):
        raise fault

    monkeypatch.setattr("validation.scene.cover_scene.show_indentation", lambda *_, **__: "a scene")
    monkeypatch.setattr("validation.scene.draw.write_picture", fail)
    case = SimpleNamespace(name="a", shape="sphere:radius=4mm", load=1.0, indenter=None, pose=None)
    cases = [SimpleNamespace(case=case, reference=SimpleNamespace(found=None))]
    evaluation = SimpleNamespace(campaign=SimpleNamespace(cases=cases))
    derivation = SimpleNamespace(sensor=SimpleNamespace(array=None))
    with caplog.at_level(logging.WARNING):
        pictures = draw_cases.dispatch(SolidDerivation)(derivation, evaluation, tmp_path)
    assert pictures.files == {}
    assert pictures.missing.startswith(said)
    assert ("pyvista" in pictures.missing) == isinstance(fault, ImportError)
    assert len(caplog.records) == 1
    nothing = draw_cases(object(), evaluation, tmp_path)
    assert (nothing.files, nothing.missing) == ({}, "")
