"""Additions to a derivation by presses with finite elements: range, tables under load, contact stiffness, tip share.

The range is where the fast model agrees with the finite elements.  Finite elements press a ball of one pitch radius
over the middle of a texel, and at a second position next to it.  At finite strain, a stiff foil on a soft layer
stretches.  The foil's tension is fitted to the base pressure at every depth of this loading path, and the fast model
gets tables at these loads.  Then the fast model repeats the path, and the larger of its misplaced forces at the two
positions gives the range.  Contacts on fewer cells than the fast model resolves are not counted, because it warns about
them, unless all contacts are so small.

The contact stiffnesses of the fast model are fitted to the depth of a sphere that presses on the cover.

A characteristic that was calibrated through the cover gives counts as a function of the force that a small tip applies
to the cover over the centre of a texel.  The fast model computes the force on the texel, which is a share of the
applied force.  Finite elements press the tip, a rod with a hemispherical end, to several depths.  As the load
increases, the contact grows and the share decreases.  The share used is the slope of the least-squares line through
zero of the force on the texel over the applied force, from zero load to saturation of the counts.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fastmodel.signal.electronics import Electronics
from fastmodel.surface import CoverCells
from fastmodel.validity import FEWEST_CELLS, Validity
from meshes import Cover, Indenter, Material, Pose, RoundedTip, Sphere, TexelArray
from meshes.array_types import FloatArray
from validation.derivation.kernel import Influence, compliance_kernel, influence_kernel, tabulate_surface
from validation.text.friction import describe_friction

if TYPE_CHECKING:
    from fastmodel.fitting.contact_stiffness import ContactFit, FoundationFit
    from fastmodel.fitting.gaussian import Fit
    from fastmodel.parameters import Parameters
    from fem_reference.indentation.ball_path import BallPath
    from fem_reference.indentation.result import Indentation
    from fem_reference.linear_response.membrane_tension import Stretch, StretchedResponse
    from fem_reference.linear_response.point_spread import PointSpread

Progress = Callable[[str], None]

#: Depths of the simulated presses of a ball from which the valid range of the fast model's loads is found, over the
#: thickness of the cover, at finite strain [-].
_FINITE_DEPTHS = (0.015, 0.03, 0.05, 0.08, 0.12, 0.2, 0.3, 0.4)
#: Depths of these presses over the thickness of the cover, at small strain [-].
_SMALL_DEPTHS = (0.05, 0.1, 0.15, 0.18, 0.2, 0.22, 0.24, 0.27, 0.3)
#: Largest depth of the ball that measures the range, over its radius [-].
_LARGEST_DEPTH = 0.5
#: Distance of the second position of the ball from the centre of a texel along x and y, over the size of the texel [-].
#: This position lies neither on the grid of texels nor on that of the fast model's cells.
_BESIDE = (0.3, 0.4)
#: Smallest useful effect of a fitted stretch: part of the force on wrong texels that it removes at one depth [-].  If
#: the effect is smaller at all depths, the tables under load are omitted.
_USEFUL = 0.02
#: Bounds of the two fitted parameters of the stretch [-]: natural logarithms of the tension over thickness times mean
#: shear modulus, and of the length over the thickness.
_BOUNDS = [(-7.0, 9.0), (-7.0, 3.0)]
#: Start values of the two fitted parameters of the stretch, at the smallest depth [-].
_START = (-1.0, -2.0)
#: Arguments of `scipy.optimize.minimize` for the fit of the stretch.
_MINIMISER: dict[str, Any] = {
    "method": "Nelder-Mead",
    "bounds": _BOUNDS,
    "options": {"xatol": 0.03, "fatol": 1e-4, "maxfev": 100},
}
#: Parts of the force on wrong texels at which the load and depth of the range are stated [-].
_LIMITS = (0.02, 0.05)


@dataclass(frozen=True, kw_only=True, eq=False)
class BallPresses:
    """A ball of one pitch radius that finite elements press on p points of an array to n depths.

    Attributes:
        radius: Radius of the ball [m].
        points: Positions of the ball's axis, shape (p, 2) [m].
        load: Forces on the ball, equal at all points, shape (n,) [N].
        texel_forces: Force on each texel, then the force outside the texels, shape (p, n, texels + 1) [N].
        path: The loading path at finite strain; None at small strain.
    """

    radius: float
    points: FloatArray
    load: FloatArray
    texel_forces: FloatArray
    path: BallPath | None


def press_ball_on_array(cover: Cover, array: TexelArray, progress: Progress | None) -> BallPresses:
    """Press a ball of one pitch radius by finite elements over the middle active texel, and next to its centre.

    Args:
        cover: A laterally wide cover.
        array: A flat array.
        progress: Called with a line of text before each step.

    Raises:
        ConvergenceError: If no depth converges.
    """
    from fem_reference.finite_strain.loading_path import LoadingPath
    from fem_reference.indentation.ball_path import press_ball
    from fem_reference.indentation.small_strain import solve_coarse

    radius = min(array.pitch)
    most = _LARGEST_DEPTH * radius
    shares = _SMALL_DEPTHS if cover.small_strain_only else _FINITE_DEPTHS
    deepest = min(shares[-1] * cover.thickness, most)
    depths = [share / shares[-1] * deepest for share in shares]
    points = _choose_points(array)
    if cover.small_strain_only:
        wanted = LoadingPath(cover=cover, indenter=Sphere(radius=radius), targets=tuple(depths), control="depth")
        found = solve_coarse(wanted, progress)
        poses = [Pose.planar(at=(float(x), float(y))) for x, y in points]
        return BallPresses(
            radius=radius,
            points=points,
            load=np.array([each.total_force for each in found]),
            texel_forces=np.array([[each.base.forces(array, pose) for each in found] for pose in poses]),
            path=None,
        )
    path = press_ball(cover, radius, depths, progress=progress)
    forces = [
        [
            load * np.append(base.texel_influence(array, point)[0], base.outside(array, point))
            for load, base in zip(path.load, path.base, strict=True)
        ]
        for point in points
    ]
    return BallPresses(radius=radius, points=points, load=path.load, texel_forces=np.array(forces), path=path)


def _choose_points(array: TexelArray) -> FloatArray:
    """Return the centre of the active texel nearest to the middle one, and a point off the grid, shape (2, 2) [m]."""
    centre = array.centres[find_middle(array), :2]
    return np.array([centre, centre + np.multiply(_BESIDE, array.texel_size)])


def add_stretch(
    cells: CoverCells, cover: Cover, array: TexelArray, spread: PointSpread, presses: BallPresses
) -> CoverCells:
    """Add tables under load to the fast model's cells, if the stretch of the cover's top changes the forces noticeably.

    A depth at which the fitted stretch does not bring the base pressure closer to that of the finite elements is
    omitted.  The minimiser may stop at its largest number of evaluations; only the remaining misplaced force is used.

    Args:
        cells: Compliance and influence of the cover without load.
        cover: A laterally wide cover.
        array: A flat array.
        spread: The point spread function of the cover without load.
        presses: The ball of one pitch radius.
    """
    from fem_reference.linear_response.membrane_tension import StretchedResponse

    if presses.path is None or len(cover.layers) == 1:
        return cells
    base = StretchedResponse.prepare(cover, spread.radius)
    stretches, gains = _fit_stretches(cover, base, presses.path)
    kept = [n for n, gain in enumerate(gains) if gain > 0]
    if max(gains) < _USEFUL:
        return cells
    reach, cell = len(cells.compliance) - 1, cells.cell
    surface = tabulate_surface(cover, reach, cell)
    top = StretchedResponse.prepare(cover, surface.regular.x)
    spreads = [
        base.remove_contact(presses.path.base[n], float(presses.path.contact_radius[n]), stretches[n]) for n in kept
    ]
    return dataclasses.replace(
        cells,
        loads=presses.load[kept],
        loaded_compliance=np.array(
            [compliance_kernel(top.stretch_compliance(surface, stretches[n]), reach, cell) for n in kept]
        ),
        loaded_influence=np.array([influence_kernel(array, each, cells.per_texel, cells.reach) for each in spreads]),
    )


def _fit_stretches(cover: Cover, response: StretchedResponse, path: BallPath) -> tuple[list[Stretch], list[float]]:
    """Fit the stretch of the cover's top to the base pressure, at each of n depths of a loading path.

    Returns:
        The n stretches, and the part of the force that each stretch moves to its place in the finite elements [-].
    """
    from scipy.optimize import minimize

    from fem_reference.linear_response.membrane_tension import Stretch

    radius = response.radius
    # The weight of a radius is half the area of its ring: misplaced force is half the sum of the differences.
    ring = np.pi * radius * np.gradient(radius)
    yielding = sum(layer.thickness / layer.material.shear_modulus for layer in cover.layers)

    def read(logarithms: FloatArray) -> Stretch:
        tension, length = np.exp(logarithms) * cover.thickness
        return Stretch(tension=float(tension * cover.thickness / yielding), length=float(length))

    stretches: list[Stretch] = []
    gains: list[float] = []
    start = list(_START)
    for base, contact in zip(path.base, path.contact_radius, strict=True):
        wanted = base.pressure(radius)

        def misplace(
            logarithms: FloatArray | None, wanted: FloatArray = wanted, contact: float = float(contact)
        ) -> float:
            stretch = Stretch(tension=0.0, length=0.0) if logarithms is None else read(logarithms)
            return float(ring @ np.abs(response.spread_over_contact(stretch, contact) - wanted))

        fit = minimize(misplace, start, **_MINIMISER)
        gain = misplace(None) - float(fit.fun)
        if gain > 0:
            start = [float(value) for value in fit.x]
        stretches.append(read(fit.x))
        gains.append(gain)
    return stretches, gains


def measure_misplaced(found: FloatArray, wanted: FloatArray) -> float:
    """Compute the part of the force on wrong texels, from forces on texels and outside whose sum is the force [-]."""
    return float(np.abs(found - wanted).sum() / 2 / wanted.sum())


def state_range(
    parameters: Parameters, cells: CoverCells, cover: Cover, spread: PointSpread, presses: BallPresses
) -> Parameters:
    """Add tables under load, where they are useful, and the range of the fast model to its parameters.

    Args:
        parameters: Parameters of the fast model.
        cells: Compliance and influence of the cover without load, as in the parameters.
        cover: A laterally wide cover.
        spread: The point spread function of the cover without load.
        presses: The ball by finite elements.

    Raises:
        FastModelError: If the fast model cannot press the ball.
    """
    cells = add_stretch(cells, cover, parameters.array, spread, presses)
    parameters = dataclasses.replace(parameters, surface=cells)
    misplaced, depth, resolved = _repeat_presses(parameters, presses)
    if cells.loads is not None:
        tabulated = np.isin(presses.load, cells.loads)
        cells = dataclasses.replace(cells, load_depths=np.maximum.accumulate(depth.mean(axis=0)[tabulated]))
    if not resolved.any():
        # Under a foil every contact is small, but the foil spreads the force over many cells.
        resolved = np.ones_like(resolved)
    counted = resolved.any(axis=0)
    load, worst, deepest = (
        presses.load[counted],
        np.where(resolved, misplaced, 0.0).max(axis=0)[counted],
        np.where(resolved, depth, 0.0).max(axis=0)[counted],
    )
    limits = [_find_limit(load, worst, limit) for limit in _LIMITS]
    depths = [float(np.interp(limit, np.append(0.0, load), np.append(0.0, deepest))) for limit in limits]
    validity = Validity(
        ball_radius=presses.radius,
        load_2_percent=limits[0],
        load_5_percent=limits[1],
        depth_2_percent=depths[0],
        depth_5_percent=depths[1],
        largest_load=float(load[-1]),
        strain="small" if presses.path is None else "finite",
    )
    return dataclasses.replace(parameters, surface=cells, validity=validity)


def _repeat_presses(
    parameters: Parameters, presses: BallPresses
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Press the ball, which finite elements have pressed, by the fast model on p points at n loads.

    Returns:
        The misplaced parts of the force, shape (p, n) [-]; the depths, shape (p, n) [m]; and whether the contact covers
        enough cells, shape (p, n).
    """
    from fastmodel import indent

    misplaced, depth = np.zeros((2, *presses.texel_forces.shape[:2]))
    resolved = np.zeros(misplaced.shape, dtype=bool)
    ball = Sphere(radius=presses.radius)
    for p, n in np.ndindex(misplaced.shape):
        x, y = presses.points[p].tolist()
        found = indent(parameters, ball, load=float(presses.load[n]), at=(x, y), contact="cover")
        misplaced[p, n] = measure_misplaced(np.append(found.texel_forces, found.outside), presses.texel_forces[p, n])
        depth[p, n] = found.depth or 0.0
        resolved[p, n] = (found.fewest_cells or 0) >= FEWEST_CELLS
    return misplaced, depth, resolved


