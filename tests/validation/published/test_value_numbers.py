"""Numbers of the values for simulators, worked out by hand: kernels, gaps, laws, presses, texts and files."""

import dataclasses
import json
import math
import re
from types import SimpleNamespace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import fastmodel
from fem_reference.closed_form.layer import tabulate_texel_response
from meshes import Cylinder, Pose, Sphere, TexelArray
from tests.support.rubber import make_cover, stack_layers
from tests.validation.published.test_simulator_values import SENSOR, Reference, make_scores
from validation.derivation.contact_range import bear
from validation.errors import InputError
from validation.published.models import CalibrationPress
from validation.published.rules import PUBLISHED
from validation.simulator_models import SCORED
from validation.simulator_values import export, models, scoring, targets
from validation.simulator_values.models import (
    SPREADS,
    divide,
    hydroelastic,
    list_fast,
    list_hydroelastic,
    list_penalty,
    list_taxels,
    refine,
    tabulate_kernel,
    weigh_points,
)
from validation.simulator_values.scoring import Presses, check_fit, find_loads, make_presses, score
from validation.simulator_values.targets import TARGETS, score_target

PARAMETERS = fastmodel.load("wts-0614-34")


def with_array(array, **changes):
    return dataclasses.replace(PARAMETERS, array=array, surface=None, tables={}, **changes)


def shift(array, x, y):
    return dataclasses.replace(array, centres=array.centres + np.array([x, y, 0.0]))


def test_a_kernel_is_the_mean_response_over_the_loaded_cell_and_reaches_six_thicknesses(bonded):
    array = TexelArray.grid(3, 5, (2e-3, 3e-3))
    kernel, response = tabulate_kernel(bonded(0.4), array), tabulate_texel_response(bonded(0.4), (2e-3, 3e-3))
    assert kernel.shape == (2 * math.ceil(12 / 3) + 1, 2 * math.ceil(12 / 2) + 1)
    inside = (np.arange(40) + 0.5) / 40 - 0.5
    for row, column in ((0, 0), (1, -2), (-3, 1), (4, 6)):
        shares = [response((column + inside) * 2e-3, np.full(40, (row + y) * 3e-3)) for y in inside]
        assert kernel[4 + row, 6 + column] == pytest.approx(np.mean(shares), rel=3e-3, abs=1e-7)


@pytest.mark.parametrize(
    ("pitch", "size", "points", "along_x", "along_y"),
    [
        ((4e-3, 2e-3), (4e-3, 2e-3), 4, [1, 1, 1, 1], [1, 1, 1, 1]),
        ((4e-3, 2e-3), (3e-3, 2e-3), 4, [0.5, 1, 1, 0.5], [1, 1, 1, 1]),  # half of the outer cells of 1 mm
        ((4e-3, 2e-3), (4e-3, 1e-3), 4, [1, 1, 1, 1], [0, 1, 1, 0]),
        ((4e-3, 2e-3), (1e-3, 1.8e-3), 4, [0, 0.5, 0.5, 0], [0.8, 1, 1, 0.8]),
        ((4e-3, 2e-3), (3e-3, 1.5e-3), 1, [0.75], [0.75]),
        ((6e-3, 6e-3), (5e-3, 1e-3), 3, [0.75, 1, 0.75], [0, 0.5, 0]),
    ],
)  # fmt: skip
def test_a_point_weighs_as_much_as_of_its_cell_lies_on_the_texel(pitch, size, points, along_x, along_y):
    array = TexelArray.grid(3, 5, pitch, texel_size=size)
    weights = weigh_points(array, points)
    np.testing.assert_allclose(weights, np.outer(along_y, along_x), atol=1e-12)
    share = size[0] * size[1] / (pitch[0] * pitch[1])
    assert weights.mean() == pytest.approx(share)  # what a uniform pressure puts on the texels


