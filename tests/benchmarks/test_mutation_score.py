"""Mutants are small changes of code that still parses, and planted defects fit the code of today."""

import ast
import importlib
import json
from argparse import Namespace
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[2]

SOURCE = '''"""Words 1 + 2."""
LIMIT: int = 3
def middle(low: int = 0, high=5):
    """Say 1 < 2."""
    if low < high and not skipped(low, high, least=True):
        raise ValueError(f"{low + 1}")
    return (low + high) / 2
'''
#: Line, text before and text after of every mutant of the source.
CHANGES = {
    (2, "3", "(3 + 1)"),
    (3, "0", "(0 + 1)"),
    (3, "5", "(5 + 1)"),
    (5, "<", "<="),
    (5, "<", ">="),
    (5, "and", "or"),
    (5, "not skipped(low, high, least=True)", "(skipped(low, high, least=True))"),
    (5, "low, high", "high, low"),
    (5, "least=True", ""),
    (5, "True", "False"),
    (7, "+", "-"),
    (7, "/", "*"),
    (7, "2", "(2 + 1)"),
}


@pytest.fixture
def score(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return importlib.import_module("mutation_score")


def test_mutants_change_what_runs_and_neither_texts_nor_types(score, tmp_path):
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "middle.py").write_text(SOURCE)
    found = score.find_mutants(tmp_path, ("package",))
    assert {(mutant.line, mutant.before, mutant.after) for mutant in found} == CHANGES
    assert len(found) == len(CHANGES)
    for mutant in found:
        changed = mutant.apply(SOURCE)
        ast.parse(changed)
        assert changed.replace(mutant.after, mutant.before, 1).count("\n") == SOURCE.count("\n")
    runs = {mutant.line: (mutant.owner, mutant.runs) for mutant in found}
    assert runs == {2: ("LIMIT", False), 3: ("middle", True), 5: ("middle", True), 7: ("middle", True)}


def test_constants_in_one_line_have_an_owner_each(score, tmp_path):
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "limits.py").write_text("_LOW, _HIGH = (1, 2), 4\n_ONE, _TWO = range(2)\n")
    found = score.find_mutants(tmp_path, ("package",))
    owners = [(mutant.before, mutant.owner) for mutant in found]
    assert owners == [("1", "_LOW"), ("2", "_LOW"), ("4", "_HIGH"), ("2", "")]


@pytest.mark.slow
def test_mutants_of_this_repository_parse(score):
    mutants = score.list_mutants(1)
    assert len(mutants) > 10_000
    for mutant in mutants[:40]:
        ast.parse(mutant.apply((ROOT / mutant.path).read_text()))


def test_tests_are_chosen_by_line_fastest_first_and_kernels_by_their_callers(score):
    mutants = score.find_mutants(ROOT, ("meshes/surfaces", "fastmodel/contact"))
    mutant = next(each for each in mutants if each.path == "meshes/surfaces/underside.py" and each.runs)
    bits = f"{1 << mutant.lines[-1]:x}"
    records = [{"tests": {"slow": [2.5, {mutant.path: bits}], "quick": [0.1, {mutant.path: bits}], "other": [0.1, {}]}}]
    chooser = score.Chooser(records)
    assert chooser.choose(mutant) == ["quick", "slow"]
    assert chooser.batches(["quick", "slow"]) == [["quick"], ["slow"]]
    kernel = next(each for each in mutants if each.owner == "share_shear" and each.runs)
    caller = (ROOT / "fastmodel/contact/net_force.py").read_text().splitlines()
    lines = sum(1 << number for number, line in enumerate(caller, start=1) if "share_shear" in line)
    records = [{"tests": {"caller": [0.1, {"fastmodel/contact/net_force.py": f"{lines:x}"}]}}]
    assert score.is_compiled(kernel.path)
    assert score.Chooser(records).choose(kernel) == ["caller"]


