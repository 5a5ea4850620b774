"""Press a body of revolution into a relaxing layer by ring elements, step by step in time, without friction.

The contact is searched anew at every instant, so that neither growth nor shrinkage of the contact is assumed.  With the
downward displacements u and pressures p of the rings, V u = sum_j l_j(V) x_j C_j p.  V is the integral
y -> int g(t - s) dy(s) on values that are linear between the instants, C_j the elastic compliance with the shear
modulus x_j G(0), and l_j the polynomial of Lagrange through the x_j.  With a constant Poisson ratio x_0 = 1 alone is
enough.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from meshes import Cover, Indenter
from meshes.array_types import FloatArray
from tests.exact.rings import _assemble, _average


def integral_of(g, times: FloatArray) -> FloatArray:
    """Return V, shape (n, n), by Gauss integration of g [-] over the intervals between the instants [s]."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    starts = np.append(0.0, times[:-1])
    s = starts[:, None] + (times - starts)[:, None] * (1 + nodes) / 2
    means = np.array([(g(np.maximum(t - s, 0.0)) * weights / 2).sum(axis=1) for t in times])
    return np.tril(means) @ (np.eye(len(times)) - np.eye(len(times), k=-1))


def press_rings(
    covers: Mapping[float, Cover],
    indenter: Indenter,
    g,
    *,
    times: Sequence[float],
    depths: FloatArray,
    radius: float,
    rings: int = 60,
) -> FloatArray:
    """Return the force at each instant under given depths, shape (n,) [N].

    Args:
        covers: Elastic covers by their factor on the shear modulus.
        indenter: Body of revolution.
        g: Relaxation function of an array of times [s].
        times: Ascending instants from 0 [s].
        depths: Depth at each instant [m].
        radius: Radius within which contact is searched [m].
        rings: Number of rings [-].
    """
    edges = np.linspace(0, radius, rings + 1)
    gap, areas = _average(edges, indenter), np.pi * np.diff(edges**2)
    scaled = [x * _assemble(cover, edges)[0] for x, cover in covers.items()]
    volterra, levels = integral_of(g, np.array(times)), list(covers)
    eye = np.eye(len(times))
    parts = []
    for x in levels:
        part = eye
        for other in levels:
            if other != x:
                part = part @ (volterra - other * eye) / (x - other)
        parts.append(part if len(levels) > 1 else eye)
    u, p = (np.zeros((len(times), rings)) for _ in range(2))
    touching = gap < depths.max()
    for n, depth in enumerate(depths):
        stiff, now = volterra[n, n], sum(part[n, n] * each for part, each in zip(parts, scaled, strict=True))
        past = volterra[n, :n] @ u[:n]
        past = past - sum(each @ (part[n, :n] @ p[:n]) for part, each in zip(parts, scaled, strict=True))
        touching = depth > gap if n == 0 else touching
        for _ in range(200):
            p[n] = 0.0
            wanted = stiff * (depth - gap) + past
            p[n, touching] = np.linalg.solve(now[np.ix_(touching, touching)], wanted[touching])
            u[n] = (now @ p[n] - past) / stiff
            changed = np.where(touching, p[n] > 0, u[n] < depth - gap - 1e-12)
            if (changed == touching).all():
                break
            touching = changed
        else:
            raise AssertionError("the contact of the rings was not found")
    return p @ areas
