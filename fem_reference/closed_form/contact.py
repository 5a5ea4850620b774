"""Solve the contact of a rigid frictionless indenter of revolution with a layered cover, almost to machine precision.

The mixed boundary-value problem reduces to a Fredholm equation of the second kind (Lebedev and Ufliand 1958 for the
punch; Hayes, Keer, Herrmann and Mockros 1972 for punch and sphere).  The compliance of the cover's top is c L(k) / k,
where c = (1 - nu) / mu of the top layer.  The Hankel transform of the contact pressure is int_0^a phi(t) cos(k t) dt.
The equation is

    phi(x) + (2 / pi) int_0^a phi(t) M(x, t) dt = (2 / (pi c)) g(x),
    M(x, t) = (m(x - t) + m(x + t)) / 2,   m(s) = int_0^inf (L(k) - 1) cos(k s) dk,

where a is the radius of the contact and g(x) = depth - x int_0^x f'(r) / sqrt(x^2 - r^2) dr for a surface of height
f(r).  For the punch g is depth, for a sphere of radius R depth - x artanh(x / R), for a paraboloid of that radius depth
- x^2 / R, and for a cone depth - (pi / 2) x cot(angle / 2).  The force is 2 pi int_0^a phi(t) dt.  For all shapes but
the punch the condition phi(a) = 0 determines the depth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from scipy.fft import fht, fhtoffset
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline
from scipy.optimize import brentq
from scipy.special import j0

from fem_reference.closed_form.layer import half_space_compliance, hankel_nodes, place_gauss_points, transfer
from meshes import Cone, Cover, Cylinder, Indenter, RoundedTip, Sphere, TexelArray
from meshes.array_types import FloatArray


@dataclass(frozen=True, kw_only=True)
class ContactSettings:
    """Constants of the integral equation for the pressure between an indenter of revolution and a layered cover."""

    #: Smallest number of Gauss points of the integral equation [-].
    nodes: int = 96
    #: Gauss points of the integral equation per thickness of the top layer [-].
    nodes_per_layer: int = 8
    #: Largest number of Gauss points of the integral equation [-].
    most_nodes: int = 2400
    #: Number of Gauss points of a second solution over that of the first; their difference is the stated error [-].
    coarser: float = 0.75
    #: Relative error of the kernel m(s) [-].  The equation of a wide contact on an incompressible layer has it enlarged
    #: about (radius / thickness)^3 times.
    kernel: float = 3e-15
    #: Largest relative error of a solution that is returned [-].
    worst: float = 1e-3
    #: Largest contact radius over the thickness of the top layer [-].
    most_thicknesses: float = 400.0
    #: Largest contact radius over the radius of the indenter [-].  The value keeps the contact away from the vertical
    #: wall of a sphere.
    widest: float = 0.95
    #: Product of wave number and thickness of the top layer at which the integral for m(s) ends: exp(-2 x 25) = 2e-22
    #: [-].
    deep: float = 25.0
    #: Distance over the thickness of the top layer below which m(s) is integrated directly, and the number of panels of
    #: that integral [-].
    near: float = 1e-2
    near_panels: int = 64
    #: Number of concentric rings of the contact on which the force is checked to be compressive [-].
    rings: int = 48
    #: Largest tensile force on a ring of the contact, over the total force, that counts as rounding error [-].
    pull: float = 1e-7
    #: Gauss points along each side of a panel of a texel, in the integral of the base pressure over the texel [-].
    points: int = 8
    #: Panels along the side of a texel per cover thickness, in the integral of the base pressure over the texel [-].
    panels: int = 2


_SETTINGS = ContactSettings()

#: Number of wave numbers of the logarithmic grid on which Hankel transforms are computed (scipy's `fht`) [-].
LOGARITHMIC_POINTS = 8192
#: Natural logarithm of the largest wave number of a logarithmic grid over its middle wave number [-].
LOGARITHMIC_HALF_WIDTH = 20.0
#: Exponent of the wave number that weights the Hankel transform of the kernel towards small wave numbers [-].
_BIAS = 0.5


@dataclass(frozen=True, kw_only=True)
class LayerContact:
    """Solved axisymmetric contact of a rigid indenter with an elastic cover.

    Attributes:
        force: Normal force on the indenter [N].
        depth: Approach of the indenter from first touch [m].
        contact_radius: Radius of the contact area [m].
        error: Estimated relative error of force and depth at this contact radius; NaN if not known [-].
        cover: The cover that was pressed.
        phi: Points t, weights and values phi(t) of the solution, shape (3, n) [m, m, N/m].
    """

    force: float
    depth: float
    contact_radius: float
    error: float = np.nan
    cover: Cover
    phi: FloatArray = field(repr=False, compare=False)

    def force_within(self, radius: FloatArray) -> FloatArray:
        """Compute the contact force within distances r <= a from the axis, shape of `radius` [N].

        F(r) = 2 pi (int_0^a phi(t) dt - int_0^sqrt(a^2 - r^2) phi(sqrt(r^2 + s^2)) ds), because the pressure at r is
        phi(a) / sqrt(a^2 - r^2) - int_r^a phi'(t) / sqrt(t^2 - r^2) dt.
        """
        t, _, value = self.phi
        phi = CubicSpline(t, value)
        nodes, weights = np.polynomial.legendre.leggauss(len(t))
        half = np.sqrt(np.maximum(self.contact_radius**2 - radius[..., None] ** 2, 0.0)) / 2
        beyond = (phi(np.hypot(radius[..., None], half * (nodes + 1))) * weights * half).sum(axis=-1)
        return np.asarray(self.force - 2 * np.pi * beyond)

    def base_waves(self, k: FloatArray) -> FloatArray:
        """Compute the Hankel transform of order 0 of the pressure on the base at n wave numbers k, shape (n,) [N]."""
        t, dt, value = self.phi
        parts = np.array_split(k, len(k) * len(t) // 1_000_000 + 1)
        pressure = np.concatenate([np.cos(np.outer(part, t)) @ (dt * value) for part in parts])
        return np.asarray(transfer(self.cover, k).base * pressure)

    def base_pressure(self, reach: float) -> CubicSpline:
        """Tabulate the pressure on the base [Pa] over the distance from the indenter's axis, from 0 to `reach` [m]."""
        k, weight = hankel_nodes(self.cover, reach + self.contact_radius)
        density = self.base_waves(k) * (k * weight)
        finest = min(self.cover.thickness, max(self.contact_radius, self.cover.thickness / 4))
        r = np.linspace(0, reach, int(40 * reach / finest) + 40)
        pressure = np.concatenate([j0(np.outer(part, k)) @ density for part in np.array_split(r, len(r) // 256 + 1)])
        return CubicSpline(r, pressure, bc_type=("clamped", "not-a-knot"))

    def texel_forces(self, array: TexelArray, at: tuple[float, float] = (0.0, 0.0)) -> FloatArray:
        """Compute the forces on the n texels of an array, for the indenter above the point `at` of the array [N]."""
        return integrate_texels(array, at, self.base_pressure, self.cover.thickness)


def integrate_texels(
    array: TexelArray, at: tuple[float, float], base_pressure: Callable[[float], CubicSpline], thickness: float
) -> FloatArray:
    """Integrate an axisymmetric pressure on the base over the texels of an array.

    Args:
        array: Array with n texels.
        at: Position of the axis in the frame of the array [m].
        base_pressure: Function that tabulates the pressure [Pa] up to a distance from the axis [m].
        thickness: Thickness of the cover, to which the quadrature is fitted [m].

    Returns:
        Force on each texel; 0 on inactive texels, which measure nothing, shape (n,) [N].
    """
    half = np.array(array.texel_size) / 2
    centres = array.centres[:, :2] - at
    pressure = base_pressure(float(np.hypot(*(np.abs(centres).max(axis=0) + half))))
    points, weights = [], []
    for edge in half:
        panels = int(np.ceil(2 * edge / thickness * _SETTINGS.panels))
        nodes, weight = np.polynomial.legendre.leggauss(_SETTINGS.points)
        ends = np.linspace(-edge, edge, panels + 1)[:-1, None]
        points.append((ends + (nodes + 1) * edge / panels).ravel())
        weights.append(np.tile(weight * edge / panels, panels))
    out = [weights[0] @ pressure(np.hypot(x + points[0][:, None], y + points[1])) @ weights[1] for x, y in centres]
    return np.where(array.active, out, 0.0)


def punch(cover: Cover, radius: float, depth: float, *, nodes: int | None = None) -> LayerContact:
    """Press a flat-ended rigid cylinder into a laterally wide cover.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        radius: Radius of the cylinder [m].
        depth: Approach of the cylinder from first touch [m].
        nodes: Number of Gauss points of the integral equation; None to choose it from the thickness [-].

    Raises:
        ValueError: If the contact is wider than 400 thicknesses of the top layer, or not resolved within 0.1 %.
    """
    return _solve(cover, radius, np.zeros_like, depth, nodes=nodes)


def sphere(cover: Cover, radius: float, contact_radius: float) -> LayerContact:
    """Press a rigid sphere into a laterally wide cover until the contact has the given radius.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        radius: Radius R of the sphere [m].
        contact_radius: Radius of the contact area, less than `radius` [m].

    Raises:
        ValueError: If the contact is not smaller than the sphere, or as for `punch`.
    """
    if not 0 < contact_radius < radius:
        raise ValueError(f"the contact radius must lie in 0..{radius} m, not {contact_radius}")
    return _solve(cover, contact_radius, lambda t: t * np.arctanh(t / radius), nodes=None)


def indent(
    cover: Cover,
    indenter: Indenter,
    *,
    load: float | None = None,
    depth: float | None = None,
    nodes: int | None = None,
) -> LayerContact:
    """Press an indenter of revolution into a laterally wide cover.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        indenter: Sphere, rounded tip, cone or cylinder.
        load: Normal force on the indenter [N].  Give either `load` or `depth`.
        depth: Approach of the indenter from first touch [m].
        nodes: Number of Gauss points of the integral equation; None to choose it from the thickness [-].

    Raises:
        TypeError: If the indenter has another shape.
        ValueError: If not exactly one of load and depth is given, the contact reaches the rim of the indenter or is
            wider than 400 thicknesses of the top layer, it is not resolved within 0.1 %, or the contact pressure would
            be negative somewhere.
    """
    if (load is None) == (depth is None):
        raise ValueError("give either a load or a depth")
    if isinstance(indenter, Cylinder):
        wanted = depth or (load or 0.0) / punch(cover, indenter.radius, 1.0, nodes=nodes).force
        return _require_push(punch(cover, indenter.radius, wanted, nodes=nodes))
    if not isinstance(indenter, Sphere | RoundedTip | Cone):
        raise TypeError(f"no exact contact for {type(indenter).__name__}")

    def profile(t: FloatArray) -> FloatArray:
        if isinstance(indenter, Cone):
            return np.asarray(np.pi / 2 * t / np.tan(indenter.angle / 2))
        return np.asarray(t * np.arctanh(t / indenter.radius))

    def miss(logarithm: float) -> float:
        """Compute the logarithm of load or depth at a contact radius, over the wanted load or depth [-]."""
        a = float(np.exp(logarithm))
        found = _Equation(cover, a, nodes).solve(a, profile)
        ratio = found.force / load if load is not None else found.depth / (depth or 0.0)
        if not ratio > 0:
            raise ValueError(f"{nodes or 'these'} nodes do not resolve a contact of {a:.3g} m radius")
        return float(np.log(ratio))

    top = cover.layers[-1].thickness
    rim = _SETTINGS.widest * indenter.radius
    widest = rim if nodes is not None else min(rim, _SETTINGS.most_thicknesses * top)
    # The search starts from a contact as wide as the thickness of the top layer, because much wider contacts are not
    # resolved.
    bracket = _bracket_root(miss, float(np.log(min(top, widest))), float(np.log(widest)))
    if bracket is None:
        reason = f"the contact reaches the rim of the {type(indenter).__name__}"
        raise ValueError(reason if widest == rim else _describe_unresolved(cover))
    a = float(np.exp(brentq(miss, *bracket, rtol=1e-14)))
    return _require_push(_solve(cover, a, profile, nodes=nodes))


def _bracket_root(function: Callable[[float], float], start: float, largest: float) -> tuple[float, float] | None:
    """Bracket the root of a rising function of one variable by an interval of length one.

    Args:
        function: The function.
        start: Value at which the search starts.
        largest: Largest value that is tried.

    Returns:
        Lower and upper end of the interval; None if the root is above `largest`.
    """
    low = high = start
    while function(high) < 0:
        if high == largest:
            return None
        low, high = high, min(largest, high + 1.0)
    while low == high or function(low) > 0:
        low -= 1.0
    return low, high


def _require_push(contact: LayerContact) -> LayerContact:
    """Return a contact whose pressure is nowhere negative, or raise an error.

    Raises:
        ValueError: If the pressure would be negative somewhere, as under a wide punch on a stiff foil.
    """
    rings = contact.force_within(contact.contact_radius * np.linspace(0.0, 1.0, _SETTINGS.rings + 1))
    if (np.diff(rings) < -_SETTINGS.pull * contact.force).any():
        raise ValueError("the indenter would have to pull on a part of the contact, which separates instead")
    return contact


def _solve(
    cover: Cover,
    radius: float,
    profile: Callable[[FloatArray], FloatArray],
    depth: float | None = None,
    *,
    nodes: int | None,
) -> LayerContact:
    """Solve the integral equation, and once more with fewer Gauss points for the error; see `_Equation.solve`.

    Raises:
        ValueError: If the contact is not resolved.
    """
    fine = _Equation(cover, radius, nodes).solve(radius, profile, depth)
    coarse = _Equation(cover, radius, round(_SETTINGS.coarser * fine.phi.shape[1])).solve(radius, profile, depth)
    error = max(abs(coarse.force / fine.force - 1), abs(coarse.depth / fine.depth - 1)) + fine.error
    if not error < _SETTINGS.worst:
        count = fine.phi.shape[1]
        raise ValueError(f"{count} nodes do not resolve a contact of {radius:.3g} m radius: the error is {error:.2g}")
    return replace(fine, error=error)


class _Equation:
    """Fredholm equation of a contact of radius a, discretised by Gauss points.

    Args:
        cover: Cover; its layers have their linear elastic properties at zero load.
        radius: Radius a of the contact [m].
        nodes: Number of Gauss points; None to choose it from the thickness of the top layer [-].

    Raises:
        ValueError: If `nodes` is None and the contact is too wide for the largest number of points.
    """

    def __init__(self, cover: Cover, radius: float, nodes: int | None) -> None:
        if nodes is None:
            if radius > _SETTINGS.most_thicknesses * cover.layers[-1].thickness * (1 + 1e-12):
                raise ValueError(_describe_unresolved(cover))
            wanted = _SETTINGS.nodes_per_layer * radius / cover.layers[-1].thickness
            nodes = int(min(max(_SETTINGS.nodes, wanted), _SETTINGS.most_nodes))
        points, weights = np.polynomial.legendre.leggauss(nodes)
        material = cover.layers[-1].material
        self._cover = cover
        self._x, self._weight = radius * (points + 1) / 2, radius * weights / 2
        self._kernel = _tabulate_kernel(cover)
        self._kernel_error = _SETTINGS.kernel * float(np.abs(self._kernel[0].c).max())
        self._matrix = np.eye(nodes) + 2 / np.pi * self._evaluate(self._x) * self._weight
        self._scale = 2 / np.pi * material.shear_modulus / (1 - material.poisson_ratio)

    def solve(
        self, radius: float, profile: Callable[[FloatArray], FloatArray], depth: float | None = None
    ) -> LayerContact:
        """Solve the integral equation for an indenter of revolution.

        Args:
            radius: Radius a of the contact [m].
            profile: Function whose value at t is the depth minus the right-hand side g(t) of the equation [m].
            depth: Approach of the indenter [m]; None for the depth at which the pressure vanishes at the edge of the
                contact, phi(a) = 0.
        """
        x, weight = self._x, self._weight
        flat, curved = np.linalg.solve(self._matrix, np.column_stack([np.ones_like(x), profile(x)])).T
        if depth is None:
            edge = self._evaluate(np.array([radius]))[0] * weight * (2 / np.pi)
            # The condition phi(a) = 0 reads g(a) = (2 / pi) int phi(t) M(a, t) dt, with phi = depth * flat - curved.
            depth = float((profile(np.array([radius]))[0] - edge @ curved) / (1 - edge @ flat))
        phi = (depth * flat - curved) * self._scale
        return LayerContact(
            force=float(2 * np.pi * weight @ phi),
            depth=depth,
            contact_radius=radius,
            error=float(2 / np.pi * self._kernel_error * abs(weight @ flat)),
            cover=self._cover,
            phi=np.stack([x, weight, phi]),
        )

    def _evaluate(self, x: FloatArray) -> FloatArray:
        """Evaluate the kernel M(x, t) at the Gauss points t, shape (len(x), nodes) [1/m]."""
        spline, k, density = self._kernel
        smallest, largest = np.exp(spline.t[[0, -1]])
        out = np.zeros((len(x), len(self._x)))
        for s in (np.abs(x[:, None] - self._x), x[:, None] + self._x):
            value, near = spline(np.log(np.clip(s, smallest, largest))), s < smallest
            value[near] = np.cos(np.outer(s[near], k)) @ density
            out += value / 2
        return out


def _describe_unresolved(cover: Cover) -> str:
    most, top = _SETTINGS.most_thicknesses, cover.layers[-1].thickness
    return f"the contact is too wide: {1e3 * most * top:.4g} mm radius, {most:g} thicknesses of the top layer"


@lru_cache(maxsize=8)
def _tabulate_kernel(cover: Cover) -> tuple[BSpline, FloatArray, FloatArray]:
    """Tabulate the kernel m(s) = int_0^inf (L(k) - 1) cos(k s) dk of the contact equation over log(s) [1/m].

    At small s the table loses digits; there the integral is a sum over wave numbers, which are returned with their
    weights times L(k) - 1.

    L(k) is the compliance of the cover at the wave number k over that of a half space of the top layer's material.

    The cosine transform is a Hankel transform of order -1/2.  The integrand is -1 at k = 0.  The transform -b / (b^2 +
    s^2) of -exp(-b k) is separated, so that the remaining integrand vanishes at k = 0.  Without the bias a constant
    error of 2e-9 / b would be left, which the nearly singular equation of a wide contact on an incompressible layer
    multiplies by more than 1e6.
    """
    top, b = cover.layers[-1], cover.thickness
    step = 2 * LOGARITHMIC_HALF_WIDTH / LOGARITHMIC_POINTS
    k = np.exp(step * (np.arange(LOGARITHMIC_POINTS) + 0.5) - LOGARITHMIC_HALF_WIDTH) / np.sqrt(top.thickness * b)
    deep = k * top.thickness > _SETTINGS.deep
    safe = np.where(deep, _SETTINGS.deep / top.thickness, k)
    relative = np.where(deep, 0.0, transfer(cover, safe).compliance / half_space_compliance(top, safe) - 1)
    offset = fhtoffset(step, -0.5, bias=_BIAS)
    s = np.exp(offset) / k[::-1]
    transform = fht((relative + np.exp(-k * b)) * np.sqrt(k), step, -0.5, offset=offset, bias=_BIAS)
    value = np.sqrt(np.pi / (2 * s)) * transform - b / (b**2 + s**2)
    inside = (s > _SETTINGS.near * top.thickness) & (s < 1e4 * b)
    edges = np.append(0.0, np.geomspace(1e-2 / b, _SETTINGS.deep / top.thickness, _SETTINGS.near_panels))
    near, weight = place_gauss_points(edges, _SETTINGS.points)
    density = weight * (transfer(cover, near).compliance / half_space_compliance(top, near) - 1)
    return make_interp_spline(np.log(s[inside]), value[inside], k=5), near, density
