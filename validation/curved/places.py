"""Read poses of an indenter on a curved cover, for the command line and for campaign files."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fem_reference.curved_cover.responses import find_above, find_top
from meshes import Pose, TexelArray
from meshes.array_types import FloatArray
from meshes.solids import SolidMesh
from meshes.solids.texels import tangent_axes
from validation.curved.touch import find_middle, find_touch_place
from validation.errors import InputError, nearest
from validation.text.indenter import read_yaw
from validation.text.quantity import read_quantities, read_quantity

#: Distances along the tangent axes from the middle texel, over the pitch: a place that is not symmetric to texels [-].
_OFF_GRID = np.array([0.206, -0.324])
#: Angle between an oblique direction and the normal of the cover, and largest tilt of an indenter about one axis [rad].
_OBLIQUE, _MOST_TILT = math.radians(30), math.radians(80)
#: Names of places besides coordinates, and of directions besides three numbers.
PLACES, DIRECTIONS = ("middle", "off grid", "edge", "side"), ("normal", "oblique x", "oblique y")
#: Component of a direction: a number without unit.
_NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,3})?\s*")
#: Largest length of a text that is parsed [characters].
_LONGEST = 100

#: A vector.
Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class PoseText:
    """Pose of an indenter on a curved cover as it was written, before the cover is meshed.

    Attributes:
        at: Name of a place, or its coordinates [m]; None for the texel nearest to the middle, along its own normal.
        direction: Name of a direction, or a vector of any length.
        yaw: Rotation of the indenter about its axis [rad].
        tilt: Rotations of the indenter against its motion, about its x and y axes [rad].
        prefix: Text before `at` and `direction` in messages about them, such as `--`.
    """

    at: str | tuple[float, ...] | None = None
    direction: str | Vector = "normal"
    yaw: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    prefix: str = "--"


def read_pose(texts: Mapping[str, str], prefix: str, *, planar: bool) -> PoseText:
    """Read the pose of an indenter on a curved cover.

    Args:
        texts: `at`, `direction`, `yaw` and `tilt`; each may be missing.
        prefix: Text before these names in messages.
        planar: Whether all texels lie in one plane, so that two coordinates are enough.

    Raises:
        InputError: With one line per fault.
    """
    readers: dict[str, Callable[[str, str], Any]] = {
        "at": lambda text, place: _read_at(text, place, planar=planar),
        "direction": _read_direction,
        "yaw": lambda text, place: read_yaw(text, place=place),
        "tilt": _read_tilt,
    }
    found: dict[str, Any] = {}
    faults: list[str] = []
    for name, text in texts.items():
        try:
            found[name] = readers[name](text.strip(), f"{prefix}{name}")
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(*faults)
    return PoseText(**found, prefix=prefix)


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvedPlaces:
    """Named places on the top of a curved cover.

    Attributes:
        mesh: Finest mesh of the cover.
        texels: Texels on its base.
    """

    mesh: SolidMesh
    texels: TexelArray

    @cached_property
    def named(self) -> dict[str, FloatArray]:
        """Points near the top by name, shape (3,) each [m].

        `middle` lies above the texel nearest to the middle of all, `off grid` less than half a pitch beside it, `edge`
        above the texel farthest from it, and `side` above the texel whose normal differs most from that of the middle.
        """
        texels, middle = self.texels, find_middle(self.texels)
        above = find_above(find_top(self.mesh), texels)
        far = np.where(texels.active, np.linalg.norm(texels.centres - texels.centres[middle], axis=1), -1.0)
        turned = np.where(texels.active, -texels.normals @ texels.normals[middle], -2.0)
        beside = (_OFF_GRID * texels.pitch) @ tangent_axes(texels.normals)[middle]
        return {
            "middle": above[middle],
            "off grid": above[middle] + beside,
            "edge": above[int(np.argmax(far))],
            "side": above[int(np.argmax(turned))],
        }

    def read(self, table: Mapping[str, Any], place: str, faults: list[str]) -> Pose | None:
        """Read `at`, `direction`, `yaw` and `tilt` of a case; None if one of them has a fault.

        Args:
            table: The table of the case.
            place: Place of the table in the file.
            faults: List to which the lines about faults are added.
        """
        texts: dict[str, str] = {}
        for key, default in {"at": "middle", "direction": "normal", "yaw": "0deg", "tilt": "0deg,0deg"}.items():
            value = table.get(key, default)
            if not isinstance(value, str):
                faults.append(f"{place}.{key}: must be a text, not {value!r}"[:200])
                return None
            texts[key] = value
        try:
            return self.find(read_pose(texts, f"{place}.", planar=self.texels.planar))
        except InputError as error:
            faults += error.faults
            return None

    def find(self, pose: PoseText) -> Pose:
        """Find the point and the direction of a pose.

        Raises:
            InputError: If the place is not on the cover.
        """
        at = tuple(self.named[pose.at].tolist()) if isinstance(pose.at, str) else pose.at
        try:
            found = find_touch_place(self.mesh, self.texels, at=at)
            if pose.direction != "normal":
                towards = _turn_aside(pose.direction, -found.towards)
                found = find_touch_place(self.mesh, self.texels, at=at, direction=towards)
        except InputError as error:
            raise InputError(*(fault.replace("--at", f"{pose.prefix}at") for fault in error.faults)) from None
        return replace(found, yaw=pose.yaw, tilt=pose.tilt)


def _turn_aside(direction: str | Vector, normal: FloatArray) -> Vector:
    """Return a direction as a vector: against the normal of the cover, turned towards a tangent axis by its name."""
    if not isinstance(direction, str):
        return direction
    aside = tangent_axes(normal[None])[0][DIRECTIONS.index(direction) - 1]
    x, y, z = (aside * math.sin(_OBLIQUE) - normal * math.cos(_OBLIQUE)).tolist()
    return (x, y, z)


def _read_at(text: str, place: str, *, planar: bool) -> str | tuple[float, ...]:
    if text in PLACES:
        return text
    if not any(character.isdigit() for character in text):
        raise InputError(
            f"{place}: unknown place {text[:_LONGEST]!r}; {nearest(text[:_LONGEST], PLACES)}, or x,y,z such as "
            "0mm,2mm,8mm"
        )
    return read_quantities(text, "length", 2 if planar and text.count(",") == 1 else 3, place=place)


def _read_direction(text: str, place: str) -> str | Vector:
    """Read a direction: a name, relative to the normal of the cover, or three numbers."""
    if text in DIRECTIONS:
        return text
    example = f"{'--direction=' if place == '--direction' else ''}0,0.5,-1"
    parts = text.split(",")
    if len(text) > _LONGEST or len(parts) != 3 or not all(map(_NUMBER.fullmatch, parts)):  # noqa: PLR2004
        raise InputError(
            f"{place}: unknown direction {text[:_LONGEST]!r}; {nearest(text[:_LONGEST], DIRECTIONS)}, or three numbers "
            f"such as {example}"
        )
    x, y, z = map(float, parts)
    if not 0 < max(abs(x), abs(y), abs(z)) < math.inf:
        raise InputError(f"{place}: {text!r} must be finite and not zero; write for example {example}")
    return (x, y, z)


def _read_tilt(text: str, place: str) -> tuple[float, float]:
    parts = text.split(",")
    if len(parts) != 2:  # noqa: PLR2004 -- about x and y
        raise InputError(f"{place}: {text[:_LONGEST]!r} is not two angles about x and y; write for example 0deg,45deg")
    x, y = (read_quantity(part, "angle", place=place) for part in parts)
    if max(abs(x), abs(y)) > _MOST_TILT:
        raise InputError(f"{place}: {text!r}: at most {math.degrees(_MOST_TILT):g} deg about either axis are accepted")
    return x, y
