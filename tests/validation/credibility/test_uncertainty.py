"""Input uncertainty, comparison errors, stages, groups and solution verification."""

import dataclasses
import math

import numpy as np
import pytest

from fem_reference import ConvergenceError
from validation.campaign.bench import LayeredBench
from validation.campaign.campaign_file import Inputs, read_campaign
from validation.campaign.case import Case
from validation.campaign.run import summarise
from validation.campaign.texel_metrics import centre_of_pressure
from validation.credibility import evidence
from validation.credibility import uncertainty as input_uncertainty
from validation.credibility.evidence import describe_domain, group_errors
from validation.credibility.stages import STAGES, count_back, score_stages
from validation.credibility.uncertainty import (
    ComparisonError,
    compare_quantities,
    list_inputs,
    propagate_inputs,
    simulate_image,
)
from validation.credibility.verification import observe_order, verify_solutions
from validation.places import FlatPlaces

BALL = Case.read("ball", "sphere:radius=5mm", "300 g", at="0.7mm,-1.1mm")
BLOCK = Case.read("block", "box:size=6mmx10mmx5mm", "300 g", at="0.7mm,-1.1mm", yaw="30deg")
ONE = dict.fromkeys(("modulus", "poisson_ratio", "thickness", "position", "yaw", "friction"), 0.0)


def only(**inputs):
    return Inputs(**{**ONE, **inputs})


@pytest.fixture(scope="module")
def results(wts_derivation):
    bench = LayeredBench(cover=wts_derivation.sensor.cover, parameters=wts_derivation.parameters)
    return [bench.solve(case) for case in (BALL, BLOCK)]


def test_the_coarse_image_is_near_the_reference(results, wts_derivation):
    sensor = wts_derivation.sensor
    for result in results:
        image = simulate_image(sensor.cover, sensor.array, result.case)
        assert np.abs(image - result.reference.texel_forces).sum() < 0.01 * result.case.load


def test_a_moved_indenter_moves_the_centre_of_pressure_by_as_much(bonded, wts):
    found = propagate_inputs(bonded(0.45), wts, BALL, only(position=1e-4))
    assert list(found.uncertainties) == ["position x [m]", "position y [m]"]
    places = wts.centres[:, :2]
    middle = centre_of_pressure(found.image, places)
    for axis, effect in enumerate(found.effects.values()):
        moved = centre_of_pressure(found.image + effect, places) - middle
        # texels of 3.4 mm under a cover of 2 mm follow the centre only roughly
        assert moved[axis] == pytest.approx(1e-4, rel=0.4)
        assert abs(moved[1 - axis]) < 2e-5


@pytest.mark.slow
def test_a_flat_face_does_not_feel_the_modulus_and_a_ball_not_its_yaw(bonded, wts):
    assert propagate_inputs(bonded(0.45), wts, BLOCK, only(modulus=0.2)).misplaced_total < 1e-6
    assert propagate_inputs(bonded(0.45), wts, BALL, only(yaw=0.1)).misplaced_total < 1e-5
    assert propagate_inputs(bonded(0.45), wts, BALL, only(modulus=0.2)).misplaced_total > 1e-3
    assert propagate_inputs(bonded(0.45), wts, BLOCK, only(yaw=0.1)).misplaced_total > 1e-3


@pytest.mark.slow
def test_effects_are_proportional_to_small_uncertainties(bonded, wts):
    for name, small in (("modulus", 0.02), ("poisson_ratio", 0.002), ("thickness", 0.01)):
        one, two = (propagate_inputs(bonded(0.45), wts, BALL, only(**{name: k * small})) for k in (1, 2))
        assert two.misplaced_total == pytest.approx(2 * one.misplaced_total, rel=0.05)


@pytest.mark.slow
def test_the_limit_of_the_poisson_ratio_is_one_sided(bonded, wts):
    inner, limit = (propagate_inputs(bonded(nu), wts, BALL, only(poisson_ratio=0.004)) for nu in (0.495, 0.5))
    assert limit.misplaced_total == pytest.approx(inner.misplaced_total, rel=0.2)


def test_the_spread_of_a_material_replaces_that_of_the_campaign(bonded):
    cover = bonded(0.45)
    layer = cover.layers[0]
    known = dataclasses.replace(layer.material, spread=0.3, poisson_spread=0.03)
    cover = dataclasses.replace(cover, layers=(dataclasses.replace(layer, material=known),))
    found = {name: value for name, value, _ in list_inputs(cover, Inputs())}
    assert found["modulus [relative]"] == pytest.approx(math.log(1.3 / 0.7) / 2 / math.sqrt(3))
    assert found["Poisson ratio [-]"] == pytest.approx(0.03 / math.sqrt(3))


