"""Models of springs or penalties that a rigid indenter compresses; it sinks until they carry the load.

Penetration is measured along the normal of the array.  A damper or a filter in time has no effect under a held load.
Equations and sources: docs/comparison-models.md.
"""

from __future__ import annotations

import numpy as np

from fastmodel import Gaussian
from meshes.array_types import FloatArray
from validation.published.contact_points import convolve
from validation.published.scene import Forces, Scene, bin_on_texels, find_approach, find_foundation_approach

#: RobWorkSim: step and number of steps of the search for the offset, thickness of the cover and largest pressure.
_ROBWORK_STEP, _ROBWORK_STEPS, _ROBWORK_THICKNESS, _ROBWORK_PRESSURE = 0.05e-3, 20, 2e-3, 250e3


def predict_foundation(scene: Scene, *, stiffness: float) -> Forces:
    """OpenGrasp (Moisio 2013): f = k d A per cell, on the cells of a fine grid, summed over each texel; no spread.

    Args:
        scene: The press.
        stiffness: k, pressure per depth [Pa/m].
    """
    points, gaps, area = scene.map
    depth = _sink(find_foundation_approach(gaps, stiffness * area, scene.load), gaps)
    texels = bin_on_texels(scene.array, points, stiffness * area * depth)
    return Forces(texels, scene.load - float(texels.sum()))


def predict_springs(scene: Scene, *, stiffness: float, amplitude: float, sigma: float) -> Forces:
    """SkinSim 2014: one spring per texel, and a Gaussian of 3 x 3 elements whose sum is not one.

    The weight of a neighbour at the distance d is `amplitude` exp(-d^2 / (2 sigma^2)).

    Args:
        scene: The press.
        stiffness: Stiffness of a spring [N/m].
        amplitude: Weight of the element itself [-].
        sigma: Standard deviation [m].
    """
    springs, outside = _compress(scene, stiffness)
    x, y = np.meshgrid(*(step * np.array([-1, 0, 1]) for step in scene.array.pitch))
    kernel = amplitude * np.exp(-(x**2 + y**2) / (2 * sigma**2))
    texels = convolve(scene, springs, kernel)
    return Forces(texels, float(outside + springs.sum() * kernel.sum() - texels.sum()))


def predict_taxels(scene: Scene, *, stiffness: float, exponent: float, crosstalk: float, sigma: float) -> Forces:
    """Genesis KinematicTaxel: f = k d^e at each texel's centre, then (1 - a) f + a (Gaussian of f).

    Args:
        scene: The press.
        stiffness: k [N/m^e].
        exponent: e [-].
        crosstalk: a [-].
        sigma: Standard deviation of the Gaussian, which has a unit sum [pitches].
    """
    texels, outside = _compress(scene, stiffness, exponent)
    if crosstalk:
        spread = Gaussian.from_sigma(sigma).operator(scene.array) @ texels
        lost = float(texels.sum() - spread.sum())
        texels = (1 - crosstalk) * texels + crosstalk * spread
        outside += crosstalk * lost
    return Forces(texels, outside)


def predict_penalty(scene: Scene, *, stiffness: float) -> Forces:
    """Penalty on a distance field (TacSL, FlexiTac): f = k_n d at one point per texel; no spread.

    Args:
        scene: The press.
        stiffness: k_n [N/m].
    """
    return Forces(*_compress(scene, stiffness))


def predict_mujoco_tactile(scene: Scene, *, depth_factor: float) -> Forces:
    """MuJoCo's tactile sensor: the penetration depth d at each texel's centre, scaled to the load.

    Args:
        scene: The press.
        depth_factor: Factor on the largest rigid penetration in MuJoCo; 1 for the sensor as it is [-].
    """
    depth = _sink(depth_factor * float(scene.contacts.depths.max()), scene.texel_gaps)
    total = depth.sum()
    return Forces(depth * scene.load / total, 0.0) if total > 0 else Forces(depth, scene.load)


def predict_robwork(scene: Scene, *, modulus: float, mask: float) -> Forces:
    """RobWorkSim, later code: springs in shares of the load, spread by a mask of 3 x 3 texels, scaled to the load.

    One offset between indenter and array is searched in steps, for which the mean pressure equals the modulus times the
    mean strain of a cover of 2 mm.  The texels then share the load by depth.

    Args:
        scene: The press.
        modulus: Modulus of the cover [Pa].
        mask: Factor on the width of the mask; 1 as published [-].
    """
    lowest = scene.texel_gaps.min()
    if not np.isfinite(lowest):
        return Forces(np.zeros(scene.array.count), scene.load)
    area, gaps = float(np.prod(scene.array.pitch)), scene.texel_gaps - lowest
    best, least = np.zeros(scene.array.count), np.inf
    for step in range(1, _ROBWORK_STEPS):
        depth = _sink(step * _ROBWORK_STEP, gaps)
        touched = area * np.count_nonzero(depth)
        miss = abs(scene.load / touched - modulus * depth.sum() * area / (_ROBWORK_THICKNESS * touched))
        if miss > least:
            break
        best, least = depth, miss
    spread = convolve(scene, best * scene.load / best.sum(), robwork_mask(mask))
    clipped = np.minimum(spread, _ROBWORK_PRESSURE * area)
    return Forces(clipped * scene.load / clipped.sum(), 0.0)


def robwork_mask(width: float) -> FloatArray:
    """Compute RobWorkSim's mask, weights of 3 x 3 texels with unit sum.

    The weight at the distance r is max(0, 1.224 / (1 + r^2) - 0.348), r in units of 3/4 pitches; it is sampled at 5 x 5
    points per texel, half a step off the middle.

    Args:
        width: Factor on the distances [-].
    """
    at = 4 * (np.arange(15) / 15 - 0.5) / width
    weights = np.maximum(1.224299065420561 / (1 + at[:, None] ** 2 + at**2) - 0.3476635514018692, 0.0)
    if not weights.any():  # narrower than its samples
        return np.pad([[1.0]], 1)
    blocks = weights.reshape(3, 5, 3, 5).sum(axis=(1, 3))
    return np.asarray(blocks / blocks.sum())


def _compress(scene: Scene, stiffness: float, exponent: float = 1.0) -> tuple[FloatArray, float]:
    """Compute forces k d^e at the texels' centres that carry the load, and the load if no centre is under the indenter.

    Args:
        scene: The press.
        stiffness: k [N/m^e].
        exponent: e [-].
    """
    gaps = scene.texel_gaps
    if exponent == 1:
        approach = find_foundation_approach(gaps, stiffness, scene.load)
    else:
        approach = find_approach(gaps, lambda depth: stiffness * depth**exponent, scene.load)
    texels = stiffness * _sink(approach, gaps) ** exponent
    return texels, 0.0 if texels.any() else scene.load


def _sink(approach: float, gaps: FloatArray) -> FloatArray:
    """Compute the penetration at points for an approach from first touch, zero if the approach is NaN [m]."""
    return np.zeros_like(gaps) if np.isnan(approach) else np.maximum(approach - gaps, 0.0)
