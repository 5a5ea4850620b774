"""The commands `softcover demo` and `softcover validate`, which score a sensor's fast model and write a report.

With `--measured`, `softcover validate` compares the finite elements with forces that were measured at known depths.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from validation.cli import options, output
from validation.cli.entry import BAD_INPUT, CHECK_FAILED, DONE, INTERRUPTED, NOT_CONVERGED
from validation.errors import InputError

if TYPE_CHECKING:
    from validation.campaign.evaluation import Evaluation, RecordingEvaluation
    from validation.campaign.results import CampaignResult
    from validation.measured_force.comparison import ForceComparison, Row
    from validation.moving.results import MovingResult
    from validation.render.table import Table
    from validation.schema.measured_force import Measurement
    from validation.sensor_file import SensorDescription

_Out = Annotated[Path, Parameter(metavar="FOLDER", help="Folder for the report; an earlier one is replaced.")]
_Quick = Annotated[
    bool, Parameter(name="--quick", help="The cases that tell most, within five minutes: --budget 5min.")
]
_Recordings = Annotated[
    Path | None,
    Parameter(metavar="FOLDER", help="Folder with recordings under known loads, or a data-set file."),
]

#: Built-in sensor that `softcover demo` evaluates.
_DEMO = "wts-0614-34"
#: Built-in sensor with which the recordings under known weights were made.
_RECORDED = "sdh2-distal"
#: Names of the metrics in the table of scores that the command prints.
SHOWN = ("misplaced_force", "centre_of_pressure_m", "image_changed_percent")
#: Largest number of rows of the table of scores that the command prints [-].
_ROWS = 10


def demo(
    *,
    quick: _Quick = False,
    out: _Out = Path("softcover-report"),
    recordings: _Recordings = None,
    json: options.Json = False,
) -> int:
    """Evaluate the default sensor: point spread, fit, scores against finite elements and recordings, and a report.

    Examples of use:

        softcover demo
        softcover demo --quick
        softcover demo --out my-report
        softcover demo --recordings ~/recordings
    """
    from validation.data_sets.data_set import find_data_set
    from validation.sensor_file import BUILT_IN

    data = find_data_set(recordings)
    return _evaluate(BUILT_IN[_DEMO], out, quick=quick, recordings=data, recorded=BUILT_IN[_RECORDED], json=json)


def validate(
    sensor: options.SensorFile,
    *,
    campaign: options.File | None = None,
    quick: _Quick = False,
    budget: Annotated[str | None, Parameter(metavar="TIME", allow_leading_hyphen=True)] = None,
    recordings: _Recordings = None,
    data_set: Annotated[str | None, Parameter(metavar="FILE")] = None,
    only_recordings: Annotated[bool, Parameter(name="--only-recordings")] = False,
    measured: Annotated[str | None, Parameter(metavar="FILE")] = None,
    cover: options.CoverChanges = options.UNCHANGED,
    out: _Out = Path("softcover-report"),
    json: options.Json = False,
) -> int:
    """Score the fast model of a sensor against finite elements, and against recordings if a folder is given.

    The exit status is 0 if the fast model meets the requirements of the campaign and of the recordings, and 1 if it
    does not or if cases or loads do not decide.  An interrupted run writes a report on the finished cases; the same
    command continues it.

    Examples of use:

        softcover validate sensor.toml --out my-report
        softcover validate sensor.toml --quick
        softcover validate sensor.toml --budget 20min
        softcover validate sensor.toml --campaign mine.toml
        softcover validate sdh2-distal --recordings ~/tactile-sensors
        softcover validate sensor.toml --recordings data-set.toml
        softcover validate sensor.toml --recordings data-set.toml --only-recordings
        softcover validate wts-0614-34 --material dragon-skin-30 --thickness 2mm --json
        softcover validate wts-0614-34 --measured gelsight-mini

    Args:
        campaign: Campaign file, or report-2015 or moving: cases and what is required of the fast model.
        budget: Processor time such as 20min, within which the cases that tell most are computed.
        data_set: Data-set file, or kiechle-sdh2; that in the folder when not given.
        only_recordings: Score the recordings alone, without the finite elements of the campaign.
        measured: File of measured forces with their own cover, or gelsight-mini: compare the finite elements with them.
    """
    from validation.data_sets.data_set import describe_unused_recordings

    if measured is not None:
        if (
            quick
            or cover != options.UNCHANGED
            or only_recordings
            or any(each is not None for each in (campaign, recordings, data_set, budget))
        ):
            raise InputError("--measured: measured forces have a cover of their own; leave out all options but --json")
        _compare_measured_force(measured, json=json)
        return DONE
    description = options.read_description(sensor, cover, any_cover=True)
    # Recordings belong to one sensor.  The environment variable may name recordings of another sensor, so that only
    # recordings named by the user are used.
    if recordings is None and data_set is None and (sentence := describe_unused_recordings()):
        output.note(sentence)
    return _evaluate(
        description, out, campaign=campaign, quick=quick, budget=budget, recordings=recordings, data_set=data_set,
        only_recordings=only_recordings, json=json,
    )  # fmt: skip


def _evaluate(sensor: SensorDescription, out: Path, *, json: bool, **chosen: Any) -> int:  # noqa: ANN401
    """Evaluate a sensor, write the report, print a summary, and return the exit status.

    Args:
        sensor: Sensor to evaluate.
        out: Folder of the report.
        json: Whether to print the numbers as JSON instead of tables.
        **chosen: Options of `validation.validate`.
    """
    from validation import api

    started = time.perf_counter()
    with output.Progress() as progress:
        found = api.validate(sensor, out=out, progress=progress, announce=output.say, **chosen)
    # This module needs the finite elements; `api.validate` names all missing packages at once.
    from validation.campaign.evaluation import Evaluation
    from validation.campaign.results import OUT_OF_BUDGET

    if json:
        output.print_json(found.report.as_json())
    else:
        _print(found)
    for line in found.recordings.problems if found.recordings else ():
        output.say(f"softcover: recordings: {line}")
    if isinstance(found, Evaluation):
        _tell_problems(found)
    output.say(f"report: {(out / 'index.html').absolute()} ({time.perf_counter() - started:.1f} s)")
    (output.say if json else output.show)(found.verdict.short)
    if isinstance(found, Evaluation):
        if found.campaign.interrupted:
            return INTERRUPTED
        if not all(each.converged for each in (*found.campaign.skipped, *found.not_moved)):
            return NOT_CONVERGED
        if found.plan.left_out or any(each.reason != OUT_OF_BUDGET for each in found.not_moved):
            return BAD_INPUT
    return DONE if found.verdict.accepted else CHECK_FAILED


def _tell_problems(evaluation: Evaluation) -> None:
    """Print the cases without scores and the warnings, each on one line."""
    for each in (*evaluation.campaign.skipped, *evaluation.not_moved):
        output.say(f"not scored: {each.name} ({each.indenter}, {each.load:.3g} N): {each.reason}")
    for moved in evaluation.moving:
        for sentence in moved.warnings:
            output.say(f"softcover: warning: {moved.name}: {sentence}")
    for result in evaluation.campaign.cases:
        for sentence in dict.fromkeys((*result.reference.warnings, *result.warnings)):
            output.say(f"softcover: warning: {result.case.name}: {sentence}")
    if evaluation.campaign.interrupted:
        output.say("interrupted: the report has the finished cases; run the same command again to continue")


def _print(evaluation: RecordingEvaluation) -> None:
    """Print the verdict in words and a table of the scores of at most ten models; the report has all of them."""
    from validation.campaign.evaluation import Evaluation
    from validation.campaign.results import describe_reference_error

    sensor, verdict = evaluation.sensor, evaluation.verdict
    output.show_wrapped(f"{sensor.name}, cover {output.describe_cover(sensor.cover)}", further="  ")
    if isinstance(evaluation, Evaluation):
        output.show_wrapped(f"Intended use: {evaluation.plan.intended_use}", further="  ")
    output.show_wrapped(verdict.sentence, further="  ")
    for reason in verdict.reasons:
        output.show_wrapped(f"- {reason}", indent="  ", further="  ")
    if isinstance(evaluation, Evaluation):
        campaign = evaluation.campaign
        output.render(_tabulate(campaign))
        output.show_wrapped(
            f"Means over {len(campaign.cases)} cases; own error of the reference: "
            f"{describe_reference_error(campaign)}. All models and intervals are in the report."
        )
        if evaluation.moving:
            output.render(_tabulate_moving(evaluation.moving))
    if (scores := evaluation.recordings) is not None:
        for split, notes in scores.notes.items():
            output.show_wrapped(f"Recordings, {scores.about[split]}: {'; '.join(notes)}", further="  ")


def _tabulate(campaign: CampaignResult) -> Table:
    """Tabulate mean scores: models of this package, null models and the best published models, at most ten rows."""
    from validation.metrics import METRICS
    from validation.render.table import Cell, Table

    pooled = dict(campaign.pooled)
    best = sorted(campaign.published, key=lambda each: each.pooled["misplaced_force"].mean)
    pooled |= {f"{each.title}, {each.variant}": each.pooled for each in best[: _ROWS - len(pooled)]}
    shown = {name: METRICS[name] for name in SHOWN}
    return Table(
        name="models",
        caption="Fast model, simpler and published ones against finite elements",
        headings=("model", *(column.title for column in shown.values())),
        rows=[
            [Cell(text=model), *(Cell(text=column.text(means[name].mean)) for name, column in shown.items())]
            for model, means in pooled.items()
        ],
    )


def _tabulate_moving(results: Sequence[MovingResult]) -> Table:
    """Tabulate the scores of the fast model in the cases that change in time."""
    from validation.moving.results import MovingScore
    from validation.render.table import tabulate

    fast = [score for result in results for score in result.scores if score.model == "fast"]
    shown = ("case", "error", "misplaced", "touching", "sliding", "delay", "latency")
    return tabulate("moving", "Fast model in cases that change in time", fast, MovingScore, shown)


def _compare_measured_force(measured: str, *, json: bool) -> None:
    """Compare the finite elements with forces that were measured at known depths, and print the comparison.

    The moduli are fitted to some of the points, and the other points are scored, with the uncertainty of the
    comparison.  This is done without slip and without friction.

    Args:
        measured: A file of measured forces, or the name of a built-in measurement.
        json: Whether to print JSON.

    Raises:
        InputError: If the file has faults.
        MissingExtraError: If the finite elements are not installed.
        OSError: If the file exists and cannot be read.
    """
    from validation.extras import require
    from validation.measured_force.comparison import compare_measurement, read_measured_force

    started = time.perf_counter()
    given = read_measured_force(measured)
    require("skfem")
    with output.Progress() as progress:
        comparison = compare_measurement(given, progress)
    output.print_json(comparison.as_json()) if json else _show_measured(comparison, given)
    output.say(f"compared in {time.perf_counter() - started:.1f} s")


def _show_measured(comparison: ForceComparison, given: Measurement) -> None:
    output.show(f"{given.name}: {output.describe_cover(given.cover)}")
    output.show(f"source: {given.source}")
    for row in comparison.rows:
        output.show(f"{row.name}: {_describe_moduli(given, row)}")
    output.print_table(
        ("friction", "mm", "D [N]", "S [N]", "E", "u_val", "u_num", "u_input", "u_D"),
        _list_points(comparison),
        title="Measured force D, computed force S; error E = S - D and standard uncertainties in % of D",
    )
    output.show("abs(E) < u_val: the comparison cannot resolve an error of the model")
    names = list(comparison.rows[-1].inputs)
    output.print_table(("friction", "mm", *names), _list_inputs(comparison, names), title="Parts of u_input in % of D")
    for sentence in comparison.verdict:
        output.show(sentence)


def _describe_moduli(given: Measurement, row: Row) -> str:
    """Describe the fitted moduli with their 95 % interval: shear modulus of a single layer, or factor on all moduli."""
    layers = given.cover.layers
    unit, label = (layers[0].material.shear_modulus / 1e6, "MPa") if len(layers) == 1 else (1.0, "times those given")
    what = "shear modulus" if len(layers) == 1 else "moduli"
    ends = "" if row.interval is None else " ({:.4g}..{:.4g}, 95 %)".format(*(unit * end for end in row.interval))
    return f"{what} {unit * row.scale:.4g} {label}{ends}"


def _list_points(found: ForceComparison) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the printed comparison: each measured point that was not fitted, for each kind of friction."""
    for row, i in _list_scored(found):
        parts = (row.u_val[i], row.numerical[i], row.u_input[i], row.measured[i])
        yield (
            row.name,
            f"{1e3 * found.depth[i]:.4g}",
            f"{found.force[i]:.4g}",
            f"{row.predicted[i]:.4g}",
            f"{100 * row.error[i] / found.force[i]:+.1f}",
            *(f"{100 * part / found.force[i]:.1f}" for part in parts),
        )


def _list_inputs(found: ForceComparison, names: list[str]) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the printed uncertainties by input: each point not fitted, for each kind of friction."""
    for row, i in _list_scored(found):
        parts = {name: f"{100 * part[i] / found.force[i]:.2f} %" for name, part in row.inputs.items()}
        yield row.name, f"{1e3 * found.depth[i]:.4g}", *(parts.get(name, "") for name in names)


def _list_scored(found: ForceComparison) -> Iterator[tuple[Row, int]]:
    return ((row, i) for row in found.rows for i, fitted in enumerate(found.fitted) if not fitted)
