"""The contact problem of many worlds, solved by a fixed number of steps on arrays of numpy, JAX or PyTorch.

`fastmodel.pressure.array_functions` describes the method and makes the problem from gap images and loads.  All
quantities are forces: displacements are divided by the compliance of one cell of the cover under a force on itself.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

from fastmodel.pressure.solvers import TILT
from fastmodel.signal.array_namespace import Array, cast, find_namespace

#: Gap of a cell without body.
_AWAY = float("inf")
#: Newton steps for the motion of a body on the elastic foundation: for its depth, and for its depth and tilts [-].
_NEWTON = {1: 12, 3: 20}
#: Residual over that of the first step, in units of the rounding error, up to which a world has converged [-].
_NOISE = 64


class Problem(NamedTuple):
    """A contact problem with N cells and k conditions in every world.

    Unknown are the forces on N cells, which are not negative, and k slacks, by which the conditions may be missed.
    Vectors of unknowns have the shape (worlds, N + k), vectors of conditions (worlds, k).

    Attributes:
        basis: Columns B of the conditions B' unknowns = target, which are also the rigid motions of a body, shape
            (N + k, k), or (worlds, N + k, k) if they differ between worlds [-].
        products: Products of all pairs of columns of the basis, shape (..., N + k, k * k) [-].
        stiffness: Stiffness of the foundation under each cell, and of the slacks, shape (..., N + k) [-].
        always: 1 for slacks, which take part in every step, 0 for cells and for the slack of the first condition, on
            the force, which is not missed, shape (N + k,) [-].
        tiny: Small diagonal matrix, which keeps a system of equations regular in a world without contact, (k, k) [-].
        shape: Rows and columns of the contact grid.
        padded: Rows and columns of the grid padded for the Fourier transform.
        spectrum: Fourier transform of the compliance; None for the elastic foundation [-].
        split: Shares of the force on a partly covered cell that act on whole cells, by their offsets in rows and
            columns, each of shape (worlds, rows, columns) [-]; empty if all cells are whole.
        own: Additional compliance of a partly covered cell under its own force, shape (worlds, N) [-].
    """

    basis: Array
    products: Array
    stiffness: Array
    always: Array
    tiny: Array
    shape: tuple[int, int]
    padded: tuple[int, int]
    spectrum: Array | None
    split: dict[tuple[int, int], Array]
    own: Array | None

    def place(self, forces: Array) -> Array:
        """Divide forces on cells (worlds, N) among whole cells, shape (worlds, rows, columns)."""
        xp = find_namespace(forces)
        images = xp.reshape(forces, (-1, *self.shape))
        parts = [xp.roll(share * images, offset, axis=(1, 2)) for offset, share in self.split.items()]
        return sum(parts) if parts else images

    def displace(self, values: Array) -> Array:
        """Compute the displacements of cells and slacks under forces on them, shape (worlds, N + k)."""
        if self.spectrum is None:
            return values / self.stiffness
        xp, (rows, columns) = find_namespace(values), self.shape
        forces, slacks = values[:, : rows * columns], values[:, rows * columns :]
        waves = xp.fft.rfftn(self.place(forces), s=self.padded, axes=(1, 2)) * self.spectrum
        moved = xp.fft.irfftn(waves, s=self.padded, axes=(1, 2))[:, :rows, :columns]
        if self.split:
            moved = sum(share * xp.roll(moved, (-i, -j), axis=(1, 2)) for (i, j), share in self.split.items())
        moved = xp.reshape(moved, forces.shape)
        return xp.concat([moved if self.own is None else moved + self.own * forces, TILT * slacks], axis=1)

    def move(self, motion: Array) -> Array:
        """Compute the displacements B motion, shape (worlds, N + k)."""
        return motion @ self.basis.T if self.basis.ndim < 3 else (self.basis @ motion[:, :, None])[..., 0]  # noqa: PLR2004

    def solve(self, weights: Array, sums: Array) -> Array:
        """Solve B' W B motion = sums, where W is the diagonal matrix of the weights (worlds, N + k)."""
        xp, count = find_namespace(weights), self.basis.shape[-1]
        matrix = xp.reshape(_multiply(weights, self.products), (-1, count, count)) + self.tiny
        return xp.linalg.solve(matrix, sums[..., None])[..., 0]

    def remove(self, active: Array, values: Array) -> tuple[Array, Array]:
        """Subtract from values the rigid motion that fits them best on active unknowns; return result and motion."""
        motion = self.solve(active, _multiply(active * values, self.basis))
        return values - self.move(motion), motion

    def complete(self, forces: Array, target: Array) -> Array:
        """Scale forces on cells to the load, and append the slacks that satisfy the other conditions."""
        xp = find_namespace(forces)
        forces = forces * _divide(target[:, :1], _sum(forces))
        missing = target - _multiply(forces, self.basis[..., : forces.shape[1], :])
        return xp.concat([forces, self.always[forces.shape[1] :] * missing], axis=1)

    def press(self, gap: Array, target: Array, steps: int) -> Array:
        """Compute the forces on cells, shape (worlds, N).

        Args:
            gap: Gap at each cell, inf where there is no body, shape (worlds, N).
            target: Wanted values of the conditions, shape (worlds, k).
            steps: Steps of the conjugate gradients [-]; 0 for the forces of the elastic foundation.
        """
        xp, cells = find_namespace(gap), gap.shape[1]
        small, load, lowest = float(xp.finfo(gap.dtype).eps), target[:, :1], xp.min(gap, axis=1, keepdims=True)
        gap = xp.concat([gap - xp.where(lowest == _AWAY, 0.0, lowest), 0 * target], axis=1)
        under, gap = _number(gap != _AWAY, gap), xp.where(gap == _AWAY, 0.0, gap)
        values = self.complete(self._found(gap, under, target)[:, :cells], target)
        direction, last, kept = xp.zeros_like(gap), xp.ones_like(load), xp.zeros_like(load)
        for _ in range(steps):
            active = xp.maximum(_number(values > 0, gap), self.always)
            overlap = self.displace(values) + gap
            beside, _ = self.remove(active, overlap)
            residual = active * beside
            energy = _sum(residual**2)
            share = xp.minimum(kept * energy / last, xp.ones_like(last))
            direction = active * self.remove(active, residual + share * direction)[0]
            curvature, slope = _sum(self.displace(direction) * direction), _sum(residual * direction)
            # A world that has converged stays as it is: its residual consists of rounding errors.
            moves = (curvature > 0) & (slope > 0) & (energy > (_NOISE * small) ** 2 * _sum((active * overlap) ** 2))
            length = xp.where(moves, _divide(slope, curvature), 1.0)
            moved = values - length * xp.where(moves, direction, 0.0)
            grown = (1 - active) * under * _positive(-length * beside)
            forces = (active * _positive(moved) + grown)[:, :cells]
            if target.shape[1] > 1:
                # Cells that gained or lost contact changed the moments; factors linear in x and y restore them.
                forces = forces * _divide(load, _sum(forces))
                planned = xp.concat([forces, moved[:, cells:]], axis=1)
                # the small weight of the slacks exceeds rounding errors of lever arms squared
                weights = xp.concat([_divide(forces, load), 0 * target + 100 * small * cells], axis=1)
                tilt = self.solve(weights, _divide(target - _multiply(planned, self.basis), load))
                forces = forces * (0.2 + _positive(0.8 + self.move(tilt)[:, :cells]))
            values = self.complete(forces, target)
            last, kept = xp.where(energy > 0, energy, 1.0), _number(_sum(grown) == 0, gap)
        return values[:, :cells]

    def _found(self, gap: Array, under: Array, target: Array) -> Array:
        """Compute the forces of the elastic foundation on cells by Newton's method, shape (worlds, N + k).

        Args:
            gap: Gap at each cell above the smallest one, and zeros, shape (worlds, N + k).
            under: 1 where there is a body, and for slacks; else 0, shape (worlds, N + k).
            target: Wanted values of the conditions, shape (worlds, k).
        """
        springs = self.stiffness * under
        motion = target * (1 - self.always[-target.shape[1] :]) / _sum(springs)
        for _ in range(_NEWTON[target.shape[1]]):
            height = self.move(motion) - gap
            weights = springs * find_namespace(gap).maximum(_number(height > 0, gap), self.always)
            motion = motion + self.solve(weights, target - _multiply(weights * height, self.basis))
        return springs * _positive(self.move(motion) - gap)

    def pull_back(self, forces: Array, slope: Array, steps: int) -> tuple[Array, Array]:
        """Compute the gradient of a function of the forces with respect to gap and target, by conjugate gradients.

        Args:
            forces: Forces on the cells at the solution, shape (worlds, N).
            slope: Gradient of the function with respect to the forces, shape (worlds, N).
            steps: Steps of the conjugate gradients [-].

        Returns:
            Gradients with respect to gap, shape (worlds, N), and to target, shape (worlds, k).
        """
        xp, nothing = find_namespace(forces), forces[:, :1] * 0 * self.always[forces.shape[1] :]
        active = xp.maximum(_number(xp.concat([forces, nothing], axis=1) > 0, forces), self.always)
        slope = xp.concat([slope, nothing], axis=1)
        found, residual = xp.zeros_like(slope), active * self.remove(active, slope)[0]
        direction, energy = residual, _sum(residual**2)
        smallest = (_NOISE * float(xp.finfo(forces.dtype).eps)) ** 2 * _sum((active * slope) ** 2)
        for _ in range(steps):
            image = active * self.remove(active, self.displace(direction))[0]
            curvature = _sum(image * direction)
            length = xp.where((curvature > 0) & (energy > smallest), _divide(energy, curvature), 0.0)
            found, residual, last = found + length * direction, residual - length * image, energy
            energy = _sum(residual**2)
            direction = residual + _divide(energy, last) * direction
        _, motion = self.remove(active, self.displace(found) - slope)
        return -found[:, : forces.shape[1]], -motion


