"""States of free bodies against the finite elements: a short version of `benchmarks/frozen_states.py`."""

import collections
import importlib
import itertools

import numpy as np
import pytest

pytestmark = pytest.mark.slow


@pytest.fixture
def frozen_states(benchmarks, monkeypatch):
    module = importlib.import_module("frozen_states")
    monkeypatch.setattr(module, "GRIPPERS", {})
    monkeypatch.setattr(module, "FREE", {"ball": module.FREE["ball"], "ellipsoid": module.FREE["ellipsoid"]})
    return module


def test_surface_of_a_frozen_ball_is_a_sphere(frozen_states):
    scene = frozen_states.FreeScene("ball", np.random.default_rng(0))
    sensor, body = scene.sensors[0], None
    while body is None or body.reason:
        scene.step()
        body = frozen_states.FrozenBody(scene.model, scene.data, sensor.name, sensor.parameters)
    x, y = np.meshgrid(np.linspace(-3e-3, 3e-3, 7), np.linspace(-2e-3, 2e-3, 5))
    middle = scene.data.body("thing").xpos[:2] - body.at
    sphere = -np.sqrt(9e-3**2 - (x - middle[0]) ** 2 - (y - middle[1]) ** 2)
    assert np.ptp(body.gap(x, y) - sphere) < 1e-12
    assert np.hypot(*(body.centre - middle)) < 1e-3  # friction moves the centre a little
    assert body.load == pytest.approx(sensor.carried(), rel=1e-9)


def test_states_of_round_bodies_keep_the_bounds(frozen_states):
    states = frozen_states.score_states(np.random.default_rng(0), ["cover", "foundation"], collections.Counter())
    rows = list(itertools.chain(*itertools.islice(states, 4)))
    cover = [row["misplaced"] for row in rows if row["method"] == "cover"]
    assert len(cover) == 4
    assert max(cover) < 2
    assert min(row["least"] for row in rows) >= 0
