"""Forward models of the stamp: texel forces per newton of weight, from stamp pose and cover.

A rigid stamp's forces scale with its weight, so a model is one pattern per pose and cover.  Each model is a list of
candidates; a candidate has a few numbers to fit and cannot be continued into the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from fastmodel import WTS_0614_34, Gaussian, Parameters, indent
from meshes import Box, TexelArray
from validation.calibration.stamp import layer_response
from validation.recordings.series import STAMP_EDGE

FloatArray = npt.NDArray[np.float64]

#: Fitted width of the kernel [pitches].
_SIGMA = (0.15, 3.0)
#: The square stamp looks the same after a quarter turn.
_YAW = np.pi / 4
#: Lattice of poses that the box texels are tried on: multiples of a quarter pitch, and yaw [rad].  It is fixed in the
#: array, so that fits to other recordings find their settled contacts done.
_STEP = 0.25
_STEPS = np.arange(-2, 3)
_TURNS = (-0.1, 0.0, 0.1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """Texel forces per newton as a function of a few numbers.

    Attributes:
        start: Where the fit starts, shape (p,).
        lower: Lower bounds, shape (p,).
        upper: Upper bounds, shape (p,).
        texel_forces: From such numbers to forces per newton of weight, shape (n,) [-].
        describe: From such numbers to what a reader wants to know, by name with its unit.
    """

    start: FloatArray
    lower: FloatArray
    upper: FloatArray
    texel_forces: Callable[[FloatArray], FloatArray]
    describe: Callable[[FloatArray], dict[str, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class StampModel:
    """A forward model.

    Attributes:
        name: Row title.
        about: One sentence: how the load is shared over the face and how the cover spreads it.
        candidates: From a first guess of the stamp's place [m] to candidates.
    """

    name: str
    about: str
    candidates: Callable[[tuple[float, float]], Sequence[Candidate]]


def models(array: TexelArray) -> tuple[StampModel, ...]:
    """The models that are scored, the fast model first."""
    return (
        StampModel(
            name="fast model",
            about="MuJoCo box texels share the weight by contact points; fitted Gaussian",
            candidates=lambda guess: _boxes(array, guess),
        ),
        StampModel(
            name="uniform pressure",
            about="the weight shared by overlapped area; fitted Gaussian",
            candidates=lambda guess: [uniform(array, guess)],
        ),
        StampModel(
            name="reference",
            about="frictionless rigid punch on one bonded linear layer, finite elements throughout",
            candidates=lambda guess: [_layer(array, guess, nu, _punch) for nu in layer_response.POISSON_RATIOS],
        ),
        StampModel(
            name="edge-loaded punch",
            about="pressure 1 / sqrt((a2 - x2)(a2 - y2)), as on a cover much deeper than the stamp is wide; "
            "finite-element spread",
            candidates=lambda guess: [_layer(array, guess, nu, _arcsine) for nu in layer_response.POISSON_RATIOS],
        ),
    )


def uniform(array: TexelArray, guess: tuple[float, float]) -> Candidate:
    """Uniform pressure under the face, then a Gaussian on texel sums: (x, y, yaw, ln sigma)."""
    low, high = _reach(array)

    def texel_forces(shape: FloatArray) -> FloatArray:
        return _smooth(array, float(np.exp(shape[3])), overlap(array, shape[0], shape[1], shape[2]))

    return Candidate(
        start=np.array([*np.clip(guess, low, high), 0.0, np.log(0.6)]),
        lower=np.array([*low, -_YAW, np.log(_SIGMA[0])]),
        upper=np.array([*high, _YAW, np.log(_SIGMA[1])]),
        texel_forces=texel_forces,
        describe=lambda shape: {**_pose(shape), **_sigma(array, shape[3])},
    )


def overlap(array: TexelArray, x: float, y: float, yaw: float, pieces: int = 40) -> FloatArray:
    """Share of the stamp's face over each texel of a flat grid, masked ones included, shape (n,) [-].

    The face is cut into small squares that are not turned with it, so that the share is continuous in the pose.
    """
    cell = STAMP_EDGE / pieces
    u, v = (each.ravel() for each in np.meshgrid(*2 * [(np.arange(pieces) + 0.5) * cell - STAMP_EDGE / 2]))
    columns = _shares(x + np.cos(yaw) * u - np.sin(yaw) * v, array.columns, array.pitch[0], cell)
    rows = _shares(y + np.sin(yaw) * u + np.cos(yaw) * v, array.rows, array.pitch[1], cell)
    return (rows.T @ columns).ravel() / pieces**2


def _shares(places: FloatArray, count: int, pitch: float, cell: float) -> FloatArray:
    """Share of each small square over each column or row, shape (k, count) [-]."""
    edges = (np.arange(count + 1) - count / 2) * pitch
    return np.diff(np.clip((edges - places[:, None]) / cell + 0.5, 0, 1), axis=1)


def _smooth(array: TexelArray, sigma: float, forces: FloatArray) -> FloatArray:
    """The fast model's kernel on texel sums, without its cut at ksize (0.1 % of the force) to stay smooth in sigma."""
    image = forces.reshape(array.rows, array.columns)
    spread = _axis(array.rows, sigma) @ image @ _axis(array.columns, sigma)
    return np.where(array.active, spread.ravel(), 0.0)


