"""Forward models of the stamp: texel forces per newton of weight as a function of the stamp's pose and the cover.

The texel forces of a rigid stamp are proportional to its weight, so a model needs one pattern per pose and cover.  Each
model is a list of candidates with a few parameters to fit.  Discrete choices, such as the Poisson ratio, give separate
candidates.
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

#: Range of the fitted sigma of the kernel [pitches].
_SIGMA = (0.15, 3.0)
#: Largest yaw of the stamp: a square is unchanged by a quarter turn [rad].
_YAW = np.pi / 4
#: Spacing of the positions that are tried with box texels [pitches].  They form a grid that is fixed in the array, so
#: that fits to other recordings reuse the simulated contacts.
_STEP = 0.25
#: Offsets of these positions from the one nearest to the first guess [steps].
_STEPS = np.arange(-2, 3)
#: Yaws that are tried with box texels [rad].
_TURNS = (-0.1, 0.0, 0.1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """Texel forces per newton of weight as a function of a few parameters.

    Attributes:
        start: Parameters at which the fit starts, shape (p,).
        lower: Lower bounds, shape (p,).
        upper: Upper bounds, shape (p,).
        texel_forces: From parameters to forces per newton of weight, shape (n,) [-].
        describe: From parameters to numbers for tables, by name with unit.
    """

    start: FloatArray
    lower: FloatArray
    upper: FloatArray
    texel_forces: Callable[[FloatArray], FloatArray]
    describe: Callable[[FloatArray], dict[str, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class StampModel:
    """A model that predicts the texel forces under the stamp.

    Attributes:
        name: Title of its row in the table of scores.
        about: Short description of the assumed pressure under the face and of the spread by the cover.
        candidates: Function from a first estimate of the stamp's position [m] to the parametrisations that are fitted
            in turn; the best fit is kept.
    """

    name: str
    about: str
    candidates: Callable[[tuple[float, float]], Sequence[Candidate]]


def models(array: TexelArray) -> tuple[StampModel, ...]:
    """The models that are scored, the fast model first."""
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
    """Uniform pressure under the face, spread by the Gaussian kernel; parameters x, y, yaw, ln(sigma)."""
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
    """Share of the stamp's face over each texel of a flat grid, masked ones included, shape (n,) [-].

    The face is cut into small squares.  They move with the face but do not rotate, which keeps the share a continuous
    function of the pose.
    """
    cell = STAMP_EDGE / pieces
    u, v = (each.ravel() for each in np.meshgrid(*2 * [(np.arange(pieces) + 0.5) * cell - STAMP_EDGE / 2]))
    columns = _interval_shares(x + np.cos(yaw) * u - np.sin(yaw) * v, array.columns, array.pitch[0], cell)
    rows = _interval_shares(y + np.sin(yaw) * u + np.cos(yaw) * v, array.rows, array.pitch[1], cell)
    return (rows.T @ columns).ravel() / pieces**2


def _interval_shares(places: FloatArray, count: int, pitch: float, cell: float) -> FloatArray:
    """Share of each small square over each column or row, shape (k, count) [-]."""
    edges = (np.arange(count + 1) - count / 2) * pitch
    return np.diff(np.clip((edges - places[:, None]) / cell + 0.5, 0, 1), axis=1)


def _spread_smoothly(array: TexelArray, sigma: float, forces: FloatArray) -> FloatArray:
    """The fast model's kernel without its cut at ksize (0.1 % of the force): a smooth function of sigma."""
    image = forces.reshape(array.rows, array.columns)
    spread = _gaussian_matrix(array.rows, sigma) @ image @ _gaussian_matrix(array.columns, sigma)
    return np.where(array.active, spread.ravel(), 0.0)


def _gaussian_matrix(count: int, sigma: float) -> FloatArray:
    """Spread along one axis by a sampled Gaussian of unit sum, shape (count, count) [-]."""
    apart = np.arange(count)[:, None] - np.arange(count)
    every = np.arange(-int(np.ceil(8 * sigma)) - 1, int(np.ceil(8 * sigma)) + 2)
    return np.asarray(np.exp(-0.5 * (apart / sigma) ** 2) / np.exp(-0.5 * (every / sigma) ** 2).sum())


