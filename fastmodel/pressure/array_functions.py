"""Texel forces of many worlds at once, as pure functions of gap images and loads, for arrays of numpy, JAX or PyTorch.

A gap image holds the distance from the undeformed cover up to the body, at every cell of the contact grid or at m x m
points of every cell.  One rigid body presses in each world; its force is prescribed, and optionally its moments:

    functions = ContactFunctions(parameters)
    found = functions.forces(gap, load)                        # gap: (worlds, rows, columns) [m], load: (worlds,) [N]
    state = chain.take(state, found.texel_forces, found.load)  # ChainFunctions(parameters, rate_hz, spreads=False)

The contact problem is that of the method `cover`, see `fastmodel.pressure.solvers`.  The iteration starts from the
elastic foundation and continues with conjugate gradients (Polonsky and Keer, Wear 231, 1999); fast Fourier transforms
apply the compliance of the cover.  All worlds take the same fixed number of steps, and a world that has converged no
longer changes.  Moments may be missed: what is missing of a moment adds to the energy as a spring would.

Forces can be differentiated with respect to gap, load and moments, by `jax.grad` or by `backward` of PyTorch.  The
gradient is that of the exact solution on the present contact area A, from one linear system with the same operator,
[C_AA, -1; 1', 0].  Forces are continuous and piecewise smooth.  Where a cell is about to gain or lose contact, the
gradient is the derivative on the side on which the contact area stays as it is.

Constants follow library, element type and device of the arrays.  JAX computes with 32 bits unless
`jax.config.update("jax_enable_x64", True)` was called.  Under `jax.jit` only shapes and types can be checked: a world
with NaN then returns NaN, without effect on other worlds, and a negative load counts as zero.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np

from fastmodel.errors import FastModelError, ParametersError, check_count, check_type, warn_user
from fastmodel.parameters import Parameters
from fastmodel.pressure.array_solver import Problem, differentiate
from fastmodel.pressure.cell_grid import BaseForces, CellGrid
from fastmodel.pressure.solvers import TILT
from fastmodel.signal.array_namespace import Array, cast, check_floats, convert, find_namespace, is_known
from fastmodel.validity import RangeWarning, describe_end, goes_on
from meshes.array_types import FloatArray

#: Number of worlds that numpy computes at a time, whose arrays fit a processor's cache [-].
_BLOCK = 64


class ContactForces(NamedTuple):
    """Forces of the bodies in many worlds.

    Attributes:
        cell_forces: Force on each cell at the top of the cover, shape (..., rows, columns) [N].
        texel_forces: Force on each of n texels at the base of the cover, shape (..., n) [N].
        load: Force of the body in each world, shape (...) [N].
        at_end: Share of the force on the outermost cells of a grid whose margin nobody states, shape (...) [-]: above
            0.001 the contact may go on beyond the cells, and the texels then bear too much.
    """

    cell_forces: Array
    texel_forces: Array
    load: Array
    at_end: Array


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
        nominal_load: float = 0.0,
    ) -> None:
        """Tabulate the operators of the cover.

        Args:
            parameters: The array of n texels, flat and regular, and the cells of its cover.
            namespace: Module for gaps and depths that are plain lists, for example `jax.numpy`; arrays keep their own.
            nominal_load: Force of a body for which a cover that becomes stiffer under load is taken [N].

        Raises:
            ParametersError: If the parameters hold no cells of a cover, or the array is not flat and regular.
        """
        check_type("parameters", parameters, Parameters, "the Parameters of a sensor, as fastmodel.load returns them")
        array, cells = parameters.array, None if parameters.surface is None else parameters.surface.cells
        if cells is None or not array.regular:
            raise ParametersError(
                f"array {array.name!r}: ContactFunctions needs a flat, regular array and the cells of its cover; use "
                f"derived parameters of such an array, or give texel forces from elsewhere to ChainFunctions"
            )
        cells.check(array)
        cells = cells.under_loads[round(cells.position_among_loads(nominal_load))]
        beyond = (0.0, 0.0) if parameters.ends_at_texels else array.margin_pitches
        grid = self.grid = CellGrid.over(array, cells.per_texel, beyond)
        self._namespace, self._array, self._modulus = namespace, array, cells.foundation_modulus()
        self._edge, self._lever = np.array(grid.edge), grid.mean_edge
        ratios = cells.compliance / cells.compliance[0, 0]
        #: Compliance of a cell under a force on itself [m/N], and that of cells up to one row and column apart over it.
        self._own = float(cells.compliance[0, 0]) / grid.mean_edge**2
        self._near, self._square = cells.near / self._own, cells.square_compliance / self._own
        self._spectrum, self._padded = _transform(ratios, (grid.rows, grid.columns))
        #: Middle of the grid in the array's frame, shape (2,) [m].
        self._middle = grid.low + self._edge * (grid.columns, grid.rows) / 2
        #: 1 at the outermost cells of a grid whose margin nobody states, else 0, shape (rows, columns) [-].
        self._rim = np.ones((grid.rows, grid.columns))
        self._rim[1:-1, 1:-1] = 0
        self._rim *= array.margin is None and not parameters.ends_at_texels
        #: Whether the warning about the end of the grid was given, or cannot be needed.
        self._told = not self._rim.any()
        y, x = np.mgrid[: grid.rows, : grid.columns].reshape(2, -1)
        places = (np.column_stack([x, y]) + 0.5) * self._edge + grid.low - self._middle
        #: Constants 1, x and y at each of N cells, and below them the columns of the slacks, shape (N + 3, 3) [-].
        self._basis = np.vstack([np.column_stack([np.ones(len(x)), places / self._lever]), np.diag([0.0, 1.0, 1.0])])
        self._along, self._across, _ = BaseForces(cells, grid, array).factor_window((0, 0), (grid.rows, grid.columns))
        self._tabulated, self._active = cells.table is not None, array.active.astype(np.float64)

    def forces(self, gap: Array, load: Array, moments: Array | None = None, iterations: int = 8) -> ContactForces:
        """Compute the forces under one body in each world.

        Args:
            gap: Distance from the undeformed cover up to the body, up to a constant, at the centre of each cell of
                `grid`, shape (..., rows, columns), or at m x m points of each cell, shape (..., m * rows, m * columns);
                inf where there is no body.  Points give the share of each cell that lies under the body: with 4 x 4
                of them forces are those of `cover`, while whole cells misplace 3 to 9 % of the load of a flat face [m].
            load: Force of the body against the array's normal, shape (...) [N].
            moments: Sums over the contact points of force times x and of force times y, in the array's frame, shape
                (..., 2); None for a body that keeps its tilt [N m].
            iterations: Steps of the conjugate gradients [-]; 0 for the elastic foundation alone.  Forces add up to the
                load after any number.  Without moments 5 give 0.1 % of the load, with moments 8.  Where the wanted
                centre of pressure lies beside the body, 10 do not suffice in about one of 100 worlds.

        Returns:
            Forces on cells and texels; zero in a world without load, or without a body above the grid.

        Raises:
            FastModelError: If an array has a wrong shape, element type or device, or holds NaN, or a load is negative.
        """
        gap, steps = check_floats("gap", gap, otherwise=self._namespace), check_count("iterations", iterations, 0)
        xp, shape, worlds = find_namespace(gap), (self.grid.rows, self.grid.columns), tuple(gap.shape[:-2])
        fine = max(gap.shape[-1] // shape[1], 1) if gap.ndim else 1
        if tuple(gap.shape[-2:]) != (fine * shape[0], fine * shape[1]):
            raise FastModelError(
                f"gap has shape {tuple(gap.shape)}; its last two dimensions must be {shape}, the cells of "
                f"ContactFunctions.grid, or the same whole multiple of both, from points that divide each cell evenly"
            )
        load = check_floats("load", load, gap, worlds)
        _check_values("gap", gap, gap > -float("inf"), "a distance, or inf where there is no body")
        _check_values("load", load, (load >= 0) & xp.isfinite(load), "a finite force from 0 on")
        target = xp.maximum(load, 0 * load)[..., None]
        if moments is not None:
            moments = check_floats("moments", moments, gap, (*worlds, 2))
            _check_values("moments", moments, xp.isfinite(moments), "a finite moment")
            target = xp.concat([target, (moments - target * convert(self._middle, gap)) / self._lever], axis=-1)
        gap, target = xp.reshape(gap, (-1, *gap.shape[-2:])) / self._own, xp.reshape(target, (-1, target.shape[-1]))
        size = _BLOCK if xp is np else gap.shape[0]
        first = range(0, max(gap.shape[0], 1), max(size, 1))
        parts = [self._press(gap[k : k + size, ...], target[k : k + size, ...], fine, steps) for k in first]
        forces = xp.reshape(xp.concat(parts), (*worlds, *shape))
        return self._conclude(forces, load)

    def from_contacts(
        self,
        world: Array,
        points: Array,
        forces: Array,
        worlds: int,
        gap: Array | None = None,
        *,
        tilts: bool = True,
        iterations: int = 8,
    ) -> ContactForces:
        """Compute the forces under contacts that a simulator lists for all worlds together.

        The contacts of a world belong to one body.  With a gap image their sum is the force, and their moments are the
        moments, of the body.  Without one the force of every contact acts at its point, which is accurate only for
        contacts smaller than a cell, since contacts at the corners of a face do not carry its pressure.

        Args:
            world: World of each of k contacts, integers of shape (k,); -1 for entries that are no contacts.
            points: Positions of the contacts in the array's frame, shape (k, 3) [m].
            forces: Forces on the array in its frame, shape (k, 3) [N].
            worlds: Number of worlds [-].
            gap: Gap images, see `forces`; None for forces at the points of contact.
            tilts: Whether the bodies are free to tilt, so that the moments are prescribed.
            iterations: Steps of the conjugate gradients, see `forces` [-].

        Raises:
            FastModelError: If an array does not fit the others, or holds NaN, or a world is out of range.
        """
        points, worlds = check_floats("points", points, otherwise=self._namespace), check_count("worlds", worlds, 0)
        xp, count = find_namespace(points), points.shape[0] if points.ndim else 0
        forces = check_floats("forces", forces, check_floats("points", points, shape=(count, 3)), (count, 3))
        world = xp.asarray(world)
        if tuple(world.shape) != (count,) or not xp.isdtype(world.dtype, "integral"):
            raise FastModelError(f"world has type {world.dtype}, shape {tuple(world.shape)}; give integers ({count},)")
        _check_values("world", world, (world >= -1) & (world < worlds), f"-1 to {worlds - 1}")
        counted = (world >= 0)[:, None]
        points, forces = xp.where(counted, points, 0.0), xp.where(counted, forces, 0.0)
        _check_values("points", points, xp.isfinite(points), "a finite position")
        _check_values("forces", forces, xp.isfinite(forces), "a finite force")
        pressing, sides = -forces[:, 2:], points[:, :2]
        sums = _add_at(world, xp.concat([pressing, pressing * sides], axis=1), worlds)
        load = xp.maximum(sums[:, 0], 0 * sums[:, 0])
        if gap is not None:
            return self.forces(gap, load, sums[:, 1:] if tilts else None, iterations)
        row, column, parts = self.grid.divide_points(xp.concat([sides, pressing], axis=1))
        shape = (worlds, self.grid.rows, self.grid.columns)
        index = xp.concat([xp.astype(world, row.dtype)] * 4)
        cell = (index * shape[1] + row) * shape[2] + column
        cells = _add_at(xp.where(index < 0, index, cell), parts[:, None], worlds * shape[1] * shape[2])
        cells = xp.reshape(cells, shape)
        return self._conclude(cells, load)

    def from_depths(self, depths: Array, load: Array | None = None, iterations: int = 8) -> ContactForces:
        """Compute the forces under bodies whose depths below the undeformed cover are known at the texels' centres.

        Depths are interpolated linearly between the texels, and extrapolated beyond them.

        Args:
            depths: Depth of the body at each of n texels, negative above the cover, shape (..., n) [m].  A depth of
                exactly zero means that there is no body, as in simulators that cut depths off at zero.
            load: Force of the body, shape (...) [N]; by default that of the elastic foundation at these depths.
            iterations: Steps of the conjugate gradients, see `forces` [-].

        Raises:
            FastModelError: If an array has a wrong number of texels, shape, type or device, or holds NaN.
        """
        depths, array = check_floats("depths", depths, otherwise=self._namespace), self._array
        xp, shape = find_namespace(depths), tuple(depths.shape)
        if shape[-1:] != (array.count,):
            raise FastModelError(f"depths has shape {shape}; its last dimension must be {array.count} texels")
        if load is None:
            whole = array.pitch[0] * array.pitch[1] * self._modulus
            load = whole * xp.sum(xp.maximum(depths, 0 * depths), axis=-1)
        rows, columns = (
            _interpolate(n, self.grid.per_texel, margin)
            for n, margin in zip((array.rows, array.columns), self.grid.margin, strict=True)
        )
        image = xp.reshape(depths, (*shape[:-1], array.rows, array.columns))
        image = convert(rows, depths) @ image @ convert(columns.T.copy(), depths)
        return self.forces(xp.where(image == 0, float("inf"), -image), load, None, iterations)

    def base_forces(self, cell_forces: Array) -> Array:
        """Compute the forces on n texels at the base of the cover, shape (..., n) [N].

        Args:
            cell_forces: Force on each cell at the top of the cover, shape (..., rows, columns) [N].
        """
        xp, worlds = find_namespace(cell_forces), tuple(cell_forces.shape[:-2])
        along, across = convert(self._along, cell_forces), convert(self._across, cell_forces)
        if self._tabulated:
            images = xp.reshape(cell_forces, (*worlds, along.shape[1])) @ along.T
        else:
            images = xp.reshape(along @ cell_forces, (*worlds, self._array.rows, across.shape[0])) @ across
        return xp.reshape(images, (*worlds, self._array.count)) * convert(self._active, cell_forces)

    def _conclude(self, cells: Array, load: Array) -> ContactForces:
        """Add forces on texels, and warn once where a contact reaches the end of the grid."""
        xp = find_namespace(cells)
        at_end = xp.sum(cells * convert(self._rim, cells), axis=(-2, -1)) / xp.where(load > 0, load, 1.0)
        if not self._told and is_known(at_end) and 0 not in at_end.shape and goes_on(most := float(xp.max(at_end))):
            warn_user(f"array {self._array.name!r}: {describe_end(most)}", RangeWarning)
            self._told = True
        return ContactForces(cells, self.base_forces(cells), load, at_end)

    def _press(self, gap: Array, target: Array, fine: int, steps: int) -> Array:
        """Compute the forces on whole cells under gaps and targets that are forces, shape (worlds, rows, columns)."""
        xp, partly = find_namespace(gap), list[Array]()
        if fine > 1:
            gap, *partly = self._average(gap, fine)

        build = functools.partial(self._build, steps)
        forces = differentiate(xp, build, steps)(xp.reshape(gap, (-1, len(self._basis) - 3)), target, *partly)
        return build(target, *partly).place(forces)

    def _average(self, gap: Array, fine: int) -> tuple[Array, Array, Array]:
        """Average a gap at fine x fine points of each cell over the points under the body.

        Returns:
            Gap of the cells, shape (worlds, rows, columns) [N]; share of each cell under the body, 1 without body; and
            x and y of the centroid of this share from the cell's centre over the edges, shape (worlds, 2, ...) [-].
        """
        xp, rows, columns = find_namespace(gap), self.grid.rows, self.grid.columns
        points = xp.reshape(gap, (-1, rows, fine, columns, fine))
        under = cast(xp, points != float("inf"), gap.dtype)
        hits, steps = xp.sum(under, axis=(2, 4)), convert((np.arange(fine) + 0.5) / fine - 0.5, gap)
        most = xp.maximum(hits, 0 * hits + 1)
        mean = xp.sum(xp.where(under > 0, points, 0 * under), axis=(2, 4)) / most
        away = xp.stack([xp.sum(under * each, axis=(2, 4)) for each in (steps, steps[:, None, None])], axis=1)
        # forces at the rim of the grid are not moved outwards
        bounds = 0.5 * np.ones((2, rows, columns))
        bounds[0, :, -1] = bounds[1, -1, :] = 0
        high, low = convert(bounds, gap), -convert(bounds[:, ::-1, ::-1].copy(), gap)
        away = xp.minimum(xp.maximum(away / most[:, None, ...], low), high)
        return xp.where(hits > 0, mean, float("inf")), xp.where(hits > 0, hits / fine**2, 0 * hits + 1), away

    def _build(self, steps: int, target: Array, share: Array | None = None, away: Array | None = None) -> Problem:
        """Build the contact problem; `share` and `away` describe partly covered cells, see `_average`."""
        xp, count, cells = find_namespace(target), target.shape[1], len(self._basis) - 3
        basis = convert(self._basis[: cells + count, :count], target)
        spring = self._modulus * self._lever**2 * self._own
        stiffness = convert(np.repeat([spring, spring / TILT], [cells, count]), target)
        split, own = {}, None
        if share is not None and away is not None:
            size, worlds = xp.abs(away), share.shape[0]
            near = convert(self._near, target)
            x, y = (2 * size[:, k, ...] * (1 - size[:, k, ...]) for k in (0, 1))
            given = (1 - x) * (1 - y) + x * (1 - y) * near[0, 1] + (1 - x) * y * near[1, 0] + x * y * near[1, 1]
            own = xp.reshape(1 - given + self._square * (share**-0.5 - 1), (worlds, cells))
            parts = {0: 1 - size, 1: xp.maximum(away, 0 * away), -1: xp.maximum(-away, 0 * away)}
            split = {(i, j): parts[i][:, 1, ...] * parts[j][:, 0, ...] for i in parts for j in parts}
            whole = xp.concat([xp.reshape(share, (worlds, cells)), 0 * target + 1], axis=1)
            stiffness = stiffness * whole
            if count > 1:
                shift = xp.reshape(away, (worlds, 2, cells)) * convert(self._edge[:, None] / self._lever, target)
                shift = xp.concat([xp.reshape(0 * share, (worlds, 1, cells)), shift], axis=1)
                nothing = 0 * target[:, :, None] * target[:, None, :]
                basis = basis + xp.concat([xp.permute_dims(shift, (0, 2, 1)), nothing], axis=1)
        return Problem(
            basis=basis,
            products=xp.reshape(basis[..., :, None] * basis[..., None, :], (*basis.shape[:-1], count**2)),
            stiffness=stiffness,
            always=convert(np.append(np.zeros(cells), [0.0, 1.0, 1.0][:count]), target),
            tiny=convert(1e-30 * np.eye(count), target),
            shape=(self.grid.rows, self.grid.columns),
            padded=self._padded,
            spectrum=convert(self._spectrum, target) if steps else None,
            # the foundation takes the force on a partly covered cell for that on the whole cell, which is more accurate
            split=split if steps else {},
            own=own,
        )


def _check_values(name: str, values: Array, accepted: Array, wanted: str) -> None:
    """Check that the values of an argument are accepted, if they are known.

    Raises:
        FastModelError: If one is not accepted; the message names the first.
    """
    if is_known(values) and not bool(find_namespace(values).all(accepted)):
        first = np.argwhere(~np.asarray(accepted.tolist()))[0].tolist()
        raise FastModelError(f"{name}{first or ''} is {float(values[tuple(first)])}; give {wanted}")


def _add_at(index: Array, values: Array, size: int) -> Array:
    """Add rows of values (k, m) at indices (k,) of an array of zeros, shape (size, m); those at -1 are left out."""
    xp, index = find_namespace(values), index % (size + 1)
    whole = convert(np.zeros((size + 1, values.shape[1])), values)
    if xp is np:
        np.add.at(whole, index, values)
    elif hasattr(whole, "at"):  # JAX
        whole = whole.at[index].add(values)
    elif hasattr(whole, "index_add"):  # PyTorch
        whole = whole.index_add(0, index, values)
    else:
        whole = cast(xp, xp.arange(size + 1)[:, None] == index[None, :], values.dtype) @ values
    return whole[:size, :]


def _interpolate(texels: int, cells: int, margin: int) -> FloatArray:
    """Compute the weights of linear interpolation from centres of texels to those of cells, shape (cells, texels).

    Args:
        texels: Number of texels in a row.
        cells: Number of cells along a texel.
        margin: Number of cells beyond the texels on each side, where values are extrapolated.
    """
    from scipy.interpolate import make_interp_spline

    place = (np.arange(-margin, texels * cells + margin) + 0.5) / cells - 0.5
    return np.asarray(make_interp_spline(np.arange(texels), np.eye(texels), k=min(1, texels - 1))(place))


def _transform(kernel: FloatArray, shape: tuple[int, int]) -> tuple[FloatArray, tuple[int, int]]:
    """Compute the Fourier transform of a symmetric kernel, and the padded shape of images that it belongs to.

    Args:
        kernel: Values at distances of i rows and j columns, entry `[i, j]` [any unit].
        shape: Rows and columns of the images before they are padded with zeros.
    """
    from scipy.fft import next_fast_len

    kernel = kernel[: shape[0], : shape[1]]
    rows, columns = (next_fast_len(n + reach - 1, real=True) for n, reach in zip(shape, kernel.shape, strict=True))
    i, j = (np.minimum(np.arange(n), n - np.arange(n)) for n in (rows, columns))
    whole = np.pad(kernel, ((0, rows), (0, columns)))[np.ix_(i, j)]
    return np.fft.rfft2(whole).real.copy(), (rows, columns)
