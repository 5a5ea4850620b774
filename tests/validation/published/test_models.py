"""Every published model gives what its equations give in a few lines of numpy, and stands under its own name."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from meshes import TexelArray
from tests.support.fixed_values import check_fixed
from tests.validation.published.equations import EQUATIONS
from tests.validation.published.equations.penetration import robwork_code
from tests.validation.published.equations.table import integrate_texels
from validation.campaign.case import Case
from validation.published.model import foundation_stiffness
from validation.published.models import CalibrationPress, ComparisonModels, Row, choose_calibration
from validation.published.rules import PUBLISHED
from validation.published.rules.penetration import robwork_mask
from validation.published.rules.pressure_map import half_space_shares


def find_values(name):
    """Return the values of the parameters with which a model is checked."""
    return EQUATIONS[name].values or find_shipped(PUBLISHED[name])


def find_shipped(model):
    return {name: each.shipped for name, each in model.parameters.items()}


@pytest.mark.parametrize("name", EQUATIONS)
@pytest.mark.parametrize("which", ["scene", "oblong"])
def test_model_agrees_with_its_equation_by_hand(request, which, name):
    model, scene = PUBLISHED[name], request.getfixturevalue(which)
    values = find_values(name)
    texels, outside = model.predict(scene, **values)
    expected = np.asarray(EQUATIONS[name].equation(scene, **values))
    assert expected.max() > 0.02  # the scene tells something
    np.testing.assert_allclose(texels, expected, atol=5e-4 * expected.max())
    if EQUATIONS[name].conserves:
        load = scene.boxes.total_force if model.contact == "engine's contact points" else scene.load
        assert texels.sum() + outside == pytest.approx(load)
        assert outside >= -1e-3 * load


def test_every_model_is_checked_and_no_two_are_alike(scene):
    assert set(EQUATIONS) == set(PUBLISHED)
    found = [(name, model.predict(scene, **find_values(name)).texels) for name, model in PUBLISHED.items()]
    same = {frozenset((a, b)) for i, (a, x) in enumerate(found) for b, y in found[:i] if np.allclose(x, y, atol=1e-4)}
    assert same <= {frozenset(("tegin-2005", "touch-grid"))}  # both bin the contact forces, on texels or on angles


#: Values of the parameters as they are published, None where none is, and their units.
VALUES = {
    "report-0.5-3x3": {"sigma": (0.5, "pitches"), "ksize_x": (3, "texels"), "ksize_y": (3, "texels")},
    "report-0.8-3x3": {"sigma": (0.8, "pitches"), "ksize_x": (3, "texels"), "ksize_y": (3, "texels")},
    "report-1-3x5": {"sigma": (1.0, "pitches"), "ksize_x": (3, "texels"), "ksize_y": (5, "texels")},
    "report-1-5x5": {"sigma": (1.0, "pitches"), "ksize_x": (5, "texels"), "ksize_y": (5, "texels")},
    "report-0.8-5x5": {"sigma": (0.8, "pitches"), "ksize_x": (5, "texels"), "ksize_y": (5, "texels")},
    "tegin-2005": {}, "robworksim-2010": {}, "mujoco-tactile": {"depth_factor": (1.0, "")},
    "schunk": {"counts_per_newton": (350.0, "1/N"), "most_counts": (3500.0, "")},
    "gazebo-ros-tactile": {"distance": (None, "m"), "angle": (None, ""), "least_force": (None, "N")},
    "touch-grid": {"field_of_view": (45.0, "deg")}, "opengrasp-2013": {"stiffness": (None, "Pa/m")},
    "robworksim-later": {"modulus": (7e5, "Pa"), "mask": (1.0, "")}, "penalty": {"stiffness": (5e3, "N/m")},
    "skinsim-2014": {"stiffness": (16.37, "N/m"), "amplitude": (0.159, ""), "sigma": (0.01, "m")},
    "genesis-taxel": {
        "stiffness": (1e3, "N/m^e"), "exponent": (1.0, ""), "crosstalk": (0.0, ""), "sigma": (0.5, "pitches")
    },
    "pezzementi-pressure": {"stiffness": (None, "Pa/m"), "sigma": (None, "m")},
    "pezzementi-depth": {"stiffness": (None, "Pa/m"), "sigma": (None, "m")},
    "shimojo-1994": {"stiffness": (None, "Pa/m"), "depth": (None, "m")}, "exact-layer": {"stiffness": (None, "Pa/m")},
}  # fmt: skip
#: Parameters that are not fitted; of the rows of the report only one is.
KEPT = {"ksize_x", "ksize_y", "counts_per_newton", "most_counts", "angle", "least_force", "exponent"}


@pytest.mark.parametrize("name", PUBLISHED)
def test_parameters_have_their_published_values_and_units(name):
    model = PUBLISHED[name]
    assert {key: (each.shipped, model.units.get(key, "")) for key, each in model.parameters.items()} == VALUES[name]
    fitted = set(model.parameters) - KEPT
    if name.startswith("report-") and name != "report-0.8-5x5":
        fitted = set()
    assert {key for key, each in model.parameters.items() if each.fitted} == fitted


def write(model, values):
    return [f"{name} {value:.3g} {model.units.get(name, '')}".strip() for name, value in values.items()]


def test_the_table_of_scores_names_the_parameters_units_and_fits(bonded):
    """`docs/comparison-models.md`: a row as shipped, and one as fitted in which the fitted parameters are bold.

    The table is measured from time to time; a new model may still be missing in it.
    """
    text = (Path(__file__).parents[3] / "docs" / "comparison-models.md").read_text()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    shown = {(row[0], row[1]): row[-1] for row in rows if row[1] in ("as shipped", "as fitted")}
    expected = {}
    for model in PUBLISHED.values():
        known = model.find_shipped(bonded(0.49)) or {}
        if len(known) == len(model.parameters):
            expected[model.title, "as shipped"] = write(model, known)
        if model.fitted:
            values = {**known, **model.start, **dict.fromkeys(model.fitted, 0.0)}
            expected[model.title, "as fitted"] = [
                re.sub(r"^(\w+) 0", r"**\1** #", part) if name in model.fitted else part
                for name, part in zip(values, write(model, values), strict=True)
            ]
    assert len(shown) > 28
    assert {key: re.sub(r"(\*\*) [\d.e+-]+", r"\1 #", text) for key, text in shown.items()} == {
        key: ", ".join(expected[key]) for key in shown
    }


def test_contact_forces_that_pull_do_not_count(scene):
    model = PUBLISHED["gazebo-ros-tactile"]
    values = {"distance": 1e-3, "angle": 1.0, "least_force": 0.0}
    before = model.predict(scene, **values).texels
    pulling = scene.contacts._replace(forces=np.append(scene.contacts.forces[:2], -0.6))
    after = model.predict(dataclasses.replace(scene, contacts=pulling), **values).texels
    assert before.sum() == pytest.approx(2.1)
    assert after.sum() == pytest.approx(1.5)


@pytest.mark.parametrize("name", ["skinsim-2014", "genesis-taxel", "penalty", "robworksim-later", "mujoco-tactile"])
def test_indenter_between_all_texel_centres_is_not_seen(scene, name):
    unseen = dataclasses.replace(scene, texel_gaps=np.full(scene.array.count, np.inf))
    texels, outside = PUBLISHED[name].predict(unseen, **find_shipped(PUBLISHED[name]))
    assert not texels.any()
    assert outside == scene.load


def test_forces_of_robworksim_end_at_its_largest_pressure(scene):
    heavy = dataclasses.replace(scene, case=dataclasses.replace(scene.case, load=9.0))
    values = find_shipped(PUBLISHED["robworksim-later"])
    texels, _ = PUBLISHED["robworksim-later"].predict(heavy, **values)
    expected = robwork_code(heavy, **values)
    assert np.isclose(expected, expected.max()).sum() > 1  # several texels are at the limit
    np.testing.assert_allclose(texels, expected, rtol=1e-9)


def test_stiffness_of_a_foundation_is_that_under_uniform_pressure(bonded):
    # E (1 - nu) / ((1 + nu) (1 - 2 nu)) at nu = 0.25 is 1.2 E
    assert foundation_stiffness(bonded(0.25, thickness=2e-3, youngs_modulus=1e6)) == pytest.approx(1.2e6 / 2e-3)
    assert foundation_stiffness(bonded(0.5)) is None
    model = PUBLISHED["opengrasp-2013"]
    assert model.find_shipped(bonded(0.5)) is None
    assert model.find_shipped(bonded(0.25)) == {"stiffness": pytest.approx(6e8)}
    assert PUBLISHED["penalty"].find_shipped(bonded(0.5)) == {"stiffness": 5000.0}


@pytest.mark.parametrize("width", [0.4, 0.7, 1.0, 1.6])
def test_the_mask_of_robworksim_is_wider_by_its_factor(width):
    """Weights max(0, 1.224 / (1 + r^2) - 0.348) at 15 x 15 samples, summed over 5 x 5 of them, by loops."""
    blocks = np.zeros((3, 3))
    for i in range(15):
        for j in range(15):
            x, y = (4 * (k / 15 - 0.5) / width for k in (i, j))
            blocks[i // 5, j // 5] += max(0.0, 1.224299065420561 / (1 + x * x + y * y) - 0.3476635514018692)
    np.testing.assert_allclose(robwork_mask(width), blocks / blocks.sum(), rtol=1e-12)


def test_a_mask_without_width_moves_no_force():
    np.testing.assert_array_equal(robwork_mask(1e-3), [[0, 0, 0], [0, 1, 0], [0, 0, 0]])


@pytest.mark.parametrize("depth", [0.3e-3, 2e-3])
def test_shares_of_a_half_space_are_boussinesqs_pressure_over_the_texels(oblong, depth):
    points = np.array([[-1.2e-3, 0.4e-3], [3.1e-3, 5.0e-3]])
    found = half_space_shares(oblong.array, points, depth)
    expected = integrate_texels(
        oblong, points, lambda r: 3 * depth**3 / (2 * np.pi * (r**2 + depth**2) ** 2.5), count=120
    )
    np.testing.assert_allclose(found, expected, atol=2e-3 * expected.max())
    wide = TexelArray.grid(1, 1, 1.0)  # one texel of a metre takes all
    np.testing.assert_allclose(half_space_shares(wide, points, depth), 1.0, rtol=1e-6)


def test_calibration_presses_are_placed_by_the_pitch_and_never_scored():
    array = TexelArray.grid(4, 3, (2e-3, 3e-3))
    found = choose_calibration(array, ())
    assert [(each.shape, each.load) for each in found] == [
        ("sphere:radius=6mm", 3.0), ("cylinder:radius=3.5mm", 2.0), ("sphere:radius=10mm", 1.0),
    ]  # fmt: skip
    places = [each.pose.at for each in found]
    np.testing.assert_allclose(places, [(0.7e-3, 0.45e-3), (-0.6e-3, 1.2e-3), (-1.8e-3, -4.8e-3)])
    moved = dataclasses.replace(array, centres=np.add(array.centres, [30e-3, -50e-3, 0.0]))
    aside = [each.pose.at for each in choose_calibration(moved, ())]
    np.testing.assert_allclose(np.subtract(aside, places), [(30e-3, -50e-3)] * 3)
    scored = Case.read("x", "cylinder:radius=3.5mm", "9 N", at="1mm,1mm")
    assert [each.shape for each in choose_calibration(array, (scored,))] == ["sphere:radius=6mm", "sphere:radius=10mm"]


def test_stiffnesses_of_layers_are_in_series(bonded):
    """1.2 E / h of nu = 0.25 and E (1 - nu) / ((1 + nu) (1 - 2 nu)) = 2.14 E of nu = 0.4."""
    thin, thick = bonded(0.25, thickness=1e-3, youngs_modulus=2e6), bonded(0.4, thickness=3e-3, youngs_modulus=5e5)
    both = dataclasses.replace(thin, layers=(*thin.layers, *thick.layers))
    assert foundation_stiffness(both) == pytest.approx(1 / (1e-3 / 2.4e6 + 3e-3 / (5e5 * 0.6 / (1.4 * 0.2))))


def test_bins_of_angles_divide_the_field_of_view_of_an_oblong_array(oblong):
    """A site 6 mm behind 3 x 4 texels of 2 x 3 mm: bins of 2 arctan(1 / 2) / 3 along x and of 22.5 degrees along y."""
    x = np.array([0.93, 0.94, -0.94, 2.99, 3.01, 0.0, 0.0, 0.0, 0.0]) * 1e-3
    y = np.array([0.1, 0.1, 0.1, 0.1, 0.1, 2.48, 2.49, -5.99, -6.01]) * 1e-3
    forces = 2.0 ** np.arange(9)
    flat = np.tile([0.0, 0.0, 1.0], (9, 1))
    points = np.column_stack([x, y, np.zeros(9)])
    plate = oblong.plate._replace(points=points, normals=flat, forces=forces, texels=np.zeros(9, int), depths=forces)
    found = PUBLISHED["touch-grid"].predict(dataclasses.replace(oblong, plate=plate), field_of_view=45.0)
    image = np.zeros((4, 3))
    image[2] = 4, 1 + 32, 2 + 8
    image[3, 1], image[0, 1] = 64, 128
    np.testing.assert_allclose(found.texels.reshape(4, 3), image)
    assert found.outside == 16 + 256


def test_fits_start_at_the_published_values_but_for_widths_that_are_not_published():
    """A width of 2 mm where none is published; a crosstalk of zero has no logarithm."""
    assert {name: model.start for name, model in PUBLISHED.items() if model.start} == {
        "gazebo-ros-tactile": {"distance": 2e-3, "angle": 1.0, "least_force": 0.0},
        "genesis-taxel": {"crosstalk": 0.3}, "pezzementi-pressure": {"sigma": 2e-3},
        "pezzementi-depth": {"sigma": 2e-3}, "shimojo-1994": {"depth": 2e-3},
    }  # fmt: skip


def test_models_name_the_input_that_they_use():
    kinds = {name: model.contact for name, model in PUBLISHED.items() if not name.startswith("report-")}
    penetration = ("robworksim-later", "opengrasp-2013", "skinsim-2014", "genesis-taxel", "penalty", "mujoco-tactile")
    maps = ("pezzementi-pressure", "pezzementi-depth", "shimojo-1994", "exact-layer")
    points = ("tegin-2005", "robworksim-2010", "schunk", "gazebo-ros-tactile", "touch-grid")
    assert kinds == {
        **dict.fromkeys(points, "engine's contact points"), **dict.fromkeys(penetration, "rigid penetration"),
        **dict.fromkeys(maps, "contact map"),
    }  # fmt: skip
    assert {model.contact for name, model in PUBLISHED.items() if name not in kinds} == {"engine's contact points"}


def test_a_point_between_two_bins_of_angles_belongs_to_the_lower_one(oblong):
    """Of four rows the second ends straight above the site."""
    points, normals = np.array([[0.1e-3, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    plate = oblong.plate._replace(points=points, normals=normals, forces=np.array([0.7]), texels=np.zeros(1, int))
    found = PUBLISHED["touch-grid"].predict(dataclasses.replace(oblong, plate=plate), field_of_view=50.0)
    assert np.flatnonzero(found.texels).tolist() == [4]
    assert (found.texels[4], found.outside) == (0.7, 0)


@pytest.mark.parametrize(("modulus", "mask"), [(2e3, 1.0), (9e4, 0.7), (3e6, 1.6)])
@pytest.mark.parametrize("which", ["scene", "oblong"])
def test_robworksim_searches_in_19_steps_at_most(request, which, modulus, mask):
    """On a soft cover the search ends at 0.95 mm, on a stiff one at its first steps."""
    press = request.getfixturevalue(which)
    texels, outside = PUBLISHED["robworksim-later"].predict(press, modulus=modulus, mask=mask)
    np.testing.assert_allclose(texels, robwork_code(press, modulus, mask), rtol=1e-9, atol=1e-12)
    assert outside == 0


def test_the_springs_of_skinsim_lose_what_the_kernel_spreads_beyond_the_array(oblong):
    values = {"stiffness": 3e3, "amplitude": 0.2, "sigma": 2.5e-3}
    texels, outside = PUBLISHED["skinsim-2014"].predict(oblong, **values)
    springs, _ = PUBLISHED["penalty"].predict(oblong, stiffness=3e3)
    around = np.zeros((6, 5))
    for (row, column), force in np.ndenumerate(springs.reshape(4, 3)):
        for i, j in np.ndindex(3, 3):
            square = ((i - 1) * 3e-3) ** 2 + ((j - 1) * 2e-3) ** 2
            around[row + i, column + j] += 0.2 * np.exp(-square / (2 * 2.5e-3**2)) * force
    np.testing.assert_allclose(texels.reshape(4, 3), around[1:-1, 1:-1])
    assert outside == pytest.approx(around.sum() - around[1:-1, 1:-1].sum())
    assert outside > 0.1


@pytest.mark.parametrize("most", [1e6, 20.0])
def test_the_mean_of_schunk_loses_force_at_the_edges_and_none_where_texels_saturate(oblong, most):
    texels, outside = PUBLISHED["schunk"].predict(oblong, counts_per_newton=350.0, most_counts=most)
    binned, _ = PUBLISHED["tegin-2005"].predict(oblong)
    kept = np.outer([2, 3, 3, 2], [2, 3, 2]).ravel() / 9  # of nine texels around each one, those on the array
    assert outside == pytest.approx(binned @ (1 - kept))
    assert outside > 0.3
    if most > 1e3:
        assert texels.sum() + outside == pytest.approx(binned.sum())
    else:
        assert texels.max() == pytest.approx(most / 350)


def test_forces_shared_by_weights_of_unit_sum_stay_on_the_texels(oblong):
    values = {"distance": 1.5e-3, "angle": 0.5, "least_force": 0.0}
    texels, outside = PUBLISHED["gazebo-ros-tactile"].predict(oblong, **values)
    assert (texels.sum(), outside) == (pytest.approx(oblong.contacts.forces.sum()), 0)


def test_terms_in_time_are_named_by_their_settings():
    """One row of the report has all settings of its filter, and the other rows the first one."""
    report = ["order 5, 20 Hz", "order 5, 8 Hz", "order 2, 5 Hz", "order 2, 2 Hz"]
    assert {name: list(model.terms) for name, model in PUBLISHED.items() if model.terms} == {
        **{f"report-{name}": report[:1] for name in ("0.5-3x3", "0.8-3x3", "1-3x5", "1-5x5")},
        "report-0.8-5x5": report, "tegin-2005": ["y = 0.1 f + 0.9 y every 2.5 ms"],
        "schunk": ["mean of 10 samples of 1 ms"], "gazebo-ros-tactile": ["mean between two reads, 100 Hz"],
        "robworksim-later": ["tau 0.1 s, dt 1 ms"],
        "skinsim-2014": ["spring 16.37 N/m, damper 0.130 N s/m, mass 1 g"],
        "genesis-taxel": ["no hysteresis", "hysteresis 0.5, 0.1 s"],
    }  # fmt: skip


PENALTY = PUBLISHED["penalty"]
PRESS = CalibrationPress(scene=None, reference=None)
ROWS = (Row(model=PENALTY, parameters={}), ComparisonModels(rows=(), response=None), PRESS, PENALTY)


@pytest.mark.parametrize("part", [*ROWS, PENALTY.parameters["stiffness"]], ids=lambda part: type(part).__name__)
def test_rows_and_models_cannot_be_changed_and_are_made_by_name(part):
    check_fixed(part)
    assert (part == dataclasses.replace(part)) == (part not in ROWS)  # those that hold arrays are not compared


def test_a_scene_cannot_be_changed_and_is_equal_to_itself_only(scene):
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene.case = scene.case
    assert scene != dataclasses.replace(scene)
