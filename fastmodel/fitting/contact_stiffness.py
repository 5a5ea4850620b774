"""Fits of an elastic foundation and of MuJoCo's contact parameters to a curve of force over depth.

The curve comes from the finite-element reference; the depth is the approach of an indenter since its first touch of the
cover.  Neither the foundation nor MuJoCo's contacts can represent the cover exactly.  The springs of an elastic
foundation are independent, so that contacts of different size require different moduli.  The stiffness of MuJoCo's
contacts is scaled with the mass of the bodies: a free body that rests on n contact points sinks by (1 - d) g t^2 / n,
with impedance d, time constant t and gravity g, independent of its mass.  So the depth can be matched at one load, but
not at all loads of the curve.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.contact.plate import Plate
from fastmodel.errors import FastModelError
from meshes import Indenter, Sphere, TexelArray
from meshes.array_types import FloatArray
from meshes.constants import STANDARD_GRAVITY

#: Name of the estimator of `FoundationFit.modulus`: the unweighted least-squares fit of the forces.
ESTIMATOR = "least-squares-force"
#: Number of points along each edge of the rectangle on which the displaced volume is summed [-].
_POINTS = 200
#: Smallest time constant of a contact, over the timestep [-].  MuJoCo increases time constants below two timesteps.
_LEAST_STEPS = 2.5
#: Impedance of the plate's contacts [-].  It is increased if the depth with the smallest time constant is too large.
_IMPEDANCE = 0.95
#: Simulated time after which the ball on the plate counts as at rest, over the time constant of the contact [-].
_REST = 60.0
#: Smallest simulated time after which the ball on the plate counts as at rest [s].
_LEAST_REST = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundationFit:
    """The elastic foundation that fits a curve of force over depth best.

    Attributes:
        modulus: Modulus of the foundation, pressure per displacement [Pa/m].
        uncertainty: Standard error of the modulus, from the residuals of the forces [Pa/m].
        residual: Root mean square of the residuals over the root mean square of the forces [-].
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
    """MuJoCo contact parameters with which a free ball rests at the depth of the finite-element reference.

    Attributes:
        solref: Time constant and damping ratio of the contacts [s, -].
        solimp: Impedance of the contacts at zero depth and at full width, width, midpoint, power [-, -, m, -, -].
        load: Weight of the ball at which the depth is matched [N].
        mass: Mass of a ball of this weight [kg].
        depth: Depth of the reference at this load [m].
        sinks: Depth of a ball in MuJoCo with these parameters at each of the k loads, shape (k,) [m].
        misses: Relative deviation of `sinks` from the depths of the reference, shape (k,) [-].
    """

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    load: float
    mass: float
    depth: float
    sinks: FloatArray
    misses: FloatArray

    def plate(self, plate: Plate | None = None) -> Plate:
        """Make plate settings with these contact parameters, for `CoverContact` or `Foundation`.

        Args:
            plate: Plate from which all other settings are taken; the default plate if None.
        """
        return dataclasses.replace(plate or Plate(), solref=self.solref, solimp=self.solimp)


