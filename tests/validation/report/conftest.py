"""One evaluation of two cases and its report, for all tests that only read them."""

import pytest

from tests.support.coarse_cells import rough_cells
from tests.support.compute_once import compute_once
from validation.campaign.case import Case
from validation.campaign.evaluation import evaluate
from validation.report import write_report
from validation.sensor_file import load

CASES = (
    Case.read("sphere", "sphere:radius=5mm", "500 g", at="1.7mm,1.7mm"),
    Case.read("box", "box:size=6mmx10mmx5mm", "100 g", at="0.7mm,-1.1mm", yaw="45deg"),
)


@pytest.fixture(scope="session")
def evaluation(wts_derivation):
    with rough_cells(), pytest.MonkeyPatch.context() as patch:
        patch.setattr("validation.campaign.evaluation.derive", lambda _sensor, **_: wts_derivation)
        # Rough fits and coarse contacts are enough for a page.
        patch.setattr("validation.published.models._EVALUATIONS", 3)
        patch.setattr("validation.published.models._SCAN", 0)
        patch.setattr("validation.credibility.uncertainty.CELLS", 16)
        return compute_once("wts-evaluation", lambda: evaluate(load("wts-0614-34"), cases=CASES))


@pytest.fixture(scope="session")
def folder(evaluation, tmp_path_factory):
    target = tmp_path_factory.mktemp("report")
    write_report(evaluation, target)
    return target
