"""Fits to the reference's curve of force over depth: the foundation's modulus, and the plate's contact parameters.

Both are approximations of the cover.  The springs of an elastic foundation are independent, so that contacts of
different size need different moduli.  MuJoCo's contacts have no stiffness of their own, because their softness is
scaled with the mass: a free body that rests on n points sinks by (1 - d) g t^2 / n, with impedance d, time constant t
and gravity g, whatever its mass.  So the depth can be matched at one load, but not the curve.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.contact.plate import Plate
from fastmodel.errors import FastModelError, ShapeError
from fastmodel.pose import Pose
from meshes import Indenter, Sphere, TexelArray
from meshes.array_types import FloatArray
from meshes.constants import STANDARD_GRAVITY

#: Name of the estimator that gives the modulus.
ESTIMATOR = "least-squares-force"
#: Number of points along each edge of the square in which the displaced volume is summed [-].
_POINTS = 200
#: Smallest time constant of a contact, in physics steps [-]: MuJoCo raises time constants below two steps.
_LEAST_STEPS = 2.5
#: Impedance of the contact [-].  It is larger if the smallest time constant already sinks too deep.
_IMPEDANCE = 0.95
#: Time to come to rest: in time constants [-], and at least [s].
_REST, _LEAST_REST = 60.0, 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundationFit:
    """The elastic foundation that fits a curve of force over depth best.

    Attributes:
        modulus: Pressure per depth [Pa/m].
        uncertainty: Standard error of the modulus, from the residuals of the forces [Pa/m].
        residual: Root mean square of the residuals over that of the forces [-].
        estimator: Name of the estimator that gave `modulus`.
        estimates: Modulus of every estimator, by name [Pa/m].
    """

    modulus: float
    uncertainty: float
    residual: float
    estimator: str
    estimates: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactFit:
    """MuJoCo contact parameters with which a free body rests at the reference's depth.

    Attributes:
        solref: Time constant and damping ratio [s, -].
        solimp: Impedance at first touch and at depth, width, midpoint and power [-, -, m, -, -].
        load: Weight at which the depth is matched [N].
        mass: Mass of this weight [kg].
        depth: Depth of the reference at this load [m].
        sinks: Depth of bodies of all the reference's loads with these parameters, shape (k,) [m].
        misses: Relative difference of these depths from the reference's, shape (k,) [-].
    """

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    load: float
    mass: float
    depth: float
    sinks: FloatArray
    misses: FloatArray

    def plate(self, plate: Plate | None = None) -> Plate:
        """Make a plate with these parameters, for `CoverContact` or `Foundation`.

        Args:
            plate: Plate whose other settings are kept; the default plate if None.
        """
        return dataclasses.replace(plate or Plate(), solref=self.solref, solimp=self.solimp)


def fit_foundation(indenter: Indenter, load: npt.ArrayLike, depth: npt.ArrayLike) -> FoundationFit:
    """Fit the modulus of an elastic foundation: force = modulus * displaced volume.

    Estimators: `least-squares-force`, the unweighted fit to all forces; `lightest` and `heaviest`, the moduli of the
    first and of the last point alone.  They differ on a real cover, where small contacts need larger moduli.

    Args:
        indenter: The shape.
        load: Forces, rising, shape (k,) [N].
        depth: Approaches since first touch, shape (k,) [m].

    Raises:
        ShapeError: If there are fewer than two points or shapes differ.
        FastModelError: If a number is not positive and finite.
    """
    force, deep = _check_curve(load, depth)
    volume = np.array([_measure_volume(indenter, each) for each in deep])
    modulus = float(force @ volume / (volume @ volume))
    miss = force - modulus * volume
    return FoundationFit(
        modulus=modulus,
        uncertainty=float(np.sqrt(miss @ miss / (len(force) - 1) / (volume @ volume))),
        residual=float(np.sqrt(miss @ miss / (force @ force))),
        estimator=ESTIMATOR,
        estimates={
            ESTIMATOR: modulus,
            "lightest": float(force[0] / volume[0]),
            "heaviest": float(force[-1] / volume[-1]),
        },
    )


def fit_contact(
    load: npt.ArrayLike, depth: npt.ArrayLike, *, matched: float | None = None, timestep: float = 1e-3
) -> ContactFit:
    """Find contact parameters of the plate with which a free ball rests at the reference's depth.

    The depths are simulated with a ball on the plate.  A face that rests on n points sinks 1 / n as deep, and a body on
    a slide a third as deep.

    Args:
        load: Forces, rising, shape (k,) [N].
        depth: Approaches of the reference, shape (k,) [m].
        matched: Load at which the depth is matched, by default the middle one [N].
        timestep: Timestep of the simulation in which the parameters will be used [s].

    Raises:
        ShapeError: If there are fewer than two points or shapes differ.
        FastModelError: If a number is not positive and finite, or the matched load is not among the loads.
    """
    force, deep = _check_curve(load, depth)
    chosen = len(force) // 2 if matched is None else int(np.abs(force - matched).argmin())
    if matched is not None and not np.isclose(force[chosen], matched, rtol=1e-6):
        raise FastModelError(f"matched must be one of the loads {force.tolist()} N, not {matched}")
    aim, mass = float(deep[chosen]), float(force[chosen] / STANDARD_GRAVITY)
    least = _LEAST_STEPS * timestep
    constant = max(least, float(np.sqrt(aim / ((1 - _IMPEDANCE) * STANDARD_GRAVITY))))
    impedance = 1 - aim / (STANDARD_GRAVITY * constant**2)
    found = _simulate_depth(mass, constant, impedance, timestep)
    # The law is exact for one contact point, up to the limits that MuJoCo sets to the constants: correct for them.
    impedance = 1 - (1 - impedance) * aim / found
    sinks = np.array([_simulate_depth(each / STANDARD_GRAVITY, constant, impedance, timestep) for each in force])
    return ContactFit(
        solref=(constant, 1.0),
        solimp=(impedance, impedance, 1e-3, 0.5, 2.0),
        load=float(force[chosen]),
        mass=mass,
        depth=aim,
        sinks=sinks,
        misses=sinks / deep - 1,
    )


def _check_curve(load: npt.ArrayLike, depth: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Forces [N] and depths [m] as arrays, both of shape (k,)."""
    force, deep = np.array(load, dtype=np.float64), np.array(depth, dtype=np.float64)
    if force.ndim != 1 or force.shape != deep.shape or len(force) < 2:  # noqa: PLR2004 -- a scatter takes two
        raise ShapeError(f"load and depth take two or more points of one shape, not {force.shape} and {deep.shape}")
    for name, values in (("load", force), ("depth", deep)):
        if not (np.isfinite(values).all() and values.min() > 0):
            raise FastModelError(f"{name} must be positive and finite, not {values.tolist()}")
    return force, deep


