"""Position of first touch on a cover: places by name or coordinates, directions and rotations, for any cover."""

from __future__ import annotations

import logging
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, singledispatch
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from meshes import Cover, Pose, SolidCover, TexelArray
from meshes.array_types import BoolArray, FloatArray
from meshes.solids.solid_mesh import measure_thickness
from meshes.solids.texels import tangent_axes
from meshes.surfaces.triangles import describe, unit_vectors
from validation.cover_meshes import make_meshes
from validation.errors import Faults, InputError, nearest
from validation.text.indenter import read_angles, read_tilt, read_yaw
from validation.text.quantity import read_quantities

if TYPE_CHECKING:
    from fastmodel import Parameters
    from fem_reference.curved_cover.facet_surface import FacetSurface
    from meshes.solids import SolidMesh
    from validation.campaign.case import Case
    from validation.schema.campaign import LoadsForTable
    from validation.sensor_file import SensorDescription

#: Offset of the place `off grid` along x, and of the place `edge` along y, from lines of symmetry of the texels, over
#: the pitch [-].  It is 0.7 mm on a pitch of 3.4 mm.
_OFF_GRID_X = 0.206
#: Offset of the place `off grid` along y, and of the place `corner` along x and y, from lines of symmetry of the
#: texels, over the pitch [-].  It is 1.1 mm on a pitch of 3.4 mm.
_OFF_GRID_Y = 0.324
#: Names of directions in which an indenter can move onto a curved cover.
DIRECTIONS = ("normal", "oblique x", "oblique y")
#: Angle between an oblique direction and the normal of the cover [rad].
_OBLIQUE = math.radians(30)
#: Largest tilt of an indenter about one axis on a solid cover [rad].
_MOST_TILT = math.radians(80)
#: Largest accepted distance of a place that a user gives from the top of a solid cover, over its thickness [-].
_OFF_TOP = 1.0
#: Distance of a place from the top of a solid cover, over its thickness, from which a message states it [-].
_TOLD = 0.1
#: Points around the point above a texel, their distance from it, and the distance from the normals of the top above
#: which they lie beyond its border, both over the thickness [-].
_AROUND, _AWAY, _BESIDE = 16, 1.25, 0.1
_LOG = logging.getLogger(__name__)
#: Pattern of one component of a direction vector: a number without unit.
_NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,3})?\s*")
#: Largest length of a text that is parsed or repeated in a message [characters].
_LONGEST = 100

#: Share of the largest depth of a campaign to which flat faces press [-].
_SHARP = 0.5

#: What is said where several bodies are not computed.
_TOGETHER = (
    "several bodies are computed only on wide flat covers of linear-elastic layers without friction; write a case "
    "for each body"
)
#: Components of a direction along x, y and z in the frame of the array [-].
Vector = tuple[float, float, float]
Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class PoseText:
    """Requested pose of an indenter, before the place is located on the cover.

    Attributes:
        at: Name of a place, or its coordinates [m]; None for the default place.
        direction: Name of a direction, or a vector of any length.
        yaw: Rotation of the indenter about its axis [rad].
        tilt: Rotations of the indenter about its x and y axes [rad].
        prefix: Text before the names of these keys in messages, such as `--`.
    """

    at: str | tuple[float, ...] | None = None
    direction: str | Vector = "normal"
    yaw: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    prefix: str = "--"


