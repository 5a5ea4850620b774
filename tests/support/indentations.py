"""Results of presses, for tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from fem_reference import Indentation
from meshes.array_types import FloatArray


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
