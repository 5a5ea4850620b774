"""Contact methods that sample the shapes of touching bodies: an elastic foundation, and the cover itself.

Both put one rigid plate under the array for the dynamics.  The engine's force on each touching body is then laid out
over sub-texel cells: by springs that know nothing of one another (`Foundation`), or by the cover's own compliance
between cells (`CoverContact`), which is also how it arrives at the base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from fastmodel.base_forces import BaseForces
from fastmodel.contact import ContactReader, Reading
from fastmodel.cover_cells import CoverCells
from fastmodel.cover_solver import CoverSolver, Settings
from fastmodel.errors import ParametersError
from fastmodel.facets import FacetReader
from fastmodel.foundation import foundation_forces
from fastmodel.layout import Layout, ScatteredBase, ScatteredGrid, lay_out, panels
from fastmodel.plate import Plate, PlateReader, Touching
from fastmodel.pose import Pose
from fastmodel.sampling import CellGrid, Load, Samples
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]

#: Height up to which a body is looked at, over the level it has come down to: at least (the cover may bulge up beside a
#: contact), and as taken for the next step [-].
_LEAST, _SPARE = 1.2, 1.6
#: Height over a body's lowest point up to which it is looked at first, over the cover's thickness, and at most, over
#: the first [-].
_FIRST, _MOST = 0.1, 20.0
#: Share of a cell that a body may have moved along the array, and of its force that may have changed, for its contact
#: to count as unchanged; and change of its axes [-].
_STILL, _TURNED = 1e-4, 1e-5
#: Share of a cell by which sharp edges stand out, see `lower_surface` [-].
_EDGE = 0.125


@dataclass(frozen=True, kw_only=True)
class Foundation:
    """One rigid plate; the force of each body laid out over an elastic foundation of cells.

    Attributes:
        plate: The plate's geom.
        modulus: Pressure per depth; that of the cover under a patch four thicknesses wide when not given [Pa/m].
        per_texel: Cells along each edge of a pitch; the cover data's when not given, else 4 [-].
    """

    plate: Plate = field(default_factory=Plate)
    modulus: float | None = None
    per_texel: int | None = None

    costly: ClassVar[bool] = True
    honours: ClassVar[tuple[str, ...]] = ("Fz", "Mx", "My")

    def attach(self, body: Any, array: TexelArray, pose: Pose, name: str) -> None:  # noqa: ANN401 -- mjsBody
        """Add the plate to a body of the spec."""
        self.plate.attach(body, array, pose, name)

    def bind(
        self,
        model: Any,  # noqa: ANN401 -- MjModel
        array: TexelArray,
        name: str,
        *,
        cells: CoverCells | None = None,
        native: bool | None = None,
    ) -> ContactReader:
        """Find the plate in the compiled model.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
            ParametersError: If there is neither a modulus nor cover data.
        """
        if self.modulus is None and cells is None:
            raise ParametersError(
                f"sensor {name!r}: the contact method 'foundation' needs the cover's cells or a modulus; derive the "
                f"parameters anew, or use Foundation(modulus=...)"
            )
        modulus = self.modulus or (cells.foundation_modulus() if cells else 0.0)
        count = self.per_texel or (cells.per_texel if cells else 4)
        ground = _Ground.under(self.plate, array, count)
        layer = _FoundationLayer(ground.grid, modulus, native=native)
        return _SurfaceReader(
            ground.reader(model, array, name, native=native), layer, ground.grid, first=_FIRST * min(array.pitch)
        )


@dataclass(frozen=True, kw_only=True)
class CoverContact:
    """One rigid plate; the force of each body laid out by the cover's own compliance, and carried to its base.

    Attributes:
        plate: The plate's geom.
        tolerance: Change of cell forces at which the solver stops, over the load [-].
        steps: Most steps of the solver.
    """

    plate: Plate = field(default_factory=Plate)
    tolerance: float = 5e-4
    steps: int = 100

    costly: ClassVar[bool] = True
    honours: ClassVar[tuple[str, ...]] = ("Fz", "Mx", "My")

    def attach(self, body: Any, array: TexelArray, pose: Pose, name: str) -> None:  # noqa: ANN401 -- mjsBody
        """Add the plate to a body of the spec."""
        self.plate.attach(body, array, pose, name)

    def bind(
        self,
        model: Any,  # noqa: ANN401 -- MjModel
        array: TexelArray,
        name: str,
        *,
        cells: CoverCells | None = None,
        native: bool | None = None,
    ) -> ContactReader:
        """Find the plate in the compiled model.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
            ParametersError: If the parameters hold no cover data for this pitch.
        """
        if cells is None:
            raise ParametersError(
                f"sensor {name!r}: the contact method 'cover' needs the cover's cells, which these parameters do not "
                f"hold; derive them anew, or use 'boxes' or 'area'"
            )
        cells.check(array)
        ground = _Ground.under(self.plate, array, cells.per_texel, apart=max(cells.compliance.shape))
        settings = Settings(tolerance=self.tolerance, steps=self.steps)
        layer = _CoverLayer(ground, array, cells, settings, native=native)
        return _SurfaceReader(
            ground.reader(model, array, name, native=native), layer, ground.grid, first=_FIRST * cells.thickness
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Ground:
    """The cells under an array: one grid where it is flat and even, else panels on a lattice."""

    plate: Plate
    grid: CellGrid
    layout: Layout | None = None

    @classmethod
    def under(cls, plate: Plate, array: TexelArray, per_texel: int, *, apart: int = 1) -> _Ground:
        if array.even:
            return cls(plate=plate, grid=CellGrid.over(array, per_texel, plate.margin))
        layout = lay_out(array, panels(array, plate.margin), per_texel, apart)
        return cls(plate=plate, grid=layout.grid, layout=layout)

    def reader(self, model: Any, array: TexelArray, name: str, *, native: bool | None) -> PlateReader:  # noqa: ANN401
        edge = _EDGE * float(np.sqrt(self.grid.edge[0] * self.grid.edge[1]))
        if self.layout is None:
            return PlateReader(self.plate, model, array, name, grid=self.grid, edge=edge, native=native)
        return FacetReader(self.plate, model, array, name, layout=self.layout, edge=edge, native=native)

    def base(self, cells: CoverCells, array: TexelArray) -> BaseForces | ScatteredBase:
        if self.layout is not None and isinstance(self.grid, ScatteredGrid):
            return ScatteredBase(cells, self.layout, self.grid, array)
        return BaseForces(cells, self.grid, array)


class _Layer(Protocol):
    """How the force of each body is laid out over cells."""

    def lay_out(self, samples: Samples, loads: Sequence[Load]) -> tuple[Reading, FloatArray]:
        """The reading, and the height over each body's lowest point up to which its cells go under the top [m]."""

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        """The reading of forces that spread evenly over texels, shape (n,) [N]; forgets what was laid out before."""


