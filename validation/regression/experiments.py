"""Experiments of the regression check that need no finite elements, each from a sensor to readings by name.

The experiments are in four groups.  Electronics: forces on all texels at once, which bypass contact, filter and point
spread.  Metrics: scores of fixed images and pooled scores of fixed numbers.  Contact methods: an off-centre H and a
ball on the sensor, and a block on fixed oblong texels.  Running sensors in MuJoCo: under load step, ramp and noise, a
ball of known weight rests on the middle texel, and a further force on the ball is prescribed at every step.  Several
sensors read the same simulation, each with another filter or other electronics.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from fastmodel import (
    METHODS,
    Butterworth,
    ChainFunctions,
    CoverCells,
    Electronics,
    Gaussian,
    OptionWarning,
    Parameters,
    Sensor,
    add_indenter,
    attach,
    indent,
    recommend_options,
)
from fastmodel.signal.frame import Frame
from meshes import Box, Indenter, LetterH, Pose, Sphere, TexelArray
from meshes.array_types import FloatArray
from meshes.solids.texels import tangent_axes
from validation.metrics import score, score_images
from validation.pooling import pool, skill
from validation.regression.reading import Readings, Subject, find_unit, list_rows, read

#: Smallest force at which the characteristic is evaluated, small enough for any sensor [N].  It must not depend on the
#: sensitivity of the sensor, because a change of the sensitivity would then not be detected.
_LIGHTEST = 1e-6
#: Largest force at which the characteristic is evaluated, large enough for any sensor [N].
_HEAVIEST = 1e6
#: Number of forces from smallest to largest, at a constant ratio [-].
_FORCES = 241
#: Number of bisections between two forces of the sequence in the search for a level of output [-].
_BISECTIONS = 60
#: Levels of output over the largest output, at which the force is measured [-].
_LEVELS = (0.01, 0.25, 0.5, 0.75, 0.99)
#: Electronics whose stages, such as threshold and saturation, are measured one by one.  Every entry of `STAGES` changes
#: some of these numbers.
LINE = Electronics(rate_hz=100.0, sensitivity=500.0, offset=-20.0, output_max=1000, bits=10)
#: Forces under which the stages of the electronics are measured, one per texel, up to beyond the largest count [N].
_LOADING = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.2, 1.6, 1.9, 2.0, 2.1, 3.0)
#: Changes of the electronics `LINE` for each stage, by its name.
_SINGLE: Mapping[str, Mapping[str, Any]] = {
    "line": {},
    "polynomial": {"characteristic": (-20.0, 700.0, -150.0, 20.0, -2.0, 0.1)},
    "gains of texels": {"gains": tuple(0.7 + 0.05 * texel for texel in range(len(_LOADING)))},
    "threshold": {"threshold": 60.0},
    "saturation band": {"saturation_band": 300.0},
    "temperature": {"temperature_coefficient": -0.01, "temperature_excess": 15.0},
    "force through the cover": {"calibrated": "through the cover, tip 1 mm", "tip_share": 0.8},
    "hysteresis": {"hysteresis_share": 0.4, "hysteresis_width": 0.3},
}
#: Measured electronics by name: each stage alone, and all of them, whose order then shows.
STAGES = {**_SINGLE, "all": {key: each for changes in _SINGLE.values() for key, each in changes.items()}}


def measure_characteristic(subject: Subject) -> Readings:
    """Measure force thresholds, sensitivity, largest count and counts of every texel of the sensor itself."""
    array, electronics = subject.parameters.array, subject.parameters.electronics
    functions = ChainFunctions(replace(subject.parameters, filter=None), electronics.rate_hz, spreads=False)

    def count(force: float) -> FloatArray:
        state = functions.settle(np.full(array.count, force))
        return np.asarray(functions.frame(state)[1].counts, dtype=np.float64)

    def average(force: float) -> float:
        return float(count(force)[array.active].mean())

    largest = max(average(force) for force in np.geomspace(_LIGHTEST, _HEAVIEST, _FORCES))
    if largest <= 0:
        raise ValueError("no force gives a count")
    forces = {f"{100 * level:.0f} % of full scale": _find_force(average, level * largest) for level in _LEVELS}
    first, last, half = (forces[f"{level} % of full scale"] for level in (25, 75, 50))
    return {
        "force": read(forces, "mN", "0.2 % of each"),
        "sensitivity": read(0.5 * largest / (last - first), "counts/N", "0.5 % of each"),
        "largest count (saturation)": read(float(count(_HEAVIEST).max()), "counts", 1.5),
        "counts of each texel": read(list_rows(array.image(count(half))), "counts", 1.5),
        "frame rate": read(electronics.rate_hz, "Hz", "0.01 % of each"),
        "noise": read(electronics.noise, "mN", "0.1 % of largest"),
    }


def measure_stages(subject: Subject) -> Readings:  # noqa: ARG001 -- every experiment takes the sensor
    """Measure the counts of each stage of the electronics under fixed forces, and their grey levels."""
    readings: Readings = {}
    for stage, changes in STAGES.items():
        functions = ChainFunctions(_make_row(replace(LINE, **changes)), LINE.rate_hz, spreads=False)
        state = functions.settle(np.zeros(len(_LOADING)))
        outputs: dict[str, list[float]] = {}
        for name, share in (("loading", 1.0), ("unloading", 0.7)):
            state = functions.take(state, share * np.array(_LOADING))
            state, output = functions.frame(state)
            outputs[name] = output.counts.tolist()
            outputs[f"{name}, grey"] = output.image.ravel().tolist()
        readings[stage] = read(outputs, "counts", 0.5)
    return readings


def _make_row(electronics: Electronics) -> Parameters:
    """Make the parameters of a single row of texels, one for each force, without point spread."""
    return Parameters(
        array=TexelArray.grid(1, len(_LOADING), 3e-3),
        spread=Gaussian(sigma_x=0.1, sigma_y=0.1, ksize_x=1, ksize_y=1),
        electronics=electronics,
    )


def _find_force(count: Callable[[float], float], level: float) -> float:
    """Find the smallest force at which the counts reach a level [N]."""
    forces = np.geomspace(_LIGHTEST, _HEAVIEST, _FORCES).tolist()
    index = next(index for index, force in enumerate(forces) if count(force) >= level)
    if index == 0:
        return float(forces[0])
    below, above = forces[index - 1], forces[index]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (below + above)
        below, above = (below, middle) if count(middle) >= level else (middle, above)
    return float(above)


#: Numbers of rows and columns of the two made-up images that the metrics score [-].
_SHAPE = (7, 5)
#: Pitch of the two made-up images along x and y [m].
_IMAGE_PITCH = (3e-3, 4e-3)
#: Load of the two made-up images [N].
_LOAD = 4.0
#: Force outside the texels of the made-up images, of the reference and of the prediction [N].
_OUTSIDE = (0.30, 0.42)
#: Made-up errors of a model in five cases, which are pooled [-].
_ERRORS = (0.02, 0.05, 0.01, 0.08, 0.03)
#: Made-up errors of a second model in the same five cases [-]; NaN for a case without a result.
_COMPARISON = (0.10, 0.07, float("nan"), 0.21, 0.05)


def score_fixed_images(subject: Subject) -> Readings:  # noqa: ARG001 -- every experiment takes the sensor
    """Score a fixed prediction against a fixed reference by every metric; the two peak on different texels.

    One texel is masked.
    """
    active = np.ones(_SHAPE, dtype=bool)
    active[3, 1] = False
    array = TexelArray.grid(*_SHAPE, _IMAGE_PITCH, active=active)
    reference, forces = _make_bump(array, (0.8e-3, -1.7e-3), 3.0e-3), _make_bump(array, (2.1e-3, -0.4e-3), 3.4e-3)
    scores = score(
        reference, 0.95 * forces, reference_outside=_OUTSIDE[0], outside=_OUTSIDE[1], load=_LOAD, array=array
    )
    levels = np.arange(array.count)
    images = score_images(5 * levels, np.where(levels % 3, 5 * levels, 7 * levels), active=array.active)
    readings = {name: read(value, find_unit(name), "0.1 % of each") for name, value in asdict(scores).items()}
    return {**readings, "fixed images": read(asdict(images), "-", "0.1 % of each")}


def pool_fixed_scores(subject: Subject) -> Readings:  # noqa: ARG001 -- every experiment takes the sensor
    """Pool fixed errors over cases, with their interval and the skill of one model against the other."""
    found = {"mean": pool(_COMPARISON), "skill": skill(_ERRORS, _COMPARISON)}
    return {
        name: read(
            {"value": each.mean, "low end": each.low, "high end": each.high, "cases": each.cases}, "-", "0.1 % of each"
        )
        for name, each in found.items()
    }


def _make_bump(array: TexelArray, middle: tuple[float, float], width: float) -> FloatArray:
    """Make texel forces that fall off from a point like a Gaussian, with a sum near the load, shape (n,) [N]."""
    distance = array.centres[:, :2] - middle
    weights = np.exp(-0.5 * (distance**2).sum(axis=1) / width**2)
    return np.asarray((_LOAD - _OUTSIDE[0]) * weights / weights.sum())


#: Contact methods that are measured, by the first method of the surface in the parameters; None stands for parameters
#: without a surface.
METHODS_OF: Mapping[str | None, tuple[str, ...]] = {
    None: ("boxes", "foundation"),
    "cover": ("boxes", "foundation", "cover"),
    "curved": ("curved",),
}
#: Contact methods that compute the contact area, and contact and spread by the cover together.  Their texel forces are
#: read after spread, those of the other methods before it.
AREA_METHODS = ("foundation", "cover", "curved")
#: Mean pressure below the H-shaped indenter: that of 500 g on an H of 12 x 16 mm with bars of 4 mm [Pa].
LETTER_PRESSURE = 34e3
#: Largest width and largest height of the H-shaped indenter [pitches].
_LARGEST = (3.5, 4.7)
#: Largest width of the H-shaped indenter over the width of the array, and largest height over its height [-].
_SHARE = 0.55
#: Width of the bars of the H-shaped indenter, over the smaller of its width and height [-].
_BAR = 0.3
#: Distance of the H-shaped indenter from the array's centre along x and y, over width and height of the array [-].
_OFF = (0.1, 0.13)
#: Rotation of the H-shaped indenter about the normal of the array [rad].
_YAW = 0.17
#: Radius of the ball that presses on the sensor, over the smaller pitch [-].
_BALL = 3.0
#: Distance of the pressing ball from the centre of the middle texel along x and y, over the pitch [-].
_BESIDE = (0.2, -0.3)
#: Edges of the block that is pressed by all compared models, over the pitch along x and y [-].
_BLOCK_SHARE = (1.7, 2.3)
#: Distance of the ball at the edge from the centre of the last texel along x, over the pitch [-].
_AT_EDGE = 0.4
#: Number of rows of the oblong test array, which is the same for all sensors [-].
_ROWS = 6
#: Number of columns of the oblong test array [-].
_COLUMNS = 5
#: Pitch of the oblong test array along x and y [m].
_PITCH = (3e-3, 4.5e-3)
#: Number of contact cells per pitch on the cover of the oblong test array [-].
_CELLS = 4
#: Number of cells beyond the edge of a texel of the oblong test array from which forces act on the texel [-].
_REACH = 6
#: Standard deviation of the force at the base of the test array's cover under a point load [m].
_WIDTH = 1.2e-3
#: Distance below which the compliance of the test array's cover is limited [m].  The compliance of a half space under
#: a point load has no limit.
_NEAR = 0.5e-3
#: Thickness of the cover of the oblong test array [m].
_THICKNESS = 2e-3
#: Compliance of the top of the test array's cover [m2/N].
_TOP = 2.4e-7
#: Edge lengths of the block that presses on the oblong test array [m].
_BLOCK = (5e-3, 9e-3, 4e-3)
#: Position of the block on the oblong test array along x and y [m].
_BLOCK_AT = (1.1e-3, 3.4e-3)
#: Rotation of the block about the normal of the oblong test array [rad].
_BLOCK_YAW = 0.3
#: Load on the block that presses on the oblong test array [N].
_BLOCK_LOAD = 3.0


def lay_letter_h(array: TexelArray) -> tuple[LetterH, float, tuple[float, float], float]:
    """Choose an H-shaped indenter for an array: its shape, load [N], position [m] and rotation [rad].

    On a WTS 0614-34 the H measures 11.2 x 16 mm.  No symmetry of the array maps the position of the H to itself.
    """
    (pitch_x, pitch_y), counts = array.pitch, (array.columns, array.rows)
    width, height = (min(most, _SHARE * count) for most, count in zip(_LARGEST, counts, strict=True))
    size = (width * pitch_x, height * pitch_y)
    letter = LetterH(size=size, bar=_BAR * min(size))
    at = (_OFF[0] * counts[0] * pitch_x, _OFF[1] * counts[1] * pitch_y)
    area = 2 * letter.bar * size[1] + (size[0] - 2 * letter.bar) * letter.bar
    return letter, LETTER_PRESSURE * area, at, _YAW


def list_methods(parameters: Parameters) -> tuple[str, ...]:
    """Return the names of the contact methods that the parameters of a sensor allow."""
    return METHODS_OF[None if parameters.surface is None else parameters.surface.methods[0]]


def lay_flat(parameters: Parameters) -> Parameters:
    """Return parameters that press on boxes, for experiments on the signal alone.

    A cover whose contact does not use boxes is left out, and its array is flattened.
    """
    array = parameters.array
    if "boxes" in list_methods(parameters):
        return parameters
    flat = TexelArray.grid(array.rows, array.columns, array.pitch, active=array.image(array.active), name=array.name)
    return replace(parameters, array=flat, surface=None)


def find_origin(array: TexelArray) -> FloatArray:
    """Return the point from which positions of indenters count, shape (3,) [m].

    The point is the origin on a planar array, and the centre of the middle texel on a curved array.
    """
    return np.zeros(3) if array.planar else array.centres[array.middle]


def face(array: TexelArray, texel: int, *, origin: FloatArray, at: tuple[float, float], yaw: float = 0.0) -> Pose:
    """Return the pose of an indenter that moves along the normal of a texel.

    Args:
        array: The array.
        texel: Index of the texel.
        origin: Reference point of `at`, shape (3,) [m].
        at: Position of the axis along the tangent axes of the texel [m].
        yaw: Rotation of the indenter [rad].
    """
    point = origin + np.array(at) @ tangent_axes(array.normals)[texel]
    return Pose.facing(point, -array.normals[texel], spin=yaw)


def press_letter(subject: Subject) -> Readings:
    """Press the H-shaped indenter on the sensor, by every contact method that its parameters allow."""
    array = subject.parameters.array
    letter, load, at, yaw = lay_letter_h(array)
    pose = face(array, array.middle, origin=find_origin(array), at=at, yaw=yaw)
    return _press(subject.parameters, letter, load=load, pose=pose)


def lay_ball(array: TexelArray) -> tuple[Sphere, float, Pose]:
    """Choose a ball for an array: its shape, load [N], and pose beside the centre of the middle texel."""
    at = (_BESIDE[0] * array.pitch[0], _BESIDE[1] * array.pitch[1])
    pose = face(array, array.middle, origin=array.centres[array.middle], at=at)
    return Sphere(radius=_BALL * min(array.pitch)), LETTER_PRESSURE * float(np.prod(array.pitch)), pose


def lay_block(array: TexelArray) -> tuple[Box, float, Pose]:
    """Choose a block for an array: its shape, load [N], and pose, turned and beside the centre of the middle texel."""
    x, y = (share * pitch for share, pitch in zip(_BLOCK_SHARE, array.pitch, strict=True))
    at = (_BESIDE[0] * array.pitch[0], _BESIDE[1] * array.pitch[1])
    pose = face(array, array.middle, origin=array.centres[array.middle], at=at, yaw=_YAW)
    return Box(size=(x, y, min(x, y))), LETTER_PRESSURE * x * y, pose


def press_ball(subject: Subject) -> Readings:
    """Press a ball on the sensor, beside a texel's centre, by the methods that compute the area under a ball."""
    ball, load, pose = lay_ball(subject.parameters.array)
    return _press(subject.parameters, ball, load=load, pose=pose, among=AREA_METHODS)


