"""What `demo` and `validate` share: evaluate, write the report, print the summary."""

from __future__ import annotations

import time
from pathlib import Path

from validation.campaign.evaluation import Evaluation, evaluate
from validation.cli.failures import DONE, NOT_CONVERGED
from validation.cli.output import print_json, say
from validation.cli.progress import Progress
from validation.output_folder import new_folder
from validation.report import require, write_report
from validation.sensor_file import SensorDescription


def evaluate_into(
    out: Path,
    sensor: SensorDescription,
    *,
    recordings: Path | None,
    recorded: SensorDescription,
    json: bool,
) -> int:
    """Evaluate a sensor and write its report.

    Returns:
        The exit status: 4 if a case did not converge.

    Args:
        out: Folder of the report.
        sensor: What to evaluate.
        recordings: Folder of recordings, or None.
        recorded: The sensor that they were made with.
        json: Print the numbers as JSON instead of tables.

    Raises:
        InputError: If `out` cannot be replaced.
        MissingExtraError: If what writes a report is not installed.
        OSError: If `out` cannot be written.
    """
    started = time.perf_counter()
    require()
    with new_folder(out) as folder, Progress() as progress:
        evaluation = evaluate(sensor, recordings=recordings, recorded=recorded, progress=progress)
        progress("report")
        write_report(evaluation, folder)
    if json:
        print_json(evaluation.as_json())
    else:
        _print(evaluation)
    for each in evaluation.campaign.skipped:
        say(f"not scored: {each.case.name} ({each.case.shape}, {each.case.load:.3g} N): {each.reason}")
    say(f"report: {(out / 'index.html').absolute()} ({time.perf_counter() - started:.1f} s)")
    return DONE if all(each.converged for each in evaluation.campaign.skipped) else NOT_CONVERGED


def _print(evaluation: Evaluation) -> None:
    from rich.console import Console

    from validation.cli.tables import campaign_table, cover_text, recordings_table

    console = Console()
    sensor, fit = evaluation.sensor, evaluation.derivation.fit
    console.print(f"{sensor.name}, cover {cover_text(sensor.cover)}", highlight=False)
    console.print(
        f"kernel: sigma {fit.gaussian.sigma_x:.4f}, {fit.gaussian.sigma_y:.4f} pitches ({fit.estimator}), "
        f"residual {100 * fit.residual:.2f} %, outside the kernel {100 * fit.outside_kernel:.2f} %",
        highlight=False,
    )
    console.print(campaign_table(evaluation.campaign))
    if evaluation.recordings is not None:
        console.print(recordings_table(evaluation.recordings))
