"""`softcover regress`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from validation import regress as gate
from validation.campaign.case import default_cases
from validation.campaign.run import run_campaign
from validation.cli.failures import CHECK_FAILED, DONE
from validation.cli.options import Json, Sensor
from validation.cli.output import print_json, say
from validation.cli.progress import Progress
from validation.derivation.derive import derive
from validation.sensor_file import load


def regress(
    sensor: Sensor,
    *,
    baseline: Annotated[Path, Parameter(help="File with the stored scores.")] = Path("baseline.json"),
    update: Annotated[bool, Parameter(help="Store the present scores instead of comparing.")] = False,
    json: Json = False,
) -> int:
    """Compare the fast model's accuracy with a stored baseline; leave with 1 when it dropped."""
    description = load(sensor)
    # A bad baseline is found before the long work.
    stored = None if update else gate.load_baseline(baseline)
    with Progress() as progress:
        parameters = derive(description, progress=progress).parameters
        campaign = run_campaign(description.cover, parameters, default_cases(description.array), progress=progress.step)
    now = gate.make_baseline(description, campaign)
    if stored is None:
        now.save(baseline)
        say(f"wrote {baseline}: {len(now.scores) - 1} cases")
        return DONE
    changes = gate.compare_baselines(stored, now)
    worse = sum(change.worse for change in changes)
    if json:
        print_json({"worse": worse, "changes": [asdict(change) for change in changes], "scores": now.scores})
    else:
        _print(changes, len(now.scores) - 1)
    return CHECK_FAILED if worse else DONE


def _print(changes: Sequence[gate.Change], cases: int) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    worse = sum(change.worse for change in changes)
    if changes:
        table = Table(title="Scores that moved by more than their tolerance")
        for heading in ("case", "metric", "before", "now", "tolerance", ""):
            table.add_column(heading, justify="left" if heading in ("case", "metric") else "right")
        for change in changes:
            verdict = "[red]worse[/red]" if change.worse else "[green]better[/green]"
            numbers = (_text(change.before), _text(change.now), _text(gate.TOLERANCES[change.metric]))
            table.add_row(change.case, change.metric, *numbers, verdict)
        console.print(table)
    verdict = f"{worse} scores became worse" if worse else "no score became worse"
    console.print(f"{cases} cases: {verdict}", highlight=False)
    if changes and not worse:
        console.print("accuracy rose: store it with --update", highlight=False)


def _text(value: float | None) -> str:
    return "none" if value is None else f"{value:.4g}"
