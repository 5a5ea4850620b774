"""Scores of texel forces against the truth, each with an interval and the floor that the truth's own error sets.

Every error here is a distance d between two images.  If the truth t lies within its intervals around the stored forces
r, the triangle inequality gives |d(f, t) - d(f, r)| <= d(t, r) for any forces f.  The slack is the largest d(t, r) that
the intervals allow, however the errors of the texels hang together.  A score with its interval is therefore d(f, r)
minus to plus the slack, and the floor is the slack: the truth itself may score as badly as that.  `_find_slack` holds
the bounds.  For the area, d is one minus the intersection over union, with the threshold of the stored truth.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from tactilebench import texel_metrics as metrics
from tactilebench.case import BenchError, Case, FloatArray, as_numbers, cases
from tactilebench.wasserstein import wasserstein

#: Scores by name: heading, unit, and factor from SI to the unit.
SCORES = {
    "misplaced_force": ("misplaced", "%", 100.0),
    "total_force_error": ("total force", "%", 100.0),
    "peak_error": ("peak", "%", 100.0),
    "centre_of_pressure_m": ("centre", "mm", 1e3),
    "width_error_x_m": ("width x", "mm", 1e3),
    "width_error_y_m": ("width y", "mm", 1e3),
    "active_area_iou": ("area IoU", "%", 100.0),
    "wasserstein_m": ("Wasserstein", "mm", 1e3),
}
#: Likely faults with their factor from newtons, and the factor about it, up and down, that raises suspicion.
_SUSPECTS = (
    ("in uN", 1e6, 3.0),
    ("in mN", 1e3, 3.0),
    ("in kN", 1e-3, 3.0),
    ("in gf (grams)", 1e3 / 9.80665, 3.0),
    ("in kgf (kilograms)", 1 / 9.80665, 1.1),
    ("negative under pressure", -1.0, 30.0),
)
#: Largest sum of forces over the true one, and force over the load of its case, that is scored [-]; largest force [N].
_MOST, _LARGEST = 30.0, 1e9
#: Number of bootstrap samples of the cases, and their seed.
_SAMPLES, _SEED = 2000, 1


def score(
    forces: Mapping[str, npt.ArrayLike],
    known: Sequence[Case] | None = None,
    *,
    outside: Mapping[str, npt.ArrayLike] | None = None,
) -> dict[str, Any]:
    """Score forces on the texels of every case.

    Args:
        forces: Forces by the name of the case, of the shape `Case.shape` [N].
        known: Cases with truth; those of the release if None.
        outside: Force beyond the texels by the name of the case; where it is not given, it is not scored [N].

    Returns:
        The scores as values for JSON, see `score.schema.json`: by case, by tier, and over all cases.

    Raises:
        BenchError: If the forces are not whole: a case is missing or unknown, a shape is wrong, a number is not finite,
            or forces seem to have another unit.
    """
    known = cases() if known is None else known
    if not known:
        raise BenchError("no case is known; take those of `tactilebench.cases()`")
    given = _check_forces(forces, known)
    _refuse_strangers(outside or {}, known)
    beyond = {name: as_numbers(f"outside of {name}", values) for name, values in (outside or {}).items()}
    rows = [_score_case(case, given[case.name], beyond.get(case.name)) for case in known]
    tiers = dict.fromkeys(case.tier for case in known)
    return {
        "version": known[0].version,
        "truth": {case.name: case.require_truth().digest for case in known},
        "cases": rows,
        "tiers": {tier: _average([row for row in rows if row["tier"] == tier]) for tier in tiers},
        "overall": _average(rows),
    }


def score_case(case: Case, forces: npt.ArrayLike, outside: npt.ArrayLike | None = None) -> dict[str, Any]:
    """Score the forces of one case; see `score`, of whose cases this is one."""
    known = _check_forces({case.name: forces}, [case])[case.name]
    return _score_case(case, known, None if outside is None else as_numbers(f"outside of {case.name}", outside))


def list_scores() -> tuple[str, ...]:
    """Return the names of the scores; the Wasserstein distance needs scipy."""
    return tuple(SCORES) if importlib.util.find_spec("scipy") else tuple(SCORES)[:-1]


def _refuse_strangers(names: Mapping[str, npt.ArrayLike], known: Sequence[Case]) -> None:
    """Raise a BenchError if there is no case of a name."""
    if strange := sorted(set(names) - {case.name for case in known}):
        raise BenchError(f"case {strange[0]!r} is unknown; `python -m tactilebench cases` lists the cases")


def _check_forces(forces: Mapping[str, npt.ArrayLike], known: Sequence[Case]) -> dict[str, FloatArray]:
    """Return the forces as arrays; raise a BenchError if they are not whole."""
    names = {case.name for case in known}
    _refuse_strangers(forces, known)
    if missing := sorted(names - set(forces)):
        raise BenchError(
            f"{len(missing)} of {len(names)} cases are missing, for example {missing[0]}; add them, or score "
            "those tiers that are whole with --tier"
        )
    found = {}
    for case in known:
        values = as_numbers(case.name, forces[case.name])
        rows = (*case.shape[:-1], case.rows, case.columns)
        if values.shape not in {case.shape, rows}:
            raise BenchError(f"{case.name}: forces of shape {values.shape}; expected {case.shape} or {rows}")
        found[case.name] = values = values.reshape(case.shape)
        _check_bound(case, values, _LARGEST, "; compute it again")
    ratios = [found[case.name].sum() / case.require_truth().forces.sum() for case in known]
    low, middle, high = np.quantile(ratios, (0.25, 0.5, 0.75)).tolist()
    guesses = []
    for fault, factor, wide in _SUSPECTS:
        least, most = sorted((low / factor, high / factor))
        if 1 / wide < least and most < wide:
            guesses.append(f", as if {fault}")
    if guesses or low > _MOST:
        raise BenchError(
            f"the forces are {middle:.4g} times the true ones{''.join(guesses)}; give newtons, positive under pressure"
        )
    for case in known:
        _check_bound(case, found[case.name], _MOST * case.load, f", {_MOST:g} times the load and more; give newtons")
    return found


def _check_bound(case: Case, forces: FloatArray, bound: float, remedy: str) -> None:
    """Raise a BenchError with the place of a force that is not finite or beyond a bound [N]."""
    if (faults := np.argwhere(~(np.abs(forces) <= bound))).size:
        place = f"{f'instant {faults[0][0]}, ' if case.motion else ''}texel {faults[0][-1]}"
        raise BenchError(f"{case.name}: {place} has {forces[tuple(faults[0])]:.4g} N{remedy}")


def _score_case(case: Case, forces: FloatArray, outside: FloatArray | None) -> dict[str, Any]:
    """Score the instants of a case, and average them."""
    truth = case.require_truth()
    given = truth.outside if outside is None else outside
    if given.shape != truth.outside.shape or not (np.abs(given) <= _MOST * case.load).all():
        raise BenchError(
            f"{case.name}: the force outside must be one number for each of {len(case.loads)} instants [N], finite and "
            f"at most {_MOST:g} times the load"
        )
    count = len(case.loads)
    frames = [each.reshape(count, -1) for each in (truth.forces, truth.half_width, forces)]
    values, slacks = [], []
    for k, (r, w, f) in enumerate(zip(*frames, strict=True)):
        beyond = [float(each.reshape(count)[k]) for each in (truth.outside, given, truth.outside_half_width)]
        values.append(_compare(r, f, (beyond[0], beyond[1]), case.loads[k], case.centres))
        slacks.append(_find_slack(r, w, beyond[2], case.loads[k], case.centres))
    scores = {}
    for name in list_scores():
        mean, slack = (float(np.mean([each[name] for each in kind])) for kind in (values, slacks))
        floor = 1 - slack if name == "active_area_iou" else slack
        scores[name] = _entry(mean, mean - slack, mean + slack, floor, name)
    return {"name": case.name, "tier": case.tier, "scores": scores}


def _compare(
    r: FloatArray, f: FloatArray, outside: tuple[float, float], load: float, places: FloatArray
) -> dict[str, float]:
    """Return every score of forces f against the reference r, as softcover computes it."""
    x, y = (
        abs(a - b) for a, b in zip(metrics.second_moments(r, places), metrics.second_moments(f, places), strict=True)
    )
    return {
        "misplaced_force": metrics.misplaced_force(r, f, reference_outside=outside[0], outside=outside[1], load=load),
        "total_force_error": metrics.total_force_error(r, f, load=load),
        "peak_error": metrics.peak_error(r, f),
        "centre_of_pressure_m": metrics.centre_of_pressure_error(r, f, places),
        "width_error_x_m": x,
        "width_error_y_m": y,
        "active_area_iou": metrics.active_area_iou(r, f, threshold=metrics.AREA_THRESHOLD * max(float(r.max()), 0.0)),
        "wasserstein_m": wasserstein(r, f, places) if "wasserstein_m" in list_scores() else math.nan,
    }


def _find_slack(r: FloatArray, w: FloatArray, w_out: float, load: float, places: FloatArray) -> dict[str, float]:
    """Return the largest distance from forces r of forces within half widths w, for every score.

    With errors e of the texels, |e| <= w, the sum R of r and the centre c, the centre moves by sum e (x - c) / (R +
    sum e), and the variance changes by sum e ((x - c)^2 - variance) / (R + sum e) less the square of that move.  The
    Wasserstein distance is at most that of transport through c.
    """
    total, peak, wide = float(r.sum()), float(r.max()), float(w.sum())
    rest = total - wide if total > wide else math.nan
    apart = places - metrics.centre_of_pressure(r, places)
    far = np.linalg.norm(apart, axis=1)
    centre = float(w @ far) / rest
    sure, possible = (int((each > metrics.AREA_THRESHOLD * peak).sum()) for each in (r - w, r + w))
    slack = {
        "misplaced_force": (wide + w_out) / (2 * load),
        "total_force_error": wide / load,
        "peak_error": max(float((r + w).max()) - peak, peak - float((r - w).max())) / peak,
        "centre_of_pressure_m": centre,
        "active_area_iou": 1 - sure / max(possible, 1),
        "wasserstein_m": centre + wide / rest * float(np.maximum(r, 0) @ far) / total,
    }
    for axis, width in zip("xy", metrics.second_moments(r, places), strict=True):
        change = float(w @ abs(apart[:, "xy".index(axis)] ** 2 - width**2)) / rest + centre**2
        slack[f"width_error_{axis}_m"] = width - math.sqrt(max(width**2 - change, 0.0))
    return slack


def _average(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Average scores over cases; the interval is a bootstrap over cases, widened by the mean slack."""
    names, weights = list_scores(), _draw_weights(len(rows))
    found: dict[str, Any] = {"cases": len(rows)}
    for name in names:
        table = np.array([[row["scores"][name][key] for key in ("value", "floor")] for row in rows], dtype=np.float64)
        valid = np.isfinite(table[:, 0])
        if not valid.any():
            found[name] = _entry(math.nan, math.nan, math.nan, float(np.mean(table[:, 1])), name)
            continue
        mean, floor = float(table[valid, 0].mean()), float(table[valid, 1].mean())
        slack = 1 - floor if name == "active_area_iou" else floor
        drawn = weights[:, valid].sum(axis=1)
        means = (weights[:, valid] @ table[valid, 0])[drawn > 0] / drawn[drawn > 0]
        low, high = np.quantile(means, (0.025, 0.975)).tolist()
        found[name] = _entry(mean, low - slack, high + slack, floor, name)
    return found


def _entry(value: float, low: float, high: float, floor: float, name: str) -> dict[str, float | None]:
    """Return a score with its interval, cut off at the least and greatest possible value, and its floor."""
    most = 1.0 if name == "active_area_iou" else math.inf
    numbers = {"value": value, "low": max(low, 0.0), "high": min(high, most), "floor": floor}
    return {key: each if math.isfinite(value) and math.isfinite(each) else None for key, each in numbers.items()}


@cache
def _draw_weights(count: int) -> FloatArray:
    """Return how often each of some cases is drawn in each bootstrap sample, shape (samples, count)."""
    rng = np.random.default_rng(_SEED)
    return rng.multinomial(count, np.full(count, 1 / count), size=_SAMPLES).astype(np.float64)
