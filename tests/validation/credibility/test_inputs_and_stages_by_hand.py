"""Effects of uncertain inputs on images in closed form, and errors of the stages of made-up forces, by hand."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import erf

from fastmodel import Electronics
from fem_reference import ConvergenceError
from meshes import Cylinder, Sphere
from tests.support.cover_data import WTS, cells, parameters
from tests.support.rubber import make_cover
from validation.campaign.campaign_file import Inputs
from validation.campaign.case import Case
from validation.campaign.results import CaseResult, Prediction, Reference, score_forces
from validation.credibility import stages, uncertainty
from validation.credibility.stages import count_back, score_stages, spread_contact
from validation.credibility.uncertainty import ComparisonError, propagate_inputs, simulate_image

BALL = Case.read("ball", "sphere:radius=5mm", "3 N", at="1mm,-2mm", yaw="10deg")
INPUTS = Inputs(modulus=0.2, poisson_ratio=0.03, thickness=0.1, position=2e-4, yaw=0.05, friction=0.0)


def make_image(cover, _array, case):
    """A made-up image that is linear in the logarithms of modulus and thickness, and in all other inputs."""
    layer = cover.layers[0]
    x, y = case.pose.at
    return np.array([
        3.0 * math.log(layer.material.youngs_modulus), 5.0 * layer.material.poisson_ratio,
        7.0 * math.log(layer.thickness), 1e3 * x + 2e3 * y, 11.0 * case.pose.yaw, case.load,
    ])  # fmt: skip


@pytest.fixture
def linear(monkeypatch, tmp_path):
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    monkeypatch.setattr(uncertainty, "simulate_image", make_image)


EFFECTS = {
    "modulus [relative]": (0, 3.0 * 0.2), "Poisson ratio [-]": (1, 5.0 * 0.03), "thickness [relative]": (2, 7.0 * 0.1),
    "position x [m]": (3, 0.2), "position y [m]": (3, 0.4), "yaw [rad]": (4, 11.0 * 0.05),
}  # fmt: skip


@pytest.mark.usefixtures("linear")
@pytest.mark.parametrize("ratio", [0.4, 0.49, 0.5])
def test_an_effect_is_half_the_difference_of_two_images_also_at_the_limit_of_the_poisson_ratio(ratio):
    cover = make_cover(ratio)
    found = propagate_inputs(cover, WTS, BALL, INPUTS)
    assert found.image == pytest.approx(make_image(cover, WTS, BALL))
    assert list(found.effects) == list(found.uncertainties) == list(EFFECTS)
    assert list(found.uncertainties.values()) == pytest.approx([0.2, 0.03, 0.1, 2e-4, 2e-4, 0.05])
    for name, (place, value) in EFFECTS.items():
        expected = np.zeros(6)
        expected[place] = value
        assert found.effects[name] == pytest.approx(expected, abs=1e-9), name
    assert (found.load, found.note, found.known) == (3.0, "", True)


@pytest.mark.usefixtures("linear")
def test_what_is_stored_belongs_to_one_cover_place_and_list_of_inputs():
    cover = make_cover(0.4)
    first = propagate_inputs(cover, WTS, BALL, INPUTS).image
    moved = dataclasses.replace(BALL, pose=dataclasses.replace(BALL.pose, yaw=0.9))
    for other, case, inputs in (
        (make_cover(0.45), BALL, INPUTS), (cover, moved, INPUTS), (cover, BALL.with_load(2.0), INPUTS),
    ):  # fmt: skip
        found = propagate_inputs(other, WTS, case, inputs)
        assert found.image == pytest.approx(make_image(other, WTS, case))
        assert np.abs(found.image - first).max() > 0.1
    wider = propagate_inputs(cover, WTS, BALL, dataclasses.replace(INPUTS, modulus=0.3))
    assert wider.effects["modulus [relative]"][0] == pytest.approx(0.9)


@pytest.mark.usefixtures("linear")
def test_a_tilted_body_is_turned_first_and_several_bodies_are_refused(monkeypatch):
    asked = []
    watch = lambda cover, array, case: asked.append(case) or make_image(cover, array, case)  # noqa: E731
    monkeypatch.setattr(uncertainty, "simulate_image", watch)
    tilted = dataclasses.replace(BALL, pose=dataclasses.replace(BALL.pose, tilt=(0.1, 0.0)))
    propagate_inputs(make_cover(0.4), WTS, tilted, INPUTS)
    assert {case.pose.tilt for case in asked} == {(0.0, 0.0)}
    with pytest.raises(ValueError, match="one body only"):
        propagate_inputs(make_cover(0.4), WTS, dataclasses.replace(BALL, others=(BALL,)), INPUTS)


@pytest.fixture
def pressed(monkeypatch):
    """Presses whose texel forces depend on the friction; returns what was pressed."""
    asked = []

    def press(cover, _array, body, *, load, pose, friction):
        asked.append((cover.small_strain_only, body, load, pose.at, friction))
        if load > 9:
            raise ConvergenceError("no")
        if load > 8:
            raise ValueError("no")
        return SimpleNamespace(texel_forces=np.array([1.0 + friction, 2.0 - 0.5 * friction]))

    monkeypatch.setattr("fem_reference.indentation.press.press", press)
    return asked


ROD = Case.read("rod", "box:size=4mmx6mmx5mm", "3 N", at="1mm,-2mm")
TILTED = dataclasses.replace(ROD, pose=dataclasses.replace(ROD.pose, tilt=(0.1, 0.0)))


@pytest.mark.usefixtures("linear")
@pytest.mark.parametrize(
    ("case", "body"),
    [
        (BALL, Sphere(radius=5e-3)), (ROD, Cylinder(radius=math.sqrt(24e-6 / math.pi))), (TILTED, None),
        (BALL.with_load(8.5), None), (BALL.with_load(9.5), None),
    ],
)  # fmt: skip
def test_friction_is_uniform_between_none_and_its_bound(pressed, case, body):
    """A standard deviation is the width over sqrt(12); a flat face is pressed as a cylinder of its area."""
    found = propagate_inputs(make_cover(0.4), WTS, case, dataclasses.replace(INPUTS, friction=0.6))
    assert found.uncertainties["friction"] == 0.6
    assert found.known
    if body is None:
        assert "friction" not in found.effects
        assert found.note == "friction not propagated: no round body stands for this indenter"
        return
    assert found.effects["friction"] == pytest.approx(np.array([0.6, -0.3]) / math.sqrt(12))
    assert found.note == ""
    linear, pressed_body, load, at, friction = pressed[0]
    assert (linear, load, at, friction, pressed[1][-1]) == (True, 3.0, (1e-3, -2e-3), 0.6, 0.0)
    assert type(pressed_body) is type(body)
    assert pressed_body.radius == pytest.approx(body.radius, rel=1e-6)


@pytest.mark.usefixtures("linear", "pressed")
def test_a_range_that_is_missing_is_noted_before_the_friction():
    cover = make_cover(0.4, assumed=True)
    found = propagate_inputs(cover, WTS, TILTED, dataclasses.replace(INPUTS, friction=0.6))
    assert not found.known
    first, second = found.note.split("; friction ")
    assert first.startswith("the cover is assumed and no range is stated for the modulus of rubber: u_input")
    assert second.startswith("not propagated")


def test_a_simulated_image_holds_the_load_and_turns_with_the_array(bonded):
    """Opposite texels exchange their forces if the place is mirrored, and texels that are off have none."""
    cover = bonded(0.45)
    image = simulate_image(cover, WTS, BALL)
    assert image.sum() == pytest.approx(3.0, rel=0.01)
    turned = dataclasses.replace(BALL, pose=dataclasses.replace(BALL.pose, point=(-1e-3, 2e-3, 0.0)))
    assert simulate_image(cover, WTS, turned) == pytest.approx(image[::-1], abs=1e-6)
    active = WTS.active.copy()
    active[image.argmax()] = False
    off = simulate_image(cover, dataclasses.replace(WTS, active=active), BALL)
    assert off == pytest.approx(np.where(active, image, 0.0))
    assert image @ WTS.centres[:, :2] / 3.0 == pytest.approx((1e-3, -2e-3), abs=0.4e-3)


@pytest.mark.parametrize(
    ("fast", "here", "real"), [(4.3, False, False), (4.31, True, False), (5.3, True, False), (2.69, True, True)]
)
def test_an_error_is_resolved_above_its_uncertainty(fast, here, real):
    """u_num 0.3, u_val = sqrt(0.09 + 0.16 + 1.44) = 1.3 about a reference of 4; limits are open."""
    error = ComparisonError(
        case="", quantity="", factor=1.0, fast=fast, reference=4.0, u_num=0.3000000001, u_input=0.4,
        u_data=1.2000000001,
    )  # fmt: skip
    assert (error.resolved_here, error.resolved) == (here, real)
    assert (error.least_error, error.largest_error) == pytest.approx((fast - 6.6, fast - 1.4))
    exact = ComparisonError(case="", quantity="", factor=1.0, fast=5, reference=4, u_num=1.0, u_input=0.0, u_data=0.0)
    assert (exact.resolved_here, exact.resolved) == (False, False)


#: Contact points [m] and forces [N]; the second lies more than a pitch beyond the left and the lower edge.
POINTS, PUSHES = np.array([[1.1e-3, -2.3e-3], [-14.9e-3, -28.4e-3], [9.6e-3, 23.0e-3]]), np.array([2.0, 0.7, 0.3])


def spread_by_hand(points=POINTS, pushes=PUSHES):
    """Forces of cells of a quarter of the pitch, by the error functions of their made-up influence."""
    edge, half = WTS.pitch[0] / 4, WTS.texel_size[0] / 2
    low = WTS.centres[0, :2] - WTS.pitch[0] / 2
    middle = low + (np.floor((points - low) / edge) + 0.5) * edge
    apart = WTS.centres[:, None, :2] - middle
    along = 0.5 * (erf((half - apart) / (math.sqrt(2) * 1e-3)) + erf((half + apart) / (math.sqrt(2) * 1e-3)))
    return along.prod(axis=2) @ pushes


def make_found(texel_forces=None, outside=0.0):
    contact = np.column_stack([0.1 * PUSHES, 0.2 * PUSHES, -PUSHES])
    return SimpleNamespace(
        contact_points=np.column_stack([POINTS, np.full(3, 2e-3)]), contact_forces=contact,
        texel_forces=texel_forces, outside=outside,
    )  # fmt: skip


def test_contact_forces_reach_the_texels_by_the_tables():
    assert spread_contact(cells(), WTS, make_found(), 3.0) == pytest.approx(spread_by_hand(), abs=1e-6)


@pytest.mark.parametrize(("load", "factor"), [(0.0, 1.0), (1.0, 0.95), (2.0, 0.9), (5.0, 0.6), (6.0, 0.5), (9.0, 0.5)])
def test_tables_under_load_are_interpolated(load, factor):
    """0.9 of the influence at 2 N and 0.5 of it at 6 N."""
    plain = cells()
    stretched = dataclasses.replace(
        plain, loads=np.array([2.0, 6.0]), loaded_compliance=np.stack([plain.compliance] * 2),
        loaded_influence=np.stack([0.9 * plain.influence, 0.5 * plain.influence]),
    )  # fmt: skip
    assert spread_contact(stretched, WTS, make_found(), load) == pytest.approx(factor * spread_by_hand(), abs=1e-6)


def fill(*values):
    forces = np.zeros(84)
    forces[[15, 16, 21]] = values
    return forces


COUNTING = parameters(electronics=Electronics(rate_hz=100.0, sensitivity=10.0))


def make_result(found):
    reference = Reference(
        texel_forces=found.texel_forces, outside=found.outside, total_force=3.0, depth=1e-3, contact_area=1e-6,
        error_estimate={}, assumptions={}, warnings=(), found=found,
    )  # fmt: skip
    fast = fill(1.23, 0.84, 0.31)
    prediction = Prediction(
        texel_forces=fast, outside=0.4, score=score_forces(reference, fast, 0.4, 3.0, COUNTING),
    )  # fmt: skip
    case = dataclasses.replace(BALL, path=(1.0, 3.0))
    return CaseResult(case=case, reference=reference, warnings=(), predictions={"fast": prediction})


def test_each_stage_is_the_misplaced_force_between_two_images(monkeypatch):
    """Forces of the reference, of the linear cover, of the tables, of the fast model, and of its counts of 0.1 N."""
    linear, asked = make_found(fill(1.4, 0.9, 0.2), 0.25), []

    def press(cover, array, case):
        asked.append((cover.small_strain_only, array, case.path, case.load))
        return linear

    monkeypatch.setattr(stages, "press_reference", press)
    result = make_result(make_found(fill(1.5, 0.7, 0.1), 0.35))
    found = score_stages(make_cover(0.49), COUNTING, [result])
    assert asked == [(True, WTS, (), 3.0)]
    spread = spread_by_hand()
    fast, left = fill(1.23, 0.84, 0.31), 3.0 - spread.sum()
    # counts 12, 8, 3; the interval of the largest ends at 1.05 of the largest force
    counted = fill((1.15 + 1.25) / 2, 0.8, 0.3)
    assert found.cases["ball"] == pytest.approx({
        "cover": (0.1 + 0.2 + 0.1 + 0.1) / 6,
        "spread": (np.abs(spread - fill(1.4, 0.9, 0.2)).sum() + abs(left - 0.25)) / 6,
        "contact": (np.abs(spread - fast).sum() + abs(left - 0.4)) / 6,
        "electronics": np.abs(counted - fast).sum() / 6,
    }, abs=1e-4)  # fmt: skip
    assert found.pooled["cover"].mean == pytest.approx(0.5 / 6)
    assert found.note == "the reference of the stage cover is at small strain"
    alike = score_stages(make_cover(0.49, "linear-elastic"), COUNTING, [result])
    assert (alike.cases["ball"]["cover"], alike.note, len(asked)) == (0.0, "", 1)


def test_stages_need_tables_of_the_cover_for_a_regular_array():
    result, cover = make_result(make_found(fill(1.5, 0.7, 0.1))), make_cover(0.49, "linear-elastic")
    assert score_stages(cover, COUNTING, [result]) is not None
    assert score_stages(cover, parameters(surface=None), [result]) is None
    sides = dataclasses.replace(cells(), table=np.zeros((84, 56, 24)))
    assert score_stages(cover, parameters(surface=sides), [result]) is None


@pytest.mark.parametrize(
    ("options", "forces", "expected"),
    [
        # 10 counts per newton: 4 counts from 0.35 N to 0.45 N; the largest ends at 1.05 of 0.5 N
        ({}, (0.37, 0.04, 0.5), (0.4, 0.0, (0.45 + 0.525) / 2)),
        ({"offset": -2.0}, (0.37, 0.21, 0.8), (0.4, 0.0, (0.75 + 0.84) / 2)),
        ({"output_max": 6}, (0.37, 0.9, 2.0), (0.4, (0.55 + 2.1) / 2, (0.55 + 2.1) / 2)),
        ({"gains": (2.0, 0.5, 1.0)}, (0.37, 0.9, 2.0), (0.35, 0.8, (1.95 + 2.05) / 2)),
        ({}, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ],
)  # fmt: skip
def test_a_count_stands_for_the_middle_of_its_forces(options, forces, expected):
    given = SimpleNamespace(electronics=Electronics(**({"rate_hz": 100.0, "sensitivity": 10.0} | options)))
    found = count_back(given, np.array(forces))
    assert found == pytest.approx(expected, abs=3e-4)
