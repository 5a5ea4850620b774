"""Print the table by shape and load of docs/comparison-models.md from the results of the 2015 report's campaign.

Run `softcover validate wts-0614-34 --campaign report-2015 --out out`, then this script with `out/report.json`.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

#: Differences between real and simulated images that the report states for a case that is known for certain [%].
PUBLISHED = {("hexagonal nut", "500 g"): "7.1102 (turn not stated)", ("big square + small square", ""): "5.6022"}
#: Rows of the table: the fast model, and the report's own filter with one of its settings.
SCORES = ("image_changed_percent", "image_changed_line_percent")
MODELS = (("models", "fast"), ("comparison_models", "report-0.8-5x5, as shipped"), ("models", "boxes"))


def main() -> None:
    """Print the table."""
    groups = defaultdict(list)
    for case in json.loads(Path(sys.argv[1]).read_text())["campaign"]["cases"]:
        name, found, _ = case["name"].partition("00 g")
        shape, load = (name[:-2], f"{name[-1]}00 g") if found else (case["name"], "")
        scores = [case[kind][model]["scores"] for kind, model in MODELS]
        groups[shape, load].append([each[score] for each in scores for score in SCORES])
    for key, rows in groups.items():
        values = " | ".join(f"{one:.2f}, {line:.2f}" for one, line in np.mean(rows, axis=0).reshape(-1, 2))
        print(f"| {key[0]} | {key[1]} | {len(rows)} | {PUBLISHED.get(key, '')} | {values} |")


if __name__ == "__main__":
    main()
