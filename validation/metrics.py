"""Metrics between a predicted tactile image and its reference image: functions from arrays to numbers.

The reference is the finite-element solution of the same indentation, or another sensor model. `score` compares the
texel forces of one case (an indentation) by every metric. `score_images` compares the grey levels of two images,
because recordings of real sensors hold no forces.  The metrics that need numpy alone are in
`validation.campaign.texel_metrics`, and `validation.campaign.results` averages scores over cases.  Force arrays have
one entry per texel, shape (n,) for n texels [N].  Errors are fractions unless the name ends in percent.  Lengths are in
metres.

Conventions:

* Only active texels are compared.  Force on a masked texel counts as `outside`, like force beyond the array.
* A quantity that does not exist, such as the centre of pressure of an empty image, is NaN in Python and null in JSON.
  Input that is not finite and a load that is not positive raise an error.
* Texel forces may be slightly negative, because the pressure under an elastic layer bonded to its base is negative at
  some distance from the contact.  Sums and differences use the signed forces.  Metrics that need masses (Wasserstein)
  clip the forces at zero.
* Grey levels are rounded half to even, as in numpy and Python.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import numpy.typing as npt

from fastmodel.signal.electronics import WHITE, WTS_0614_34, Electronics, grey_levels
from meshes.array import TexelArray
from meshes.array_types import FloatArray
from validation.campaign.texel_metrics import (
    AREA_THRESHOLD,
    active_area_iou,
    centre_of_pressure_error,
    misplaced_force,
    peak_error,
    second_moments,
    total_force_error,
)
from validation.campaign.wasserstein import wasserstein
from validation.results import Column, Number, Result, columns, result_model


@dataclass(frozen=True, kw_only=True)
class ImageScore:
    """Differences between an 8-bit image and its reference image, one pixel per active texel.

    Attributes:
        image_changed_percent: Mean absolute difference of the grey levels over 255 [%].
        pixels_changed: Number of pixels whose grey levels differ [-].
        pixels_lit: Number of pixels of the reference image that are not black [-].
    """

    image_changed_percent: float
    pixels_changed: int
    pixels_lit: int


def _share(heading: str, meaning: str, *, decimals: int = 1) -> Column:
    return Column(heading=heading, unit="%", factor=100, decimals=decimals, meaning=meaning)


def _length(heading: str, meaning: str) -> Column:
    return Column(heading=heading, unit="mm", factor=1e3, decimals=3, meaning=meaning)


def _greys(heading: str, meaning: str) -> Column:
    return Column(heading=heading, unit="%", decimals=2, meaning=meaning)


@result_model
class Score(Result):
    """Differences between predicted and reference texel forces of one case, by every metric.

    Two grey scales are used.  On the first, white is the largest texel force of the reference.  On the second, the
    published straight line from force to counts of the WTS 0614-34 sensor gives the grey levels.

    Attributes:
        total_force_error: Absolute difference of the sums of texel forces, over the load [-].
        misplaced_force: Share of the load that must move between texels to turn one image into the other [-].
        relative_l2: Euclidean norm of the difference over the Euclidean norm of the reference [-].
        centre_of_pressure_m: Distance between the two centres of pressure [m].
        image_changed_percent: Mean absolute difference of grey levels over 255, on the first grey scale [%].
        pixels_changed: Number of texels whose grey levels differ, on the first grey scale [-].
        image_changed_line_percent: Mean absolute difference of grey levels over 255, on the second grey scale [%].
        pixels_changed_line: Number of texels whose grey levels differ, on the second grey scale [-].
        pixels_lit_line: Number of reference texels that are not black, on the second grey scale [-].
        wasserstein_m: Wasserstein-1 distance of the two force maps, each scaled to unit mass [m].
        active_area_iou: Intersection over union of the areas with a force above `AREA_THRESHOLD` times the largest
            reference force [-].
        peak_error: Absolute difference of the two largest texel forces, over the largest reference force [-].
        width_error_x_m: Absolute difference of the root second central moments along x [m].
        width_error_y_m: Absolute difference of the root second central moments along y [m].
    """

    misplaced_force: Annotated[Number, _share("misplaced force", "share of the load on the wrong texel")]
    relative_l2: Annotated[Number, _share("relative L2", "norm of the difference over the norm of the reference")]
    total_force_error: Annotated[
        Number, _share("total force", "difference of the total texel forces over the load", decimals=2)
    ]
    peak_error: Annotated[Number, _share("peak", "difference of the largest texels over the reference's largest")]
    centre_of_pressure_m: Annotated[Number, _length("centre of pressure", "distance between the centres of pressure")]
    wasserstein_m: Annotated[Number, _length("Wasserstein-1", "mean distance that force would have to move")]
    image_changed_percent: Annotated[
        Number, _greys("image changed", "mean grey difference over 255, white = the case's peak")
    ]
    image_changed_line_percent: Annotated[
        Number, _greys("image changed, WTS line", "the same after the published line")
    ]
    pixels_changed: Annotated[
        int, Column(heading="pixels changed", decimals=0, meaning="texels whose grey level differs")
    ]
    pixels_changed_line: Annotated[int, Column(heading="pixels changed line", shown=False)]
    pixels_lit_line: Annotated[int, Column(heading="pixels lit line", shown=False)]
    active_area_iou: Annotated[Number, Column(heading="active area iou", shown=False)]
    width_error_x_m: Annotated[Number, Column(heading="width error x", unit="mm", factor=1e3, shown=False)]
    width_error_y_m: Annotated[Number, Column(heading="width error y", unit="mm", factor=1e3, shown=False)]


#: Printed form of each metric in tables (heading, unit and format), by the name of the metric.
METRICS = columns(Score)
#: Printed form of the metrics whose means over the cases are in the tables of the report, by the name of the metric.
TABULATED = {name: column for name, column in METRICS.items() if column.shown}


def score(
    reference: npt.ArrayLike,
    forces: npt.ArrayLike,
    *,
    reference_outside: float = 0.0,
    outside: float = 0.0,
    load: float,
    array: TexelArray,
    line: Electronics = WTS_0614_34,
) -> Score:
    """Compare predicted texel forces with the reference texel forces of the same case, by every metric.

    Args:
        reference: Reference texel forces, shape (n,) or (rows, columns) for n texels [N].
        forces: Predicted texel forces, of the same size [N].
        reference_outside: Part of the reference force that acts beyond the array [N].
        outside: Part of the predicted force that acts beyond the array [N].
        load: Applied load [N].
        array: The texels, with the mask of active ones.
        line: Electronics of the second grey scale, see `published_line`.

    Raises:
        ValueError: If `reference` or `forces` has another number of values than the array has texels, a value is not
            finite or the load is not positive.
    """
    r_all, f_all = _check_forces(reference, array, "reference"), _check_forces(forces, array, "forces")
    r, f = r_all[array.active], f_all[array.active]
    r_out = _check_finite(reference_outside, "reference_outside") + float(r_all[~array.active].sum())
    f_out = _check_finite(outside, "outside") + float(f_all[~array.active].sum())
    positions = array.centres[array.active]
    full_scale = float(r.max())
    scaled = score_images(grey_levels(r, full_scale), grey_levels(f, full_scale))
    by_line = score_images(grey_by_line(r, line), grey_by_line(f, line))
    width_r, width_f = second_moments(r, positions), second_moments(f, positions)
    return Score(
        total_force_error=total_force_error(r, f, load=load),
        misplaced_force=misplaced_force(r, f, reference_outside=r_out, outside=f_out, load=load),
        relative_l2=relative_l2(r, f),
        centre_of_pressure_m=centre_of_pressure_error(r, f, positions),
        image_changed_percent=scaled.image_changed_percent,
        pixels_changed=scaled.pixels_changed,
        image_changed_line_percent=by_line.image_changed_percent,
        pixels_changed_line=by_line.pixels_changed,
        pixels_lit_line=by_line.pixels_lit,
        wasserstein_m=wasserstein(r, f, positions),
        active_area_iou=active_area_iou(r, f, threshold=AREA_THRESHOLD * max(full_scale, 0.0)),
        peak_error=peak_error(r, f),
        width_error_x_m=abs(width_f[0] - width_r[0]),
        width_error_y_m=abs(width_f[1] - width_r[1]),
    )


def score_images(reference: npt.ArrayLike, image: npt.ArrayLike, *, active: npt.ArrayLike | None = None) -> ImageScore:
    """Compare two 8-bit images by mean grey difference and number of changed pixels, as the 2015 report does.

    Args:
        reference: Grey levels 0..255 of the reference image, any shape [-].
        image: Grey levels 0..255 of the predicted image, of the same size [-].
        active: True for each texel that measures, of the same size; all texels when not given.

    Raises:
        ValueError: If sizes differ, a value is not a whole number in 0..255, or no texel is active.
    """
    r, g = _check_greys(reference, "reference"), _check_greys(image, "image")
    if r.size != g.size:
        raise ValueError(f"images differ in size: reference has {r.size} pixels, image has {g.size}")
    mask = np.ones(r.size, dtype=bool) if active is None else np.asarray(active, dtype=bool).ravel()
    if mask.size != r.size or not mask.any():
        raise ValueError(f"active must mark at least one of the {r.size} pixels and have as many entries")
    difference = np.abs(r[mask] - g[mask])
    return ImageScore(
        image_changed_percent=float(100 * difference.sum() / (WHITE * mask.sum())),
        pixels_changed=int(np.count_nonzero(difference)),
        pixels_lit=int(np.count_nonzero(r[mask])),
    )


def relative_l2(reference: FloatArray, forces: FloatArray) -> float:
    """Return |f - r| / |r| in the Euclidean norm for forces f and reference r; NaN if r is zero [-]."""
    norm = float(np.linalg.norm(reference))
    return float(np.linalg.norm(forces - reference)) / norm if norm > 0 else math.nan


# --- Grey levels of texel forces. --------------------------------------------------------------------------


def published_line(electronics: Electronics) -> Electronics:
    """Return the published line from force to counts of the WTS 0614-34, for the forces on the texels of a sensor.

    The line was calibrated against the force of a tip on the cover.  The share of that force on the texel depends on
    the cover and on the texel.  It is known if the sensor was calibrated with the same tip.  Otherwise the line is
    applied to the force on the texel.

    Args:
        electronics: Electronics of the sensor.
    """
    same = electronics.calibrated == WTS_0614_34.calibrated
    return replace(WTS_0614_34, tip_share=electronics.tip_share if same else None)


def grey_by_line(forces: npt.ArrayLike, line: Electronics = WTS_0614_34) -> npt.NDArray[np.uint8]:
    """Convert texel forces to grey levels by the published straight line of the WTS 0614-34 sensor.

    Args:
        forces: Texel forces, any shape [N].
        line: The line, see `published_line`.

    Returns:
        Grey levels 0..255, of the same shape [-].
    """
    return np.asarray(grey_levels(line.counts(forces), line.output_max))


# --- Checks of arguments. ----------------------------------------------------------------------------------


def _check_forces(values: npt.ArrayLike, array: TexelArray, name: str) -> FloatArray:
    flat = np.asarray(values, dtype=np.float64).ravel()
    if flat.size != array.count:
        raise ValueError(f"{name} has {flat.size} values, {array.name} has {array.count} texels")
    if not np.isfinite(flat).all():
        where = int(np.flatnonzero(~np.isfinite(flat))[0])
        raise ValueError(f"{name} is {flat[where]} at texel {where}; texel forces must be finite")
    return flat


def _check_greys(values: npt.ArrayLike, name: str) -> FloatArray:
    flat = np.asarray(values, dtype=np.float64).ravel()
    if not ((flat >= 0) & (flat <= WHITE) & (flat == np.rint(flat))).all():
        raise ValueError(f"{name} must hold whole grey levels 0..{WHITE}")
    return flat


def _check_finite(value: float, name: str) -> float:
    if not math.isfinite(value):
        raise ValueError(f"{name} must be finite, not {value}")
    return value
