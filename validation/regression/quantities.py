"""The table of all experiments of a regression check, and the function that runs experiments.

To guard a further number, let an experiment return its reading under a new name. `docs/regression.md` explains the
quantities and the choice of their tolerances.  The experiments of this module need finite elements: derived parameters,
results of the cases, and accuracy of the fast model.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

import fastmodel
from fastmodel import Parameters
from meshes import Cylinder, Pose, Sphere
from meshes.array_types import FloatArray
from validation.campaign.campaign_file import Inputs
from validation.campaign.case import Case
from validation.campaign.results import CaseResult
from validation.campaign.texel_metrics import centre_of_pressure, second_moments
from validation.credibility.uncertainty import compare_quantities
from validation.places import PoseText, find_places
from validation.regression import experiments, exports, in_time, made_up, touches
from validation.regression.reading import Reading, Readings, Subject, Value, find_unit, list_numbers, read
from validation.sensor_file import BUILT_IN

if TYPE_CHECKING:
    from fem_reference.indentation.result import Indentation

#: Unit and tolerance of the quantities of a derivation, by name.
_DERIVED: Mapping[str, tuple[str, float | str]] = {
    "sigma": ("pitches", "0.5 % of each"),
    "ksize": ("texels", 0.5),
    "residual": ("%", 0.1),
    "outside the kernel": ("%", 0.1),
    "share on the loaded texel": ("%", 0.1),
    "share outside": ("%", 0.05),
    "share of the calibration tip": ("%", 0.3),
    "foundation modulus": ("N/mm3", "1 % of each"),
    "depth of a ball": ("mm", "0.5 % of each"),
    "range of the fast model": ("N", "5 % of each"),
    "estimated error": ("%", "20 % of each"),
}
#: Depth of the presses with friction over the thickness of the cover [-].
_FRICTION_DEPTH = 0.02
#: Instants at which a relaxing cover is guarded [s], and depth of the touches over the thickness [-].
_AGES, _RELAXED_DEPTH = (0.0, 1.0, 10.0, 60.0), 0.02
#: Standard uncertainty of measured forces over the force, in the experiment on uncertainties [-].
_DATA = 0.02
#: Tolerance of the guarded metrics in their units, see `find_unit`.
_METRICS: Mapping[str, float] = {
    "misplaced_force": 0.05,
    "relative_l2": 0.1,
    "total_force_error": 0.02,
    "centre_of_pressure_m": 0.002,
    "image_changed_percent": 0.02,
}


def measure_derivation(subject: Subject) -> Readings:
    """Collect the fitted Gaussian, the response of the cover, its stiffness and the errors of the derivation."""
    found = subject.derivation
    if found is None:
        return {}
    result, pitch = found.result, found.sensor.array.pitch
    kernel, surface = result.psf, result.gaussian
    outside = {"point": result.texel_response_outside, "uniform": result.texel_response_uniform_outside}
    loads = {"2 %": result.load_2_percent, "5 %": result.load_5_percent}
    tip = result.calibration["tip"]
    values: dict[str, Value] = {
        "share on the loaded texel": found.own_share,
        "share outside": {name: each for name, each in outside.items() if each is not None} or None,
        "share of the calibration tip": tip and tip["share"],
        "foundation modulus": result.foundation_modulus,
        "depth of a ball": result.depth and {"depths": list(result.depth["depth"])},
        "range of the fast model": {name: each for name, each in loads.items() if each is not None} or None,
        "estimated error": {name: each for name, each in found.error_estimate.items() if math.isfinite(each)} or None,
    }
    if kernel is not None:
        values |= {
            "sigma": {"x": kernel.sigma_x, "y": kernel.sigma_y},
            "ksize": {"x": kernel.ksize_x, "y": kernel.ksize_y},
            "residual": kernel.residual,
            "outside the kernel": kernel.outside_kernel,
        }
    if surface is not None:
        along = zip("xy", surface.sigma_m, pitch, strict=True)
        values |= {"sigma": {axis: sigma / each for axis, sigma, each in along}, "residual": surface.residual}
    return {name: read(value, *_DERIVED[name]) for name, value in values.items()}


def compare_shipped(subject: Subject) -> Readings:
    """Compare the parameters that come with the package with those derived anew; for built-in sensors only."""
    found = subject.derivation
    if found is None or found.sensor is not BUILT_IN.get(found.sensor.name):
        return {}
    shipped, derived = fastmodel.load(found.sensor.name), found.parameters
    array = shipped.array

    def differ(take: Callable[[Parameters], npt.ArrayLike]) -> float:
        one, other = np.asarray(take(shipped)), np.asarray(take(derived))
        return float(np.abs(one - other).max() / np.abs(other).max()) if one.shape == other.shape else 1.0

    parts: dict[str, Callable[[Parameters], npt.ArrayLike]] = {
        "texels": lambda each: each.array.centres,
        "mask": lambda each: each.array.active.astype(np.float64),
        "spread": lambda each: each.spread.operator(array),
    }
    if shipped.surface is not None and derived.surface is not None:
        table = "compliance" if shipped.surface.cells else "remainder"
        parts["compliance of the cover"] = lambda each: getattr(each.surface, table, 0.0)
        parts["influence of the cover"] = lambda each: each.surface.influence if each.surface else 0.0
    same = (
        dataclasses.replace(shipped.electronics, tip_share=None)
        == dataclasses.replace(derived.electronics, tip_share=None),
        shipped.filter == derived.filter,
    )
    differences = {name: differ(take) for name, take in parts.items()}
    differences["calibration tip"] = differ(lambda each: each.electronics.applied_share)
    differences |= {"electronics": float(not same[0]), "filter": float(not same[1])}
    return {"difference": read(differences, "%", 0.1)}


def measure_reference(subject: Subject) -> Readings:
    """Collect the results of the finite elements in all cases, relative to the load where possible."""
    campaign = subject.campaign
    if campaign is None:
        return {}

    def collect(unit: str, tolerance: float | str, take: Callable[[CaseResult], float]) -> Reading | None:
        return read({result.case.name: take(result) for result in campaign.cases}, unit, tolerance)

    estimates = {name: value for name, value in campaign.noise_floor.items() if value > 0}
    return {
        "load": collect("N", "0.1 % of each", lambda each: each.reference.total_force),
        "largest texel force": collect("mN", "0.2 % of each", lambda each: float(each.reference.texel_forces.max())),
        "force outside": collect("% of load", 0.1, lambda each: each.reference.outside / each.case.load),
        "depth": collect("mm", "0.2 % of each", lambda each: each.reference.depth),
        "contact area": collect("mm2", "0.5 % of each", lambda each: each.reference.contact_area),
        "imbalance": collect("% of load", 0.02, lambda each: each.reference.balance or 0.0),
        "estimated error": read(estimates, "%", "20 % of each"),
    }


def measure_accuracy(subject: Subject) -> Readings:
    """Collect the scores of the fast model against finite elements in all cases, and means of other methods."""
    campaign = subject.campaign
    if campaign is None:
        return {}
    scores = {result.case.name: result.predictions["fast"].score.as_json() for result in campaign.cases}
    models = [name for name, meaning in campaign.models.items() if not meaning.startswith("null")]
    means = {model: campaign.pooled[model]["misplaced_force"].mean for model in models}
    cases = {
        metric: read(
            {case: float(value) for case, score in scores.items() if (value := score[metric]) is not None},
            find_unit(metric),
            tolerance,
        )
        for metric, tolerance in _METRICS.items()
    }
    return {
        **cases,
        "mean misplaced force of each method": read(means, "%", "2 % of each"),
        "skipped cases": read(float(len(campaign.skipped)), "cases", 0.5),
    }


def measure_friction(subject: Subject) -> Readings:
    """Press a ball with friction and a face without slip into the middle of the cover at small strain.

    The shear is the sum of the contact forces across the motion.
    """
    found = subject.derivation
    if found is None:
        return {}
    from fem_reference import press
    from fem_reference.errors import UnsupportedError
    from validation.derivation.contact_range import linearise_material

    sensor = found.sensor
    layers = tuple(
        dataclasses.replace(layer, material=linearise_material(layer.material)) for layer in sensor.cover.layers
    )
    cover = dataclasses.replace(sensor.cover, layers=layers)
    thickness = sum(layer.thickness for layer in layers)
    pose = find_places(sensor.cover, sensor).find(PoseText())
    shapes = {
        "ball, coefficient 0.1": (Sphere(radius=20 * thickness), 0.1),
        "face, no slip": (Cylinder(radius=thickness), math.inf),
    }
    try:
        pressed = {
            name: press(cover, sensor.array, shape, pose, depth=_FRICTION_DEPTH * thickness, friction=friction)
            for name, (shape, friction) in shapes.items()
        }
    except UnsupportedError:  # Covers whose shear is not resolved; `press` says why.
        return {}

    def collect(unit: str, tolerance: str, take: Callable[[Indentation], float]) -> Reading | None:
        return read({name: take(each) for name, each in pressed.items()}, unit, tolerance)

    return {
        "load": collect("N", "0.1 % of each", lambda each: each.total_force),
        "largest texel force": collect("mN", "0.2 % of each", lambda each: float(each.texel_forces.max())),
        "shear": collect(
            "% of load",
            "1 % of each",
            lambda each: (
                float(np.linalg.norm(np.cross(each.contact_forces, pose.direction), axis=1).sum()) / each.total_force
            ),
        ),
        "shear outwards": collect("% of load", "1 % of each", lambda each: _measure_outward_shear(each, pose)),
    }


def measure_relaxation(subject: Subject) -> Readings:
    """Follow touches of a cover that relaxes: a face at a held depth, and a ball on a half-space of its material.

    The force of the ball, a power 3/2 of the depth in units of the largest, needs no finite elements.
    """
    found = subject.derivation
    if found is None or not any(layer.material.relaxation for layer in found.sensor.cover.layers):
        return {}
    from fem_reference.errors import UnsupportedError
    from fem_reference.indentation.relaxing import ElasticCurve, find_relaxation, follow_curves, follow_press

    sensor, held = found.sensor, np.ones(len(_AGES))
    cover, pose = sensor.layered_cover, find_places(sensor.cover, sensor).find(PoseText())
    depth, face = _RELAXED_DEPTH * cover.thickness, Cylinder(radius=2 * cover.thickness)
    depths = np.linspace(0.1, 1.0, 10) ** 2
    ball = {1.0: ElasticCurve(depths=depths, values=np.outer(depths**1.5, [1.0, 1.0, 0.0]))}
    try:
        relaxation = find_relaxation(cover)
        pressed = follow_press(cover, sensor.array, face, pose, times=_AGES, depths=(depth * held).tolist())
    except UnsupportedError:  # Covers that are not followed in time; `press --history` says why.
        return {}
    crept = follow_curves(ball, relaxation, _AGES, 0.1 * held, control="load", is_flat=False)
    grown = follow_curves(ball, relaxation, _AGES, np.array(_AGES) / _AGES[-1], control="depth", is_flat=False)

    def pick(times: FloatArray, values: FloatArray) -> dict[str, float]:
        return {f"{age:g} s": float(values[np.searchsorted(times, age)]) for age in _AGES[1:]}

    return {
        "force at a held depth": read(pick(pressed.times, pressed.forces), "N", "0.1 % of each"),
        "depth under a held load": read(pick(crept.times, crept.depths), "-", "0.1 % of each"),
        "force of a growing contact": read(pick(grown.times, grown.forces), "-", "0.1 % of each"),
    }


def _measure_outward_shear(found: Indentation, pose: Pose) -> float:
    """Return the sum of the shear forces on the cover away from the axis of the motion, over the load [-]."""
    arms = found.contact_points - pose.position
    arms = arms - np.outer(arms @ pose.towards, pose.towards)
    distances = np.maximum(np.linalg.norm(arms, axis=1), np.finfo(float).tiny)
    return float(((found.contact_forces * arms).sum(axis=1) / distances).sum()) / found.total_force


def measure_comparison_models(subject: Subject) -> Readings:
    """Press a block by every model that is compared, and collect its forces and their moments."""
    if subject.comparison is None:
        return {}
    array = subject.parameters.array
    block, load, pose = experiments.lay_block(array)
    found = subject.comparison.compute_models(Case(name="block", indenter=block, shape="box", load=load, pose=pose))
    predicted = {**found.models, **found.published}

    def collect(unit: str, tolerance: float | str, take: Callable[[FloatArray, float], object]) -> Reading | None:
        return read(list_numbers({name: take(*each) for name, each in predicted.items()}), unit, tolerance)

    return {
        "force on texels": collect("N", "0.2 % of each", lambda forces, _: float(forces.sum())),
        "force outside": collect("% of load", 0.1, lambda _, outside: outside / load),
        "largest texel force": collect("mN", "0.5 % of each", lambda forces, _: float(forces.max())),
        "centre": collect("mm", 0.01, lambda forces, _: centre_of_pressure(forces, array.centres).tolist()),
        "width": collect("mm", 0.02, lambda forces, _: second_moments(forces, array.centres)),
    }


def measure_uncertainty(subject: Subject) -> Readings:
    """Collect the standard uncertainties of the comparison of fast model and reference in the first case."""
    if subject.bench is None or subject.campaign is None or not subject.campaign.cases:
        return {}
    result = subject.campaign.cases[0]
    inputs = subject.bench.propagate(result.case, Inputs(friction=0.0))
    errors = compare_quantities(subject.parameters.array, result, inputs, _DATA)
    rows = {each.quantity: [each.u_num, each.u_input, each.u_data] for each in errors}
    return {
        "of each quantity": read(list_numbers(rows), "u_num, u_input, u_D in SI", "10 % of each"),
        "misplaced by each input": read(inputs.misplaced, "%", 0.05),
    }


#: Experiments by the group of quantities that each one gives; what a group follows from stands above it.
EXPERIMENTS: Mapping[str, Callable[[Subject], Readings]] = MappingProxyType(
    {
        "kernel": measure_derivation,
        "shipped parameters": compare_shipped,
        "spread": experiments.measure_spread,
        "characteristic": experiments.measure_characteristic,
        "electronics": experiments.measure_stages,
        "filter": experiments.measure_load_step,
        "frames": experiments.measure_frames,
        "noise": experiments.measure_noise,
        "reset": experiments.measure_reset,
        "orientation": experiments.measure_letter,
        "H": experiments.press_letter,
        "ball": experiments.press_ball,
        "edge": experiments.press_edge,
        "oblong texels": experiments.press_oblong,
        "metric": experiments.score_fixed_images,
        "pooling": experiments.pool_fixed_scores,
        "in time": in_time.measure_time,
        "touches": touches.measure_touches,
        "reference": measure_reference,
        "accuracy": measure_accuracy,
        "friction": measure_friction,
        "relaxing cover": measure_relaxation,
        "comparison models": measure_comparison_models,
        "uncertainty": measure_uncertainty,
        "data sheet": exports.measure_data_sheet,
        "export": exports.measure_exports,
        "exported values": exports.measure_values,
        "verdict": made_up.judge_fixed_scores,
        "calibration": made_up.calibrate_fixed_recordings,
        "recordings": made_up.score_fixed_recordings,
    }
)


def measure(
    subject: Subject,
    *,
    groups: Mapping[str, Callable[[Subject], Readings]] = EXPERIMENTS,
    progress: Callable[[str], None],
) -> tuple[dict[str, Reading], dict[str, str]]:
    """Run experiments on a sensor.

    Args:
        subject: The sensor.
        groups: The experiments to run, by group of quantities.
        progress: Called with the name of each group before its experiment.

    Returns:
        Readings by title of the quantity, without quantities that do not apply to the sensor, and reasons why groups
        could not be measured.
    """
    readings: dict[str, Reading] = {}
    failures: dict[str, str] = {}
    for group, experiment in groups.items():
        progress(f"{group} (made-up data)" if experiment.__module__ == made_up.__name__ else group)
        try:
            found = experiment(subject)
        except ValueError as error:  # All packages raise subclasses of ValueError for inputs that they cannot compute.
            failures[group] = " ".join(str(error).split())
            continue
        for name, reading in found.items():
            if reading is not None:
                title = name.removesuffix("_m").removesuffix("_percent").replace("_", " ")
                readings[f"{group}: {title}"] = reading
    return readings, failures
