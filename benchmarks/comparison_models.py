"""Score the fast model and all published models against the finite elements at finite strain, in one table.

    python benchmarks/comparison_models.py [--cases default|report] [--json FILE]

The cover is wide, 2 mm of neo-Hookean rubber (1 MPa, Poisson ratio 0.49), frictionless, over the WTS 0614-34.
`default` are the 17 cases of `softcover validate`; `report` are the shapes, loads and turns of `benchmarks/campaign.py`
at the centre of the array, those of the 2015 report.  An empty store takes about 3 and 7 minutes of processor time.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from campaign import ALL_TURNS, LOADS, SHAPES, TURNS

from meshes import Pose, TexelArray
from tests.support.rubber import make_cover
from validation.campaign.bench import LayeredBench
from validation.campaign.campaign_file import read_campaign
from validation.campaign.case import Case
from validation.campaign.results import MODELS, CampaignResult
from validation.campaign.run import run_campaign
from validation.derivation.derive import derive
from validation.json_values import json_text
from validation.places import FlatPlaces
from validation.pooling import Pooled
from validation.published.models import prepare_models
from validation.sensor_file import BUILT_IN

METRICS = (("misplaced_force", 100), ("image_changed_percent", 1), ("image_changed_line_percent", 1))


def report_cases() -> tuple[Case, ...]:
    """Return the static campaign of the 2015 report, without its two squares at once."""
    return tuple(
        Case(
            name=f"{name}, {load:.3g} N, {turn} deg",
            indenter=shape,
            shape=name,
            load=load,
            pose=Pose.planar(yaw=float(np.radians(turn))),
        )
        for name, shape in SHAPES.items()
        for turn in TURNS.get(name, ALL_TURNS)
        for load in LOADS
    )


def score(cases: tuple[Case, ...] | None) -> CampaignResult:
    """Derive the sensor's fast model, fit the published models, and score all in the cases."""
    sensor = dataclasses.replace(BUILT_IN["wts-0614-34"], name="campaign", cover=make_cover())
    array: TexelArray = sensor.array
    chosen = read_campaign(None, FlatPlaces(array=array)).cases if cases is None else cases
    parameters = derive(sensor).parameters
    started = time.process_time()
    comparison = prepare_models(sensor.cover, parameters, chosen)
    print(f"fits: {time.process_time() - started:.1f} s of processor time")
    started = time.process_time()
    result = run_campaign(LayeredBench(cover=sensor.cover, parameters=parameters, comparison=comparison), chosen)
    print(f"campaign: {time.process_time() - started:.1f} s of processor time\n")
    return result


def list_rows(result: CampaignResult) -> Iterator[tuple[str, str, dict[str, Pooled], str]]:
    """Yield the rows of the table: name, variant, pooled scores, and parameters."""
    for name in MODELS:
        yield name, "ours" if name in ("fast", "foundation") else "baseline", dict(result.pooled[name]), ""
    for scores in result.published:
        values = ", ".join(
            f"{'**' if name in scores.fitted else ''}{name}{'**' if name in scores.fitted else ''} "
            f"{value:.3g} {scores.units.get(name, '')}".strip()
            for name, value in scores.parameters.items()
        )
        yield scores.title, scores.variant, dict(scores.pooled), values


def format_pooled(value: Pooled, factor: float) -> str:
    """Format a mean with its interval."""
    return f"{factor * value.mean:.2f} ({value.describe('{:.2f}', factor=factor).removeprefix('95 % interval ')})"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", choices=("default", "report"), default="default")
    parser.add_argument("--json", type=Path, help="file for all numbers")
    options = parser.parse_args()
    result = score(report_cases() if options.cases == "report" else None)
    print(
        "| model | variant | misplaced [%] | image changed, case's peak [%] | image changed, WTS line [%] "
        "| parameters (fitted: bold) |"
    )
    print("|---|---|---|---|---|---|")
    for name, variant, pooled, values in list_rows(result):
        cells = [format_pooled(pooled[metric], factor) for metric, factor in METRICS]
        print(f"| {name} | {variant} | {' | '.join(cells)} | {values} |")
    for model in ("fast", "boxes"):
        for metric, _ in METRICS[1:]:
            values = [getattr(case.predictions[model].score, metric) for case in result.cases]
            least, median, most = np.quantile(values, [0.0, 0.5, 1.0])
            mean = np.mean(values)
            print(f"\n{model}, {metric}: {least:.3f} to {most:.3f}, median {median:.3f}, mean {mean:.3f}")
    for each in result.skipped:
        print(f"\nnot scored: {each.case.name}: {each.reason}")
    if options.json:
        options.json.write_text(json_text(result.as_json()))


if __name__ == "__main__":
    main()
