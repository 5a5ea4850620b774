"""Massless box geoms, from which the texels and plates of contact methods are made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from fastmodel.errors import LifeCycleError
from meshes.array_types import IntArray

#: Colour of plates and of boxes of active texels: red, green, blue, opacity [-].
_COLOUR = (0.25, 0.27, 0.3, 1.0)
#: Index of the highest usable collision bit [-]: MuJoCo's collision masks are signed 32-bit numbers.
_HIGHEST_BIT = 30


def check_box(height: float, contact_bit: int) -> None:
    """Check the height and the collision bit of a box geom.

    Args:
        height: Height of the box [m].
        contact_bit: Index of the collision bit of the box [-].

    Raises:
        ValueError: If the height is not positive or the bit not 0..30.
    """
    if not 0 < height < np.inf:
        raise ValueError(f"height must be positive, not {height} m")
    if not 0 <= contact_bit <= _HIGHEST_BIT:
        raise ValueError(f"contact_bit must lie in 0..{_HIGHEST_BIT}, not {contact_bit}")


def describe_box(half: Sequence[float], contact_bit: int) -> dict[str, Any]:
    """Return MuJoCo's attributes of a massless box geom, by name.

    The box collides with every geom whose contype has a bit other than the box's own collision bit.

    Args:
        half: Half edge lengths of the box, shape (3,) [m].
        contact_bit: Index of the box's own collision bit, 0..30 [-].
    """
    bit = 1 << contact_bit
    box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": half, "mass": 0.0, "rgba": _COLOUR}
    return {**box, "contype": bit, "conaffinity": 0x7FFFFFFF & ~bit}


def find_geoms(model: mujoco.MjModel, names: Sequence[str], sensor: str) -> IntArray:
    """Find the ids of n geoms in the compiled model, shape (n,).

    Args:
        model: The compiled model.
        names: Names of the n geoms.
        sensor: Name of the sensor, for the error message.

    Raises:
        LifeCycleError: If one of the geoms is not in the model.
    """
    ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) for name in names]
    if min(ids) < 0:
        raise LifeCycleError(
            f"geom {names[ids.index(-1)]!r} is not in this model; bind a model compiled from the spec "
            f"that sensor {sensor!r} was attached to"
        )
    return np.array(ids)