@pytest.mark.parametrize(
    ("model", "size"),
    [("penalty", (2e-3, 3e-3)), ("genesis-taxel", (1.4e-3, 2.4e-3)), ("penalty", (1.7e-3, 0.6e-3))],
)
def test_behind_the_kernel_a_texel_bears_its_share_and_a_gap_the_rest(oblong, model, size):
    """A load over the third point of a texel, against the response of a texel of its true size, which is exact.

    Within the cell of a point the pressure is taken as uniform: two points in a hundred where a cell is cut.
    """
    array = TexelArray.grid(4, 3, (2e-3, 3e-3), texel_size=size)
    array = shift(array, 1e-3, -2e-3)
    response = tabulate_texel_response(oblong.cover, size)
    fine = divide(array, 4)
    at = fine.centres[5 * fine.columns + 6]
    ball = Sphere(radius=1e-4)  # so small that it touches one point
    case = dataclasses.replace(oblong.case, indenter=ball, pose=Pose.planar(at=tuple(at[:2])))
    scene = dataclasses.replace(oblong, array=array, case=case)
    values = {"stiffness": 1e9} | ({} if model == "penalty" else {"exponent": 1.0, "crosstalk": 0.0, "sigma": 1.0})
    found = refine(PUBLISHED[model], oblong.cover, array, 4).predict(scene, **values)
    inside = (np.arange(12) + 0.5) / 12 - 0.5
    x, y = (each.ravel() for each in np.meshgrid(at[0] + inside * 0.5e-3, at[1] + inside * 0.75e-3))
    shares = [response(x - cx, y - cy).mean() for cx, cy in array.centres[:, :2]]
    error = np.abs(found.texels / scene.load - shares).max()
    assert error < (4e-3 if size == (2e-3, 3e-3) else 0.025)
    assert found.texels.sum() + found.outside == pytest.approx(scene.load)
    if size != (2e-3, 3e-3):
        whole = refine(PUBLISHED[model], oblong.cover, dataclasses.replace(array, texel_size=array.pitch), 4)
        assert np.abs(whole.predict(scene, **values).texels / scene.load - shares).max() > 4 * error


@pytest.mark.parametrize("size", [(2e-3, 3e-3), (1.4e-3, 2.4e-3), (1.9e-3, 0.6e-3)])
def test_without_spread_a_texel_bears_what_lies_on_it_alone(oblong, size):
    array = shift(TexelArray.grid(4, 3, (2e-3, 3e-3), texel_size=size), 0.13e-3, -0.2e-3)
    scene = dataclasses.replace(oblong, array=array)
    _, forces = models.press_hydroelastic(scene, modulus=2e5, exponent=1.0)
    on = [(np.abs(scene.map.points - at) < np.array(size) / 2).all(axis=1) for at in array.centres[:, :2]]
    found = hydroelastic(scene.cover, SPREADS[1]).predict(scene, modulus=2e5, exponent=1.0)
    np.testing.assert_allclose(found.texels, [forces[each].sum() for each in on], atol=1e-12)
    assert found.texels.sum() + found.outside == pytest.approx(scene.load)
    assert (np.count_nonzero(found.texels) > 4, found.outside > 0.05 * scene.load) == (True, True)


def test_points_lie_on_a_grid_of_the_whole_top_about_the_middle_of_the_array():
    array = TexelArray.grid(2, 3, (2e-3, 3e-3), texel_size=(1e-3, 1e-3))
    fine = divide(shift(array, 5e-3, 7e-3), 2)
    assert (fine.rows, fine.columns, fine.pitch) == (4, 6, (1e-3, 1.5e-3))
    assert fine.centres[:, 0].reshape(4, 6)[1] == pytest.approx(5e-3 + 1e-3 * (np.arange(6) - 2.5))
    assert fine.centres[:, 1].reshape(4, 6)[:, 2] == pytest.approx(7e-3 + 1.5e-3 * (np.arange(4) - 1.5))


@pytest.mark.parametrize("form", ["genesis", "isaac"])
def test_files_for_kinematic_sensors_weigh_points_beside_gaps_and_refuse_overlapping_texels(form):
    array = TexelArray.grid(6, 4, 3e-3, texel_size=(2.4e-3, 1.2e-3))
    parameters = with_array(array)
    found = json.loads(TARGETS[form].write(make_scores(form, parameters), SENSOR, parameters))
    weights = np.outer([0, 0.8, 0.8, 0], [0.6, 1, 1, 0.6])
    np.testing.assert_allclose(found["point_weights"], weights if form == "genesis" else weights.T, atol=1e-12)
    assert any("times `point_weights`" in note for note in TARGETS[form].notes)
    wide = with_array(TexelArray.grid(6, 4, 3e-3, texel_size=3.2e-3))
    given = {"loads": (1.0, 2.0), "command": "", "progress": lambda _: None}
    with pytest.raises(InputError, match=r"texels of 3\.2 x 3\.2 mm at a pitch of 3 x 3 mm overlap"):
        score_target(form, SENSOR, wide, **given)


