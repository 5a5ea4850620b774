"""Limits of the layout: small folders, short files and functions, no circular imports."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("meshes", "fem_reference", "fastmodel", "validation")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
FOLDERS = sorted({path.parent for path in FILES})
MOST_LINES, MOST_FUNCTION_LINES, MOST_MODULES = 700, 80, 20


def find_long_functions(source):
    return [
        f"{node.name} ({node.end_lineno - node.lineno + 1} lines)"
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and node.end_lineno - node.lineno + 1 > MOST_FUNCTION_LINES
    ]


def name_of(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(source, known):
    """Modules of the product that a source imports, also inside functions."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= names & known
            if node.module in known and names - known:
                found.add(node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names} & known
    return found


def sort_modules(graph):
    return list(TopologicalSorter(graph).static_order())


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_and_functions_are_short(folder):
    for path in folder.glob("*.py"):
        source = path.read_text()
        assert len(source.splitlines()) <= MOST_LINES, path
        assert find_long_functions(source) == [], path


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_folders_hold_few_modules(folder):
    if folder != ROOT / "validation" / "cli" / "commands":  # one file per command
        assert len(list(folder.glob("*.py"))) <= MOST_MODULES


def test_no_module_imports_itself_through_others():
    known = {name_of(path) for path in FILES}
    sort_modules({name_of(path): imports_of(path.read_text(), known) for path in FILES})


def test_planted_faults_are_seen():
    assert find_long_functions("def f():\n" + "    x = 1\n" * 80) == ["f (81 lines)"]
    assert imports_of("def f():\n    from a import b, value\n", {"a", "a.b"}) == {"a", "a.b"}
    with pytest.raises(CycleError):
        sort_modules({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}})