def _box_candidates(array: TexelArray, guess: tuple[float, float]) -> list[Candidate]:
    """One candidate, with the parameter ln(sigma), per distinct pattern of contact forces near the guess.

    Box texels share a flat face by contact points.  The pattern is constant over ranges of the pose and jumps between
    them, so it has no gradient and the pose is found by trying.
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
    """Contact forces of the fast model at rest, per newton of weight, shape (n,) [-]."""
    parameters = Parameters(array=array, spread=Gaussian.from_sigma(1.0), electronics=WTS_0614_34)
    stamp = Box(size=(STAMP_EDGE, STAMP_EDGE, STAMP_EDGE))
    result = indent(parameters, stamp, load=5.0, at=(x, y), yaw=yaw)
    return result.contact_forces / result.total_force


def _pattern_candidate(array: TexelArray, pattern: FloatArray, poses: FloatArray) -> Candidate:
    """A pattern of contact forces that is the same at several poses (x, y, yaw), shape (k, 3)."""
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


#: Pressure under the face: from Poisson ratio [-] and thickness [m] to points, shape (k, 2) [m], and their shares of
#: the load, shape (k,) [-].
_Face = Callable[[float, float], tuple[FloatArray, FloatArray]]


def _layer_candidates(array: TexelArray, guess: tuple[float, float], face: _Face) -> list[Candidate]:
    """One candidate per Poisson ratio."""
    return [_layer_candidate(array, guess, nu, face) for nu in layer_response.POISSON_RATIOS]


def _layer_candidate(array: TexelArray, guess: tuple[float, float], poisson_ratio: float, face: _Face) -> Candidate:
    """Any pressure under the face, spread by a layer; parameters x, y, yaw, ln(thickness)."""
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
    """Pressure of the rigid punch, interpolated over the logarithm of the thickness between solved thicknesses."""
    table = np.geomspace(*layer_response.THICKNESS, 9)
    upper = int(np.clip(np.searchsorted(table, thickness), 1, len(table) - 1))
    part = np.log(thickness / table[upper - 1]) / np.log(table[upper] / table[upper - 1])
    (a, wa), (b, wb) = (layer_response.punch_pressure(poisson_ratio, float(table[i])) for i in (upper - 1, upper))
    return (1 - part) * a + part * b, (1 - part) * wa + part * wb


def _arcsine_face(_poisson_ratio: float, _thickness: float, nodes: int = 8) -> tuple[FloatArray, FloatArray]:
    """Pressure 1 / sqrt((a2 - x2)(a2 - y2)) by Gauss-Chebyshev points, which have equal weights."""
    line = STAMP_EDGE / 2 * np.cos((np.arange(nodes) + 0.5) * np.pi / nodes)
    x, y = (each.ravel() for each in np.meshgrid(line, line))
    return np.column_stack([x, y]), np.full(nodes**2, 1 / nodes**2)


def _position_bounds(array: TexelArray) -> tuple[FloatArray, FloatArray]:
    """Bounds on the position that keep most of the stamp on the array, along x and y [m]."""
    half = np.maximum(np.array(array.extent) / 2 - STAMP_EDGE / 4, max(array.pitch))
    return -half, half


def _describe_pose(shape: FloatArray) -> dict[str, float]:
    return {"x_m": float(shape[0]), "y_m": float(shape[1]), "yaw_rad": float(shape[2])}


def _describe_sigma(array: TexelArray, log_sigma: float) -> Mapping[str, float]:
    """Sigma, and for each Poisson ratio the thickness with this sigma: the Gaussian does not separate the two."""
    sigma = float(np.exp(log_sigma))
    same = layer_response.thickness_of_sigma(array, sigma)
    return {"sigma_pitches": sigma} | {f"thickness_m_at_nu_{nu:g}": h for nu, h in same.items()}
