"""Experiments on contact methods: an off-centre H on the sensor, and a block on fixed oblong texels."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.special import ndtr

from fastmodel import CoverCells, Electronics, Gaussian, Parameters, indent
from meshes import Box, Indenter, LetterH, Sphere, TexelArray
from meshes.array_types import FloatArray
from validation.regression.subject import Subject, Value, Values, list_texels

#: Contact methods for flat covers.
FLAT_METHODS = ("boxes", "area", "foundation", "cover")
#: Mean pressure below the H: that of 500 g on an H of 12 x 16 mm with bars of 4 mm [Pa].
LETTER_PRESSURE = 34e3
#: Largest width and height of the H [pitches], and the same over columns and rows; width of its bars over the smaller
#: of the two; distance of its axis from the array's centre over columns and rows [-]; its rotation [rad].
_LARGEST, _SHARE, _BAR, _OFF, _YAW = (3.5, 4.7), 0.55, 0.3, (0.1, 0.13), 0.17
#: Radius of the ball over the smaller pitch, and its distance from the centre of the middle texel over the pitch [-].
_BALL, _BESIDE = 3.0, (0.2, -0.3)
#: The fixed array: rows and columns, pitch along x and y [m].
_ROWS, _COLUMNS, _PITCH = 6, 5, (3e-3, 4.5e-3)
#: The fixed cover: cells per pitch, cells beyond a texel that act on it [-], standard deviation of the force at its
#: base, distance at which a load no longer acts like one at a point [m], thickness [m], compliance of its top [m2/N].
_CELLS, _REACH, _WIDTH, _NEAR, _THICKNESS, _TOP = 4, 6, 1.2e-3, 0.5e-3, 2e-3, 2.4e-7
#: The block on the fixed array: size, position [m], rotation [rad], load [N].
_BLOCK, _BLOCK_AT, _BLOCK_YAW, _BLOCK_LOAD = (5e-3, 9e-3, 4e-3), (1.1e-3, 3.4e-3), 0.3, 3.0


def lay_letter_h(array: TexelArray) -> tuple[LetterH, float, tuple[float, float], float]:
    """Choose an H that fits an array: the shape, its load [N], position [m] and rotation [rad].

    On a WTS 0614-34 the H measures 11.2 x 16 mm.  No symmetry of the array maps its position to itself.
    """
    (pitch_x, pitch_y), counts = array.pitch, (array.columns, array.rows)
    width, height = (min(most, _SHARE * count) for most, count in zip(_LARGEST, counts, strict=True))
    size = (width * pitch_x, height * pitch_y)
    letter = LetterH(size=size, bar=_BAR * min(size))
    at = (_OFF[0] * counts[0] * pitch_x, _OFF[1] * counts[1] * pitch_y)
    area = 2 * letter.bar * size[1] + (size[0] - 2 * letter.bar) * letter.bar
    return letter, LETTER_PRESSURE * area, at, _YAW


def press_letter(subject: Subject) -> Values:
    """Press the H on the sensor, by every contact method that its parameters allow."""
    letter, load, at, yaw = lay_letter_h(subject.parameters.array)
    return _press(subject.parameters, letter, load=load, at=at, yaw=yaw)


def press_ball(subject: Subject) -> Values:
    """Press a ball on the sensor, beside a texel's centre, by the methods that compute the area under a ball."""
    array = subject.parameters.array
    x, y = array.centres[array.middle, :2].tolist()
    at = (x + _BESIDE[0] * array.pitch[0], y + _BESIDE[1] * array.pitch[1])
    load = LETTER_PRESSURE * float(np.prod(array.pitch))
    ball = Sphere(radius=_BALL * min(array.pitch))
    return _press(subject.parameters, ball, load=load, at=at, methods=("foundation", "cover"))


def press_oblong(subject: Subject) -> Values:  # noqa: ARG001 -- every experiment takes the sensor
    """Press a block on a fixed array with oblong texels, a masked one, and a fixed cover, by every contact method."""
    return _press(make_oblong(), Box(size=_BLOCK), load=_BLOCK_LOAD, at=_BLOCK_AT, yaw=_BLOCK_YAW)


def measure_spread(subject: Subject) -> Values:
    """Measure where the point spread of the sensor brings the force on the middle and on the last texel."""
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
    surface = subject.parameters.surface
    return {
        "share": shares,
        "share outside": {"of the middle texel": float(lost[array.middle]), "of the last texel": float(lost[-1])},
        "foundation modulus": surface.foundation_modulus() if isinstance(surface, CoverCells) else None,
    }


def make_oblong() -> Parameters:
    """Make the parameters of the fixed array: oblong texels, the first one masked, under a cover given by formulas."""
    active = np.ones(_ROWS * _COLUMNS, dtype=bool)
    active[0] = False
    array = TexelArray.grid(_ROWS, _COLUMNS, _PITCH, active=active, name="oblong")
    cell = (_PITCH[0] / _CELLS, _PITCH[1] / _CELLS)
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
    """Return the share of the force on each cell in a row that acts on a texel, shape (cells + 2 reach,) [-]."""
    middles = (np.arange(_CELLS + 2 * _REACH) - _REACH + 0.5) * edge
    return np.asarray(ndtr((_CELLS * edge - middles) / _WIDTH) - ndtr(-middles / _WIDTH))


def _press(
    parameters: Parameters,
    indenter: Indenter,
    *,
    load: float,
    at: tuple[float, float],
    yaw: float = 0.0,
    methods: Iterable[str] = FLAT_METHODS,
) -> dict[str, Value]:
    """Press an indenter by several contact methods, and take forces and depth."""
    values: dict[str, Value] = {}
    for method in methods:
        if parameters.surface is None and method in {"foundation", "cover"}:
            continue
        pressed = indent(parameters, indenter, load=load, at=at, yaw=yaw, method=method)
        # before spread, which has quantities of its own; `cover` computes the forces after spread by itself
        forces = pressed.texel_forces if method == "cover" else pressed.contact_forces
        values[f"{method}, force of each texel"] = list_texels(parameters.array, forces)
        values[f"{method}, largest force after spread"] = float(pressed.texel_forces.max())
        values[f"{method}, load carried"] = pressed.total_force
        values[f"{method}, force outside"] = pressed.outside / load
        values[f"{method}, depth"] = pressed.depth
    return values
