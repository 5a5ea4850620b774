"""How metrics are printed: heading, unit, number of decimals and meaning."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping


@dataclasses.dataclass(frozen=True, kw_only=True)
class Metric:
    """How a metric is printed in tables.

    Attributes:
        heading: Heading of the metric's column.
        factor: Factor from the metric's value, in SI units or as a fraction, to the printed unit.
        unit: Printed unit.
        meaning: Explanation of the metric in a few words.
        decimals: Number of printed decimals.
    """

    heading: str
    factor: float
    unit: str
    meaning: str
    decimals: int = 1

    def text(self, value: float | None) -> str:
        """Format a value of the metric without its unit; a dash if the value is None or NaN."""
        return "\u2013" if value is None or math.isnan(value) else f"{self.factor * value:.{self.decimals}f}"


#: How each metric of the tables is printed, by the name of the metric.
METRICS: Mapping[str, Metric] = {
    name: Metric(heading=heading, factor=factor, unit=unit, decimals=decimals, meaning=meaning)
    for name, heading, factor, unit, decimals, meaning in (
        ("misplaced_force", "misplaced force", 100, "%", 1, "share of the load on the wrong texel"),
        ("relative_l2", "relative L2", 100, "%", 1, "norm of the difference over the norm of the reference"),
        ("total_force_error", "total force", 100, "%", 2, "difference of the total texel forces over the load"),
        ("peak_error", "peak", 100, "%", 1, "difference of the largest texels over the reference's largest"),
        ("centre_of_pressure_m", "centre of pressure", 1e3, "mm", 3, "distance between the centres of pressure"),
        ("wasserstein_m", "Wasserstein-1", 1e3, "mm", 3, "mean distance that force would have to move"),
        ("image_changed_percent", "image changed", 1, "%", 2, "mean grey difference over 255, white = the case's peak"),
        ("image_changed_line_percent", "image changed, WTS line", 1, "%", 2, "the same after the published line"),
        ("pixels_changed", "pixels changed", 1, "", 0, "texels whose grey level differs"),
    )
}
