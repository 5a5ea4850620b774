"""Checks of the solvers: what they compare, on which grids, and how their errors follow from the solutions."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from fem_reference.closed_form.layer import point_response, transfer
from fem_reference.linear_response.surface_compliance import solve_waves
from meshes import Cylinder, Sphere, TexelArray
from tests.support.rubber import make_cover, make_rubber
from validation.campaign.case import Case
from validation.campaign.results import CaseResult, Reference
from validation.credibility import verification
from validation.credibility.verification import (
    Check,
    check_bonded_disk,
    check_contact,
    check_finer_mesh,
    check_point_load,
    check_shell,
    check_surface_compliance,
    compress_disk,
    observe_order,
    verify_code,
)

COVER = make_cover(0.45, "linear-elastic", thickness=1.5e-3)
ARRAY = TexelArray.grid(3, 4, (2e-3, 3e-3))


@pytest.mark.parametrize(
    ("errors", "options", "passed"),
    [
        ((0.04, 0.02, 0.01), {"tolerance": 0.01}, True),  # the order is the least one
        ((0.04, 0.02, 0.01), {"tolerance": 0.00999}, False),
        ((0.04, 0.02, 0.01), {"tolerance": 0.01, "least_order": 1.001}, False),
        ((0.009, 0.0099, 0.009), {"tolerance": 0.01}, True),
        ((0.009, 0.01, 0.009), {"tolerance": 0.01}, False),  # not below the tolerance on every grid
        ((0.009, 0.0, 0.009), {"tolerance": 0.01}, True),
        ((0.02, 0.0, 0.0), {"tolerance": 0.01}, False),
    ],
)
def test_a_check_passes_at_its_borders(errors, options, passed):
    check = Check(
        name="", exact="", sizes=(1.0, 0.5, 0.25), errors=errors, result=errors[-1], **({"least_order": 1.0} | options)
    )
    if errors == (0.04, 0.02, 0.01):
        assert check.order == pytest.approx(1.0, abs=1e-12)
        check = dataclasses.replace(check, least_order=check.least_order - 1e-9)
    assert check.passed is passed


def test_waves_of_a_fifth_to_four_per_thickness_are_compared_on_4_8_and_16_elements():
    check = check_surface_compliance(COVER)
    waves = np.exp(np.linspace(math.log(0.2), math.log(4.0), 25)) / 1.5e-3
    exact = transfer(COVER, waves).compliance

    def measure(**options):
        return np.abs(solve_waves(COVER, waves, **options).compliance / exact - 1).max()

    assert check.errors == pytest.approx([measure(elements_per_layer=count) for count in (4, 8, 16)])
    assert check.result == pytest.approx(measure())
    assert check.sizes == pytest.approx((1.0, 1 / 2, 1 / 4))
    assert (check.least_order, check.tolerance, check.passed) == (2.0, 1e-3, True)


def test_the_pressure_under_a_point_load_is_compared_up_to_six_thicknesses(wts_derivation):
    cover, spread = wts_derivation.sensor.cover, wts_derivation.point_spread
    check = check_point_load(cover)
    radius = 6 * cover.thickness * np.arange(200) / 199
    exact = point_response(cover, radius)
    errors = [np.abs(each.pressure(radius) - exact).max() / exact.max() for each in (*spread.coarse, spread)]
    assert check.errors == pytest.approx(errors)
    assert check.result == check.errors[-1]
    assert check.sizes == pytest.approx(np.array(spread.sizes) / spread.sizes[0])
    assert (check.least_order, check.tolerance) == (1.0, 5e-3)


def test_a_bonded_disk_has_the_stiffness_of_the_series():
    """Force over area, strain and three shear moduli is 2.9551965 at a radius of four half heights."""
    check = check_bonded_disk()
    stiffness = [compress_disk(4.0, count) / (16 * math.pi) / 3 for count in (4, 6, 9)]
    assert check.errors == pytest.approx([abs(each / 2.9551965 - 1) for each in stiffness], rel=1e-3)
    assert max(check.errors) < 0.004
    assert check.errors[0] > check.errors[1] > check.errors[2] == check.result
    assert check.sizes == pytest.approx((1.0, 4 / 6, 4 / 9))
    assert (check.least_order, check.tolerance, check.passed) == (0.7, 1e-2, True)
    # a disk as flat as its elements has two of them along its radius, and feels both plates
    assert compress_disk(0.4, 2) / (0.16 * math.pi) == pytest.approx(3.0, rel=0.1)


SIZES = (0.4, 0.3, 0.2)
#: Total force of each grid, and force of texel 5 [N].
FORCES, TEXEL = (2.1, 2.04, 2.02), (0.55, 0.52, 0.51)


@pytest.fixture
def contact(monkeypatch):
    """Solutions of contacts by numbers that are given; returns what was asked for."""
    asked, refused = [], []

    def indent(cover, indenter, *, depth):
        if indenter in refused:
            raise ValueError("tension")
        asked.append((indenter, depth))
        texels = np.zeros(ARRAY.count)
        texels[[2, 5]] = 0.3, 0.5

        def texel_forces(array, at):
            asked.append((array, at))
            return texels

        return SimpleNamespace(force=2.0, texel_forces=texel_forces)

    def study_path(path, place, progress):
        asked.append((path.indenter, path.targets, path.control, place.pose.at, progress))

        def make(k):
            forces = np.full(ARRAY.count, 9.0)
            forces[5] = TEXEL[k]
            base = SimpleNamespace(forces=lambda _array, _pose: forces)
            return SimpleNamespace(size=SIZES[k], total_force=FORCES[k], base=base)

        grids = [make(k) for k in range(3)]
        return SimpleNamespace(solutions=[grids], combine=lambda grids, of: 2 * of(grids[2]) - of(grids[1]))

    monkeypatch.setattr("fem_reference.closed_form.contact.indent", indent)
    monkeypatch.setattr("fem_reference.indentation.small_strain.study_path", study_path)
    return asked, refused


def test_contacts_of_a_cylinder_and_a_ball_are_compared_by_force_and_largest_texel_force(contact):
    asked, _ = contact
    checks = check_contact(COVER, ARRAY)
    assert [each.name.split(",")[0] for each in checks] == [
        f"{what} under a {body} at 5 % of the thickness"
        for body in ("flat cylinder", "ball")
        for what in ("force", "largest texel force")
    ]
    cylinder, ball, at = Cylinder(radius=1.5e-3), Sphere(radius=3e-3), pytest.approx((0.42e-3, -0.96e-3))
    assert asked[0] == (cylinder, pytest.approx(75e-6))
    assert asked[1] == (ARRAY, at)
    assert asked[2] == (cylinder, (pytest.approx(75e-6),), "depth", at, None)
    assert (asked[3][0], asked[5][0]) == (ball, ball)
    for check, exact, values, order in (
        (checks[0], 2.0, FORCES, 0.7), (checks[1], 0.5, TEXEL, 0.7), (checks[3], 0.5, TEXEL, 1.0),
    ):  # fmt: skip
        assert check.sizes == pytest.approx((1.0, 0.75, 0.5))
        assert check.errors == pytest.approx([each / exact - 1 for each in values])
        assert check.result == pytest.approx(abs((2 * values[2] - values[1]) / exact - 1), abs=1e-12)
        assert (check.least_order, check.tolerance) == (order, 3e-3)


def test_a_contact_that_needs_tension_is_left_out(contact):
    _, refused = contact
    refused.append(Cylinder(radius=1.5e-3))
    assert [each.name.split(",")[0] for each in check_contact(COVER, ARRAY)] == [
        "force under a ball at 5 % of the thickness", "largest texel force under a ball at 5 % of the thickness",
    ]  # fmt: skip


@pytest.mark.usefixtures("contact")
def test_all_checks_are_made_in_their_order(wts_derivation):
    checks = verify_code(wts_derivation.sensor.cover, ARRAY)
    assert [each.name.split()[0] for each in checks] == [
        "compliance", "pressure", "force", "largest", "force", "largest", "stiffness",
    ]  # fmt: skip


def test_a_shell_is_near_its_closed_form_on_a_coarse_mesh(monkeypatch):
    monkeypatch.setattr(verification, "_SHELL_MESHES", ((1.2, 2),))
    check = check_shell(make_rubber(0.4, "linear-elastic"), 2e-3)
    assert check.errors == pytest.approx((0.042,), rel=0.05)
    assert (check.sizes, check.result) == ((1.0,), check.errors[0])
    assert (check.least_order, check.tolerance) == (1.0, 5e-3)


def make_result(name, shape, area, peak=0.031):
    reference = Reference(
        texel_forces=np.ones(9), total_force=1.0, depth=1e-3, contact_area=area, error_estimate={"peak_texel": peak},
        assumptions={}, warnings=(),
    )  # fmt: skip
    return CaseResult(case=Case.read(name, shape, "2 N"), reference=reference, warnings=(), predictions={})


RESULTS = (
    make_result("large ball", "sphere:radius=9mm", 5e-6), make_result("small ball", "sphere:radius=3mm", 3e-6),
    make_result("small box", "box:size=2mmx3mmx4mm", 6e-6, -0.01), make_result("big box", "box:size=3mmx3mmx4mm", 9e-6),
)  # fmt: skip


def test_the_smallest_round_and_the_smallest_other_contact_are_pressed_on_a_finer_mesh(small_pad, monkeypatch):
    """Forces on the finer mesh are 1, 2, ... 9 N; on the others one texel differs by 0.36 N and another by 0.18 N."""
    from meshes.solids import flat_pad

    pad = flat_pad(size=(9e-3, 9e-3), rows=3, pitch=3e-3)
    coarse, middle, fine = (pad.mesh(size, layers=2) for size in (4.5e-3, 3e-3, 2e-3))
    given, asked = {}, []

    def press(cover, array, case, *, friction):
        count = len(cover.meshes()[0].cells)
        asked.append((case.name, count, friction))
        forces = np.arange(1.0, 10.0)
        forces[4] -= {len(coarse.cells): 0.36, len(middle.cells): -0.18}.get(count, 0.0)
        return SimpleNamespace(texel_forces=forces)

    def refine(thicknesses):
        given["thicknesses"] = thicknesses
        return fine

    monkeypatch.setattr(verification, "press_reference", press)
    cover = dataclasses.replace(small_pad.cover, refine=refine)
    ball, box = check_finer_mesh(cover, small_pad.array, (coarse, middle), RESULTS, 0.3)
    assert [name for name, *_ in asked] == ["small ball"] * 3 + ["small box"] * 3
    assert [count for _, count, _ in asked[:3]] == [len(each.cells) for each in (fine, coarse, middle)]
    assert {friction for *_, friction in asked} == {0.3}
    assert given["thicknesses"] == cover.thicknesses
    assert ball.errors == pytest.approx((0.04, 0.02))
    assert ball.result == pytest.approx(0.02)
    assert ball.sizes == pytest.approx((1.0, (len(coarse.cells) / len(middle.cells)) ** (1 / 3)))
    assert (ball.least_order, ball.tolerance, box.tolerance) == (0.7, 0.031, 0.0)
    assert "“small ball”" in ball.name
    assert f"{len(fine.cells)} elements" in ball.exact
    assert [
        each.name.split("“")[1][:9] for each in check_finer_mesh(cover, ARRAY, (coarse, fine), RESULTS[2:], 0.0)
    ] == ["small box"]
    assert check_finer_mesh(cover, small_pad.array, (coarse,), RESULTS, 0.0) == []
    with pytest.raises(ValueError, match="there is none"):
        check_finer_mesh(small_pad.cover, small_pad.array, (coarse, middle), RESULTS, 0.0)


@pytest.mark.parametrize("sizes", [(4.0, 2.0, 1.0), (0.3, 0.2, 0.15)])
@pytest.mark.parametrize("order", [0.3, 1.7, 4.0])
def test_the_order_of_three_values_is_found_at_any_ratio_of_sizes(sizes, order):
    assert observe_order([5.0 - 0.2 * size**order for size in sizes], sizes) == pytest.approx(order, rel=1e-6)
