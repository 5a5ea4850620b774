"""The commands `softcover demo` and `softcover validate`, which score a sensor's fast model and write a report."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.failures import BAD_INPUT, CHECK_FAILED, DONE, INTERRUPTED, NOT_CONVERGED
from validation.cli.options import Json, Layers, MaterialName, SensorFile, Thickness
from validation.cli.output import describe_cover, note, print_json, print_table, say, show, show_wrapped
from validation.cli.progress import Progress
from validation.errors import InputError

if TYPE_CHECKING:
    from validation.campaign.campaign_file import Campaign
    from validation.campaign.evaluation import Evaluation
    from validation.campaign.pooling import Pooled
    from validation.campaign.results import CampaignResult, RowScores
    from validation.data_sets.data_set import DataSet
    from validation.data_sets.results import RecordingScores
    from validation.results import Column
    from validation.sensor_file import SensorDescription

_Out = Annotated[Path, Parameter(help="Folder for the report; an earlier one is replaced.")]
_Campaign = Annotated[
    Path | None, Parameter(name="--campaign", help="Campaign file: cases and what is required of the fast model.")
]
_Quick = Annotated[bool, Parameter(name="--quick", help="Six cases instead of all.")]
_Recordings = Annotated[Path | None, Parameter(help="Folder with recordings under known loads, or a data-set file.")]
_DataSet = Annotated[
    str | None, Parameter(name="--data-set", help="Data-set file, or kiechle-sdh2; that in the folder when not given.")
]

#: Built-in sensor that `softcover demo` evaluates, and built-in sensor that made the recordings under known weights.
_DEMO, _RECORDED = "wts-0614-34", "sdh2-distal"
#: Names of the metrics in the printed table of scores; number of published models that are printed [-].
_COLUMNS = ("misplaced_force", "centre_of_pressure_m", "image_changed_percent")
_BEST = 5


def demo(
    *,
    quick: _Quick = False,
    out: _Out = Path("softcover-report"),
    recordings: _Recordings = None,
    json: Json = False,
) -> int:
    """Evaluate the default sensor: point spread, fit, scores against finite elements and recordings, and a report.

    Examples of use:

        softcover demo
        softcover demo --quick
        softcover demo --out my-report
        softcover demo --recordings ~/recordings
    """
    from validation.data_sets.locate import find_data_set
    from validation.sensor_file import BUILT_IN

    data_set = find_data_set(recordings)
    campaign = _read_campaign(None, BUILT_IN[_DEMO], quick=quick)
    return _evaluate(BUILT_IN[_DEMO], campaign, out, recordings=data_set, recorded=BUILT_IN[_RECORDED], json=json)


def validate(
    sensor: SensorFile,
    *,
    campaign: _Campaign = None,
    quick: _Quick = False,
    recordings: _Recordings = None,
    data_set: _DataSet = None,
    material: MaterialName = None,
    thickness: Thickness = None,
    layer: Layers = None,
    out: _Out = Path("softcover-report"),
    json: Json = False,
) -> int:
    """Score the fast model of a sensor against finite elements, and against recordings if a folder is given.

    The exit status is 0 if the fast model meets the acceptance criterion of the campaign, and 1 if it does not or if
    the cases do not decide.  An interrupted run writes a report on the finished cases; the same command continues it.

    Examples of use:

        softcover validate sensor.toml --out my-report
        softcover validate sensor.toml --quick
        softcover validate sensor.toml --campaign mine.toml
        softcover validate sdh2-distal --recordings ~/tactile-sensors
        softcover validate sensor.toml --recordings data-set.toml
        softcover validate wts-0614-34 --material dragon-skin-30 --thickness 2mm --json
    """
    from validation.cli.sensors import read_description
    from validation.data_sets.locate import describe_unused_recordings, find_data_set

    description = read_description(sensor, material=material, thickness=thickness, layers=layer, curved=True)
    if description.body is not None and (recordings is not None or data_set is not None):
        raise InputError("--recordings, --data-set: recordings of curved covers are not scored; leave them out")
    # Recordings belong to one sensor.  Those of the environment variable may be of another sensor, so only recordings
    # that the user names are used.
    found = None if recordings is None and data_set is None else find_data_set(recordings, data_set)
    if found is None and (sentence := describe_unused_recordings()):
        note(sentence)
    plan = _read_campaign(campaign, description, quick=quick)
    return _evaluate(description, plan, out, recordings=found, recorded=description, json=json)


def _read_campaign(path: Path | None, sensor: SensorDescription, *, quick: bool) -> Campaign:
    """Read a campaign file or the default campaign, and shorten it for a quick run; faults in cases are printed."""
    from validation.campaign.campaign_file import read_campaign

    if sensor.body is None:
        campaign = read_campaign(path, sensor.array)
    else:
        from validation.curved.places import CurvedPlaces
        from validation.curved.press import make_meshes

        with Progress() as progress:
            places = CurvedPlaces(mesh=make_meshes(sensor, progress)[-1], texels=sensor.array)
        campaign = read_campaign(path, sensor.array, cover=sensor.cover, curved=places)
    for line in campaign.left_out:
        say(f"softcover: left out: {line}")
    return campaign.shorten() if quick else campaign


def _evaluate(
    sensor: SensorDescription,
    campaign: Campaign,
    out: Path,
    *,
    recordings: DataSet | None,
    recorded: SensorDescription,
    json: bool,
) -> int:
    """Evaluate a sensor, write the report and print a summary.

    Args:
        sensor: The sensor to evaluate.
        campaign: Cases, intended use and acceptance criterion.
        out: Folder of the report.
        recordings: Recordings under known loads, or None.
        recorded: The sensor that made the recordings.
        json: Whether to print the numbers as JSON instead of tables.

    Returns:
        The exit status, see `_choose_status`.
    """
    from validation.extras import REPORT_MODULES, require
    from validation.output_folder import new_folder
    from validation.recordings.importing import list_modules

    started = time.perf_counter()
    files = recordings.files if recordings else ()
    require("skfem", *REPORT_MODULES, *list_modules(file.path for file in files))
    from validation.report import write_report

    _tell_friction(sensor)
    with new_folder(out) as folder, Progress() as progress:
        if sensor.body is not None:
            from validation.curved.evaluate import evaluate_curved

            evaluation = evaluate_curved(sensor, campaign, progress=progress, announce=say)
        else:
            from validation.campaign.evaluation import evaluate

            evaluation = evaluate(
                sensor, campaign=campaign, recordings=recordings, recorded=recorded, progress=progress, announce=say
            )
        progress("report")
        write_report(evaluation, folder)
    if json:
        print_json(evaluation.report.as_json())
    else:
        _print(evaluation)
    _tell_problems(evaluation)
    say(f"report: {(out / 'index.html').absolute()} ({time.perf_counter() - started:.1f} s)")
    (say if json else show)(evaluation.verdict.short)
    return _choose_status(evaluation)


def _choose_status(evaluation: Evaluation) -> int:
    """Return the exit status: the first that applies of interrupted, not converged, faults in the campaign, verdict."""
    if evaluation.campaign.interrupted:
        return INTERRUPTED
    if not all(each.converged for each in evaluation.campaign.skipped):
        return NOT_CONVERGED
    if evaluation.plan.left_out:
        return BAD_INPUT
    return DONE if evaluation.verdict.accepted else CHECK_FAILED


def _tell_friction(sensor: SensorDescription) -> None:
    from validation.text.friction import describe_friction

    if sensor.friction:
        say(
            f"friction {describe_friction(sensor.friction)} from {sensor.source} in the finite elements of every case, "
            "which takes minutes for each flat face; the fast model has none"
        )


def _tell_problems(evaluation: Evaluation) -> None:
    """Print the cases without scores and the warnings, each on one line."""
    for line in evaluation.recordings.problems if evaluation.recordings else ():
        say(f"softcover: recordings: {line}")
    for each in evaluation.campaign.skipped:
        say(f"not scored: {each.name} ({each.indenter}, {each.load:.3g} N): {each.reason}")
    for result in evaluation.campaign.cases:
        for sentence in dict.fromkeys((*result.reference.warnings, *result.warnings)):
            say(f"softcover: warning: {result.case.name}: {sentence}")
    if evaluation.campaign.interrupted:
        say("interrupted: the report has the finished cases; run the same command again to continue")


def _print(evaluation: Evaluation) -> None:
    """Print a summary that fits 80 columns: the verdict in words, then tables."""
    from validation.campaign.results import SKILL_METRICS, describe_reference_error

    sensor, campaign, verdict = evaluation.sensor, evaluation.campaign, evaluation.verdict
    show_wrapped(f"{sensor.name}, cover {describe_cover(sensor.cover)}", further="  ")
    show_wrapped(f"Intended use: {evaluation.plan.intended_use}", further="  ")
    show_wrapped(verdict.sentence, further="  ")
    for reason in verdict.reasons:
        show_wrapped(f"- {reason}", indent="  ", further="  ")
    floor = describe_reference_error(campaign)
    print_table(
        ("model", *map(_head, _COLUMNS)),
        _list_scores(campaign),
        title=f"Fast model and simpler models against finite elements, {len(campaign.cases)} cases",
        caption=f"mean and 95 % interval over cases; own error of the reference: {floor}",
    )
    if campaign.published:
        rows = sorted(campaign.published, key=lambda each: each.pooled["misplaced_force"].mean)
        print_table(
            ("published model", *map(_head, SKILL_METRICS)),
            _list_published(rows[:_BEST]),
            title=f"The {min(_BEST, len(rows))} best of {len(rows)} published models, same cases, means",
            caption="all are in the report; the fitted ones were fitted to other presses",
        )
    scores = evaluation.recordings
    if scores is not None:
        splits = list(dict.fromkeys(row.split for row in scores.rows))
        print_table(
            ("model", *(f"({number})" for number in range(1, len(splits) + 1))),
            _list_recording_scores(scores, splits),
            title="Against recordings: image changed [%] on recordings that were not fitted",
        )
        for number, split in enumerate(splits, start=1):
            notes = scores.notes[split]
            show_wrapped(f"({number}) {scores.about[split]}:", further="  ")
            for note in notes:
                show_wrapped(f"- {note}", indent="  ", further="  ")


def _head(name: str) -> str:
    """Return the heading of a metric's column, with its unit."""
    from validation.metrics import METRICS

    return f"{METRICS[name].heading} [{METRICS[name].unit}]"


def _list_scores(campaign: CampaignResult) -> Iterator[tuple[str, ...]]:
    from validation.metrics import METRICS

    for model, metrics in campaign.pooled.items():
        yield model, *(_format_pooled(metrics[name], METRICS[name]) for name in _COLUMNS)


def _list_published(rows: Sequence[RowScores]) -> Iterator[tuple[str, ...]]:
    from validation.campaign.results import SKILL_METRICS
    from validation.metrics import METRICS

    for scores in rows:
        means = (METRICS[name].text(scores.pooled[name].mean) for name in SKILL_METRICS)
        yield f"{scores.title}, {scores.variant}", *means


def _format_pooled(value: Pooled, metric: Column) -> str:
    if not value.cases:
        return "none"
    mean, low, high = (metric.factor * number for number in (value.mean, value.low, value.high))
    return f"{mean:.2g} ({low:.2g}..{high:.2g})"


def _list_recording_scores(scores: RecordingScores, splits: list[str]) -> Iterator[tuple[str, ...]]:
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
