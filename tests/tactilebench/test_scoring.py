"""Scores of tactilebench: those of softcover, bounds by the truth's own error, and the rank of nulls and cheats."""

import collections
import itertools
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tactilebench
from meshes import TexelArray
from tactilebench.draw import draw
from tactilebench.scoring import SCORES
from tactilebench.texel_metrics import check_load
from tests.support.score_schema import check_scores
from validation import metrics

PACKAGE = Path(tactilebench.__file__).parent


@pytest.fixture(scope="module")
def known():
    return [case for case in tactilebench.cases() if case.tier in {"linear", "moving"}][::9]


def spread(case, forces):
    """Average each texel with its neighbours along rows and columns."""
    image = forces.reshape(-1, case.rows, case.columns)
    wide = np.pad(image, ((0, 0), (1, 1), (1, 1)), mode="edge")
    parts = [wide[:, 1:-1, 1:-1], wide[:, :-2, 1:-1], wide[:, 2:, 1:-1], wide[:, 1:-1, :-2], wide[:, 1:-1, 2:]]
    return np.mean(parts, axis=0).reshape(forces.shape)


def nearest(case):
    at = np.array([case.bodies[0].at] if case.motion is None else case.motion.at)
    forces = np.zeros((len(at), len(case.centres)))
    apart = np.linalg.norm(case.centres[None, :, :2] - at[:, None, :2], axis=2)
    forces[np.arange(len(at)), apart.argmin(axis=1)] = case.loads
    return forces.reshape(case.shape)


def mirror(case, forces):
    return forces.reshape(-1, case.rows, case.columns)[:, ::-1, ::-1].reshape(forces.shape)


def take_from(case, truths):
    """The forces of the next case with an image of the same shape, scaled to the load."""
    same = [each for each in truths if each.shape == case.shape and each.name != case.name]
    return same[0].truth.forces * case.load / same[0].load if same else np.zeros(case.shape)


@pytest.mark.slow
def test_nulls_and_cheats_rank_as_they_must(known):
    models = {
        "perfect": lambda case: case.truth.forces,
        "scaled": lambda case: 0.95 * case.truth.forces,
        "blurred": lambda case: spread(case, case.truth.forces),
        "nearest": nearest,
        "mirrored": lambda case: mirror(case, case.truth.forces),
        "zeros": lambda case: np.zeros(case.shape),
        "uniform": lambda case: np.full(case.shape, case.load / case.shape[-1]),
        "another": lambda case: take_from(case, known),
    }
    found = {
        name: tactilebench.score({case.name: model(case) for case in known}, known)["overall"]
        for name, model in models.items()
    }
    misplaced = {name: each["misplaced_force"] for name, each in found.items()}
    assert misplaced["perfect"]["value"] == 0
    assert misplaced["perfect"]["high"] == misplaced["perfect"]["floor"]
    assert 0 < misplaced["perfect"]["floor"] < 0.003
    ranks = ["perfect", "scaled", "blurred", "mirrored"]
    assert all(misplaced[a]["value"] < misplaced[b]["value"] for a, b in itertools.pairwise(ranks))
    for name in set(models) - {"perfect"}:
        assert misplaced[name]["low"] > misplaced[name]["floor"], name
    for name in ("nearest", "uniform", "another"):
        assert misplaced[name]["value"] > 0.3, name
    # Half of what the array bears is missing from its texels: half of the sum of true forces over the load.
    shares = [np.mean(case.truth.forces.sum(axis=-1) / np.array(case.loads)) for case in known]
    assert misplaced["zeros"]["value"] == pytest.approx(np.mean(shares) / 2, rel=0.02)
    assert found["scaled"]["total_force_error"]["value"] == pytest.approx(0.05 * np.mean(shares), rel=0.01)
    assert found["scaled"]["centre_of_pressure_m"]["value"] == pytest.approx(0, abs=1e-12)
    assert found["zeros"]["centre_of_pressure_m"]["value"] is None


def test_scores_equal_those_of_softcover(known):
    rng = np.random.default_rng(3)
    for case in [each for each in known if each.motion is None][::3]:
        forces = case.truth.forces * rng.uniform(0.7, 1.3, case.shape)
        beyond = 1.1 * float(case.truth.outside)
        array = TexelArray.grid(case.rows, case.columns, pitch=case.pitch[0])
        array = replace(array, centres=case.centres)
        ours = tactilebench.score_case(case, forces, outside=beyond)["scores"]
        theirs = metrics.score(
            case.truth.forces, forces, reference_outside=float(case.truth.outside), outside=beyond, load=case.load,
            array=array,
        )  # fmt: skip
        assert set(ours) == set(SCORES)
        for name, each in ours.items():
            assert each["value"] == pytest.approx(getattr(theirs, name), rel=1e-12, abs=1e-15), name


