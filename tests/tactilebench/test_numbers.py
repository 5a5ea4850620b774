"""Scores of made-up cases worked out by hand: values, slack, floors, intervals, means, and units that are suspected."""

import importlib.util
import math

import numpy as np
import pytest

import tactilebench
from tactilebench import texel_metrics
from tactilebench.scoring import SCORES, list_scores
from tactilebench.wasserstein import wasserstein
from tests.tactilebench.test_case import make_case, slide

#: Ten texels: five columns 2 mm apart and two rows 3 mm apart.
X, Y = (each.ravel() for each in np.meshgrid([-4e-3, -2e-3, 0.0, 2e-3, 4e-3], [-1.5e-3, 1.5e-3]))
PLACES = np.stack([X, Y, 0 * X], axis=1)
#: The threshold of the area is 0.3 N: texels 0 and 4 may lie above or below it.
R = np.array([0.25, 3.0, 2.0, 1.0, 0.35, 0.0, 1.0, 0.5, 0.0, -0.1])
W = np.array([0.1, 0.2, 0.3, 0.1, 0.1, 0.0, 0.1, 0.05, 0.02, 0.03])
F = np.array([0.4, 2.6, 2.1, 0.5, 0.2, 0.1, 1.5, 0.4, -0.2, 0.0])


def make_known(r=R, w=W, wide=0.4, *, name="linear-000", tier="linear"):
    ball = tactilebench.Body(shape={"shape": "sphere", "radius": 5e-3}, at=(0.0, 0.0, 2e-3), load=10.0)
    case = make_case(
        name=name, tier=tier, bodies=(ball,), columns=5, centres=PLACES, normals=np.tile([0, 0, 1.0], (10, 1))
    )
    return case.with_truth(r, w, 2.0, wide, command="")


def moments(forces, places=PLACES):
    """Sum, centres along x and y, and variances about them."""
    total = sum(forces)
    centre = [sum(f * p for f, p in zip(forces, places[:, axis], strict=True)) / total for axis in (0, 1)]
    squares = [
        sum(f * (p - c) ** 2 for f, p in zip(forces, places[:, axis], strict=True)) / total
        for axis, c in enumerate(centre)
    ]
    return total, centre, squares


def work_out(r, f, w, outside, load):
    """Values and slack of every score but the Wasserstein distance; outside holds truth, given, and half width."""
    (big, c, v), (small, d, u) = moments(r), moments(f)
    rest = big - sum(w)
    far = [math.hypot(x - c[0], y - c[1]) for x, y in zip(X, Y, strict=True)]
    moved = sum(map(math.prod, zip(w, far, strict=True))) / rest
    values = {
        "misplaced_force": (sum(abs(a - b) for a, b in zip(r, f, strict=True)) + abs(outside[0] - outside[1]))
        / 2
        / load,
        "total_force_error": abs(big - small) / load,
        "peak_error": abs(max(f) - max(r)) / max(r),
        "centre_of_pressure_m": math.dist(c, d),
        "width_error_x_m": abs(math.sqrt(v[0]) - math.sqrt(u[0])),
        "width_error_y_m": abs(math.sqrt(v[1]) - math.sqrt(u[1])),
    }
    slack = {
        "misplaced_force": (sum(w) + outside[2]) / 2 / load,
        "total_force_error": sum(w) / load,
        "peak_error": max(max(a + b for a, b in zip(r, w, strict=True)) - max(r),
                          max(r) - max(a - b for a, b in zip(r, w, strict=True))) / max(r),
        "centre_of_pressure_m": moved,
        "wasserstein_m": moved + sum(w) / rest * sum(max(a, 0) * b for a, b in zip(r, far, strict=True)) / big,
    }  # fmt: skip
    for axis, places, centre, square in zip("xy", (X, Y), c, v, strict=True):
        change = sum(a * abs((p - centre) ** 2 - square) for a, p in zip(w, places, strict=True)) / rest + moved**2
        slack[f"width_error_{axis}_m"] = math.sqrt(square) - math.sqrt(max(square - change, 0))
    return values, slack


def test_values_and_slack_of_one_case_are_those_worked_out_by_hand():
    found = tactilebench.score_case(make_known(), F, outside=1.7)["scores"]
    values, slack = work_out(R, F, W, (2.0, 1.7, 0.4), 10.0)
    # Forces above 0.3 N: truth 1, 2, 3, 4, 6, 7; given 0, 1, 2, 3, 6, 7.  Truths surely above: 1, 2, 3, 6, 7, possibly
    # 0 and 4 too.
    values["active_area_iou"], slack["active_area_iou"] = 5 / 7, 1 - 5 / 7
    for name, value in values.items():
        most = 1.0 if name == "active_area_iou" else math.inf
        floor = 1 - slack[name] if name == "active_area_iou" else slack[name]
        expected = (value, max(value - slack[name], 0), min(value + slack[name], most), floor)
        assert tuple(found[name].values()) == pytest.approx(expected, rel=1e-9), name
    assert found["wasserstein_m"]["floor"] == pytest.approx(slack["wasserstein_m"], rel=1e-9)
    assert found["width_error_y_m"]["floor"] < 1.5e-3  # so that the square root is not of zero
    assert set(found) == set(SCORES)


