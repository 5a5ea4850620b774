"""Histories: loads, depths or places in time; and moving cases with the static states from which they are computed.

The cover of a moving case is elastic and its inertia is negligible, so that the force on each texel follows from the
load and the place at the same instant.  A few static presses along the history therefore give the forces at every
instant: the shares of the load that the texels measure are interpolated between them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from meshes import Indenter, Pose
from meshes.array_types import BoolArray, FloatArray, IntArray
from validation.campaign.case import Case
from validation.errors import InputError, at
from validation.moving.inertia import BANDWIDTH
from validation.places import FlatPlaces, Places
from validation.recordings.tables import read_history
from validation.schema import parse
from validation.schema.campaign import LONGEST_HISTORY, MOST_INSTANTS, MovingTable
from validation.schema.types import check_below

#: Number of states along a change of the load [-].  Their loads are cubes, because the radius of a round contact on a
#: thick cover grows with the cube root of the load.
_LOADS = 8
#: Largest distance of two states along a motion, over the pitch [-].
_STEP = 0.25
#: Largest load [N] or depth [m] of a history.
_LARGEST = 1e6
#: Smallest number of intervals between states along a motion [-].
_FEWEST = 4
#: Largest distance that a moving case moves [m], and its largest number of different runs, see `_Run` [-].
_FARTHEST, _MOST_RUNS = 0.5, 100
#: Cosine of the largest angle between two parts of one run: 20 degrees [-].
_STRAIGHT = 0.94
#: Distance over which a motion counts as one change [m].
_MILLIMETRE = 1e-3


#: Columns of a recorded history beside the time.
_COLUMNS = ("load",), ("x", "y"), ("load", "x", "y")


class Curve(NamedTuple):
    """Static states along one part of a history.

    Attributes:
        positions: Ascending coordinate of each state: the cube root of the load over the largest load, or the share of
            a motion that is done, shape (m,) [-].
        cases: The states.
    """

    positions: FloatArray
    cases: tuple[Case, ...]


class _Run(NamedTuple):
    """Parts of a history that share a curve: at one place, or one after the other along a way without a corner.

    Attributes:
        poses: The places, in the order of the motion.
        loads: Load at each place; at one place where the load changes zero and the largest load of the history [N].
    """

    poses: tuple[Pose, ...]
    loads: tuple[float, ...]

    @property
    def ways(self) -> FloatArray:
        """Share of the way that is done at each place, shape (k,); all zero at one place [-]."""
        done = np.append(0.0, np.cumsum([math.dist(a.point, b.point) for a, b in itertools.pairwise(self.poses)]))
        return done / (done[-1] or 1.0)


class Samples(NamedTuple):
    """A history at k instants.

    Attributes:
        times: The instants, shape (k,) [s].
        loads: Load at each instant, shape (k,) [N].
        curves: Index of the curve to which each instant belongs, shape (k,) [-].
        positions: Coordinate on the curve at each instant, shape (k,) [-].
        moves: Whether the place changes, shape (k,).
    """

    times: FloatArray
    loads: FloatArray
    curves: IntArray
    positions: FloatArray
    moves: BoolArray


@dataclass(frozen=True, kw_only=True)
class History:
    """A load or depth, and a place, that are linear in time between given instants.

    Attributes:
        times: Ascending instants, the first one zero [s].
        values: Load [N] or depth [m] at each instant; a value other than zero at the first one is a step.
        control: Whether the load or the depth is given.
        poses: Position of first touch at each instant, direction and rotation of the indenter; empty if it stays.
        repeat: How often the history happens, one time after the other [-].
        place: Option, and file, that states the history, for messages.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    control: Literal["load", "depth"] = "load"
    poses: tuple[Pose, ...] = ()
    repeat: int = 1
    place: str = field(default="--history", compare=False)
    #: Largest number of instants [-], shortest time between two and longest history [s].
    limits: ClassVar[tuple[int, float, float]] = 1000, 1e-6, 1e9

    def __post_init__(self) -> None:
        """Check the instants and values.

        Raises:
            InputError: If there are too few or too many instants, they do not ascend from zero, the history is too
                long, a value is negative, or nothing presses.
        """
        most, shortest, longest = self.limits
        if not 2 <= len(self.times) <= most:  # noqa: PLR2004 -- a start and an end
            raise InputError(f"time: {len(self.times)} instants; 2..{most} are accepted")
        if self.times[0] != 0:
            raise InputError(f"time[0]: the history must begin at 0 s, not {self.times[0]:g} s")
        for k in np.flatnonzero(~(np.diff(self.times) > shortest * (1 - 1e-6))):
            raise InputError(
                f"time[{k + 1}]: {self.times[k + 1]:g} s must come at least {1e3 * shortest:g} ms after "
                f"{self.times[k]:g} s"
            )
        if self.duration > longest:
            raise InputError(f"time: {self.duration:.4g} s, with repetitions; at most {longest:g} s")
        for k in np.flatnonzero(~((np.array(self.values) >= 0) & (np.array(self.values) <= _LARGEST))):
            pull = "an indenter cannot pull; " if self.values[k] < 0 else ""
            raise InputError(f"{self.control}[{k}]: {self.values[k]:g}; {pull}let it be 0..{_LARGEST:g} N or m")
        if not max(self.values) > 0:
            raise InputError(f"{self.control}: zero at all instants, so that nothing presses")

    @property
    def duration(self) -> float:
        """Time of the whole history with its repetitions [s]."""
        return self.repeat * self.times[-1]

    @property
    def fastest(self) -> float:
        """Highest frequency that the history contains after a first step, 0.35 over its shortest change [Hz].

        A change is one by the largest value, or a motion by a millimetre.  The bandwidth of a ramp is 0.35 over its
        rise time, as for the response of a first-order system from 10 % to 90 %.
        """
        ways = [math.dist(one.point, other.point) for one, other in itertools.pairwise(self.poses)]
        changes = np.maximum(np.abs(np.diff(self.values)) / max(self.values), np.array(ways or [0.0]) / _MILLIMETRE)
        return float(BANDWIDTH * (changes / np.diff(self.times)).max())

    @property
    def last_change(self) -> float:
        """End of the last change of the value [s]; 0 if there is none after the first instant."""
        return max(itertools.compress(self.times[1:], np.diff(self.values)), default=0.0)


