"""Write the packages that the base installation and each extra bring, with their licences, into docs/licences.md.

Names, versions and licences are those of the installed packages' metadata; sizes are those of their files.  Run it
where `.[all,docs,test]` is installed.

    python docs/licences.py            prints the table
    python docs/licences.py --write    writes it into docs/licences.md
"""

from __future__ import annotations

import platform
import sys
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

PAGE = Path(__file__).resolve().parent / "licences.md"
#: Lines of the page between which the table stands.
BEGIN, END = "<!-- licences: begin -->", "<!-- licences: end -->"
#: Extras in the order of the table; a package stands at the first that brings it.
EXTRAS = ("", "fem", "curved", "report", "device", "gym", "torch", "view", "sweep", "docs", "test")
#: Longest text of the field `License` that is taken for the name of a licence; others are the licence itself.
_LONGEST_NAME = 60


def main() -> None:
    """Print the table, or write it into the page."""
    table = "\n".join(make_table())
    print(table)
    if "--write" in sys.argv[1:]:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        after = rest.partition(END)[2]
        PAGE.write_text(f"{before}{BEGIN}\n{table}\n{END}{after}", encoding="utf-8")


def make_table() -> list[str]:
    """Return the lines of the table: each package once, at the first extra that brings it."""
    lines = ["| extra | package | version | licence, as its metadata says | size [MB] |", "|---|---|---|---|---|"]
    listed: set[str] = set()
    for extra in EXTRAS:
        for name in sorted(find_packages(extra) - listed):
            found = metadata.distribution(name)
            size = (
                sum(path.stat().st_size for file in found.files or () if (path := Path(file.locate())).is_file()) / 1e6
            )
            place = f"`{extra}`" if extra else "(base)"
            lines.append(f"| {place} | {name} | {found.version} | {find_licence(found)} | {size:.1f} |")
            listed.add(name)
    bits = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    return [*lines, "", f"Written on {bits}, by `python docs/licences.py --write`."]


def find_packages(extra: str) -> set[str]:
    """Find every package that the project needs with an extra, in lower case, on this system."""
    found: set[str] = set()
    waiting = [("softcover", frozenset({extra}))]
    seen = set(waiting)
    while waiting:
        name, extras = waiting.pop()
        for line in metadata.requires(name) or ():
            needed = Requirement(line)
            if needed.marker and not any(needed.marker.evaluate({"extra": each}) for each in extras):
                continue
            found.add(needed.name.lower().replace("_", "-"))
            following = (needed.name, frozenset({"", *needed.extras}))
            if following not in seen:
                seen.add(following)
                waiting.append(following)
    return found - {"softcover"}


def find_licence(found: metadata.Distribution) -> str:
    """Return the licence of a package: the expression, else the classifier, else the field of its metadata."""
    fields = found.metadata
    classifiers = [each for each in fields.get_all("Classifier") or () if each.startswith("License ::")]
    names = ", ".join(each.rpartition(" :: ")[2] for each in classifiers)
    text = (fields.get("License") or "").partition("\n")[0].strip()
    if "Proprietary" in names and text:
        names = f"{text} ({names})"
    return fields.get("License-Expression") or names or text[:_LONGEST_NAME] or "not stated"


if __name__ == "__main__":
    main()