def press_edge(subject: Subject) -> Readings:
    """Press the ball on the outer edge of the last texel, where much of the force lies outside the array."""
    array = subject.parameters.array
    ball, load, _ = lay_ball(array)
    last = int(np.flatnonzero(array.active)[-1])
    pose = face(array, last, origin=array.centres[last], at=(_AT_EDGE * array.pitch[0], 0.0))
    return _press(subject.parameters, ball, load=load, pose=pose, among=AREA_METHODS)


def press_oblong(subject: Subject) -> Readings:  # noqa: ARG001 -- every experiment takes the sensor
    """Press a block on the oblong test array, which is the same for all sensors, by every contact method."""
    parameters = make_oblong()
    pose = face(parameters.array, 0, origin=np.zeros(3), at=_BLOCK_AT, yaw=_BLOCK_YAW)
    return _press(parameters, Box(size=_BLOCK), load=_BLOCK_LOAD, pose=pose)


def measure_spread(subject: Subject) -> Readings:
    """Measure the distribution of the force on the middle and on the last texel by the point spread of the sensor."""
    array = subject.parameters.array
    operator = subject.parameters.spread.operator(array)
    row, column = divmod(array.middle, array.columns)
    image = array.image(operator[:, array.middle])
    beside = {
        "on the loaded texel": (row, column),
        "on the next along x": (row, column - 1),
        "on the next along y": (row - 1, column),
        "on the next across": (row - 1, column - 1),
    }
    shares = {name: float(image[place]) for name, place in beside.items() if min(place) >= 0}
    lost = 1.0 - operator.sum(axis=0)
    outside = {"of the middle texel": float(lost[array.middle]), "of the last texel": float(lost[-1])}
    surface = subject.parameters.surface
    cells = None if surface is None else surface.cells
    return {
        "share": read(shares, "%", 0.1),
        "share outside": read(outside, "%", 0.1),
        "foundation modulus": read(None if cells is None else cells.foundation_modulus(), "N/mm3", "0.5 % of each"),
    }


