"""Comparison error E = S - D of each quantity, with its validation uncertainty (ASME V&V 20-2009, sections 1 and 5).

S is the fast model and D the reference.  u_val = sqrt(u_num^2 + u_input^2 + u_D^2).  Where the absolute value of E is
below u_val, a comparison with these uncertainties cannot tell the error of the model from that of inputs, numbers and
data.  The two models share their inputs, so that u_input cancels in their own comparison; there E stands against u_num
alone.  u_val is what remains for a real sensor whose cover and pose are known within the stated uncertainties.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np

from meshes import TexelArray
from validation.campaign.results import CaseResult, texel_error
from validation.credibility.input_uncertainty import InputUncertainty
from validation.metrics import centre_of_pressure, second_moments
from validation.results import Column, Number, Result, result_model

#: Grid convergence index over the standard uncertainty, for an error that is skewed to one side (ASME V&V 20-2009,
#: section 2-4.4) [-].
_COVERAGE = 1.15
#: Change of a texel force by the fast model's iteration tolerance, over the load [-].
_ITERATION = 2e-4


_WORDS = {True: "yes", False: "no"}


@result_model
class ComparisonError(Result):
    """One quantity of one case.

    Attributes:
        case: Name of the case.
        quantity: Name of the quantity with its unit.
        factor: Factor from SI units to this unit [-].
        fast: Value of the fast model, S, in SI units.
        reference: Value of the reference, D, in SI units.
        u_num: Standard uncertainty of the numerical solutions, in SI units.
        u_input: Standard uncertainty due to the inputs, in SI units.
        u_data: Standard uncertainty of the data, in SI units.
    """

    case: Annotated[str, Column(heading="case and quantity", small="{0.quantity}")]
    quantity: str
    factor: float
    fast: Annotated[Number, Column(heading="S", digits=4, factor_field="factor")]
    reference: Annotated[Number, Column(heading="D", digits=4, factor_field="factor")]
    u_num: Annotated[Number, Column(heading="u_num", digits=2, factor_field="factor")]
    u_input: Annotated[Number, Column(heading="u_input", digits=2, factor_field="factor")]
    u_data: Annotated[Number, Column(heading="u_D", digits=2, factor_field="factor")]
    printed: ClassVar[Mapping[str, Column]] = {
        "error": Column(heading="E", digits=2, factor_field="factor"),
        "u_val": Column(heading="u_val", digits=2, factor_field="factor"),
        "resolved_here": Column(heading="|E| > u_num: resolved here", words=_WORDS),
        "resolved": Column(heading="|E| > u_val: resolved on a real cover", words=_WORDS),
    }
    computed = (
        ("E", "error"),
        ("u_val", "u_val"),
        ("resolved_with_shared_inputs", "resolved_here"),
        ("resolved", "resolved"),
    )

    @property
    def error(self) -> float:
        """Comparison error E = S - D."""
        return self.fast - self.reference

    @property
    def u_val(self) -> float:
        """Validation uncertainty."""
        return math.sqrt(self.u_num**2 + self.u_input**2 + self.u_data**2)

    @property
    def resolved_here(self) -> bool:
        """Whether the comparison of the two models, which share their inputs, shows an error of the fast model."""
        return abs(self.error) > self.u_num

    @property
    def resolved(self) -> bool:
        """Whether a comparison with all uncertainties would show this error."""
        return abs(self.error) > self.u_val


def compare_quantities(
    array: TexelArray, result: CaseResult, inputs: InputUncertainty, data: float
) -> list[ComparisonError]:
    """Compare the fast model with the reference of one case, quantity by quantity.

    Args:
        array: The array.
        result: The scored case.
        inputs: Effects of the uncertain inputs on its image.
        data: Standard uncertainty of measured forces, over the force; 0 for the reference as data [-].
    """
    reference, fast = result.reference.texel_forces, result.predictions["fast"].texel_forces
    estimate = texel_error(result.reference.error_estimate) / _COVERAGE
    load, positions = result.case.load, array.centres[:, :2]
    sums = np.ones(array.count)
    peak = np.zeros(array.count)
    peak[np.argmax(reference)] = 1.0
    # The quantities are weighted sums of the texel forces; those of a centre of pressure are divided by their sum.
    weights = {"largest texel [mN]": peak, "all texels [mN]": sums}
    out = []
    for name, weight in weights.items():
        values = float(weight @ fast), float(weight @ reference)
        u_num = math.hypot(estimate * values[1], _ITERATION * load)
        u_input = _add_squares(inputs.of(weight.dot))
        out.append(_build(result, name, values, (u_num, u_input, data * abs(values[1]))))
    if min(reference.sum(), fast.sum(), inputs.image.sum()) <= 0:
        return out
    # The shares of all texels have the relative error of the largest; the lever is the width of the image.
    width = max((value for value in second_moments(reference, positions) if not math.isnan(value)), default=0.0)
    middle = centre_of_pressure(inputs.image, positions)
    for axis, name in enumerate(("x", "y")):
        values = (
            float(centre_of_pressure(fast, positions)[axis]),
            float(centre_of_pressure(reference, positions)[axis]),
        )
        lever = (positions[:, axis] - middle[axis]) / float(inputs.image.sum())
        u_num, u_input = math.hypot(estimate, _ITERATION) * width, _add_squares(inputs.of(lever.dot))
        out.append(_build(result, f"centre of pressure {name} [mm]", values, (u_num, u_input, 0.0)))
    return out


def _build(
    result: CaseResult, name: str, values: Sequence[float], uncertainties: tuple[float, float, float]
) -> ComparisonError:
    """Build the comparison error of a quantity that is printed in mN or mm."""
    u_num, u_input, u_data = uncertainties
    return ComparisonError(
        case=result.case.name,
        quantity=name,
        factor=1e3,
        fast=values[0],
        reference=values[1],
        u_num=u_num,
        u_input=u_input,
        u_data=u_data,
    )


def _add_squares(contributions: Mapping[str, float]) -> float:
    return math.sqrt(sum(value**2 for value in contributions.values()))