def test_a_force_beyond_the_texels_that_is_not_stated_is_not_scored():
    found = tactilebench.score_case(make_known(), F)["scores"]["misplaced_force"]["value"]
    assert found == pytest.approx(np.abs(F - R).sum() / 20)
    for wrong in ([1.0, 2.0], math.nan, math.inf, 301.0, -301.0):
        with pytest.raises(tactilebench.BenchError, match="outside must be one number for each of 1 instants"):
            tactilebench.score_case(make_known(), F, outside=wrong)
    assert tactilebench.score_case(make_known(), F, outside=300.0)


def test_an_overlap_is_one_at_most_and_no_score_is_negative():
    """The true forces overlap wholly; texels 0 and 4 of seven may lie on either side of the threshold."""
    found = tactilebench.score_case(make_known(), R)["scores"]
    assert tuple(found["active_area_iou"].values()) == pytest.approx((1, 5 / 7, 1, 5 / 7))
    assert {each["low"] for name, each in found.items() if name != "active_area_iou"} == {0}
    assert min(each["high"] for each in found.values()) > 0


def test_the_score_of_a_motion_is_the_mean_over_its_instants():
    loads, frames, wide = (5.0, 10.0), np.array([R, 2 * R[::-1]]), np.array([W, 3 * W])
    case = make_case(motion=slide(*loads), columns=5, centres=PLACES, normals=np.tile([0, 0, 1.0], (10, 1)))
    given = np.array([F, F[::-1] + R])
    moving = case.with_truth(frames, wide, [1.0, 2.0], [0.1, 0.3], command="")
    found = tactilebench.score_case(moving, given, outside=[1.4, 2.6])["scores"]
    each = [
        work_out(r, f, w, outside, load)
        for r, f, w, outside, load in zip(
            frames, given, wide, [(1.0, 1.4, 0.1), (2.0, 2.6, 0.3)], loads, strict=True)
    ]  # fmt: skip
    for name in each[0][0]:
        assert found[name]["value"] == pytest.approx(np.mean([values[name] for values, _ in each]), rel=1e-9), name
        assert found[name]["floor"] == pytest.approx(np.mean([slack[name] for _, slack in each]), rel=1e-9), name
    by_rows = tactilebench.score_case(moving, given.reshape(2, 2, 5), outside=[1.4, 2.6])["scores"]
    assert by_rows == found


def test_what_is_not_defined_is_absent():
    """Without force there is no centre; a truth whose intervals reach zero force bounds no centre."""
    zero = tactilebench.score_case(make_known(), 0 * F)["scores"]
    for name in ("centre_of_pressure_m", "width_error_x_m", "width_error_y_m", "wasserstein_m"):
        assert set(zero[name].values()) == {None}, name
    assert zero["peak_error"]["value"] == 1
    r = np.array([0, 1.0, 3, 1, 0, 0, 1, 2, 0, 0])
    vague = tactilebench.score_case(make_known(r, r.copy()), r)["scores"]["centre_of_pressure_m"]
    assert (vague["value"], vague["low"], vague["high"], vague["floor"]) == (0, None, None, None)


def test_a_score_without_scipy_lacks_the_wasserstein_distance(monkeypatch):
    assert list_scores() == tuple(SCORES)
    whole = tactilebench.score_case(make_known(), F)["scores"]
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert list_scores() == tuple(SCORES)[:-1]
    assert tactilebench.score_case(make_known(), F)["scores"] == {name: whole[name] for name in list_scores()}


def make_many(count, tier="linear"):
    """Cases whose truth is uncertain by 0.01 (k + 1) of a newton on a texel, and forces that misplace 0.1 k of ten."""
    known, forces = [], {}
    for k in range(count):
        wide = np.zeros(10)
        wide[3] = 0.01 * (k + 1)
        known.append(make_known(w=wide, wide=0.0, name=f"{tier}-{k:03d}", tier=tier))
        shift = np.zeros(10)
        shift[[1, 2]] = 0.1 * k, -0.1 * k
        forces[known[-1].name] = R + shift
    return known, forces