def test_laws_of_two_layers_have_the_moduli_of_layers_in_series():
    cover = stack_layers((1e-3, 1e6, 0.3), (2e-3, 4e6, 0.2))
    rows = {each.name: each for each in list_hydroelastic(cover, None)}
    oedometric = [1e6 * 0.7 / (1.3 * 0.4), 4e6 * 0.8 / (1.2 * 0.6)]
    series = {"Young's": 3 / (1 / 1e6 + 2 / 4e6), "oedometric": 3 / (1 / oedometric[0] + 2 / oedometric[1])}
    for name, modulus in series.items():
        for spread in SPREADS:
            row = rows[f"{name} modulus, {spread}"]
            assert row.values == {"modulus": pytest.approx(modulus), "exponent": 1.0}
            assert spread in row.model.rule
    for name, each in rows.items():
        assert each.model.fitted == (("modulus", "exponent") if "power" in name else ("modulus",))
        assert each.model.start == {"modulus": pytest.approx(series["Young's"]), "exponent": 1.0}
        assert (each.model.units, each.model.contact) == ({"modulus": "Pa"}, "rigid penetration")
    assert [name for name, each in rows.items() if each.values is None and not each.like] == [
        "fitted, exact spread", "fitted without spread, no spread", "power law, exact spread",
    ]  # fmt: skip
    assert rows["fitted, no spread"].like == "fitted, exact spread"


def test_the_depth_of_a_law_is_the_deepest_point_of_its_contact(scene):
    for each in list_hydroelastic(scene.cover, None):
        depth = each.sink(scene, modulus=2e6, exponent=1.0)
        texels, outside = each.model.predict(scene, modulus=2e6, exponent=1.0)
        _, gaps, area = scene.map
        force = 2e6 / scene.cover.thickness * area * np.maximum(depth + gaps.min() - gaps, 0)
        assert force.sum() == pytest.approx(scene.load)
        assert texels.sum() + outside == pytest.approx(scene.load)


