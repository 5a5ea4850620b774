"""Compares the fast model with the best null model of every split of a set of recordings, and over all splits.

    python benchmarks/recording_scores.py --recordings DIR [--out scores.json]

The best null model of a split is the one with the smallest score on the scored cases themselves, which favours null
models.  Differences are paired by case.  A case occurs in several splits, so that its differences form one cluster; the
interval of the mean over all splits is Student's t on the sums of the clusters.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
from scipy.stats import t as student

from validation.data_sets.data_set import find_data_set
from validation.data_sets.results import RecordingScores, find_best_null
from validation.data_sets.score import FAST, score_recordings
from validation.parameters import find_parameters
from validation.sensor_file import load


def find_interval(differences: list[float], clusters: list[str]) -> tuple[float, float, float]:
    """Return the mean of n differences and the ends of its 95 % interval, with errors that are common to a cluster.

    Args:
        differences: The differences, n entries.
        clusters: Name of the cluster of each, n entries.
    """
    values = np.array(differences)
    mean = float(values.mean())
    names, index = np.unique(clusters, return_inverse=True)
    sums = np.bincount(index, values - mean)
    count = len(names)
    if count < 3:
        return mean, float("nan"), float("nan")
    error = float(np.sqrt(count / (count - 1) * np.sum(sums**2))) / len(values)
    half = float(student.ppf(0.975, count - 1)) * error
    return mean, mean - half, mean + half


def print_table(scores: RecordingScores, model: str = FAST) -> None:
    """Print a line for each split, and the mean difference over all of them."""
    print(f"image changed [%]: {model} with texel gains, best null model, paired difference [95 % interval]")
    pooled: list[float] = []
    cases: list[str] = []
    splits: list[str] = []
    for split in dict.fromkeys(row.split for row in scores.rows):
        null = find_best_null([row for row in scores.rows if row.split == split])
        own = scores.row(split, model, texel_gains=True)
        both = {
            case: (own.per_case[case].image_changed_percent, each.image_changed_percent)
            for case, each in null.per_case.items()
        }
        differences = [a - b for a, b in both.values()]
        mean, low, high = find_interval(differences, list(both))
        a, b = np.mean(list(both.values()), axis=0)
        print(f"{split:32s} {a:5.2f} {b:5.2f} {mean:+6.2f} [{low:+.2f}, {high:+.2f}] n {len(both):2d}  {null.model}")
        pooled += differences
        cases += both
        splits += [split] * len(both)
    for name, clusters in (("cases", cases), ("splits", splits)):
        mean, low, high = find_interval(pooled, clusters)
        print(
            f"all {len(set(splits))} splits: difference {mean:+.3f} [{low:+.3f}, {high:+.3f}] %, "
            f"n {len(pooled)} in {len(set(clusters))} {name} as clusters"
        )


def main() -> None:
    """Score the recordings and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", help="folder of the recordings; SOFTCOVER_RECORDINGS if left out")
    parser.add_argument("--data-set", help="data-set file, or name of a built-in one")
    parser.add_argument("--sensor", default="", help="sensor file or built-in sensor; that of the data set if left out")
    parser.add_argument("--out", type=Path, help="file for all scores (JSON)")
    options = parser.parse_args()
    data_set = find_data_set(options.recordings, options.data_set)
    if data_set is None:
        parser.error("name the recordings with --recordings")
    sensor = load(options.sensor or data_set.sensor)
    start = time.process_time()

    def say(text: str) -> None:
        print(f"{time.process_time() - start:6.1f} s  {text}", file=sys.stderr)

    scores = score_recordings(data_set, sensor, find_parameters(sensor, say), progress=say)
    print_table(scores)
    for split, notes in scores.notes.items():
        print(f"{split}: " + "; ".join(notes))
    print("\n".join(scores.problems))
    if options.out:
        options.out.write_text(json.dumps(scores.as_json()))


if __name__ == "__main__":
    main()