def _measure_volume(indenter: Indenter, depth: float) -> float:
    """Volume of the indenter below the undeformed top, the integral of max(0, depth - gap) [m3].

    Args:
        indenter: The shape.
        depth: Depth of its lowest point [m].
    """
    half_x, half_y = indenter.footprint
    middle = (np.arange(_POINTS) + 0.5) / _POINTS * 2 - 1
    # The integral covers only the part of the footprint that lies below the top, which is small for a shallow ball.
    gap = indenter.gap(*np.meshgrid(middle * half_x, middle * half_y))
    rows, columns = np.nonzero(gap < depth)
    if not len(rows):
        rows = columns = np.array([_POINTS // 2])
    reach = 2 / _POINTS * 2 + np.abs(middle[[rows.min(), rows.max(), columns.min(), columns.max()]]).max()
    share = min(1.0, float(reach))
    x, y = np.meshgrid(share * middle * half_x, share * middle * half_y)
    cell = (2 * share / _POINTS) ** 2 * half_x * half_y
    return float(np.maximum(depth - indenter.gap(x, y), 0.0).sum() * cell)


def _simulate_depth(mass: float, constant: float, impedance: float, timestep: float) -> float:
    """Depth at which a free ball rests in the plate [m].

    Args:
        mass: Mass of the ball [kg].
        constant: Time constant of the contact [s].
        impedance: Impedance of the contact [-].
        timestep: Timestep of the simulation [s].
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.gravity = [0, 0, -STANDARD_GRAVITY]
    spec.option.tolerance = 1e-12
    plate = Plate(solref=(constant, 1.0), solimp=(impedance, impedance, 1e-3, 0.5, 2.0))
    plate.attach(spec.worldbody, TexelArray.grid(4, 4, 10e-3), Pose.of((0, 0, 0), (1, 0, 0, 0)), "fit")
    ball = Sphere(radius=10e-3)
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[ball.radius, 0, 0], pos=[0, 0, ball.radius], mass=mass)
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(int(max(_LEAST_REST, _REST * constant) / timestep)):
        mujoco.mj_step(model, data)
    return float(-data.qpos[2])
