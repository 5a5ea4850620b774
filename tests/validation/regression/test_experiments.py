"""Experiments of the regression check on sensors and campaigns whose readings follow from formulas."""

import dataclasses
import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from fastmodel import WTS_0614_34, Gaussian, Parameters
from meshes import TexelArray
from tests.support.made_up_evaluation import CASES, make_case
from validation.campaign.run import summarise
from validation.regression.experiments import measure_spread
from validation.regression.quantities import measure_accuracy
from validation.regression.reading import Subject

#: Standard deviations of a point spread along x and y [pitches].
SIGMAS = (0.7, 0.45)


def weigh(offset, sigma):
    """Weight of a kernel of five texels along one axis."""
    weights = np.exp(-(np.arange(-2, 3) ** 2) / (2 * sigma**2))
    return weights[offset + 2] / weights.sum() if abs(offset) <= 2 else 0.0


@pytest.mark.parametrize(("rows", "columns"), [(3, 3), (2, 2), (1, 4), (5, 1), (4, 7)])
def test_the_spread_is_read_on_the_middle_texel_and_on_its_neighbours_inside_the_array(rows, columns):
    spread = Gaussian(sigma_x=SIGMAS[0], sigma_y=SIGMAS[1], ksize_x=5, ksize_y=5)
    array = TexelArray.grid(rows, columns, (3e-3, 4e-3), name="pad")
    found = measure_spread(Subject(parameters=Parameters(array=array, spread=spread, electronics=WTS_0614_34)))
    along_x, along_y, names = columns > 1, rows > 1, ("loaded texel", "next along x", "next along y", "next across")
    offsets = dict(zip(names, ((0, 0), (1, 0), (0, 1), (1, 1)), strict=True))
    expected = {
        f"on the {name}": 100 * weigh(i, SIGMAS[0]) * weigh(j, SIGMAS[1])
        for name, (i, j) in offsets.items()
        if along_x >= i and along_y >= j
    }
    assert {name: share for name, (share,) in found["share"].numbers.items()} == pytest.approx(expected, abs=1e-3)

    def lose(row, column):
        """Share of a force on a texel that lies on no texel of the array [%]."""
        places = itertools.product(range(rows), range(columns))
        return 100 - 100 * sum(weigh(j - column, SIGMAS[0]) * weigh(i - row, SIGMAS[1]) for i, j in places)

    assert {name: share for name, (share,) in found["share outside"].numbers.items()} == pytest.approx(
        {"of the middle texel": lose(rows // 2, columns // 2), "of the last texel": lose(rows - 1, columns - 1)},
        abs=1e-3,
    )
    assert found["foundation modulus"] is None


def test_the_scores_of_the_fast_model_are_read_in_all_cases_that_have_them_in_the_units_of_the_metrics():
    results = [make_case(number, case) for number, case in enumerate(CASES)]
    fast = results[0].predictions["fast"]
    blank = dataclasses.replace(fast, score=dataclasses.replace(fast.score, centre_of_pressure_m=np.nan))
    results[0] = dataclasses.replace(results[0], predictions={**results[0].predictions, "fast": blank})
    found = measure_accuracy(SimpleNamespace(campaign=summarise(results, (), None)))
    for metric, unit, factor in (
        ("misplaced_force", "%", 100), ("relative_l2", "%", 100), ("centre_of_pressure_m", "mm", 1e3)
    ):  # fmt: skip
        scores = {each.case.name: factor * getattr(each.predictions["fast"].score, metric) for each in results}
        assert found[metric].unit == unit
        assert {case: score for case, (score,) in found[metric].numbers.items()} == pytest.approx(
            {case: score for case, score in scores.items() if np.isfinite(score)}, rel=1e-3
        )
    assert {metric: found[metric].tolerance for metric in found if not found[metric].relative} == {
        "misplaced_force": 0.05, "relative_l2": 0.1, "total_force_error": 0.02, "centre_of_pressure_m": 0.002,
        "image_changed_percent": 0.02, "skipped cases": 0.5,
    }  # fmt: skip
    means = found["mean misplaced force of each method"].numbers
    for model, (mean,) in means.items():
        scores = [each.predictions[model].score.misplaced_force for each in results]
        assert mean == pytest.approx(100 * np.mean(scores), rel=1e-3)
    assert {"fast", "foundation"} <= set(means)
    assert found["skipped cases"].numbers == {"": (0.0,)}
