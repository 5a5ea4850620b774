"""Array libraries that tests of pure functions run with."""

import numpy as np
import pytest

#: Parameters of a fixture that runs a test with every library; the last two are slow to import.
MODULES = [
    "numpy",
    "strict",
    pytest.param("jax", marks=pytest.mark.slow),
    pytest.param("torch", marks=pytest.mark.slow),
]


def open_module(name):
    if name == "jax":
        jax = pytest.importorskip("jax")
        # Tests run each function once or twice: to compile it takes longer than to run it.
        jax.config.update("jax_disable_most_optimizations", True)  # noqa: FBT003
        jax.config.update("jax_enable_x64", True)  # noqa: FBT003 -- jax takes it so
        return jax.numpy
    if name == "torch":
        pytest.importorskip("torch")
        from array_api_compat import torch

        return torch
    return np if name == "numpy" else pytest.importorskip("array_api_strict")
