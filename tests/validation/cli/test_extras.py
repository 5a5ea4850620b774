"""Every optional package has a line that says how to install it."""

import tomllib
from pathlib import Path

import pytest

from validation.cli.failures import OUTSIDE_FAILED, explain

PROJECT = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())
#: Modules of the distributions in an extra whose names differ, and distributions that the product does without.
MODULES = {"scikit-fem": "skfem", "pyserial": "serial", "mcap-ros2-support": "mcap_ros2"}
WITHOUT = {"pypardiso", "array-api-compat"}
OPTIONAL = [
    (extra, name)
    for extra in ("fem", "report", "device", "gym", "view")
    for line in PROJECT["project"]["optional-dependencies"][extra]
    if (name := line.split(">")[0]) not in WITHOUT
]


@pytest.mark.parametrize(("extra", "name"), OPTIONAL)
def test_a_missing_package_is_told_with_its_extra(extra, name):
    module = MODULES.get(name, name)
    found = explain(ModuleNotFoundError(f"No module named {module!r}", name=f"{module}.part"))
    assert found is not None
    assert found.status == OUTSIDE_FAILED
    assert f"softcover[{extra}]" in found.lines[0]
