"""Cases: indentations in which the fast model is scored against the finite elements."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from meshes import Indenter, TexelArray, tilt_indenter
from validation.text.indenter import read_indenter, read_load, read_position, read_yaw

if TYPE_CHECKING:
    from validation.curved.touch import Touch

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
        touch: Place, direction and rotation of the indenter on a curved cover, which replace `at`, `yaw` and `tilt`;
            None on a flat one.
        yaw: Rotation of the indenter about its axis [rad].
        tilt: Rotations about the x and y axes of the indenter's frame [rad].
        path: Ascending loads of the loading path that the load belongs to; empty if it is applied at once [N].
        compared: Names of the metrics that are pooled over cases, fields of `Score`; empty for all.
        required: Largest accepted value of metrics in this case, by name, in SI units or as a fraction.
    """

    name: str
    indenter: Indenter
    shape: str
    load: float
    at: tuple[float, float] = (0.0, 0.0)
    touch: Touch | None = None
    yaw: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    path: tuple[float, ...] = ()
    compared: tuple[str, ...] = ()
    required: Mapping[str, float] = dataclasses.field(default_factory=dict, hash=False)

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
    def turned(self) -> Case:
        """The same case with the tilt in the shape of its indenter, for models that know no tilt."""
        return dataclasses.replace(self, indenter=tilt_indenter(self.indenter, self.tilt), tilt=(0.0, 0.0))

    def has_shape_of(self, other: Case) -> bool:
        """Whether two cases have the same indenter, however its text is written."""
        from fem_reference.result_store import describe

        return type(self.indenter) is type(other.indenter) and describe(self.indenter) == describe(other.indenter)

    def is_press_of(self, other: Case) -> bool:
        """Whether two cases are the same press: the same indenter, load and pose."""
        if (self.touch is None) != (other.touch is None):
            return False
        if self.touch is not None and other.touch is not None and not self.touch.same_as(other.touch):
            return False
        mine, others = ((each.load, each.at, each.yaw, each.tilt, each.path) for each in (self, other))
        return mine == others and self.has_shape_of(other)

    def as_json(self) -> dict[str, Any]:
        """Return the case as a dictionary of JSON values, which `from_json` reads."""
        pose = {"at": self.at, "yaw": self.yaw, "tilt": self.tilt} if self.touch is None else self.touch.as_json()
        about = {"name": self.name, "indenter": self.shape, "load": self.load}
        return about | pose | {"path": self.path, "compared": self.compared, "required": self.required}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Case:
        """Return the case that wrote a dictionary of JSON values.

        Raises:
            InputError: If the indenter's mesh file is not there any more.
        """
        pose: dict[str, Any] = {"at": tuple(values["at"]), "yaw": values["yaw"], "tilt": tuple(values["tilt"])}
        if values.get("direction") is not None:
            from validation.curved.touch import Touch

            at, direction = np.array(values["at"]), np.array(values["direction"])
            pose = {"touch": Touch(point=at, direction=direction, yaw=pose["yaw"], tilt=pose["tilt"])}
        return cls(
            name=values["name"],
            indenter=read_indenter(values["indenter"]),
            shape=values["indenter"],
            load=values["load"],
            path=tuple(values["path"]),
            compared=tuple(values["compared"]),
            required=dict(values["required"]),
            **pose,
        )

    @property
    def pose(self) -> str:
        """Position and rotation of the indenter as text, in mm and degrees."""
        if self.touch is not None:
            return self.touch.describe()
        x, y = (1e3 * value for value in self.at)
        tilted = ""
        if any(self.tilt):
            tilted = ", tilted {}°, {}°".format(*(_format_number(math.degrees(angle)) for angle in self.tilt))
        return f"({_format_number(x)}, {_format_number(y)}) mm, {_format_number(math.degrees(self.yaw))}°{tilted}"


def name_positions(array: TexelArray) -> dict[str, tuple[float, float]]:
    """Return the positions (x, y) that a campaign file can name, in the frame of an array [m].

    They are the centre of the array, the centre of a texel, a point less than half a pitch beside the array's centre,
    a point over an edge and a point near a corner.
    """
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
