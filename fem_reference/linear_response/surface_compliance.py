"""Compute the compliance of the top of a laterally wide cover by finite elements in z and Fourier functions in x and y.

A surface pressure cos(k x) displaces an isotropic layered cover by (U(z) sin k x, W(z) cos k x) with mean pressure
P(z) cos k x.  For each wave number k, one small one-dimensional mixed problem is solved (quadratic U and W, linear P
that may jump where materials meet).  The surface displacement under any pressure distribution follows by
superposition.  Contacts of indenters at small strain are solved in this way.  The method is the semi-analytical
finite-element method, a discretisation that is independent of the axisymmetric elements.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0, j1

from fem_reference.elements.grading import growing_steps, layer_heights
from fem_reference.elements.line import Line, gauss_points, line_matrix
from meshes import Cover
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class SurfaceSettings:
    """Constants of the compliance table, and of the outer boundaries of meshes."""

    #: Product x of wave number and thickness of the top layer above which the layers below have no effect: exp(-2 x)
    #: is below 1e-11 [-].
    short_waves: float = 13.0
    #: Part of the largest wave number above which the effect of the layers below is faded out [-].  If the effect ended
    #: abruptly, the error of the elements at short waves would cause oscillations at all distances.
    fade: float = 0.8
    #: Number of quadratic elements through each layer [-].
    elements: int = 16
    #: Largest length of a panel of the integral over the wave number k, in half periods of J0(k reach) [-].
    panel_periods: float = 4.0
    #: Length of the first panel of the integral over the wave number k, at k = 0, times the cover thickness [-].
    first_panel: float = 0.25
    #: Largest length of a panel of the integral over the wave number k, over k, at larger k [-].
    panel_ratio: float = 0.3
    #: Smallest wave number times the reach of the table, where shear moves the cover along its base [-].  Longer waves
    #: move it as a whole.
    longest_wave: float = 1e-2
    #: Gauss points in each panel of the integral over the wave number [-].
    panel_points: int = 12
    #: Number of points of the table of compliance over distance, per thickness of the thinnest layer [-].
    table_points: int = 10
    #: Largest number of points of the table per thickness of the top layer [-].
    most_per_layer: int = 40
    #: Smallest number of points of the table to the reach [-].
    least_points: int = 200
    #: Ratio of neighbouring steps of the table far from the load [-].
    table_growth: float = 1.02
    #: Distance at which the displacement counts as zero, over the decay length or, if that is longer, the distance
    #: over which the stretch of a stiff layer decays [-].
    decay: float = 28.0
    #: Wave numbers per factor e at which the response is solved; others are interpolated [-].
    solved_waves: int = 30
    #: Distance between two cells, over the larger side of a cell, below which the half-space part of the displacement
    #: of one by the pressure on the other is integrated exactly [-].
    neighbours: float = 32.0
    #: Largest length of a panel of a quadrature over a cell, over the thickness of the top layer [-].
    panel: float = 0.6
    #: Size of a cell, over the thickness of the top layer, below which a quadrature of two points suffices [-].
    small_cell: float = 0.2
    #: Parts in which the compliance table is computed, to limit the memory of the Bessel functions [-].
    blocks: int = 8
    #: Coefficient of the decay length of the cover's response in the outer radius of axisymmetric meshes [-].
    reach: float = 12.0
    #: Distance of the outer boundary of three-dimensional meshes from the contact, over the decay length of the cover's
    #: response [-].
    solid_reach: float = 7.0
    #: Coefficient of the contact radius in the outer radius of axisymmetric meshes [-].
    reach_radii: float = 1.5
    #: Coefficient of the membrane length of a stiff top layer in the outer radius of axisymmetric meshes, where
    #: friction holds the top sideways [-].
    reach_in_plane: float = 4.0
    #: Outer radius of axisymmetric meshes on a sliding base, over the sum of decay length and contact radius [-].
    #: There the response decays only with the square of the distance.  The boundary changes forces by less than 0.005
    #: %.
    reach_sliding: float = 40.0
    #: Smallest outer radius of axisymmetric meshes for a stiff top layer, over the membrane length of this layer, which
    #: is the distance over which its stretch decays [-].  The boundary changes texel forces by 0.1 %.
    reach_membrane: float = 0.3
    #: Upper limit of the smallest outer radius for a stiff top layer, over the cover thickness [-].  With longer
    #: elements the factorisation fails.
    longest: float = 40.0


_SETTINGS = SurfaceSettings()


#: Number added to distances to avoid division by zero at the corners of a rectangle [m].
_TINY = 1e-300


@dataclass(frozen=True, kw_only=True)
class WaveResponse:
    """Response of a cover to the surface pressure cos(k x) at m wave numbers k.

    Attributes:
        compliance: Downward displacement of the top per pressure on the top, shape (m,) [m/Pa].
        base: Pressure on the base, from the reaction, per pressure on the top, shape (m,) [-].
        coupling: Factor of the displacement sin(k x) along x per pressure, and of the downward displacement cos(k x)
            per shear sin(k x) along x, shape (m,) [m/Pa].
        along: Displacement along x per shear along x, shape (m,) [m/Pa].
        across: Displacement along y per shear along y, shape (m,) [m/Pa].
        tilting: Pressure cos(k x) on the base per shear sin(k x) along x, over k, shape (m,) [m].
    """

    compliance: FloatArray
    base: FloatArray
    coupling: FloatArray
    along: FloatArray
    across: FloatArray
    tilting: FloatArray


def decay_length(cover: Cover) -> float:
    """Estimate the distance over which the response to a point load decays: thickness or bending length of layers [m].

    For each interface, the layers above are modelled as a plate of bending stiffness D = sum E t^3 / 12 (1 - nu^2) and
    the layers below as an elastic foundation of stiffness k with 1 / k = sum t / E (modulus E, thickness t).  The
    bending length is (D / k)^(1/4) (Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, section 57).
    """
    lengths = [cover.thickness]
    for split in range(1, len(cover.layers)):
        below, above = cover.layers[:split], cover.layers[split:]
        springs = 1 / sum(layer.thickness / layer.material.youngs_modulus for layer in below)
        plate = sum(
            layer.material.youngs_modulus * layer.thickness**3 / (12 * (1 - layer.material.poisson_ratio**2))
            for layer in above
        )
        lengths.append((plate / springs) ** 0.25)
    return max(lengths)


def spread_of_top(cover: Cover) -> float:
    """Estimate the distance over which the top layer spreads a load [m].

    It is the thickness of the layer, or the bending length of a plate of bending stiffness D if that is larger: on a
    half space (2 D (1 - nu^2) / E)^(1/3), on springs (D h / E)^(1/4), whichever is smaller, with the constants and the
    thickness h of the layer below (Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, sections 57, 61).
    """
    top = cover.layers[-1]
    if len(cover.layers) == 1:
        return top.thickness
    plate, below, height = top.material, cover.layers[-2].material, cover.layers[-2].thickness
    stiffness = plate.youngs_modulus * top.thickness**3 / (12 * (1 - plate.poisson_ratio**2))
    yielding = stiffness / below.youngs_modulus
    half_space = (2 * yielding * (1 - below.poisson_ratio**2)) ** (1 / 3)
    return max(top.thickness, float(min(half_space, (yielding * height) ** 0.25)))


def membrane_length(cover: Cover) -> float:
    """Compute the distance in the plane of the cover over which the stretch of a stiff top decays; 0 for one layer [m].

    For each interface, the layers above are a membrane of stiffness sum E t / (1 - nu^2), and the layers below are a
    shear foundation of stiffness 1 / sum (t / mu).  The displacement in the plane decays over the square root of the
    ratio of the two (shear lag; Cox, British Journal of Applied Physics 3, 1952).
    """
    lengths = [0.0]
    for split in range(1, len(cover.layers)):
        below, above = cover.layers[:split], cover.layers[split:]
        yielding = sum(layer.thickness / layer.material.shear_modulus for layer in below)
        membrane = sum(
            layer.material.youngs_modulus * layer.thickness / (1 - layer.material.poisson_ratio**2) for layer in above
        )
        lengths.append((membrane * yielding) ** 0.5)
    return max(lengths)


def solve_waves(cover: Cover, wave_number: FloatArray, *, elements_per_layer: int = _SETTINGS.elements) -> WaveResponse:
    """Solve the one-dimensional problem through the thickness of a cover for every wave number.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        wave_number: Wave numbers k > 0, shape (m,) [1/m].
        elements_per_layer: Number of quadratic elements through each layer [-].
    """
    constant, linear, square = _assemble(cover, elements_per_layer)
    nodes = 2 * elements_per_layer * len(cover.layers) + 1
    # Indices of U and W at the base, and of U and W at the top.
    base, top = np.array([0, nodes]), np.array([nodes - 1, 2 * nodes - 1])
    constrained = base if cover.base == "bonded" else base[1:]
    free = np.setdiff1d(np.arange(len(constant)), constrained)
    load = np.zeros((len(free), 2))
    load[np.searchsorted(free, top), [0, 1]] = [1.0, -1.0]
    # The displacement along y has the shear stiffness of U over z and that of W over x.
    held = slice(int(cover.base == "bonded"), nodes)
    bend, shear = constant[held, held], square[nodes:, nodes:][held, held]
    out = np.empty((6, len(wave_number)))
    for i, k in enumerate(wave_number):
        matrix = constant + k * linear + k**2 * square
        solution = np.linalg.solve(matrix[np.ix_(free, free)], load)
        (along, coupling), (_, compliance) = load.T @ solution
        across = np.linalg.solve(bend + k**2 * shear, np.eye(len(bend))[-1])[-1]
        tilting, below = matrix[base[1], free] @ solution
        out[:, i] = compliance, below, coupling, along, across, tilting / k
    return WaveResponse(compliance=out[0], base=out[1], coupling=out[2], along=out[3], across=out[4], tilting=out[5])


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceCompliance:
    """Displacement of the top of a wide cover due to a normal load on the top, over the distance from the load.

    The displacement is that of a half space of the top layer's material (closed form, singular) plus a regular part due
    to the finite thickness and the other layers, tabulated from a finite-element solution.

    Attributes:
        half_space: (1 - nu) / (2 pi mu) of the top layer; displacement of the half space per force, times the distance
            from a point load [m2/N].
        regular: Regular part of the displacement per force as a function of the distance [m/N].
        reach: Largest distance of the table [m].  Where it is `decayed`, the displacement beyond is zero.
        decayed: Whether the displacement has decayed to zero at `reach`.
        scale: Distance over which the regular part varies, the thickness of the top layer [m].
        thickness: Thickness of the cover [m].
        bending: Distance over which the top layer spreads a load, see `spread_of_top` [m].
    """

    half_space: float
    regular: CubicSpline
    reach: float
    decayed: bool
    scale: float
    thickness: float
    bending: float

    def of_rectangle(self, x: FloatArray, y: FloatArray, width: float, height: float) -> FloatArray:
        """Compute the downward displacement at (x, y) per pressure on a small rectangle around the origin [m/Pa].

        The half-space part is exact (Love 1929; Johnson, Contact Mechanics, 1985, eq. 3.25).  The regular part is
        averaged over the rectangle by Gauss quadrature.

        Args:
            x: x coordinates of the points, any shape [m].
            y: y coordinates of the points, same shape [m].
            width: Size of the rectangle along x [m].
            height: Size of the rectangle along y [m].
        """
        near = self.half_space * _integrate_distance(x, y, width / 2, height / 2)
        rules = [_cut_uniform(size, self.scale) for size in (width, height)]
        return near + width * height * self._average_regular(x, y, rules)

    def average_over_cells(self, x: FloatArray, y: FloatArray, width: float, height: float) -> FloatArray:
        """Compute the mean displacement of a cell per uniform pressure on an equal cell around the origin [m/Pa].

        The half-space part is exact for neighbouring cells and expanded to second order in the cell size, with relative
        error below 1e-4, for distant ones.  The regular part is averaged over both cells by Gauss quadrature.

        Args:
            x: x coordinates of the middle of the displaced cell, any shape [m].
            y: y coordinates of the middle of the displaced cell, same shape [m].
            width: Size of both cells along x [m].
            height: Size of both cells along y [m].
        """
        out = np.zeros(np.shape(x))
        beside = np.hypot(np.maximum(np.abs(x) - width, 0), np.maximum(np.abs(y) - height, 0))
        within = beside < self.reach if self.decayed else np.ones_like(out, dtype=bool)
        x, y = x[within], y[within]
        distance = np.maximum(np.hypot(x, y), min(width, height))
        spread = (width**2 * (3 * (x / distance) ** 2 - 1) + height**2 * (3 * (y / distance) ** 2 - 1)) / 12
        value = width * height / distance * (1 + spread / distance**2)
        near = distance < _SETTINGS.neighbours * max(width, height)
        value[near] = _integrate_twice(x[near], y[near], width, height) / (width * height)
        rules = [cut_triangular(size, self.scale) for size in (width, height)]
        out[within] = self.half_space * value + width * height * self._average_regular(x, y, rules)
        return out

    def _average_regular(self, x: FloatArray, y: FloatArray, rules: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
        """Average the regular part over offsets from the points (x, y), with a quadrature rule along each axis."""
        out = np.zeros(np.shape(x))
        for move, share in zip(*rules[0], strict=True):
            for rise, part in zip(*rules[1], strict=True):
                distance = np.hypot(x + move, y + rise)
                value = self.regular(np.minimum(distance, self.reach))
                # Beyond the reach the displacement is zero, so that the regular part cancels that of the half space.
                if self.decayed:
                    beyond = -self.half_space / np.maximum(distance, self.reach)
                    value = np.where(distance < self.reach, value, beyond)
                out += share * part * value
        return out


def surface_compliance(
    cover: Cover, reach: float, *, elements_per_layer: int = _SETTINGS.elements
) -> SurfaceCompliance:
    """Tabulate the compliance of the top of a wide cover over the distance from a point load.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        reach: Largest distance of interest [m].  The table ends where the displacement has decayed, if that is nearer.
        elements_per_layer: Number of quadratic elements through each layer [-].
    """
    top, waves = cover.layers[-1], Waves(cover, reach, elements_per_layer)
    half_space = (1 - top.material.poisson_ratio) / top.material.shear_modulus  # Johnson 1985, eq. 2.61
    return SurfaceCompliance(
        half_space=half_space / (2 * np.pi),
        regular=waves.invert("compliance", half_space),
        reach=waves.reach,
        decayed=waves.decayed,
        scale=top.thickness,
        thickness=cover.thickness,
        bending=spread_of_top(cover),
    )


class Waves:
    """Responses of a cover to waves, and their inverse Hankel transforms.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        reach: Largest distance of interest [m].
        elements_per_layer: Number of quadratic elements through each layer [-].
        floats: Whether shear moves the cover along its base, so that the displacement does not decay.

    Attributes:
        reach: Largest distance of the tables [m].
        decayed: Whether the displacement has decayed to zero at `reach`.
    """

    def __init__(
        self, cover: Cover, reach: float, elements_per_layer: int = _SETTINGS.elements, *, floats: bool = False
    ) -> None:
        farthest = np.inf if floats else _SETTINGS.decay * max(decay_length(cover), membrane_length(cover))
        self.decayed, self.reach = reach >= farthest, min(reach, farthest)
        k, weight = _wave_numbers(cover, self.reach, _SETTINGS.longest_wave if floats else 0.0)
        # The compliance times the wave number is smooth over the logarithm of the wave number, and constant for a half
        # space, so that it is solved at few wave numbers and interpolated.
        first, last = np.log(k[[0, -1]])
        count = int(np.ceil(_SETTINGS.solved_waves * (last - first))) + 1
        self._solved = np.exp(np.linspace(first, last, count)) if count < len(k) else k
        self._response = solve_waves(cover, self._solved, elements_per_layer=elements_per_layer)
        fade = np.cos(np.pi / 2 * np.clip((k / k[-1] - _SETTINGS.fade) / (1 - _SETTINGS.fade), 0, 1)) ** 2
        self._k, self._weight = k, fade * weight / (2 * np.pi)
        thin, top = min(layer.thickness for layer in cover.layers), cover.layers[-1].thickness
        step = min(
            max(thin / _SETTINGS.table_points, top / _SETTINGS.most_per_layer), self.reach / _SETTINGS.least_points
        )
        growing = growing_steps(
            step,
            self.reach,
            lambda each: max(step, min(_SETTINGS.table_growth * each, self.reach / _SETTINGS.least_points)),
        )
        radius = np.append(0.0, np.cumsum(growing))
        self._radius = radius * (self.reach / radius[-1])

    def invert(self, name: str, half_space: float, bessel: Callable[[FloatArray], FloatArray] = j0) -> CubicSpline:
        """Tabulate the transform of a response less that of the half space, over the distance.

        Args:
            name: Attribute of `WaveResponse`.
            half_space: Response of the half space times the wave number.
            bessel: Kernel of the transform, a function of wave number times distance.
        """
        scaled = CubicSpline(np.log(self._solved), self._solved * getattr(self._response, name))(np.log(self._k))
        excess = (scaled - half_space) * self._weight
        blocks = np.array_split(self._radius, _SETTINGS.blocks)
        table = np.concatenate([bessel(np.outer(block, self._k)) @ excess for block in blocks])
        # Kernels of odd order have a slope at 0, and the others none.
        start: Literal["not-a-knot", "clamped"] = "not-a-knot" if bessel is j1 else "clamped"
        return CubicSpline(self._radius, table, bc_type=(start, "not-a-knot"))


def _wave_numbers(cover: Cover, reach: float, least: float) -> tuple[FloatArray, FloatArray]:
    """Compute Gauss points and weights in the wave number k for integrals that contain J0(k r) with r up to `reach`.

    The integrals begin at `least` over the reach; if it is not 0, a part of the integrand grows with 1 / k.

    Returns:
        Points and weights, shape (m,) each [1/m].
    """
    end = _SETTINGS.short_waves / cover.layers[-1].thickness
    longest = np.pi / reach * _SETTINGS.panel_periods
    edges, first = [least / reach], 0.0 if least else _SETTINGS.first_panel / cover.thickness
    while edges[-1] < end:
        edges.append(edges[-1] + min(longest, max(first, _SETTINGS.panel_ratio * edges[-1])))
    return gauss_points(np.array(edges), _SETTINGS.panel_points)


def _assemble(cover: Cover, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Assemble the matrices of k^0, k^1 and k^2 of the problem through the thickness of a cover.

    The energy density per wave is mu (2 exx^2 + 2 ezz^2 + gxz^2 - 2/3 div^2) / 2 - p div - p^2 / 2K with exx = k U,
    ezz = W', gxz = U' - k W, div = k U + W'.

    Returns:
        Matrices over the nodal values of U, then W, then P, with n values in all, shape (n, n) each.
    """
    layers = cover.layers
    edges, layer = layer_heights([each.thickness for each in layers], [count] * len(layers))
    u = Line(edges=edges, order=2)
    p = Line(edges=edges, order=1, jumps=tuple(range(count, len(layer), count)))
    mu = np.array([each.material.shear_modulus for each in layers])[layer]
    bulk_compliance = np.array([1 / each.material.bulk_modulus for each in layers])[layer]
    mass, stiffness, mixed = (line_matrix(u, u, each, mu).toarray() for each in ((0, 0), (1, 1), (1, 0)))
    value, slope = (line_matrix(u, p, each).toarray() for each in ((0, 0), (1, 0)))
    volume = line_matrix(p, p, weight=bulk_compliance).toarray()
    shear = mixed + 2 / 3 * mixed.T
    zero, empty = np.zeros_like(mass), np.zeros_like(value)
    constant = [[stiffness, zero, empty], [zero, 4 / 3 * stiffness, -slope], [empty.T, -slope.T, -volume]]
    linear = [[zero, -shear, -value], [-shear.T, zero, empty], [-value.T, empty.T, 0 * volume]]
    square = [[4 / 3 * mass, zero, empty], [zero, mass, empty], [empty.T, empty.T, 0 * volume]]
    return np.block(constant), np.block(linear), np.block(square)


