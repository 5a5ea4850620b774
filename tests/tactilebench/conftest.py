"""Processes that these tests start find tactilebench, which need not be installed."""

import os
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "benchmarks" / "tactilebench"


@pytest.fixture(autouse=True)
def _findable(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(PACKAGE), prepend=os.pathsep)
