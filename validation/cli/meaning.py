"""Sentences at the end of a command's output: what the numbers mean, and what to do where they are bad."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from validation.campaign.comparison import Comparison
    from validation.derivation.derive import Derivation

#: Shares of the force on wrong texels below which the fast model is good, and below which it is usable: those of the
#: range that `softcover derive` states [-].
GOOD_MISPLACED, USABLE_MISPLACED = 0.02, 0.05
#: Estimated error of the finite elements below which they are good [-].
GOOD_ERROR = 0.01
#: Share of a load that a kernel puts on wrong texels below which a Gaussian describes the spread well [-].
GOOD_RESIDUAL = 0.05


def explain_derivation(derivation: Derivation) -> Iterator[str]:
    """Yield sentences about the kernel, the range of the fast model and the error of the finite elements."""
    residual, validity = derivation.fit.residual, derivation.parameters.validity
    yield (
        f"The Gaussian kernel puts {100 * residual:.1f} % of a load on wrong texels (good: below "
        f"{100 * GOOD_RESIDUAL:.0f} %)."
        + (
            " The real spread has a narrow core and a long, weak tail, which no Gaussian follows; simulators that know "
            "kernels only (Gazebo) have this error."
            if residual > GOOD_RESIDUAL
            else ""
        )
    )
    if derivation.fit.outside_kernel < 0:
        yield "The force beyond the kernel is negative: near incompressibility the base is pulled at some distance."
    if validity is not None and validity.load_2_percent > 0:
        yield (
            "The fast model does not use the kernel but the spread itself. Under a ball of "
            f"{1e3 * validity.ball_radius:.3g} mm radius it puts at most 2 % of the force on wrong texels up to "
            f"{validity.load_2_percent:.3g} N; compare your own touches by `softcover press`."
        )
    elif validity is not None and validity.load_5_percent > 0:
        yield (
            "The fast model does not use the kernel but the spread itself. Under a ball of "
            f"{1e3 * validity.ball_radius:.3g} mm radius it puts 2 to 5 % of the force on wrong texels (usable) up to "
            f"{validity.load_5_percent:.3g} N; compare your own touches by `softcover press`."
        )
    elif validity is not None:
        yield (
            "The fast model puts more than 5 % of the force on wrong texels under a ball at every load compared: take "
            "the finite elements (`softcover press --model fem`)."
        )
    else:
        yield "The range of the fast model is not known here; compare your own touches by `softcover press`."
    worst = max(derivation.error_estimate.values())
    yield _explain_error(worst, "check a touch of yours by `softcover press --accuracy 1%`")


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
        worst = max((value for value in fem.error_estimate.values() if not math.isnan(value)), default=0.0)
        yield _explain_error(worst, "`--accuracy 1%` adds finer grids")


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


def _explain_error(worst: float, remedy: str) -> str:
    """Explain the largest error estimate of the finite elements [-], and name a remedy if it is large."""
    sentence = (
        f"The finite elements state an error of at most {100 * worst:.2g} % (good: below {100 * GOOD_ERROR:.0f} %)"
    )
    return f"{sentence}." if worst <= GOOD_ERROR else f"{sentence}: {remedy}."