def _axis(count: int, sigma: float) -> FloatArray:
    apart = np.arange(count)[:, None] - np.arange(count)
    every = np.arange(-int(np.ceil(8 * sigma)) - 1, int(np.ceil(8 * sigma)) + 2)
    return np.asarray(np.exp(-0.5 * (apart / sigma) ** 2) / np.exp(-0.5 * (every / sigma) ** 2).sum())


def _boxes(array: TexelArray, guess: tuple[float, float]) -> list[Candidate]:
    """One candidate (ln sigma) per distinct pattern of contact forces near the guess.

    Box texels split a flat face by contact points, so the pattern is the same over ranges of pose: it jumps and cannot
    be fitted by slopes.
    """
    low, high = _reach(array)
    grain = _STEP * np.array(array.pitch)
    start = np.round(np.divide(guess, grain))
    found: dict[tuple[float, ...], tuple[FloatArray, list[tuple[float, float, float]]]] = {}
    for step_y in _STEPS:
        for step_x in _STEPS:
            place = np.clip(np.add(start, (step_x, step_y)) * grain, low, high)
            for yaw in _TURNS:
                pose = (float(place[0]), float(place[1]), yaw)
                pattern = _contact(_Grid(array), *pose)
                found.setdefault(tuple(np.round(pattern, 3)), (pattern, []))[1].append(pose)
    return [_fixed(array, pattern, np.array(poses)) for pattern, poses in found.values()]


class _Grid:
    """An array that can be a key of a cache: equal when the texels are."""

    def __init__(self, array: TexelArray) -> None:
        self.array = array
        self._key = (array.rows, array.columns, array.pitch, array.texel_size, array.active.tobytes())

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Grid) and other._key == self._key


@cache
def _contact(grid: _Grid, x: float, y: float, yaw: float) -> FloatArray:
    """Contact forces of the settled fast model per newton of weight, shape (n,) [-]."""
    parameters = Parameters(array=grid.array, spread=Gaussian.from_sigma(1.0), electronics=WTS_0614_34)
    stamp = Box(size=(STAMP_EDGE, STAMP_EDGE, STAMP_EDGE))
    result = indent(parameters, stamp, load=5.0, at=(x, y), yaw=yaw)
    return result.contact_forces / result.total_force


def _fixed(array: TexelArray, pattern: FloatArray, poses: FloatArray) -> Candidate:
    middle, spread = poses.mean(axis=0), np.ptp(poses, axis=0) / 2
    return Candidate(
        start=np.array([np.log(0.6)]),
        lower=np.log(_SIGMA[:1]),
        upper=np.log(_SIGMA[1:]),
        texel_forces=lambda shape: _smooth(array, float(np.exp(shape[0])), pattern),
        describe=lambda shape: {
            **_pose(middle),
            "x_undetermined_m": float(spread[0]),
            "y_undetermined_m": float(spread[1]),
            **_sigma(array, shape[0]),
        },
    )


_Face = Callable[[float, float], tuple[FloatArray, FloatArray]]


def _layer(array: TexelArray, guess: tuple[float, float], poisson_ratio: float, face: _Face) -> Candidate:
    """Any pressure under the face, spread by a layer: (x, y, yaw, ln thickness)."""
    low, high = _reach(array)

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
            **_pose(shape),
            "thickness_m": float(np.exp(shape[3])),
            "poisson_ratio": poisson_ratio,
        },
    )


def _punch(poisson_ratio: float, thickness: float) -> tuple[FloatArray, FloatArray]:
    """Between the solved thicknesses around, linear in the logarithm, so that the fit sees a smooth function."""
    table = np.geomspace(*layer_response.THICKNESS, 9)
    upper = int(np.clip(np.searchsorted(table, thickness), 1, len(table) - 1))
    part = np.log(thickness / table[upper - 1]) / np.log(table[upper] / table[upper - 1])
    (a, wa), (b, wb) = (layer_response.punch_pressure(poisson_ratio, float(table[i])) for i in (upper - 1, upper))
    return (1 - part) * a + part * b, (1 - part) * wa + part * wb


def _arcsine(_poisson_ratio: float, _thickness: float, nodes: int = 8) -> tuple[FloatArray, FloatArray]:
    """Gauss-Chebyshev points, whose equal weights are the pressure 1 / sqrt((a2 - x2)(a2 - y2))."""
    line = STAMP_EDGE / 2 * np.cos((np.arange(nodes) + 0.5) * np.pi / nodes)
    x, y = (each.ravel() for each in np.meshgrid(line, line))
    return np.column_stack([x, y]), np.full(nodes**2, 1 / nodes**2)


def _reach(array: TexelArray) -> tuple[FloatArray, FloatArray]:
    """Places that keep the stamp's middle well on the array [m]."""
    half = np.maximum(np.array(array.extent) / 2 - STAMP_EDGE / 4, max(array.pitch))
    return -half, half


def _pose(shape: FloatArray) -> dict[str, float]:
    return {"x_m": float(shape[0]), "y_m": float(shape[1]), "yaw_rad": float(shape[2])}


def _sigma(array: TexelArray, log_sigma: float) -> Mapping[str, float]:
    """Sigma and the covers that have it: thickness and Poisson ratio are not told apart by a Gaussian."""
    sigma = float(np.exp(log_sigma))
    same = layer_response.thickness_of_sigma(array, sigma)
    return {"sigma_pitches": sigma} | {f"thickness_m_at_nu_{nu:g}": h for nu, h in same.items()}
