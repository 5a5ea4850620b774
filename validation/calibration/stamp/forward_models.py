"""Forward models of the stamp: texel forces per newton of weight as a function of the stamp's pose and the cover.

The stamp is a rigid flat square indenter.  Texel forces under it are proportional to its weight, so a model computes
one pattern of forces for each pose and cover.  A model is a list of candidates.  A candidate is one parametrisation
with a few continuous parameters to fit; discrete choices, such as the Poisson ratio, give separate candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from fastmodel import WTS_0614_34, Gaussian, Parameters, indent
from meshes import Box
from meshes.array import FloatArray, TexelArray
from validation.calibration.stamp import layer_response
from validation.recordings.series import STAMP_EDGE

#: Bounds of the fitted standard deviation sigma of the Gaussian kernel of the spread [pitches].
_SIGMA = (0.15, 3.0)
#: Bound of |yaw| of the stamp in the fit [rad]; a square is unchanged by a quarter turn.
_YAW = np.pi / 4
#: Spacing of the grid of stamp positions at which the fast model is simulated [pitches].  The grid is fixed to the
#: array, so that fits to other recordings reuse the simulated contact forces.
_STEP = 0.25
#: Offsets along x and y of the simulated positions from the grid position nearest to the first estimate [steps].
_STEPS = np.arange(-2, 3)
#: Yaws of the stamp at which the fast model is simulated [rad].
_TURNS = (-0.1, 0.0, 0.1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """Parametrisation of a forward model: texel forces per newton of weight as a function of p parameters.

    Attributes:
        start: Initial parameters of the fit, shape (p,).
        lower: Lower bounds of the parameters, shape (p,).
        upper: Upper bounds of the parameters, shape (p,).
        texel_forces: Function from the parameters to the force on each of the n texels per newton of weight,
            shape (n,) [-].
        describe: Function from the parameters to their physical values, by name with unit, for tables.
    """

    start: FloatArray
    lower: FloatArray
    upper: FloatArray
    texel_forces: Callable[[FloatArray], FloatArray]
    describe: Callable[[FloatArray], dict[str, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class StampModel:
    """A forward model: predicts the texel forces under the stamp from its weight and pose and from the cover.

    Attributes:
        name: Name of the model in the table of scores.
        about: Short description of the assumed pressure under the face of the stamp and of the spread by the cover.
        candidates: Function from a first estimate of the stamp's position x, y [m] to the parametrisations to fit; the
            fit with the smallest residual is used.
    """

    name: str
    about: str
    candidates: Callable[[tuple[float, float]], Sequence[Candidate]]


def models(array: TexelArray) -> tuple[StampModel, ...]:
    """Return the forward models that are scored for the stamp on an array, the fast model first."""
    return (
        StampModel(
            name="fast model",
            about="MuJoCo box texels share the weight by contact points; fitted Gaussian spread",
            candidates=lambda guess: _box_candidates(array, guess),
        ),
        StampModel(
            name="uniform pressure",
            about="the weight shared by overlapped area; fitted Gaussian spread",
            candidates=lambda guess: [uniform(array, guess)],
        ),
        StampModel(
            name="reference",
            about="frictionless rigid punch on one bonded linear layer, finite elements throughout",
            candidates=lambda guess: _layer_candidates(array, guess, _punch_face),
        ),
        StampModel(
            name="edge-loaded punch",
            about="pressure 1 / sqrt((a2 - x2)(a2 - y2)), as on a cover much deeper than the stamp is wide; "
            "finite-element spread",
            candidates=lambda guess: _layer_candidates(array, guess, _arcsine_face),
        ),
    )


def uniform(array: TexelArray, guess: tuple[float, float]) -> Candidate:
    """Make a candidate with uniform pressure under the face of the stamp, spread by a Gaussian kernel.

    Its parameters are x, y [m], yaw [rad] and ln(sigma), with the standard deviation sigma of the kernel [pitches].

    Args:
        array: The texels.
        guess: Initial position x, y of the stamp [m].
    """
    low, high = _position_bounds(array)

    def texel_forces(shape: FloatArray) -> FloatArray:
        return _spread_smoothly(array, float(np.exp(shape[3])), overlap(array, shape[0], shape[1], shape[2]))

    return Candidate(
        start=np.array([*np.clip(guess, low, high), 0.0, np.log(0.6)]),
        lower=np.array([*low, -_YAW, np.log(_SIGMA[0])]),
        upper=np.array([*high, _YAW, np.log(_SIGMA[1])]),
        texel_forces=texel_forces,
        describe=lambda shape: {**_describe_pose(shape), **_describe_sigma(array, shape[3])},
    )


def overlap(array: TexelArray, x: float, y: float, yaw: float, pieces: int = 40) -> FloatArray:
    """Return the share of the area of the stamp's face over each texel, masked texels included, shape (n,) [-].

    The face is divided into small squares.  The centres of the squares move and rotate with the face, while their edges
    stay parallel to the axes of the array.  The shares are then continuous functions of the pose.

    Args:
        array: A flat grid of texels.
        x: Position of the centre of the stamp along x [m].
        y: Position of the centre of the stamp along y [m].
        yaw: Rotation of the stamp about z [rad].
        pieces: Number of squares along each edge of the face [-].
    """
    cell = STAMP_EDGE / pieces
    u, v = (each.ravel() for each in np.meshgrid(*2 * [(np.arange(pieces) + 0.5) * cell - STAMP_EDGE / 2]))
    columns = _interval_shares(x + np.cos(yaw) * u - np.sin(yaw) * v, array.columns, array.pitch[0], cell)
    rows = _interval_shares(y + np.sin(yaw) * u + np.cos(yaw) * v, array.rows, array.pitch[1], cell)
    return (rows.T @ columns).ravel() / pieces**2


def _interval_shares(places: FloatArray, count: int, pitch: float, cell: float) -> FloatArray:
    """Return the share of the width of each of k intervals that lies over each column (or row) of an array.

    Args:
        places: Centres of the intervals along one axis, shape (k,) [m].
        count: Number of columns (or rows) of the array [-].
        pitch: Width of a column (or row) [m].
        cell: Width of an interval [m].

    Returns:
        Shares, shape (k, count) [-].
    """
    edges = (np.arange(count + 1) - count / 2) * pitch
    return np.diff(np.clip((edges - places[:, None]) / cell + 0.5, 0, 1), axis=1)


def _spread_smoothly(array: TexelArray, sigma: float, forces: FloatArray) -> FloatArray:
    """Spread forces by the Gaussian kernel of the fast model, without the truncation of the kernel.

    The truncation removes 0.1 % of the force and would make the result a discontinuous function of sigma.

    Args:
        array: The texels.
        sigma: Standard deviation of the kernel [pitches].
        forces: Contact forces on the n texels, shape (n,).

    Returns:
        Measured texel forces in the unit of `forces`, shape (n,); 0 on masked texels.
    """
    image = forces.reshape(array.rows, array.columns)
    spread = _gaussian_matrix(array.rows, sigma) @ image @ _gaussian_matrix(array.columns, sigma)
    return np.where(array.active, spread.ravel(), 0.0)


def _gaussian_matrix(count: int, sigma: float) -> FloatArray:
    """Return the matrix that spreads forces along one axis by a sampled Gaussian of unit sum, shape (count, count)."""
    apart = np.arange(count)[:, None] - np.arange(count)
    every = np.arange(-int(np.ceil(8 * sigma)) - 1, int(np.ceil(8 * sigma)) + 2)
    return np.asarray(np.exp(-0.5 * (apart / sigma) ** 2) / np.exp(-0.5 * (every / sigma) ** 2).sum())


def _box_candidates(array: TexelArray, guess: tuple[float, float]) -> list[Candidate]:
    """Make the candidates of the fast model: one per distinct pattern of contact forces near a first position.

    The fast model represents texels by boxes that share a flat face by contact points.  The pattern of contact forces
    is a piecewise constant function of the pose, without a usable gradient.  The pose is therefore found by a search
    over a grid of poses, and the only fitted parameter of a candidate is ln(sigma) of the Gaussian kernel.
    """
    low, high = _position_bounds(array)
    grain = _STEP * np.array(array.pitch)
    start = np.round(np.divide(guess, grain))
    found: dict[tuple[float, ...], tuple[FloatArray, list[tuple[float, float, float]]]] = {}
    for step_y in _STEPS:
        for step_x in _STEPS:
            place = np.clip(np.add(start, (step_x, step_y)) * grain, low, high)
            for yaw in _TURNS:
                pose = (float(place[0]), float(place[1]), yaw)
                pattern = _contact_pattern(array, *pose)
                found.setdefault(tuple(np.round(pattern, 3)), (pattern, []))[1].append(pose)
    return [_pattern_candidate(array, pattern, np.array(poses)) for pattern, poses in found.values()]


@cache
def _contact_pattern(array: TexelArray, x: float, y: float, yaw: float) -> FloatArray:
    """Simulate the stamp on the fast model until it is at rest, and return the contact forces over their sum.

    Args:
        array: The texels.
        x: Position of the stamp along x [m].
        y: Position of the stamp along y [m].
        yaw: Rotation of the stamp about z [rad].

    Returns:
        Contact force on each texel per newton of weight, shape (n,) [-].
    """
    parameters = Parameters(array=array, spread=Gaussian.from_sigma(1.0), electronics=WTS_0614_34)
    stamp = Box(size=(STAMP_EDGE, STAMP_EDGE, STAMP_EDGE))
    result = indent(parameters, stamp, load=5.0, at=(x, y), yaw=yaw)
    return result.contact_forces / result.total_force


def _pattern_candidate(array: TexelArray, pattern: FloatArray, poses: FloatArray) -> Candidate:
    """Make a candidate from a pattern of contact forces that is the same at k poses.

    Args:
        array: The texels.
        pattern: Contact force on each texel per newton of weight, shape (n,) [-].
        poses: The poses x [m], y [m], yaw [rad], shape (k, 3).
    """
    middle, spread = poses.mean(axis=0), np.ptp(poses, axis=0) / 2
    return Candidate(
        start=np.array([np.log(0.6)]),
        lower=np.log(_SIGMA[:1]),
        upper=np.log(_SIGMA[1:]),
        texel_forces=lambda shape: _spread_smoothly(array, float(np.exp(shape[0])), pattern),
        describe=lambda shape: {
            **_describe_pose(middle),
            "x_undetermined_m": float(spread[0]),
            "y_undetermined_m": float(spread[1]),
            **_describe_sigma(array, shape[0]),
        },
    )


#: Pressure under the face of the stamp as point forces: function from Poisson ratio [-] and thickness [m] of the cover
#: to k points in the stamp's frame, shape (k, 2) [m], and their shares of the load, shape (k,) [-].
_Face = Callable[[float, float], tuple[FloatArray, FloatArray]]


def _layer_candidates(array: TexelArray, guess: tuple[float, float], face: _Face) -> list[Candidate]:
    """Make one candidate per Poisson ratio in `layer_response.POISSON_RATIOS` for a pressure under the stamp."""
    return [_layer_candidate(array, guess, nu, face) for nu in layer_response.POISSON_RATIOS]


def _layer_candidate(array: TexelArray, guess: tuple[float, float], poisson_ratio: float, face: _Face) -> Candidate:
    """Make a candidate with a given pressure under the face of the stamp, spread by one elastic layer.

    Its parameters are x, y [m], yaw [rad] and ln(thickness) with the thickness of the layer in metres.
    """
    low, high = _position_bounds(array)

    def texel_forces(shape: FloatArray) -> FloatArray:
        thickness = float(np.exp(shape[3]))
        places, shares = face(poisson_ratio, thickness)
        c, s = np.cos(shape[2]), np.sin(shape[2])
        turned = places @ np.array([[c, s], [-s, c]]) + shape[:2]
        return np.asarray(shares @ layer_response.influence(array, poisson_ratio, thickness, turned))

    return Candidate(
        start=np.array([*np.clip(guess, low, high), 0.0, np.log(4e-3)]),
        lower=np.array([*low, -_YAW, np.log(layer_response.THICKNESS[0])]),
        upper=np.array([*high, _YAW, np.log(layer_response.THICKNESS[1])]),
        texel_forces=texel_forces,
        describe=lambda shape: {
            **_describe_pose(shape),
            "thickness_m": float(np.exp(shape[3])),
            "poisson_ratio": poisson_ratio,
        },
    )


def _punch_face(poisson_ratio: float, thickness: float) -> tuple[FloatArray, FloatArray]:
    """Return the pressure under a rigid punch on one layer as points [m] and shares of the load, see `_Face`.

    The pressure is interpolated linearly in ln(thickness) between nine thicknesses for which the contact is solved.
    """
    table = np.geomspace(*layer_response.THICKNESS, 9)
    upper = int(np.clip(np.searchsorted(table, thickness), 1, len(table) - 1))
    part = np.log(thickness / table[upper - 1]) / np.log(table[upper] / table[upper - 1])
    (a, wa), (b, wb) = (layer_response.punch_pressure(poisson_ratio, float(table[i])) for i in (upper - 1, upper))
    return (1 - part) * a + part * b, (1 - part) * wa + part * wb


def _arcsine_face(_poisson_ratio: float, _thickness: float, nodes: int = 8) -> tuple[FloatArray, FloatArray]:
    """Return the pressure 1 / sqrt((a^2 - x^2)(a^2 - y^2)) as points [m] and shares of the load, see `_Face`.

    a is half the edge of the stamp.  The points are those of the Gauss-Chebyshev quadrature, which have equal weights.
    """
    line = STAMP_EDGE / 2 * np.cos((np.arange(nodes) + 0.5) * np.pi / nodes)
    x, y = (each.ravel() for each in np.meshgrid(line, line))
    return np.column_stack([x, y]), np.full(nodes**2, 1 / nodes**2)


def _position_bounds(array: TexelArray) -> tuple[FloatArray, FloatArray]:
    """Return lower and upper bounds of the stamp's position x, y that keep most of the stamp on the array [m]."""
    half = np.maximum(np.array(array.extent) / 2 - STAMP_EDGE / 4, max(array.pitch))
    return -half, half


def _describe_pose(shape: FloatArray) -> dict[str, float]:
    return {"x_m": float(shape[0]), "y_m": float(shape[1]), "yaw_rad": float(shape[2])}


def _describe_sigma(array: TexelArray, log_sigma: float) -> Mapping[str, float]:
    """Return sigma of the Gaussian kernel [pitches] and, by Poisson ratio, the layer thickness with this sigma [m].

    The Gaussian kernel alone does not determine thickness and Poisson ratio separately.
    """
    sigma = float(np.exp(log_sigma))
    same = layer_response.thickness_of_sigma(array, sigma)
    return {"sigma_pitches": sigma} | {f"thickness_m_at_nu_{nu:g}": h for nu, h in same.items()}
