"""The derivation that most tests of this folder read."""

import pytest


@pytest.fixture(scope="session")
def derivation(wts_derivation):
    return wts_derivation
