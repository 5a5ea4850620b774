"""Comparison errors, classes of cases, domains and inputs of a small oblong array, by hand."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from fastmodel import Electronics, Gaussian, Parameters
from meshes import Cover, Layer, Material, Pose, TexelArray
from validation.campaign.bench import LayeredBench
from validation.campaign.campaign_file import Inputs
from validation.campaign.case import Case, describe_pose
from validation.campaign.results import CaseResult, Prediction, Reference, score_forces
from validation.campaign.run import summarise
from validation.credibility.evidence import describe_domain, group_errors
from validation.credibility.uncertainty import InputUncertainty, compare_quantities, find_missing_range, list_inputs
from validation.credibility.verification import verify_solutions

ARRAY = TexelArray.grid(2, 2, (2e-3, 4e-3))  # centres at x = -1, 1 mm and y = -2, 2 mm
PARAMETERS = Parameters(
    array=ARRAY, spread=Gaussian.from_sigma(0.5), electronics=Electronics(rate_hz=1.0, sensitivity=1000.0)
)
TRUE, FAST = np.array([1.0, 3.0, 0.5, 0.5]), np.array([1.2, 2.6, 0.4, 0.6])


def make_result(name="a", *, shape="sphere:radius=5mm", load="5 N", yaw="0deg", outside=0.2, **changes):
    reference = Reference(
        texel_forces=TRUE, outside=outside, total_force=5.0,
        **({"depth": 0.3e-3, "contact_area": 7e-6, "error_estimate": {"peak_texel": 0.023, "depth": 0.004,
                                                                      "contact_area": 0.05},
            "assumptions": {}, "warnings": ()} | changes),
    )  # fmt: skip
    case = Case.read(name, shape, load, yaw=yaw)
    score = score_forces(reference, FAST, 0.2, case.load, PARAMETERS)
    fast = Prediction(texel_forces=FAST, outside=0.2, score=score)
    return CaseResult(case=case, reference=reference, warnings=(), predictions={"fast": fast})


def test_errors_and_uncertainties_of_a_case_are_those_worked_out_by_hand():
    """u_num of a force: 2.3 % / 1.15 of it, and 2e-4 of the load by the iteration."""
    effects = {"a": np.array([0.1, 0.3, 0.0, 0.0]), "b": np.array([0.0, -0.4, 0.2, 0.0])}
    inputs = InputUncertainty(load=5.0, uncertainties={"a": 1.0, "b": 1.0}, image=TRUE, effects=effects)
    peak, total, x, y = compare_quantities(ARRAY, make_result(), inputs, 0.1)
    assert [each.quantity for each in (peak, total, x, y)] == [
        "largest texel [mN]", "all texels [mN]", "centre of pressure x [mm]", "centre of pressure y [mm]",
    ]  # fmt: skip
    assert {each.factor for each in (peak, total, x, y)} == {1e3}
    assert (peak.fast, peak.reference, peak.u_data) == pytest.approx((2.6, 3.0, 0.3))
    assert peak.u_num == pytest.approx(math.hypot(0.02 * 3.0, 1e-3))
    assert peak.u_input == pytest.approx(math.hypot(0.3, 0.4))
    assert (total.fast, total.reference, total.u_data) == pytest.approx((4.8, 5.0, 0.5))
    assert total.u_num == pytest.approx(math.hypot(0.02 * 5.0, 1e-3))
    assert total.u_input == pytest.approx(math.hypot(0.4, -0.2))
    # x: (3.5 - 1.5) / 5 mm and (3.2 - 1.6) / 4.8 mm; y: (1 - 4) / 5 of 2 mm and (1 - 3.8) / 4.8 of 2 mm
    assert (x.fast, x.reference, x.u_data) == pytest.approx((1e-3 * 1.6 / 4.8, 0.4e-3, 0.0))
    assert (y.fast, y.reference) == pytest.approx((-2e-3 * 2.8 / 4.8, -1.2e-3))
    # levers x - 0.4 mm over 5 N: -1.4, 0.6, -1.4, 0.6 mm; y + 1.2 mm: -0.8, -0.8, 3.2, 3.2 mm
    assert x.u_input == pytest.approx(1e-3 * math.hypot(-0.14 + 0.18, -0.24 - 0.28) / 5)
    assert y.u_input == pytest.approx(1e-3 * math.hypot(-0.32, 0.32 + 0.64) / 5)
    # root second moments: x sqrt(1 - 0.16) mm, y sqrt(4 - 1.44) mm; the larger is the lever arm
    assert x.u_num == y.u_num == pytest.approx(1.6e-3 * math.hypot(0.02, 2e-4))
    blind = dataclasses.replace(inputs, known=False)
    assert all(math.isnan(each.u_input) for each in compare_quantities(ARRAY, make_result(), blind, 0.0))
    dark = dataclasses.replace(inputs, image=-TRUE)
    assert len(compare_quantities(ARRAY, make_result(), dark, 0.0)) == 2


def test_a_change_of_the_sum_is_made_up_outside():
    """Half of the changes of all texels and of the outside: 0.4 N more on the texels are 0.4 N less outside."""
    effects = {"a": np.array([0.1, 0.3, 0.0, 0.0]), "b": np.array([0.2, -0.2, 0.0, 0.0])}
    inputs = InputUncertainty(load=2.0, uncertainties={"a": 1.0, "b": 1.0}, image=TRUE, effects=effects)
    assert inputs.misplaced == pytest.approx({"a": 0.4 / 2.0, "b": 0.2 / 2.0})
    assert inputs.misplaced_total == pytest.approx(math.hypot(0.2, 0.1))
    assert inputs.of(lambda effect: effect[1]) == pytest.approx({"a": 0.3, "b": 0.2})


def make_material(name="x", **options):
    return Material(name=name, model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.4, **options)


TWO = Cover(
    layers=(
        Layer(thickness=1e-3, material=make_material("soft")),
        Layer(thickness=3e-3, material=make_material("hard")),
    )
)
BALL = Case.read("ball", "sphere:radius=5mm", "3 N", at="1mm,-2mm", yaw="10deg")


def test_each_input_changes_one_number_of_cover_or_pose():
    listed = {
        name: (by, change) for name, by, change in list_inputs(TWO, Inputs(thickness=0.1, position=2e-4, yaw=0.05))
    }
    assert {name: by for name, (by, _) in listed.items()} == pytest.approx({
        "modulus of soft, layer 1 [relative]": 0.1, "Poisson ratio of soft, layer 1 [-]": 0.005,
        "thickness of soft, layer 1 [relative]": 0.1, "modulus of hard, layer 2 [relative]": 0.1,
        "Poisson ratio of hard, layer 2 [-]": 0.005, "thickness of hard, layer 2 [relative]": 0.1,
        "position x [m]": 2e-4, "position y [m]": 2e-4, "yaw [rad]": 0.05,
    })  # fmt: skip

    def change(name, by):
        cover, case = listed[name][1](TWO, BALL, by)
        layers = [(each.thickness, each.material.youngs_modulus, each.material.poisson_ratio) for each in cover.layers]
        return [*layers[0], *layers[1], *case.pose.at, case.pose.yaw]

    before = [1e-3, 1e6, 0.4, 3e-3, 1e6, 0.4, 1e-3, -2e-3, math.radians(10)]
    for name, place, after in (
        ("modulus of hard, layer 2 [relative]", 4, 1e6 * math.exp(0.2)),
        ("thickness of soft, layer 1 [relative]", 0, 1e-3 * math.exp(0.2)),
        ("Poisson ratio of soft, layer 1 [-]", 2, 0.5), ("position x [m]", 6, 1e-3 + 0.2),
        ("position y [m]", 7, -2e-3 + 0.2), ("yaw [rad]", 8, math.radians(10) + 0.2),
    ):  # fmt: skip
        expected = before.copy()
        expected[place] = after
        assert change(name, 0.2) == pytest.approx(expected), name
    assert change("Poisson ratio of hard, layer 2 [-]", -0.7)[5] == 0.0


def test_a_cover_that_is_assumed_without_a_range_is_named_with_its_materials():
    assert find_missing_range(TWO) == ""
    words = find_missing_range(dataclasses.replace(TWO, assumed=True))
    assert "modulus of soft, hard: u_input, u_val" in words
    stated = Cover(layers=(Layer(thickness=1e-3, material=make_material(spread=0.1)),), assumed=True)
    above = Cover(layers=(Layer(thickness=1e-3, material=make_material(spread_above=0.1)),), assumed=True)
    assert find_missing_range(stated) == find_missing_range(above) == ""


BENCH = LayeredBench(cover=TWO, parameters=PARAMETERS)


@pytest.mark.parametrize(
    ("changes", "classes"),
    [
        ({"load": "1.99 N", "outside": 0.0}, ("below 2 N", "sphere", "inside, not turned")),
        ({"load": "2 N", "outside": 0.1}, ("2 N and more", "sphere", "inside, not turned")),  # a twentieth is no edge
        ({"load": "2 N", "outside": 0.101}, ("2 N and more", "sphere", "over an edge")),
        ({"yaw": "90deg", "outside": 0.0}, ("2 N and more", "sphere", "inside, not turned")),
        ({"yaw": "45deg", "shape": "box:size=2mmx3mmx4mm", "outside": 0.0}, ("2 N and more", "box", "turned")),
        ({"yaw": "45deg", "outside": 1.0}, ("2 N and more", "sphere", "over an edge")),
    ],
)
def test_classes_of_a_case_on_layers(changes, classes):
    assert BENCH.classify(make_result(**changes)) == dict(zip(("load", "shape", "pose"), classes, strict=True))


def test_the_domain_is_that_of_all_cases_and_groups_pool_their_members():
    results = [
        make_result("a", load="1 N", depth=0.2e-3, outside=0.0), make_result("b", load="4 N", contact_area=9e-6),
        make_result("c", load="1.5 N", depth=0.6e-3, outside=0.75),
    ]  # fmt: skip
    domain = describe_domain(BENCH, results)
    assert {name: pytest.approx(ends) for name, ends in domain.items()} == {
        "load_N": (1.0, 4.0), "depth_over_thickness": (0.05, 0.15), "contact_area_m2": (7e-6, 9e-6),
        "share_outside_array": (0.0, 0.5),
    }  # fmt: skip
    groups = group_errors(BENCH, results)
    # texel forces differ by 0.2 + 0.4 + 0.1 + 0.1 N; what is outside differs by |0.2 - outside|
    errors = [(0.8 + apart) / 2 / load for load, apart in ((1.0, 0.2), (4.0, 0.0), (1.5, 0.55))]
    light = groups["load"]["below 2 N"]["misplaced_force"]
    assert (light.mean, light.cases) == (pytest.approx((errors[0] + errors[2]) / 2), 2)
    assert groups["load"]["2 N and more"]["misplaced_force"].mean == pytest.approx(errors[1])
    assert {member: each["misplaced_force"].cases for member, each in groups["pose"].items()} == {
        "inside, not turned": 2, "over an edge": 1,
    }  # fmt: skip


def test_solutions_on_three_grids_have_their_order_and_the_result():
    """Values 1 - h^2: differences 0.75 and 0.1875 of grids 1, 1/2 and 1/4 have the order 2."""
    grids = {
        "size": (1.0, 0.5, 0.25), "depth": (0.0, 0.75e-3, 0.9375e-3), "peak_texel": (2.0, 2.5, 2.75),
        "contact_area": (1e-6, 2e-6, 1.5e-6),
    }  # fmt: skip
    depth, peak, area = verify_solutions([make_result(grid_values=grids)])
    assert (depth.quantity, depth.unit, depth.factor, depth.result) == ("depth", "\u00b5m", 1e6, 0.3e-3)
    assert (depth.order, depth.estimate) == (pytest.approx(2), 0.004)
    assert (peak.quantity, peak.unit, peak.factor, peak.result) == ("peak texel", "mN", 1e3, 3.0)
    assert (peak.order, peak.estimate) == (pytest.approx(1), 0.023)
    assert (area.quantity, area.unit, area.factor, area.result) == ("contact area", "mm\u00b2", 1e6, 7e-6)
    assert math.isnan(area.order)
    assert depth.values == grids["depth"]
    few = {name: values[:2] for name, values in grids.items()}
    assert verify_solutions([make_result(grid_values=few), make_result()]) == ()


def test_a_summary_pools_what_the_cases_compare():
    """Skill of 0.25 and 0.5 against 1.0 and 2.0; the error of the reference is the mean of the cases."""
    results = []
    for number, (own, other) in enumerate(((0.25, 1.0), (0.5, 2.0), (9.0, 9.0))):
        made = make_result(str(number), error_estimate={"peak_texel": 0.01 * (number + 1)})
        fast = made.predictions["fast"]
        scores = [dataclasses.replace(fast.score, misplaced_force=each, peak_error=10 * each) for each in (own, other)]
        case = dataclasses.replace(made.case, compared=("peak_error",) if number == 2 else ())
        fast, null = (dataclasses.replace(fast, score=score) for score in scores)
        predictions = {"fast": fast, "null": null}
        results.append(dataclasses.replace(made, case=case, predictions=predictions))
    found = summarise(results, (), None, models={"fast": "ours", "null": "none"})
    assert found.pooled["fast"]["misplaced_force"].mean == pytest.approx(0.375)
    assert found.pooled["null"]["misplaced_force"].mean == pytest.approx(1.5)
    assert found.pooled["fast"]["peak_error"].mean == pytest.approx(97.5 / 3)
    assert {name: each.mean for name, each in found.skill.items()} == {"null": pytest.approx(0.75)}
    assert found.noise_floor == {"peak_texel": pytest.approx(0.02)}
    assert found.reference_error == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        (Pose.planar(at=(1.234e-3, -2e-3), yaw=math.radians(30)), "(1.23, -2) mm, 30\u00b0"),
        (Pose.planar(at=(-1e-9, 0.0), yaw=0.0), "(0, 0) mm, 0\u00b0"),
        (Pose.planar(at=(0.0, 0.0), yaw=0.0, tilt=(math.radians(2), math.radians(-1.5))),
         "(0, 0) mm, 0\u00b0, tilted 2\u00b0, -1.5\u00b0"),
        (Pose(point=(1e-3, 2e-3, 3e-3), direction=(0.6, 0.0, -0.8)), "(1, 2, 3) mm along (0.6, 0, -0.8), 0\u00b0"),
    ],
)  # fmt: skip
def test_a_pose_is_described_in_millimetres_and_degrees(pose, words):
    assert describe_pose(pose) == words


def test_bodies_share_the_load_and_change_by_one_factor():
    second = Case.read("b", "box:size=2mmx3mmx4mm", "1.5 N", at="4mm,5mm")
    both = dataclasses.replace(BALL, load=BALL.load + second.load, others=(second,))
    assert [each.load for each in both.bodies] == [3.0, 1.5]
    assert [each.others for each in both.bodies] == [(), ()]
    half = both.with_load(2.25)
    assert (half.load, half.others[0].load, half.bodies[0].load) == pytest.approx((2.25, 0.75, 1.5))
    assert both.describe() == (
        "sphere:radius=5mm, 3 N at (1, -2) mm, 10\u00b0 and box:size=2mmx3mmx4mm, 1.5 N at (4, 5) mm, 0\u00b0"
    )
    assert Case.from_json(both.as_json()) == both
    same = dataclasses.replace(both, name="another", shape="sphere:radius=0.5cm")
    assert same.is_press_of(both)
    assert not BALL.is_press_of(both)
    assert not both.is_press_of(both.with_load(1.0))
    assert not dataclasses.replace(both, path=(1.0, 4.5)).is_press_of(both)
    assert not dataclasses.replace(both, others=(second.with_load(1.0),)).is_press_of(both)
    assert BALL.compares("peak_error")
    assert [dataclasses.replace(BALL, compared=("x",)).compares(each) for each in ("x", "peak_error")] == [True, False]


def test_a_reference_keeps_what_the_solver_found():
    found = SimpleNamespace(
        texel_forces=TRUE, outside=0.1, total_force=5.0, depth=1e-3, contact_area=2e-6, error_estimate={},
        assumptions={}, warnings=("w",), energy=0.7,
    )  # fmt: skip
    reference = Reference.of(found)
    assert (reference.outside, reference.energy, reference.warnings) == (0.1, 0.7, ("w",))
    assert reference.found is found
    assert Reference.of(reference) is reference