def _integrate_distance(x: FloatArray, y: FloatArray, a: float, b: float) -> FloatArray:
    """Integrate 1 / distance from (x, y) over the rectangle with half sides a and b around the origin [m]."""

    def antiderivative(u: FloatArray, v: FloatArray) -> FloatArray:
        """Evaluate the antiderivative of 1 / sqrt(u^2 + v^2) with respect to u and v [m]."""
        return u * np.arcsinh(v / (np.abs(u) + _TINY)) + v * np.arcsinh(u / (np.abs(v) + _TINY))

    return (
        antiderivative(x + a, y + b)
        - antiderivative(x - a, y + b)
        - antiderivative(x + a, y - b)
        + antiderivative(x - a, y - b)
    )


def _integrate_twice(x: FloatArray, y: FloatArray, width: float, height: float) -> FloatArray:
    """Integrate 1 / distance over all pairs of points of two equal rectangles whose middles are (x, y) apart [m3]."""

    def antiderivative(u: FloatArray, v: FloatArray) -> FloatArray:
        """Evaluate the function whose fourth derivative is 1 / distance; it is even in u and in v [m3]."""
        u, v = np.abs(u) + _TINY, np.abs(v) + _TINY
        distance = np.hypot(u, v)
        return (u**2 * v * np.arcsinh(v / u) + v**2 * u * np.arcsinh(u / v)) / 2 - distance**3 / 6

    return difference_twice(antiderivative, x, y, width, height)


