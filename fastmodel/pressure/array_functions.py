"""Texel forces of many worlds at once, as pure functions of gap images and loads, for arrays of numpy, JAX or PyTorch.

A gap image holds for every cell of the contact grid the distance from the undeformed cover up to the body above the
cell.  One rigid body presses in every world; its force is prescribed, and optionally its two moments:

    functions = ContactFunctions(parameters)
    found = functions.forces(gap, load)                  # gap: (worlds, rows, columns) [m], load: (worlds,) [N]
    state = chain.take(state, found.texel_forces, load)  # chain: `ChainFunctions(parameters, rate, spreads=False)`

The problem is that of the contact method `cover`, see `fastmodel.pressure.solvers`, except that a cell lies under the
body as a whole or not at all.  The iteration starts from the elastic foundation and continues with conjugate gradients
(Polonsky and Keer, Wear 231, 1999).  The cover's compliance is applied by fast Fourier transforms.  All worlds take the
same fixed number of iterations; a world that has converged no longer changes.  Moments are a soft condition, as in
`cover`: what is missing of a moment adds to the energy as a spring would.

Cell forces are differentiable with respect to gap, load and moments, with `jax.grad` and `backward` of PyTorch.  The
gradient is that of the exact solution on the present contact area A, from one linear system with the same operator,
[C_AA, -1; 1', 0].  The forces are continuous and piecewise smooth: where a cell is about to gain or lose contact, the
gradient is the one-sided derivative on the side where the contact area stays as it is.

Constants follow library, element type and device of the arrays.  JAX computes with 32 bits unless
`jax.config.update("jax_enable_x64", True)` was called.  Values are checked where they are known; functions under
`jax.jit` check shapes and types only, and a world with NaN then returns NaN, without effect on other worlds.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from fastmodel.errors import FastModelError, ParametersError, check_count, check_type
from fastmodel.parameters import Parameters
from fastmodel.pressure.cell_grid import BaseForces, CellGrid
from fastmodel.signal.array_namespace import Array, cast, check_floats, convert, find_namespace, is_known
from meshes.array_types import FloatArray

#: Slack of a moment [-]: rotation of a body, as displacement over the edge of a cell, for each missing moment, as force
#: with this edge as lever arm, in units of the compliance of one cell under a force on itself.
_TILT = 4.0
#: Newton steps for the motion of a body on the elastic foundation [-].
_NEWTON = 20
#: Smallest number that is added to the first entry of a matrix, so that it is regular in a world without contact [-].
_TINY = 1e-30


class ContactForces(NamedTuple):
    """Forces of the bodies in many worlds.

    Attributes:
        cell_forces: Force on each cell at the top of the cover, shape (..., rows, columns) [N].
        texel_forces: Force on each of n texels at the base of the cover, shape (..., n) [N].
    """

    cell_forces: Array
    texel_forces: Array


class ContactFunctions:
    """Forces on cells and texels under rigid bodies in many worlds, as pure functions.

    Attributes:
        grid: The contact grid, which gap images cover: its rows, columns, edges of a cell, and lowest corner.
    """

    def __init__(
        self,
        parameters: Parameters,
        namespace: Any = np,  # noqa: ANN401 -- modules have no common type
        *,
        margin: int = 1,
        nominal_load: float = 0.0,
    ) -> None:
        """Tabulate the operators of the cover.

        Args:
            parameters: The array of n texels, flat and regular, and its cover's cells.
            namespace: Module for gap images and depths that are plain lists; arrays keep their own.
            margin: Number of pitches by which the contact grid extends beyond the texels, see `Plate` [-].
            nominal_load: Force of a body for which a cover that becomes stiffer under load is taken [N].

        Raises:
            FastModelError: If the margin is no whole number from 0 on.
            ParametersError: If the parameters hold no cells of a cover, or the array is not flat and regular.
        """
        check_type("parameters", parameters, Parameters, "the Parameters of a sensor, as fastmodel.load returns them")
        array, cells = parameters.array, None if parameters.surface is None else parameters.surface.cells
        if cells is None or not array.regular:
            raise ParametersError(
                f"array {array.name!r}: ContactFunctions needs a flat, regular array and the cover's cells; derive the "
                f"parameters of such an array, or give texel forces from elsewhere to ChainFunctions"
            )
        cells.check(array)
        cells = cells.under_loads[round(cells.position_among_loads(nominal_load))]
        margin = check_count("margin", margin, 0) if cells.margin is None else cells.margin
        grid = self.grid = CellGrid.over(array, cells.per_texel, margin)
        self._namespace, self._array, self._margin = namespace, array, margin
        edges, area = np.array(grid.edge), grid.edge[0] * grid.edge[1]
        self._lever = float(np.sqrt(area))
        #: Compliance of one cell under a force on itself [m/N].  Gaps are divided by it, and become forces.
        self._own = float(cells.compliance[0, 0]) / area
        self._modulus = cells.foundation_modulus()
        self._cover = _transform(cells.compliance / cells.compliance[0, 0], (grid.rows, grid.columns))
        places = np.stack(np.meshgrid(np.arange(grid.columns), np.arange(grid.rows)), axis=-1).reshape(-1, 2) * edges
        #: Middle of the contact grid in the array's frame, shape (2,) [m].
        self._middle = grid.low + edges * (grid.columns, grid.rows) / 2
        self._basis = np.column_stack([np.ones(len(places)), (places - places.mean(axis=0)) / self._lever])
        base = BaseForces(cells, grid, array)
        self._along, self._across, _ = base.factor_window((0, 0), (grid.rows, grid.columns))
        self._tabulated = cells.table is not None

    def forces(self, gap: Array, load: Array, moments: Array | None = None, iterations: int = 8) -> ContactForces:
        """Compute the forces under one body in every world.

        Args:
            gap: Distance from the undeformed cover up to the body at the centre of each cell, up to a constant, shape
                (..., rows, columns) as in `grid`; inf where no body is above the cell [m].
            load: Force of the body against the array's normal, shape (...) [N].
            moments: Sums over the contact points of force times x and of force times y, in the array's frame, shape
                (..., 2); None for a body that keeps its tilt [N m].
            iterations: Steps of the conjugate gradients [-]; 0 for the elastic foundation alone.  The forces add up to
                the load after any number.

        Returns:
            Forces on cells and texels; zero in a world without load, or without a body above the grid.

        Raises:
            FastModelError: If an array has a wrong shape, element type or device, or holds NaN, or a load is negative.
        """
        xp, steps = find_namespace(gap, self._namespace), check_count("iterations", iterations, 0)
        gap = check_floats("gap", xp.asarray(gap))
        worlds, grid = tuple(gap.shape[:-2]), (self.grid.rows, self.grid.columns)
        if tuple(gap.shape[-2:]) != grid:
            raise FastModelError(
                f"gap has shape {tuple(gap.shape)}; it must end with {grid}, the rows and columns of the contact grid "
                f"of {self.grid.per_texel} x {self.grid.per_texel} cells a texel and a margin of {self._margin} texels"
            )
        load = check_floats("load", load, gap, worlds)
        _check_values("gap", gap, ~xp.isnan(gap), "numbers, and inf where there is no body")
        _check_values("load", load, (load >= 0) & xp.isfinite(load), "finite forces from 0 on")
        target = load[..., None]
        if moments is not None:
            moments = check_floats("moments", moments, gap, (*worlds, 2))
            _check_values("moments", moments, xp.isfinite(moments), "finite numbers")
            arms = (moments - target * convert(self._middle, gap)) / self._lever
            target = xp.concat([target, arms], axis=-1)
        target, count = xp.reshape(target, (-1, target.shape[-1])), target.shape[-1]
        basis = self._basis[:, :count]
        problem = _Problem(
            basis=convert(basis, gap),
            products=convert((basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1), gap),
            soft=convert(np.array([0.0, 1.0, 1.0])[:count], gap),
            stiffness=self._modulus * self._lever**2 * self._own,
            shape=grid,
            padded=self._cover[0],
            spectrum=convert(self._cover[1], gap) if steps else None,
        )
        forces = _differentiate(xp, problem, steps)(xp.reshape(gap, (-1, problem.basis.shape[0])) / self._own, target)
        forces = xp.reshape(forces, gap.shape)
        return ContactForces(forces, self.base_forces(forces))

    def base_forces(self, cell_forces: Array) -> Array:
        """Compute the forces on n texels at the base of the cover, shape (..., n) [N].

        Args:
            cell_forces: Force on each cell at the top of the cover, shape (..., rows, columns) [N].
        """
        xp, worlds = find_namespace(cell_forces), tuple(cell_forces.shape[:-2])
        along = convert(self._along, cell_forces)
        if self._tabulated:
            images = xp.reshape(cell_forces, (*worlds, along.shape[1])) @ along.T
        else:
            across = convert(self._across, cell_forces)
            images = along @ cell_forces
            images = xp.reshape(images, (*worlds, self._array.rows, across.shape[0])) @ across
        return xp.reshape(images, (*worlds, self._array.count)) * convert(self._array.active, cell_forces)


def _check_values(name: str, values: Array, accepted: Array, wanted: str) -> None:
    """Check that the values of an argument are accepted, if they are known.

    Raises:
        FastModelError: If one is not accepted.
    """
    if not is_known(values):
        return
    wrong = np.argwhere(~np.asarray(accepted.tolist())) if not bool(find_namespace(values).all(accepted)) else []
    if len(wrong):
        place = f"[{', '.join(map(str, wrong[0]))}]" if len(wrong[0]) else ""
        raise FastModelError(f"{name}{place} is {float(values[tuple(wrong[0].tolist())])}; give {wanted}")


def _transform(kernel: FloatArray, shape: tuple[int, int]) -> tuple[tuple[int, int], FloatArray]:
    """Find the padded shape of images and the Fourier transform of a symmetric kernel on this shape.

    Args:
        kernel: Values at distances of i rows and j columns, entry `[i, j]` [any unit].
        shape: Rows and columns of the images before they are padded with zeros.
    """
    from scipy.fft import next_fast_len

    reach = [min(each, size) for each, size in zip(kernel.shape, shape, strict=True)]
    padded = tuple(next_fast_len(size + each - 1, real=True) for size, each in zip(shape, reach, strict=True))
    whole = np.zeros(padded)
    rows, columns = (np.arange(1 - each, each) for each in reach)
    whole[np.ix_(rows % padded[0], columns % padded[1])] = kernel[np.ix_(np.abs(rows), np.abs(columns))]
    return (padded[0], padded[1]), np.fft.rfft2(whole).real.copy()


class _Problem(NamedTuple):
    """The contact problem of N cells under k conditions; all quantities are forces, in the library of the arrays.

    Unknown are the forces f on cells and a slack m of each moment.  Conditions: f >= 0 and B' f + m = target.

    Attributes:
        basis: Columns B of the conditions, which are also the rigid motions of a body, shape (N, k) [-].
        products: Products of all pairs of columns of the basis, shape (N, k * k) [-].
        soft: 0 for the condition on the force, 1 for those on moments, which may be missed, shape (k,) [-].
        stiffness: Stiffness of the foundation under a cell, times the compliance of a cell of the cover [-].
        shape: Rows and columns of the contact grid.
        padded: Rows and columns of the padded grid.
        spectrum: Fourier transform of the compliance over that of one cell; None for the elastic foundation [-].
    """

    basis: Array
    products: Array
    soft: Array
    stiffness: float
    shape: tuple[int, int]
    padded: tuple[int, int]
    spectrum: Array | None

    def displace(self, forces: Array) -> Array:
        """Compute the displacements of the cells under forces, shape (worlds, N) [N]."""
        if self.spectrum is None:
            return forces / self.stiffness
        xp = find_namespace(forces)
        images = xp.reshape(forces, (-1, *self.shape))
        bent = xp.fft.rfftn(images, s=self.padded, axes=(-2, -1)) * self.spectrum
        moved = xp.fft.irfftn(bent, s=self.padded, axes=(-2, -1))[..., : self.shape[0], : self.shape[1]]
        return xp.reshape(moved, forces.shape)

    def multiply(self, weights: Array, slack: float = 1.0) -> Array:
        """Compute B' W B + D, with D = `slack` for moments, shape (worlds, k, k); weights have shape (worlds, N).

        A small number keeps the matrix regular in a world without weights.
        """
        count = self.basis.shape[1]
        products = find_namespace(weights).reshape(weights @ self.products, (-1, count, count))
        return products + convert(np.diag([_TINY, slack, slack][:count]), weights)

    def fit(self, matrix: Array, values: Array, slacks: Array) -> Array:
        """Fit rigid motions to values on active cells (worlds, N) and to slacks (worlds, k), shape (worlds, k).

        Args:
            matrix: The result of `multiply` for active cells, shape (worlds, k, k).
            values: Values on active cells, 0 on others, shape (worlds, N).
            slacks: Values of the slacks, shape (worlds, k).
        """
        return _solve(matrix, values @ self.basis + self.soft * slacks)

    def press(self, gap: Array, target: Array, steps: int) -> Array:
        """Compute the forces on cells, shape (worlds, N) [N].

        Args:
            gap: Gap over the compliance of a cell, inf where there is no body, shape (worlds, N) [N].
            target: Prescribed values of the conditions, shape (worlds, k) [N].
            steps: Steps of the conjugate gradients; with 0 the result is that of the foundation [-].
        """
        xp, below = find_namespace(gap), find_namespace(gap).isfinite(gap)
        lowest = xp.min(gap, axis=1, keepdims=True)
        gap = xp.where(below, gap - xp.where(xp.isfinite(lowest), lowest, 0.0), 0.0)
        forces = _scale(self._start(gap, below, target), target)
        direction, turn = xp.zeros_like(gap), xp.zeros_like(target)
        last, kept = xp.ones_like(gap[:, :1]), xp.zeros_like(gap[:, :1])
        small, load = float(xp.finfo(gap.dtype).eps), xp.where(target[:, :1] > 0, target[:, :1], 1.0)
        for _ in range(steps):
            active = _as_numbers(forces > 0, gap)
            slacks = self.soft * (target - forces @ self.basis)
            overlap = self.displace(forces) + gap
            pressed, matrix = active * overlap, self.multiply(active)
            motion = self.fit(matrix, pressed, _TILT * slacks)
            beside = overlap - motion @ self.basis.T
            residual, rest = active * beside, self.soft * (_TILT * slacks - motion)
            energy = _sum(residual**2) + _sum(rest**2)
            share = kept * xp.minimum(energy / last, xp.ones_like(last))
            direction, turn = residual + share * direction, rest + share * turn
            direction = active * direction
            motion = self.fit(matrix, direction, turn)
            direction, turn = direction - active * (motion @ self.basis.T), turn - self.soft * motion
            curvature = _sum(self.displace(direction) * direction) + _TILT * _sum(turn**2)
            slope = _sum(residual * direction) + _sum(rest * turn)
            # a world that has converged stays as it is: its residual consists of rounding errors
            moves = (curvature > 0) & (slope > 0) & (energy > (64 * small) ** 2 * _sum(pressed**2))
            length = xp.where(moves, slope / xp.where(moves, curvature, 1.0), 1.0)
            direction, turn = xp.where(moves, direction, 0.0), xp.where(moves, turn, 0.0)
            grown = xp.where(below & (active == 0), xp.maximum(-length * beside, xp.zeros_like(beside)), 0.0)
            forces = grown + active * xp.maximum(forces - length * direction, xp.zeros_like(forces))
            forces = _scale(forces, target)
            if self.basis.shape[1] > 1:
                # cells that gained or lost contact changed the moments; factors linear in x and y restore them
                missed = (target - self.soft * (slacks - length * turn) - forces @ self.basis) / load
                tilt = _solve(self.multiply(forces / load, 100 * small), missed)
                forces = _scale(forces * xp.maximum(1 + tilt @ self.basis.T, 0.2 + xp.zeros_like(forces)), target)
            last, kept = xp.where(energy > 0, energy, 1.0), _as_numbers(_sum(grown) == 0, gap)
        return forces

    def _start(self, gap: Array, below: Array, target: Array) -> Array:
        """Compute the forces of the elastic foundation by Newton's method; see `press` for the arguments."""
        xp = find_namespace(gap)
        motion = xp.concat([target[:, :1] / (self.stiffness * gap.shape[1]), 0 * target[:, 1:]], axis=1)
        for _ in range(_NEWTON):
            height = motion @ self.basis.T - gap
            pressed = below & (height > 0)
            forces = self.stiffness * xp.where(pressed, height, 0.0)
            missed = target - forces @ self.basis - self.soft * motion / _TILT
            motion = motion + _solve(self.multiply(self.stiffness * _as_numbers(pressed, gap), 1 / _TILT), missed)
        return self.stiffness * xp.where(below, xp.maximum(motion @ self.basis.T - gap, 0.0), 0.0)

    def pull_back(self, forces: Array, slope: Array, steps: int) -> tuple[Array, Array]:
        """Compute the gradient of a function of the forces with respect to gap and target, by conjugate gradients.

        Args:
            forces: Forces on the cells at the solution, shape (worlds, N) [N].
            slope: Gradient of the function with respect to the forces, shape (worlds, N) [1/N].
            steps: Steps of the conjugate gradients [-].

        Returns:
            Gradients with respect to gap, shape (worlds, N), and to target, shape (worlds, k) [1/N].
        """
        xp = find_namespace(forces)
        active = _as_numbers(forces > 0, forces)
        matrix = self.multiply(active)

        def remove(values: Array, slacks: Array) -> tuple[Array, Array]:
            motion = self.fit(matrix, active * values, slacks)
            return active * (values - motion @ self.basis.T), self.soft * (slacks - motion)

        found, rest = xp.zeros_like(forces), xp.zeros_like(forces @ self.basis)
        residual, excess = remove(slope, rest)
        direction, turn, energy = residual, excess, _sum(residual**2) + _sum(excess**2)
        for _ in range(steps):
            image, swing = remove(self.displace(direction), _TILT * turn)
            curvature = _sum(image * direction) + _sum(swing * turn)
            length = xp.where(curvature > 0, energy / xp.where(curvature > 0, curvature, 1.0), 0.0)
            found, rest = found + length * direction, rest + length * turn
            residual, excess, last = residual - length * image, excess - length * swing, energy
            energy = _sum(residual**2) + _sum(excess**2)
            share = xp.where(last > 0, energy / xp.where(last > 0, last, 1.0), 0.0)
            direction, turn = residual + share * direction, excess + share * turn
        return -found, -self.fit(matrix, active * (self.displace(found) - slope), _TILT * rest)


