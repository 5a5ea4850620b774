"""Fixtures of the commands' tests."""

import importlib

import pytest


@pytest.fixture
def without_reference(monkeypatch):
    """Fail the test if the finite elements are asked for a point spread function."""

    def fail(*_, **__):
        raise AssertionError("the finite elements were asked")

    module = importlib.import_module("fem_reference.linear_response.axisymmetric")
    monkeypatch.setattr(module, "point_spread", fail)