def _find_limit(load: FloatArray, misplaced: FloatArray, limit: float) -> float:
    """Return the load at which the misplaced part first exceeds a limit, interpolated linearly, or the largest load."""
    over = np.flatnonzero(misplaced > limit)
    if not over.size:
        return float(load[-1])
    first = int(over[0])
    if first == 0:
        return 0.0
    return float(np.interp(limit, misplaced[[first - 1, first]], load[[first - 1, first]]))


#: Radius of the sphere that presses on the cover, similar to a fingertip [m].
_SPHERE_RADIUS = 5e-3
#: Radii of the contact area between sphere and cover for which force and depth are computed, over the thickness of the
#: cover [-].
_CONTACTS_BY_THICKNESS = (0.25, 0.5, 0.75, 1.0, 1.5)
#: Largest radius of the contact area, over the radius of the sphere [-].  The closed-form solution replaces the sphere
#: by a paraboloid, which is acceptable up to about this ratio.
_LARGEST_CONTACT = 0.8
#: Radii of the contact area over the radius of the sphere, for thick covers [-].  On these the limit `_LARGEST_CONTACT`
#: leaves fewer than three of the radii in `_CONTACTS_BY_THICKNESS`.
_CONTACTS_BY_RADIUS = (0.2, 0.4, _LARGEST_CONTACT)


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthFits:
    """Forces and depths of a sphere that presses on a cover, and the contact stiffnesses fitted to them.

    Attributes:
        ball_radius: Radius of the sphere [m].
        load: Forces on the sphere in k presses, shape (k,) [N].
        depth: Approaches of the sphere from first touch by the closed-form layer solution, shape (k,) [m].
        foundation: Fitted modulus of an elastic foundation, independent springs under the sphere.
        contact: Fitted contact parameters of MuJoCo.
    """

    ball_radius: float
    load: FloatArray
    depth: FloatArray
    foundation: FoundationFit
    contact: ContactFit


