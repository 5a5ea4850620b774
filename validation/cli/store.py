"""`softcover store list`, `verify` and `prune`: the results that the reference keeps."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from validation.cli.failures import CHECK_FAILED, DONE
from validation.cli.options import Json
from validation.cli.output import print_json, say, show
from validation.errors import InputError

if TYPE_CHECKING:
    from fem_reference.result_store import Entry

OlderThan = Annotated[
    str | None, Parameter(name="--older-than", help="Remove only what was written longer ago, e.g. 30d, 12h.")
]
KeepLatest = Annotated[int | None, Parameter(name="--keep-latest", help="Keep this many of the newest entries.")]
OtherCode = Annotated[
    bool,
    Parameter(
        name="--other-code",
        help="Remove only what other versions of softcover or its libraries wrote; so does `prune` without options.",
    ),
]
Everything = Annotated[bool, Parameter(name="--all", help="Remove every entry.")]
DryRun = Annotated[bool, Parameter(name="--dry-run", help="Only say what would be removed.")]

#: What the kinds of entries are called; others keep their own name.
_KINDS = {"point-spread": "point spread"}

#: The longest list of sizes that is written out.
_SIZES = 3


def list_entries(*, json: Json = False) -> None:
    """List the kept results, newest first."""
    from fem_reference import result_store

    found = result_store.entries()
    if json:
        print_json(
            {
                "folder": str(result_store.folder()),
                "code": result_store.code_version(),
                "entries": [_as_json(entry) for entry in found],
                "bytes": sum(entry.size for entry in found),
                "partial_files": result_store.partial_files(),
            }
        )
        return
    _print_lines(found)
    other = sum(not _usable(entry) for entry in found)
    show(f"{_summary(found)} in {result_store.folder()}")
    if other:
        say(f"{other} of them cannot be used by this version; `softcover store prune` removes them")


def verify_entries(*, json: Json = False) -> int:
    """Read every kept result and check it; leave with 1 when one is damaged."""
    from fem_reference import result_store

    checked = result_store.verify()
    damaged = [entry for entry in checked if entry.problem]
    if json:
        print_json(
            {
                "folder": str(result_store.folder()),
                "checked": len(checked),
                "damaged": [{"key": e.key, "path": str(e.path), "problem": e.problem} for e in damaged],
                "partial_files": result_store.partial_files(),
            }
        )
    else:
        for entry in damaged:
            show(f"{entry.path}: {entry.problem}")
        show(f"{_summary(checked)} checked, {len(damaged) or 'none'} damaged")
        if damaged:
            say("damaged entries are never used: they are computed again, or removed by `softcover store prune`")
    return CHECK_FAILED if damaged else DONE


def prune_entries(
    *,
    older_than: OlderThan = None,
    keep_latest: KeepLatest = None,
    other_code: OtherCode = False,
    everything: Everything = False,
    dry_run: DryRun = False,
    json: Json = False,
) -> None:
    """Remove kept results: those of other code versions, or those that the options choose.

    Options narrow one another.  Damaged entries and what killed writers left always go.
    """
    from fem_reference import result_store

    age = _age_limit(older_than)
    if keep_latest is not None and keep_latest < 0:
        raise InputError(f"--keep-latest: must be 0 or more, not {keep_latest}")
    if everything and (older_than or other_code or keep_latest is not None):
        raise InputError("--all: removes every entry; leave out --older-than, --keep-latest and --other-code")
    if not everything and older_than is None and keep_latest is None:
        other_code = True
    found = result_store.verify()
    chosen = list(_chosen(found, age=age, keep_latest=keep_latest or 0, other_code=other_code))
    removed, failures = (chosen, []) if dry_run else _remove(chosen)
    swept = 0 if dry_run else result_store.sweep_leftovers()
    _report(removed, kept=len(found) - len(removed), swept=swept, dry_run=dry_run, as_json=json)
    if failures:
        raise failures[0]


def _age_limit(older_than: str | None) -> float:
    from validation.text.quantity import read_quantity

    if older_than is None:
        return 0.0
    limit = read_quantity(older_than, "time", place="--older-than")
    if limit < 0:
        raise InputError(f"--older-than: must not be negative, not {older_than!r}; write for example '30 d'")
    return limit


def _chosen(found: Iterable[Entry], *, age: float, keep_latest: int, other_code: bool) -> Iterator[Entry]:
    """Entries to remove out of `found`, which is newest first."""
    from fem_reference import result_store

    now, kept = time.time(), 0
    for entry in found:
        if entry.problem:
            yield entry
            continue
        kept += 1
        young = now - entry.created < age
        ours = other_code and entry.code == result_store.code_version()
        if kept > keep_latest and not young and not ours:
            yield entry


def _remove(chosen: Iterable[Entry]) -> tuple[list[Entry], list[OSError]]:
    from fem_reference import result_store

    removed, failures = [], []
    for entry in chosen:
        try:
            result_store.remove(entry)
        except OSError as error:
            failures.append(error)
        else:
            removed.append(entry)
    return removed, failures


def _report(removed: list[Entry], *, kept: int, swept: int, dry_run: bool, as_json: bool) -> None:
    freed = sum(entry.size for entry in removed)
    if as_json:
        print_json(
            {
                "dry_run": dry_run,
                "removed": [_as_json(entry) for entry in removed],
                "bytes": freed,
                "kept": kept,
                "partial_files_removed": swept,
            }
        )
        return
    _print_lines(removed)
    done = "would be removed" if dry_run else "removed"
    left = f", and {swept} unfinished files of killed writers" if swept else ""
    show(f"{_summary(removed)} {done}{left}; {kept} kept")


def _print_lines(found: Iterable[Entry]) -> None:
    """One line per entry; what it is comes last, since it may be long."""
    for entry in found:
        what = f"{_KINDS.get(entry.kind, entry.kind)}: {_about(entry.inputs)}"
        show(f"{entry.key[:12]}  {_size(entry.size):>7}  {_age(entry.created):>6}  {_state(entry):10}  {what}")


def _as_json(entry: Entry) -> dict[str, Any]:
    return {
        "key": entry.key,
        "kind": entry.kind,
        "about": _about(entry.inputs),
        "bytes": entry.size,
        "created": datetime.fromtimestamp(entry.created, UTC).isoformat(timespec="seconds"),
        "code": entry.code,
        "usable": _usable(entry),
        "problem": entry.problem or None,
    }


def _usable(entry: Entry) -> bool:
    from fem_reference import result_store

    return not entry.problem and entry.code == result_store.code_version()


def _state(entry: Entry) -> str:
    if entry.problem:
        return "damaged"
    return "" if _usable(entry) else "other code"


def _about(inputs: Mapping[str, Any]) -> str:
    """What a result was computed from, in a line."""
    parts = [text for name, value in inputs.items() if (text := _input_text(name, value))]
    return ", ".join(parts) or "unknown"


def _input_text(name: str, value: object) -> str:
    match name, value:
        case "cover", {"layers": layers, "base": base}:
            text = " + ".join(f"{1e3 * layer['thickness']:.4g} mm {layer['material']['name']}" for layer in layers)
            return f"{text}, {base}"
        case "indenter", {"@type": kind, **sizes}:
            text = ",".join(f"{key}={_size_text(str(key), size)}" for key, size in sizes.items())
            return f"{str(kind).rpartition('.')[2].lower()}:{text}"
        case (("load" | "force"), float() | int()):
            return f"{value:.4g} N"
        case (("depth" | "thickness"), float() | int()):
            return f"{name} {1e3 * value:.4g} mm"
    return ""


def _size_text(name: str, size: object) -> str:
    """A size of an indenter as the command line writes it; long tables are only counted."""
    if isinstance(size, list):
        return "x".join(_size_text(name, part) for part in size) if len(size) <= _SIZES else f"{len(size)} values"
    if not isinstance(size, float):
        return str(size)
    return f"{math.degrees(size):.4g}deg" if name == "angle" else f"{1e3 * size:.4g}mm"


def _summary(found: list[Entry]) -> str:
    noun = "entry" if len(found) == 1 else "entries"
    return f"{len(found)} {noun}, {_size(sum(entry.size for entry in found))}"


def _size(count: int) -> str:
    """Bytes as people read them."""
    value = float(count)
    for unit in ("B", "kB", "MB", "GB"):
        if value < 1000:  # noqa: PLR2004 -- the next unit
            return f"{value:.3g} {unit}"
        value /= 1000
    return f"{value:.3g} TB"


def _age(created: float) -> str:
    """Time since then as people read it."""
    seconds = max(0.0, time.time() - created)
    for unit, length in (("d", 86_400), ("h", 3600), ("min", 60)):
        if seconds >= length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} s"
