"""A result store for each test of sweeps."""

import pytest


@pytest.fixture
def store(tmp_path, monkeypatch):
    """Use an empty store of the test's own; its folder."""
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path / "store"))
    return tmp_path / "store"
