"""Sentences at the end of a command's output: what the numbers mean, and what to do where they are bad."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from validation.campaign.comparison import Comparison

#: Share of the force on wrong texels below which the fast model is called good [-].  `softcover derive` states the
#: range of loads for this share.
GOOD_MISPLACED = 0.02
#: Share of the force on wrong texels below which the fast model is called usable [-].  `softcover derive` states the
#: range of loads for this share.
USABLE_MISPLACED = 0.05
#: Estimated relative error of the finite elements below which they are called good [-].
GOOD_ERROR = 0.01


def explain_comparison(comparison: Comparison) -> Iterator[str]:
    """Yield sentences about how far the two models agree, and how accurate the finite elements are."""
    score, fem, fast = comparison.score, comparison.fem, comparison.fast
    if score is not None:
        share = score.misplaced_force
        yield (
            f"The fast model puts {100 * share:.1f} % of the force on wrong texels here (good: below "
            f"{100 * GOOD_MISPLACED:.0f} %, usable: below {100 * USABLE_MISPLACED:.0f} %)."
        )
        if share > GOOD_MISPLACED:
            method = "" if fast is None or fast.method == "cover" else "; `--method cover` is the most accurate method"
            yield (
                "It is one linear response: a deep or sharp touch on a soft cover leaves its range. Press less, or "
                f"take the finite elements{method}. `softcover derive` states the range."
            )
    elif fast is not None:
        yield "No finite elements were computed: `--model fem,fast` shows how far the fast model is right here."
    if fem is not None and "fem" in comparison.models:
        remedy = "`--accuracy 1%` adds finer grids" if fem.mesh is None else "take it as their uncertainty"
        yield explain_error(fem.error_estimate.values(), remedy)
        if fem.mesh is not None:
            yield (
                "The force on a texel is the resultant on it along its own normal, so forces on a curved base do not "
                "sum to the load; the balance is that of the forces on cover and base."
            )


def explain_verdict(changes: Mapping[str, float]) -> str:
    """Explain the largest changes of quantities over their tolerances [-], by title."""
    moved = [title for title, value in changes.items() if not value <= 1]
    if not moved:
        worst = max(changes, key=lambda title: changes[title], default="")
        near = f"; the largest change is {changes[worst]:.2g} of its tolerance ({worst})" if worst else ""
        return f"All {len(changes)} quantities are within their tolerances{near}."
    groups = ", ".join(dict.fromkeys(title.partition(":")[0] for title in moved))
    return (
        f"{len(moved)} of {len(changes)} quantities left their tolerances, in: {groups}. An improvement counts as a "
        "change too. Look for the cause in the first group: later ones follow from it."
    )


def explain_error(estimates: Iterable[float], remedy: str) -> str:
    """Explain the largest error estimate of the finite elements [-], and name a remedy if it is large."""
    known = [each for each in estimates if not math.isnan(each)]
    if not known:
        return "No error of the finite elements is known: there is one mesh only."
    worst = max(known)
    sentence = (
        f"The finite elements state an error of at most {100 * worst:.2g} % (good: below {100 * GOOD_ERROR:.0f} %)"
    )
    return f"{sentence}." if worst <= GOOD_ERROR else f"{sentence}: {remedy}."
