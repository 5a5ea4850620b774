"""Equations of the models that use the penetration of the rigid indenter."""

import numpy as np

from tests.validation.published.equations.table import COLUMNS, ROWS, area, equation, gaussian, near, sink, spread


@equation("robworksim-later")
def robwork_code(scene, modulus, mask):
    gaps, misses = scene.texel_gaps - scene.texel_gaps.min(), []
    for step in range(1, 20):
        depth = np.clip(step * 0.05e-3 - gaps, 0, None)
        touched = (depth > 0).sum() * area(scene)
        misses.append((abs(scene.load / touched - modulus * depth.sum() * area(scene) / (2e-3 * touched)), depth))
        if len(misses) > 1 and misses[-1][0] > misses[-2][0]:
            misses.pop()
            break
    force = misses[-1][1] / misses[-1][1].sum() * scene.load
    # one texel of the mask is a third of its width: 5 of 15 samples
    samples = [4 * (k / 15 - 0.5) / mask for k in range(15)]
    value = [[max(1.224299065420561 / (1 + x * x + y * y) - 0.3476635514018692, 0) for x in samples] for y in samples]
    blocks = np.array(value).reshape(3, 5, 3, 5).sum(axis=(1, 3))
    blocks /= blocks.sum()
    out = spread(force, lambda x, y: blocks[y + 1, x + 1] if max(abs(x), abs(y)) <= 1 else 0.0)
    out = np.minimum(out, 250e3 * area(scene))
    return out * scene.load / out.sum()


def on_texels(scene, forces):
    out, (wide, high) = np.zeros(scene.array.count), scene.array.pitch
    for (x, y), force in zip(scene.map.points, forces, strict=True):
        column, row = int(np.floor(x / wide + COLUMNS / 2)), int(np.floor(y / high + ROWS / 2))
        if 0 <= column < COLUMNS and 0 <= row < ROWS:
            out[row * COLUMNS + column] += force
    return out


@equation("opengrasp-2013", stiffness=2e9)
def opengrasp(scene, stiffness):
    return on_texels(scene, sink(scene.map.gaps, 2.0, lambda d: stiffness * scene.map.area * d))


@equation("skinsim-2014", conserves=False, stiffness=3e3, amplitude=0.159, sigma=2e-3)
def skinsim(scene, stiffness, amplitude, sigma):
    wide, high = scene.array.pitch
    springs = sink(scene.texel_gaps, 2.0, lambda d: stiffness * d)
    return spread(springs, near(lambda x, y: amplitude * np.exp(-((x * wide) ** 2 + (y * high) ** 2) / (2 * sigma**2))))


@equation("genesis-taxel", stiffness=4e3, exponent=1.2, crosstalk=0.3, sigma=0.4)
def genesis(scene, stiffness, exponent, crosstalk, sigma):
    taxels = sink(scene.texel_gaps, 2.0, lambda d: stiffness * d**exponent)
    return (1 - crosstalk) * taxels + crosstalk * spread(taxels, gaussian(sigma, 3, 3))


@equation("penalty")
def penalty(scene, stiffness):
    return sink(scene.texel_gaps, 2.0, lambda d: stiffness * d)


@equation("mujoco-tactile", depth_factor=1.7)
def mujoco_tactile(scene, depth_factor):
    depth = np.clip(depth_factor * 0.3e-3 - scene.texel_gaps, 0, None)
    return 2.0 * depth / depth.sum()