class Places(ABC):
    """Places on the cover of a sensor; each kind of cover has a subclass.

    A pose is read in two steps.  `parse` checks its texts at once.  `find` locates it on the cover, which may take
    minutes.
    """

    #: Name of the file with the default campaign for this kind of cover.
    default: ClassVar[str]

    @property
    @abstractmethod
    def refused(self) -> Mapping[str, str]:
        """Why cases with several bodies (`others`) or with a `motion` are not computed on this cover, with a remedy."""

    def parse(self, texts: Mapping[str, str], prefix: str) -> PoseText:
        """Read the texts of a pose without computations.

        Args:
            texts: Texts by key: `at`, `direction`, `yaw` and `tilt`, each of which may be missing.
            prefix: Text before the keys in messages.

        Raises:
            InputError: With one line per fault.
        """
        readers: dict[str, Callable[..., Any]] = {
            "at": self.read_at,
            "direction": self.read_direction,
            "yaw": read_yaw,
            "tilt": self.read_tilt,
        }
        faults = Faults()
        found = {key: faults.read(readers[key], text.strip(), place=f"{prefix}{key}") for key, text in texts.items()}
        faults.refuse()
        return PoseText(**found, prefix=prefix)

    @abstractmethod
    def read_at(self, text: str, *, place: str) -> str | tuple[float, ...]:
        """Read the position of first touch: the name of a place, or coordinates [m].

        Args:
            text: The text.
            place: Option or key that holds the text; error messages begin with it.
        """

    @abstractmethod
    def read_direction(self, text: str, *, place: str) -> str | Vector:
        """Read the direction of the indenter's motion: a name in `DIRECTIONS`, or a vector of any length."""

    @abstractmethod
    def read_tilt(self, text: str, *, place: str) -> tuple[float, float]:
        """Read the rotations of the indenter about its x and y axes [rad]."""

    @abstractmethod
    def find(self, pose: PoseText) -> Pose:
        """Locate place and direction on the cover, which may require meshes.

        Raises:
            InputError: If the place is not on the cover.
        """

    @abstractmethod
    def scale_loads(self, table: LoadsForTable, source: str) -> float:
        """Return the factor on the loads of a campaign that is written for another cover [-].

        Args:
            table: Modulus and thickness of the cover for which the campaign is written.
            source: Path of the campaign file, for error messages.

        Raises:
            InputError: If loads are not scaled for this kind of cover.
        """

    def limit_load(self, case: Case, share: float) -> float:  # noqa: ARG002 -- for layers
        """Return the load under which a case presses the cover to a share of its thickness, inf if not known [N]."""
        return math.inf


def read_place(text: str, place: str, names: tuple[str, ...], counts: tuple[int, ...]) -> str | tuple[float, ...]:
    """Read a place: a name, or coordinates [m].

    Args:
        text: The text.
        place: Option or key that holds the text; error messages begin with it.
        names: Accepted names.
        counts: Accepted numbers of coordinates [-]; error messages ask for the last number.
    """
    if text in names:
        return text
    if not any(character.isdigit() for character in text):
        example = "0mm,2mm,8mm" if counts[-1] == 3 else "1mm,-2mm"  # noqa: PLR2004 -- x, y and z
        raise InputError(
            f"{place}: unknown place {text[:_LONGEST]!r}; {nearest(text[:_LONGEST], names)}, or "
            f"{'x,y,z'[: 2 * counts[-1] - 1]} such as {example}"
        )
    given = text.count(",") + 1
    return read_quantities(text, "length", given if given in counts else counts[-1], place=place)