def test_no_truth_within_the_intervals_scores_beyond_the_interval_of_a_score(known):
    rng = np.random.default_rng(5)
    for first in [each for each in known if each.motion is None][::5]:
        wide = first.truth.half_width + 0.02 * np.abs(first.truth.forces)
        case = first.with_truth(first.truth.forces, wide, first.truth.outside, 0.1 * first.truth.outside, command="")
        forces = spread(case, case.truth.forces)
        beyond = float(case.truth.outside)
        found = tactilebench.score_case(case, forces, outside=beyond)["scores"]
        for _ in range(8):
            corner = rng.choice([-1.0, 1.0], case.shape) * rng.uniform(0.9, 1.0)
            moved = case.truth.forces + corner * wide
            other = case.with_truth(moved, 0 * wide, 1.1 * case.truth.outside, 0 * case.truth.outside, command="")
            again = tactilebench.score_case(other, forces, outside=beyond)["scores"]
            for name in set(SCORES) - {"active_area_iou"}:  # whose threshold is that of the stored truth
                low, value, high = found[name]["low"], again[name]["value"], found[name]["high"]
                assert low - 1e-12 <= value <= high + 1e-12, (case.name, name)


def test_forces_that_are_no_whole_arrays_of_numbers_are_refused(known):
    forces = {case.name: nearest(case) for case in known}
    first, moving = known[0], next(case for case in known if case.motion)
    gap = forces[moving.name].copy()
    gap[2, 5] = np.nan
    wrong = {
        "no array": {first.name: [[1.0], [1.0, 2.0]]},
        "real numbers": {first.name: np.ma.masked_less(forces[first.name], 1e-9)},
        "not object": {first.name: None},
        "instant 2, texel 5 has nan N": {moving.name: gap},
    }
    for words, change in wrong.items():
        with pytest.raises(tactilebench.BenchError, match=words):
            tactilebench.score(forces | change, known)
    with pytest.raises(tactilebench.BenchError, match="'linear-999' is unknown"):
        tactilebench.score(forces, known, outside={"linear-999": 1.0})
    with pytest.raises(tactilebench.BenchError, match="no case is known"):
        tactilebench.score({}, [])


def test_files_of_scores_fit_the_schema(known):
    result = tactilebench.score({case.name: nearest(case) for case in known}, known)
    check_scores(json.loads(json.dumps(result, allow_nan=False)))


@pytest.mark.slow
def test_the_code_of_the_readme_runs():
    text = (PACKAGE.parent / "README.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        exec(block, {})  # noqa: S102 -- ours
    assert f"holds {len(tactilebench.cases())} cases" in text


def test_fresh_cases_are_other_cases_and_the_same_each_time():
    fresh, again = tactilebench.cases(seed=7), tactilebench.cases(seed=7)
    assert [case.as_json() for case in fresh] == [case.as_json() for case in again]
    shipped = {json.dumps([case.as_json()["bodies"], case.as_json()["cover"]]) for case in tactilebench.cases()}
    assert not shipped & {json.dumps([case.as_json()["bodies"], case.as_json()["cover"]]) for case in fresh}
    with pytest.raises(tactilebench.BenchError, match="unknown"):
        tactilebench.score({case.name: np.zeros(case.shape) for case in fresh})
    with pytest.raises(tactilebench.BenchError, match="seed"):
        tactilebench.cases(seed=-1)
    with pytest.raises(tactilebench.BenchError, match=r"2031\.1"):
        tactilebench.cases("2031.1")


def test_every_tier_has_the_cases_that_its_page_states():
    counts = collections.Counter(case.tier for case in draw("2026.1", seed=5))
    assert counts == {
        "linear": 150, "layered": 84, "finite_strain": 42, "foil": 32, "friction": 42, "two_bodies": 42, "curved": 42,
        "moving": 32,
    }  # fmt: skip


def test_the_interval_of_a_mean_overlap_is_that_of_the_cases_widened_by_what_the_floor_lacks_to_one():
    """One case alone has no bootstrap: its overlap plus and minus one minus the floor, between 0 and 1."""
    (case,) = [each for each in tactilebench.cases() if each.name == "linear-003"]
    forces = np.roll(case.truth.forces, 1)
    alone = tactilebench.score_case(case, forces)["scores"]["active_area_iou"]
    mean = tactilebench.score({case.name: forces}, known=[case])["overall"]["active_area_iou"]
    assert mean["value"] == alone["value"]
    assert mean["low"] == pytest.approx(max(alone["value"] - (1 - alone["floor"]), 0.0))
    assert mean["high"] == pytest.approx(min(alone["value"] + (1 - alone["floor"]), 1.0))


@pytest.mark.parametrize("load", [0.0, -1.0, math.nan, math.inf])
def test_a_load_that_is_not_positive_is_refused(load):
    with pytest.raises(ValueError, match="the load must be positive"):
        check_load(load)