def make_oblong(pitch: tuple[float, float] = _PITCH) -> Parameters:
    """Make the parameters of the oblong test array, with a masked texel, under a cover given by formulas.

    Args:
        pitch: Pitch along x and y [m].
    """
    active = np.ones(_ROWS * _COLUMNS, dtype=bool)
    active[0] = False
    array = TexelArray.grid(_ROWS, _COLUMNS, pitch, active=active, name="oblong")
    cell = (pitch[0] / _CELLS, pitch[1] / _CELLS)
    rows, columns = (np.arange(_CELLS * count)[:, None] for count in (2 * _ROWS, 2 * _COLUMNS))
    distance = np.sqrt((rows * cell[1]) ** 2 + (columns.T * cell[0]) ** 2 + _NEAR**2)
    return Parameters(
        array=array,
        spread=Gaussian(sigma_x=0.5, sigma_y=0.35, ksize_x=3, ksize_y=3),
        electronics=Electronics(rate_hz=100.0, sensitivity=1000.0),
        surface=CoverCells(
            per_texel=_CELLS,
            cell=cell,
            compliance=_TOP * cell[0] * cell[1] / distance * np.exp(-distance / _THICKNESS),
            influence=np.outer(_share(cell[1]), _share(cell[0])),
            top_compliance=_TOP,
            thickness=_THICKNESS,
            source="a formula",
        ),
    )