@dataclass(frozen=True, kw_only=True, eq=False)
class FlatPlaces(Places):
    """Places on planar layers, pressed along -z.

    Attributes:
        array: The array, in whose frame places are given.
        whole: Whether the axis of the indenter must lie over the array.
        cover: The cover; None if it is not known.
        friction: Coefficient of friction between indenter and cover [-].
    """

    array: TexelArray
    whole: bool = False
    cover: Cover | None = None
    friction: float = 0.0
    default = "default.toml"

    @property
    def refused(self) -> Mapping[str, str]:
        """Several bodies press on wide covers of linear layers without friction; see `Places`."""
        if self.cover is None or (self.cover.size is None and self.cover.small_strain_only and not self.friction):
            return {}
        return {"others": _TOGETHER}

    @property
    def named(self) -> dict[str, tuple[float, float]]:
        """Positions (x, y) on planar layers by name [m].

        The places are the centre of the array, the centre of a texel (also called middle), a point less than half a
        pitch from the array's centre, a point over an edge and a point near a corner.
        """
        array = self.array
        right, top = array.centres[array.active, :2].max(axis=0).tolist()
        x, y = array.centres[array.middle, :2].tolist()
        pitch_x, pitch_y = array.pitch
        return {
            "centre": (0.0, 0.0),
            "middle": (x, y),
            "texel": (x, y),
            "off grid": (_OFF_GRID_X * pitch_x, -_OFF_GRID_Y * pitch_y),
            "edge": (right, _OFF_GRID_X * pitch_y),
            "corner": (right - _OFF_GRID_Y * pitch_x, top - _OFF_GRID_Y * pitch_y),
        }

    def find(self, pose: PoseText) -> Pose:
        """Return the pose of an indenter that moves along -z; see `Places`."""
        at = self.named[pose.at] if isinstance(pose.at, str) else pose.at or (0.0, 0.0)
        return Pose.planar((at[0], at[1]), pose.yaw, pose.tilt)

    def scale_loads(self, table: LoadsForTable, source: str) -> float:
        """Refuse a campaign whose loads are to be scaled, because only loads on curved covers are; see `Places`."""
        del table
        raise InputError(f"{source}: loads_for: is for curved covers; remove it, and write the loads as they are")

    def limit_load(self, case: Case, share: float) -> float:
        """Return the load that presses the linear cover to a share of its thickness; see `Places`."""
        from validation.derivation.contact_range import bear

        # Finite strain ends earlier under sharp edges.
        deepest = share * (_SHARP if case.indenter.is_flat else 1.0)
        return math.inf if self.cover is None else bear(self.cover, case.turned.indenter, deepest)

    def read_at(self, text: str, *, place: str) -> str | tuple[float, ...]:
        """Read the name of a place, or its coordinates x and y [m]; see `Places`."""
        at = read_place(text, place, tuple(self.named), (2,))
        if self.whole and not isinstance(at, str):
            half = np.array(self.array.texel_size) / 2
            low, high = (edge(self.array.centres[:, :2], axis=0) for edge in (np.min, np.max))
            if not ((low - half <= at) & (at <= high + half)).all():
                ranges = zip("xy", 1e3 * (low - half), 1e3 * (high + half), strict=True)
                accepted = ", ".join(f"{axis} {first:.4g}..{last:.4g} mm" for axis, first, last in ranges)
                given = f"({1e3 * at[0]:.4g}, {1e3 * at[1]:.4g}) mm"
                raise InputError(f"{place}: {given} is not on the array; accepted: {accepted}")
        return at

    def read_direction(self, text: str, *, place: str) -> str:
        """Refuse every direction but `normal`, which is -z; see `Places`."""
        if text != DIRECTIONS[0]:
            raise InputError(f"{place}: is for curved covers; a flat one is pressed along -z, `tilt` turns the body")
        return text

    def read_tilt(self, text: str, *, place: str) -> tuple[float, float]:
        """Read the tilt within the limit of the solvers for planar layers [rad]; see `Places`."""
        return read_tilt(text, place=place)


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidPlaces(Places):
    """Places on the top of a solid cover.

    Attributes:
        sensor: The sensor.
        progress: Called with a line of text while the cover is meshed.
        mesh: Finest mesh of the cover, made when a place is located.
    """

    sensor: SensorDescription
    progress: Progress | None = field(default=None, repr=False)
    default = "curved.toml"

    @property
    def refused(self) -> Mapping[str, str]:
        """One indenter presses at one place; see `Places`."""
        motion = "motions along a curved cover and falls on it are not computed; give one place and loads"
        return {"others": _TOGETHER, "motion": motion}

    @cached_property
    def mesh(self) -> SolidMesh:
        """Finest mesh of the solid cover."""
        return make_meshes(self.sensor, self.progress)[-1]

    @cached_property
    def top(self) -> FacetSurface:
        """Surface of the finest mesh that an indenter can touch."""
        from fem_reference.curved_cover.responses import find_top

        return find_top(self.mesh)

    @cached_property
    def above(self) -> FloatArray:
        """Points of the top above n texels, each along the normal of its texel, shape (n, 3) [m]."""
        from fem_reference.curved_cover.responses import find_above

        return find_above(self.top, self.sensor.array)

    @cached_property
    def thickness(self) -> float:
        """Mean thickness of the solid cover, measured on its finest mesh [m]."""
        return measure_thickness(self.mesh)

    @cached_property
    def inside(self) -> BoolArray:
        """Active texels with the top all around the point above them; all active ones where there are none, shape (n,).

        A contact at the border of the top is not resolved.
        """
        texels, turn = self.sensor.array, np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
        directions = np.stack([np.cos(turn), np.sin(turn)], axis=1) @ tangent_axes(texels.normals)
        ring = (self.above[:, None] + _AWAY * self.thickness * directions).reshape(-1, 3)
        place = self.top.locate(ring)[0]
        normals = unit_vectors(place @ self.top.normals)
        beside = np.linalg.norm(np.cross(ring - place @ self.top.nodes, normals), axis=1).reshape(-1, _AROUND)
        inside = texels.active & (beside < _BESIDE * self.thickness).all(axis=1)
        return inside if inside.any() else texels.active

    @cached_property
    def named(self) -> dict[str, FloatArray]:
        """Points near the top by name, shape (3,) each [m].

        `middle`, also called `centre` and `texel`, lies above the texel nearest to the middle of all texels. `off grid`
        lies less than half a pitch from it. `edge`, also called `corner`, lies above the texel farthest from it. `side`
        lies above the texel whose normal differs most from that of the middle.  Both are about a thickness and more
        away from the border of the top, where there is such a texel.
        """
        texels, middle, above = self.sensor.array, find_middle(self.sensor.array), self.above
        far = np.where(self.inside, np.linalg.norm(texels.centres - texels.centres[middle], axis=1), -1.0)
        turned = np.where(self.inside, -texels.normals @ texels.normals[middle], -2.0)
        beside = (np.array([_OFF_GRID_X, -_OFF_GRID_Y]) * texels.pitch) @ tangent_axes(texels.normals)[middle]
        edge = above[int(np.argmax(far))]
        return {
            **dict.fromkeys(("middle", "centre", "texel"), above[middle]),
            "off grid": above[middle] + beside,
            **dict.fromkeys(("edge", "corner"), edge),
            "side": above[int(np.argmax(turned))],
        }

    def read_at(self, text: str, *, place: str) -> str | tuple[float, ...]:
        """Read the name of a place, or coordinates x, y and z [m], of which a planar array needs no z; see `Places`."""
        names = ("middle", "centre", "texel", "off grid", "edge", "corner", "side")
        return read_place(text, place, names, (2, 3) if self.sensor.array.planar else (3,))

    def read_direction(self, text: str, *, place: str) -> str | Vector:
        """Read the name of a direction relative to the normal of the cover, or three numbers; see `Places`."""
        if text in DIRECTIONS:
            return text
        example = f"{'--direction=' if place == '--direction' else ''}0,0.5,-1"
        parts = text.split(",")
        if len(text) > _LONGEST or len(parts) != 3 or not all(map(_NUMBER.fullmatch, parts)):  # noqa: PLR2004
            raise InputError(
                f"{place}: unknown direction {text[:_LONGEST]!r}; {nearest(text[:_LONGEST], DIRECTIONS)}, or three "
                f"numbers such as {example}"
            )
        x, y, z = map(float, parts)
        if not 0 < max(abs(x), abs(y), abs(z)) < math.inf:
            raise InputError(f"{place}: {text!r} must be finite and not zero; write for example {example}")
        return (x, y, z)

    def read_tilt(self, text: str, *, place: str) -> tuple[float, float]:
        """Read the tilt, at most 80 degrees about either axis [rad]; see `Places`."""
        tilt = read_angles(text, place=place, example="0deg,45deg")
        if max(map(abs, tilt)) > _MOST_TILT:
            most = f"at most {math.degrees(_MOST_TILT):g} deg about either axis are accepted"
            raise InputError(f"{place}: {text!r}: {most}")
        return tilt

    def find(self, pose: PoseText) -> Pose:
        """Find the nearest point of the top, and the direction there; see `Places`."""
        at = tuple(self.named[pose.at].tolist()) if isinstance(pose.at, str) else pose.at
        point, normal = self._touch(at, pose.prefix)
        towards = _turn_aside(pose.direction, normal)
        return replace(Pose.facing(point, towards / np.linalg.norm(towards), spin=pose.yaw), tilt=pose.tilt)

    def scale_loads(self, table: LoadsForTable, source: str) -> float:
        """Return the factor on a campaign's loads: E t^2 of this cover over that of the campaign's cover; see `Places`.

        E is Young's modulus, of several layers under one pressure, and t the thickness.
        """
        del source
        cover = self.sensor.cover
        yielding = sum(layer.thickness / layer.material.youngs_modulus for layer in cover.layers)
        return cover.thickness**3 / yielding / (table.modulus * table.thickness**2)

    def _touch(self, at: tuple[float, ...] | None, prefix: str) -> tuple[FloatArray, FloatArray]:
        """Find the point of first touch on the top of the cover, and the unit normal there.

        Args:
            at: Wanted coordinates [m], from which the nearest point of the top is taken.  If None, the point lies above
                a texel, along whose normal it is touched: the texel nearest to the middle of all active texels, among
                the texels with a top above them.
            prefix: Text before `at` in messages.
        """
        top, texels, thickness = self.top, self.sensor.array, self.thickness
        if at is None:
            middle = self._find_covered(prefix)
            wanted = self.above[[middle]]
        else:
            wanted = np.array([at if len(at) == 3 else (*at, thickness)])  # noqa: PLR2004 -- x, y and z
        weights, distance = top.locate(wanted)
        point = (weights @ top.nodes)[0]
        if distance[0] > _OFF_TOP * thickness:
            near = ",".join(f"{round(1e3 * each, 4) + 0.0:g}mm" for each in point)
            raise InputError(
                f"{prefix}at: the place is {1e3 * distance[0]:.4g} mm from the cover's surface; the nearest point is "
                f"{near}"
            )
        if at is not None and len(at) == 3 and distance[0] > _TOLD * thickness:  # noqa: PLR2004 -- x, y and z
            near = describe(point)
            away = 1e3 * distance[0]
            _LOG.warning("%sat: the nearest point of the surface is (%s) mm, %.2g mm away", prefix, near, away)
        # At the default place the normal of the texel is used, because on a rough surface the normal of the top varies
        # from element to element.
        normal = texels.normals[middle] if at is None else (weights @ top.normals)[0]
        return point, normal / np.linalg.norm(normal)

    def _find_covered(self, prefix: str) -> int:
        """Return the index of the texel nearest to the middle of the active texels, among those below the cover's top.

        A texel lies below the top if the line along its normal meets the top.
        """
        from fem_reference.curved_cover.responses import find_uncovered

        texels = self.sensor.array
        covered = texels.active & ~find_uncovered(self.top, texels, self.thickness)
        if not covered.any():
            raise InputError(
                f"{prefix}at: is needed: no texel has a surface of the cover above it along its normal; write for "
                "example --at=0mm,2mm,8mm"
            )
        return find_middle(texels, covered)


