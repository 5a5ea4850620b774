"""Places and directions on a curved cover that a campaign file names, and their reading."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.responses import find_above, lay_out
from meshes import TexelArray
from meshes.array_types import FloatArray
from meshes.solids import SolidMesh
from meshes.solids.texels import tangent_axes
from validation.curved.touch import Touch, find_middle, find_touch_place
from validation.errors import InputError, nearest
from validation.text.indenter import read_yaw
from validation.text.quantity import read_quantities, read_quantity

#: Distances along the tangent axes from the middle texel, over the pitch: a place that is not symmetric to texels [-].
_OFF_GRID = np.array([0.206, -0.324])
#: Angle between an oblique direction and the normal of the cover, and largest tilt of an indenter about one axis [rad].
_OBLIQUE, _MOST_TILT = math.radians(30), math.radians(80)
#: Names of directions besides three numbers.
_DIRECTIONS = ("normal", "oblique x", "oblique y")


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
        layout = lay_out(self.mesh)
        above = find_above(FacetSurface.part_of(layout.elements.nodes, layout.top), texels)
        far = np.where(texels.active, np.linalg.norm(texels.centres - texels.centres[middle], axis=1), -1.0)
        turned = np.where(texels.active, -texels.normals @ texels.normals[middle], -2.0)
        beside = (_OFF_GRID * texels.pitch) @ tangent_axes(texels.normals)[middle]
        return {
            "middle": above[middle],
            "off grid": above[middle] + beside,
            "edge": above[int(np.argmax(far))],
            "side": above[int(np.argmax(turned))],
        }

    def read(self, table: Mapping[str, Any], place: str, faults: list[str]) -> Touch | None:
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
            texts[key] = value.strip()
        try:
            at = self._read_at(texts["at"], f"{place}.at")
            tilt = _read_tilt(texts["tilt"], f"{place}.tilt")
            yaw = read_yaw(texts["yaw"], place=f"{place}.yaw")
            upright = _find(self.mesh, self.texels, at, None, f"{place}.at")
            towards = _read_direction(texts["direction"], -upright.direction, f"{place}.direction")
            found = _find(self.mesh, self.texels, at, towards, f"{place}.at")
        except InputError as error:
            faults += error.faults
            return None
        return replace(found, yaw=yaw, tilt=tilt)

    def _read_at(self, text: str, place: str) -> tuple[float, ...]:
        if text in self.named:
            return tuple(self.named[text].tolist())
        if not any(character.isdigit() for character in text):
            raise InputError(
                f"{place}: unknown place {text!r}; {nearest(text, self.named)}, or x,y,z such as '0mm,2mm,8mm'"
            )
        return read_quantities(text, "length", 2 if self.texels.planar and text.count(",") == 1 else 3, place=place)


def _find(
    mesh: SolidMesh,
    texels: TexelArray,
    at: tuple[float, ...],
    direction: tuple[float, float, float] | None,
    place: str,
) -> Touch:
    try:
        return find_touch_place(mesh, texels, at=at, direction=direction)
    except InputError as error:
        raise InputError(*(fault.replace("--at", place) for fault in error.faults)) from None


def _read_direction(text: str, normal: FloatArray, place: str) -> tuple[float, float, float]:
    """Read a direction: a name, relative to the normal of the cover, or three numbers."""
    if text in _DIRECTIONS:
        axes = tangent_axes(normal[None])[0]
        aside = {"normal": np.zeros(3), "oblique x": axes[0], "oblique y": axes[1]}[text]
        x, y, z = (aside * math.sin(_OBLIQUE) - normal * (math.cos(_OBLIQUE) if aside.any() else 1.0)).tolist()
        return (x, y, z)
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            f"{place}: unknown direction {text!r}; {nearest(text, _DIRECTIONS)}, or three numbers such as '0,0.5,-1'"
        ) from None
    if not all(map(math.isfinite, (x, y, z))) or not any((x, y, z)):
        raise InputError(f"{place}: {text!r} must be finite and not zero; write for example '0,0.5,-1'")
    return (x, y, z)


def _read_tilt(text: str, place: str) -> tuple[float, float]:
    parts = text.split(",")
    if len(parts) != 2:  # noqa: PLR2004 -- about x and y
        raise InputError(f"{place}: {text!r} is not two angles about x and y; write for example '0deg,45deg'")
    x, y = (read_quantity(part, "angle", place=place) for part in parts)
    if max(abs(x), abs(y)) > _MOST_TILT:
        raise InputError(f"{place}: {text!r}: at most {math.degrees(_MOST_TILT):g} deg about either axis are accepted")
    return x, y