def test_springs_of_a_texel_are_fitted_with_a_kernel_a_gaussian_and_as_published(scene):
    parameters = with_array(scene.array)
    genesis, penalty = list_taxels(scene.cover, parameters), list_penalty(scene.cover, parameters)
    names = ["fitted, 4 x 4 points per texel", "fitted, 1 x 1 points per texel"]
    assert [each.name for each in genesis] == [*names, "fitted, Gaussian", "as shipped"]
    assert [each.name for each in penalty] == [*names, "fitted, no spread", "as shipped, no spread"]
    assert [each.model.fitted for each in genesis[:2]] == [("stiffness", "exponent")] * 2
    assert genesis[3].values == {"stiffness": 1000.0, "exponent": 1.0, "crosstalk": 0.0, "sigma": 0.5}
    assert penalty[3].values == {"stiffness": 5000.0}
    assert all(each.values is None and each.sink is None for each in (*genesis[:3], *penalty[:3]))
    # One point per texel, no spread: springs under the gaps of the ball of 8 mm bear the load in proportion.
    gaps = scene.case.indenter.gap(*scene.case.pose.to_indenter(*scene.array.centres[:, :2].T))
    scene = dataclasses.replace(scene, texel_gaps=gaps)
    forces = penalty[2].model.predict(scene, stiffness=900.0)
    kernel = tabulate_kernel(scene.cover, scene.array)
    for row in (genesis[1], penalty[1]):
        values = {"stiffness": 900.0} | ({"exponent": 1.0} if row is genesis[1] else {})
        found = row.model.predict(scene, **values)
        image = forces.texels.reshape(4, 3)
        expected = sum(
            image[i, j] * kernel[kernel.shape[0] // 2 - i : , kernel.shape[1] // 2 - j :][:4, :3]
            for i in range(4) for j in range(3)
        )  # fmt: skip
        np.testing.assert_allclose(found.texels.reshape(4, 3), expected, atol=1e-9)
    at_one = genesis[1].model.predict(scene, stiffness=900.0, exponent=1.0)
    assert at_one.texels.any()


def test_the_law_of_a_recording_is_the_fast_model_at_the_place_of_the_press(monkeypatch, scene):
    asked = {}

    def indent(parameters, indenter, **options):
        asked.update(options, parameters=parameters, indenter=indenter)
        return SimpleNamespace(texel_forces=np.arange(3.0), outside=0.25)

    monkeypatch.setattr(fastmodel, "indent", indent)
    (row,) = list_fast(scene.cover, PARAMETERS)
    case = dataclasses.replace(scene.case, pose=Pose.planar(at=(1e-3, 2e-3), yaw=0.3), load=1.75)
    texels, outside = row.model.predict(dataclasses.replace(scene, case=case))
    assert (texels.tolist(), outside, row.values, row.model.fitted) == ([0, 1, 2], 0.25, {}, ())
    assert (asked["load"], asked["at"], asked["yaw"]) == (1.75, (1e-3, 2e-3), pytest.approx(0.3))
    assert (asked["parameters"], asked["indenter"]) == (PARAMETERS, case.indenter)


def test_a_sensor_that_never_saturates_has_no_range_of_loads(bonded):
    electronics = dataclasses.replace(PARAMETERS.electronics, sensitivity=1e-9)
    response = tabulate_texel_response(bonded(0.45), PARAMETERS.array.texel_size)
    with pytest.raises(InputError, match="--load: the electronics never saturate"):
        find_loads(dataclasses.replace(PARAMETERS, electronics=electronics), response)


def test_a_range_begins_where_the_dead_zone_ends_if_that_is_above_a_tenth_of_it(bonded, monkeypatch):
    # counts = 1000 F - 500: the first count at 0.5005 N, the last at 1.5 N
    electronics = dataclasses.replace(
        PARAMETERS.electronics, sensitivity=1000.0, offset=-500.0, output_max=1000, bits=12, tip_share=1.0
    )
    parameters = dataclasses.replace(PARAMETERS, electronics=electronics)
    response = tabulate_texel_response(bonded(0.45), PARAMETERS.array.texel_size)
    share = float(response(np.zeros(1), np.zeros(1))[0])
    low, high = find_loads(parameters, response)
    assert (share * low, share * high) == (pytest.approx(0.5005, rel=2e-3), pytest.approx(1.5, rel=2e-3))
    found, _ = make_presses_up(monkeypatch, None, array=PARAMETERS.array)
    assert found.loads == find_loads(PARAMETERS, found.response)


def make_presses_up(monkeypatch, loads, *, array=PARAMETERS.array, heard=None):
    """Make the presses of a range without solving them; returns what would be solved."""
    solved = []

    def press(cover, pressed, indenter, *, load, pose, progress):
        assert (cover, pressed) == (SENSOR.layered_cover, array)
        progress("a grid")
        solved.append((indenter, load, pose.at))
        return SimpleNamespace(depth=1e-4)

    monkeypatch.setattr("fem_reference.indentation.press.press", press)
    monkeypatch.setattr(scoring, "make_scene", lambda _cover, _parameters, case, _response: SimpleNamespace(case=case))
    tell = (lambda _: None) if heard is None else heard.append
    return make_presses(SENSOR.layered_cover, with_array(array), loads, tell), solved


def test_every_body_presses_at_the_ends_of_the_range_and_at_their_geometric_mean(monkeypatch):
    heard = []
    found, solved = make_presses_up(monkeypatch, (1.0, 4.0), heard=heard)
    shapes = [Sphere(radius=4e-3), "sphere:radius=6mm", "cylinder:radius=3.5mm", "sphere:radius=10mm"]
    assert [load for _, load, _ in solved] == [press.scene.case.load for press in found.presses] == [1.0, 2.0, 4.0] * 4
    assert solved[0][0] == shapes[0]
    assert [press.scene.case.shape for press in found.presses[3::3]] == shapes[1:]
    assert solved[0][2] == pytest.approx((0.2 * 3.4e-3, -0.35 * 3.4e-3))
    assert (found.loads, found.left_out, len(heard)) == ((1.0, 4.0), (), 24)
    assert heard[2:4] == ["finite elements: sphere:radius=4mm at 2 N", "a grid"]
    response = tabulate_texel_response(SENSOR.layered_cover, PARAMETERS.array.texel_size)
    at = np.array([0.0, 1e-3]), np.array([2e-3, 0.0])
    np.testing.assert_allclose(found.response(*at), response(*at))


def test_a_load_that_a_body_does_not_bear_is_left_out_and_said(monkeypatch):
    least = bear(SENSOR.layered_cover, Sphere(radius=4e-3))
    found, solved = make_presses_up(monkeypatch, (1.0, 1.05 * least))
    assert [load for indenter, load, _ in solved if indenter == Sphere(radius=4e-3)] == [
        1.0, pytest.approx(math.sqrt(1.05 * least))
    ]  # fmt: skip
    assert len(solved) == 11
    (said,) = found.left_out
    assert said.startswith(f"sphere:radius=4mm at {1.05 * least:.3g} N: deeper than")


def test_two_bodies_that_bear_a_load_are_enough(monkeypatch):
    cover = SENSOR.layered_cover
    shapes = [Sphere(radius=each) for each in (4e-3, 6e-3, 10e-3)] + [Cylinder(radius=3.5e-3)]
    high = 0.999 * sorted(bear(cover, shape) for shape in shapes)[-2]
    found, solved = make_presses_up(monkeypatch, (0.99 * high, high))
    assert len({indenter for indenter, load, _ in solved if load == high}) == 2
    assert sum(f"at {high:.3g} N" in each for each in found.left_out) >= 2
    with pytest.raises(InputError, match="under all but the widest body"):
        make_presses_up(monkeypatch, (0.99 * high, 1.002 * high))


def test_bodies_lie_a_tenth_of_a_pitch_inside_of_a_small_array(monkeypatch):
    array = TexelArray.grid(1, 3, (2e-3, 3e-3))
    array = shift(array, 1e-3, 2e-3)
    _, solved = make_presses_up(monkeypatch, (1.0, 1.0), array=array)
    assert len(solved) == 4  # a range of one load
    places = np.array([at for _, _, at in solved])
    shifts = np.array([(0.2, -0.35), (0.35, 0.15), (-0.3, 0.4), (-0.9, -0.4)])  # -1.6 pitches end at -0.5 + 0.1
    assert places == pytest.approx([1e-3, 2e-3] + shifts * [2e-3, 3e-3])


def plant(scene, *loads, modulus=2.9e6, exponent=1.0):
    """Presses of a law with known values."""
    model = hydroelastic(scene.cover, SPREADS[0])
    presses = []
    for number, load in enumerate(loads):
        case = dataclasses.replace(scene.case, load=load, shape=f"sphere:radius={number + 5}mm")
        other = dataclasses.replace(scene, case=case)
        reference = Reference(other, model, {"modulus": modulus, "exponent": exponent})
        presses.append(CalibrationPress(scene=other, reference=reference))
    return presses


@pytest.mark.parametrize(("count", "refused"), [(11, True), (12, False)])
def test_a_contact_must_cover_twelve_cells(scene, count, refused):
    presses = plant(scene, 2.0, 3.0)
    law = list_hydroelastic(scene.cover, None)[0]
    (row,) = score([law], scene.cover, presses)
    gaps = np.sort(scene.map.gaps - scene.map.gaps.min())
    presses[0].reference.depth = (gaps[count - 1] + gaps[count]) / 2
    if refused:
        with pytest.raises(InputError, match="under 2 N the contact of sphere:radius=5mm is smaller than the cells"):
            check_fit(law, row, presses)
    else:
        check_fit(law, row, presses)


@pytest.mark.parametrize(
    ("mean", "change", "refused"),
    [(0.1, 5e-8, True), (0.1, 2e-7, False), (0.0, 5e-10, True), (0.0, 2e-9, False), (0.1, -5e-8, True)],
)
def test_a_value_is_settled_where_twice_it_scores_otherwise(scene, monkeypatch, mean, change, refused):
    presses, asked = plant(scene, 2.0, 3.0), []
    law = dataclasses.replace(list_hydroelastic(scene.cover, None)[0], sink=None)
    row = dataclasses.replace(make_scores("drake", PARAMETERS).rows[0], mean=mean)

    def list_errors(_model, values, _presses):
        asked.append(values)
        return [mean + change - 0.01, mean + change + 0.01]

    monkeypatch.setattr(scoring, "list_errors", list_errors)
    if refused:
        with pytest.raises(InputError, match="presses from 2 N on do not settle the modulus"):
            check_fit(law, row, presses)
    else:
        check_fit(law, row, presses)
    assert asked == [row.parameters | {"modulus": 2 * row.parameters["modulus"]}]


def test_shapes_that_a_fit_has_not_seen_are_left_out_one_after_the_other(scene, monkeypatch):
    """A made-up fit returns a modulus for each press it gets; its error is that of the shape left out."""
    presses, asked = plant(scene, 1.0, 2.0, 4.0), []
    law = list_hydroelastic(scene.cover, None)[0]

    def fit(_model, _cover, given):
        asked.append([press.scene.load for press in given])
        return {"modulus": 1e6 * len(given), "exponent": 1.0}, 0.0

    monkeypatch.setattr(scoring, "fit_model", fit)
    monkeypatch.setattr(scoring, "list_errors", lambda _model, values, given: [
        values["modulus"] / 1e6 + press.scene.load / 100 for press in given])  # fmt: skip
    (row,) = score([law], scene.cover, presses)
    assert asked == [[1.0, 2.0, 4.0], [2.0, 4.0], [1.0, 4.0], [1.0, 2.0]]
    assert row.unseen == pytest.approx(2 + 7 / 300)
    assert (row.mean, row.worst) == (pytest.approx(3 + 7 / 300), pytest.approx(3.04))
    assert row.parameters == {"modulus": 3e6, "exponent": 1.0}
    assert (row.fitted, row.units, row.rule) == (("modulus",), {"modulus": "Pa"}, law.model.rule)
    assert [each.load for each in row.presses] == [1.0, 2.0, 4.0]
    assert [each.misplaced_force for each in row.presses] == pytest.approx([3.01, 3.02, 3.04])
    assert row.presses[1].indenter == "sphere:radius=6mm"
    for each, press in zip(row.presses, presses, strict=True):
        assert each.depth_ratio == pytest.approx(law.sink(press.scene, **row.parameters) / press.reference.depth)


@pytest.fixture(scope="module")
def scored(scene):
    """Scores for Drake from planted presses, and what was told."""
    parameters = with_array(scene.array)
    sensor = dataclasses.replace(SENSOR, cover=scene.cover, friction=0.3, source="pad.toml")
    response = tabulate_texel_response(scene.cover, scene.array.texel_size)
    presses = tuple(plant(scene, 0.8, 3.0, exponent=1.2, modulus=1.7e6))
    presses[0].reference.depth = 0.2e-3
    made, heard = Presses(loads=(0.8, 3.0), presses=presses, left_out=("one: too deep",), response=response), []
    found = score_target(
        "drake", sensor, parameters, loads=None, command="softcover export pad.toml", progress=heard.append,
        presses=made,
    )  # fmt: skip
    return found, made, heard


def test_the_pressure_law_goes_on_a_quarter_beyond_the_deepest_press(scored, scene):
    found, made, _ = scored
    values = {row.name: row for row in found.rows}["power law, exact spread"].parameters
    depth, pressure = found.pressure_law.T
    assert depth == pytest.approx(np.linspace(0, 1.25 * made.presses[1].reference.depth, 17))
    assert pressure == pytest.approx(values["modulus"] * (depth / scene.cover.thickness) ** values["exponent"])
    assert values["exponent"] == pytest.approx(1.2, abs=0.05)
    assert values["modulus"] == pytest.approx(1.7e6, rel=0.05)


def test_the_table_of_the_spread_has_steps_of_a_sixteenth_pitch_to_six_thicknesses_beyond_a_texel(scored, scene):
    found, made, _ = scored
    for name in ("along_x", "along_y"):
        along = found.spread[name]
        assert np.diff(along) == pytest.approx(2e-3 / 16)
        assert along[0] == 0
        assert 13e-3 - 2.001e-3 / 16 < along[-1] < 13e-3
    share = np.array(found.spread["share"])
    assert share.shape == (len(found.spread["along_y"]), len(found.spread["along_x"]))
    for row, column in ((0, 0), (3, 9), (20, 1)):
        at = np.array([found.spread["along_x"][column]]), np.array([found.spread["along_y"][row]])
        assert share[row, column] == pytest.approx(float(made.response(*at)[0]))


def test_scores_state_their_range_and_limits(scored):
    found, _, heard = scored
    assert (found.loads, found.format, found.left_out) == ((0.8, 3.0), "drake", ("one: too deep",))
    assert found.command == "softcover export pad.toml --load 0.8N:3N"
    assert heard == ["fits of 2 presses"]
    assert found.notes[2] == "The friction of pad.toml, 0.3, is not in these scores."
    assert found.notes[-len(TARGETS["drake"].notes) :] == TARGETS["drake"].notes
    assert {"softcover", "numpy"} <= set(found.versions)
    assert found.values == found.rows[0].parameters


@pytest.mark.parametrize(
    ("ratio", "model", "words"),
    [
        (0.5, "linear-elastic", "undefined at a Poisson ratio of 0.5"), (0.45, "linear-elastic", None),
        (0.4501, "neo-hookean", "depends on its last digit"), (0.3, "neo-hookean", None),
    ],
)  # fmt: skip
def test_notes_tell_strain_depth_and_where_the_oedometric_modulus_is_no_guide(scene, ratio, model, words, monkeypatch):
    sensor = dataclasses.replace(SENSOR, cover=make_cover(ratio, model), friction=0.0)
    row = make_scores("drake", PARAMETERS).rows[0]
    monkeypatch.setattr(targets, "score", lambda *_: [row])
    monkeypatch.setattr(targets, "check_fit", lambda *_: None)
    response = tabulate_texel_response(scene.cover, scene.array.texel_size)
    presses = [SimpleNamespace(reference=SimpleNamespace(depth=depth)) for depth in (0.1e-3, 0.46e-3, 0.2e-3)]
    made = Presses(loads=(1.0, 2.0), presses=tuple(presses), left_out=(), response=response)
    found = score_target(
        "drake", sensor, PARAMETERS, loads=None, command="", progress=lambda _: None, presses=made
    )  # fmt: skip
    strain = "small strain (linear)" if model == "linear-elastic" else "finite strain"
    assert found.notes[1] == f"The deepest press reaches 23% of the thickness, computed at {strain}."
    own = found.notes[2 : -len(TARGETS["drake"].notes)]
    assert len(own) == (words is not None)
    assert all(words in note for note in own)
    assert found.pressure_law.shape == (0, 2)


def test_presses_that_were_not_made_before_are_made_for_the_loads(scored, scene, monkeypatch):
    asked = []
    monkeypatch.setattr(targets, "make_presses", lambda *given: asked.append(given) or scored[1])
    sensor, parameters = dataclasses.replace(SENSOR, cover=scene.cover), with_array(scene.array)
    found = score_target("drake", sensor, parameters, loads=(0.5, 2.0), command="", progress=str)
    assert asked == [(scene.cover, parameters, (0.5, 2.0), str)]
    assert found.loads == (0.8, 3.0)


def test_another_array_than_a_regular_flat_one_is_refused_with_its_source():
    centres = PARAMETERS.array.centres.copy()
    centres[0, 0] += 1e-3
    given = {"loads": (1.0, 2.0), "command": "", "progress": lambda _: None}
    with pytest.raises(InputError, match=r"--format newton: .*wts-0614-34 has another array"):
        score_target("newton", SENSOR, with_array(dataclasses.replace(PARAMETERS.array, centres=centres)), **given)


@pytest.fixture(scope="module")
def shifted():
    """Files of an oblong array away from the origin, and its parameters."""
    array = TexelArray.grid(6, 4, (3e-3, 3e-3))
    array = shift(array, 11e-3, -7e-3)
    parameters = with_array(array)
    return parameters, {
        form: TARGETS[form].write(make_scores(form, parameters), SENSOR, parameters) for form in TARGETS
    }


def test_pads_lie_under_the_array_with_their_top_at_zero(shifted):
    _, texts = shifted
    root = ET.fromstring(texts["drake"])  # noqa: S314 -- our own
    assert [float(each) for each in root.find(".//pose").text.split()] == pytest.approx([11e-3, -7e-3, -1e-3, 0, 0, 0])
    assert float(root.find(".//{https://drake.mit.edu}mesh_resolution_hint").text) == pytest.approx(3e-3 / 4)
    assert "half space, slab_thickness 0.002 m: hydroelastic_modulus 3.2e+06 Pa" in texts["drake"]
    newton = {
        name: [float(each) for each in numbers.split(",")]
        for name, numbers in re.findall(r"double3 xformOp:(\w+) = \((.*)\)", texts["newton"])
    }
    assert newton == {"translate": pytest.approx([11e-3, -7e-3, -1e-3]), "scale": pytest.approx([12e-3, 18e-3, 2e-3])}
    band = [float(each) for each in re.findall(r"NarrowBand(?:Inner|Outer) = (\S+)", texts["newton"])]
    assert band == pytest.approx([-2e-3, 2e-3])
    assert f"kh = {3.2e6 / 2e-3:.6g} N/m^3" in texts["newton"]


def test_a_middle_that_is_zero_but_for_rounding_is_written_as_zero():
    parameters = with_array(shift(TexelArray.grid(6, 4, 3e-3), -3e-10, -1e-13))
    texts = {
        form: TARGETS[form].write(make_scores(form, parameters), SENSOR, parameters) for form in ("drake", "newton")
    }
    assert "<pose>0 0 -0.001 0 0 0</pose>" in texts["drake"]
    assert "translate = (0, 0, -0.001)" in texts["newton"]


def test_kinematic_sensors_have_no_damping_shear_or_twist_and_points_under_the_array(shifted):
    parameters, texts = shifted
    found = json.loads(texts["genesis"])
    options = found["options"]
    assert [options[name] for name in ("normal_damping", "shear_scalar", "twist_scalar")] == [0, 0, 0]
    assert options["probe_radius"] == 1e-9
    assert np.array(options["probe_local_pos"]).mean(axis=(0, 1)) == pytest.approx([11e-3, -7e-3, 0])
    assert found["point_weights"] == [[1.0] * 4] * 4
    isaac = json.loads(texts["isaac"])
    assert isaac["options"]["tactile_array_size"] == [16, 24]
    assert isaac["options"]["tactile_margin"] == pytest.approx(-3e-3 / 4 / 2)
    assert isaac["elastomer_size_m"] == pytest.approx([12e-3, 18e-3])
    assert np.shape(found["options"]["crosstalk_kernel"]) == np.shape(isaac["kernel_behind"])[::-1]
    assert parameters.array.regular


@pytest.mark.parametrize(("stretch", "refused"), [(1 + 2e-6, True), (1 + 5e-7, False)])
def test_isaac_takes_two_pitches_that_differ_by_rounding(stretch, refused):
    parameters = with_array(TexelArray.grid(6, 4, (3e-3, stretch * 3e-3)))
    if refused:
        with pytest.raises(InputError, match="its points have one spacing along both sides"):
            TARGETS["isaac"].write(make_scores("isaac", parameters), SENSOR, parameters)
    else:
        assert TARGETS["isaac"].write(make_scores("isaac", parameters), SENSOR, parameters)


def test_recordings_hold_centres_rate_and_the_forces_of_a_ball_in_the_middle(shifted):
    parameters, texts = shifted
    found = json.loads(texts["lerobot"])
    assert found["fps"] == SENSOR.electronics.rate_hz
    assert np.array(found["points"]["centres_m"]) == pytest.approx(parameters.array.centres)
    assert found["points"]["normals"] == [[0, 0, 1]] * 24
    assert found["points"]["active"] == [True] * 24
    assert found["example"]["of"] == "sphere:radius=7mm at 1.5 N"
    forces = np.array(found["example"]["observation.tactile"])[:, 0]
    image = forces.reshape(6, 4)
    assert image == pytest.approx(image[::-1, ::-1], rel=0.02, abs=1e-4)  # it lies over the middle
    listed = re.search(r"texel_forces: \[(.*)\]", texts["ros2"])[1]
    assert [float(each) for each in listed.split(", ")] == pytest.approx(forces, rel=1e-4, abs=1e-12)
    counts = re.search(r"counts: \[(.*)\]", texts["ros2"])[1]
    assert [int(each) for each in counts.split(", ")] == parameters.electronics.counts(forces).tolist()
    assert "6 rows of 4 texels, row by row" in texts["ros2"]


def test_a_file_describes_its_layers_values_and_depths_in_words(shifted):
    scores = make_scores("drake", shifted[0])
    press = dataclasses.replace(scores.rows[0].presses[0], depth_ratio=1.234)
    row = dataclasses.replace(
        scores.rows[0], presses=(press,), units={"modulus": "Pa"}, parameters={"modulus": 3.21e6, "exponent": 1.25}
    )
    other = dataclasses.replace(row, name="textbook", parameters={}, unseen=math.nan)
    cover = {"layers": [{"thickness_m": 2e-3, "material": "rubber", "youngs_modulus": 1.5e6, "poisson_ratio": 0.45}],
             "assumed": False}  # fmt: skip
    lines = dataclasses.replace(scores, rows=(row, other), cover=cover).describe()
    assert "  fitted: modulus 3.21e+06 Pa, exponent 1.25, misplaced 1.23 % in the mean, 4.56 % at worst, " in lines[4]
    assert lines[4].endswith("1.78 % on shapes the fit has not seen")
    assert lines[5] == "  textbook: misplaced 1.23 % in the mean, 4.56 % at worst"
    assert "  sphere:radius=7mm at 2.5 N: 3.21 %, depth 1.23 of the finite elements'" in lines
    assert lines[1] == "cover: 2 mm rubber, E 1.5e+06 Pa, nu 0.45; as stated"


@pytest.mark.parametrize("form", SCORED)
def test_an_export_writes_file_scores_and_parameters_and_says_what_it_wrote(form, tmp_path, monkeypatch):
    sensor = dataclasses.replace(
        SENSOR, source="my pads/pad.toml", array=dataclasses.replace(SENSOR.array, name="my pad")
    )
    asked = {}

    def score_target(form, given, parameters, **options):
        asked.update(options, form=form, sensor=given, parameters=parameters)
        return dataclasses.replace(make_scores(form, parameters), command=options["command"])

    monkeypatch.setattr(export, "find_parameters", lambda *_: PARAMETERS)
    monkeypatch.setattr(export, "score_target", score_target)
    out, heard = tmp_path / "out", []
    found = export.export_values(
        sensor, out, form=form, loads=(1.5, 4.5), changes=["--thickness", "2mm"], progress=heard.append
    )
    assert asked["command"] == f"softcover export 'my pads/pad.toml' --format {form} --thickness 2mm"
    assert (asked["form"], asked["sensor"], asked["parameters"]) == (form, sensor, PARAMETERS)
    assert asked["loads"] == (1.5, 4.5)
    asked["progress"]("a stage")
    assert heard == ["a stage"]
    assert (found.sensor, found.format, found.method, found.out) == ("my pad", form, None, str(out))
    assert found.files == (f"my-pad{TARGETS[form].suffix}", "scored.json", "parameters.toml", "cover.npz")
    assert all((out / name).is_file() for name in found.files)
    assert f"--format {form} --thickness 2mm" in (out / found.files[0]).read_text()
    written = json.loads((out / "scored.json").read_text())
    assert written["rows"][0]["presses"][0]["load"] == 2.5
    assert found.scores["loads"] == [1.5, 4.5] == written["loads"]
    (row,) = found.scores["rows"]
    assert row.keys() == {"name", "parameters", "units", "fitted", "mean", "worst", "unseen"}
    assert (row["mean"], row["worst"]) == (0.0123, 0.0456)
    again = export.export_values(sensor, out, form=form, loads=None, changes=(), progress=None)
    assert (again.files, asked["loads"]) == (found.files, None)
    asked["progress"]("unheard")
