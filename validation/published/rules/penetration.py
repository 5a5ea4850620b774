"""Models that compute the forces from the depth to which a rigid indenter penetrates the array."""

from __future__ import annotations

import numpy as np

from fastmodel import Gaussian
from meshes.array_types import FloatArray
from validation.published.in_time import oscillator, recursion, relaxation
from validation.published.model import CODE, PENETRATION, SUMMARY, Parameter, published
from validation.published.scene import Forces, Scene, bin_on_texels, convolve, scale_to_load, sink, sink_springs

#: Step of RobWorkSim's search for the depth of the indenter [m].
_ROBWORK_STEP = 0.05e-3
#: Number of steps after which RobWorkSim's search ends [-].
_ROBWORK_STEPS = 20
#: Thickness of the cover in RobWorkSim [m].
_ROBWORK_THICKNESS = 2e-3
#: Largest pressure on a texel in RobWorkSim [Pa].
_ROBWORK_PRESSURE = 250e3


@published(
    "robworksim-later",
    title="RobWorkSim, later code",
    contact=PENETRATION,
    rule="one offset by mean pressure, load shared by depth, mask of 3 x 3 texels",
    certainty=CODE,
    total="scaled to the load; the code divides by the number of loaded texels once more",
    in_time="alpha = dt / (tau + dt), tau = 0.1 s; overwritten in the version that was read",
    terms={"tau 0.1 s, dt 1 ms": recursion(1e-3 / (0.1 + 1e-3), 1e-3)},
    modulus=Parameter(shipped=700e3, unit="Pa", fitted=True),
    mask=Parameter(shipped=1.0, fitted=True),
)
def predict_robwork(scene: Scene, *, modulus: float, mask: float) -> Forces:
    """RobWorkSim, later code: share the load in proportion to depth, and spread the shares by a mask of 3 x 3 texels.

    The depth of the indenter is searched in steps.  At this depth the mean pressure is nearest to the modulus times
    the mean strain of a cover of 2 mm.  Texel forces are cut off at the largest pressure, and scaled to the load.

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
        depth = np.maximum(step * _ROBWORK_STEP - gaps, 0.0)
        touched = area * np.count_nonzero(depth)
        miss = abs(scene.load / touched - modulus * depth.sum() * area / (_ROBWORK_THICKNESS * touched))
        if miss > least:
            break
        best, least = depth, miss
    spread = convolve(scene.array, best * scene.load / best.sum(), robwork_mask(mask))
    clipped = np.minimum(spread, _ROBWORK_PRESSURE * area)
    return scale_to_load(clipped, scene.load)


def robwork_mask(width: float) -> FloatArray:
    """Compute RobWorkSim's mask: weights of 3 x 3 texels with unit sum, shape (3, 3) [-].

    The weight at the distance r is max(0, 1.224 / (1 + r^2) - 0.348), with r in units of 3/4 pitches.  It is sampled at
    5 x 5 points per texel, which lie half a step off the texel's middle as in RobWorkSim's code.

    Args:
        width: Factor on the distances [-].
    """
    at = 4 * (np.arange(15) / 15 - 0.5) / width
    weights = np.maximum(1.224299065420561 / (1 + at[:, None] ** 2 + at**2) - 0.3476635514018692, 0.0)
    if not weights.any():  # The mask is narrower than the distance of the samples, so that no sample lies in it.
        return np.pad([[1.0]], 1)
    blocks = weights.reshape(3, 5, 3, 5).sum(axis=(1, 3))
    return np.asarray(blocks / blocks.sum())


@published(
    "opengrasp-2013",
    title="OpenGrasp (Moisio 2013)",
    contact=PENETRATION,
    rule="elastic foundation k d A on fine cells",
    certainty=SUMMARY,
    in_time="damper c; friction with sigma_0, sigma_1, mu_s, mu_d, along the surface; no values are known to us",
    stiffness=Parameter(unit="Pa/m", fitted=True),
)
def predict_foundation(scene: Scene, *, stiffness: float) -> Forces:
    """OpenGrasp (Moisio 2013): sum the forces f = k d A of an elastic foundation's fine cells over each texel.

    d is the depth of a cell inside the indenter, and A is the area of a cell.

    Args:
        scene: The press.
        stiffness: Pressure per depth k [Pa/m].
    """
    points, gaps, area = scene.map
    depth = sink_springs(gaps, stiffness * area, scene.load)
    texels = bin_on_texels(scene.array, points, stiffness * area * depth)
    return Forces(texels, scene.load - float(texels.sum()))


@published(
    "skinsim-2014",
    title="SkinSim 2014",
    contact=PENETRATION,
    rule="one spring per texel, Gaussian of 3 x 3 texels",
    certainty=SUMMARY,
    total="amplitude times the sum of the kernel",
    in_time="damper 0.130 N s/m, mass 1 g; that the spring is read is our assumption",
    terms={"spring 16.37 N/m, damper 0.130 N s/m, mass 1 g": oscillator(16.37, 0.130, 1e-3)},
    stiffness=Parameter(shipped=16.37, unit="N/m", fitted=True),
    amplitude=Parameter(shipped=0.159, fitted=True),
    sigma=Parameter(shipped=10e-3, unit="m", fitted=True),
)
def predict_springs(scene: Scene, *, stiffness: float, amplitude: float, sigma: float) -> Forces:
    """SkinSim 2014: press one spring per texel, and convolve the spring forces with a Gaussian of 3 x 3 texels.

    The weight of a texel at the distance d is `amplitude` exp(-d^2 / (2 sigma^2)).  The sum of the weights is not one.

    Args:
        scene: The press.
        stiffness: Stiffness of a spring [N/m].
        amplitude: Weight at the distance zero [-].
        sigma: Standard deviation [m].
    """
    springs, outside = _compress(scene, stiffness)
    x, y = np.meshgrid(*(step * np.array([-1, 0, 1]) for step in scene.array.pitch))
    kernel = amplitude * np.exp(-(x**2 + y**2) / (2 * sigma**2))
    texels = convolve(scene.array, springs, kernel)
    return Forces(texels, float(outside + springs.sum() * kernel.sum() - texels.sum()))


@published(
    "genesis-taxel",
    title="Genesis KinematicTaxel",
    contact=PENETRATION,
    rule="k d^e at each texel's centre, crosstalk by a Gaussian",
    certainty=CODE,
    in_time="damping f (1 + c v / k), the same for all taxels and without effect under a given load; hysteresis; "
    "gain 0.85..1.15, dead taxels 5 %, noise 0.005 N",
    terms={"no hysteresis": relaxation(0.0, 0.1), "hysteresis 0.5, 0.1 s": relaxation(0.5, 0.1)},
    stiffness=Parameter(shipped=1000.0, unit="N/m^e", fitted=True),
    exponent=Parameter(shipped=1.0),
    crosstalk=Parameter(shipped=0.0, start=0.3, fitted=True),
    sigma=Parameter(shipped=0.5, unit="pitches", fitted=True),
)
def predict_taxels(scene: Scene, *, stiffness: float, exponent: float, crosstalk: float, sigma: float) -> Forces:
    """Genesis KinematicTaxel: compute f = k d^e from the depth d of each texel's centre, then mix f with its Gaussian.

    The forces are (1 - a) f + a G f, where G is the convolution with a Gaussian of unit sum.

    Args:
        scene: The press.
        stiffness: Stiffness k of a texel [N/m^e].
        exponent: Exponent e of the depth [-].
        crosstalk: Weight a of the Gaussian part [-].
        sigma: Standard deviation of the Gaussian [pitches].
    """
    texels, outside = _compress(scene, stiffness, exponent)
    if crosstalk:
        spread = Gaussian.from_sigma(sigma).operator(scene.array) @ texels
        lost = float(texels.sum() - spread.sum())
        texels = (1 - crosstalk) * texels + crosstalk * spread
        outside += crosstalk * lost
    return Forces(texels, outside)


@published(
    "penalty",
    title="TacSL, FlexiTac",
    contact=PENETRATION,
    rule="penalty k_n d on a distance field, one point per texel",
    certainty=SUMMARY,
    stiffness=Parameter(shipped=5000.0, unit="N/m", fitted=True),
)
def predict_penalty(scene: Scene, *, stiffness: float) -> Forces:
    """TacSL and FlexiTac: compute the penalty f = k_n d from the depth d of one point per texel.

    Args:
        scene: The press.
        stiffness: Stiffness k_n of a texel [N/m].
    """
    return Forces(*_compress(scene, stiffness))


@published(
    "mujoco-tactile",
    title="MuJoCo tactile sensor",
    contact=PENETRATION,
    rule="rigid penetration at each texel's centre",
    certainty="checked against the sensor of MuJoCo 4.0",
    total="scaled to the load",
    depth_factor=Parameter(shipped=1.0, fitted=True),
)
def predict_mujoco_tactile(scene: Scene, *, depth_factor: float) -> Forces:
    """MuJoCo's tactile sensor: scale the penetration of each texel's centre so that the sum is the load.

    Args:
        scene: The press.
        depth_factor: Factor on the largest rigid penetration in MuJoCo; 1 as in MuJoCo's sensor [-].
    """
    depth = np.maximum(depth_factor * scene.contacts.depths.max() - scene.texel_gaps, 0.0)
    return scale_to_load(depth, scene.load)


def _compress(scene: Scene, stiffness: float, exponent: float = 1.0) -> tuple[FloatArray, float]:
    """Compute the forces k d^e at the texels' centres that together carry the load.

    Args:
        scene: The press.
        stiffness: Stiffness k of a texel [N/m^e].
        exponent: Exponent e of the depth [-].

    Returns:
        Force on each texel, shape (n,) [N], and the force outside all texels [N].  The force outside is the load if no
        centre is under the indenter, and zero otherwise.
    """
    if exponent == 1:
        depth = sink_springs(scene.texel_gaps, stiffness, scene.load)
    else:
        depth = sink(scene.texel_gaps, lambda depth: stiffness * depth**exponent, scene.load)
    texels = stiffness * depth**exponent
    return texels, 0.0 if texels.any() else scene.load
