"""Metrics between a tactile image and its reference: pure functions from arrays to numbers.

`score` compares the texel forces of one case by every metric.  `score_images` compares grey levels alone, because
recordings have no forces.  `validation.campaign.pooling` averages over cases.  Force arrays have one entry per texel,
shape (n,) [N].  Errors are fractions unless the name says percent; lengths are in metres.

Conventions:

* Only active texels are compared.  Force on a masked texel counts as `outside`, like force that leaves the array.
* A quantity that does not exist (the centre of pressure of an empty image) is NaN here and null in JSON.  Input that
  is not finite and a load that is not positive raise an error.
* Texel forces may be slightly negative: the response of a bonded layer dips below zero.  Sums and differences use them
  as they are.  Metrics that need masses (Wasserstein) use the positive part.
* Rounding to grey levels is half to even, as in numpy and Python.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from fastmodel.signal.electronics import WHITE, WTS_0614_34, grey_levels
from meshes.array import FloatArray, TexelArray

#: A texel counts as active in `active_area_iou` above this share of the largest reference texel [-].
AREA_THRESHOLD = 0.1


@dataclass(frozen=True, kw_only=True)
class ImageScore:
    """Differences of two 8-bit images.

    Attributes:
        image_changed_percent: Mean absolute difference over 255, active texels only [%].
        pixels_changed: Active texels whose grey level differs [-].
        pixels_lit: Active texels of the reference image that are not black [-].
    """

    image_changed_percent: float
    pixels_changed: int
    pixels_lit: int


@dataclass(frozen=True, kw_only=True)
class Score:
    """One case by every metric.

    Attributes:
        total_force_error: Difference of the total texel forces over the load [-].
        misplaced_force: Share of the load that must move to turn one image into the other [-].
        relative_l2: Norm of the difference over the norm of the reference [-].
        centre_of_pressure_m: Distance between the centres of pressure [m].
        image_changed_percent: Mean grey difference over 255, with white at the reference's largest texel [%].
        pixels_changed: Texels whose grey level differs, on the same grey scale [-].
        image_changed_line_percent: Mean grey difference over 255 after the published line of the WTS 0614-34 [%].
        pixels_changed_line: Texels whose grey level differs after that line [-].
        pixels_lit_line: Texels of the reference that are not black after that line [-].
        wasserstein_m: Wasserstein-1 distance of the maps, each scaled to unit mass [m].
        active_area_iou: Intersection over union of the active areas, at `AREA_THRESHOLD` of the reference's peak [-].
        peak_error: Difference of the largest texels over the reference's largest [-].
        width_error_x_m: Difference of the root second central moments along x [m].
        width_error_y_m: Difference of the root second central moments along y [m].
    """

    total_force_error: float
    misplaced_force: float
    relative_l2: float
    centre_of_pressure_m: float
    image_changed_percent: float
    pixels_changed: int
    image_changed_line_percent: float
    pixels_changed_line: int
    pixels_lit_line: int
    wasserstein_m: float
    active_area_iou: float
    peak_error: float
    width_error_x_m: float
    width_error_y_m: float

    def as_json(self) -> dict[str, float | int | None]:
        """Values by name; None for NaN, which JSON lacks."""
        return {key: None if math.isnan(value) else value for key, value in asdict(self).items()}


def score(
    reference: npt.ArrayLike,
    forces: npt.ArrayLike,
    *,
    reference_outside: float = 0.0,
    outside: float = 0.0,
    load: float,
    array: TexelArray,
) -> Score:
    """Compare the texel forces of one case with the reference's.

    Args:
        reference: Reference texel forces, shape (n,) or (rows, columns) [N].
        forces: Texel forces to score, same size [N].
        reference_outside: Reference force beyond the array [N].
        outside: Scored force beyond the array [N].
        load: Applied load [N].
        array: The texels.

    Raises:
        ValueError: If a shape is not the array's, a value is not finite or the load is not positive.
    """
    r_all, f_all = _check_forces(reference, array, "reference"), _check_forces(forces, array, "forces")
    r, f = r_all[array.active], f_all[array.active]
    r_out = _check_finite(reference_outside, "reference_outside") + float(r_all[~array.active].sum())
    f_out = _check_finite(outside, "outside") + float(f_all[~array.active].sum())
    positions = array.centres[array.active]
    full_scale = float(r.max())
    scaled = score_images(grey_levels(r, full_scale), grey_levels(f, full_scale))
    line = score_images(grey_by_line(r), grey_by_line(f))
    width_r, width_f = second_moments(r, positions), second_moments(f, positions)
    return Score(
        total_force_error=total_force_error(r, f, load=load),
        misplaced_force=misplaced_force(r, f, reference_outside=r_out, outside=f_out, load=load),
        relative_l2=relative_l2(r, f),
        centre_of_pressure_m=centre_of_pressure_error(r, f, positions),
        image_changed_percent=scaled.image_changed_percent,
        pixels_changed=scaled.pixels_changed,
        image_changed_line_percent=line.image_changed_percent,
        pixels_changed_line=line.pixels_changed,
        pixels_lit_line=line.pixels_lit,
        wasserstein_m=wasserstein(r, f, positions),
        active_area_iou=active_area_iou(r, f, threshold=AREA_THRESHOLD * max(full_scale, 0.0)),
        peak_error=peak_error(r, f),
        width_error_x_m=abs(width_f[0] - width_r[0]),
        width_error_y_m=abs(width_f[1] - width_r[1]),
    )


def score_images(reference: npt.ArrayLike, image: npt.ArrayLike, *, active: npt.ArrayLike | None = None) -> ImageScore:
    """Compare two 8-bit images by the two figures of the 2015 report.

    Args:
        reference: Grey levels 0..255, any shape [-].
        image: Grey levels 0..255 of the same shape [-].
        active: Which texels measure, same shape or flat; all when not given.

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


