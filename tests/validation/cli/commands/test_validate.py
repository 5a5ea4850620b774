import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.recordings import RECORDINGS
from validation.campaign.bench import LayeredBench
from validation.campaign.plan import OutOfBudgetError
from validation.campaign.results import OUT_OF_BUDGET
from validation.moving import run


@pytest.mark.slow
@pytest.mark.skipif(RECORDINGS is None, reason="no recordings here")
def test_recordings_of_another_array_are_refused(softcover):
    status, _, err = softcover("validate", "wts-0614-34", "--recordings", RECORDINGS)
    assert status == 2
    assert "is not wts-0614-34" in err
    assert "sdh2-distal" in err


@pytest.mark.slow
@pytest.mark.bench  # `.ci/run` runs it as README says
def test_demo_writes_report_scores_and_parameters(softcover, tmp_path):
    recordings = [] if RECORDINGS is None else ["--recordings", RECORDINGS]
    status, out, err = softcover("demo", "--json", *recordings)
    assert status == 0
    page = (tmp_path / "softcover-report" / "index.html").read_text()
    assert ("Light weights to heavy ones" in page) == bool(recordings)
    assert json.loads(out)["campaign"]["skill"]["zeros"]["mean"] > 0.4
    assert "softcover-report/index.html" in err
    names = {path.name for path in (tmp_path / "softcover-report").iterdir()}
    assert names >= {"index.html", "report.json", "parameters.toml", "cover.npz"}


BALL = "[[case]]\nname = 'ball'\nindenter = 'sphere:radius=5mm'\nload = '100 g'\n"


def test_a_campaign_without_a_usable_case_ends_before_any_work(softcover, tmp_path):
    (tmp_path / "mine.toml").write_text(BALL.replace("sphere", "spere"))
    status, out, err = softcover("validate", "wts-0614-34", "--campaign", "mine.toml")
    assert (status, out) == (2, "")
    assert "mine.toml: case[0].indenter: unknown indenter 'spere'; did you mean 'sphere'?" in err
    assert not (tmp_path / "softcover-report").exists()


@pytest.mark.slow
def test_a_damaged_case_costs_a_line_and_the_rest_is_scored(softcover, tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTCOVER_RECORDINGS", "/my recordings")
    (tmp_path / "mine.toml").write_text(BALL + BALL + BALL.replace("ball", "other").replace("5mm", "5"))
    status, out, err = softcover("validate", "wts-0614-34", "--campaign", "mine.toml")
    assert status == 2
    assert "left out: mine.toml: case[1].name: 'ball' is the name of case[0] already" in err
    assert "left out: mine.toml: case[2].indenter: " in err
    assert err.splitlines()[-1].endswith("to score against them, add --recordings '/my recordings'")
    verdict = (
        "verdict: NOT DECIDED; fast model against finite elements, 1 of 3 cases, limits of the built-in campaign: "
    )
    assert out.splitlines()[-1].startswith(verdict)
    scores = json.loads((tmp_path / "softcover-report" / "report.json").read_text())
    assert [case["name"] for case in scores["campaign"]["cases"]] == ["ball"]


TAP = "[[moving]]\nname = 'tap'\nindenter = 'sphere:radius=4mm'\ntime = ['0 s', '0.1 s']\nload = ['0 N', '1 N']\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stop", "status", "why"),
    [
        (KeyboardInterrupt, 130, "interrupted"),
        pytest.param(OutOfBudgetError, 1, OUT_OF_BUDGET, marks=pytest.mark.bench),
    ],
)
def test_a_stopped_moving_case_ends_as_any_other(softcover, monkeypatch, stop, status, why):
    """One case does not decide (1); nothing further is computed after an interruption."""

    def refuse(*_arguments):
        raise stop

    checked = []
    monkeypatch.setattr(run, "score_moving", refuse)
    monkeypatch.setattr(LayeredBench, "verify", lambda *_: checked.append(1) or iter(()))
    Path("mine.toml").write_text(BALL + TAP)
    found, _, err = softcover("validate", "wts-0614-34", "--campaign", "mine.toml")
    assert found == status
    assert f"not scored: tap (sphere:radius=4mm, 1 N): {why}" in err
    assert bool(checked) == (status == 1)


#: Number of cases of a campaign that is stopped.
COUNT = 8


@pytest.mark.slow
def test_a_stopped_run_reports_the_finished_cases_and_continues(tmp_path):
    """The first run is stopped in the middle; the second finishes the rest.

    Progress is told every two seconds, so the cases are so many that a fast machine needs longer.
    """
    cases = "".join(BALL.replace("ball", f"ball {n}").replace("100", f"{200 + n}") for n in range(COUNT))
    (tmp_path / "mine.toml").write_text(cases)
    command = [sys.executable, "-c", "from validation.cli import main; main()", "validate", "wts-0614-34"]
    command += ["--campaign", "mine.toml"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=tmp_path, stderr=pipe, stdout=pipe, text=True) as run:  # noqa: S603
        for line in run.stderr:
            if (told := re.search(rf" (\d+)/{COUNT} ", line)) and 1 < int(told[1]) < COUNT:
                run.send_signal(signal.SIGINT)
                break
        out, err = run.communicate(timeout=300)
    assert run.returncode == 130, err
    assert "run the same command again" in err
    assert out.splitlines()[-1].startswith("verdict: NOT DECIDED; ")
    scores = json.loads((tmp_path / "softcover-report" / "report.json").read_text())
    assert scores["campaign"]["interrupted"]
    assert 0 < len(scores["campaign"]["cases"]) < COUNT
    assert {each["reason"] for each in scores["campaign"]["skipped"]} == {"interrupted"}
    again = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)  # noqa: S603
    assert again.returncode == 0, again.stderr
    assert f"verdict: ACCEPTED; fast model against finite elements, {COUNT} of {COUNT} cases" in again.stdout


@pytest.mark.parametrize("options", [[], ["--data-set", "kiechle-sdh2", "--quick"]])
def test_only_recordings_needs_recordings_and_no_budget(softcover, tmp_path, monkeypatch, options):
    monkeypatch.setenv("SOFTCOVER_RECORDINGS", str(tmp_path))
    (tmp_path / "weights").mkdir()
    status, out, err = softcover("validate", "sdh2-distal", "--only-recordings", *options)
    assert (status, out) == (2, "")
    assert "--recordings" in err
    assert not (tmp_path / "softcover-report").exists()
