"""The spread of a flat cover in the forms that the fast model uses: a fitted Gaussian kernel, and tables of cells.

Finite elements give the response of the texels to loads on the cover (`Influence`).  A Gaussian kernel is fitted to it.
The two-point resolution of the kernel and the change of its width with thickness and Poisson ratio are computed too.
The contact method `cover` divides each texel into small cells.  The response of a laterally wide cover is the same
everywhere, so that two kernels describe it.  The compliance is the displacement of the cover's top around a loaded
cell.  The influence is the force on a texel per unit force on a cell.  Near free side edges the influence depends on
the position, and is a table with one entry per cell and texel.  The compliance is still that of the wide cover, which
is stiffer than the real cover near its sides.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from fastmodel.fitting.gaussian import Fit, fit_gaussian
from fastmodel.surface import CoverCells
from meshes import Cover, TexelArray
from meshes.array_types import FloatArray

if TYPE_CHECKING:
    from fem_reference.linear_response.finite_cover import SolidInfluence
    from fem_reference.linear_response.point_spread import PointSpread
    from fem_reference.linear_response.surface_compliance import SurfaceCompliance

#: Finite-element response of the texels to loads on the cover.  For a wide cover it is one radial profile.  For a cover
#: with free side edges it is a separate solution for each texel.
Influence: TypeAlias = "PointSpread | SolidInfluence"

#: Number of rows and of columns of the grid for the fit of the kernel, if the texels of the array do not form a regular
#: grid [-].  It is larger than any kernel.
_GRID_SIZE = 15


def radial_profile(influence: Influence) -> PointSpread | None:
    """Return the response of a wide cover as a radial profile; None for a cover with free side edges."""
    from fem_reference.linear_response.point_spread import PointSpread

    return influence if isinstance(influence, PointSpread) else None


def fit_kernel(influence: Influence, array: TexelArray) -> Fit:
    """Fit the Gaussian spread kernel to the forces on texels under uniform pressure over the middle texel.

    Args:
        influence: Finite-element response of the texels to loads on the cover.
        array: Texels of the sensor.  If they do not form a regular grid, the fit uses a grid of the same pitch.
    """
    grid = fitting_grid(array)
    profile = radial_profile(influence)
    return fit_gaussian(
        _middle_response(influence, grid, "uniform"),
        (grid.rows // 2, grid.columns // 2),
        active=grid.image(grid.active),
        point_response=_middle_response(influence, grid, "point"),
        radius=None if profile is None else profile.radius,
        pressure_per_force=None if profile is None else profile.pressure_per_force,
        pitch=grid.pitch,
    )


def uncut_sigma(influence: Influence, grid: TexelArray) -> float:
    """Fit a Gaussian that is not truncated at a kernel width, and return its standard deviation along x [pitches].

    This sigma is a smooth function of the cover's thickness and materials.  The sigma of the truncated kernel is not,
    because it changes discontinuously with the kernel's width `ksize`, a number of texels.

    Args:
        influence: Finite-element response of the texels to loads on the cover.
        grid: Texels on a regular grid.
    """
    return fit_kernel(influence, grid).estimates["least-squares-uniform-uncut"][0]


def fitting_grid(array: TexelArray) -> TexelArray:
    """Return the array itself if its texels form a regular grid, else a grid with the array's pitch and texel size."""
    if array.regular:
        return array
    return TexelArray.grid(_GRID_SIZE, _GRID_SIZE, array.pitch, texel_size=array.texel_size)


def _middle_response(influence: Influence, grid: TexelArray, load: Literal["point", "uniform"]) -> FloatArray:
    """Return the forces on texels per unit force on the middle texel, as an image of shape (rows, columns) [-].

    Args:
        influence: Finite-element response of the texels to loads on the cover.
        grid: Texels on a regular grid.
        load: Whether the force acts at the texel's centre or as uniform pressure over the texel.
    """
    return np.asarray(grid.image(influence.texel_response(grid, load=load)), dtype=np.float64)


#: Smallest relative depth of a dip between two peaks, over the largest value, that counts as a dip [-].  It is above
#: errors of rounding and interpolation.
_SMALLEST_DIP = 1e-3


def two_point_separation(spread: PointSpread) -> float:
    """Compute the smallest distance of two equal point loads with a dip of pressure at the cover's base between them.

    Two unit loads at distance s cause the pressure 2 P(s/2) midway and P(0) + P(s) under each load, where P is the
    radial profile of pressure at the base under a unit point load.

    Args:
        spread: The point spread function of the cover.

    Returns:
        The distance; NaN if no distance up to half the profile's radius shows a dip [m].
    """
    radius, pressure = np.asarray(spread.radius), np.asarray(spread.pressure_per_force)
    separation = np.linspace(0, radius[-1] / 2, 4001)[1:]
    under_load = np.interp(0, radius, pressure) + np.interp(separation, radius, pressure)
    dip = under_load - 2 * np.interp(separation / 2, radius, pressure)
    resolved = np.flatnonzero(dip > _SMALLEST_DIP * pressure.max())
    return float(separation[resolved[0]]) if resolved.size else float("nan")


