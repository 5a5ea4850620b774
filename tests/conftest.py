"""Shared fixtures."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator

import pytest

from meshes import Cover, Layer, Material, TexelArray
from meshes.catalogue import ARRAYS


@pytest.fixture(scope="session", autouse=True)
def _interruptible() -> None:
    """Processes that tests start can be interrupted, also where the shell that started the tests ignores Control-C."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _own_store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests never read or write the user's result store."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOFTCOVER_STORE", str(tmp_path_factory.mktemp("store")))
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
def wts() -> TexelArray:
    return ARRAYS["wts-0614-34"]