# --- single metrics, on active texels only ------------------------------------------------------------------


def total_force_error(reference: FloatArray, forces: FloatArray, *, load: float) -> float:
    """|sum f - sum r| / load: error of the total measured force [-]."""
    return float(abs(forces.sum() - reference.sum()) / _check_load(load))


def misplaced_force(
    reference: FloatArray, forces: FloatArray, *, reference_outside: float, outside: float, load: float
) -> float:
    """(sum |f - r| + |outside_f - outside_r|) / (2 load) [-].

    The factor 2 counts a newton that moves from one texel to another once, not twice.
    """
    moved = np.abs(forces - reference).sum() + abs(outside - reference_outside)
    return float(moved / (2 * _check_load(load)))


def relative_l2(reference: FloatArray, forces: FloatArray) -> float:
    """|f - r| / |r| in the Euclidean norm; NaN for an empty reference [-]."""
    norm = float(np.linalg.norm(reference))
    return float(np.linalg.norm(forces - reference)) / norm if norm > 0 else math.nan


def peak_error(reference: FloatArray, forces: FloatArray) -> float:
    """|max f - max r| / max r; NaN where no reference texel is positive [-]."""
    peak = float(reference.max())
    return abs(float(forces.max()) - peak) / peak if peak > 0 else math.nan


def centre_of_pressure(forces: FloatArray, positions: FloatArray) -> FloatArray:
    """Force-weighted mean of the texel centres, shape (d,) [m]; NaN where the total is not positive."""
    total = float(forces.sum())
    if total <= 0:
        return np.full(positions.shape[1], np.nan)
    return np.asarray(forces @ positions / total, dtype=np.float64)


def centre_of_pressure_error(reference: FloatArray, forces: FloatArray, positions: FloatArray) -> float:
    """Distance between the two centres of pressure; NaN where one does not exist [m]."""
    apart = centre_of_pressure(forces, positions) - centre_of_pressure(reference, positions)
    return float(np.linalg.norm(apart))


def second_moments(forces: FloatArray, positions: FloatArray) -> tuple[float, float]:
    """Root second central moments along x and y [m]; NaN where the total is not positive or a moment is negative."""
    total = float(forces.sum())
    if total <= 0:
        return (math.nan, math.nan)
    apart = positions[:, :2] - centre_of_pressure(forces, positions)[:2]
    x, y = (math.sqrt(value) if value >= 0 else math.nan for value in (forces @ apart**2 / total).tolist())
    return (x, y)


def active_area_iou(reference: FloatArray, forces: FloatArray, *, threshold: float) -> float:
    """Texels above the threshold in both images over texels above it in either; 1 if there are none [-].

    Args:
        reference: Reference texel forces, shape (n,) [N].
        forces: Texel forces, shape (n,) [N].
        threshold: Force above which a texel is active [N].
    """
    r, f = reference > threshold, forces > threshold
    either = np.count_nonzero(r | f)
    return float(np.count_nonzero(r & f) / either) if either else 1.0


def wasserstein(reference: FloatArray, forces: FloatArray, positions: FloatArray) -> float:
    """Wasserstein-1 distance of the positive parts, each scaled to unit mass [m]; NaN where one is empty.

    With a distance as cost, mass common to both maps need not move (Kantorovich and Rubinstein).  So the exact linear
    programme runs from the texels with a surplus to those with a deficit only, which makes it much smaller.
    """
    from scipy.stats import wasserstein_distance_nd

    r, f = np.maximum(reference, 0.0), np.maximum(forces, 0.0)
    if r.sum() <= 0 or f.sum() <= 0:
        return math.nan
    difference = f / f.sum() - r / r.sum()
    surplus, deficit = difference > 0, difference < 0
    mass = float(difference[surplus].sum())
    if mass < np.finfo(float).eps * len(r):
        return 0.0
    distance = wasserstein_distance_nd(
        positions[surplus], positions[deficit], difference[surplus], -difference[deficit]
    )
    return mass * float(distance)


# --- grey levels --------------------------------------------------------------------------------------------


def grey_by_line(forces: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Grey levels after the published line of the WTS 0614-34, same shape [-].

    Args:
        forces: Texel forces, any shape [N].
    """
    return grey_levels(WTS_0614_34.counts(forces), WTS_0614_34.output_max)


# --- checks ------------------------------------------------------------------------------------------------


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


def _check_load(load: float) -> float:
    if not (math.isfinite(load) and load > 0):
        raise ValueError(f"the load must be positive, not {load} N")
    return load
