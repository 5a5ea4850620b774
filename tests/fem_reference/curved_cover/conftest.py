"""Tests of this folder press on few cells, unless they compare with independent solutions."""

import contextlib

import pytest

from tests.support.coarse_cells import coarse_cells


@pytest.fixture
def full_cells():
    """Ask for the cells of the product."""


@pytest.fixture(autouse=True)
def _cells(request):
    with contextlib.nullcontext() if "full_cells" in request.fixturenames else coarse_cells():
        yield
