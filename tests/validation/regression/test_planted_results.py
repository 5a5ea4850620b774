"""Planted changes of every kind of result beyond the flat chain make the check red, and the quantity is named."""

import functools
from dataclasses import replace
from pathlib import Path

import pytest

import fastmodel.bench
import fem_reference
import validation.calibration.calibrate as calibration
from fastmodel import Electronics
from fastmodel.adapters import rigid_models
from tests.support.coarse_cells import coarse_cells
from tests.validation.regression.planted import edit, measure_groups, take_every
from validation import data_sheet, verdict
from validation.calibration.calibrate import Calibration
from validation.calibration.model import CountCurve
from validation.calibration.uncertainty import Uncertainty
from validation.campaign.results import Reference
from validation.credibility import recorded
from validation.data_sets import score
from validation.derivation.derive import derive
from validation.published.models import Row
from validation.regression import quantities
from validation.regression.baseline import compare
from validation.sensor_file import load
from validation.simulator_values import scoring, targets

pytestmark = pytest.mark.slow
CURVED = Path(__file__).parents[3] / ".ci" / "bent-pad.toml"


def flip_shear(monkeypatch, parameters):
    healthy = fem_reference.press

    def press(*arguments, **options):
        found = healthy(*arguments, **options)
        return replace(found, contact_forces=found.contact_forces * [-1, -1, 1])

    monkeypatch.setattr(fem_reference, "press", press)
    return parameters


def weaken_curved_reference(monkeypatch, parameters):
    healthy = Reference.of

    def weaken(found):
        reference = healthy(found)
        return replace(reference, texel_forces=0.98 * reference.texel_forces)

    monkeypatch.setattr(Reference, "of", weaken)
    return parameters


def weaken_curved_model(_monkeypatch, parameters):
    surface = parameters.surface
    return replace(parameters, surface=replace(surface, influence=0.97 * surface.influence))


def halve_recorded_iteration(monkeypatch, parameters):
    monkeypatch.setattr(recorded, "ITERATION", recorded.ITERATION / 2)
    return parameters


def write_half_space(monkeypatch, parameters):
    drake = targets.TARGETS["drake"]

    def write(scores, *others):
        (row, *rows) = scores.rows
        doubled = replace(row, parameters={**row.parameters, "modulus": 2 * row.parameters["modulus"]})
        return drake.write(replace(scores, rows=(doubled, *rows)), *others)

    monkeypatch.setitem(targets.TARGETS, "drake", replace(drake, write=write))
    return parameters


