"""A moving case: an indenter whose load or place changes in time, and the static states from which it is computed.

The cover is elastic and its inertia is negligible, so that the force on each texel follows from the load and the place
at the same instant.  A few static presses along the history therefore give the forces at every instant: the shares of
the load that the texels measure are interpolated between them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from meshes import Indenter, Pose
from meshes.array_types import FloatArray, IntArray
from validation.campaign.case import Case
from validation.errors import InputError
from validation.places import Places
from validation.schema import parse
from validation.schema.campaign import LONGEST_HISTORY, MovingTable

#: Number of states along a change of the load [-].  Their loads are cubes, because the radius of a round contact on a
#: thick cover grows with the cube root of the load.
_LOADS = 8
#: Largest distance of two states along a motion, over the pitch [-].
_STEP = 0.25
#: Smallest number of intervals between states along a motion [-].
_FEWEST = 4
#: Largest distance that a moving case moves [m].
_FARTHEST = 0.5
#: Distance over which a motion counts as one change [m].
_MILLIMETRE = 1e-3


class Curve(NamedTuple):
    """Static states along one part of a history.

    Attributes:
        positions: Ascending coordinate of each state: the cube root of the load over the largest load, or the share of
            a motion that is done, shape (m,) [-].
        cases: The states.
    """

    positions: FloatArray
    cases: tuple[Case, ...]


class Samples(NamedTuple):
    """A history at k instants.

    Attributes:
        times: The instants, shape (k,) [s].
        loads: Load at each instant, shape (k,) [N].
        curves: Index of the curve to which each instant belongs, shape (k,) [-].
        positions: Coordinate on the curve at each instant, shape (k,) [-].
    """

    times: FloatArray
    loads: FloatArray
    curves: IntArray
    positions: FloatArray


@dataclass(frozen=True, kw_only=True)
class MovingCase:
    """An indenter whose load and place are linear in time between given instants.

    Attributes:
        name: Short name, unique in its campaign.
        indenter: Rigid body that presses on the cover.
        shape: The indenter as text, for example `sphere:radius=5mm`.
        times: Ascending instants, the first one is zero [s].
        loads: Load at each instant [N].
        poses: Position of first touch at each instant, direction and rotation of the indenter.
        repeat: How often the history happens, one time after the other [-].
    """

    name: str
    indenter: Indenter
    shape: str
    times: tuple[float, ...]
    loads: tuple[float, ...]
    poses: tuple[Pose, ...]
    repeat: int = 1

    @property
    def duration(self) -> float:
        """Time of the whole history with its repetitions [s]."""
        return self.repeat * self.times[-1]

    @property
    def fastest(self) -> float:
        """Highest frequency that the history contains, 0.35 over its shortest change [Hz]; 0 if constant.

        A change is one of the load, or a motion by a millimetre.  The bandwidth of a ramp is 0.35 over its rise time,
        as for the response of a first-order system from 10 % to 90 %.
        """
        changes = []
        for k, (before, after) in enumerate(itertools.pairwise(self.times)):
            if self.loads[k] != self.loads[k + 1]:
                changes.append(after - before)
            if way := math.dist(self.poses[k].point, self.poses[k + 1].point):
                changes.append((after - before) * min(1.0, _MILLIMETRE / way))
        return 0.35 / min(changes) if changes else 0.0

    def divide(self, pitch: float) -> list[Curve]:
        """Divide the history into curves of static states; equal parts share a curve.

        Args:
            pitch: Distance of the texels [m].
        """
        return [self._place_states(*key, pitch) for key in dict.fromkeys(self._keys())]

    def sample(self, rate: float) -> Samples:
        """Sample the history.

        Args:
            rate: Instants per second [Hz].
        """
        times = np.arange(math.floor(self.duration * rate + 1e-9) + 1) / rate
        within = np.where(times < self.duration, times % self.times[-1], self.times[-1])
        part = np.clip(np.searchsorted(self.times, within, side="right") - 1, 0, len(self.times) - 2)
        start, end = np.array(self.times)[part], np.array(self.times)[part + 1]
        done = (within - start) / (end - start)
        loads = (1 - done) * np.array(self.loads)[part] + done * np.array(self.loads)[part + 1]
        keys = list(self._keys())
        order = {key: number for number, key in enumerate(dict.fromkeys(keys))}
        moves = np.array([before != after for before, after, *_ in keys])[part]
        positions = np.where(moves, done, np.cbrt(loads / max(self.loads)))
        return Samples(times, loads, np.array([order[key] for key in keys])[part], positions)

    def _keys(self) -> Iterator[tuple[Pose, Pose, float, float]]:
        """Yield poses and loads at the ends of each part; parts at a place where the load changes have equal keys."""
        ends = list(zip(self.poses, self.poses[1:], self.loads, self.loads[1:], strict=False))
        varied = {before for before, after, low, high in ends if before == after and low != high}
        for before, after, low, high in ends:
            is_ramp = before == after and before in varied
            yield before, after, 0.0 if is_ramp else low, max(self.loads) if is_ramp else high

    def _place_states(self, before: Pose, after: Pose, low: float, high: float, pitch: float) -> Curve:
        """Place the states of one curve, see `_keys`."""
        most, least = max(self.loads), max(self.loads) / _LOADS**3
        if before == after:
            ends = [(high / most) ** (1 / 3)] if low == high else [k / _LOADS for k in range(1, _LOADS + 1)]
            states = [(position, before, max(least, most * position**3)) for position in ends]
        else:
            start, way = np.array(before.point), np.subtract(after.point, before.point)
            count = max(_FEWEST, math.ceil(float(np.linalg.norm(way)) / (_STEP * pitch)))
            states = [
                (
                    k / count,
                    replace(before, point=tuple((start + k / count * way).tolist())),
                    max(least, low + k / count * (high - low)),
                )
                for k in range(count + 1)
            ]
        cases = tuple(self.make_state(pose, float(f"{load:.6g}")) for _, pose, load in states)
        return Curve(np.array([position for position, *_ in states]), cases)

    def make_state(self, pose: Pose, load: float) -> Case:
        """Return the static press under a load [N]."""
        name = f"{self.name}, {load:.3g} N"
        return Case(name=name, indenter=self.indenter, shape=self.shape, load=load, pose=pose)


def interpolate(curve: Curve, shares: Sequence[FloatArray] | FloatArray, positions: FloatArray) -> FloatArray:
    """Interpolate the shares of the m states of a curve by a cubic spline; beyond its ends they are constant.

    Args:
        curve: The curve.
        shares: Share of the load in each state, shape (m, ...) [-].
        positions: Coordinates, shape (k,) [-].

    Returns:
        Shares at the coordinates, shape (k, ...) [-].
    """
    from scipy.interpolate import make_interp_spline

    nodes, values = curve.positions, np.asarray(shares)
    spline = make_interp_spline(nodes, values, k=min(3, len(nodes) - 1))
    return np.asarray(spline(np.clip(positions, nodes[0], nodes[-1])))


def estimate_interpolation(curve: Curve, shares: FloatArray) -> float:
    """Estimate the error of the interpolation: the share of the load on wrong texels, largest over the curve [-].

    Every other state is left out and interpolated.  The error of a cubic spline falls with the fourth power of the
    distance of the states; an eighth of the error with half of the states is taken.

    Args:
        curve: The curve of m states.
        shares: Share of the load on each of n texels, shape (m, n) [-].
    """
    if len(curve.cases) < _FEWEST:
        return 0.0
    kept = sorted({*range(len(curve.cases) - 1, -1, -2), 0})
    coarse = Curve(curve.positions[kept], tuple(curve.cases[k] for k in kept))
    found = interpolate(coarse, shares[kept], curve.positions)
    return float(0.5 * np.abs(found - shares).sum(axis=1).max() / 8)


def read_moving(
    listed: Sequence[Any], places: Places, *, scale: float = 1.0, deepest: float | None = None
) -> tuple[list[MovingCase], list[str]]:
    """Read the tables `[[moving]]` of a campaign file; return the cases and all faults.

    Args:
        listed: The tables, as the TOML parser returns them.
        places: Places on the cover.
        scale: Factor on all loads [-].
        deepest: Depth over thickness to which the loads of a case are lowered; None for no limit [-].
    """
    cases: list[MovingCase] = []
    faults: list[str] = []
    for number, data in enumerate(listed):
        place = f"moving[{number}]"
        try:
            case = _read_case(data, number, places)
        except InputError as error:
            faults += error.faults
            continue
        if any(case.name == other.name for other in cases):
            faults.append(f"{place}.name: {case.name!r} is used already; every case needs its own")
        else:
            cases.append(_limit_loads(case, places, scale, deepest))
    return cases, faults


def _limit_loads(case: MovingCase, places: Places, scale: float, deepest: float | None) -> MovingCase:
    """Scale the loads of a case, and lower them by one factor where they press deeper than a share of the cover."""
    if deepest is not None:
        most = replace(case.make_state(case.poses[0], max(case.loads)), load=scale * max(case.loads))
        scale *= min(1.0, places.limit_load(most, deepest) / most.load)
    return case if scale == 1 else replace(case, loads=tuple(float(f"{scale * load:.2g}") for load in case.loads))


def _read_case(data: Mapping[str, Any], number: int, places: Places) -> MovingCase:
    """Read one table `[[moving]]`."""
    place = f"moving[{number}]"
    table = parse(data, MovingTable, place=("moving", number))
    texts = {key: text for key in ("yaw", "tilt") if (text := getattr(table, key)) is not None}
    found = [places.find(places.parse({"at": at, **texts}, f"{place}.")) for at in table.at]
    count = len(table.time)
    loads, poses = list(table.load), found
    loads, poses = loads * (count if len(loads) == 1 else 1), poses * (count if len(poses) == 1 else 1)
    for key, given in (("load", len(loads)), ("at", len(poses))):
        if given != count:
            raise InputError(f"{place}.{key}: {given} values for {count} instants; give one for each, or one value")
    if len(set(poses)) > 1 and not all(pose.is_planar for pose in poses):
        raise InputError(f"{place}.at: motions along a curved cover are not computed; give one place")
    if table.repeat > 1 and (loads[0] != loads[-1] or poses[0] != poses[-1]):
        raise InputError(f"{place}.repeat: the history must end with the load and the place with which it begins")
    if table.repeat * table.time[-1] > LONGEST_HISTORY:
        raise InputError(
            f"{place}.time: {table.repeat * table.time[-1]:.4g} s with repetitions; at most {LONGEST_HISTORY:g} s"
        )
    far = sum(math.dist(one.point, other.point) for one, other in itertools.pairwise(poses))
    if far > _FARTHEST:
        raise InputError(f"{place}.at: the motion is {far:.3g} m long; at most {_FARTHEST:g} m are computed")
    return MovingCase(
        name=table.name,
        indenter=table.indenter,
        shape=data["indenter"],
        times=tuple(table.time),
        loads=tuple(loads),
        poses=tuple(poses),
        repeat=table.repeat,
    )
