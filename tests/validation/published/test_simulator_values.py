"""Values for other simulators: their laws against closed forms, their fit against planted values and a scan, files."""

import dataclasses
import json
import math
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import fastmodel
from fastmodel import Electronics
from fem_reference.closed_form.layer import tabulate_texel_response
from fem_reference.indentation.press import press
from meshes import TexelArray
from validation.errors import InputError
from validation.metrics import misplaced_force
from validation.published.models import CalibrationPress
from validation.published.rules import PUBLISHED
from validation.sensor_file import BUILT_IN
from validation.simulator_models import SCORED
from validation.simulator_values.models import (
    SPREADS,
    Candidate,
    divide,
    hydroelastic,
    list_hydroelastic,
    list_taxels,
    press_hydroelastic,
    refine,
    tabulate_kernel,
)
from validation.simulator_values.scoring import (
    ScoredPress,
    ScoredValues,
    check_fit,
    find_loads,
    make_presses,
    score,
)
from validation.simulator_values.targets import TARGETS, Scores, score_target

SENSOR = BUILT_IN["wts-0614-34"]


@pytest.mark.parametrize("exponent", [1.0, 1.7])
def test_depth_under_a_paraboloid_is_that_of_the_integrated_pressure_law(scene, exponent):
    # gap r^2 / 2R, p = E (d / h)^e: F = 2 pi R E h^-e delta^(e + 1) / (e + 1)
    height, modulus, radius = scene.cover.thickness, 2.3e6, 8e-3
    depth, force = press_hydroelastic(scene, modulus=modulus, exponent=exponent)
    expected = (scene.load * (exponent + 1) * height**exponent / (2 * np.pi * radius * modulus)) ** (1 / (exponent + 1))
    assert depth.max() == pytest.approx(expected, rel=0.01)
    assert force.sum() == pytest.approx(scene.load)
    np.testing.assert_allclose(force / scene.map.area, modulus * (depth / height) ** exponent)


def test_hydroelastic_contact_without_spread_is_an_elastic_foundation(scene):
    ours = hydroelastic(scene.cover, SPREADS[1]).predict(scene, modulus=3e6, exponent=1.0)
    theirs = PUBLISHED["opengrasp-2013"].predict(scene, stiffness=3e6 / scene.cover.thickness)
    np.testing.assert_allclose(ours.texels, theirs.texels)
    assert ours.outside == pytest.approx(theirs.outside)


def test_spread_moves_force_off_the_loaded_texels_and_keeps_the_load(scene):
    exact, none = (hydroelastic(scene.cover, each).predict(scene, modulus=3e6, exponent=1.0) for each in SPREADS)
    assert exact.texels.max() < 0.95 * none.texels.max()
    for each in (exact, none):
        assert each.texels.sum() + each.outside == pytest.approx(scene.load)


def test_kernel_of_a_texel_is_the_sum_of_the_kernels_of_its_parts(bonded):
    cover, array, n = bonded(0.3), TexelArray.grid(3, 5, (2e-3, 3e-3)), 3
    coarse, fine = tabulate_kernel(cover, array), tabulate_kernel(cover, divide(array, n))
    assert coarse.sum() == pytest.approx(1, abs=0.01)
    np.testing.assert_allclose(coarse, coarse[::-1, ::-1], atol=1e-12)
    middle = np.array(fine.shape) // 2
    for row, column in ((0, 0), (0, 1), (1, 0), (-1, 1)):
        shares = [
            fine[middle[0] + n * row + i - k, middle[1] + n * column + j - m]
            for i in range(n) for j in range(n) for k in range(n) for m in range(n)
        ]  # fmt: skip
        at = np.array(coarse.shape) // 2 + (row, column)
        assert sum(shares) / n**2 == pytest.approx(coarse[tuple(at)], abs=5e-4)


def test_many_points_with_the_kernel_come_to_hydroelastic_contact_with_the_exact_spread(scene):
    array, modulus, points = scene.array, 2e6, 8
    area = array.pitch[0] * array.pitch[1] / points**2
    fine = refine(PUBLISHED["penalty"], scene.cover, array, points)
    gap = scene.case.indenter.gap
    flat = dataclasses.replace(scene, case=dataclasses.replace(scene.case, pose=_place((0.5e-3, 0.7e-3))))
    found = fine.predict(flat, stiffness=modulus / scene.cover.thickness * area)
    wide = hydroelastic(scene.cover, SPREADS[0]).predict(scene, modulus=modulus, exponent=1.0)
    assert gap(0.0, 0.0) == 0
    np.testing.assert_allclose(found.texels, wide.texels, atol=0.02 * wide.texels.max())