class _SurfaceReader:
    """Samples what touches, up to a height that follows the contact; what stands still is not sampled again."""

    def __init__(self, touching: PlateReader, layer: _Layer, grid: CellGrid, *, first: float) -> None:
        self._touching, self._layer, self._grid = touching, layer, grid
        self._first, self._most = first, _MOST * first
        self._axes = 3 if isinstance(touching, FacetReader) else 2
        self._reach: dict[int, float] = {}
        self._last: tuple[Touching, Reading] | None = None
        self._samples: Samples | None = None
        self._nothing = layer.at_rest(np.zeros(grid.texels))

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        self._reach.clear()
        self._last = self._samples = None
        return self._layer.at_rest(contact_forces)

    def read(self, data: Any) -> Reading:  # noqa: ANN401
        touching = self._touching.touching(data)
        if touching is None:
            self._last = self._samples = None
            return self._nothing
        if self._last is not None and _stands_still(self._last[0], touching, self._still, self._axes):
            if _presses_alike(self._last[0], touching, self._still):
                return _scaled(self._last[1], touching.force / self._last[0].force)
        else:
            self._samples = None
        reading = self._lay_out(touching)
        self._last = (touching, reading) if reading is not self._nothing else None
        return reading

    @property
    def _still(self) -> float:
        return _STILL * min(self._grid.edge)

    def _lay_out(self, touching: Touching) -> Reading:
        reach = [self._reach.get(body, self._first) for body in touching.bodies]
        while True:
            if self._samples is None:
                self._samples = self._touching.look(touching, reach)
            kept = self._samples.seen
            if len(kept) < len(reach):
                # beside the cells: nothing of it is felt here
                touching, reach, self._samples = touching.only(kept), [reach[body] for body in kept], None
                if not kept:
                    return self._nothing
                continue
            reading, level = self._layer.lay_out(self._samples, touching.loads)
            level = np.where(np.isfinite(level), level, self._first)
            higher = [
                min(_SPARE * top, self._most) if have < min(top * _LEAST, self._most) else have
                for have, top in zip(reach, level.tolist(), strict=True)
            ]
            if higher == reach:
                break
            reach, self._samples = higher, None
        for body, top in zip(touching.bodies, level.tolist(), strict=True):
            self._reach[body] = min(max(_SPARE * top, self._first / 4), self._most)
        return reading