#: Sensor, change, and the quantity that must be named, by name.
PLANTS = {
    "curved reference -2 %": ("curved", weaken_curved_reference, "reference: largest texel force"),
    "curved fast model -3 %": ("curved", weaken_curved_model, "accuracy: misplaced force"),
    "scores on recordings x 0.9": (
        "flat",
        edit(score, "score_counts", "image.image_changed_percent", "0.9 * image.image_changed_percent"),
        "recordings: image changed",
    ),
    "switched-off texels scored": (
        "flat",
        edit(score, "score_counts", "array.active if measured is None else measured", "array.active | True"),
        "recordings: image changed",
    ),
    "calibrated gains in the wrong order": (
        "flat",
        edit(Calibration, "electronics", "self.gains.tolist()", "self.gains[::-1].tolist()"),
        "calibration: electronics",
    ),
    "sign of the temperature coefficient": (
        "flat",
        edit(calibration, "_list_estimates", "curve.gain_temperature,", "-curve.gain_temperature,"),
        "calibration: estimates",
    ),
    "one-sided quantile in the intervals": (
        "flat",
        edit(Uncertainty, "half_width", "0.5 + CONFIDENCE / 2", "CONFIDENCE"),
        "calibration: estimates",
    ),
    "threshold of the firmware ignored": (
        "flat",
        edit(CountCurve, "predict", " - thresholds[:, None]", ""),
        "calibration: estimates",
    ),
    "creep lost on export": (
        "flat",
        edit(CountCurve, "electronics", "[age]", "[self.reference_age]"),
        "recordings: electronics",
    ),
    "u_num of recordings halved": ("flat", halve_recorded_iteration, "recordings: uncertainties"),
    "u_num halved": (
        "flat",
        edit(quantities, "compare_quantities", "u_num=u_num,", "u_num=u_num / 2,"),
        "uncertainty: of each quantity",
    ),
    "a model that adds 1 % force": (
        "flat",
        edit(Row, "predict", "np.where(active, texels", "np.where(active, 1.01 * texels"),
        "comparison models: force on texels",
    ),
    "verdict by the mean": (
        "flat",
        edit(verdict, "_find_mean", "high <= limit", "pooled.mean <= limit"),
        "verdict: verdict",
    ),
    "few cases decide": (
        "flat",
        edit(verdict, "_find_mean", "pooled.few or undefined", "undefined"),
        "verdict: verdict",
    ),
    "outside -2 %": (
        "flat",
        edit(fastmodel.bench, "_describe", "float(reading.carried", "0.98 * float(reading.carried"),
        "edge: cover, force outside",
    ),
    "shear in the other direction": ("flat", flip_shear, "friction: shear outwards"),
    "threshold before the gain": (
        "flat",
        edit(
            Electronics,
            "counts",
            "signal * xp.asarray(self.gains, dtype=signal.dtype)",
            "(signal - self.threshold) * xp.asarray(self.gains, dtype=signal.dtype) + self.threshold",
        ),
        "electronics: all",
    ),
    "angles of URDF in another order": ("flat", edit(rigid_models, "compute_angles", '"xyz"', '"zyx"'), "export: URDF"),
    "exported values +2 %": (
        "flat",
        edit(scoring, "_score", "dict(values)", "{key: 1.02 * each for key, each in values.items()}"),
        "exported values: values",
    ),
    "depth of exported laws -2 %": (
        "flat",
        edit(
            scoring, "_score", "candidate.sink(press.scene, **values)", "0.98 * candidate.sink(press.scene, **values)"
        ),
        "exported values: depth",
    ),
    "misplaced force of exported laws without the worst press": (
        "flat",
        edit(scoring, "_score", "max(errors)", "sorted(errors)[-2]"),
        "exported values: misplaced force",
    ),
    "spread of the export on a coarser table": (
        "flat",
        edit(targets, "score_target", "_SPREAD_STEP * min", "1.05 * _SPREAD_STEP * min"),
        "exported values: spread",
    ),
    "modulus of a half space in Drake's box": (
        "flat",
        write_half_space,
        "exported values: file for Drake",
    ),
    "width in the data sheet without pitch": (
        "flat",
        edit(data_sheet, "_list_space", "_WIDTH_AT_HALF * s * p", "_WIDTH_AT_HALF * s * 1e-3"),
        "data sheet: of the sensor",
    ),
}


@pytest.fixture(scope="module", autouse=True)
def few_cases():
    """Take every eighth case of the default campaigns, and few cells."""
    with take_every(8), coarse_cells():
        yield


@functools.cache
def derived(kind):
    return derive(load({"flat": "wts-0614-34", "curved": CURVED}[kind]))


def measured(kind, group, parameters):
    return measure_groups(parameters, [group], derived(kind))


@functools.cache
def healthy(kind, group):
    return measured(kind, group, derived(kind).parameters)


#: Further changes of the values for simulators, which are scored anew for each.
DEAR = {
    "depth of exported laws -2 %", "misplaced force of exported laws without the worst press",
    "spread of the export on a coarser table",
}  # fmt: skip


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.bench] if name in DEAR else []) for name in PLANTS]
)
def test_a_change_is_red_and_names_the_quantity(name, monkeypatch):
    kind, plant, title = PLANTS[name]
    group = title.partition(":")[0]
    stored = healthy(kind, group)
    parameters = plant(monkeypatch, derived(kind).parameters)
    assert title in {each.quantity for each in compare(stored, measured(kind, group, parameters), {})}


@pytest.mark.parametrize(
    "group", ["verdict", "export", "exported values", "data sheet", "calibration", "recordings", "edge"]
)
def test_unchanged_results_are_green(group):
    assert compare(healthy("flat", group), measured("flat", group, derived("flat").parameters), {}) == []
