"""The check guards curved covers too: the same quantities where they exist, and planted changes turn it red."""

from dataclasses import replace

import numpy as np
import pytest

import fastmodel
from tests.support.coarse_cells import coarse_cells
from tests.validation.regression.planted import take_every
from validation.derivation.derive import derive
from validation.regression.baseline import check_sensor, compare, make_baseline
from validation.regression.quantities import EXPERIMENTS, measure
from validation.regression.reading import Subject

#: Groups that the cover changes, without the campaign.
GROUPS = ("spread", "H", "ball", "kernel")


def take(subject, groups=GROUPS):
    readings, failures = measure(subject, groups={name: EXPERIMENTS[name] for name in groups}, progress=lambda _: None)
    assert not failures
    return make_baseline("small pad", readings)


@pytest.fixture(scope="module")
def derivation(small_pad):
    return derive(small_pad)


@pytest.fixture(scope="module")
def stored(derivation):
    return take(Subject(parameters=derivation.parameters, derivation=derivation))


def change_surface(parameters, **changes):
    surface = parameters.surface
    made = {name: change(getattr(surface, name)) for name, change in changes.items()}
    return replace(parameters, surface=replace(surface, **made))


def soften(parameters):
    return change_surface(parameters, **dict.fromkeys(("remainder", "layer", "top_compliance"), lambda v: 1.02 * v))


@pytest.mark.parametrize(
    ("plant", "title"),
    [
        (lambda p: change_surface(p, influence=lambda v: np.roll(v, 1, axis=0)), "H: curved, force of each texel"),
        (lambda p: change_surface(p, influence=lambda v: 0.98 * v), "ball: curved, largest force after spread"),
        (soften, "H: curved, depth"),
        (lambda p: replace(p, spread=replace(p.spread, matrix=0.99 * p.spread.matrix)), "spread: share"),
    ],
    ids=["texels changed places", "lost force", "softer cover", "lost spread"],
)
def test_a_changed_fast_model_of_a_curved_cover_is_noticed(derivation, stored, plant, title):
    changed = take(Subject(parameters=plant(derivation.parameters), derivation=derivation))
    assert title in {each.quantity for each in compare(stored, changed, {})}


def test_a_changed_response_of_a_curved_cover_is_noticed(derivation, stored):
    responses = derivation.responses
    grid = replace(responses.finest, influence=0.99 * responses.finest.influence)
    weaker = replace(derivation, responses=replace(responses, grids=(*responses.grids[:-1], grid)))
    changed = take(Subject(parameters=derivation.parameters, derivation=weaker), ("kernel",))
    before = replace(stored, readings={k: v for k, v in stored.readings.items() if k.startswith("kernel")})
    assert "kernel: share on the loaded texel" in {each.quantity for each in compare(before, changed, {})}


@pytest.mark.slow
def test_a_derived_folder_of_a_curved_cover_is_checked(derivation, softcover, tmp_path):
    derivation.parameters.save(tmp_path / "derived")
    assert softcover("regress", tmp_path / "derived", "--update")[0] == 0
    assert softcover("regress", tmp_path / "derived")[0] == 0
    softer = soften(fastmodel.load(tmp_path / "derived"))
    softer.save(tmp_path / "derived")
    status, out, _ = softcover("regress", tmp_path / "derived")
    assert status == 1
    assert "H: curved, depth: rose" in out


@pytest.mark.slow
def test_cases_on_a_curved_cover_are_guarded(small_pad, derivation, tmp_path):
    class Progress:
        def __call__(self, stage):
            pass

        def step(self, done, total, name):
            pass

    path = tmp_path / "baseline.json"
    with take_every(4), coarse_cells():
        first = check_sensor(small_pad, path, update=True, progress=Progress())
    assert not first.failures
    assert {"reference: depth", "accuracy: misplaced force"} <= set(first.now.readings)
    spoilt = change_surface(derivation.parameters, influence=lambda v: np.roll(v, 1, axis=0))
    with take_every(4), coarse_cells():
        changed = take(Subject(parameters=spoilt, derivation=derivation), ("reference", "accuracy"))
    before = replace(first.now, readings={k: first.now.readings[k] for k in changed.readings})
    titles = {each.quantity for each in compare(before, changed, {})}
    assert "accuracy: misplaced force" in titles
    assert not any(title.startswith("reference") for title in titles)