def _share(edge: float) -> FloatArray:
    """Return the share of the force on each cell in a row that a texel measures, shape (_CELLS + 2 _REACH,) [-]."""
    middles = (np.arange(_CELLS + 2 * _REACH) - _REACH + 0.5) * edge
    return np.asarray(ndtr((_CELLS * edge - middles) / _WIDTH) - ndtr(-middles / _WIDTH))


def _press(
    parameters: Parameters,
    indenter: Indenter,
    *,
    load: float,
    pose: Pose,
    among: Container[str] = tuple(METHODS),
) -> Readings:
    """Press an indenter by several contact methods; return forces and depth.

    Args:
        parameters: The sensor.
        indenter: The indenter.
        load: Load [N].
        pose: Pose of the indenter.
        among: Names of the contact methods.
    """
    readings: Readings = {}
    array = parameters.array
    for method in (each for each in list_methods(parameters) if each in among):
        pressed = indent(parameters, indenter, load=load, pose=pose, contact=method)
        # The forces are read before the point spread, because quantities of their own measure the spread.
        forces = pressed.texel_forces if method in AREA_METHODS else pressed.contact_forces
        readings |= {
            f"{method}, force of each texel": read(list_rows(array.image(forces)), "mN", "1 % of largest"),
            f"{method}, largest force after spread": read(float(pressed.texel_forces.max()), "mN", "0.5 % of each"),
            f"{method}, load carried": read(pressed.total_force, "N", "0.2 % of each"),
            f"{method}, force outside": read(pressed.outside / load, "% of load", 0.05),
            f"{method}, depth": read(pressed.depth, "mm", "1 % of each"),
        }
    return readings


