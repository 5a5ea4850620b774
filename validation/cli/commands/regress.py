"""The command `softcover regress`, which compares everything that a sensor's fast model does with stored values."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from validation.cli import options, output
from validation.cli.entry import CHECK_FAILED, DONE
from validation.errors import InputError

#: Change over its tolerance from which on the quantity is named; smaller changes may be rounding [-].
_LEAST_NAMED = 0.01


def regress(
    sensor: options.Sensor,
    *,
    baseline: options.File = Path("baseline.json"),
    update: bool = False,
    junit: options.File | None = None,
    out: options.Folder | None = None,
    seed: int = 0,
    json: options.Json = False,
) -> int:
    """Compare what the fast model of a sensor measures with a stored baseline; exit with 1 if anything changed.

    Checks the fitted kernel, the filter under a load step, noise, characteristic, saturation, frames, the orientation
    of images, contact methods, metrics and accuracy against finite elements, and prints a line for each change.  For a
    folder that `derive --out` wrote, what needs finite elements is left out.

    Examples of use:

        softcover regress wts-0614-34 --update
        softcover regress wts-0614-34 --out verdict
        softcover regress sensor.toml --baseline ci/sensor.json --junit regress.xml

    Args:
        baseline: File with the stored values.
        update: Store the present values and print what changed, instead of checking.
        junit: File for the verdict as JUnit XML, one test case per quantity.
        out: Folder for regress.csv, each change over its tolerance.
        seed: Seed of the noise, from 0 on; no seed changes the verdict.
    """
    from validation import api
    from validation.output_folder import check_writable, optional_folder
    from validation.regression.baseline import write_junit

    _check_options(baseline, junit, out, seed, update=update)
    check_writable(junit, baseline if update else None)
    source = options.read_sensor(sensor, any_cover=True)
    with optional_folder(out) as folder, output.Progress() as progress:
        options.tell_unused(source, ", and this check computes its finite elements without")
        found = api.regress(source, baseline=baseline, update=update, seed=seed, progress=progress)
        if folder:
            (folder / "regress.csv").write_text(found.to_csv(), encoding="utf-8")
    if json:
        output.print_json(found.as_json())
    else:
        for change in found.changes:
            output.show(f"{change.quantity}: {change.text}")
    for reason in dict.fromkeys(found.failures.values()):
        titles = "; ".join(title for title, each in found.failures.items() if each == reason)
        output.say(f"not measured: {titles}: {reason}")
    count, readings = len(found.changes), found.now.readings
    if update:
        output.say(
            f"wrote {baseline}: {len(readings)} quantities, {'all' if found.stored is None else count} changed or new"
        )
        return DONE
    name = found.now.sensor.partition(":")[0]
    output.say(f"{len(readings)} quantities of {name} measured in {found.seconds:.1f} s: {count or 'none'} changed")
    output.say(explain_verdict(found.ratios))
    if count:
        if found.other_versions:
            output.say(f"other versions than in the baseline: {', '.join(found.other_versions)}")
        output.say(f"if the changes are meant: softcover regress {sensor} --baseline {baseline} --update")
    if junit is not None:
        write_junit(junit, found.now.sensor, readings, found.changes, seconds=found.seconds)
    if out is not None:
        output.say(f"wrote regress.csv to {out}")
    return CHECK_FAILED if count else DONE


def _check_options(baseline: Path, junit: Path | None, out: Path | None, seed: int, *, update: bool) -> None:
    """Refuse options that exclude each other and files that cannot be written, before the long computation."""
    clashing = [name for name, path in (("--junit", junit), ("--out", out)) if update and path is not None]
    faults = [f"{option}, --update: give one of the two; --update checks nothing" for option in clashing]
    if seed < 0:
        faults.append(f"--seed: accepted: 0 or more, not {seed}")
    written = {"--baseline": baseline if update else None, "--junit": junit}
    for option, path in ((option, path) for option, path in written.items() if path is not None):
        if path.is_dir():
            faults.append(f"{option}: {path} is a folder; name a file")
        elif not next(parent for parent in path.absolute().parents if parent.exists()).is_dir():
            faults.append(f"{option}: {path} lies below a file; name a file in a folder")
    if faults:
        raise InputError(*faults)


def explain_verdict(changes: Mapping[str, float]) -> str:
    """Explain in a few sentences which quantities left their tolerances.

    Args:
        changes: Largest change of each quantity over its tolerance [-], by title of the quantity.
    """
    moved = [title for title, value in changes.items() if not value <= 1]
    if not moved:
        worst = max(changes, key=lambda title: changes[title], default="")
        if not worst:
            near = ""
        elif changes[worst] < _LEAST_NAMED:
            near = f"; none changed by more than {_LEAST_NAMED:g} of its tolerance"
        else:
            near = f"; the largest change is {changes[worst]:.2g} of its tolerance ({worst})"
        return f"All {len(changes)} quantities are within their tolerances{near}."
    groups = ", ".join(dict.fromkeys(title.partition(":")[0] for title in moved))
    return (
        f"{len(moved)} of {len(changes)} quantities left their tolerances, in: {groups}. An improvement counts as a "
        "change too. Look for the cause in the first group: later ones follow from it."
    )