def _place(at):
    from meshes import Pose

    return Pose.planar(at=at)


class Reference:
    """A planted reference: forces of a law with known values."""

    def __init__(self, scene, model, values):
        self.texel_forces, self.outside = model.predict(scene, **values)
        self.depth = float(press_hydroelastic(scene, **values)[0].max())


def test_fit_finds_planted_values_and_textbook_values_score_worse(scene):
    model = hydroelastic(scene.cover, SPREADS[0])
    presses = []
    for load, shape in ((0.5, "a"), (2.0, "a"), (1.0, "b"), (4.0, "b")):
        case = dataclasses.replace(scene.case, load=load, shape=shape)
        other = dataclasses.replace(scene, case=case)
        presses.append(
            CalibrationPress(scene=other, reference=Reference(other, model, {"modulus": 2.9e6, "exponent": 1.0}))
        )
    rows = {row.name: row for row in score(list_hydroelastic(scene.cover, None), scene.cover, presses)}
    fitted, law = rows["fitted, exact spread"], rows["power law, exact spread"]
    assert fitted.parameters["modulus"] == pytest.approx(2.9e6, rel=0.01)
    assert law.parameters["exponent"] == pytest.approx(1, abs=0.05)
    assert max(fitted.worst, fitted.unseen) < 1e-3
    assert [each.depth_ratio for each in fitted.presses] == pytest.approx([1] * 4, abs=0.01)
    assert rows["fitted, no spread"].parameters == fitted.parameters
    assert min(rows[f"{each} modulus, exact spread"].mean for each in ("Young's", "oedometric")) > 5 * fitted.mean
    assert math.isnan(rows["Young's modulus, exact spread"].unseen)


def test_no_oedometric_row_for_an_incompressible_cover(bonded):
    names = [each.name for each in list_hydroelastic(bonded(0.5), None)]
    assert not any("oedometric" in name for name in names)
    assert any("Young" in name for name in names)


def test_exponents_that_genesis_refuses_are_never_chosen(scene):
    laws = list_taxels(scene.cover, dataclasses.replace(fastmodel.load("wts-0614-34"), array=scene.array, surface=None))
    texels, outside = laws[1].model.predict(scene, stiffness=900.0, exponent=0.99)
    assert not texels.any()
    assert outside == pytest.approx(scene.load)


def test_range_of_loads_follows_from_dead_zone_and_saturation(bonded):
    # counts = 1000 F - 100: the first count at 0.1005 N, the last at 1.1 N
    electronics = Electronics(rate_hz=100.0, sensitivity=1000.0, offset=-100.0, output_max=1000, bits=12)
    parameters = dataclasses.replace(fastmodel.load("wts-0614-34"), electronics=electronics)
    response = tabulate_texel_response(bonded(0.45), parameters.array.texel_size)
    share = float(response(np.zeros(1), np.zeros(1))[0])
    low, high = find_loads(parameters, response)
    assert high == pytest.approx(1.1 / share, rel=0.01)
    assert low == pytest.approx(max(0.1005 / share, 0.1 * high), rel=0.01)


def make_scores(form, parameters):
    """Make scores with planted numbers, none of which is a default."""
    values = {"drake": {"modulus": 3.2e6, "exponent": 1.0}, "genesis": {"stiffness": 811.0, "exponent": 1.25}}
    row = ScoredValues(
        name="fitted", rule="law", parameters=values.get(form, values["drake"]) | {"stiffness": 811.0}, units={},
        fitted=("modulus",), mean=0.0123, worst=0.0456, unseen=0.0178,
        presses=(ScoredPress(indenter="sphere:radius=7mm", load=2.5, misplaced_force=0.0321, depth_ratio=math.nan),),
    )  # fmt: skip
    return Scores(
        sensor=parameters.array.name, format=form, loads=(1.5, 4.5), rows=(row,),
        pressure_law=np.array([[0.0, 0.0], [1e-4, 2e5]]), spread={}, cover=SENSOR.describe_cover(),
        left_out=("sphere:radius=1mm at 4.5 N: too deep",), notes=("Outside nothing was scored.",),
        form=TARGETS[form].form, command="softcover export x --format y --load 1.5N:4.5N",
        versions={"softcover": "9.8.7"},
    )  # fmt: skip


