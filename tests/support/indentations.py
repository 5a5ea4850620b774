"""Results of presses, for tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem_reference import Indentation
from fem_reference.indentation.grid_solution import Base
from meshes import TexelArray
from meshes.array_types import FloatArray
from meshes.pose import Place, Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class FixedBase(Base):
    """Forces that are the same for all arrays and poses, with the error that `error` gives."""

    values: FloatArray
    error: Callable[[Place, int, float], float] = lambda _place, _texel, _share: 0.0

    def forces(self, _array: TexelArray, _pose: Pose) -> FloatArray:
        """Return the forces."""
        return self.values

    def estimate_error(self, place: Place, texel: int, share: float) -> float:
        """Return the error."""
        return self.error(place, texel, share)


def column_contact(found: Indentation) -> FloatArray:
    """Return columns x, y [m] and normal force [N] of the contact points, shape (m, 3)."""
    return np.column_stack([found.contact_points[:, :2], -found.contact_forces[:, 2]])


def make_indentation(texel_forces: FloatArray, **changes: Any) -> Indentation:
    """Return the result of a press with these texel forces, whose other values are zero or as given."""
    load = float(np.sum(texel_forces))
    values: dict[str, Any] = {
        "texel_forces": texel_forces,
        "total_force": load,
        "force": np.array([0.0, 0.0, -load]),
        "moment": np.zeros(3),
        "base_force": np.array([0.0, 0.0, -load]),
        "unmeasured": np.zeros(3),
        "balance": 0.0,
        "depth": 0.3e-3,
        "contact_area": 8e-6,
        "contact_points": np.zeros((0, 3)),
        "contact_forces": np.zeros((0, 3)),
        "energy": 1e-4,
        "error_estimate": {},
        "assumptions": {},
        "warnings": (),
    }
    return Indentation(**(values | changes))