#: Weight of the ball that rests on a sensor in the simulations [N].
_WEIGHT = 2.0
#: Largest timestep of the simulations [s].
_TIMESTEP = 1e-3
#: Smallest number of timesteps per period of the cut-off of the sensor's own filter [-].
_PER_PERIOD = 20.0
#: Time for the simulated ball to come to rest [s].
_REST = 0.15
#: Smallest duration of the simulation after the load step [s].
_STEP = 0.15
#: Smallest duration of the simulation after the load step, over the period of the cut-off of the sensor's own filter
#: [-].
_PERIODS = 5.0
#: Cut-off frequency of the filters that are measured in addition to the sensor's own filter [Hz].
_CUTOFF = 20.0
#: Orders of the filters with the cut-off frequency `_CUTOFF` [-].
_ORDERS = (1, 2, 3, 4)
#: Number of frames under the simulated ramp of the load [-].
_FRAMES = 8
#: Smallest number of noisy counts; their standard deviation then has a relative error of 0.7 % [-].
_SAMPLES = 10_000
#: Standard deviation of the noise that is measured in addition to the sensor's own noise [N].
_NOISE = 0.1
#: Electronics with one count per millinewton, which neither saturate nor reach zero in these experiments.
_WIDE = Electronics(rate_hz=1 / _TIMESTEP, sensitivity=1000.0, offset=20_000.0, output_max=2**20, bits=24)
#: Half width of the hysteresis of the sensor that is reset [N].
_PLAY = 0.5
#: Forces on each texel to which the sensor is reset, one after the other [N].
_RESET_LOADS = (1.0, 3.0, 1.0)
#: Time for which the H-shaped indenter rests before its tactile image is taken [s].
_LETTER_TIME = 0.25
#: Grey level of the mean force on a texel below the H-shaped indenter, 0..255 [-].
_LETTER_GREY = 120.0
_NAME = "sensor"


