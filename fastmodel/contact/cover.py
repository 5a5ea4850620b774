"""Contact methods that sample the shapes of touching bodies: an elastic foundation, and the cover itself.

Both put one rigid plate under the array for the dynamics.  The engine's force on each touching body is then laid out
over sub-texel cells: by springs that know nothing of one another (`Foundation`), or by the cover's own compliance
between cells (`CoverContact`), which is also how it arrives at the base.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from fastmodel.contact.interface import ContactReader, Reading
from fastmodel.contact.panel_layout import Layout, ScatteredBase, ScatteredGrid, lay_out, panels
from fastmodel.contact.panels import FacetReader
from fastmodel.contact.plate import Plate, PlateReader, Touching
from fastmodel.errors import ParametersError
from fastmodel.pose import Pose
from fastmodel.pressure.base_forces import BaseForces
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.conjugate_gradient import CoverSolver, Settings
from fastmodel.pressure.cover_kernels import CoverCells
from fastmodel.pressure.gap_sampling import Load, Samples
from fastmodel.pressure.reused_contact import Held, Laid
from fastmodel.pressure.winkler import foundation_forces
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]

#: Height up to which a body is looked at, over the level it has come down to: at least (the cover may bulge up beside a
#: contact), and as taken for the next step [-].
_LEAST, _SPARE = 1.2, 1.6
#: Height over a body's lowest point up to which it is looked at first, over the cover's thickness, and at most, over
#: the first [-].
_FIRST, _MOST = 0.1, 20.0
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
            ground.reader(model, array, name, native=native),
            layer,
            ground,
            first=_FIRST * min(array.pitch),
            native=native,
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
        layer = _CoverLayer(ground, cells, settings, native=native)
        touching, base = ground.reader(model, array, name, native=native), ground.base(cells, array)
        return _SurfaceReader(touching, layer, ground, base, first=_FIRST * cells.thickness, native=native)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Ground:
    """The cells under an array: one grid where it is flat and even, else panels on a lattice."""

    plate: Plate
    grid: CellGrid
    layout: Layout | None = None

    @classmethod
    def under(cls, plate: Plate, array: TexelArray, per_texel: int, *, apart: int = 1) -> _Ground:
        if array.regular:
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

    def lay_out(self, samples: Samples, loads: Sequence[Load], slid: tuple[int, int]) -> Laid:
        """Forces on cells; the contact has slid by so many rows and columns since the last one."""

    def reset(self) -> None:
        """Forget what was laid out before."""


class _SurfaceReader:
    """Samples what touches, up to a height that follows the contact; what rests or slides is carried along."""

    def __init__(
        self,
        touching: PlateReader,
        layer: _Layer,
        ground: _Ground,
        base: BaseForces | ScatteredBase | None = None,
        *,
        first: float,
        native: bool | None,
    ) -> None:
        self._native = native
        self._touching, self._layer, self._grid, self._base = touching, layer, ground.grid, base
        self._flat = ground.layout is None
        self._first, self._most = first, _MOST * first
        self._reach: dict[int, float] = {}
        self._held: Held | None = None
        self._nothing = self.at_rest(np.zeros(ground.grid.texels))

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        self._reach.clear()
        self._held = None
        self._layer.reset()
        return Reading(
            contact_forces=contact_forces,
            texel_forces=None if self._base is None else self._base.of_texels(contact_forces),
            carried=float(contact_forces.sum()),
        )

    def compile_kernels(self, data: Any) -> None:  # noqa: ANN401 -- MjData
        self.read(data)

    def read(self, data: Any) -> Reading:  # noqa: ANN401
        touching = self._touching.touching(data)
        if touching is None:
            self._held = None
            return self._nothing
        if self._held is not None and (reading := self._held.carry(touching)) is not None:
            return reading
        self._held = self._hold(touching)
        return self._nothing if self._held is None else self._held.reading

    def _hold(self, touching: Touching) -> Held | None:
        """Solve the contact; None where nothing of it lies on the cells."""
        samples, slid = None, (0, 0)
        reach = [self._reach.get(body, self._first) for body in touching.bodies]
        if self._held is not None and (moved := self._held.slid(touching)) is not None:
            slid = moved
        elif self._held is not None:
            # the same cells, and the pose that they were looked at in: what creeps adds up
            samples, reach = self._held.samples, list(self._held.reach)
            touching = dataclasses.replace(touching, standing=self._held.touching.standing)
        while True:
            if samples is None:
                samples = self._touching.look(touching, reach)
            kept = samples.seen
            if len(kept) < len(reach):
                # beside the cells: nothing of it is felt here
                touching, reach, samples = touching.only(kept), [reach[body] for body in kept], None
                if not kept:
                    return None
                continue
            laid = self._layer.lay_out(samples, touching.loads, slid)
            level = np.where(np.isfinite(laid.level), laid.level, self._first).tolist()
            higher = [
                min(_SPARE * top, self._most) if have < min(top * _LEAST, self._most) else have
                for have, top in zip(reach, level, strict=True)
            ]
            if higher == reach:
                break
            reach, samples = higher, None
        for body, top in zip(touching.bodies, level, strict=True):
            self._reach[body] = min(max(_SPARE * top, self._first / 4), self._most)
        return Held(touching, samples, laid, self._grid, self._base, reach=reach, flat=self._flat, native=self._native)


class _FoundationLayer:
    def __init__(self, grid: CellGrid, modulus: float, *, native: bool | None) -> None:
        self._stiffness, self._native = modulus * grid.edge[0] * grid.edge[1], native

    def reset(self) -> None:
        """Springs remember nothing."""

    def lay_out(self, samples: Samples, loads: Sequence[Load], slid: tuple[int, int]) -> Laid:  # noqa: ARG002
        forces, levels = foundation_forces(samples, loads, self._stiffness * samples.coverage, native=self._native)
        return Laid(forces, samples.largest(levels) - samples.lowest)


class _CoverLayer:
    def __init__(self, ground: _Ground, cells: CoverCells, settings: Settings, *, native: bool | None) -> None:
        self._solver = CoverSolver(cells, ground.grid, settings, native=native)
        self._deep = ground.layout is None or len(ground.layout.facets) == 1

    def reset(self) -> None:
        self._solver.reset()

    def lay_out(self, samples: Samples, loads: Sequence[Load], slid: tuple[int, int]) -> Laid:
        found = self._solver.solve(samples, loads, slid)
        approach = found.approach if self._deep else None
        return Laid(found.forces, found.level, approach, found.on_cells, found.origin)
