"""What is installed is used, and what is used is declared."""

from __future__ import annotations

import re
import sys
from functools import cache
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
PRODUCT = ("meshes", "fem_reference", "fastmodel", "validation")
OWN = {
    *PRODUCT,
    "tests",
    "benchmarks",
    "tactilebench",
    *(
        path.stem
        for folder in ("examples", "benchmarks", "benchmarks/tactilebench", "benchmarks/tactilebench/adapters")
        for path in (ROOT / folder).glob("*.py")
    ),
}
#: Distributions that are run, not imported: linters, type checker and stubs, plugins of pytest and Sphinx.
TOOLS = {"ruff", "mypy", "scipy-stubs", "mujoco-stubs", "pytest-xdist", "pytest-cov", "furo", "myst-parser"}
#: Packages of benchmarks and examples, where each says how to install them; and coverage, which pytest-cov brings.
BENCHMARKS_ONLY = {
    *("felupe", "netgen", "ngsolve", "coverage"),
    *("stable_baselines3", "robosuite", "dm_control", "shimmy"),
    *("mujoco_warp", "warp", "torch", "pydrake", "genesis"),
}


#: Texts of several lines, which may hold code of their own.
TEXTS = re.compile(r'""".*?"""', re.DOTALL)
#: Lines that import a module, and calls that name one: its files are used without an import statement.
IMPORTS = re.compile(
    r"^ *from (\w+)[\w.]* import |^ *import (\w+)"
    r"|\b(?:files|find_spec|import_module|importorskip)\(\s*\"(\w+)", re.MULTILINE
)  # fmt: skip


@cache
def imported_in(*folders):
    """Top-level modules of other projects that sources under these folders use, also inside functions."""
    sources = (path.read_text() for folder in folders for path in (ROOT / folder).rglob("*.py"))
    names = {name for source in sources for found in IMPORTS.findall(TEXTS.sub("", source)) for name in found if name}
    return names - set(sys.stdlib_module_names) - OWN


def declared():
    """Distributions by the extra that brings them, "" for the base installation."""
    found = {}
    for line in metadata.requires("softcover"):
        requirement = Requirement(line)
        extra = str(requirement.marker).split("extra == ")[-1].strip("\"'") if "extra" in line else ""
        if requirement.name != "softcover":
            found.setdefault(extra, set()).add(requirement.name.lower())
    return found


#: Installed distributions by the modules that they bring; reading them all takes a fifth of a second.
installed = cache(metadata.packages_distributions)


def distributions_of(module):
    return {name.lower().replace("_", "-") for name in installed().get(module, [module])}


def test_every_distribution_of_an_extra_is_imported():
    used = set().union(*map(distributions_of, imported_in(*PRODUCT, "tests", "examples", "docs")))
    for extra, names in declared().items():
        assert names - used - TOOLS == set(), f"extra {extra!r}"


def test_every_import_is_declared():
    known = set().union(*declared().values())
    for module in imported_in(*PRODUCT, "tests", "examples", "docs", "benchmarks"):
        assert module in BENCHMARKS_ONLY or distributions_of(module) & known, module


def test_the_product_runs_without_what_only_tests_install():
    names = declared()
    known = set().union(*(names[extra] for extra in names if extra != "test"))
    for module in imported_in(*PRODUCT):
        assert distributions_of(module) & known, module