@dataclass(frozen=True, kw_only=True, eq=False)
class _Recorded:
    """Output of one sensor after every step of a simulation.

    Attributes:
        frames: Latest frame after every step.
        new: Whether the step made a new frame, shape (steps,).
        totals: Sum of texel forces and force outside in the latest frame, shape (steps,) [N].
    """

    frames: Sequence[Frame]
    new: npt.NDArray[np.bool_]
    totals: FloatArray


def measure_load_step(subject: Subject) -> Readings:
    """Measure rise time and overshoot of the total force after a load step, with the sensor's and fixed filters."""
    parameters = lay_flat(subject.parameters)
    own = parameters.filter
    period = 0.0 if own is None else 1.0 / own.cutoff_hz
    timestep = min(_TIMESTEP, period / _PER_PERIOD or _TIMESTEP)
    rest, steps = round(_REST / timestep), round(max(_STEP, _PERIODS * period) / timestep)
    filters = {"own filter": own}
    filters |= {f"order {order}": Butterworth(cutoff_hz=_CUTOFF, order=order) for order in _ORDERS}
    electronics = replace(_WIDE, rate_hz=1 / timestep)
    sensors = {name: replace(parameters, filter=each, electronics=electronics) for name, each in filters.items()}
    loads = np.repeat([0.0, _WEIGHT], [rest, steps])
    responses = {
        name: recorded.totals[rest:] / _WEIGHT - 1.0
        for name, recorded in _simulate(parameters, sensors, loads, timestep).items()
    }
    rises = {name: timestep * _count_rise(response) for name, response in responses.items()}
    ends = {name: _WEIGHT * (1 + float(response[-1])) for name, response in responses.items()}
    return {
        "rise time": read(rises, "ms", "1 % of each"),
        "overshoot": read({name: float(response.max()) - 1.0 for name, response in responses.items()}, "%", 0.2),
        "force after the step": read(ends, "N", "0.2 % of each"),
    }


