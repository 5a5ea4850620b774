"""One indentation that is scored, and the default list of them."""

from __future__ import annotations

import dataclasses
import math

from meshes import Indenter, TexelArray
from validation.text.indenter import read_indenter, read_load, read_position, read_yaw

#: The default campaign: name, indenter, load, position by name and yaw.  It holds flat and round shapes, the weights of
#: 100 g and 500 g and the three yaws of the 2015 report, and positions where force leaves the array.
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
#: Positions off the grid, in pitches: 0.7 mm and 1.1 mm on a pitch of 3.4 mm, so that no symmetry of the grid is left.
_OFF_GRID_X, _OFF_GRID_Y = 0.206, 0.324


@dataclasses.dataclass(frozen=True, kw_only=True)
class Case:
    """One indenter, pose and load.

    Attributes:
        name: Short name, unique in its campaign.
        indenter: The shape.
        shape: The shape as text, `sphere:radius=5mm`.
        load: Applied force [N].
        at: Indenter's axis in the array's frame [m].
        yaw: Rotation about that axis [rad].
    """

    name: str
    indenter: Indenter
    shape: str
    load: float
    at: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0

    @classmethod
    def read(cls, name: str, shape: str, load: str, *, at: str = "0mm,0mm", yaw: str = "0deg") -> Case:
        """Create a case (one indentation that is scored) from strings in the format of the command line.

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
        """Position and rotation as text."""
        x, y = (1e3 * value for value in self.at)
        return f"({_format_number(x)}, {_format_number(y)}) mm, {_format_number(math.degrees(self.yaw))}°"


def default_cases(array: TexelArray) -> tuple[Case, ...]:
    """The default campaign on a flat array as large as a fingertip or larger.

    Args:
        array: The texels, which define the positions: over the centre of the array (between texels where their number
            is even), over a texel, off the grid by less than half a pitch, over an edge and near a corner.
    """
    positions = _positions(array)
    return tuple(
        dataclasses.replace(Case.read(name, shape, load, yaw=yaw), at=positions[position])
        for name, shape, load, position, yaw in _DEFAULT_CASES
    )


def _positions(array: TexelArray) -> dict[str, tuple[float, float]]:
    """The named positions of the default campaign [m]."""
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
    """Two decimals without trailing zeros, and without a minus sign before zero."""
    return f"{round(value, 2) + 0.0:g}"