def _solve(matrix: Array, right: Array) -> Array:
    """Solve a system of k equations in every world, shape (worlds, k)."""
    return find_namespace(matrix).linalg.solve(matrix, right[..., None])[..., 0]


def _scale(forces: Array, target: Array) -> Array:
    """Scale forces on cells (worlds, N) to the prescribed force (worlds, 1...); without any, they stay zero [N]."""
    xp, total = find_namespace(forces), _sum(forces)
    return forces * xp.where(total > 0, target[:, :1] / xp.where(total > 0, total, 1.0), 0.0)


def _sum(values: Array) -> Array:
    """Sum over cells or conditions, shape (worlds, 1)."""
    return find_namespace(values).sum(values, axis=-1, keepdims=True)


def _as_numbers(which: Array, like: Array) -> Array:
    """Convert truth values to 0 and 1 of the type of an array, same shape."""
    return cast(find_namespace(like), which, like.dtype)


def _differentiate(xp: Any, problem: _Problem, steps: int) -> Callable[[Array, Array], Array]:  # noqa: ANN401
    """Return the function of gap and target that computes the forces, with its gradient in the array's library."""

    def press(gap: Array, target: Array) -> Array:
        return problem.press(gap, target, steps)

    def pull_back(forces: Array, slope: Array) -> tuple[Array, Array]:
        return problem.pull_back(forces, slope, max(steps, 4))

    if xp.__name__ == "jax.numpy":
        solve = sys.modules["jax"].custom_vjp(press)
        solve.defvjp(lambda gap, target: (press(gap, target),) * 2, pull_back)
        return solve
    if xp.__name__.endswith("torch"):
        function = sys.modules["torch"].autograd.Function

        class Press(function):
            @staticmethod
            def forward(ctx, gap, target):
                forces = press(gap, target)
                ctx.save_for_backward(forces)
                return forces

            @staticmethod
            def backward(ctx, slope):
                return pull_back(*ctx.saved_tensors, slope)

        return Press.apply
    return press