def test_a_constant_is_tested_by_the_functions_that_need_it_and_not_by_what_loads_its_file_first(score):
    """`TexelCount` is a type in a table, which stands in the tables of sensors."""
    file, reader = "validation/schema/types.py", "validation/sensor_file/sensor.py"
    mutant = next(each for each in score.find_mutants(ROOT, ("validation/schema",)) if each.owner == "TexelCount")
    lines = {
        name: sum(1 << number for number, line in enumerate((ROOT / name).read_text().splitlines(), start=1) if line)
        for name in (file, reader)
    }
    records = [{"tests": {"loads": [0.1, {file: f"{lines[file]:x}"}], "reads": [0.2, {reader: f"{lines[reader]:x}"}]}}]
    assert score.Chooser(records).choose(mutant)[-1] == "reads"
    records = [{"tests": {"loads": [0.1, {file: f"{1 << mutant.line:x}"}]}}]
    assert score.Chooser(records).choose(mutant) == []


def test_tests_of_a_constant_are_those_of_the_constants_made_from_it(score):
    """Imports make named materials, so no test runs the lines that use the numbers of natural rubber."""
    mutants = score.find_mutants(ROOT, ("meshes",))
    mutant = next(each for each in mutants if each.owner == "_NATURAL_RUBBER")
    reader = (ROOT / "validation/schema/types.py").read_text().splitlines()
    lines = sum(1 << number for number, line in enumerate(reader, start=1) if "return MATERIALS[" in line)
    records = [{"tests": {"reader": [0.1, {"validation/schema/types.py": f"{lines:x}"}]}}]
    assert score.Chooser(records).choose(mutant) == ["reader"]


def test_scores_count_time_outs_as_killed_and_leave_out_equivalents(score, monkeypatch):
    outcomes = ["failed"] * 17 + ["time", "passed", "no test", "passed"]
    records = [
        {"number": k, "path": "meshes/a.py", "line": k, "before": f"x{k}", "after": "y", "outcome": outcome}
        for k, outcome in enumerate(outcomes)
    ]
    monkeypatch.setattr(score, "read_equivalent", lambda: [{"path": "meshes/a.py", "before": "x20", "after": "y"}])
    text = score.write_score(records, "code")
    # 18 of 20: the interval of Wilson, (p + z^2 / 2n +- z sqrt(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n)
    assert "| all | 21 | 17 | 1 | 1 | 1 | 1 | 90.0 % | 69.9..97.2 % |" in text
    assert "meshes/a.py:18 (passed, mutant 18)" in text
    assert "x20" not in text


def test_planted_defects_and_equivalent_mutants_fit_the_code(score):
    for defect in score.read_planted():
        changed = score.plant(defect)
        assert changed != (ROOT / defect["path"]).read_text()
        if defect["path"].endswith(".py"):
            ast.parse(changed)
        assert all((ROOT / name.split("::")[0]).is_file() for name in defect["tests"])
    for entry in score.read_equivalent():
        assert entry["before"] in (ROOT / entry["path"]).read_text()
        assert entry["reason"]


def _square(_seed, number):
    return {"square": number**2}


def test_finished_cases_of_the_same_code_and_those_that_still_hold_are_not_run_again(score, monkeypatch, tmp_path):
    from resumable import run_cases

    def run_here(_method):
        return SimpleNamespace(Pool=lambda *_, **__: nullcontext(SimpleNamespace(imap_unordered=map)))

    monkeypatch.setattr("multiprocessing.get_context", run_here)
    lines = tmp_path / "lines"
    old = [{"number": 0, "code": "new"}, {"number": 1, "code": "old", "noticed": True}, {"number": 2, "code": "old"}]
    lines.write_text("".join(json.dumps(each) + "\n" for each in old))
    given = Namespace(first=0, cases=4, seed=1, minutes=1, processes=1, lines=lines, older=False)
    found = run_cases(_square, given, "new", holds=lambda record: "noticed" in record)
    assert found[:2] == old[:2]
    assert [(each["number"], each["square"]) for each in found[2:]] == [(2, 4), (3, 9)]
    assert all(each["code"] == "new" for each in found[2:])
