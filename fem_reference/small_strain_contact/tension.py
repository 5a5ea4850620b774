"""The tensile part of contact forces, which the solvers without slip share."""

from __future__ import annotations

import numpy as np

from meshes.array_types import FloatArray

#: Distance from the outline of a face, over the smaller of its half width and the cover thickness, within which
#: tensile forces count as discretisation error of the singular stress at the edge [-].
_AT_EDGE = 0.1


def measure_tension(forces: FloatArray, inside: FloatArray, size: float) -> float:
    """Compute the tensile part of nodal contact forces away from the edge of a face, over the whole force [-].

    A face under which it is not near zero would separate from the cover.

    Args:
        forces: Normal contact forces on the cover at n nodes, positive in compression, shape (n,) [N].
        inside: Distance of each node from the outline of the face, shape (n,) [m].
        size: Smaller of the face's half width and the cover thickness [m].
    """
    away = inside > _AT_EDGE * size
    return float(-np.minimum(forces[away], 0.0).sum() / forces.sum())
