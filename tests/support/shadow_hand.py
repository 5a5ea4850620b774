"""Marks of the tests that need the Shadow hand."""

import importlib.util

import pytest

NEEDS_HAND = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("gymnasium_robotics") is None,
        reason="the hand is not installed: python -m pip install gymnasium-robotics",
    ),
]
