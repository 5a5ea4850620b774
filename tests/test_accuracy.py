"""The table of recordings has one source: the report, from which docs/accuracy.py writes it into one page."""

import importlib.util
import json
from pathlib import Path

ROOT = Path(__file__).parents[1]
SPEC = importlib.util.spec_from_file_location("accuracy", ROOT / "docs" / "accuracy.py")
accuracy = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(accuracy)


def make_row(model, split, mean, *, texel_gains=False):
    pooled = {"image_changed_percent": {"mean": mean, "low": None, "high": None, "cases": 2}}
    return {"model": model, "split": split, "texel_gains": texel_gains, "pooled": pooled}


def test_the_table_is_written_from_a_report_of_recordings_alone(tmp_path):
    rows = [
        make_row("zeros", "a", 10.0),
        make_row("fast model", "a", 1.25, texel_gains=True),
        make_row("zeros", "b", 7),
        make_row("mean pattern x load curve", "b", 7),
    ]
    report = {"recordings": {"rows": rows, "about": {"a": "to heavy", "b": "to warm"}}}
    (tmp_path / "report.json").write_text(json.dumps(report))
    page = tmp_path / "page.md"
    page.write_text(f"before\n{accuracy.BEGIN}old\n{accuracy.END}after\n")
    accuracy.main(tmp_path, page)
    lines = page.read_text().splitlines()
    assert (lines[0], lines[-1]) == ("before", "after")
    head, _, *rows = (dict(enumerate(line.strip("| ").split(" | "))) for line in lines if line.startswith("|"))
    fast, pattern = (list(head.values()).index(name) for name in (accuracy.MODELS[0], "mean pattern x load curve"))
    assert [(row[0], row[1], row[fast], row[pattern]) for row in rows] == [
        ("to heavy", "2", "1.25", "none"),
        ("to warm", "2", "none", "7.00"),
    ]
    assert "old" not in lines
    assert "zeros" not in page.read_text()


def test_the_figures_stand_in_one_page():
    page = accuracy.PAGE.read_text(encoding="utf-8")
    assert page.count(accuracy.BEGIN) == page.count(accuracy.END) == 1
    assert "docs/recordings.md#the-published-recordings" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert "| recordings" not in (ROOT / "README.md").read_text(encoding="utf-8")