def fit_depth(cover: Cover) -> DepthFits:
    """Compute forces and depths of a sphere on a wide cover, and fit the fast model's contact stiffnesses to them.

    The fitted quantities are the modulus of an elastic foundation and the contact parameters of MuJoCo.

    Args:
        cover: A laterally wide cover, linearised at zero load.
    """
    from fastmodel.fitting.contact_stiffness import fit_contact, fit_foundation
    from fem_reference.closed_form.contact import sphere

    largest = _LARGEST_CONTACT * _SPHERE_RADIUS
    contacts = np.unique(np.minimum(np.array(_CONTACTS_BY_THICKNESS) * cover.thickness, largest))
    if len(contacts) < len(_CONTACTS_BY_RADIUS):
        contacts = _SPHERE_RADIUS * np.array(_CONTACTS_BY_RADIUS)
    pressed = [sphere(cover, _SPHERE_RADIUS, float(contact)) for contact in contacts]
    load = np.array([each.force for each in pressed])
    depth = np.array([each.depth for each in pressed])
    return DepthFits(
        ball_radius=_SPHERE_RADIUS,
        load=load,
        depth=depth,
        foundation=fit_foundation(Sphere(radius=_SPHERE_RADIUS), load, depth),
        contact=fit_contact(load, depth),
    )