def measure_frames(subject: Subject) -> Readings:
    """Measure the times of frames, and the lag of their forces behind a load that increases at a constant rate."""
    parameters = lay_flat(subject.parameters)
    rate = parameters.electronics.rate_hz
    rest, ramp = round(_REST / _TIMESTEP), max(round(_FRAMES / rate / _TIMESTEP), _FRAMES) + 1
    loads = np.append(np.zeros(rest), np.arange(1, ramp + 1) * _WEIGHT / ramp)
    sensors = {"own": replace(parameters, filter=None)}
    own = _simulate(parameters, sensors, loads, _TIMESTEP)["own"]
    made = np.flatnonzero(own.new)
    times = np.array([own.frames[step].time for step in made.tolist()])
    late = made[made >= rest + 1]
    slope = _WEIGHT / ramp / _TIMESTEP
    lags = (_WEIGHT + loads[late] - own.totals[late]) / slope
    first = {f"frame {number}": time for number, time in enumerate(times[:_FRAMES].tolist())}
    return {
        "time of the first frames": read(first, "ms", 0.01),
        "frames per second": read(1.0 / float(np.diff(times).mean()), "Hz", "0.1 % of each"),
        "delay of the force": read(float(lags.mean()), "ms", 0.1),
        "delay of the time": read(float((_TIMESTEP * (made + 1) - times).max()), "ms", 0.01),
    }


