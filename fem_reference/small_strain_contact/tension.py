"""Properties of covers and contacts that the solvers without slip share."""

from __future__ import annotations

import numpy as np

from meshes import Cover
from meshes.array_types import FloatArray

#: Distance from the outline of a face, over the smaller of its half width and the cover thickness, within which
#: tensile forces count as discretisation error of the singular stress at the edge [-].
_AT_EDGE = 0.1


def membrane_length(cover: Cover) -> float:
    """Estimate the distance over which the response of a cover to shear tractions decays [m].

    For each interface, the layers above are modelled as a membrane of stiffness sum E t / (1 - nu^2) and the layers
    below as a shear foundation of stiffness 1 / sum (t / mu); the length is the root of the ratio.
    """
    lengths = [cover.thickness]
    for split in range(1, len(cover.layers)):
        below, above = cover.layers[:split], cover.layers[split:]
        shear = sum(layer.thickness / layer.material.shear_modulus for layer in below)
        plane = sum(
            layer.thickness * layer.material.youngs_modulus / (1 - layer.material.poisson_ratio**2) for layer in above
        )
        lengths.append(float(np.sqrt(plane * shear)))
    return max(lengths)


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
