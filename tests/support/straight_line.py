"""A fitted model whose counts are a straight line in the texel forces."""

from __future__ import annotations

import dataclasses

from validation.calibration.forward_fit import compute_forces
from validation.calibration.model import ContactMethod


@dataclasses.dataclass(frozen=True)
class StraightLine:
    """Counts are `slope` [1/N] times the texel forces of `method`; `poses` are the poses of images by their name."""

    method: ContactMethod
    slope: float
    poses: dict = dataclasses.field(default_factory=dict)

    def predict(self, observed):
        return self.slope * compute_forces(self.method, observed, self.poses)
