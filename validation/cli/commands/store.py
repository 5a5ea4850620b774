"""The commands `softcover store list`, `verify` and `prune` list, check and delete stored finite-element results."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from validation.cli import options, output
from validation.cli.entry import CHECK_FAILED, DONE
from validation.errors import InputError

if TYPE_CHECKING:
    from fem_reference.result_store import Entry

#: Largest number of elements of a list of sizes that is printed in full [-].
_LONGEST_LIST = 3

store = App(
    name="store",
    help="""List, check and remove stored finite-element results.

    A stored result is used again for the same input and the same version of the code.  The results are in the user's
    cache folder, or in the folder that the environment variable SOFTCOVER_STORE names.

    Examples of use:

        softcover store list
        softcover store verify
        softcover store prune
    """,
)


@store.command(name="list")
def list_entries(*, json: options.Json = False) -> None:
    """List the stored results with their inputs, size and age, newest first.

    Examples of use:

        softcover store list
        softcover store list --json
    """
    from fem_reference import result_store

    found, code = result_store.entries(), result_store.code_version()
    if json:
        partial = result_store.count_partial_files()
        listed = _list_entries(found, code)
        output.print_json({"folder": str(result_store.folder()), "code": code, **listed, "partial_files": partial})
        return
    _show_entries(found, code)
    output.show(f"{_summarise(found)} in {result_store.folder()}")
    if other := sum(bool(entry.problem) or entry.code != code for entry in found):
        output.say(f"{other} of them cannot be used by this version; `softcover store prune` removes them")


@store.command(name="verify")
def verify_entries(*, json: options.Json = False) -> int:
    """Read and check every stored result; print the damaged ones, and exit with 1 if there are any.

    Examples of use:

        softcover store verify
        softcover store verify --json
    """
    from fem_reference import result_store

    checked = result_store.verify()
    damaged = [{"key": e.key, "path": str(e.path), "problem": e.problem} for e in checked if e.problem]
    if json:
        counts = {"checked": len(checked), "partial_files": result_store.count_partial_files()}
        output.print_json({"folder": str(result_store.folder()), "damaged": damaged, **counts})
    else:
        for entry in damaged:
            output.show(f"{entry['path']}: {entry['problem']}")
        output.show(f"{_summarise(checked)} checked, {len(damaged) or 'none'} damaged")
        if damaged:
            output.say("damaged entries are never used: they are computed again, or removed by `softcover store prune`")
    return CHECK_FAILED if damaged else DONE


@store.command(name="prune")
def prune_entries(
    *,
    older_than: Annotated[str | None, Parameter(metavar="TIME", allow_leading_hyphen=True)] = None,
    keep_latest: int | None = None,
    other_code: bool = False,
    everything: Annotated[bool, Parameter(name="--all")] = False,
    dry_run: bool = False,
    json: options.Json = False,
) -> None:
    """Remove stored results of other code versions, or those that the options choose, and print what was removed.

    A result is removed only if all given options choose it.  Damaged results and unfinished files of killed processes
    are always removed.

    Examples of use:

        softcover store prune
        softcover store prune --older-than 30d --dry-run
        softcover store prune --keep-latest 100
        softcover store prune --all

    Args:
        older_than: Remove only what was written longer ago, e.g. 30d, 12h.
        keep_latest: Keep this many of the newest entries.
        other_code: Remove only what other versions of softcover or its libraries wrote; so does `prune` without
            options.
        everything: Remove every entry.
        dry_run: Only say what would be removed.
    """
    from fem_reference import result_store
    from validation.text.quantity import read_quantity

    age = 0.0 if older_than is None else read_quantity(older_than, "time", place="--older-than", example="30 days")
    if age < 0:
        raise InputError(f"--older-than: accepted: 0 days or more, not {older_than!r}")
    options.check_range("--keep-latest", keep_latest)
    if everything and (older_than or other_code or keep_latest is not None):
        raise InputError("--all: removes every entry; leave out --older-than, --keep-latest and --other-code")
    found, code = result_store.verify(), result_store.code_version()
    kept = code if other_code or not (everything or older_than is not None or keep_latest is not None) else None
    removed: list[Entry] = []
    failures: list[OSError] = []
    for entry in _choose(found, age=age, keep_latest=keep_latest or 0, kept=kept):
        try:
            if not dry_run:
                result_store.remove(entry)
            removed.append(entry)
        except OSError as error:
            failures.append(error)
    swept = 0 if dry_run else result_store.sweep_leftovers()
    left = len(found) - len(removed)
    if json:
        listed = _list_entries(removed, code, name="removed")
        output.print_json({"dry_run": dry_run, **listed, "kept": left, "partial_files_removed": swept})
    else:
        _show_entries(removed, code)
        also = f", and {swept} unfinished files of killed processes" if swept else ""
        output.show(f"{_summarise(removed)} {'would be removed' if dry_run else 'removed'}{also}; {left} kept")
    if failures:
        raise failures[0]


def _choose(found: Sequence[Entry], *, age: float, keep_latest: int, kept: str | None) -> list[Entry]:
    """Choose the stored results to remove: damaged ones, and those that meet all conditions.

    Args:
        found: All stored results, newest first.
        age: Smallest age of an undamaged result that is removed [s].
        keep_latest: Number of the newest undamaged results that are kept [-].
        kept: Version of the code whose results are kept; None for none.
    """
    latest = {entry.key for entry in [entry for entry in found if not entry.problem][:keep_latest]}
    written = time.time() - age
    return [e for e in found if e.problem or not (e.key in latest or e.created > written or e.code == kept)]


def _show_entries(found: Sequence[Entry], code: str) -> None:
    """Print one line for each stored result: key, size, age, state, and a description of its inputs."""
    from rich.filesize import decimal

    for entry in found:
        state = "damaged" if entry.problem else "" if entry.code == code else "other code"
        seconds = max(0.0, time.time() - entry.created)
        units = (("d", 86_400), ("h", 3600), ("min", 60), ("s", 1))
        age = next(f"{seconds / length:.0f} {unit}" for unit, length in units if seconds >= length or length == 1)
        what = f"{str(entry.kind).replace('-', ' ')}: {_describe_inputs(entry.inputs)}"
        output.show(f"{entry.key[:12]}  {decimal(entry.size):>9}  {age:>6}  {state:10}  {what}")


def _list_entries(found: Sequence[Entry], code: str, *, name: str = "entries") -> dict[str, Any]:
    """Return stored results and the sum of their sizes as JSON values.

    Args:
        found: The stored results.
        code: Present version of the code; results of other versions are not usable.
        name: Key of the list of results.
    """
    entries = [
        {
            "key": entry.key,
            "kind": entry.kind,
            "about": _describe_inputs(entry.inputs),
            "bytes": entry.size,
            "created": datetime.fromtimestamp(entry.created, UTC).isoformat(timespec="seconds"),
            "code": entry.code,
            "usable": not entry.problem and entry.code == code,
            "problem": entry.problem or None,
        }
        for entry in found
    ]
    return {name: entries, "bytes": sum(entry.size for entry in found)}


def _describe_inputs(inputs: Mapping[str, Any]) -> str:
    """Describe the inputs of a stored result in one line of text."""
    try:
        parts = [text for name, value in inputs.items() if (text := _format_input(name, value))]
    except (ArithmeticError, LookupError, TypeError, ValueError):  # Another program wrote the entry.
        return "unknown"
    return ", ".join(parts) or "unknown"


def _format_input(name: str, value: object) -> str:
    match name, value:
        case "cover", {"layers": layers, "base": base}:
            text = " + ".join(f"{1e3 * layer['thickness']:.4g} mm {layer['material']['name']}" for layer in layers)
            return f"{text}, {base}"
        case "indenter", {"@type": kind, **sizes}:
            text = ",".join(f"{key}={_format_size(str(key), size)}" for key, size in sizes.items())
            return f"{str(kind).rpartition('.')[2].lower()}:{text}"
        case (("load" | "force"), float() | int()):
            return f"{value:.4g} N"
        case (("depth" | "thickness"), float() | int()):
            return f"{name} {1e3 * value:.4g} mm"
    return ""


def _format_size(name: str, size: object) -> str:
    """Format a length, an angle (of the parameter `angle`) or a list of lengths of an indenter, given in SI units."""
    if isinstance(size, list):
        long = len(size) > _LONGEST_LIST
        return f"{len(size)} values" if long else "x".join(_format_size(name, part) for part in size)
    if not isinstance(size, float):
        return str(size)
    return f"{math.degrees(size):.4g}deg" if name == "angle" else f"{1e3 * size:.4g}mm"


def _summarise(found: Sequence[Entry]) -> str:
    from rich.filesize import decimal

    noun = "entry" if len(found) == 1 else "entries"
    return f"{len(found)} {noun}, {decimal(sum(entry.size for entry in found))}"