@pytest.mark.parametrize(
    ("below", "above", "width"), [(2 / 3, 2.0, 2 * math.log(3)), (0.0, 0.5, math.log(1.5)), (1.0, 1.0, math.log(4))]
)
def test_both_sides_of_an_uneven_spread_count(bonded, below, above, width):
    cover = bonded(0.45)
    layer = cover.layers[0]
    known = dataclasses.replace(layer.material, spread=below, spread_above=above)
    cover = dataclasses.replace(cover, layers=(dataclasses.replace(layer, material=known),))
    found = {name: value for name, value, _ in list_inputs(cover, Inputs())}
    assert found["modulus [relative]"] == pytest.approx(width / math.sqrt(12))


@pytest.mark.slow
def test_friction_is_a_share_of_the_change_to_no_slip(bonded, wts):
    found = propagate_inputs(bonded(0.45), wts, BALL, only(friction=math.inf))
    assert list(found.effects) == ["friction"]
    assert 1e-4 < found.misplaced_total < 0.05


def test_validation_uncertainty_is_the_root_of_the_squares():
    error = ComparisonError(
        case="", quantity="", factor=1.0, fast=5.0, reference=4.0, u_num=0.3, u_input=0.4, u_data=1.2
    )
    assert (error.error, error.u_val) == (1.0, pytest.approx(1.3))
    assert error.resolved_here
    assert not error.resolved
    assert dataclasses.replace(error, u_data=0.0).resolved


@pytest.mark.slow
def test_comparison_errors_are_those_of_the_images(results, wts):
    result = results[0]
    inputs = propagate_inputs(wts_cover(), wts, result.case, only(position=1e-4))
    peak, everything, x, y = compare_quantities(wts, result, inputs, 0.1)
    fast, reference = result.predictions["fast"].texel_forces, result.reference.texel_forces
    at = int(np.argmax(reference))
    assert peak.error == fast[at] - reference[at]
    assert peak.u_input == pytest.approx(math.hypot(*(effect[at] for effect in inputs.effects.values())))
    assert peak.u_data == pytest.approx(0.1 * reference[at])
    assert everything.error == pytest.approx(fast.sum() - reference.sum())
    apart = centre_of_pressure(fast, wts.centres[:, :2]) - centre_of_pressure(reference, wts.centres[:, :2])
    assert [x.error, y.error] == pytest.approx(apart.tolist())
    # to first order
    effect = inputs.effects["position x [m]"]
    moved = centre_of_pressure(inputs.image + 1e-3 * effect, wts.centres[:, :2])
    moved -= centre_of_pressure(inputs.image, wts.centres[:, :2])
    alone = compare_quantities(wts, result, dataclasses.replace(inputs, effects={"x": effect}), 0.0)[2]
    assert alone.u_input == pytest.approx(abs(moved[0]) / 1e-3, rel=1e-2)


def wts_cover():
    from validation.sensor_file import load

    return load("wts-0614-34").cover


def test_stages_of_a_linear_cover(results, wts_derivation):
    found = score_stages(wts_derivation.sensor.cover, wts_derivation.parameters, results)
    assert set(found.pooled) == set(STAGES)
    for result in results:
        stages = found.cases[result.case.name]
        total = result.predictions["fast"].score.misplaced_force
        assert stages["cover"] == 0
        assert total <= stages["spread"] + stages["contact"] + 1e-9
        assert stages["spread"] < 0.05


def test_a_wrong_table_shows_in_the_stage_spread(results, wts_derivation):
    parameters = wts_derivation.parameters
    cells = dataclasses.replace(parameters.surface, influence=0.9 * parameters.surface.influence)
    right, wrong = (
        score_stages(wts_derivation.sensor.cover, dataclasses.replace(parameters, surface=each), results)
        for each in (parameters.surface, cells)
    )
    assert wrong.pooled["spread"].mean > right.pooled["spread"].mean + 0.05


def test_counts_are_converted_back(wts_derivation):
    electronics = dataclasses.replace(
        wts_derivation.parameters.electronics, sensitivity=1000.0, offset=0.0, characteristic=None, tip_share=None
    )
    parameters = dataclasses.replace(wts_derivation.parameters, electronics=electronics)
    forces = np.linspace(0, 2, 84)
    assert np.abs(count_back(parameters, forces) - forces).max() < 1e-3
    gains = tuple(np.linspace(0.5, 1.5, 84))
    parameters = dataclasses.replace(parameters, electronics=dataclasses.replace(electronics, gains=gains))
    assert np.abs(count_back(parameters, forces) - forces).max() < 2e-3
    few = dataclasses.replace(electronics, output_max=1000)
    back = count_back(dataclasses.replace(parameters, electronics=few), forces)
    assert back.max() == pytest.approx(1.5, abs=0.55)  # forces beyond saturation are not told apart
    assert np.ptp(back[forces > 1.01]) == 0


def test_observed_orders():
    sizes = (4.0, 2.0, 1.0)
    assert observe_order([1 + 0.1 * h**2 for h in sizes], sizes) == pytest.approx(2)
    assert observe_order([1 - 0.1 * h for h in (3, 2, 1)], (3, 2, 1)) == pytest.approx(1)
    assert math.isnan(observe_order([1.0, 1.1, 1.05], sizes))
    assert math.isnan(observe_order([1.0, 1.0, 1.0], sizes))
    for order in (0.06, 9.9):
        assert observe_order([1 + h**order for h in sizes], sizes) == pytest.approx(order)
    for order in (0.04, 10.1):
        assert math.isnan(observe_order([1 + h**order for h in sizes], sizes))


