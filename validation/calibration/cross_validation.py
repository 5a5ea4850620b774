"""Chooses options of the fit by cross-validation over the fitted images; scored images are not used.

A heavy image shows the seat of the indenter better than a light one, so that the weight of an image may increase with
its load; seating heights explain light images instead.  Which is better depends on the recordings.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from meshes.array_types import FloatArray
from validation.calibration.forward_fit import Options, fit_forward
from validation.calibration.model import BoolArray, ContactMethod, Observations, Placement

#: Candidates for the power of the load in the weight of an image [-].
POWERS = (0.0, 1.0, 8.0)
#: Descriptions of the seat of the indenter, without and with seating heights.
SEATS = ("even seat", "seating heights")
#: Largest number of left-out loads between others [-].
_MOST_FOLDS = 3
#: Smallest number of loads that must remain [-].
_FEWEST_LOADS = 2
#: Largest relative difference of two loads that count as equal [-].
_SAME_LOAD = 1e-6


def choose_options(
    method: ContactMethod, fitted: Observations, options: Options, scored: Observations
) -> tuple[Options, dict[str, tuple[float, ...]]]:
    """Choose the power of the load in the weights of images, and whether seating heights are fitted.

    Args:
        method: The contact method.
        fitted: Fitted images.
        options: Options of the fit; with heights, they are tried as well.
        scored: Images that will be predicted, of which loads and placements are used, and no counts.

    Returns:
        The options with the smallest error, and the mean error with every power by the description of the seat
        [counts]; without enough images the given options, and no errors.
    """
    folds = list_folds(fitted, scored.loads, scored.distinct_placements)
    found: dict[tuple[bool, float], float] = {}
    for heights, power in itertools.product((False, True) if options.heights else (False,), POWERS if folds else ()):
        candidate = replace(options, heights=heights, load_power=power)
        differences = []
        for out in folds:
            left_out = fitted.select(out)
            predicted = fit_forward(method, fitted.select(~out), candidate).predict(left_out)
            differences.append(float(np.abs(predicted - left_out.counts)[left_out.measured].mean()))
        found[heights, power] = float(np.mean(differences))
    if not found:
        return options, {}
    heights, power = min(found, key=found.__getitem__)
    listed = {SEATS[seat]: tuple(error for (each, _), error in found.items() if each == seat) for seat, _ in found}
    return replace(options, heights=heights, load_power=power), listed


def list_folds(fitted: Observations, loads: FloatArray, placements: Sequence[Placement]) -> list[BoolArray]:
    """List groups of fitted images that are to the other fitted images as the scored images are to all fitted ones.

    For scored images of a new session, a group is a fitted session without the images of its middle load, if there are
    several.  Otherwise it is a load: one between others if a scored load lies between the fitted ones, the heaviest if
    a scored load is heavier than all of them, and the lightest if one is lighter.

    Args:
        fitted: The m fitted images.
        loads: Loads of the scored images, shape (k,) [N].
        placements: Placements of the scored images.

    Returns:
        Whether each image belongs to the group, shape (m,), for every group.
    """
    names = np.array([each.name for each in fitted.placements])
    sessions = list(dict.fromkeys(names.tolist()))
    distinct = np.unique(fitted.loads)
    if len(sessions) > 1 and any(each.name not in sessions for each in placements):
        groups = []
        for name in sessions:
            own = np.unique(fitted.loads[names == name])
            groups.append((names == name) & ~np.isclose(fitted.loads, own[len(own) // 2], rtol=_SAME_LOAD))
    else:
        inner = distinct[1:-1] if ((loads > distinct[0]) & (loads < distinct[-1])).any() else distinct[:0]
        inner = inner[np.unique(np.linspace(0, max(len(inner) - 1, 0), _MOST_FOLDS).round().astype(int))[: len(inner)]]
        ends = (distinct[:1] if loads.min() < distinct[0] else (), distinct[-1:] if loads.max() > distinct[-1] else ())
        picked = np.concatenate([inner, *ends])
        groups = [np.isclose(fitted.loads, load, rtol=_SAME_LOAD) for load in picked]
    return [out for out in groups if out.any() and _can_be_left_out(fitted, out)]


def _can_be_left_out(fitted: Observations, out: BoolArray) -> bool:
    """Return whether the remaining images have several loads, and determine the poses of those that are left out."""
    kept = fitted.select(~out)
    known = {each.name for each in kept.placements}
    return len(np.unique(kept.loads)) >= _FEWEST_LOADS and all(
        each.pose is not None or each.name in known for each in fitted.select(out).placements
    )
