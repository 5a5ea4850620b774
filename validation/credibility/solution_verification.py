"""Solution verification: each quantity of the reference on three grids, its observed order and its estimated error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from scipy.optimize import brentq

from validation.campaign.results import CaseResult
from validation.results import Column, Number, Result, result_model

#: Quantities of the table, with unit and factor from SI units to it.
_QUANTITIES = {"depth": ("µm", 1e6), "peak_texel": ("mN", 1e3), "contact_area": ("mm²", 1e6)}
#: Range in which an observed order is searched [-].
_ORDERS = (0.05, 10.0)
#: Number of grids.
_GRIDS = 3


@result_model
class Convergence(Result):
    """One quantity of one case on three grids.

    Attributes:
        case: Name of the case.
        quantity: Name of the quantity.
        unit: Unit of the printed values.
        factor: Factor from SI units to this unit [-].
        values: The quantity on the three grids, coarsest first, in SI units.
        result: The value of the result, which may be extrapolated or corrected; NaN if not known.
        order: Observed order of convergence [-]; NaN if the values do not converge monotonically.
        estimate: Estimated relative error of the result (grid convergence index or the like) [-].
    """

    case: Annotated[str, Column(heading="case and quantity", small="{0.quantity} [{0.unit}]")]
    quantity: str
    unit: str
    factor: float
    values: Annotated[
        tuple[Number, ...], Column(heading="", digits=5, parts=("coarse", "middle", "fine"), factor_field="factor")
    ]
    result: Annotated[Number, Column(heading="result", digits=5, factor_field="factor")]
    order: Annotated[Number, Column(heading="observed order", digits=2)]
    estimate: Annotated[Number, Column(heading="estimated error", unit="%", factor=100, digits=2)]


def verify_solutions(results: Sequence[CaseResult]) -> tuple[Convergence, ...]:
    """List the quantities of the reference in every case on three grids.

    Args:
        results: The cases.
    """
    out = []
    for result in results:
        reference = result.reference
        grids = reference.grid_values or {}
        for name, (unit, factor) in _QUANTITIES.items():
            if len(grids.get(name, ())) != _GRIDS:
                continue
            found = {
                "depth": reference.depth,
                "peak_texel": float(reference.texel_forces.max()),
                "contact_area": reference.contact_area,
            }
            out.append(
                Convergence(
                    case=result.case.name,
                    quantity=name.replace("_", " "),
                    unit=unit,
                    factor=factor,
                    values=grids[name],
                    result=found[name],
                    order=observe_order(grids[name], grids["size"]),
                    estimate=reference.error_estimate[name],
                )
            )
    return tuple(out)


def observe_order(values: Sequence[float], sizes: Sequence[float]) -> float:
    """Return the observed order of convergence of three values [-].

    The order p solves (f1 - f2) / (f2 - f3) = (h1^p - h2^p) / (h2^p - h3^p) (Celik et al. 2008).

    Args:
        values: Values on three grids, coarsest first.
        sizes: Element sizes of the grids, descending.

    Returns:
        The order; NaN if the values do not converge monotonically, or with an order out of 0.05..10.
    """
    coarse, fine = values[0] - values[1], values[1] - values[2]
    if coarse * fine <= 0:
        return math.nan

    def miss(order: float) -> float:
        first, second, third = (float((size / sizes[0]) ** order) for size in sizes)
        return (first - second) / (second - third) - coarse / fine

    if miss(_ORDERS[0]) * miss(_ORDERS[1]) > 0:
        return math.nan
    return float(brentq(miss, *_ORDERS))
