"""Score of a calibration on recordings that were left out of a second fit, beside a line per texel."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastmodel.signal.electronics import WHITE, grey_levels
from meshes.array import FloatArray
from validation.calibration.forward_fit import ForwardFit, fit_forward
from validation.calibration.observations import BoolArray, Observations

#: Every third recording of a placement is left out.
_EVERY = 3
#: Smallest number of recordings that remain, and of loads among them [-].
_FEWEST_LEFT, _FEWEST_LOADS = 3, 2


@dataclass(frozen=True, kw_only=True, eq=False)
class HoldOut:
    """Predictions of recordings that were not fitted.

    Attributes:
        names: Names of the k left-out images.
        loads: Their loads, shape (k,) [N].
        recorded: Recorded counts, shape (k, n) [-].
        predicted: Counts predicted by the forward model, shape (k, n) [-].
        image_changed_percent: Mean absolute difference of grey levels over 255, mean over images [%].
        line_percent: The same for a straight line in the load per texel and placement [%]; None if the recordings that
            remain in a placement have fewer than two loads.
    """

    names: tuple[str, ...]
    loads: FloatArray
    recorded: FloatArray
    predicted: FloatArray
    image_changed_percent: float
    line_percent: float | None

    @property
    def summary(self) -> str:
        """The score beside that of a line per texel, in words."""
        line = "" if self.line_percent is None else f", line per texel {self.line_percent:.2f} %"
        return f"image changed {self.image_changed_percent:.2f} %{line}"

    def as_json(self) -> dict[str, Any]:
        """Return the scores and the names of the left-out recordings."""
        return {
            "recordings": list(dict.fromkeys(self.names)),
            "image_changed_percent": self.image_changed_percent,
            "line_per_texel_percent": self.line_percent,
        }


def score_hold_out(fit: ForwardFit, full_scale: float) -> HoldOut | None:
    """Leave out every third recording of each placement in the order of loads, fit again, and score the predictions.

    One recording of each placement whose pose is fitted remains.

    Args:
        fit: The fit to all recordings, which says what to fit.
        full_scale: Count that is shown white [-].

    Returns:
        The predictions; None if too few recordings remain.
    """
    seen = fit.observations
    scored = _choose_left_out(seen)
    left = ~scored
    kept = seen.select(left)
    if len(set(kept.groups)) < _FEWEST_LEFT or len(np.unique(kept.loads)) < _FEWEST_LOADS or not scored.any():
        return None
    again = fit_forward(fit.method, kept, fit.options, start=None)
    held = seen.select(scored)
    predicted = again.predict(held)
    line = _predict_by_line(kept, held)
    return HoldOut(
        names=held.groups,
        loads=held.loads,
        recorded=held.counts,
        predicted=predicted,
        image_changed_percent=_compare(held.counts, predicted, held.measured, full_scale),
        line_percent=None if line is None else _compare(held.counts, line, held.measured, full_scale),
    )


def _choose_left_out(seen: Observations) -> BoolArray:
    """Return whether each of m images belongs to a recording that is left out, shape (m,)."""
    by_placement: dict[str, dict[str, float]] = {}
    count = Counter(placement.name for placement in seen.placements)
    for group, placement, load in zip(seen.groups, seen.placements, seen.loads.tolist(), strict=True):
        alone = placement.known and count[placement.name] == 1
        recordings = by_placement.setdefault("" if alone else placement.name, {})
        recordings[group] = max(load, recordings.get(group, 0.0))
    out: set[str] = set()
    for number, recordings in enumerate(by_placement.values()):
        # The first one that is left out changes from placement to placement, so that several loads are left out.
        first = (1 + number) % min(_EVERY, len(recordings))
        if len(recordings) > 1:
            out.update(sorted(recordings, key=recordings.__getitem__)[first::_EVERY])
    return np.array([group in out for group in seen.groups])


def _predict_by_line(kept: Observations, held: Observations) -> FloatArray | None:
    """Predict left-out counts by a straight line in the load per texel and placement, shape (k, n) [-]."""
    line = np.zeros_like(held.counts)
    for name in dict.fromkeys(each.name for each in held.placements):
        rows = np.array([each.name == name for each in held.placements])
        near = kept.select(np.array([each.name == name for each in kept.placements]))
        if len(np.unique(near.loads)) < _FEWEST_LOADS:
            return None
        terms = np.column_stack([np.ones_like(near.loads), near.loads])
        coefficients = np.linalg.lstsq(terms, near.counts, rcond=None)[0]
        line[rows] = np.maximum(np.column_stack([np.ones(rows.sum()), held.loads[rows]]) @ coefficients, 0.0)
    return line


def _compare(recorded: FloatArray, predicted: FloatArray, measured: BoolArray, full_scale: float) -> float:
    """Mean over images of the image changed [%]."""
    grey = [np.asarray(grey_levels(each, full_scale), dtype=np.float64) for each in (recorded, predicted)]
    changes = [100 * np.abs(a - b)[lit].mean() / WHITE for a, b, lit in zip(*grey, measured, strict=True)]
    return float(np.mean(changes))