def differentiate(xp: Any, build: Callable[..., Problem], steps: int) -> Callable[..., Array]:  # noqa: ANN401 -- a module
    """Make the function that computes forces, with a gradient for JAX and PyTorch with respect to gap and target.

    Args:
        xp: Module of the arrays.
        build: Function that builds the problem from the target and further arrays.
        steps: Steps of the conjugate gradients [-].

    Returns:
        Function of gap, target and the further arrays, see `Problem.press`.
    """

    def press(gap: Array, target: Array, *parts: Array) -> Array:
        return build(target, *parts).press(gap, target, steps)

    def keep(gap: Array, target: Array, *parts: Array) -> tuple[Array, tuple[Array, ...]]:
        forces = press(gap, target, *parts)
        return forces, (forces, target, *parts)

    def pull_back(kept: tuple[Array, ...], slope: Array) -> tuple[Array | None, ...]:
        forces, target, *parts = kept
        found = build(target, *parts).pull_back(forces, slope, max(steps, 8))
        return (*found, *(None for _ in parts))

    if xp.__name__ == "jax.numpy":
        solve = sys.modules["jax"].custom_vjp(press)
        solve.defvjp(keep, pull_back)
        return solve  # type: ignore[no-any-return]
    if xp.__name__.endswith("torch"):

        class Press(sys.modules["torch"].autograd.Function):  # type: ignore[misc]
            """The function with its gradient, as PyTorch takes it."""

            @staticmethod
            def forward(context: Any, *arguments: Array) -> Array:  # noqa: ANN401 -- a class of PyTorch
                forces, kept = keep(*arguments)
                context.save_for_backward(*kept)
                return forces

            @staticmethod
            def backward(context: Any, slope: Array) -> tuple[Array | None, ...]:  # noqa: ANN401 -- a class of PyTorch
                return pull_back(context.saved_tensors, slope)

        return Press.apply  # type: ignore[no-any-return]
    return press


def _multiply(values: Array, columns: Array) -> Array:
    """Multiply vectors (worlds, m) by columns (m, n), or by each world's own (worlds, m, n), shape (worlds, n)."""
    return values @ columns if columns.ndim < 3 else (values[:, None, :] @ columns)[:, 0, :]  # noqa: PLR2004


def _sum(values: Array) -> Array:
    """Sum over the unknowns, shape (worlds, 1)."""
    return find_namespace(values).sum(values, axis=1, keepdims=True)


def _divide(values: Array, by: Array) -> Array:
    """Divide values by positive numbers (worlds, 1); the result is zero where a divisor is zero."""
    xp = find_namespace(values)
    return xp.where(by > 0, values / xp.where(by > 0, by, 1.0), 0.0)


def _positive(values: Array) -> Array:
    """Replace negative values by zero."""
    return find_namespace(values).maximum(values, 0 * values)


def _number(which: Array, like: Array) -> Array:
    """Convert truth values to 0 and 1 of the type of an array."""
    return cast(find_namespace(like), which, like.dtype)