@singledispatch
def find_places(cover: object, sensor: SensorDescription | Parameters, progress: Progress | None = None) -> Places:
    """Return the places on the cover of a sensor.

    The places are those on planar layers, unless another function is registered for the type of the cover.

    Args:
        cover: The cover of the sensor; None if it is not known.
        sensor: The sensor.
        progress: Called with a line of text before each step.
    """
    del progress
    friction = getattr(sensor, "friction", 0.0)
    return FlatPlaces(array=sensor.array, cover=cover if isinstance(cover, Cover) else None, friction=friction)


@find_places.register(SolidCover)
def _(cover: SolidCover, sensor: SensorDescription, progress: Progress | None = None) -> Places:
    del cover
    return SolidPlaces(sensor=sensor, progress=progress)


def find_middle(texels: TexelArray, among: BoolArray | None = None) -> int:
    """Return the index of the texel whose centre is nearest to the mean of all active centres.

    Args:
        texels: The texels.
        among: Whether each texel may be returned, shape (n,); the active texels if None.
    """
    allowed = np.flatnonzero(texels.active if among is None else among)
    middle = texels.centres[texels.active].mean(axis=0)
    return int(allowed[np.argmin(np.linalg.norm(texels.centres[allowed] - middle, axis=1))])


def _turn_aside(direction: str | Vector, normal: FloatArray) -> FloatArray:
    """Return the direction of an indenter's motion as a vector of any length, shape (3,) [-].

    The direction `normal` is against the normal of the cover.  The directions `oblique x` and `oblique y` are turned
    from it by 30 degrees towards the first and the second tangent axis of the cover.
    """
    if not isinstance(direction, str):
        return np.array(direction, dtype=float)
    if direction == DIRECTIONS[0]:
        return -normal
    aside = tangent_axes(normal[None])[0][DIRECTIONS.index(direction) - 1]
    return np.asarray(aside * math.sin(_OBLIQUE) - normal * math.cos(_OBLIQUE))
