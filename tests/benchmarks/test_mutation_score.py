"""Mutants are small changes of code that still parses, and tests are chosen for them by the lines that they run."""

import ast
import importlib
from pathlib import Path

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
def score(benchmarks):
    return importlib.import_module("mutation_score")


def test_mutants_change_what_runs_and_neither_texts_nor_types(score, tmp_path):
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "middle.py").write_text(SOURCE)
    (tmp_path / "package" / "limits.py").write_text("_LOW, _HIGH = (1, 2), 4\n_ONE, _TWO = range(2)\n")
    every = score.find_mutants(tmp_path, ("package",))
    found = [mutant for mutant in every if mutant.path.endswith("middle.py")]
    assert {(mutant.line, mutant.before, mutant.after) for mutant in found} == CHANGES
    for mutant in found:
        ast.parse(mutant.apply(SOURCE))
    runs = {mutant.line: (mutant.owner, mutant.runs) for mutant in found}
    assert runs == {2: ("LIMIT", False), 3: ("middle", True), 5: ("middle", True), 7: ("middle", True)}
    owners = [(mutant.before, mutant.owner) for mutant in every if mutant not in found]
    assert owners == [("1", "_LOW"), ("2", "_LOW"), ("4", "_HIGH"), ("2", "")]


@pytest.mark.slow
def test_a_change_is_noticed_by_a_test_that_runs_its_line(score, tmp_path):
    known = score.Coverage(tmp_path, ["tests/meshes/test_array.py"])
    mutants = [each for each in score.find_mutants(ROOT, ("meshes",)) if each.path == "meshes/array.py"]
    mutant = next(each for each in mutants if (each.owner, each.before) == ("grid", "/"))
    assert score.try_mutant(mutant, known, score.copy_tree(tmp_path))["outcome"] == "failed"


def test_scores_count_time_outs_as_noticed(score):
    outcomes = ["failed"] * 17 + ["time", "passed", "no test"]
    records = [
        {"path": "meshes/a.py", "line": k, "before": f"x{k}", "after": "y", "outcome": outcome}
        for k, outcome in enumerate(outcomes)
    ]
    # 18 of 20: the interval of Wilson, (p + z^2 / 2n +- z sqrt(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n)
    table = score.write_score(records, {"arrays": ("meshes/a",), "others": ("meshes/b", "fem_reference")})
    assert "| arrays | 20 | 17 | 1 | 1 | 1 | 90.0 % | 69.9..97.2 % |" in table
    assert "| others | 0 | 0 | 0 | 0 | 0 | - | - |" in table
    assert "| all | 20 | 17 | 1 | 1 | 1 | 90.0 % | 69.9..97.2 % |" in table
    assert "meshes/a.py:18 (passed)" in table


def test_parts_name_files_that_exist_and_share_none(score):
    paths = [path for part in score.PARTS.values() for path in part]
    assert len(score.PARTS) == 9
    assert all((ROOT / path).exists() for path in paths)
    assert not any(a != b and a.startswith(b) for a in paths for b in paths)


def test_files_with_kernels_are_those_that_numba_compiles(score):
    kernels = (
        "validation/resolution/kernel.py",
        "validation/resolution/mixture.py",
        "fastmodel/pressure/gap_kernels.py",
    )
    assert all(score.is_compiled(path) for path in kernels)
    assert not any(score.is_compiled(path) for path in ("meshes/pose.py", "validation/metrics.py"))
