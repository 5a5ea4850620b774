"""Fits to how deep an indenter goes under which force: the foundation's modulus, and the plate's contact parameters.

Neither is the cover.  An elastic foundation has no lateral reach, so every size of contact asks for a modulus of its
own.  MuJoCo's contacts have no stiffness at all: their softness is divided by the mass, and a free body that rests on
n points sinks (1 - d) g t^2 / n, with impedance d, time constant t and gravity g, whatever it weighs.  So one depth at
one load can be matched, a curve cannot.
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
from meshes.constants import STANDARD_GRAVITY

FloatArray = npt.NDArray[np.float64]

#: The estimator that a fitted modulus comes from.
ESTIMATOR = "least-squares-force"
#: Points along each edge of the square in which the displaced volume is summed.
_POINTS = 200
#: Time constants of a contact in physics steps: MuJoCo takes no less than two, and these are well clear of it [-].
_LEAST_STEPS = 2.5
#: Impedance where the depth allows it; stiffer contacts come closer to 1 [-].
_IMPEDANCE = 0.95
#: Time that is given to come to rest, in time constants, and at least [s].
_REST, _LEAST_REST = 60.0, 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundationFit:
    """The elastic foundation that comes closest to a depth curve.

    Attributes:
        modulus: Pressure per depth [Pa/m].
        uncertainty: Standard error of the modulus, from how far the forces miss the fit [Pa/m].
        residual: Root mean square miss of the forces, over that of the forces [-].
        estimator: Name of the estimator that `modulus` comes from.
        estimates: Every estimator's modulus by name [Pa/m].
    """

    modulus: float
    uncertainty: float
    residual: float
    estimator: str
    estimates: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactFit:
    """MuJoCo contact parameters under which one free body rests as deep as in the reference.

    Attributes:
        solref: Time constant and damping ratio [s, -].
        solimp: Impedance at first touch and deep down, width, midpoint and power [-, -, m, -, -].
        load: Weight at which the depth is matched [N].
        mass: Its mass [kg].
        depth: The reference's depth at that load [m].
        sinks: How deep bodies of all the reference's loads rest with these parameters, shape (k,) [m].
        misses: The same over the reference's depths, less one, shape (k,) [-].
    """

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    load: float
    mass: float
    depth: float
    sinks: FloatArray
    misses: FloatArray

    def plate(self, plate: Plate | None = None) -> Plate:
        """A plate with these parameters, to be given to `CoverContact` or `Foundation`."""
        return dataclasses.replace(plate or Plate(), solref=self.solref, solimp=self.solimp)


def fit_foundation(indenter: Indenter, load: npt.ArrayLike, depth: npt.ArrayLike) -> FoundationFit:
    """Fit the modulus of an elastic foundation to how deep an indenter goes: force = modulus times displaced volume.

    Estimators: `least-squares-force` over all forces, unweighted; `lightest` and `heaviest`, what the first and the
    last point ask for by themselves.  On a real cover these differ: small contacts ask for more.

    Args:
        indenter: The shape.
        load: Forces, shape (k,), rising [N].
        depth: Approaches from first touch, shape (k,) [m].

    Raises:
        ShapeError: If there are fewer than two points or shapes differ.
        FastModelError: If a number is not positive and finite.
    """
    force, deep = _checked(load, depth)
    volume = np.array([_displaced(indenter, each) for each in deep])
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
    """Find contact parameters of the plate with which a ball under its own weight rests as deep as in the reference.

    The engine itself is run, with a free ball on the plate; a face that stands on n points sinks 1 / n as deep, a body
    on a slide a third.

    Args:
        load: Forces, shape (k,), rising [N].
        depth: The reference's approaches, shape (k,) [m].
        matched: The load whose depth is matched; the middle one when not given [N].
        timestep: Of the physics that the parameters are for [s].

    Raises:
        ShapeError: If there are fewer than two points or shapes differ.
        FastModelError: If a number is not positive and finite, or the matched load is not among the loads.
    """
    force, deep = _checked(load, depth)
    chosen = len(force) // 2 if matched is None else int(np.abs(force - matched).argmin())
    if matched is not None and not np.isclose(force[chosen], matched, rtol=1e-6):
        raise FastModelError(f"matched must be one of the loads {force.tolist()} N, not {matched}")
    aim, mass = float(deep[chosen]), float(force[chosen] / STANDARD_GRAVITY)
    least = _LEAST_STEPS * timestep
    constant = max(least, float(np.sqrt(aim / ((1 - _IMPEDANCE) * STANDARD_GRAVITY))))
    impedance = 1 - aim / (STANDARD_GRAVITY * constant**2)
    found = _sink(mass, constant, impedance, timestep)
    # the law is exact for one contact point; what remains is the engine's own rounding of the constants
    impedance = 1 - (1 - impedance) * aim / found
    sinks = np.array([_sink(each / STANDARD_GRAVITY, constant, impedance, timestep) for each in force])
    return ContactFit(
        solref=(constant, 1.0),
        solimp=(impedance, impedance, 1e-3, 0.5, 2.0),
        load=float(force[chosen]),
        mass=mass,
        depth=aim,
        sinks=sinks,
        misses=sinks / deep - 1,
    )


def _checked(load: npt.ArrayLike, depth: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    force, deep = np.array(load, dtype=np.float64), np.array(depth, dtype=np.float64)
    if force.ndim != 1 or force.shape != deep.shape or len(force) < 2:  # noqa: PLR2004 -- a scatter takes two
        raise ShapeError(f"load and depth take two or more points of one shape, not {force.shape} and {deep.shape}")
    for name, values in (("load", force), ("depth", deep)):
        if not (np.isfinite(values).all() and values.min() > 0):
            raise FastModelError(f"{name} must be positive and finite, not {values.tolist()}")
    return force, deep


def _displaced(indenter: Indenter, depth: float) -> float:
    """Volume of an indenter below the undeformed top: int max(0, depth - gap) [m3]."""
    half_x, half_y = indenter.footprint
    middle = (np.arange(_POINTS) + 0.5) / _POINTS * 2 - 1
    # a shallow ball touches a small part of its footprint only: look where it does
    gap = indenter.gap(*np.meshgrid(middle * half_x, middle * half_y))
    rows, columns = np.nonzero(gap < depth)
    if not len(rows):
        rows = columns = np.array([_POINTS // 2])
    reach = 2 / _POINTS * 2 + np.abs(middle[[rows.min(), rows.max(), columns.min(), columns.max()]]).max()
    share = min(1.0, float(reach))
    x, y = np.meshgrid(share * middle * half_x, share * middle * half_y)
    cell = (2 * share / _POINTS) ** 2 * half_x * half_y
    return float(np.maximum(depth - indenter.gap(x, y), 0.0).sum() * cell)


def _sink(mass: float, constant: float, impedance: float, timestep: float) -> float:
    """How deep a free ball of a mass rests in the plate [m]."""
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