def measure_noise(subject: Subject) -> Readings:
    """Measure the noise of running sensors: its size, and whether it depends on seed, sensor, texel and frame."""
    parameters = lay_flat(subject.parameters)
    array = parameters.array
    steps = -(-_SAMPLES // array.count)
    quiet = replace(parameters, filter=None, electronics=_WIDE)
    noisy = replace(quiet, electronics=replace(_WIDE, noise=_NOISE))
    sensors = {"quiet": quiet, "noisy": noisy, "same seed": noisy, "other seed": noisy}
    seed = subject.seed
    seeds = {"noisy": seed, "same seed": seed, "other seed": seed + 1}
    loads = np.zeros(steps)
    runs = _simulate(parameters, sensors, loads, _TIMESTEP, seeds=seeds)
    counts = {name: np.array([frame.counts for frame in run.frames]) for name, run in runs.items()}
    active = array.active
    first, same, other = ((counts[name] - counts["quiet"])[:, active] / _WIDE.sensitivity for name in seeds)
    correlations = {
        "of two seeds": _correlate(first, other),
        "of two frames": _correlate(first[1:], first[:-1]),
        "of two texels": _correlate(first[:, 1:], first[:, :-1]) if first.shape[1] > 1 else 0.0,
    }
    return {
        "standard deviation": read(float(first.std()), "mN", "5 % of each"),
        "mean": read(float(first.mean()), "mN", 5.0),
        "difference for the same seed": read(float(np.abs(first - same).max()), "mN", 0.5),
        "correlation": read(correlations, "-", 0.1),
    }


def measure_reset(subject: Subject) -> Readings:
    """Measure counts after resets of a sensor with hysteresis and filter; the first and the last are at equal load."""
    parameters = lay_flat(subject.parameters)
    electronics = replace(_WIDE, hysteresis_share=0.5, hysteresis_width=_PLAY)
    reset = replace(parameters, filter=Butterworth(cutoff_hz=_CUTOFF), electronics=electronics)
    _, (sensor,) = _build(parameters, [reset], _TIMESTEP)
    means = []
    for load in _RESET_LOADS:
        sensor.reset(load)
        means.append(float(sensor.frame().counts[parameters.array.active].mean()))
    return {
        "counts after a reset": read(means[0], "counts", "0.1 % of each"),
        "trace of the load before": read(means[2] - means[0], "counts", 1.5),
    }


def measure_letter(subject: Subject) -> Readings:
    """Press an off-centre, turned H on the sensor by the default contact method, and measure image and net force."""
    parameters = subject.parameters
    indenter, load, at, yaw = lay_letter_h(parameters.array)
    x, y = (find_origin(parameters.array)[:2] + at).tolist()
    below = LETTER_PRESSURE * float(np.prod(parameters.array.pitch))
    electronics = Electronics(rate_hz=100.0, sensitivity=_LETTER_GREY / below, output_max=255, bits=8)
    spec = _make_spec(_TIMESTEP)
    height = float(parameters.array.centres[:, 2].max())
    add_indenter(spec, indenter, load, at=(x, y), height=height, yaw=yaw)
    sensor = attach(spec, "world", replace(parameters, electronics=electronics, filter=None), name=_NAME)
    model = _compile(spec)
    data = mujoco.MjData(model)
    _bind(sensor, model)
    for _ in range(round(_LETTER_TIME / _TIMESTEP)):
        mujoco.mj_step(model, data)
        sensor.step(data)
    frame = sensor.frame()
    force, torque = (np.zeros(3) if each is None else each for each in (frame.net_force, frame.net_torque))
    return {
        "image": read(list_rows(frame.image), "grey levels", 2.0),
        "net force": read(dict(zip("xyz", force.tolist(), strict=True)), "N", "0.5 % of largest"),
        "net torque": read(dict(zip("xyz", torque.tolist(), strict=True)), "N mm", "0.5 % of largest"),
        "force outside": read(sensor.outside() / load, "% of load", 0.05),
    }


def _simulate(
    parameters: Parameters,
    sensors: Mapping[str, Parameters],
    loads: FloatArray,
    timestep: float,
    *,
    seeds: Mapping[str, int] | None = None,
) -> dict[str, _Recorded]:
    """Simulate a ball on the middle texel under a prescribed force, and record the output of several sensors.

    Args:
        parameters: The array.
        sensors: Parameters of the sensors, by name.
        loads: Force on the ball besides its weight at every step, shape (steps,) [N].
        timestep: Timestep [s].
        seeds: Seeds of the noise by name of the sensor.
    """
    model, bound = _build(parameters, list(sensors.values()), timestep)
    data = mujoco.MjData(model)
    ball = model.body(_NAME + "-ball").id
    for name, sensor in zip(sensors, bound, strict=True):
        if seeds and name in seeds:
            sensor.reset(seed=seeds[name])
    records: list[list[tuple[Frame, bool, float]]] = [[] for _ in bound]
    for load in loads.tolist():
        data.xfrc_applied[ball, 2] = -load
        mujoco.mj_step(model, data)
        for sensor, record in zip(bound, records, strict=True):
            new, frame = sensor.step(data), sensor.frame()
            forces = 0.0 if frame.texel_forces is None else float(frame.texel_forces.sum())
            record.append((frame, new, forces + sensor.outside()))
    columns = (zip(*record, strict=True) for record in records)
    return {
        name: _Recorded(frames=frames, new=np.array(new), totals=np.array(totals))
        for name, (frames, new, totals) in zip(sensors, columns, strict=True)
    }


def _build(
    parameters: Parameters, sensors: Sequence[Parameters], timestep: float
) -> tuple[mujoco.MjModel, list[Sensor]]:
    """Build the MuJoCo model of a ball on the middle texel, and bind sensors, which are all at the same place."""
    array = parameters.array
    spec = _make_spec(timestep)
    x, y, height = array.centres[array.middle].tolist()
    add_indenter(spec, Sphere(radius=min(array.pitch)), _WEIGHT, at=(x, y), height=height, name=_NAME + "-ball")
    attach(spec, "world", parameters, name=_NAME, contact="boxes")
    model = _compile(spec)
    method = METHODS["boxes"]
    return model, [_bind(Sensor(name=_NAME, parameters=each, contact=method, every=1), model) for each in sensors]


def _bind(sensor: Sensor, model: mujoco.MjModel) -> Sensor:
    """Bind a sensor without warnings of limited accuracy, because two versions are compared with each other."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OptionWarning)
        return sensor.bind(model)


def _make_spec(timestep: float) -> mujoco.MjSpec:
    """Make a MuJoCo spec with the options that the fast model recommends, and the timestep [s]."""
    spec = mujoco.MjSpec()
    recommend_options(spec)
    spec.option.timestep = timestep
    return spec


def _compile(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Switch off the friction of all geoms of a spec, as in the simulated bench tests, and compile it."""
    for geom in spec.geoms:
        geom.condim = 1
    return spec.compile()


def _count_rise(response: FloatArray) -> float:
    """Return the number of timesteps, interpolated, in which a response that ends at 1 rises from 10 to 90 % [-]."""
    rising = response[: int(response.argmax()) + 1]
    if response.argmax() == 0 or rising[0] >= 0.9:  # noqa: PLR2004 -- 90 %
        return 0.0
    first, last = (float(np.interp(level, rising, np.arange(len(rising)))) for level in (0.1, 0.9))
    return last - first


def _correlate(one: FloatArray, other: FloatArray) -> float:
    """Return the coefficient of correlation of two arrays of numbers [-]; 0 if one is constant."""
    a, b = one.ravel() - one.mean(), other.ravel() - other.mean()
    scale = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / scale if scale > 0 else 0.0
