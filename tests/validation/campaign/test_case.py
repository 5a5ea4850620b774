"""Cases, and the default campaign."""

import numpy as np
import pytest

from meshes.catalogue import ARRAYS
from validation.campaign.campaign_file import read_campaign
from validation.places import FlatPlaces


@pytest.mark.parametrize("name", ["wts-0614-34", "sdh2-distal"])
def test_default_campaign_covers_what_it_says(name):
    array = ARRAYS[name]
    cases = read_campaign(None, FlatPlaces(array=array)).cases
    assert len(cases) >= 12
    assert len({case.name for case in cases}) == len(cases)
    assert {case.shape.split(":")[0] for case in cases} == {"sphere", "cylinder", "box", "tip"}
    assert {round(np.degrees(case.pose.yaw)) for case in cases} == {0, 45, 90}
    assert {round(case.load / 9.80665e-3) for case in cases} >= {100, 500}
    half = np.array(array.extent) / 2
    assert all((np.abs(case.pose.at) < half).all() for case in cases)
