"""The commands `softcover demo` and `softcover validate`, which score a sensor's fast model and write a report."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.entry import BAD_INPUT, CHECK_FAILED, DONE, INTERRUPTED, NOT_CONVERGED
from validation.cli.options import Json, Layers, MaterialName, SensorFile, Thickness
from validation.cli.output import Progress, describe_cover, make_console, note, print_json, say, show, show_wrapped
from validation.errors import InputError

if TYPE_CHECKING:
    from validation.campaign.campaign_file import Campaign
    from validation.campaign.evaluation import Evaluation
    from validation.campaign.results import CampaignResult
    from validation.data_sets.data_set import DataSet
    from validation.render.table import Table
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
_Measured = Annotated[
    str | None,
    Parameter(
        help="File of measured forces with their own cover, or gelsight-mini: compare the finite elements with them."
    ),
]

#: Built-in sensor that `softcover demo` evaluates, and built-in sensor that made the recordings under known weights.
_DEMO, _RECORDED = "wts-0614-34", "sdh2-distal"
#: Names of the metrics in the printed table of scores; number of its rows [-].
SHOWN = ("misplaced_force", "centre_of_pressure_m", "image_changed_percent")
_ROWS = 10


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
    from validation.data_sets.data_set import find_data_set
    from validation.sensor_file import BUILT_IN

    data_set = find_data_set(recordings)
    recorded = BUILT_IN[_RECORDED]
    return _evaluate(BUILT_IN[_DEMO], None, out, quick=quick, recordings=data_set, recorded=recorded, json=json)


def validate(
    sensor: SensorFile,
    *,
    campaign: _Campaign = None,
    quick: _Quick = False,
    recordings: _Recordings = None,
    data_set: _DataSet = None,
    measured: _Measured = None,
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
        softcover validate wts-0614-34 --measured gelsight-mini
    """
    from meshes import SolidCover
    from validation.cli.options import read_description
    from validation.data_sets.data_set import describe_unused_recordings, find_data_set

    if measured is not None:
        if quick or any(given is not None for given in (campaign, recordings, data_set, material, thickness, layer)):
            raise InputError("--measured: measured forces have a cover of their own; leave out all options but --json")
        from validation.cli.measured_force import compare_measured_force

        compare_measured_force(measured, json=json)
        return DONE
    description = read_description(sensor, material=material, thickness=thickness, layers=layer, curved=True)
    if isinstance(description.cover, SolidCover) and (recordings is not None or data_set is not None):
        raise InputError("--recordings, --data-set: recordings of curved covers are not scored; leave them out")
    # Recordings belong to one sensor.  Those of the environment variable may be of another sensor, so only recordings
    # that the user names are used.
    found = None if recordings is None and data_set is None else find_data_set(recordings, data_set)
    if found is None and (sentence := describe_unused_recordings()):
        note(sentence)
    return _evaluate(description, campaign, out, quick=quick, recordings=found, recorded=description, json=json)


def _read_campaign(path: Path | None, sensor: SensorDescription, *, quick: bool) -> Campaign:
    """Read a campaign file or the default campaign, and shorten it for a quick run; faults in cases are printed."""
    from validation.campaign.evaluation import read_plan

    with Progress() as progress:
        campaign = read_plan(path, sensor, progress)
    for line in campaign.left_out:
        say(f"softcover: left out: {line}")
    return campaign.shorten() if quick else campaign


def _evaluate(
    sensor: SensorDescription,
    campaign: Path | None,
    out: Path,
    *,
    quick: bool,
    recordings: DataSet | None,
    recorded: SensorDescription,
    json: bool,
) -> int:
    """Evaluate a sensor, write the report and print a summary.

    Args:
        sensor: The sensor to evaluate.
        campaign: Campaign file; None for the default campaign.
        out: Folder of the report.
        quick: Whether six cases suffice.
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
    from validation.campaign.evaluation import evaluate
    from validation.report import write_report

    plan = _read_campaign(campaign, sensor, quick=quick)
    _tell_friction(sensor)
    with new_folder(out) as folder, Progress() as progress:
        evaluation = evaluate(
            sensor, campaign=plan, recordings=recordings, recorded=recorded, progress=progress, announce=say
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
    """Print the verdict in words and a table of at most ten models; the report has the rest."""
    from validation.campaign.results import describe_reference_error

    sensor, campaign, verdict = evaluation.sensor, evaluation.campaign, evaluation.verdict
    show_wrapped(f"{sensor.name}, cover {describe_cover(sensor.cover)}", further="  ")
    show_wrapped(f"Intended use: {evaluation.plan.intended_use}", further="  ")
    show_wrapped(verdict.sentence, further="  ")
    for reason in verdict.reasons:
        show_wrapped(f"- {reason}", indent="  ", further="  ")
    make_console().print(_tabulate(campaign).to_rich())
    show_wrapped(
        f"Means over {len(campaign.cases)} cases; own error of the reference: "
        f"{describe_reference_error(campaign)}. All models and intervals are in the report."
    )
    scores = evaluation.recordings
    for split, notes in scores.notes.items() if scores else ():
        show_wrapped(f"Recordings, {scores.about[split] if scores else ''}: {'; '.join(notes)}", further="  ")


def _tabulate(campaign: CampaignResult) -> Table:
    """Make the table of our models, the null models and the best published ones, ten rows at most."""
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