def test_solutions_are_listed_on_three_grids(results):
    found = verify_solutions(results)
    assert [(each.case, each.quantity) for each in found[:3]] == [
        ("ball", "depth"),
        ("ball", "peak texel"),
        ("ball", "contact area"),
    ]
    for each in found:
        assert len(each.values) == 3
        assert each.result == pytest.approx(each.values[-1], rel=0.05)
    assert found[1].estimate == results[0].reference.error_estimate["peak_texel"]


def test_errors_are_grouped_and_the_range_is_that_of_the_cases(results, wts_derivation):
    bench = LayeredBench(cover=wts_derivation.sensor.cover, parameters=wts_derivation.parameters)
    groups = group_errors(bench, results)
    assert set(groups) == {"load", "shape", "pose"}
    assert groups["load"]["2 N and more"]["misplaced_force"].cases == 2
    assert groups["shape"]["box"]["misplaced_force"].mean == results[1].predictions["fast"].score.misplaced_force
    assert set(groups["pose"]) == {"inside, not turned", "turned"}
    domain = describe_domain(bench, results)
    assert domain["load_N"] == (BALL.load, BALL.load)
    assert domain["depth_over_thickness"][0] == min(r.reference.depth for r in results) / 2e-3


@pytest.mark.slow
def test_propagated_uncertainty_agrees_with_a_monte_carlo(bonded, wts):
    """100 draws of all inputs at once, each through the whole contact: the spread agrees with the propagated one."""
    cover, inputs = bonded(0.45), Inputs(friction=0.0)
    found = propagate_inputs(cover, wts, BALL, inputs)
    random = np.random.default_rng(0)
    images = []
    for _ in range(100):
        changed, case = cover, BALL
        for _, uncertainty, change in list_inputs(cover, inputs):
            changed, case = change(changed, case, uncertainty * random.standard_normal())
        images.append(simulate_image(changed, wts, case))
    images = np.array(images)
    peak = int(np.argmax(found.image))
    for drawn, quantity in (
        (images[:, peak], lambda effect: effect[peak]),
        (images.sum(axis=1), lambda effect: effect.sum()),
        (
            [centre_of_pressure(image, wts.centres[:, :2])[0] for image in images],
            lambda effect: (
                effect
                @ (wts.centres[:, 0] - centre_of_pressure(found.image, wts.centres[:, :2])[0])
                / found.image.sum()
            ),
        ),
    ):
        propagated = math.sqrt(sum(value**2 for value in found.of(quantity).values()))
        assert np.std(drawn) == pytest.approx(propagated, rel=0.25)  # 100 draws: 7 % of a standard deviation


@pytest.mark.slow
def test_a_case_whose_inputs_cannot_be_propagated_costs_its_comparison_and_a_line(results, wts_derivation, monkeypatch):
    def propagate(cover, array, case, inputs):
        if case.name == results[0].case.name:
            raise ConvergenceError("too coarse")
        return propagate_inputs(cover, array, case, inputs)

    monkeypatch.setattr(input_uncertainty, "propagate_inputs", propagate)
    monkeypatch.setattr("validation.credibility.verification.verify_code", lambda *_: ())
    sensor = wts_derivation.sensor
    bench = LayeredBench(cover=sensor.cover, parameters=wts_derivation.parameters)
    plan = dataclasses.replace(read_campaign(None, FlatPlaces(array=sensor.array)), inputs=only(position=1e-4))
    gathered = evidence.gather_evidence(bench, plan, summarise(results, (), None))
    assert set(gathered.inputs) == {each.case.name for each in results[1:]}
    assert {each.case for each in gathered.errors} == set(gathered.inputs)
    assert gathered.failed == (f"input uncertainty of {results[0].case.name}: too coarse",)


def test_an_assumed_cover_is_never_more_certain_than_stated(bonded):
    """The range of ignorance of an assumed thickness is 0.52; a larger stated uncertainty stays."""
    cover = dataclasses.replace(bonded(0.45), assumed=True)
    for stated, expected in ((0.025, math.log(6) / math.sqrt(12)), (0.7, 0.7)):
        found = {name: value for name, value, _ in list_inputs(cover, only(thickness=stated))}
        assert found["thickness [relative]"] == pytest.approx(expected)


def test_a_thickness_changes_in_its_logarithm(bonded):
    """The range of ignorance is uniform there: both changed covers differ from the nominal one by the same factor."""
    cover = dataclasses.replace(bonded(0.45), assumed=True)
    (_, by, change), *_ = (each for each in list_inputs(cover, only()) if each[0].startswith("thickness"))
    high, low = (change(cover, BALL, sign * by)[0].thickness / cover.thickness for sign in (1, -1))
    assert high == pytest.approx(math.exp(math.log(6) / math.sqrt(12)))
    assert high * low == pytest.approx(1)