def difference_twice(
    antiderivative: Callable[[FloatArray, FloatArray], FloatArray],
    x: FloatArray,
    y: FloatArray,
    width: float,
    height: float,
) -> FloatArray:
    """Integrate a function over all pairs of points of two equal rectangles whose middles are (x, y) apart.

    The integral is the second difference along x and y of the antiderivative, whose fourth derivative, twice along x
    and twice along y, is the function.
    """
    out = np.zeros_like(x)
    for i, a in ((-1, 1), (0, -2), (1, 1)):
        for j, b in ((-1, 1), (0, -2), (1, 1)):
            out += a * b * antiderivative(x + i * width, y + j * height)
    return out


def _cut_uniform(size: float, scale: float) -> tuple[FloatArray, FloatArray]:
    """Return points and weights of a quadrature for the mean over an interval around 0; the weights sum to 1.

    Args:
        size: Length of the interval [m].
        scale: Distance over which the integrand varies [m].
    """
    points, weights = gauss_points(
        np.linspace(-size / 2, size / 2, int(np.ceil(size / scale / _SETTINGS.panel)) + 1), 2
    )
    return points, weights / size


def cut_triangular(size: float, scale: float) -> tuple[FloatArray, FloatArray]:
    """Return points and weights of a quadrature for the mean over all pairs of points of two equal intervals.

    The integrand depends on the difference of the two positions.  If both positions are distributed evenly, their
    difference has a triangular distribution.

    Args:
        size: Length of each interval [m].
        scale: Distance over which the integrand varies [m].
    """
    # Two points integrate polynomials up to degree 3 exactly.
    if size < _SETTINGS.small_cell * scale:
        return size / np.sqrt(6) * np.array([-1.0, 1.0]), np.array([0.5, 0.5])
    half = np.linspace(0, size, int(np.ceil(size / scale / _SETTINGS.panel)) + 1)
    points, weights = gauss_points(half, 3)
    weights = weights * (1 - points / size) / size
    return np.concatenate([-points, points]), np.concatenate([weights, weights])


