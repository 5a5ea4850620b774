"""The command `softcover regress`, which compares the accuracy of a sensor's fast model with stored scores."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli.failures import CHECK_FAILED, DONE
from validation.cli.options import Json, SensorFile
from validation.cli.output import print_json, print_table, say, show
from validation.cli.progress import Progress

if TYPE_CHECKING:
    from rich.text import Text

    from validation.regress import Change


def regress(
    sensor: SensorFile,
    *,
    baseline: Annotated[Path, Parameter(help="File with the stored scores.")] = Path("baseline.json"),
    update: Annotated[bool, Parameter(help="Store the present scores instead of comparing.")] = False,
    json: Json = False,
) -> int:
    """Compare the fast model's accuracy with a stored baseline; exit with 1 if it dropped.

    Examples of use:

        softcover regress wts-0614-34 --baseline baseline.json --update
        softcover regress wts-0614-34 --baseline baseline.json
    """
    from validation.campaign.case import default_cases
    from validation.campaign.run import run_campaign
    from validation.cli.sensors import read_description
    from validation.derivation.derive import derive
    from validation.regress import compare_baselines, load_baseline, make_baseline

    description = read_description(sensor)
    # Read the baseline first, so that a fault in it is reported before the long computation.
    stored = None if update else load_baseline(baseline)
    with Progress() as progress:
        parameters = derive(description, progress=progress).parameters
        campaign = run_campaign(description.cover, parameters, default_cases(description.array), progress=progress.step)
    now = make_baseline(description, campaign)
    cases = len(now.scores) - 1
    if stored is None:
        now.save(baseline)
        say(f"wrote {baseline}: {cases} cases")
        return DONE
    changes = compare_baselines(stored, now)
    worse = sum(change.worse for change in changes)
    if json:
        print_json({"worse": worse, "changes": [asdict(change) for change in changes], "scores": now.scores})
        return CHECK_FAILED if worse else DONE
    if changes:
        headings = ("case", "metric", "before", "now", "tolerance", "")
        print_table(headings, _list_changes(changes), title="Scores that moved by more than their tolerance", left=2)
    show(f"{cases} cases: {f'{worse} scores became worse' if worse else 'no score became worse'}")
    if changes and not worse:
        show("accuracy rose: store it with --update")
    return CHECK_FAILED if worse else DONE


def _list_changes(changes: Sequence[Change]) -> Iterator[tuple[str | Text, ...]]:
    from rich.text import Text

    from validation.regress import TOLERANCES

    for change in changes:
        numbers = (change.before, change.now, TOLERANCES[change.metric])
        verdict = Text("worse", style="red") if change.worse else Text("better", style="green")
        yield change.case, change.metric, *("none" if value is None else f"{value:.4g}" for value in numbers), verdict
