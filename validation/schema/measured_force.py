"""Tables of a file of measured forces: the forces on an indenter at known depths."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field

from meshes import Sphere
from meshes.array_types import FloatArray
from validation.schema import Table
from validation.schema.sensor import FlatCover
from validation.schema.types import Force, Indenter, Length, choice

#: Largest number of points of a measurement; the finite elements solve every depth [-].
_MOST_POINTS = 100


class PointTable(Table):
    """One measured force.

    Attributes:
        depth: Approach of the indenter from first touch.
        force: Measured normal force.
        use: Whether the moduli are fitted to the force ("fit") or it is scored ("score").
    """

    depth: Length = Field(examples=["0.5 mm"])
    force: Force = Field(examples=["1.65 N"])
    use: Annotated[str, choice("fit", "score")] = Field(examples=["fit"])


class UncertaintyTable(Table):
    """Standard uncertainties of the measurement.

    Attributes:
        force: Standard uncertainty of each force, independent of the others.
        zero: Standard uncertainty of the zero of depth; its error is the same for all points.
    """

    force: Force | None = None
    zero: Length | None = None


class Measurement(Table):
    """Measured forces on an indenter that is pressed into the middle of a cover.

    Attributes:
        name: Name for tables.
        indenter: Indenter with an axis of revolution.
        cover: The cover; all moduli are multiplied by one fitted factor.
        point: The measured forces.
        source: Origin of the data.
        top_radius: Radius of curvature of a domed top under a ball; flat when left out.
        uncertainty: Standard uncertainties of the measurement.
    """

    name: str = Field(examples=["my pad"])
    indenter: Indenter = Field(examples=["sphere:radius=7.5mm"])
    cover: FlatCover
    point: Annotated[list[PointTable], Field(max_length=_MOST_POINTS)]
    source: str = "given by the user"
    top_radius: Length | None = None
    uncertainty: UncertaintyTable = UncertaintyTable()

    @property
    def _points(self) -> list[PointTable]:
        return sorted(self.point, key=lambda each: each.depth)

    @property
    def depth(self) -> FloatArray:
        """Approaches from first touch, ascending, shape (n,) [m]."""
        return np.array([each.depth for each in self._points])

    @property
    def force(self) -> FloatArray:
        """Measured normal forces, shape (n,) [N]."""
        return np.array([each.force for each in self._points])

    @property
    def fitted(self) -> npt.NDArray[np.bool_]:
        """Whether each point is used to fit the moduli, shape (n,); the other points are scored."""
        return np.array([each.use == "fit" for each in self._points])

    def list_faults(self) -> Iterator[tuple[str, str]]:
        """Yield faults of points and of the indenter."""
        if {point.use for point in self.point} != {"fit", "score"}:
            yield "point", 'takes at least one with use = "fit" and one with use = "score"'
        elif len({point.depth for point in self.point}) == 1:
            yield "point", "takes points at two depths or more"
        for number, point in enumerate(self.point):
            if point.depth >= self.cover.thickness:
                limit = f"accepted: less than its {1e3 * self.cover.thickness:.4g} mm"
                yield f"point[{number}].depth", f"{1e3 * point.depth:.4g} mm pierces the cover; {limit}"
        if not self.indenter.axisymmetric:
            yield "indenter", "takes a body of revolution: sphere, cylinder, tip or cone"
        if self.top_radius is not None and not isinstance(self.indenter, Sphere):
            yield "top_radius", "takes a sphere as indenter; remove the key, or let indenter be a sphere"
        least = min((point.depth for point in self.point), default=math.inf)
        if self.uncertainty.zero is not None and self.uncertainty.zero >= least:
            yield "uncertainty.zero", f"must be less than the smallest depth, {1e3 * least:.4g} mm"
