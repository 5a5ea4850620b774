"""The command `python -m tactilebench`: list cases, write an empty file of forces, score a file of forces."""

from __future__ import annotations

import argparse
import io
import json
import os
import secrets
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from tactilebench.case import BenchError, Case, cases, load_truth
from tactilebench.draw import RELEASES, TIERS
from tactilebench.files import read_forces, write_template
from tactilebench.scoring import SCORES, list_scores, score

_EXAMPLES = """examples:
  python -m tactilebench cases --tier linear
  python -m tactilebench template --tier linear > mine.csv
  python -m tactilebench score mine.csv --tier linear --json mine.json
  python -m tactilebench score fresh.csv --truth truth-7.npz     fresh cases, whose truth softcover computed

Without --tier all tiers count.  Exit status: 0, or 2 if there is nothing to score, or a file is not whole or cannot
be written.
"""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """End with one line about words that are wrong, without the usage."""
        self.exit(2, f"tactilebench: {message}; see {self.prog} --help\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command, and return its exit status: 2 after a line about bad input, else 0."""
    options = _parse(arguments)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # the name of a file may have letters beyond the encoding
    try:
        text = _run(options)
    except BenchError as error:
        print(f"tactilebench: {error}", file=sys.stderr)
        return 2
    return show(text)


def show(text: str) -> int:
    """Print a text, and return the exit status: 2 after a line about an output that cannot be written, else 0."""
    if sys.stdout is None:  # closed before the start
        print("tactilebench: standard output is closed, and nothing was printed; open it", file=sys.stderr)
        return 2
    try:
        print(text, flush=True)
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            print(f"tactilebench: standard output cannot be written: {error.strerror}", file=sys.stderr)
            return 2
    return 0


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = _Parser(
        prog="python -m tactilebench", description="Score forces on the texels of tactile arrays against a truth.",
        epilog=_EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="cases | template | score")
    about = {
        "cases": "list the cases: name, bodies, load and cover",
        "template": "print a CSV file in which only the forces are missing",
        "score": "score a CSV or npz file of forces",
    }
    for verb, text in about.items():
        command = verbs.add_parser(verb, help=text, description=text)
        command.add_argument("--version", default="2026.1", choices=tuple(RELEASES), help="release of the cases")
        command.add_argument("--tier", action="append", choices=tuple(TIERS), help="only this tier; may be repeated")
        if verb == "score":
            command.add_argument("file", help="forces: CSV with case,instant,texel,force_n, or npz by case")
            command.add_argument("--truth", help="file of truth that softcover computed for fresh cases")
            command.add_argument("--json", help="write all scores to this file")
        else:
            command.add_argument("--seed", type=int, help="fresh cases of this seed instead of those of the release")
    return parser.parse_args(arguments)


def _run(options: argparse.Namespace) -> str:
    """Return what a command prints."""
    if options.verb != "score":
        known = _select(cases(options.version, seed=options.seed) if options.seed is not None else
                        cases(options.version), options.tier)  # fmt: skip
        return "\n".join(map(_describe, known) if options.verb == "cases" else write_template(known))
    for path in (options.file, options.truth):
        if None not in (path, options.json) and Path(options.json).resolve() == Path(path).resolve():
            raise BenchError(f"--json: {options.json} is also read; name another file for the scores")
    known = _select(load_truth(options.truth) if options.truth is not None else cases(options.version), options.tier)
    forces, outside = read_forces(options.file, known)
    result = score(forces, known, outside=outside)
    text = "\n".join(_tabulate(result))
    if options.json is not None:
        _write(Path(options.json), json.dumps(result, indent=1, allow_nan=False) + "\n")
        text += f"\nwrote {options.json}"
    return text


def _select(known: Sequence[Case], tiers: Sequence[str] | None) -> list[Case]:
    found = [case for case in known if tiers is None or case.tier in tiers]
    if not found:
        raise BenchError(f"--tier: no case of {', '.join(tiers or ())} is known here")
    return found


def _describe(case: Case) -> str:
    bodies = " and ".join(each.shape["shape"] for each in case.bodies)
    motion = f", {len(case.loads)} instants" if case.motion else ""
    cover = case.cover.geometry or f"{len(case.cover.layers)} x flat, {1e3 * case.cover.thickness:.3g} mm"
    return f"{case.name}  {bodies}, {case.load:.4g} N{motion}; {cover}; {case.shape[-1]} texels"


def _tabulate(result: dict[str, Any]) -> list[str]:
    """Return the lines of a table of means by tier, then all cases with their interval and floor."""
    names = list_scores()
    rows = [("", "cases", *(SCORES[name][0] for name in names)), ("", "", *(SCORES[name][1] for name in names))]
    for title, means in (*result["tiers"].items(), ("all", result["overall"])):
        rows.append((title, str(means["cases"]), *(_show(means, name, "value") for name in names)))
    rows += [
        (f"  {key}", "", *(_show(result["overall"], name, key) for name in names)) for key in ("low", "high", "floor")
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for title, *entries in rows:
        cells = [each.rjust(width) for each, width in zip(entries, widths[1:], strict=True)]
        lines.append("  ".join([title.ljust(widths[0]), *cells]))
    return [
        *lines,
        "Means over cases; low and high are their 95 % interval. The floor is what perfect forces may score, because",
        "the truth has an error of its own. IoU is best at 100 %, all others at 0.",
    ]


def _show(means: dict[str, Any], name: str, key: str) -> str:
    value = means[name][key]
    return "-" if value is None else f"{value * SCORES[name][2]:.3g}"


def _write(path: Path, text: str) -> None:
    """Write a file completely or not at all."""
    if path.exists() and not path.is_file():
        raise BenchError(f"--json: {path} is a folder, a device or a pipe, which is not replaced; name a file")
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        try:
            with part.open("x", encoding="utf-8") as file:
                file.write(text)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise BenchError(f"--json: {path} cannot be written: {error.strerror}") from None


if __name__ == "__main__":
    sys.exit(main())
