"""Carry a solution from one tensor mesh to another, as a start for Newton's method on the finer one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import RegularGridInterpolator

from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.finite_strain.newton import Equilibrium, Guess, first_solved

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Coarse:
    """A path on a coarser mesh.

    Attributes:
        elements: Its elements.
        path: Its converged targets.
    """

    elements: MixedElements
    path: list[Equilibrium]

    def guesses(self, target: MixedElements) -> list[Guess]:
        """The targets, carried to a finer mesh."""
        path = map(first_solved, self.path)
        return [Guess(state=transferred(self.elements, target, e.state), depth=e.depth) for e in path]


def transferred(source: MixedElements, target: MixedElements, state: FloatArray) -> FloatArray:
    """Displacements and pressures of `state` at the unknowns of another tensor mesh of the same cover.

    Args:
        source: Elements that `state` belongs to.
        target: Elements to carry it to; where they reach beyond the source the nearest value is taken.
        state: Displacements, then pressures, shape (n,) [m], [Pa].

    Returns:
        Shape (m,) [m], [Pa].
    """
    d = source.dimension
    moved = state[: source.displacements].reshape(-1, d)
    columns = [_carried(source.nodes, moved[:, i], target.nodes) for i in range(d)]
    here, there = _pressure_places(source), _pressure_places(target)
    pressure = np.empty(target.pressures)
    for region in np.unique(target.region):
        mine, theirs = _of_region(source, region), _of_region(target, region)
        pressure[theirs] = _carried(here[mine], state[source.displacements + mine], there[theirs])
    return np.concatenate([np.stack(columns, axis=1).ravel(), pressure])


def _carried(places: FloatArray, values: FloatArray, wanted: FloatArray) -> FloatArray:
    """Linear interpolation on the tensor grid that the scattered `places` form."""
    digits = 9 - int(np.ceil(np.log10(np.abs(places).max())))
    lines, index = [], []
    for axis in range(places.shape[1]):
        line, inverse = np.unique(np.round(places[:, axis], digits), return_inverse=True)
        lines.append(line)
        index.append(inverse)
    table = np.empty([len(line) for line in lines])
    table[tuple(index)] = values
    inside = np.stack([np.clip(wanted[:, i], line[0], line[-1]) for i, line in enumerate(lines)], axis=1)
    return np.asarray(RegularGridInterpolator(lines, table)(inside))


def _pressure_places(elements: MixedElements) -> FloatArray:
    """Where each pressure unknown stands, shape (p, dimension) [m]."""
    mesh = elements.basis.mesh
    out = np.empty((elements.pressures, elements.dimension))
    out[elements.pressure_cells] = np.moveaxis(mesh.p[:, mesh.t], 0, -1).transpose(1, 0, 2)
    return out


def _of_region(elements: MixedElements, region: int) -> npt.NDArray[np.int64]:
    return np.unique(elements.pressure_cells[elements.region == region])