def _stands_still(before: Touching, now: Touching, distance: float, axes: int) -> bool:
    """Whether the same bodies touch and none of them moved along the array; approach and tilt follow from the loads.

    On a flat array that is along two axes, on any other along all three.
    """
    return before.bodies == now.bodies and all(
        np.abs(a.position[:, :axes] - b.position[:, :axes]).max() <= distance
        and np.abs(a.rotation - b.rotation).max() <= _TURNED
        for a, b in zip(before.standing, now.standing, strict=True)
    )


def _presses_alike(before: Touching, now: Touching, distance: float) -> bool:
    """Whether every body presses as before, with the same point of pressure where that counts."""
    return all(
        abs(a.force - b.force) <= _STILL * a.force and b.alike(a, distance)
        for a, b in zip(before.loads, now.loads, strict=True)
    )


def _scaled(reading: Reading, factor: float) -> Reading:
    spread = reading.texel_forces
    return Reading(
        contact_forces=reading.contact_forces * factor,
        texel_forces=None if spread is None else spread * factor,
        carried=reading.carried * factor,
        approach=reading.approach,
    )


class _FoundationLayer:
    def __init__(self, grid: CellGrid, modulus: float, *, native: bool | None) -> None:
        self._grid, self._stiffness, self._native = grid, modulus * grid.edge[0] * grid.edge[1], native

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        return Reading(contact_forces=contact_forces, texel_forces=None, carried=float(contact_forces.sum()))

    def lay_out(self, samples: Samples, loads: Sequence[Load]) -> tuple[Reading, FloatArray]:
        forces, levels = foundation_forces(samples, loads, self._stiffness * samples.coverage, native=self._native)
        contact = self._grid.on_texels(samples, forces)
        reading = Reading(contact_forces=contact, texel_forces=None, carried=float(forces.sum()))
        return reading, samples.largest(levels) - samples.lowest


class _CoverLayer:
    def __init__(
        self, ground: _Ground, array: TexelArray, cells: CoverCells, settings: Settings, *, native: bool | None
    ) -> None:
        self._grid = ground.grid
        self._solver = CoverSolver(cells, ground.grid, settings, native=native)
        self._base = ground.base(cells, array)
        self._deep = ground.layout is None or len(ground.layout.facets) == 1

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        self._solver.reset()
        return Reading(
            contact_forces=contact_forces,
            texel_forces=self._base.of_texels(contact_forces),
            carried=float(contact_forces.sum()),
        )

    def lay_out(self, samples: Samples, loads: Sequence[Load]) -> tuple[Reading, FloatArray]:
        solution = self._solver.solve(samples, loads)
        reading = Reading(
            contact_forces=self._grid.on_texels(samples, solution.forces),
            texel_forces=self._base.of_window(solution.on_cells, solution.origin),
            carried=float(solution.forces.sum()),
            approach=solution.approach if self._deep else None,
        )
        return reading, solution.level