def choose_linear_reach(cover: Cover, contact_radius: float) -> float:
    """Choose the radius of an axisymmetric mesh for linear solutions, where a stiff top layer does not stretch [m].

    Args:
        cover: Laterally wide cover.
        contact_radius: Estimated radius of the largest contact [m].
    """
    decay = decay_length(cover)
    if cover.base == "sliding":
        return _SETTINGS.reach_sliding * (decay + contact_radius)
    return _SETTINGS.reach * decay + _SETTINGS.reach_radii * contact_radius


def choose_friction_reach(cover: Cover, contact_radius: float) -> float:
    """Choose the radius of an axisymmetric mesh for linear solutions with shear tractions on the top [m].

    Args:
        cover: Laterally wide cover.
        contact_radius: Estimated radius of the largest contact [m].
    """
    stretch = _SETTINGS.reach_in_plane * membrane_length(cover) + _SETTINGS.reach_radii * contact_radius
    return max(choose_linear_reach(cover, contact_radius), stretch)


def choose_reach(cover: Cover, contact_radius: float) -> float:
    """Choose the radius of an axisymmetric mesh at finite strain, where a stiff top layer also stretches [m].

    Args:
        cover: Laterally wide cover.
        contact_radius: Estimated radius of the largest contact [m].
    """
    stretch = min(_SETTINGS.reach_membrane * membrane_length(cover), _SETTINGS.longest * cover.thickness)
    return max(choose_linear_reach(cover, contact_radius), stretch)


def choose_solid_reach(cover: Cover) -> float:
    """Choose the distance from the contact to the outer boundary of a mesh in three dimensions [m]."""
    return (_SETTINGS.reach_sliding if cover.base == "sliding" else _SETTINGS.solid_reach) * decay_length(cover)


def warn_of_boundary(cover: Cover) -> tuple[str, ...]:
    """Return a warning if a stiff top layer is stretched beyond the outer boundary of the meshes; else nothing."""
    wanted = _SETTINGS.reach_membrane * membrane_length(cover)
    if wanted <= max(_SETTINGS.longest * cover.thickness, _SETTINGS.reach * decay_length(cover)):
        return ()
    sentence = (
        f"the stiff top reaches {wanted * 1e3:.3g} mm in its plane, beyond the fixed outer boundary of the mesh: the "
        "cover is stiffer than a wide one, which no error estimate contains"
    )
    return (sentence,)