#: Depths to which finite elements press the calibration tip, over the thickness of the cover [-].
_DEPTHS = (0.1, 0.2, 0.4)
#: Exponent p for the interpolation of the tip's share, which is nearly linear in load^p [-].  The contact area of a
#: ball is proportional to load^(2/3).
_EXPONENT = 2 / 3
#: Number of loads to which the line of force on the texel over applied force is fitted [-].
_FITTED_LOADS = 200
#: Number of decimals to which the share is rounded [-].  Further decimals differ between computers.
_DECIMALS = 4


@dataclass(frozen=True, kw_only=True)
class TipShare:
    """Share of a calibration tip's force that the texel under the tip measures.

    Attributes:
        radius: Radius of the hemispherical end of the tip [m].
        share: Force on the texel over the applied force, fitted over the range of loads [-].
        largest_load: Largest load of the range: load of saturation, or of the deepest press that finite elements at
            small strain compute [N].
        saturation_load: Load at which the counts saturate; None for a characteristic that never does [N].
        lightest: Force on the texel over the applied force under a point load, the limit for light loads [-].
        heaviest: Force on the texel over the applied force under the largest load of the range [-].
    """

    radius: float
    share: float
    largest_load: float
    saturation_load: float | None
    lightest: float
    heaviest: float


def compute_tip_share(
    cover: Cover, array: TexelArray, influence: Influence, *, radius: float, saturation: float | None
) -> TipShare:
    """Press the calibration tip of a sensor over the centre of the middle active texel by finite elements.

    The materials are linearised, as in all parts of a derivation.  For a cover with free side edges, the pressure under
    the tip is that on a wide cover, and the force on the texel follows from the response of the cover with its edges.

    Args:
        cover: The cover.
        array: A flat array.
        influence: Finite-element response of the texels to loads on the cover.
        radius: Radius of the hemispherical end of the tip [m].
        saturation: Load at which the counts saturate; None for a characteristic that never does [N].

    Raises:
        ConvergenceError: If the finite elements did not converge.
        ValueError: If finite elements cannot press the tip.
    """
    from fem_reference.indentation.press import press_path

    texel = find_middle(array)
    centre = array.centres[texel, :2]
    path = press_path(
        linearise(cover),
        array,
        RoundedTip(radius=radius),
        depths=[depth * cover.thickness for depth in _DEPTHS],
        pose=Pose.planar(at=(float(centre[0]), float(centre[1]))),
    )
    lightest = float(influence.texel_influence(array, centre)[0, texel])
    loads = np.array([0.0, *(each.total_force for each in path)])
    shares = [lightest, *(_measure(each, array, influence)[texel] / each.total_force for each in path)]
    largest = float(loads[-1]) if saturation is None else min(saturation, float(loads[-1]))
    applied = np.linspace(0, largest, _FITTED_LOADS)
    on_texel = applied * np.interp(applied**_EXPONENT, loads**_EXPONENT, shares)
    share = round(float(applied @ on_texel / (applied @ applied)), _DECIMALS)
    if not share > 0:
        raise ValueError(
            f"a cover of {1e3 * cover.thickness:g} mm puts too little of the tip's force on a texel; give the true "
            'thickness, or calibrated = "texel force"'
        )
    return TipShare(
        radius=radius,
        share=share,
        largest_load=largest,
        saturation_load=saturation,
        lightest=lightest,
        heaviest=float(on_texel[-1] / largest),
    )