@pytest.mark.parametrize("count", [1, 2, 7])
def test_the_interval_of_a_mean_is_a_bootstrap_of_2000_samples_of_the_cases_widened_by_the_mean_slack(count):
    known, forces = make_many(count)
    found = tactilebench.score(forces, known)["overall"]
    values, slack = 0.01 * np.arange(count), np.mean(0.01 * (np.arange(count) + 1)) / 20
    chosen = np.random.default_rng(1).multinomial(count, [1 / count] * count, size=2000)
    low, high = np.percentile(chosen @ values / count, [2.5, 97.5])
    assert found["cases"] == count
    expected = (values.mean(), max(low - slack, 0), high + slack, slack)
    assert tuple(found["misplaced_force"].values()) == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_a_case_whose_score_is_not_defined_counts_in_no_mean():
    known, forces = make_many(3)
    forces["linear-001"] = 0 * R
    result = tactilebench.score(forces, known)
    rows = [each["scores"]["centre_of_pressure_m"] for each in result["cases"]]
    found = result["overall"]["centre_of_pressure_m"]
    assert rows[1]["value"] is None
    for key in ("value", "floor"):
        assert found[key] == pytest.approx((rows[0][key] + rows[2][key]) / 2)
    assert found["low"] == pytest.approx(max(rows[0]["value"] - found["floor"], 0))  # at times the first case alone
    assert found["high"] == pytest.approx(rows[2]["value"] + found["floor"])
    assert tactilebench.score({"linear-000": 0 * R}, known[:1])["overall"]["centre_of_pressure_m"]["value"] is None


def test_tiers_are_averaged_apart_and_together():
    linear, first = make_many(3)
    foils, second = make_many(2, "foil")
    result = tactilebench.score(first | {name: 0.9 * each for name, each in second.items()}, [*linear, *foils])
    assert list(result["tiers"]) == ["linear", "foil"]
    means = {name: each["total_force_error"]["value"] for name, each in result["tiers"].items()}
    assert means == pytest.approx({"linear": 0, "foil": 0.1 * R.sum() / 10}, abs=1e-12)
    assert result["overall"]["total_force_error"]["value"] == pytest.approx(0.4 * means["foil"])
    assert [result["tiers"][name]["cases"] for name in result["tiers"]] == [3, 2]
    assert result["truth"] == {case.name: case.truth.digest for case in [*linear, *foils]}


#: Factor from newtons and the factor about it that raises suspicion, by what is suspected.
SUSPECTED = {
    "in uN": (1e6, 3), "in mN": (1e3, 3), "in kN": (1e-3, 3), "in gf": (1e3 / 9.80665, 3),
    "in kgf": (1 / 9.80665, 1.1), "negative under pressure": (-1.0, 30),
}  # fmt: skip


@pytest.mark.parametrize("fault", SUSPECTED)
def test_another_unit_is_suspected_within_a_factor_about_it(fault):
    (factor, wide), (known, forces) = SUSPECTED[fault], make_many(1)
    for share, found in ((0.99 * wide, True), (1.01 / wide, True), (1.01 * wide, False), (0.99 / wide, False)):
        given = {name: share * factor * each for name, each in forces.items()}
        try:
            tactilebench.score(given, known)
            said = ""
        except tactilebench.BenchError as error:
            said = str(error)
        assert (f"as if {fault}" in said) == found, (share, said)


@pytest.mark.parametrize(("factor", "refused"), [(29.0, False), (31.0, True)])
def test_forces_of_no_sense_are_refused_from_thirty_times_the_true_ones_on(factor, refused):
    known, forces = make_many(1)
    if refused:
        with pytest.raises(tactilebench.BenchError, match=r"31 times the true ones; give newtons"):
            tactilebench.score({name: factor * each for name, each in forces.items()}, known)
    else:
        assert tactilebench.score({name: factor * each for name, each in forces.items()}, known)


@pytest.mark.parametrize(
    ("wrong", "factor", "said"),
    [
        (0, 1e3, ""), (4, 1e3, "the forces are 1000 times the true ones, as if in mN"),
        (1, 1e3, "linear-000: texel 1 has 3000 N, 30 times the load and more; give newtons"), (3, 1e-3, ""),
        (4, 1e-3, "the forces are 0.001 times the true ones, as if in kN"),
    ],
)  # fmt: skip
def test_a_unit_is_suspected_in_the_middle_half_of_the_cases_and_from_thirty_loads_on(wrong, factor, said):
    known, forces = make_many(5)
    given = {name: each * (factor if k < wrong else 1) for k, (name, each) in enumerate(forces.items())}
    if not said:
        assert tactilebench.score(given, known)["overall"]["cases"] == 5
        return
    with pytest.raises(tactilebench.BenchError, match=said):
        tactilebench.score(given, known)


