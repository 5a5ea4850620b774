"""Shared fixtures."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

# Before NumPy loads: test processes share the cores already, and threads of theirs would spin while they wait for one.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import hypothesis
import pytest

from meshes import Cover, Layer, Material, TexelArray
from meshes.catalogue import ARRAYS
from tests.support.compute_once import compute_once

if TYPE_CHECKING:
    from validation.derivation.derive import Derivation

# The modules of all tests hold many objects for good; looking for garbage among them more rarely saves time.
gc.set_threshold(20_000, 20, 20)
# Test modules with rewritten assertions are kept on disk: to rewrite them takes a third of the collection.
sys.dont_write_bytecode = False
# A property must hold, however long a busy machine takes to try an example.
# In CI the examples of property tests are the same on every run, and more; elsewhere they differ from run to run.
hypothesis.settings.register_profile(
    "default",
    hypothesis.settings.get_profile("default"),
    deadline=None,
    derandomize="CI" in os.environ,
    max_examples=100 if "CI" in os.environ else 30,
)
hypothesis.settings.load_profile("default")


@pytest.fixture(scope="session", autouse=True)
def _interruptible() -> None:
    """Processes that tests start can be interrupted, also where the shell that started the tests ignores Control-C."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _no_flush() -> Iterator[None]:
    """Files of tests need not survive a loss of power: nothing waits for the disk."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _handle: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def _own_store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests never read or write the user's result store; the processes of a run share one, as those of a user do.

    Runs that are given one folder as `SOFTCOVER_TEST_RESULTS` share it too.
    """
    base = tmp_path_factory.getbasetemp()
    own = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    shared = Path(os.environ.get("SOFTCOVER_TEST_RESULTS", own))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOFTCOVER_STORE", str(shared / "shared-store"))
        yield


@pytest.fixture(scope="session")
def bonded() -> Callable[..., Cover]:
    """Make a bonded cover: Poisson ratio, thickness [m], Young's modulus [Pa]."""

    def make(poisson_ratio: float, thickness: float = 2e-3, youngs_modulus: float = 1e6, **options) -> Cover:
        material = Material(
            name="test",
            model="linear-elastic",
            parameters={"youngs_modulus": youngs_modulus},
            poisson_ratio=poisson_ratio,
        )
        return Cover(layers=(Layer(thickness=thickness, material=material),), **options)

    return make


@pytest.fixture(scope="session")
def wts_derivation() -> Derivation:
    """The catalogue's sensor under its assumed cover, derived once for all that only read it."""
    from validation.derivation.derive import derive
    from validation.sensor_file import load

    sensor = load("wts-0614-34")
    # A built-in sensor is known by identity, which does not survive the way from one process to another.
    return replace(compute_once("wts-derivation", lambda: derive(sensor)), sensor=sensor)


@pytest.fixture(scope="session")
def wts() -> TexelArray:
    return ARRAYS["wts-0614-34"]
