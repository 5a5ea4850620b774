"""The bench of the built-in sensor, and a campaign of three cases on it."""

import pytest

from validation.campaign.bench import LayeredBench
from validation.campaign.case import Case
from validation.campaign.run import run_campaign


@pytest.fixture(scope="session")
def bench(wts_derivation):
    return LayeredBench(cover=wts_derivation.sensor.cover, parameters=wts_derivation.parameters)


@pytest.fixture(scope="session")
def cases():
    return (
        Case.read("sphere", "sphere:radius=5mm", "500 g", at="1.7mm,1.7mm"),
        Case.read("box", "box:size=6mmx10mmx5mm", "100 g", at="0.7mm,-1.1mm", yaw="45deg"),
        Case.read("edge", "cylinder:radius=4mm", "100 g", at="8.5mm,0mm"),
    )


@pytest.fixture(scope="session")
def campaign(bench, cases):
    return run_campaign(bench, cases)
