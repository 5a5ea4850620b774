"""Print README's table of accuracy from a report, and write the table of recordings into docs/recordings.md.

Run it in the repository root:

    softcover demo && python docs/accuracy.py
    softcover validate sdh2-distal --recordings FOLDER --data-set kiechle-sdh2 --only-recordings --out recorded
    python docs/accuracy.py recorded

The figures of recordings stand in docs/recordings.md alone, between two comments; README links to them.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

PAGE = Path(__file__).with_name("recordings.md")
#: Models in the table; the report has all.
MODELS = (
    "fast model, texel gains",
    "reference, texel gains",
    "fast model",
    "mean pattern x load curve",
    "line per texel, saturating",
    "heaviest image x load ratio, threshold added back",
    "repeat of the same load",
)
#: Comments around the table in the page.
BEGIN, END = "<!-- recordings: written by docs/accuracy.py -->\n", "<!-- recordings: end -->\n"


def main(report: Path, page: Path = PAGE) -> None:
    """Print the rows of the campaign, and write those of the recordings into the page."""
    scores = json.loads((report / "report.json").read_text())
    if "campaign" in scores:
        print("| compared with | model | misplaced force | image changed |\n|---|---|---|---|")
        cases = len(scores["campaign"]["cases"])
        for model, pooled in scores["campaign"]["pooled"].items():
            misplaced = write_mean(pooled["misplaced_force"], "{:.1f}", factor=100, unit=" %")
            changed = f"{pooled['image_changed_percent']['mean']:.2f} %"
            print(f"| finite elements, {cases} cases | {model} | {misplaced} | {changed} |")
    if scores["recordings"]:
        text = page.read_text(encoding="utf-8")
        before, after = text.split(BEGIN)[0], text.split(END)[1]
        page.write_text(before + BEGIN + tabulate(scores["recordings"]) + END + after, encoding="utf-8")


def tabulate(scores: dict[str, Any]) -> str:
    """Make the table of recordings: a row for each split, a column for each of `MODELS`."""
    cells: dict[str, dict[str, str]] = {}
    counts: dict[str, int] = {}
    for row in scores["rows"]:
        changed = row["pooled"]["image_changed_percent"]
        name = row["model"] + (", texel gains" if row["texel_gains"] else "")
        cells.setdefault(row["split"], {})[name] = write_mean(changed, "{:.2f}")
        counts[row["split"]] = max(counts.get(row["split"], 0), changed["cases"])
    lines = [["split", "weights", *MODELS], ["---"] * (len(MODELS) + 2)]
    lines += [
        [scores["about"][split], str(counts[split]), *(found.get(name, "none") for name in MODELS)]
        for split, found in cells.items()
    ]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def write_mean(pooled: dict[str, Any], form: str, *, factor: float = 1.0, unit: str = "") -> str:
    """Write a mean over cases with its 95 % interval, if there is one."""
    mean, low, high = (math.nan if pooled[key] is None else factor * pooled[key] for key in ("mean", "low", "high"))
    ends = "" if math.isnan(low) else f" ({form.format(low)}..{form.format(high)})"
    return form.format(mean) + unit + ends


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path("softcover-report"))