@pytest.fixture(scope="module")
def texts():
    parameters = fastmodel.load("wts-0614-34")
    return {form: TARGETS[form].write(make_scores(form, parameters), SENSOR, parameters) for form in TARGETS}


def test_every_file_states_range_error_shapes_limits_and_command(texts):
    assert tuple(TARGETS) == SCORED
    for text in texts.values():
        for wanted in ("1.5 N to 4.5 N", "1.23 %", "4.56 %", "1.78 %", "sphere:radius=7mm at 2.5 N: 3.21 %", "too deep",
                       "Outside nothing", "softcover export x --format y --load 1.5N:4.5N", "9.8.7",
                       "assumed, not measured"):  # fmt: skip
            assert wanted in text


@pytest.mark.parametrize("pitch", [3.4e-3, 0.3e-3])  # 6 columns: with 0.3 mm the box is less wide than it is high
def test_drakes_pressure_is_one_modulus_at_half_the_smallest_edge_of_a_box(pitch):
    # geometry/proximity/make_box_field.h: the extent is the depth over half the smallest edge.
    array = TexelArray.grid(14, 6, pitch)
    parameters = dataclasses.replace(fastmodel.load("wts-0614-34"), array=array, surface=None, tables={})
    text = TARGETS["drake"].write(make_scores("drake", parameters), SENSOR, parameters)
    root = ET.fromstring(text)  # noqa: S314 -- our own
    modulus = root.find(".//{https://drake.mit.edu}hydroelastic_modulus")
    size = [float(each) for each in root.find(".//size").text.split()]
    assert float(modulus.text) / (min(size) / 2) == pytest.approx(3.2e6 / 2e-3)  # p over d
    assert size == pytest.approx([6 * pitch, 14 * pitch, 2e-3])
    assert f"hydroelastic_modulus {float(modulus.text):.6g} Pa" in text
    top = float(root.find(".//pose").text.split()[2]) + size[2] / 2
    assert top == pytest.approx(0)


def test_newtons_stiffness_is_pressure_over_depth_and_the_law_is_a_table(texts):
    assert float(re.search(r"hydroelasticStiffness = (\S+)", texts["newton"])[1]) == pytest.approx(3.2e6 / 2e-3)
    assert "softcover:pressureLaw = [(0, 0), (0.0001, 200000)]" in texts["newton"]


