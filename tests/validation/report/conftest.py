"""Evaluations of two cases and their reports, for all tests that only read them: made-up ones, and solved ones."""

import pytest

from tests.support.coarse_cells import rough_cells
from tests.support.compute_once import compute_once
from tests.support.made_up_evaluation import CASES, make_evaluation
from validation.campaign.evaluation import evaluate
from validation.report import write_report
from validation.sensor_file import load


@pytest.fixture(scope="session")
def evaluation(wts_derivation):
    return make_evaluation(wts_derivation)


@pytest.fixture(scope="session")
def folder(evaluation, tmp_path_factory):
    target = tmp_path_factory.mktemp("report")
    write_report(evaluation, target)
    return target


@pytest.fixture(scope="session")
def solved(wts_derivation):
    with rough_cells(), pytest.MonkeyPatch.context() as patch:
        patch.setattr("validation.campaign.evaluation.derive", lambda _sensor, **_: wts_derivation)
        # Rough fits and coarse contacts are enough for a page.
        patch.setattr("validation.published.models._EVALUATIONS", 3)
        patch.setattr("validation.published.models._SCAN", 0)
        patch.setattr("validation.credibility.uncertainty.CELLS", 16)
        return compute_once("wts-evaluation", lambda: evaluate(load("wts-0614-34"), cases=CASES))


@pytest.fixture(scope="session")
def solved_folder(solved, tmp_path_factory):
    target = tmp_path_factory.mktemp("report")
    write_report(solved, target)
    return target
