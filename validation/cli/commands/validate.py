"""The commands `softcover demo` and `softcover validate`, which score a sensor's fast model and write a report."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.failures import DONE, NOT_CONVERGED
from validation.cli.options import Json, MaterialName, SensorFile, Thickness
from validation.cli.output import describe_cover, print_json, print_table, say, show
from validation.cli.progress import Progress

if TYPE_CHECKING:
    from validation.calibration.stamp import StampScores
    from validation.campaign.evaluation import Evaluation
    from validation.campaign.pooling import Pooled
    from validation.campaign.run import CampaignResult
    from validation.report.contents import Metric
    from validation.sensor_file import SensorDescription

_Out = Annotated[Path, Parameter(help="Folder for the report; an earlier one is replaced.")]
_Recordings = Annotated[Path | None, Parameter(help="Folder with recordings of a real sensor under known weights.")]

#: Built-in sensor that `softcover demo` evaluates, and built-in sensor that made the recordings under known weights.
_DEMO, _RECORDED = "wts-0614-34", "sdh2-distal"
#: Names of the metrics in the printed table of scores.
_COLUMNS = ("misplaced_force", "relative_l2", "total_force_error", "centre_of_pressure_m", "image_changed_percent")


def demo(*, out: _Out = Path("softcover-report"), recordings: _Recordings = None, json: Json = False) -> int:
    """Evaluate the default sensor: point spread, fit, scores against finite elements and recordings, and a report.

    Examples of use:

        softcover demo
        softcover demo --out my-report
        softcover demo --recordings ~/recordings
    """
    from validation.recordings.series import find_recordings_folder
    from validation.sensor_file import BUILT_IN

    folder = find_recordings_folder(recordings)
    return _evaluate(BUILT_IN[_DEMO], out, recordings=folder, recorded=BUILT_IN[_RECORDED], json=json)


def validate(
    sensor: SensorFile,
    *,
    recordings: _Recordings = None,
    material: MaterialName = None,
    thickness: Thickness = None,
    out: _Out = Path("softcover-report"),
    json: Json = False,
) -> int:
    """Score the fast model of a sensor against finite elements, and against recordings if a folder is given.

    Examples of use:

        softcover validate sensor.toml --out my-report
        softcover validate sdh2-distal --recordings ~/recordings
        softcover validate wts-0614-34 --material dragon-skin-30 --thickness 2mm --json
    """
    from validation.cli.sensors import read_description
    from validation.recordings.series import find_recordings_folder

    description = read_description(sensor, material=material, thickness=thickness)
    # Recordings belong to one sensor.  Those in the default folder may be of another sensor, so only a folder that the
    # user names is used.
    folder = None if recordings is None else find_recordings_folder(recordings)
    return _evaluate(description, out, recordings=folder, recorded=description, json=json)


def _evaluate(
    sensor: SensorDescription, out: Path, *, recordings: Path | None, recorded: SensorDescription, json: bool
) -> int:
    """Evaluate a sensor, write the report and print a summary.

    Args:
        sensor: The sensor to evaluate.
        out: Folder of the report.
        recordings: Folder of recordings, or None.
        recorded: The sensor that made the recordings.
        json: Whether to print the numbers as JSON instead of tables.

    Returns:
        The exit status: 0, or 4 if the finite-element solver did not converge in a case (an indentation).
    """
    from validation.campaign.evaluation import evaluate
    from validation.output_folder import new_folder
    from validation.report import require, write_report
    from validation.text.friction import describe_friction

    started = time.perf_counter()
    require()
    if sensor.friction:
        say(
            f"friction {describe_friction(sensor.friction)} from {sensor.source} in the finite elements of every case, "
            "which takes minutes for each flat face; the fast model has none"
        )
    with new_folder(out) as folder, Progress() as progress:
        evaluation = evaluate(sensor, recordings=recordings, recorded=recorded, progress=progress)
        progress("report")
        write_report(evaluation, folder)
    if json:
        print_json(evaluation.as_json())
    else:
        _print(evaluation)
    skipped = evaluation.campaign.skipped
    for each in skipped:
        say(f"not scored: {each.case.name} ({each.case.shape}, {each.case.load:.3g} N): {each.reason}")
    for result in evaluation.campaign.cases:
        for sentence in dict.fromkeys((*result.reference.warnings, *result.warnings)):
            say(f"softcover: warning: {result.case.name}: {sentence}")
    say(f"report: {(out / 'index.html').absolute()} ({time.perf_counter() - started:.1f} s)")
    return DONE if all(each.converged for each in skipped) else NOT_CONVERGED


def _print(evaluation: Evaluation) -> None:
    from validation.campaign.run import SKILL_METRICS
    from validation.report.contents import METRICS

    sensor, fit, campaign = evaluation.sensor, evaluation.derivation.fit, evaluation.campaign
    show(f"{sensor.name}, cover {describe_cover(sensor.cover)}")
    show(
        f"kernel: sigma {fit.gaussian.sigma_x:.4f}, {fit.gaussian.sigma_y:.4f} pitches ({fit.estimator}), "
        f"residual {100 * fit.residual:.2f} %, outside the kernel {100 * fit.outside_kernel:.2f} %"
    )
    floor = campaign.noise_floor
    print_table(
        ("model", *(METRICS[name].heading for name in _COLUMNS)),
        _list_scores(campaign),
        title=f"Against finite elements: {len(campaign.cases)} cases, means and 95 % intervals over cases",
        caption=f"error estimate of the reference: depth {100 * floor['depth']:.2g} %, "
        f"peak texel {100 * floor['peak_texel']:.2g} %",
    )
    if campaign.published:
        print_table(
            ("published model", *(METRICS[name].heading for name in SKILL_METRICS)),
            _list_published(campaign),
            title="Published models in the same cases, means; the fitted ones were fitted to other presses",
        )
    scores = evaluation.recordings
    if scores is not None:
        splits = list(dict.fromkeys(row.split for row in scores.rows))
        print_table(
            ("model", *(scores.about[split] for split in splits)),
            _list_recording_scores(scores, splits),
            title="Against recordings: image changed [%] on weights that were not fitted",
        )


def _list_scores(campaign: CampaignResult) -> Iterator[tuple[str, ...]]:
    from validation.report.contents import METRICS

    for model, metrics in campaign.pooled.items():
        yield model, *(_format_pooled(metrics[name], METRICS[name]) for name in _COLUMNS)


def _list_published(campaign: CampaignResult) -> Iterator[tuple[str, ...]]:
    from validation.campaign.run import SKILL_METRICS
    from validation.report.contents import METRICS

    for scores in campaign.published:
        means = (f"{METRICS[name].text(scores.pooled[name].mean)} {METRICS[name].unit}" for name in SKILL_METRICS)
        yield f"{scores.row.model.title}, {scores.row.variant}", *means


def _format_pooled(value: Pooled, metric: Metric) -> str:
    if not value.cases:
        return "none"
    mean, low, high = (metric.factor * number for number in (value.mean, value.low, value.high))
    return f"{mean:.3g} {metric.unit}\n{low:.2g}..{high:.2g}"


def _list_recording_scores(scores: StampScores, splits: list[str]) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the table of scores against recordings: the mean change of the image by each model.

    Args:
        scores: Scores against the recordings.
        splits: Names of the divisions of the recordings into fitted and scored weights, one column each.

    Yields:
        Name of the model and one number per column [%]; an empty text where the model was not scored.
    """
    means = {
        (row.split, row.model, row.texel_gains): f"{row.pooled['image_changed_percent'].mean:.2f}"
        for row in scores.rows
    }
    for model, gains, kind in dict.fromkeys((row.model, row.texel_gains, row.kind) for row in scores.rows):
        label = {"null": " (null)", "floor": " (floor)"}.get(kind, " + texel gains" if gains else "")
        yield f"{model}{label}", *(means.get((split, model, gains), "") for split in splits)
