import dataclasses
import json

import pytest

from fem_reference import point_spread
from validation.campaign.case import Case
from validation.campaign.run import run_campaign
from validation.cli import main
from validation.derivation.cover_kernels import cover_cells
from validation.errors import InputError
from validation.regress import MEAN, TOLERANCES, compare_baselines, load_baseline, make_baseline
from validation.sensor_file import load

CASES = (
    Case.read("sphere", "sphere:radius=5mm", "500 g", at="1.7mm,1.7mm"),
    Case.read("box", "box:size=6mmx10mmx5mm", "100 g", at="0.7mm,-1.1mm", yaw="45deg"),
)


@pytest.fixture(scope="module")
def derivation(wts_derivation):
    return wts_derivation


@pytest.fixture(scope="module")
def baseline(derivation):
    return measured(derivation, derivation.parameters)


def measured(derivation, parameters, cases=CASES):
    return make_baseline(derivation.sensor, run_campaign(derivation.sensor.cover, parameters, cases))


def test_same_model_passes(derivation, baseline):
    assert compare_baselines(baseline, measured(derivation, derivation.parameters)) == []


def test_baseline_survives_its_file(baseline, tmp_path):
    baseline.save(tmp_path / "baseline.json")
    assert load_baseline(tmp_path / "baseline.json") == baseline


@pytest.mark.parametrize("thickness", ["1.8mm", "2.2mm"])
def test_planted_defect_in_the_cover_is_caught(derivation, baseline, thickness):
    sensor = load("wts-0614-34", thickness=thickness)
    cells = cover_cells(sensor.cover, sensor.array, point_spread(sensor.cover))
    spoilt = dataclasses.replace(derivation.parameters, cells=cells)
    changes = compare_baselines(baseline, measured(derivation, spoilt))
    worse = {(change.case, change.metric) for change in changes if change.worse}
    assert (MEAN, "misplaced_force") in worse


def moved(baseline, case, metric, by):
    scores = {name: dict(values) for name, values in baseline.scores.items()}
    scores[case][metric] += by
    return dataclasses.replace(baseline, scores=scores)


@pytest.mark.parametrize("metric", TOLERANCES)
@pytest.mark.parametrize("case", ["sphere", "box", MEAN])
def test_gate_stands_at_the_tolerance(baseline, case, metric):
    tolerance = TOLERANCES[metric]
    assert compare_baselines(baseline, moved(baseline, case, metric, 0.9 * tolerance)) == []
    (change,) = compare_baselines(baseline, moved(baseline, case, metric, 1.1 * tolerance))
    assert (change.case, change.metric, change.worse) == (case, metric, True)
    (change,) = compare_baselines(baseline, moved(baseline, case, metric, -1.1 * tolerance))
    assert not change.worse


def test_case_that_vanished_counts_as_worse(baseline):
    gone = dataclasses.replace(baseline, scores={MEAN: baseline.scores[MEAN]})
    assert {change.case for change in compare_baselines(baseline, gone) if change.worse} == {"sphere", "box"}


def test_baseline_of_something_else_is_refused(derivation, baseline):
    with pytest.raises(InputError, match="another array, cover or list of cases"):
        compare_baselines(baseline, measured(derivation, derivation.parameters, CASES[:1]))


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"format": 99}', '{"format": 1}'])
def test_bad_file_is_bad_input(tmp_path, text):
    path = tmp_path / "baseline.json"
    path.write_text(text)
    with pytest.raises(InputError, match="--baseline"):
        load_baseline(path)


@pytest.mark.slow
def test_command_leaves_with_1_when_accuracy_dropped(tmp_path, capsys):
    path = tmp_path / "baseline.json"

    def status(*words):
        with pytest.raises(SystemExit) as left:
            main(["regress", "wts-0614-34", "--baseline", str(path), *words])
        return left.value.code

    assert status() == 2
    assert status("--update") == 0
    assert status() == 0
    data = json.loads(path.read_text())
    data["scores"]["sphere, texel"]["misplaced_force"] -= 0.01
    path.write_text(json.dumps(data))
    capsys.readouterr()
    assert status() == 1
    out = capsys.readouterr().out
    assert "sphere, texel" in out
    assert "1 scores became worse" in out
