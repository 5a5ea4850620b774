"""Cases: indentations in which the fast model is scored against the finite elements, and the default list of cases."""

from __future__ import annotations

import dataclasses
import math

from meshes import Indenter, TexelArray
from validation.text.indenter import read_indenter, read_load, read_position, read_yaw

#: The default list of cases: name, indenter, load, name of a position, and yaw.  It holds flat and round indenters, the
#: weights of 100 g and 500 g and the three yaws of the 2015 report, and positions at which a part of the load acts
#: outside the array.
_DEFAULT_CASES = (
    ("sphere, centre", "sphere:radius=5mm", "100 g", "centre", "0deg"),
    ("sphere, centre, heavy", "sphere:radius=5mm", "500 g", "centre", "0deg"),
    ("sphere, texel", "sphere:radius=5mm", "500 g", "texel", "0deg"),
    ("large sphere, off grid", "sphere:radius=8mm", "500 g", "off grid", "0deg"),
    ("sphere, edge", "sphere:radius=5mm", "500 g", "edge", "0deg"),
    ("cylinder, centre", "cylinder:radius=5mm", "100 g", "centre", "0deg"),
    ("cylinder, off grid", "cylinder:radius=5mm", "500 g", "off grid", "0deg"),
    ("cylinder, corner", "cylinder:radius=4mm", "500 g", "corner", "0deg"),
    ("big square, centre", "box:size=12mmx12mmx8mm", "500 g", "centre", "0deg"),
    ("big square, off grid, 45", "box:size=12mmx12mmx8mm", "500 g", "off grid", "45deg"),
    ("small square, texel", "box:size=6mmx6mmx8mm", "100 g", "texel", "0deg"),
    ("big rectangle, 0", "box:size=6mmx18mmx8mm", "500 g", "off grid", "0deg"),
    ("big rectangle, 45", "box:size=6mmx18mmx8mm", "500 g", "off grid", "45deg"),
    ("big rectangle, 90", "box:size=6mmx18mmx8mm", "500 g", "off grid", "90deg"),
    ("small rectangle, edge", "box:size=4mmx10mmx8mm", "100 g", "edge", "0deg"),
    ("tip, texel", "tip:radius=1mm", "20 g", "texel", "0deg"),
    ("tip, off grid", "tip:radius=1mm", "100 g", "off grid", "0deg"),
)
#: Distances along x and y from a texel's centre or the array's centre, over the pitch: 0.7 mm and 1.1 mm on a pitch of
#: 3.4 mm.  An indenter there is not symmetric to the grid of texels [-].
_OFF_GRID_X, _OFF_GRID_Y = 0.206, 0.324


@dataclasses.dataclass(frozen=True, kw_only=True)
class Case:
    """One indentation that is scored: an indenter with its pose and load.

    Attributes:
        name: Short name, unique in its campaign.
        indenter: The rigid body that presses on the cover.
        shape: The indenter as text, for example `sphere:radius=5mm`.
        load: Applied force along the array's normal [N].
        at: Position (x, y) of the indenter's axis in the array's frame [m].
        yaw: Rotation of the indenter about its axis [rad].
        tilt: Rotations about the x and y axes of the indenter's frame [rad].
    """

    name: str
    indenter: Indenter
    shape: str
    load: float
    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def read(cls, name: str, shape: str, load: str, *, at: str = "0mm,0mm", yaw: str = "0deg") -> Case:
        """Create a case (one indentation that is scored) from strings in the format of the command line.

        Args:
            name: Short name of the case.
            shape: The indenter, for example `sphere:radius=5mm`.
            load: The load, for example `4.9 N` or `500 g`.
            at: Position of the indenter's axis in the array's frame.
            yaw: Rotation of the indenter about its axis.

        Raises:
            InputError: If one of the strings is not valid.
        """
        return cls(
            name=name,
            indenter=read_indenter(shape),
            shape=shape,
            load=read_load(load),
            at=read_position(at),
            yaw=read_yaw(yaw),
        )

    @property
    def pose(self) -> str:
        """Position and rotation of the indenter as text, in mm and degrees."""
        x, y = (1e3 * value for value in self.at)
        tilted = ""
        if any(self.tilt):
            tilted = ", tilted {}°, {}°".format(*(_format_number(math.degrees(angle)) for angle in self.tilt))
        return f"({_format_number(x)}, {_format_number(y)}) mm, {_format_number(math.degrees(self.yaw))}°{tilted}"


def default_cases(array: TexelArray) -> tuple[Case, ...]:
    """Return the default list of cases for a flat array that is at least as large as a fingertip.

    Args:
        array: The array, which defines the positions of the indenter: over the centre of the array, over the centre of
            a texel, less than half a pitch beside the array's centre, over an edge and near a corner.
    """
    positions = _positions(array)
    return tuple(
        dataclasses.replace(Case.read(name, shape, load, yaw=yaw), at=positions[position])
        for name, shape, load, position, yaw in _DEFAULT_CASES
    )


def _positions(array: TexelArray) -> dict[str, tuple[float, float]]:
    """Return the named positions (x, y) of the default list of cases, in the frame of an array [m]."""
    right, top = array.centres[array.active, :2].max(axis=0).tolist()
    middle_x, middle_y = array.centres[array.middle, :2].tolist()
    pitch_x, pitch_y = array.pitch
    return {
        "centre": (0.0, 0.0),
        "texel": (middle_x, middle_y),
        "off grid": (_OFF_GRID_X * pitch_x, -_OFF_GRID_Y * pitch_y),
        "edge": (right, _OFF_GRID_X * pitch_y),
        "corner": (right - _OFF_GRID_Y * pitch_x, top - _OFF_GRID_Y * pitch_y),
    }


def _format_number(value: float) -> str:
    """Format a number with at most two decimals, without trailing zeros, and without a minus sign before zero."""
    return f"{round(value, 2) + 0.0:g}"