@pytest.mark.parametrize("value", [1.1e9, -1.1e9, math.nan, math.inf, 301.0, -301.0])
def test_a_force_beyond_all_sense_is_named_with_its_place(value):
    known, forces = make_many(5)
    given = {name: each.copy() for name, each in forces.items()}
    given["linear-002"][4] = value
    with pytest.raises(tactilebench.BenchError, match="linear-002: texel 4 has "):
        tactilebench.score(given, known)
    given["linear-002"][4] = 299.0
    assert tactilebench.score(given, known)


@pytest.mark.parametrize("shape", [(9,), (5, 2), (1, 10), (2, 2, 5)])
def test_forces_of_another_shape_are_refused(shape):
    with pytest.raises(tactilebench.BenchError, match=r"linear-000: forces of shape .*; expected \(10,\) or \(2, 5\)"):
        tactilebench.score_case(make_known(), np.ones(shape))
    assert tactilebench.score_case(make_known(), F.reshape(2, 5)) == tactilebench.score_case(make_known(), F)


def test_missing_cases_are_counted():
    known, forces = make_many(5)
    del forces["linear-003"], forces["linear-001"]
    with pytest.raises(tactilebench.BenchError, match="2 of 5 cases are missing, for example linear-001"):
        tactilebench.score(forces, known)


def test_the_metrics_of_forces_are_those_worked_out_by_hand():
    given = {"load": 4.0}
    assert texel_metrics.total_force_error(np.array([1.0, 2.0]), np.array([0.5, 1.0]), **given) == 1.5 / 4
    assert texel_metrics.misplaced_force(
        np.array([1.0, 2.0]), np.array([2.0, 0.5]), reference_outside=0.5, outside=1.25, **given
    ) == (1 + 1.5 + 0.75) / 8  # fmt: skip
    assert texel_metrics.peak_error(np.array([1.0, 2.0]), np.array([3.0, 0.5])) == 0.5
    for none in ([0.0, 0.0], [-1.0, 0.0], [-2.0, -1.0]):
        assert math.isnan(texel_metrics.peak_error(np.array(none), np.ones(2)))
    places = np.array([[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 3.0, 2.0]])
    assert texel_metrics.centre_of_pressure(np.array([1.0, 1.0, 2.0]), places) == pytest.approx([1.0, 1.5, 1.5])
    assert texel_metrics.second_moments(np.array([1.0, 1.0, 2.0]), places) == pytest.approx((math.sqrt(3), 1.5))
    assert texel_metrics.centre_of_pressure_error(np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), places) == 4
    for none in (np.zeros(3), np.array([-1.0, 0, 0]), np.array([1.0, -2.0, 1.0])):
        assert np.isnan(texel_metrics.centre_of_pressure(none, places)).tolist() == [True] * 3
        assert all(map(math.isnan, texel_metrics.second_moments(none, places)))
    assert texel_metrics.second_moments(np.array([3.0, -1.0, -1.0]), places)[0] == 0  # its square would be negative


@pytest.mark.parametrize(
    ("reference", "forces", "expected"),
    [([0.5, 2, 2], [2, 2, 0.5], 1 / 3), ([1, 0, 0], [1, 0, 0], 1),
     ([1, 1, 2], [0, 1, 1], 0), ([2, 0, 0], [0, 2, 2], 0)],
)  # fmt: skip
def test_the_overlap_of_areas_is_their_intersection_over_their_union(reference, forces, expected):
    """A force equal to the threshold lies below it; two empty areas overlap wholly."""
    found = texel_metrics.active_area_iou(np.array(reference, float), np.array(forces, float), threshold=1.0)
    assert found == pytest.approx(expected)


@pytest.mark.parametrize(
    ("reference", "forces", "expected"),
    [
        ([1, 0, 0], [0, 2, 0], 4.0),  # all of it 4 to the right
        ([1, 1, 0], [2, 0, 2], 2.5),  # half of it from the second place to the third, 5 apart
        ([1, -1, 0], [1, 0, -3], 0.0),  # pulls are no mass
        ([3, 1, 0], [2, 2, 0], 1.0),  # a quarter of it 4 to the right
        ([0, 0, -1], [1, 0, 0], math.nan), ([1, 0, 0], [0, 0, 0], math.nan),
    ],
)  # fmt: skip
def test_the_wasserstein_distance_is_mass_times_way(reference, forces, expected):
    places = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])
    found = wasserstein(np.array(reference, float), np.array(forces, float), places)
    assert found == pytest.approx(expected, nan_ok=True)