@dataclass(frozen=True, kw_only=True)
class MovingCase(History):
    """An indenter whose load and place change in time.

    Attributes:
        name: Short name, unique in its campaign.
        indenter: Rigid body that presses on the cover.
        shape: The indenter as text, for example `sphere:radius=5mm`.
        fall: Height from which the indenter falls on the cover [m]; 0 for given loads.  The loads are its weight until
            a simulation has recorded them, see `record_fall`.
        most: Largest load of a fall, to which its weight is lowered once its impact is known [N].
    """

    name: str
    indenter: Indenter
    shape: str
    fall: float = 0.0
    most: float = math.inf
    limits = MOST_INSTANTS, 1e-3, LONGEST_HISTORY  # of samples at 1 ms

    @property
    def heaviest(self) -> Case:
        """Static press under the largest load, at the first place."""
        return replace(self.make_state(self.poses[0], max(self.values)), name=self.name)

    def divide(self, pitch: float) -> list[Curve]:
        """Divide the history into curves of static states; equal parts share a curve.

        Args:
            pitch: Distance of the texels [m].
        """
        return [self._place_states(run, pitch) for run in self.find_runs()[0]]

    def sample(self, rate: float) -> Samples:
        """Sample the history.

        Args:
            rate: Instants per second [Hz].
        """
        times = np.arange(math.floor(self.duration * rate + 1e-9) + 1) / rate
        within = np.where(times < self.duration, times % self.times[-1], self.times[-1])
        part = np.clip(np.searchsorted(self.times, within, side="right") - 1, 0, len(self.times) - 2)
        done = (within - np.array(self.times)[part]) / np.diff(self.times)[part]
        loads = np.interp(within, self.times, self.values)
        curves, start, end = self.find_runs()[1][part].T
        moves = end > start
        positions = np.where(moves, start + done * (end - start), np.cbrt(loads / max(self.values)))
        return Samples(times, loads, curves.astype(int), positions, moves)

    def find_runs(self) -> tuple[list[_Run], FloatArray]:
        """Find the different runs.

        Returns:
            The runs; and for each of n parts the number of its run and the shares of the way at start and end, shape
            (n, 3) [-].
        """
        still = [one == other for one, other in itertools.pairwise(self.poses)]
        steps = np.diff([pose.point for pose in self.poses], axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        bends = (steps[:-1] * steps[1:]).sum(axis=1) < _STRAIGHT * lengths[:-1] * lengths[1:]
        varied = {self.poses[k] for k, stays in enumerate(still) if stays and self.values[k] != self.values[k + 1]}
        runs: dict[_Run, int] = {}
        parts: list[tuple[int, float, float]] = []
        for k, stays in enumerate(still):
            here, first = self.poses[k], len(parts)
            if stays:
                run = _Run((here,), (0.0, max(self.values)) if here in varied else (self.values[k],))
            elif k + 1 == len(still) or still[k + 1] or bends[k]:
                run = _Run(self.poses[first : k + 2], self.values[first : k + 2])
            else:
                continue
            number, ways = runs.setdefault(run, len(runs)), run.ways.tolist()
            parts += [(number, *each) for each in itertools.pairwise(ways if len(ways) > 1 else [0.0, 0.0])]
        return list(runs), np.array(parts)

    def _place_states(self, run: _Run, pitch: float) -> Curve:
        """Place the states of one curve."""
        most, points = max(self.values), np.array([pose.point for pose in run.poses])
        if len(points) > 1:
            way = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
            positions = np.linspace(0, 1, max(_FEWEST, math.ceil(way / (_STEP * pitch))) + 1)
            loads = np.interp(positions, run.ways, run.loads)
        else:
            positions = np.arange(1, _LOADS + 1) / _LOADS if len(run.loads) > 1 else np.cbrt([run.loads[0] / most])
            loads = most * positions**3
        along = np.stack([np.interp(positions, run.ways, each) for each in points.T], axis=1).tolist()
        cases = [
            self.make_state(replace(run.poses[0], point=tuple(point)), float(f"{load:.6g}"))
            for point, load in zip(along, np.maximum(loads, most / _LOADS**3).tolist(), strict=True)
        ]
        return Curve(positions, tuple(cases))

    def make_state(self, pose: Pose, load: float) -> Case:
        """Return the static press under a load [N]."""
        name = f"{self.name}, {load:.3g} N"
        return Case(name=name, indenter=self.indenter, shape=self.shape, load=load, pose=pose)


def interpolate(curve: Curve, shares: FloatArray, positions: FloatArray) -> FloatArray:
    """Interpolate the shares of the m states of a curve by a cubic spline; beyond its ends they are constant.

    Args:
        curve: The curve.
        shares: Share of the load in each state, shape (m, ...) [-].
        positions: Coordinates, shape (k,) [-].

    Returns:
        Shares at the coordinates, shape (k, ...) [-].
    """
    from fem_reference.interpolation import interpolate

    return np.asarray(interpolate(curve.positions, shares)(np.clip(positions, *curve.positions[[0, -1]])))


def read_moving(
    listed: Sequence[Any],
    places: Places,
    *,
    scale: float = 1.0,
    deepest: float | None = None,
    folder: Path = Path(),
) -> tuple[list[MovingCase], list[str]]:
    """Read the tables `[[moving]]` of a campaign file; return the cases and all faults.

    Args:
        listed: The tables, as the TOML parser returns them.
        places: Places on the cover.
        scale: Factor on all loads [-].
        deepest: Depth over thickness to which the loads of a case are lowered; None for no limit [-].
        folder: Folder of the files of histories.
    """
    cases: list[MovingCase] = []
    faults: list[str] = []
    for number, data in enumerate(listed):
        place = f"moving[{number}]"
        try:
            case = _read_case(data, number, places, folder)
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
        most = replace(case.heaviest, load=scale * max(case.values))
        bearable = places.limit_load(most, deepest)
        case = replace(case, most=bearable)
        scale *= min(1.0, bearable / most.load)
    return case if scale == 1 else replace(case, values=tuple(float(f"{scale * load:.2g}") for load in case.values))


def _read_columns(data: Mapping[str, Any], place: str, folder: Path) -> dict[str, Any]:
    """Read the file that a table names as history; return the keys of the table that it replaces."""
    name = data.get("history") if isinstance(data, Mapping) else None
    if not isinstance(name, str):
        return {}
    with at(f"{place}.history: "):
        columns = read_history(folder / check_below(name), *_COLUMNS)
    found = {key: values.tolist() for key, values in columns.items()}
    keys = {
        key: [f"{value!r} {unit}" for value in found[key]]
        for key, unit in (("time", "s"), ("load", "N"))
        if key in found
    }
    if "x" in found:
        keys["at"] = [f"{x!r}m,{y!r}m" for x, y in zip(found["x"], found["y"], strict=True)]
    if twice := sorted({"fall", *keys} & set(data)):
        raise InputError(f"{place}.{twice[0]}: the file of `history` states the motion; remove one of the two")
    return keys


def _read_case(data: Mapping[str, Any], number: int, places: Places, folder: Path) -> MovingCase:
    """Read one table `[[moving]]`."""
    place = f"moving[{number}]"
    if columns := _read_columns(data, place, folder):
        data = {**data, **columns}
    table = parse(data, MovingTable, place=("moving", number))
    if (table.fall or len(set(table.at)) > 1) and "motion" in places.refused:
        raise InputError(f"{place}.{'fall' if table.fall else 'at'}: {places.refused['motion']}")
    if table.fall and isinstance(places, FlatPlaces):
        places = replace(places, whole=True)
    texts = {key: text for key in ("yaw", "tilt") if (text := getattr(table, key)) is not None}
    known = {each: places.find(places.parse({"at": each, **texts}, f"{place}.")) for each in dict.fromkeys(table.at)}
    found = [known[text] for text in table.at]
    count = len(table.time)
    loads, poses = list(table.load), found
    loads, poses = loads * (count if len(loads) == 1 else 1), poses * (count if len(poses) == 1 else 1)
    for key, given in (("load", len(loads)), ("at", len(poses))):
        if given != count:
            raise InputError(f"{place}.{key}: {given} values for {count} instants; give one for each, or one value")
    if table.repeat > 1 and (loads[0] != loads[-1] or poses[0] != poses[-1]):
        raise InputError(f"{place}.repeat: the history must end with the load and the place with which it begins")
    far = sum(math.dist(one.point, other.point) for one, other in itertools.pairwise(poses))
    if far > _FARTHEST:
        raise InputError(f"{place}.at: the motion is {far:.3g} m long; at most {_FARTHEST:g} m are computed")
    with at(f"{place}."):
        case = MovingCase(
            name=table.name, indenter=table.indenter, shape=data["indenter"], times=tuple(table.time),
            values=tuple(loads), poses=tuple(poses), repeat=table.repeat, fall=table.fall or 0.0,
        )  # fmt: skip
    if (count := len(case.find_runs()[0])) > _MOST_RUNS:
        raise InputError(f"{place}.at: the way has {count} corners and stops; at most {_MOST_RUNS}; smooth the places")
    return case
