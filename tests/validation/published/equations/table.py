"""The table of the equations, and what several equations share: the texels of the small press, images and kernels."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

ROWS, COLUMNS = 4, 3
EQUATIONS = {}


class Case(NamedTuple):
    equation: object
    values: dict
    conserves: bool


def equation(name, *, conserves=True, **values):
    """Enter a function as the equation of a model, with values of its parameters; without values, those as shipped."""

    def enter(function):
        EQUATIONS[name] = Case(function, values, conserves)
        return function

    return enter


def place(scene, index):
    row, column = divmod(index, COLUMNS)
    return np.array([(column - 1) * scene.array.pitch[0], (row - 1.5) * scene.array.pitch[1]])


def area(scene):
    return scene.array.pitch[0] * scene.array.pitch[1]


def integrate_texels(scene, points, pressure, count=24):
    """Integrate pressures around points over each texel, which may be smaller than a pitch, by the midpoint rule."""
    wide, high = scene.array.texel_size
    steps = (np.arange(count) + 0.5) / count - 0.5
    x, y = (each.ravel() for each in np.meshgrid(wide * steps, high * steps))
    out = np.zeros((scene.array.count, len(points)))
    for i in range(len(out)):
        away = place(scene, i) - points
        out[i] = pressure(np.hypot(x + away[:, :1], y + away[:, 1:])).mean(axis=1) * wide * high
    return out


def spread(forces, weight):
    """Sum weight(steps along x, steps along y) times force, texel by texel."""
    out = np.zeros(ROWS * COLUMNS)
    for i in range(out.size):
        for j in range(out.size):
            out[i] += weight(i % COLUMNS - j % COLUMNS, i // COLUMNS - j // COLUMNS) * forces[j]
    return out


def gaussian(sigma, ksize_x, ksize_y):
    def one(step, ksize):
        values = {k: np.exp(-(k**2) / (2 * sigma**2)) for k in range(-(ksize // 2), ksize // 2 + 1)}
        return values.get(step, 0.0) / sum(values.values())

    return lambda x, y: one(x, int(ksize_x)) * one(y, int(ksize_y))


def near(value):
    return lambda x, y: value(x, y) if max(abs(x), abs(y)) <= 1 else 0.0


def sink(gaps, load, law):
    """Forces of points under an indenter that carry the load."""
    depth = brentq(lambda d: law(np.clip(d - gaps, 0, None)).sum() - load, 0, 1)
    return law(np.clip(depth - gaps, 0, None))
