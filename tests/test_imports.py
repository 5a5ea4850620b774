"""Data flows one way, and a robot user needs neither finite elements nor VTK."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("meshes", "fem_reference", "fastmodel", "validation")
ALLOWED = {
    "meshes": {"meshes", "numpy", "trimesh", "manifold3d", "lazy_loader"},
    "fem_reference": {
        "meshes",
        "fem_reference",
        "numpy",
        "scipy",
        "skfem",
        "pypardiso",
        "pymetis",
        "trimesh",
        "lazy_loader",
    },
    "fastmodel": {
        "meshes",
        "fastmodel",
        "numpy",
        "scipy",
        "mujoco",
        "numba",
        "tomli_w",
        "gymnasium",
        "array_api_compat",
        "lazy_loader",
    },
    "validation/weiss": {"validation", "numpy", "serial"},
}


def imported(source: str) -> set[str]:
    """Top-level names of every import in a module, lazy ones included."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add(str(node.module).split(".")[0])
    return names


def foreign(folder: str) -> dict[str, set[str]]:
    found = {}
    for path in (ROOT / folder).rglob("*.py"):
        extra = imported(path.read_text()) - ALLOWED[folder] - set(sys.stdlib_module_names) - {"__future__"}
        if extra:
            found[str(path.relative_to(ROOT))] = extra
    return found


@pytest.mark.parametrize("folder", ALLOWED)
def test_packages_import_only_what_lies_before_them(folder):
    assert (ROOT / folder).is_dir()
    assert foreign(folder) == {}


def test_a_planted_import_is_seen():
    assert "fem_reference" in imported("def f():\n    from fem_reference import press\n")
    assert "fem_reference" not in ALLOWED["fastmodel"]


@pytest.mark.parametrize(
    ("package", "absent"),
    [
        ("fastmodel", {"skfem", "fem_reference", "pyvista", "matplotlib", "xarray", "pydantic", "tomli_w"}),
        ("meshes", {"scipy", "mujoco", "skfem", "trimesh"}),
        ("fem_reference", {"mujoco", "fastmodel", "pyvista", "matplotlib"}),
        ("fem_reference.result_store", {"skfem", "scipy", "mujoco", "fastmodel"}),
        ("validation.cli", {"mujoco", "skfem", "matplotlib", "scipy", "pyvista"}),
        ("validation.press_files", {"pyvista", "vtkmodules"}),
    ],
)
def test_importing_a_package_loads_no_heavy_stranger(package, absent):
    code = f"import sys; from {package} import *; print(*sorted(set(sys.modules) & set({sorted(absent)!r})))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)  # noqa: S603 -- ours
    assert done.stdout.split() == []


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_can_be_imported(package):
    module = importlib.import_module(package)
    assert module.__all__
    assert all(getattr(module, name) is not None for name in module.__all__)
