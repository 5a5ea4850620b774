"""Comparison errors on recordings with their validation uncertainty (ASME V&V 20-2009), load by load.

The comparison error of a quantity is E = S - D, with the counts S of the fast model with texel gains and the recorded
counts D, each the mean over repeats of the load.

    u_D      repeats of the load (their relative scatter, pooled over loads), growth by creep within the window of the
             frames, noise and rounding of one frame
    u_num    iteration tolerance of the fast model, on the largest texel
    u_input  cover and pose, see `validation.credibility.uncertainty`; friction is left out

The calibrated numbers (curve and gains) are held when an input changes.  A calibration on the same pose absorbs part of
the effect of the cover, so that u_input is an upper bound there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

import meshes
from meshes import Cover, Indenter
from meshes.array_types import FloatArray
from validation.calibration.forward_fit import ForwardFit
from validation.calibration.model import ContactMethod, Placement, Pose
from validation.campaign.campaign_file import Inputs
from validation.campaign.case import Case
from validation.campaign.texel_metrics import centre_of_pressure
from validation.credibility.uncertainty import (
    ITERATION,
    ComparisonError,
    find_missing_range,
    list_inputs,
    propagate_inputs,
)
from validation.data_sets.images import Image, observe

#: Standard deviation of a uniform distribution over its width [-].
_OF_WIDTH = 1 / math.sqrt(12)
#: Name with unit, factor to this unit, the function of the counts of the n texels, and the function of these counts for
#: the size that the scatter between repeats is proportional to.
Quantity = tuple[str, float, Callable[[FloatArray], float], Callable[[FloatArray], float]]


def compare_loads(found: ForwardFit, images: Sequence[Image], cover: Cover, inputs: Inputs) -> list[ComparisonError]:
    """Compare predicted with recorded counts, load by load and quantity by quantity.

    Args:
        found: The fitted model.
        images: Recorded images that were not fitted; repeats of one load share their name.
        cover: Cover of the sensor; without a range of an assumed material u_input is NaN.
        inputs: Standard uncertainties of the inputs.
    """
    cover, inputs, observed = replace(cover, size=None), replace(inputs, friction=0.0), observe(images)
    predicted, method = found.predict(observed), found.method
    # At a fitted pose a fit interpolates forces between a lattice of poses.  An effect is computed at the pose itself.
    still = replace(observed, placements=tuple(_fix_pose(each, found.poses) for each in observed.placements))
    unchanged = found.predict(still)

    @cache
    def propagate(indenter: Indenter, load: float, pose: Pose) -> Mapping[str, FloatArray]:
        at = meshes.Pose.planar(at=(pose.x, pose.y), yaw=pose.yaw, tilt=(pose.tilt_x, pose.tilt_y))
        case = Case(name="recording", indenter=indenter, shape="", load=load, pose=at)
        return propagate_inputs(cover, method.array, case, inputs).effects

    def change(name: str) -> FloatArray:
        """Return the change of the counts of m images by one standard uncertainty of an input, shape (m, n)."""

        def solve(indenter: Indenter, load: float, pose: Pose) -> FloatArray:
            return np.asarray(method.solve(indenter, load, pose) + propagate(indenter, load, pose)[name])

        return replace(found, method=replace(method, solve=solve)).predict(still) - unchanged

    changed = [] if find_missing_range(cover) else [change(name) for name, *_ in list_inputs(cover, inputs)]
    cases = np.array([image.case for image in images])
    repeated = {case: observed.counts[cases == case] for case in dict.fromkeys(cases.tolist())}
    quantities = {
        case: list(_list_quantities(method, counts.mean(axis=0), observed.measured[cases == case].all(axis=0)))
        for case, counts in repeated.items()
    }
    scatter = _pool_scatter(repeated, quantities)
    errors = []
    for case, counts in repeated.items():
        rows, here = cases == case, [image for image in images if image.case == case]
        S, D = predicted[rows].mean(axis=0), counts.mean(axis=0)
        for (name, factor, quantity, size), relative in zip(quantities[case], scatter, strict=True):
            iteration = np.where(np.arange(S.size) == S.argmax(), ITERATION * S.sum(), 0.0)
            repeats = relative * size(D) ** 2 / len(counts)
            effects = [part[rows].mean(axis=0) for part in changed]
            errors.append(
                ComparisonError(
                    case=case, quantity=name, factor=factor, fast=quantity(S), reference=quantity(D),
                    u_num=_add_effects(quantity, S, [iteration]),
                    u_input=_add_effects(quantity, S, effects) if effects else math.nan,
                    u_data=math.sqrt(repeats + _add_effects(quantity, D, list(_list_drifts(here, D))) ** 2),
                )
            )  # fmt: skip
    return errors


def _fix_pose(placement: Placement, poses: Mapping[str, Pose]) -> Placement:
    """Return a placement whose pose is the fitted one, if it was fitted."""
    pose = poses.get(placement.name)
    if pose is None:
        return placement
    return replace(placement, at=(pose.x, pose.y), yaw=pose.yaw, tilt=(pose.tilt_x, pose.tilt_y))


def _list_quantities(method: ContactMethod, recorded: FloatArray, measured: FloatArray) -> Iterator[Quantity]:
    places, peak = method.array.centres[:, :2], int(np.argmax(recorded * measured))

    def add(counts: FloatArray) -> float:
        return float((counts * measured).sum())

    def find_peak(counts: FloatArray) -> float:
        return float(counts[peak])

    def find_centre(axis: int, counts: FloatArray) -> float:
        return float(centre_of_pressure(counts * measured, places)[axis])

    yield "sum of counts", 1.0, add, add
    yield "largest texel [counts]", 1.0, find_peak, find_peak
    yield "centre of counts x [mm]", 1e3, partial(find_centre, 0), lambda _counts: 1.0
    yield "centre of counts y [mm]", 1e3, partial(find_centre, 1), lambda _counts: 1.0


def _pool_scatter(repeated: Mapping[str, FloatArray], quantities: Mapping[str, Sequence[Quantity]]) -> FloatArray:
    """Return the variance of each quantity between repeats over its squared size, pooled over loads, shape (4,).

    Both are summed over the loads, so that loads with hardly any counts have hardly any weight.  Zero without repeats.
    """
    variance, square = np.zeros(4), np.full(4, np.finfo(float).tiny)
    for case, counts in repeated.items():
        if len(counts) > 1:
            variance += [np.var([of(each) for each in counts], ddof=1) for _, _, of, _ in quantities[case]]
            square += [size(counts.mean(axis=0)) ** 2 for _, _, _, size in quantities[case]]
    return variance / square


def _list_drifts(images: Sequence[Image], recorded: FloatArray) -> Iterator[FloatArray]:
    """Yield the change of the recorded counts by creep within the window, then by noise and rounding of each texel."""
    first, lit = images[0], recorded > 0
    known = [image.creep for image in images if not math.isnan(image.creep)]
    creep = float(np.mean(known)) if known else 0.0
    low, high = first.file.window
    if creep and low > 0:
        yield creep * math.log(high / low) * _OF_WIDTH * np.where(lit, recorded + first.threshold, 0.0)
    yield from np.diag(np.where(lit, math.hypot(max(image.noise for image in images), _OF_WIDTH), 0.0))


def _add_effects(quantity: Callable[[FloatArray], float], base: FloatArray, effects: Sequence[FloatArray]) -> float:
    """Return the root of the sum of squares of the changes of a quantity by changes of the counts."""
    return math.sqrt(sum((quantity(base + effect) - quantity(base)) ** 2 for effect in effects))