def test_kinematic_sensors_get_points_stiffness_and_kernel(texts):
    genesis, isaac = (json.loads(texts[form]) for form in ("genesis", "isaac"))
    options = genesis["options"]
    assert (options["normal_stiffness"], options["normal_exponent"]) == (811.0, 1.25)
    points = np.array(options["probe_local_pos"])
    assert points.shape == (56, 24, 3)
    np.testing.assert_allclose(points.reshape(14, 4, 6, 4, 3).mean(axis=(1, 3)).reshape(84, 3), SENSOR.array.centres)
    kernel = np.array(options["crosstalk_kernel"])
    assert all(size % 2 for size in kernel.shape)
    assert 0.97 < kernel.sum() < 1.001
    assert kernel.max() == kernel[tuple(np.array(kernel.shape) // 2)]
    assert isaac["options"]["normal_contact_stiffness"] == 811.0
    np.testing.assert_array_equal(np.transpose(isaac["kernel_behind"]), kernel)
    # visuotactile_sensor.py: one spacing, the smaller one, and points listed along the mesh's first axis first.
    count = np.array(isaac["options"]["tactile_array_size"])
    room = np.array(isaac["elastomer_size_m"]) - 2 * isaac["options"]["tactile_margin"]
    along = [np.linspace(-0.5, 0.5, n + 2)[1:-1] * (n + 1) * min(room / (count + 1)) for n in count]
    placed = np.array([(x, y) for x in along[0] for y in along[1]]).reshape(*count, 2)
    np.testing.assert_allclose(placed.transpose(1, 0, 2), points[:, :, :2], atol=1e-9)
    assert isaac["elastomer_size_m"] == pytest.approx([6 * 3.4e-3, 14 * 3.4e-3])


#: Attributes of NewtonSDFCollisionAPI by type, from generatedSchema.usda of newton-usd-schemas 0.6.0.
NEWTON = {
    "hydroelasticEnabled": "bool",
    "hydroelasticStiffness": "float",
    **{f"sdf{name}": "uniform float" for name in ("TargetVoxelSize", "NarrowBandInner", "NarrowBandOuter", "Padding")},
    "sdfMaxResolution": "uniform int",
    "sdfTextureFormat": "uniform token",
}
#: Fields that forces depend on, from KinematicTaxel of genesis-world 1.4.5, whose probe_radius of 10 mm adds to the
#: depth and whose last three are 1 unless given, and from VisuoTactileSensorCfg of isaaclab 2.3.2.post1.
GENESIS = {
    *("probe_local_pos", "probe_radius", "normal_stiffness", "normal_exponent", "crosstalk_kernel"),
    *("normal_damping", "shear_scalar", "twist_scalar"),
}
ISAAC = {"tactile_array_size", "tactile_margin", "normal_contact_stiffness"}


def test_fields_are_those_of_the_released_simulators(texts):
    written = re.findall(r"^ +((?:uniform )?\w+) newton:(\w+) = ", texts["newton"], re.MULTILINE)
    assert len(written) == 4
    assert all(NEWTON[name] == kind for kind, name in written)
    genesis, isaac = (json.loads(texts[form])["options"] for form in ("genesis", "isaac"))
    assert set(genesis) == GENESIS
    assert 0 < genesis["probe_radius"] < 1e-7  # its depth is that of the probe and this radius
    assert set(isaac) == ISAAC


def test_isaacs_equally_spaced_points_fit_no_array_of_two_pitches():
    array = TexelArray.grid(6, 4, (4e-3, 3e-3))
    parameters = dataclasses.replace(fastmodel.load("wts-0614-34"), array=array, surface=None, tables={})
    with pytest.raises(InputError, match=r"--format isaac: its points have one spacing .*; take genesis"):
        TARGETS["isaac"].write(make_scores("isaac", parameters), SENSOR, parameters)


@pytest.mark.parametrize("load", [2e-6, 2e-3])
def test_loads_that_settle_no_modulus_are_refused(scene, load):
    """At 2 uN every modulus gives one cell, at 2 mN a few cells, whose modulus would be wrong by a factor."""
    model = hydroelastic(scene.cover, SPREADS[0])
    presses = []
    for share, shape in ((1.0, "a"), (1.5, "b")):
        case = dataclasses.replace(scene.case, load=share * load, shape=shape)
        other = dataclasses.replace(scene, case=case)
        planted = Reference(other, model, {"modulus": 2.9e6, "exponent": 1.0})
        presses.append(CalibrationPress(scene=other, reference=planted))
    law = list_hydroelastic(scene.cover, None)[0]
    (row,) = score([law], scene.cover, presses)
    with pytest.raises(InputError, match=r"--load: .*; take larger loads"):
        check_fit(law, row, presses)
    if load < 1e-4:
        with pytest.raises(InputError, match="do not settle the modulus: twice its value"):
            check_fit(dataclasses.replace(law, sink=None), row, presses)


@pytest.mark.slow
def test_presses_lie_on_an_array_of_one_row_wherever_its_origin_is():
    middle, array = np.array([30e-3, -50e-3, 0.0]), TexelArray.grid(1, 4, 4e-3)
    array = dataclasses.replace(array, centres=array.centres + middle)
    parameters = dataclasses.replace(fastmodel.load("wts-0614-34"), array=array, surface=None, tables={})
    made = make_presses(SENSOR.layered_cover, parameters, (1.0, 1.1), lambda _: None)
    places = np.array([press.scene.case.pose.at for press in made.presses]) - middle[:2]
    assert (np.abs(places) < [8e-3, 2e-3]).all()
    assert len(np.unique(places, axis=0)) == 4


def test_shear_that_no_texel_measures_is_absent_and_never_zero(texts):
    found = json.loads(texts["lerobot"])
    (feature,) = found["features"].values()
    assert feature["names"] == ["Fz"]
    assert feature["shape"] == [84, 1]
    forces = np.array(found["example"]["observation.tactile"])
    assert forces.shape == (84, 1)
    assert forces.sum() == pytest.approx(1.5, rel=0.05)
    assert set(found["absent"]) == {"dx, dy, dz", "Fx, Fy"}
    assert "float64[] texel_forces" in texts["ros2"]
    assert "tangential" not in texts["ros2"]


def test_an_array_or_cover_on_which_nothing_is_scored_is_refused():
    cover = dataclasses.replace(SENSOR.cover, size=(0.03, 0.05))
    narrow = dataclasses.replace(SENSOR, cover=cover, source="pad.toml")
    given = {"loads": (1.0, 2.0), "command": "", "progress": lambda _: None}
    with pytest.raises(InputError, match=r"--format drake: .*pad.toml has side edges"):
        score_target("drake", narrow, fastmodel.load("wts-0614-34"), **given)


def test_loads_that_the_cover_does_not_bear_are_refused_with_the_largest_accepted_one():
    parameters = fastmodel.load("wts-0614-34")
    with pytest.raises(InputError, match=r"--load: 200 N .*accepted: up to 16") as caught:
        make_presses(SENSOR.layered_cover, parameters, (1.0, 200.0), lambda _: None)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_written_modulus_is_within_a_fifth_of_a_point_of_the_best_of_a_scan_of_its_own():
    """The scan is written anew: elastic foundation by bisection, exact response, finite elements."""
    parameters, cover = fastmodel.load("wts-0614-34"), SENSOR.layered_cover
    scores = score_target("drake", SENSOR, parameters, loads=(0.7, 3.1), command="a {b}", progress=lambda _: None)
    assert scores.command == "a {b} --load 0.7N:3.1N"
    array, height = parameters.array, cover.thickness
    response = tabulate_texel_response(cover, array.texel_size)
    made = make_presses(cover, parameters, (0.7, 3.1), lambda _: None)
    cases = [each.scene.case for each in made.presses]
    truth = [press(cover, array, each.indenter, load=each.load, pose=each.pose) for each in cases]

    def measure(modulus):
        errors = []
        for case, reference in zip(cases, truth, strict=True):
            at, step = np.array(case.pose.at), 0.15e-3
            along = (np.arange(-70, 70) + 0.5) * step
            x, y = (each.ravel() for each in np.meshgrid(along, along))
            gap = case.indenter.gap(x, y)
            low, high = 0.0, 2e-3
            for _ in range(60):
                middle = (low + high) / 2
                force = modulus / height * step**2 * np.maximum(middle - gap, 0)
                low, high = (middle, high) if force.sum() < case.load else (low, middle)
            force *= case.load / force.sum()
            some = force > 0
            texels = np.array(
                [response(x[some] + at[0] - cx, y[some] + at[1] - cy) @ force[some] for cx, cy in array.centres[:, :2]]
            )
            errors.append(
                misplaced_force(reference.texel_forces, texels, reference_outside=reference.outside,
                                outside=case.load - texels.sum(), load=case.load)
            )  # fmt: skip
        return float(np.mean(errors))

    best = min(map(measure, np.geomspace(1e6, 6e6, 19)))
    rows = {row.name: row for row in scores.rows}
    assert measure(scores.values["modulus"]) < best + 0.002
    assert rows["fitted, exact spread"].mean == pytest.approx(best, abs=0.002)
    assert rows["Young's modulus, exact spread"].mean == pytest.approx(measure(1e6), abs=0.004)
    assert rows["oedometric modulus, exact spread"].mean == pytest.approx(
        measure(0.51 / (1.49 * 0.02) * 1e6), abs=0.004
    )
    assert rows["Young's modulus, exact spread"].mean > 3 * best


def test_values_of_another_row_are_scored_unchanged(scene):
    model = hydroelastic(scene.cover, SPREADS[1])
    given = {"modulus": 1.7e6, "exponent": 1.0}
    planted = CalibrationPress(scene=scene, reference=Reference(scene, model, given))
    rows = score(
        [Candidate(name="a", model=model, values=given), Candidate(name="b", model=model, like="a")],
        scene.cover,
        [planted],
    )
    assert [row.parameters["modulus"] for row in rows] == [1.7e6, 1.7e6]
    assert rows[0].mean == rows[1].mean == pytest.approx(0, abs=1e-12)