#: Force between two peaks, over the peaks, at which two equal points count as separated [-]: the Rayleigh criterion of
#: a circular aperture (M. Born and E. Wolf, Principles of Optics, 7th edition, section 8.6.2).
_RAYLEIGH = 0.735
#: Number of places of a texel within one pitch at which its force is computed [-].
_PLACES = 64
#: Largest tried distance of the two loads, over the pitch [-].
_FARTHEST = 12


def texel_separation(spread: PointSpread, array: TexelArray) -> float:
    """Compute the smallest distance of two equal point loads along x that one texel, moved between them, separates.

    The force on a texel is a continuous function of its place.  Midway between the loads it must fall to 73.5 % of
    the peaks, as intensity does by the Rayleigh criterion.  The distance contains the spread by the cover and the size
    of a texel, but not the sampling by the pitch: an image shows two peaks only if the loads are two pitches apart.

    Args:
        spread: The point spread function of the cover.
        array: The array, which gives pitch and texel size.

    Returns:
        The distance; NaN if the loads are not separated up to twelve pitches [m].
    """
    texel = TexelArray.grid(1, 1, array.pitch, texel_size=array.texel_size)
    step = array.pitch[0] / _PLACES
    places = step * np.arange(_FARTHEST * _PLACES + 1)
    force = np.asarray(spread.texel_influence(texel, np.column_stack([places, np.zeros(len(places))])))[:, 0]
    before = 1.0
    for half in range(1, len(places) // 2):
        peak = float(np.max(force[: half + 1] + force[2 * half - np.arange(half + 1)]))
        share = 2 * float(force[half]) / peak
        if share <= _RAYLEIGH:
            return 2 * step * (half - (_RAYLEIGH - share) / (before - share))
        before = share
    return float("nan")


#: Relative step of the cover's thickness in the central difference quotient [-].
_THICKNESS_STEP = 0.02
#: Absolute step of the Poisson ratio in the finite differences [-].
_POISSON_STEP = 0.005


def sigma_sensitivities(cover: Cover, array: TexelArray, spread: PointSpread) -> dict[str, float]:
    """Compute the derivatives of the Gaussian's sigma along x with respect to thickness and elastic constants.

    The Gaussian is the one that is not truncated at a kernel width.  The quantity changes in all layers together.

    Args:
        cover: A laterally wide cover.
        array: Texels of the sensor.
        spread: The point spread function of the cover.

    Returns:
        Derivatives with respect to `thickness` [pitches/m], `poisson_ratio` [pitches] and `youngs_modulus`
        [pitches/Pa].
    """
    grid = fitting_grid(array)
    return {
        "thickness": _thickness_slope(cover.thickness, grid, spread),
        "poisson_ratio": sum(_poisson_slope(cover, grid, spread, layer) for layer in range(len(cover.layers))),
        # Multiplying all moduli by a factor divides all displacements by this factor and does not change the forces.
        "youngs_modulus": 0.0,
    }


def _thickness_slope(thickness: float, grid: TexelArray, spread: PointSpread) -> float:
    """Return the derivative of the Gaussian's sigma with respect to the thickness of the cover [pitches/m].

    It is a central difference.  No other cover is solved: a cover scaled by a factor s over the array responds like the
    original cover over the array scaled by 1 / s.

    Args:
        thickness: Thickness of the cover [m].
        grid: Texels on a regular grid.
        spread: The point spread function of the cover.
    """
    thicker, thinner = (
        uncut_sigma(spread, _scaled_array(grid, 1 / (1 + step))) for step in (_THICKNESS_STEP, -_THICKNESS_STEP)
    )
    return (thicker - thinner) / (2 * _THICKNESS_STEP * thickness)


def sigma_range(cover: Cover, array: TexelArray, spread: PointSpread) -> tuple[float, float] | None:
    """Compute the range of the Gaussian's sigma along x over the ranges of the layers' elastic constants.

    Each Young's modulus and each Poisson ratio moves alone to both ends of its range.  The changes count as independent
    of each other: the root of the sum of their squares, upwards and downwards apart.

    Args:
        cover: A laterally wide cover.
        array: Texels of the sensor.
        spread: The point spread function of the cover.

    Returns:
        Lower and upper end over the sigma of the cover itself [-]; None if no layer states a range.
    """
    grid = fitting_grid(array)
    own, below, above, stated = _sigma_of(cover, grid, spread), 0.0, 0.0, False
    for place, material in enumerate(layer.material for layer in cover.layers):
        modulus, ratio, wide = material.youngs_modulus, material.poisson_ratio, material.poisson_spread
        ratios = [min(0.5, max(0.0, ratio + sign * wide)) for sign in (-1, 1)]
        for ends in ([(end, ratio) for end in material.modulus_range], [(modulus, end) for end in ratios]):
            if ends[0] == ends[1]:
                continue
            stated = True
            changes = [_sigma_of(_with_constants(cover, place, *end), grid, spread) / own - 1 for end in ends]
            below, above = math.hypot(below, min(0.0, *changes)), math.hypot(above, max(0.0, *changes))
    return (1 - below, 1 + above) if stated else None


def _sigma_of(cover: Cover, grid: TexelArray, spread: PointSpread) -> float:
    """Return sigma [pitches] of a cover by the closed-form layer solution at the radii of a point spread function.

    A finite-element solution of each changed cover would multiply the computing time.
    """
    from fem_reference.closed_form import point_response

    response = point_response(cover, spread.radius)
    return uncut_sigma(dataclasses.replace(spread, pressure_per_force=response, coarse=()), grid)


def _with_constants(cover: Cover, place: int, modulus: float, ratio: float) -> Cover:
    """Return a copy of the cover with other elastic constants [Pa, -] in one layer, at small strain."""
    layers = list(cover.layers)
    material = dataclasses.replace(
        layers[place].material, model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=ratio
    )
    layers[place] = dataclasses.replace(layers[place], material=material)
    return dataclasses.replace(cover, layers=tuple(layers))


def _poisson_slope(cover: Cover, grid: TexelArray, spread: PointSpread, layer: int) -> float:
    """Return the derivative of the Gaussian's sigma with respect to the Poisson ratio of one layer [pitches].

    It is the slope of the parabola through the sigmas at three Poisson ratios inside 0..0.5.

    Args:
        cover: A laterally wide cover.
        grid: Texels on a regular grid.
        spread: The point spread function of the cover.
        layer: Index of the layer, from the bottom.
    """
    modulus, ratio = cover.layers[layer].material.youngs_modulus, cover.layers[layer].material.poisson_ratio
    middle = float(np.clip(ratio, _POISSON_STEP, 0.5 - _POISSON_STEP))

    def sigma_at(poisson_ratio: float) -> float:
        return _sigma_of(_with_constants(cover, layer, modulus, poisson_ratio), grid, spread)

    low, high = sigma_at(middle - _POISSON_STEP), sigma_at(middle + _POISSON_STEP)
    slope = (high - low) / (2 * _POISSON_STEP)
    if ratio == middle:  # At the middle of an interval a parabola has the slope of its chord over the interval.
        return slope
    return slope + (ratio - middle) * (high - 2 * sigma_at(middle) + low) / _POISSON_STEP**2


def _scaled_array(array: TexelArray, factor: float) -> TexelArray:
    (width, height), (along_x, along_y) = (factor * np.array([array.texel_size, array.pitch])).tolist()
    return dataclasses.replace(
        array, centres=array.centres * factor, texel_size=(width, height), pitch=(along_x, along_y)
    )


def gauss_points(size: tuple[float, float], order: int) -> tuple[FloatArray, FloatArray]:
    """Return the points and weights of Gauss-Legendre quadrature over a rectangle centred on the origin.

    Args:
        size: Edge lengths of the rectangle along x and y [m].
        order: Number of points along each edge [-].

    Returns:
        Points, shape (order^2, 2) [m], and weights that sum to 1, shape (order^2,) [-]: the weighted sum of a
        function's values at the points is the mean of the function over the rectangle.
    """
    nodes, weights = np.polynomial.legendre.leggauss(order)
    x, y = np.meshgrid(nodes * size[0] / 2, nodes * size[1] / 2)
    return np.column_stack([x.ravel(), y.ravel()]), np.outer(weights, weights).ravel() / 4


#: Target edge length of a cell of the contact grid, over the thickness of the cover [-].
_CELL_SIZE = 0.45
#: Least and greatest number of cells of the contact grid along one pitch of the texels [-].
_CELLS_PER_PITCH = (4, 12)
#: Radius of the kernels, over the decay length of the cover's response [-].  At larger distances the response is
#: negligible.
_KERNEL_RADIUS = 8.0


def cover_cells(cover: Cover, array: TexelArray, spread: PointSpread, *, per_texel: int | None = None) -> CoverCells:
    """Tabulate the compliance and the influence of a wide cover between cells of the contact grid.

    Args:
        cover: A laterally wide cover, linearised at zero load.
        array: A flat array.  Pitch and texel size define the cells; rows and columns limit the radius of the kernels.
        spread: The point spread function of the cover.
        per_texel: Number of cells along one pitch; if None, it follows from the thickness of the cover [-].
    """
    from fem_reference.linear_response.surface_compliance import decay_length

    count = per_texel or int(np.clip(math.ceil(min(array.pitch) / (_CELL_SIZE * cover.thickness)), *_CELLS_PER_PITCH))
    cell = (array.pitch[0] / count, array.pitch[1] / count)
    reach = math.ceil(_KERNEL_RADIUS * decay_length(cover) / min(cell))
    reach = min(reach, (max(array.rows, array.columns) + 2) * count)
    surface = tabulate_surface(cover, reach, cell)
    return CoverCells(
        per_texel=count,
        cell=cell,
        compliance=compliance_kernel(surface, reach, cell),
        influence=influence_kernel(array, spread, count, reach),
        top_compliance=surface.half_space,
        thickness=cover.thickness,
        source="finite elements",
    )


def tabulate_surface(cover: Cover, reach: int, cell: tuple[float, float]) -> SurfaceCompliance:
    """Tabulate the compliance of the cover's top over all distances between cells up to `reach` cells apart."""
    from fem_reference.linear_response.surface_compliance import surface_compliance

    return surface_compliance(cover, (1.5 * reach + 1) * max(cell))


def compliance_kernel(surface: SurfaceCompliance, reach: int, cell: tuple[float, float]) -> FloatArray:
    """Compute the displacement of a cell's centre per uniform pressure on the cell i rows and j columns away.

    Returns:
        Displacements per pressure, shape (reach + 1, reach + 1) [m/Pa].
    """
    offsets = np.meshgrid(np.arange(reach + 1) * cell[0], np.arange(reach + 1) * cell[1])
    return surface.of_rectangle(offsets[0], offsets[1], *cell)


def cells_with_sides(cover: Cover, array: TexelArray, influence: PointSpread | SolidInfluence) -> CoverCells:
    """Tabulate the response of a cover with free side edges between the cells of the contact grid and the texels.

    The compliance is that of a wide cover of the same layers; the influence is a table by cell and texel.

    Args:
        cover: A cover with a size, hence with free side edges.
        array: Texels under the cover, flat and on a regular grid.
        influence: Finite-element response of the texels to loads anywhere on the cover.
    """
    from fem_reference.linear_response.axisymmetric import point_spread

    wide = dataclasses.replace(cover, size=None)
    cells = cover_cells(wide, array, point_spread(wide))
    rows, columns = array.rows * cells.per_texel, array.columns * cells.per_texel
    low = array.centres[:, :2].min(axis=0) - np.array(array.pitch) / 2
    x, y = np.meshgrid(*(low[i] + (np.arange(n) + 0.5) * cells.cell[i] for i, n in enumerate((columns, rows))))
    # Integration points that lie beside the cover are moved to the cover's edge.
    half = np.array(cover.size) / 2
    table = _mean_over_cells(
        lambda points: influence.texel_influence(array, np.clip(points, -half, half)), x, y, cells.cell
    )
    return dataclasses.replace(
        cells,
        table=table.T.reshape(array.count, rows, columns),
        source="finite elements; influence with free side edges, compliance of the wide cover",
    )


def influence_kernel(array: TexelArray, spread: PointSpread, count: int, reach: int) -> FloatArray:
    """Tabulate the force on one texel per unit force on each cell around the texel, spread uniformly over the cell.

    Args:
        array: The array, which gives the pitch and the size of the texel.
        spread: The point spread function of the cover.
        count: Number of cells along one pitch [-].
        reach: Number of cells beyond the texel's edges [-].

    Returns:
        Forces by row and column of the cell, a square array of edge 2 reach + count [-].
    """
    texel = TexelArray.grid(1, 1, array.pitch, texel_size=array.texel_size)
    cell = (array.pitch[0] / count, array.pitch[1] / count)
    index = np.arange(-reach, count + reach) + 0.5 - count / 2
    x, y = np.meshgrid(index * cell[0], index * cell[1])
    kernel = _mean_over_cells(lambda points: spread.texel_influence(texel, points), x, y, cell)
    return kernel.reshape(len(index), len(index))


def _mean_over_cells(
    influence: Callable[[FloatArray], FloatArray], x: FloatArray, y: FloatArray, cell: tuple[float, float]
) -> FloatArray:
    """Average the force on each of n texels over the position of a unit force within each cell.

    Args:
        influence: Function from m positions, shape (m, 2) [m], to the forces on texels under a unit point load at each
            position, shape (m, n) [-].
        x: x coordinates of the cells' centres, any shape [m].
        y: y coordinates of the cells' centres, same shape [m].
        cell: Edge lengths of a cell along x and y [m].

    Returns:
        Force on each texel per unit force spread uniformly over each cell, shape (cells, n) [-].
    """
    middles = np.column_stack([x.ravel(), y.ravel()])
    points, weights = gauss_points(cell, 3)
    return np.asarray(sum(w * influence(middles + point) for point, w in zip(points, weights, strict=True)))
