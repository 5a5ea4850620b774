"""Print README's table of accuracy from the scores of a report.

Run it in the repository root after `softcover demo`: `.venv/bin/python docs/accuracy.py [REPORT]`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

RECORDINGS = "recordings, light weights to heavy"


def main(report: Path) -> None:
    """Print one row per model: what it was compared with, and three scores."""
    scores = json.loads((report / "report.json").read_text())
    print("| compared with | model | misplaced force | image changed |\n|---|---|---|---|")
    cases = len(scores["campaign"]["cases"])
    for model, pooled in scores["campaign"]["pooled"].items():
        misplaced = " ".join((f"{100 * pooled['misplaced_force']['mean']:.1f} %", interval(pooled["misplaced_force"])))
        changed = f"{pooled['image_changed_percent']['mean']:.2f} %"
        print(f"| finite elements, {cases} cases | {model} | {misplaced} | {changed} |")
    for row in (scores["recordings"] or {"rows": []})["rows"]:
        if row["split"] == "heavier" and row["model"] in SHOWN:
            name = SHOWN[row["model"]] + (", texel gains" if row["texel_gains"] else "")
            print(f"| {RECORDINGS} | {name} | | {row['pooled']['image_changed_percent']['mean']:.2f} % |")


#: Rows of the recordings that README shows, and what it calls them; the report shows all.
SHOWN = {
    "fast model": "fast",
    "fast model, boxes": "fast, box texels",
    "reference": "finite elements",
    "heaviest fitted image x load ratio": "null: heaviest fitted image times load ratio",
    "line per texel": "null: a line per texel, no sensor model",
    "zeros": "null: zeros",
    "repeat of the same load": "noise floor: repeats of a weight",
}


def interval(pooled: dict[str, Any]) -> str:
    """The 95 % interval over cases, of a fraction, in percent."""
    return f"({100 * pooled['low']:.1f}..{100 * pooled['high']:.1f})"


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path("softcover-report"))
