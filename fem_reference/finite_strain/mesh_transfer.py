"""Interpolate a solution from one tensor-product mesh to another, as initial guess for Newton's method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from fem_reference.elements.taylor_hood import MixedElements
from fem_reference.finite_strain.contact_problem import ContactEquilibrium, Guess
from meshes.array_types import FloatArray, IntArray

#: Number of decimal digits, relative to the largest coordinate, to which coordinates of nodes on one mesh line agree.
_DIGITS = 9
#: Loads of the equilibria between targets that serve as initial guesses, over the largest load [-].
_SHARES = (0.8, 0.6, 0.4, 0.2)


@dataclass(frozen=True, kw_only=True, eq=False)
class SolvedPath:
    """Equilibria of a loading path on one mesh.

    Attributes:
        elements: Elements of the mesh.
        equilibria: Equilibrium at every target load or depth.
        steps: Equilibria between the targets, ascending.
        coarse: The same loading path on a coarser mesh, whose steps serve below the first of `steps`.
    """

    elements: MixedElements
    equilibria: Sequence[ContactEquilibrium]
    steps: Sequence[ContactEquilibrium] = ()
    coarse: SolvedPath | None = None

    def transfer_guesses(self, target: MixedElements) -> list[Guess]:
        """Interpolate the equilibrium at every target, before augmentation, to another mesh as initial guesses."""
        return [self._transfer(each.penalty_solution, target) for each in self.equilibria]

    def transfer_steps(self, target: MixedElements, wanted: Sequence[float] | None = None) -> list[Guess]:
        """Interpolate a few of the equilibria between the targets to another mesh as initial guesses, descending.

        Args:
            target: Elements of the other mesh.
            wanted: Descending loads near which an equilibrium is wanted; None for shares of the largest load [N].
        """
        loads = np.array([each.load for each in self.steps])
        least = loads.min(initial=np.inf)
        wanted = [share * self.equilibria[-1].load for share in _SHARES] if wanted is None else wanted
        chosen = dict.fromkeys(int(np.argmin(np.abs(loads - load))) for load in wanted if load >= least)
        below = [load for load in wanted if load < least]
        coarse = self.coarse.transfer_steps(target, below) if self.coarse else []
        return [self._transfer(self.steps[index], target) for index in chosen] + coarse

    def _transfer(self, reached: ContactEquilibrium, target: MixedElements) -> Guess:
        return Guess(
            state=transfer_state(self.elements, target, reached.state),
            depth=reached.depth,
            load=reached.load,
            contact_pressure=float(reached.contact.pressure.max()),
        )


def transfer_state(source: MixedElements, target: MixedElements, state: FloatArray) -> FloatArray:
    """Interpolate displacements and pressures linearly to another tensor-product mesh of the same cover.

    Args:
        source: Elements that `state` belongs to.
        target: Elements of the other mesh.  At nodes outside the source mesh the nearest value is used.
        state: Displacements [m], then pressures [Pa], on the source mesh, shape (n,).

    Returns:
        Displacements [m], then pressures [Pa], on the target mesh, shape (m,).
    """
    d = source.dimension
    displacement = state[: source.displacements].reshape(-1, d)
    components = [_interpolate(source.nodes, displacement[:, i], target.nodes) for i in range(d)]
    here, there = locate_pressures(source), locate_pressures(target)
    pressure = np.empty(target.pressures)
    # Pressures jump between regions, so the pressure is interpolated in each region separately.
    for region in np.unique(target.region):
        mine, theirs = _find_pressures(source, region), _find_pressures(target, region)
        pressure[theirs] = _interpolate(here[mine], state[source.displacements + mine], there[theirs])
    return np.concatenate([np.stack(components, axis=1).ravel(), pressure])


def locate_pressures(elements: MixedElements) -> FloatArray:
    """Return the positions of the p pressure unknowns, shape (p, dimension) [m]."""
    mesh = elements.basis.mesh
    out = np.empty((elements.pressures, elements.dimension))
    out[elements.pressure_cells] = np.moveaxis(mesh.p[:, mesh.t], 0, -1).transpose(1, 0, 2)
    return out


def _interpolate(positions: FloatArray, values: FloatArray, wanted: FloatArray) -> FloatArray:
    """Interpolate values linearly on a tensor-product grid whose nodes are given in any order.

    Args:
        positions: Positions of the n nodes of the grid in d dimensions, shape (n, d) [m].
        values: Values at the nodes, shape (n,).
        wanted: m positions at which to interpolate, shape (m, d) [m].

    Returns:
        Interpolated values, shape (m,).
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
    """Return the indices of the pressure unknowns of one region."""
    return np.unique(elements.pressure_cells[elements.region == region])