def find_middle(array: TexelArray) -> int:
    """Return the index of the active texel whose centre is nearest to the centre of the texel `array.middle`."""
    distance = np.linalg.norm(array.centres - array.centres[array.middle], axis=1)
    return int(np.argmin(np.where(array.active, distance, np.inf)))


def find_saturation(electronics: Electronics) -> float | None:
    """Return the smallest force on a texel of gain one from which counts saturate, None if they never do [N].

    The force is the argument of the characteristic.
    """
    coefficients = np.array(electronics.characteristic or (electronics.offset, electronics.sensitivity))
    coefficients[0] -= electronics.output_max + electronics.threshold
    roots = np.polynomial.Polynomial(coefficients).roots()
    forces = roots.real[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(forces.min()) if len(forces) else None


def linearise_material(material: Material) -> Material:
    """Return the linear material with the properties of a material at zero load."""
    if material.small_strain_only:
        return material
    return Material(
        name=material.name,
        model="linear-elastic",
        parameters={"youngs_modulus": material.youngs_modulus},
        poisson_ratio=material.poisson_ratio,
    )


def linearise(cover: Cover) -> Cover:
    """Return a wide cover of the same layers with linear materials."""
    layers = (dataclasses.replace(layer, material=linearise_material(layer.material)) for layer in cover.layers)
    return dataclasses.replace(cover, layers=tuple(layers), size=None)


#: Ratio of the moduli of two layers above which a cover counts as one with a foil [-].
_FOIL = 100.0
#: Depth over thickness to which a linear cover without its foils is pressed to find the load that a cover bears [-].
DEEP = 0.3
#: Number of cells across the contact of these presses [-].
_CELLS = 32


@lru_cache(maxsize=256)
def bear(cover: Cover, indenter: Indenter, share: float = DEEP) -> float:
    """Return the load that presses a cover to a share of its thickness [N].

    The cover is wide, linear and frictionless.  Foils are left out, so that a cover with a foil bears more than this.

    Args:
        cover: The cover.
        indenter: The indenter, not tilted.
        share: Depth over thickness [-].
    """
    from fem_reference.linear_response.surface_compliance import decay_length, surface_compliance
    from fem_reference.small_strain_contact.frictionless import bound_contact, solve_contact

    softest = min(layer.material.youngs_modulus for layer in cover.layers)
    kept = tuple(layer for layer in cover.layers if layer.material.youngs_modulus <= _FOIL * softest)
    soft = linearise(dataclasses.replace(cover, layers=kept))
    reach = max(3 * float(np.hypot(*bound_contact(indenter, soft.thickness))), 4 * decay_length(soft))
    surface = surface_compliance(soft, reach)
    return solve_contact(surface, indenter, cells=_CELLS, depth=share * soft.thickness).total_force


def _measure(press: Indentation, array: TexelArray, influence: Influence) -> FloatArray:
    """Compute the force on each of n texels from the contact forces of a press and the influence, shape (n,) [N]."""
    force = -press.contact_forces[:, 2]
    measured = force @ influence.texel_influence(array, press.contact_points[:, :2])
    return np.asarray(measured * press.total_force / force.sum())


#: Standard deviation (sigma) of the Gaussian spread kernel, below which the forces on texels hardly depend on sigma
#: [pitches].
_NARROW_SIGMA = 0.27


def list_undetermined(cover: Cover, fit: Fit, depth: DepthFits | None, *, friction: float = 0.0) -> tuple[str, ...]:
    """List the quantities that the derivation of the fast model's parameters cannot determine, one line of text each.

    Args:
        cover: The cover.
        fit: The fitted spread kernel.
        depth: Contact stiffnesses fitted to the depth of a sphere; None for a cover with free side edges.
        friction: Friction coefficient between indenter and cover in the sensor file, inf for no slip [-].
    """
    ratio = "" if len(cover.layers) == 1 else "; between layers the ratio of moduli does matter"
    lines = [
        f"Young's modulus: no effect on the point spread or on how force is shared, only on depths{ratio}",
        "filter, noise, hysteresis, temperature gain, characteristic, gains: need a recording (`softcover calibrate`)",
        "shear, friction, rate and relaxation: the reference is one slow press along the normal",
    ]
    if friction:
        lines.append(
            f"friction {describe_friction(friction)} of the sensor file: not used, since every indenter here is "
            "frictionless; `press` and `validate` use it in the finite elements"
        )
    if cover.assumed:
        lines.append("thickness and material of this cover: assumed, nobody measured them")
    if min(fit.gaussian.sigma_x, fit.gaussian.sigma_y) < _NARROW_SIGMA:
        lines.append("sigma: the kernel is narrower than the texels resolve; any sigma below 0.26 pitches fits alike")
    if depth is None:
        lines.append("foundation modulus and contact parameters: near free side edges depth depends on the position")
        return tuple(lines)
    foundation, contact = depth.foundation, depth.contact
    lightest, heaviest = (foundation.estimates[name] / foundation.modulus for name in ("lightest", "heaviest"))
    lines.append(
        f"one foundation modulus for all loads: the lightest load alone gives {lightest:.2g} of the fitted one, the "
        f"heaviest {heaviest:.2g}"
    )
    lines.append(
        f"MuJoCo's depth under other loads: fitted to a free body of {1e3 * contact.mass:.3g} g only; in MuJoCo bodies "
        f"of all masses sink equally deep, here {contact.misses.max():+.0%} to {contact.misses.min():+.0%} off over "
        f"{depth.load.min():.2g}..{depth.load.max():.2g} N"
    )
    return tuple(lines)
