"""One set of keys for flat and curved covers, and a second press from the store."""

import json
import resource

import numpy as np
import pytest

from tests.support.coarse_cells import coarse_cells

BALL = ("--indenter", "sphere:radius=4mm", "--load", "0.5N")


def list_keys(values, above=""):
    """Names of all keys down to the models' values, without those whose names are data."""
    data = {"cover", "wanted", "error_estimate", "assumptions", "grid_values", "mesh", "settings"}
    for name, value in values.items():
        yield f"{above}{name}"
        if isinstance(value, dict) and name not in data:
            yield from list_keys(value, f"{above}{name}.")


@pytest.fixture
def _cells():
    with coarse_cells():
        yield


@pytest.mark.slow
@pytest.mark.usefixtures("_cells")
def test_flat_and_curved_presses_have_the_same_keys_and_a_second_one_is_read(softcover):
    found = []
    for sensor in ("wts-0614-34", "flat-pad", "flat-pad"):
        before = resource.getrusage(resource.RUSAGE_SELF).ru_utime
        status, out, err = softcover("press", sensor, *BALL, "--json")
        assert status == 0, err
        found.append((json.loads(out), resource.getrusage(resource.RUSAGE_SELF).ru_utime - before))
    (flat, _), (first, cost), (again, second) = found
    assert set(list_keys(flat)) == set(list_keys(first))
    assert again["models"]["fem"]["texel_forces"] == first["models"]["fem"]["texel_forces"]
    assert second < cost / 4
    for each in (flat, first):
        fem = each["models"]["fem"]
        np.testing.assert_allclose(fem["force"], fem["base_force"], atol=2e-3 * each["load"])
        assert each["scores"]["misplaced_force"] == pytest.approx(each["models"]["fast"]["misplaced_force"], rel=1e-9)


@pytest.mark.slow
def test_the_moment_of_a_press_is_its_load_times_its_place(softcover):
    words = ("press", "wts-0614-34", *BALL, "--at=2mm,-3mm", "--model", "fem", "--json")
    fem = json.loads(softcover(*words)[1])["models"]["fem"]
    np.testing.assert_allclose(fem["force"], [0, 0, -0.5], rtol=1e-9)
    np.testing.assert_allclose(fem["moment"], [3e-3 * 0.5, 2e-3 * 0.5, 0], rtol=1e-3, atol=1e-9)
    assert fem["unmeasured"][2] == pytest.approx(-fem["outside"], abs=1e-9)
