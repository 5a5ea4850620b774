"""Cases: indentations in which the fast model is scored against the finite elements."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

from meshes import Indenter, Pose, tilt_indenter
from validation.text.indenter import read_indenter, read_load, read_position, read_yaw


@dataclasses.dataclass(frozen=True, kw_only=True)
class Case:
    """One indentation that is scored: an indenter with its pose and load.

    Attributes:
        name: Short name, unique in its campaign.
        indenter: Rigid body that presses on the cover.
        shape: The indenter as text, for example `sphere:radius=5mm`.
        load: Applied force along the direction of the motion, of all bodies together [N].
        pose: Position of first touch, direction of motion, and rotation of the indenter.
        path: Ascending loads of the loading path to which the load belongs [N]; empty if the load is applied at once.
        compared: Names of the metrics that are pooled over cases, fields of `Score`; empty for all metrics.
        required: Largest accepted value of metrics in this case, by name, in SI units or as a fraction.
        others: Further bodies that press at the same time, each as a case of its own.
    """

    name: str
    indenter: Indenter
    shape: str
    load: float
    pose: Pose = dataclasses.field(default_factory=Pose)
    path: tuple[float, ...] = ()
    compared: tuple[str, ...] = ()
    required: Mapping[str, float] = dataclasses.field(default_factory=dict, hash=False)
    others: tuple[Case, ...] = ()

    @classmethod
    def read(cls, name: str, shape: str, load: str, *, at: str = "0mm,0mm", yaw: str = "0deg") -> Case:
        """Create a case (one indentation that is scored) from strings in the format of the command line.

        Args:
            name: Short name of the case.
            shape: Indenter as text, for example `sphere:radius=5mm`.
            load: Load as text, for example `4.9 N` or `500 g`.
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
            pose=Pose.planar(at=read_position(at), yaw=read_yaw(yaw)),
        )

    @property
    def bodies(self) -> tuple[Case, ...]:
        """Each body alone, under its own load."""
        own = self.load - sum(each.load for each in self.others)
        return (dataclasses.replace(self, load=own, others=()), *self.others)

    def with_load(self, load: float) -> Case:
        """Return the case under another load [N]; the loads of all bodies change by one factor."""
        others = tuple(each.with_load(load / self.load * each.load) for each in self.others)
        return dataclasses.replace(self, load=load, others=others)

    @property
    def turned(self) -> Case:
        """An equal case whose indenter has a tilted shape and an upright pose, for models without tilt."""
        upright = dataclasses.replace(self.pose, tilt=(0.0, 0.0))
        return dataclasses.replace(self, indenter=tilt_indenter(self.indenter, self.pose.tilt), pose=upright)

    def compares(self, metric: str) -> bool:
        """Whether a metric of this case is pooled over cases."""
        return not self.compared or metric in self.compared

    def has_shape_of(self, other: Case) -> bool:
        """Whether two cases have the same indenter, even if the texts that describe the indenter differ."""
        from fem_reference.result_store import describe

        return type(self.indenter) is type(other.indenter) and describe(self.indenter) == describe(other.indenter)

    def is_press_of(self, other: Case) -> bool:
        """Whether two cases are the same press: the same indenter, load and pose."""
        mine, others = ((each.load, each.path, len(each.others)) for each in (self, other))
        if mine != others or not all(map(Case.is_press_of, self.others, other.others)):
            return False
        return self.pose.is_close_to(other.pose) and self.has_shape_of(other)

    def as_json(self) -> dict[str, Any]:
        """Return the case as a dictionary of JSON values, which `from_json` reads."""
        about = {"name": self.name, "indenter": self.shape, "load": self.load}
        return (
            about
            | tabulate_pose(self.pose)
            | {"path": self.path, "compared": self.compared, "required": self.required}
            | ({"others": [each.as_json() for each in self.others]} if self.others else {})
        )

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Case:
        """Create the case from a dictionary of JSON values that `as_json` returned.

        Raises:
            InputError: If the indenter's mesh file no longer exists.
        """
        return cls(
            name=values["name"],
            indenter=read_indenter(values["indenter"]),
            shape=values["indenter"],
            load=values["load"],
            pose=Pose(point=values["at"], direction=values["direction"], yaw=values["yaw"], tilt=values["tilt"]),
            path=tuple(values["path"]),
            compared=tuple(values["compared"]),
            required=dict(values["required"]),
            others=tuple(map(cls.from_json, values.get("others", ()))),
        )

    def describe(self, name: Callable[[str], str] = str) -> str:
        """Describe every body with its own load and place.

        Args:
            name: Function that describes an indenter, given as text.
        """
        return " and ".join(f"{name(each.shape)}, {each.load:.3g} N at {each.place}" for each in self.bodies)

    @property
    def place(self) -> str:
        """Position, direction and rotation of the indenter as text, in mm and degrees."""
        return describe_pose(self.pose)


def describe_pose(pose: Pose) -> str:
    """Describe a pose in words, in mm and degrees; the direction only where it is not along -z."""
    place = pose.at if pose.is_planar and pose.point[2] == 0 else pose.point
    at = ", ".join(_format_number(1e3 * value) for value in place)
    towards = "" if pose.is_planar else f" along ({', '.join(f'{round(each, 3) + 0.0:g}' for each in pose.direction)})"
    angles = ", ".join(f"{_format_number(math.degrees(angle))}\u00b0" for angle in pose.tilt)
    tilted = f", tilted {angles}" if any(pose.tilt) else ""
    return f"({at}) mm{towards}, {_format_number(math.degrees(pose.yaw))}\u00b0{tilted}"


def tabulate_pose(pose: Pose) -> dict[str, Any]:
    """Return a pose as a dictionary of JSON values: `at` [m], `direction` [-], `yaw` and `tilt` [rad]."""
    return {"at": list(pose.point), "direction": list(pose.direction), "yaw": pose.yaw, "tilt": list(pose.tilt)}


def _format_number(value: float) -> str:
    """Format a number with at most two decimals, without trailing zeros, and without a minus sign before zero."""
    return f"{round(value, 2) + 0.0:g}"
