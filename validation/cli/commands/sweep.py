"""The command `softcover sweep`, which measures many designs of a sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from validation.cli import options, output
from validation.cli.entry import DONE, OUTSIDE_FAILED

#: Largest numbers of designs and of quantities that are printed [-].
_ROWS, _QUANTITIES = 40, 4


def sweep(
    file: Annotated[Path, Parameter(help="Sweep file: sensor, keys that vary, and what is measured.")],
    *,
    wish: options.Text | None = None,
    out: options.Folder | None = None,
    workers: int | None = None,
    cluster: options.Text | None = None,
    only_plan: bool = False,
    json: options.Json = False,
) -> int:
    """Measure many designs of a sensor, here or on a cluster, and find those that meet a wish.

    Results are kept in the store: the same command goes on where a killed one stopped. What a design refuses, and what
    does not converge, is a result. Ends with 3 if designs were lost with their workers.

    Examples of use:

        softcover sweep sweep.toml --only-plan
        softcover sweep sweep.toml --workers 2 --out designs
        softcover sweep sweep.toml --wish "width_x < 4 mm, load_5_percent > 5 N"
        softcover sweep sweep.toml --cluster tcp://node1:8786

    Args:
        wish: Conditions on quantities; tells certain, possible and excluded designs with the reason.
        out: Folder for sweep.nc, maps and a page.
        workers: Compute in so many processes of this machine.
        cluster: Compute on a running cluster: address or file of its scheduler.
        only_plan: State number and cost of the designs, and compute none.
    """
    from validation.sweeps import verb
    from validation.sweeps.page import tabulate

    options.check_range("--workers", workers, most=1024)
    with output.Progress() as progress:
        found = verb.sweep(
            file, wish=wish, out=out, workers=workers, cluster=cluster, only_plan=only_plan, progress=progress,
            announce=output.say,
        )  # fmt: skip
    if json:
        output.print_json(found.as_json())
    elif not only_plan:
        names = list(dict.fromkeys(each.name for each in found.wish)) or list(found.quantities)[:_QUANTITIES]
        table = tabulate(found, names, brief=True)
        output.print_table(
            table.headings,
            [[c.text for c in row] for row in table.rows[:_ROWS]],
            title=table.caption,
            left=len(found.tables.designs),
        )
        output.print_meaning(found.explain())
        if len(table.rows) > _ROWS or len(found.quantities) > len(names):
            output.show_wrapped("--out FOLDER and --json have all designs and quantities.")
    if out is not None:
        output.say(f"wrote {out}")
    return OUTSIDE_FAILED if found.lost else DONE