def fit_foundation(indenter: Indenter, load: npt.ArrayLike, depth: npt.ArrayLike) -> FoundationFit:
    """Fit the modulus of an elastic foundation to k forces and depths: force = modulus * displaced volume.

    The displaced volume is that of the indenter below the undeformed top of the cover.  There are three estimators.
    `least-squares-force` is the unweighted fit to all forces. `lightest` and `heaviest` use the first and the last
    force alone.  They differ on a real cover, because small contacts require larger moduli.

    Args:
        indenter: Shape of the indenter.
        load: Forces on the indenter, rising, shape (k,) [N].
        depth: Approaches of the indenter since its first touch of the cover, shape (k,) [m].

    Raises:
        FastModelError: If there are fewer than two points or shapes differ.
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
    """Find contact parameters of the plate with which a free ball rests at the depth of the finite-element reference.

    The depths are simulated with a ball on the plate, which has one contact point.  With the same parameters, a face
    that rests on n contact points sinks 1 / n as deep as the ball, and a body on a slide joint a third as deep.

    Args:
        load: Forces of the reference, rising, shape (k,) [N].
        depth: Approaches of the reference at these forces, shape (k,) [m].
        matched: Load at which the depth is matched, by default the middle one of the loads [N].
        timestep: Timestep of the simulation in which the parameters will be used [s].

    Raises:
        FastModelError: If there are fewer than two points or shapes differ.
        FastModelError: If a number is not positive and finite, or the matched load is not among the loads.
    """
    force, deep = _check_curve(load, depth)
    chosen = len(force) // 2 if matched is None else int(np.abs(force - matched).argmin())
    if matched is not None and not np.isclose(force[chosen], matched, rtol=1e-6):
        raise FastModelError(f"matched must be one of the loads {force.tolist()} N, not {matched}")
    aim = float(deep[chosen])
    constant = max(_LEAST_STEPS * timestep, float(np.sqrt(aim / ((1 - _IMPEDANCE) * STANDARD_GRAVITY))))
    # This formula for the depth is exact for one contact point, as long as MuJoCo accepts the impedance.
    impedance = 1 - aim / (STANDARD_GRAVITY * constant**2)
    sinks = np.array([_simulate_depth(each / STANDARD_GRAVITY, constant, impedance, timestep) for each in force])
    return ContactFit(
        solref=(constant, 1.0),
        solimp=(impedance, impedance, 1e-3, 0.5, 2.0),
        load=float(force[chosen]),
        mass=float(force[chosen] / STANDARD_GRAVITY),
        depth=aim,
        sinks=sinks,
        misses=sinks / deep - 1,
    )


def _check_curve(load: npt.ArrayLike, depth: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Check k forces [N] and depths [m], and return them as arrays of shape (k,)."""
    force, deep = np.array(load, dtype=np.float64), np.array(depth, dtype=np.float64)
    if force.ndim != 1 or force.shape != deep.shape or len(force) < 2:  # noqa: PLR2004 -- a scatter takes two
        raise FastModelError(f"load and depth take two or more points of one shape, not {force.shape} and {deep.shape}")
    for name, values in (("load", force), ("depth", deep)):
        if not (np.isfinite(values).all() and values.min() > 0):
            raise FastModelError(f"{name} must be positive and finite, not {values.tolist()}")
    return force, deep


def _measure_volume(indenter: Indenter, depth: float) -> float:
    """Compute the volume of an indenter below the undeformed top of the cover [m3].

    The volume is the integral of max(0, depth - gap), with the gap above the indenter's lowest point.

    Args:
        indenter: Shape of the indenter.
        depth: Depth of the indenter's lowest point below the top of the cover [m].
    """
    half_x, half_y = indenter.footprint
    middle = (np.arange(_POINTS) + 0.5) / _POINTS * 2 - 1
    # The volume is summed only over the part of the footprint below the top, which is small for a ball at small depth.
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
    """Simulate a free ball on the plate, and return the depth at which the ball rests [m].

    Args:
        mass: Mass of the ball [kg].
        constant: Time constant of the contact [s].
        impedance: Impedance of the contact [-].
        timestep: Timestep of the simulation [s].
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.gravity[:] = [0, 0, -STANDARD_GRAVITY]
    spec.option.tolerance = 1e-12
    plate = Plate(solref=(constant, 1.0), solimp=(impedance, impedance, 1e-3, 0.5, 2.0))
    plate.attach(spec.worldbody.add_frame(), TexelArray.grid(4, 4, 10e-3), "fit")
    ball = Sphere(radius=10e-3)
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[ball.radius, 0, 0], pos=[0, 0, ball.radius], mass=mass)
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(int(max(_LEAST_REST, _REST * constant) / timestep)):
        mujoco.mj_step(model, data)
    return float(-data.qpos[2])
