"""Quick tests of this folder press on few cells."""

import contextlib

import pytest

from tests.support.coarse_cells import coarse_cells


@pytest.fixture
def full_cells():
    """Ask for the cells of the product."""


@pytest.fixture(autouse=True)
def _cells(request):
    full = request.node.get_closest_marker("slow") or "full_cells" in request.fixturenames
    with contextlib.nullcontext() if full else coarse_cells():
        yield
