"""The verdict of a regression check as JUnit XML, which CI services show."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from validation.output_folder import write_text
from validation.regression.baseline import Change


def write_junit(path: Path, sensor: str, titles: Iterable[str], changes: Sequence[Change], *, seconds: float) -> None:
    """Write one test case for each quantity, which fails if the quantity changed; completely or not at all.

    Args:
        path: The file.
        sensor: The sensor in one line.
        titles: Titles of all quantities.
        changes: The quantities that changed.
        seconds: Duration of the check [s].

    Raises:
        OSError: If the file cannot be written.
    """
    changed = {change.quantity: change for change in changes}
    names = sorted({*titles, *changed})
    counts = {"tests": str(len(names)), "failures": str(len(changed)), "errors": "0", "time": f"{seconds:.1f}"}
    suite = ET.Element("testsuite", {"name": _clean(f"softcover regress, {sensor}"), **counts})
    for title in names:
        group, _, name = title.partition(": ")
        case = ET.SubElement(suite, "testcase", {"classname": _clean(group), "name": _clean(name or group)})
        if title in changed:
            message = _clean(f"{title}: {changed[title].text}")
            failure = ET.SubElement(case, "failure", {"type": "changed", "message": message})
            failure.text = message
    root = ET.Element("testsuites", counts)
    root.append(suite)
    ET.indent(root)
    write_text(path, ET.tostring(root, encoding="unicode") + "\n")


def _clean(text: str) -> str:
    """Replace characters that XML does not allow."""
    return "".join(each if each.isprintable() else "?" for each in text)
