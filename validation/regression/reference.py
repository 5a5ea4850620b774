"""Experiments on the finite elements: derived parameters, results of the cases, and accuracy of the fast model.

They apply to sensors that are described by a sensor file.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

import fastmodel
from fastmodel import Parameters
from validation.campaign.results import CaseResult
from validation.regression.subject import Subject, Values
from validation.sensor_file import BUILT_IN

#: Models of the campaign whose mean scores are quantities.
_MODELS = ("fast", "area", "boxes")


def measure_derivation(subject: Subject) -> Values:
    """Take the fitted kernel, the response of the cover, its stiffness and the estimated errors from the derivation."""
    found = subject.derivation
    if found is None:
        return {}
    kernel, array = found.fit.gaussian, found.sensor.array
    row, column = divmod(array.middle, array.columns)
    point, uniform = (np.atleast_2d(each) for each in (found.texel_response, found.texel_response_uniform))
    validity = found.parameters.validity
    return {
        "sigma": {"x": kernel.sigma_x, "y": kernel.sigma_y},
        "ksize": {"x": kernel.ksize_x, "y": kernel.ksize_y},
        "residual": found.fit.residual,
        "outside the kernel": found.fit.outside_kernel,
        "share on the loaded texel": {"point": float(point[row, column]), "uniform": float(uniform[row, column])},
        "share outside": dict(zip(("point", "uniform"), found.outside, strict=True)),
        "share of the calibration tip": None if found.tip is None else found.tip.share,
        "foundation modulus": None if found.depth is None else found.depth.foundation.modulus,
        "depth of a ball": None if found.depth is None else {"depths": list(found.depth.depth)},
        "range of the fast model": None
        if validity is None
        else {"2 %": validity.load_2_percent, "5 %": validity.load_5_percent},
        "estimated error": dict(found.error_estimate),
    }


def compare_shipped(subject: Subject) -> Values:
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
        parts["compliance of the cover"] = lambda each: each.surface.compliance if each.surface else 0.0
        parts["influence of the cover"] = lambda each: each.surface.influence if each.surface else 0.0
    same = (
        dataclasses.replace(shipped.electronics, tip_share=None)
        == dataclasses.replace(derived.electronics, tip_share=None),
        shipped.filter == derived.filter,
    )
    differences = {name: differ(take) for name, take in parts.items()}
    differences["calibration tip"] = differ(lambda each: each.electronics.applied_share)
    return {"difference": {**differences, "electronics": float(not same[0]), "filter": float(not same[1])}}


def measure_reference(subject: Subject) -> Values:
    """Take the results of the finite elements in all cases, relative to the load where that is possible."""
    campaign = subject.campaign
    if campaign is None:
        return {}

    def collect(take: Callable[[CaseResult], float]) -> dict[str, float]:
        return {result.case.name: take(result) for result in campaign.cases}

    estimates = campaign.noise_floor
    return {
        "load": collect(lambda each: each.reference.total_force),
        "largest texel force": collect(lambda each: float(each.reference.texel_forces.max())),
        "force outside": collect(lambda each: each.reference.outside / each.case.load),
        "depth": collect(lambda each: each.reference.depth),
        "contact area": collect(lambda each: each.reference.contact_area),
        "imbalance": collect(lambda each: each.reference.balance or 0.0),
        "estimated error": {name: value for name, value in estimates.items() if value > 0},
    }


def measure_accuracy(subject: Subject) -> Values:
    """Take the scores of the fast model against the finite elements in all cases, and means of other methods."""
    campaign = subject.campaign
    if campaign is None:
        return {}
    names = (
        "misplaced_force",
        "relative_l2",
        "total_force_error",
        "centre_of_pressure_m",
        "image_changed_percent",
    )
    scores = {result.case.name: result.predictions["fast"].score.as_json() for result in campaign.cases}
    cases = {
        name: {case: float(value) for case, each in scores.items() if (value := each[name]) is not None}
        for name in names
    }
    means = {model: campaign.pooled[model]["misplaced_force"].mean for model in _MODELS}
    skipped = float(len(campaign.skipped))
    return {**cases, "mean misplaced force of each method": means, "skipped cases": skipped}
