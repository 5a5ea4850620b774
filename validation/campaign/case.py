"""A case: one indentation that is scored."""

from __future__ import annotations

import math
from dataclasses import dataclass

from meshes import Indenter
from validation.text.indenter import read_indenter, read_load, read_position, read_yaw


@dataclass(frozen=True, kw_only=True)
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
        """Make a case from text, as on the command line.

        Raises:
            InputError: If a part cannot be read.
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
        return f"({_short(x)}, {_short(y)}) mm, {_short(math.degrees(self.yaw))}°"


def _short(value: float) -> str:
    """Two decimals without trailing zeros or a minus before zero."""
    return f"{round(value, 2) + 0.0:g}"
