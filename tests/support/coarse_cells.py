"""Presses on few cells, for quick tests of balances, orders and messages.

Slow tests and tests of accuracy press on the cells of the product.
"""

import contextlib
import dataclasses
import importlib
import os

import pytest

#: Settings that cost most, by module.
COARSE = {
    "press": {"cells": (20, 30, 44), "rough": 30, "rubbing": ((24, 8), (16, 4))},
    "local_contact": {"first_cells": 16, "searched": 41, "sampled": 21},
}


@contextlib.contextmanager
def rough_cells():
    """Press on covers of layers on half of the cells in each direction, with a result store of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOFTCOVER_STORE", os.environ["SOFTCOVER_STORE"] + "-rough")
        patch.setattr("fem_reference.indentation.rubbing.GRIDS", (16, 24, 32, 48, 72))
        patch.setattr("fem_reference.indentation.small_strain.CELLS", (32, 48, 72, 112, 168))
        yield


@contextlib.contextmanager
def coarse_cells():
    """Press on few cells, with a result store of its own: keys of entries do not contain these settings."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOFTCOVER_STORE", os.environ["SOFTCOVER_STORE"] + "-coarse")
        for name, options in COARSE.items():
            module = importlib.import_module(f"fem_reference.curved_cover.{name}")
            patch.setattr(module, "_SETTINGS", dataclasses.replace(module._SETTINGS, **options))
        yield
