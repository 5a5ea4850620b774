"""Transfer of a solution from one tensor mesh to another, where Newton's method starts from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.finite_strain.contact_problem import ContactEquilibrium, Guess
from meshes.array_types import FloatArray, IntArray

#: Decimal digits, relative to the largest coordinate, to which positions on one mesh line agree.
_DIGITS = 9


@dataclass(frozen=True, kw_only=True, eq=False)
class SolvedPath:
    """The equilibria of a loading path on one mesh.

    Attributes:
        elements: The mesh.
        equilibria: The equilibrium at every target.
    """

    elements: MixedElements
    equilibria: Sequence[ContactEquilibrium]

    def transfer_guesses(self, target: MixedElements) -> list[Guess]:
        """Return a guess for every target on another mesh, from the solutions before augmentation."""
        path = [each.penalty_solution for each in self.equilibria]
        return [Guess(state=transfer_state(self.elements, target, each.state), depth=each.depth) for each in path]


def transfer_state(source: MixedElements, target: MixedElements, state: FloatArray) -> FloatArray:
    """Interpolate displacements and pressures linearly at the unknowns of another tensor mesh of the same cover.

    Args:
        source: Elements that `state` belongs to.
        target: Elements to interpolate at.  Outside the source mesh the nearest value is used.
        state: Displacements [m], then pressures [Pa], shape (n,).

    Returns:
        Displacements [m], then pressures [Pa], on the target mesh, shape (m,).
    """
    d = source.dimension
    displacement = state[: source.displacements].reshape(-1, d)
    components = [_interpolate(source.nodes, displacement[:, i], target.nodes) for i in range(d)]
    here, there = locate_pressures(source), locate_pressures(target)
    pressure = np.empty(target.pressures)
    # Pressures jump between regions, so each region is interpolated by itself.
    for region in np.unique(target.region):
        mine, theirs = _find_pressures(source, region), _find_pressures(target, region)
        pressure[theirs] = _interpolate(here[mine], state[source.displacements + mine], there[theirs])
    return np.concatenate([np.stack(components, axis=1).ravel(), pressure])


def locate_pressures(elements: MixedElements) -> FloatArray:
    """Return the position of each pressure unknown, shape (p, dimension) [m]."""
    mesh = elements.basis.mesh
    out = np.empty((elements.pressures, elements.dimension))
    out[elements.pressure_cells] = np.moveaxis(mesh.p[:, mesh.t], 0, -1).transpose(1, 0, 2)
    return out


def _interpolate(positions: FloatArray, values: FloatArray, wanted: FloatArray) -> FloatArray:
    """Interpolate values linearly on the tensor grid that scattered positions form.

    Args:
        positions: All nodes of the grid in any order, shape (n, d) [m].
        values: Their values, shape (n,).
        wanted: Positions to interpolate at, shape (m, d) [m].

    Returns:
        Shape (m,).
    """
    digits = _DIGITS - int(np.ceil(np.log10(np.abs(positions).max())))
    lines, index = [], []
    for axis in range(positions.shape[1]):
        line, inverse = np.unique(np.round(positions[:, axis], digits), return_inverse=True)
        lines.append(line)
        index.append(inverse)
    table = np.empty([len(line) for line in lines])
    table[tuple(index)] = values
    inside = np.stack([np.clip(wanted[:, i], line[0], line[-1]) for i, line in enumerate(lines)], axis=1)
    return np.asarray(RegularGridInterpolator(lines, table)(inside))


def _find_pressures(elements: MixedElements, region: int) -> IntArray:
    """Return the pressure unknowns of one region."""
    return np.unique(elements.pressure_cells[elements.region == region])
