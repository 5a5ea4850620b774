"""Contact methods that sample the shapes of touching bodies: an elastic foundation, and the cover itself.

Both put one rigid plate under the array for the dynamics.  The engine's force on each touching body is then laid out
over sub-texel cells: by springs that know nothing of one another (`Foundation`), or by the cover's own compliance
between cells (`CoverContact`), which is also how it arrives at the base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from fastmodel.base_forces import BaseForces
from fastmodel.contact import ContactReader, Reading
from fastmodel.cover_cells import CoverCells
from fastmodel.cover_solver import CoverSolver, Settings
from fastmodel.errors import ParametersError
from fastmodel.foundation import foundation_forces
from fastmodel.plate import Plate, PlateReader, grid_of
from fastmodel.pose import Pose
from fastmodel.sampling import Samples, sample
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]

#: Share of the height up to which a body is looked at that its contact may fill; beyond it is looked at higher up.
_FILLED = 0.7
#: Heights over a body's lowest point up to which it is looked at, first and at most, over the cover's thickness [-].
_FIRST, _MOST = 0.1, 2.0
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
        native: bool | None = None,  # noqa: ARG002 -- numpy throughout
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
        return _FoundationReader(self.plate, model, array, name, modulus=modulus, per_texel=count)


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
        native: bool | None = None,  # noqa: ARG002 -- numpy throughout
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
        return _CoverReader(self, model, array, name, cells)


class _SurfaceReader:
    """Samples what touches, at a height that follows the contact."""

    def __init__(self, plate: Plate, model: Any, array: TexelArray, name: str, *, per_texel: int, first: float) -> None:  # noqa: ANN401
        self.grid = grid_of(array, per_texel, plate)
        edge = _EDGE * float(np.sqrt(self.grid.edge[0] * self.grid.edge[1]))
        self._touching = PlateReader(plate, model, array, name, edge)
        self._count = array.count
        self._first, self._reach = first, dict[int, float]()

    def read(self, data: Any) -> Reading:  # noqa: ANN401
        touching = self._touching.touching(data)
        if touching is None:
            return self.at_rest(np.zeros(self._count))
        reach = [self._reach.get(body, self._first) for body in touching.bodies]
        while True:
            samples = sample(self.grid, touching.parts, reach)
            kept = [body for body in range(len(reach)) if (samples.body == body).any()]
            if len(kept) < len(reach):
                # beside the cells: nothing of it is felt here
                touching = touching.only(kept)
                reach = [reach[body] for body in kept]
                if not kept:
                    return self.at_rest(np.zeros(self._count))
                continue
            forces, reading = self._lay_out(samples, touching.loads)
            highest = _highest(samples, forces, len(reach))
            higher = [
                2 * have if have < _MOST * self._first / _FIRST and top > _FILLED * have else have
                for have, top in zip(reach, highest, strict=True)
            ]
            if higher == reach:
                break
            reach = higher
        for body, top in zip(touching.bodies, highest, strict=True):
            self._reach[body] = max(1.6 * float(top), self._first / 4)
        return reading

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        raise NotImplementedError

    def _lay_out(self, samples: Samples, loads: Sequence[Any]) -> tuple[FloatArray, Reading]:
        raise NotImplementedError

    def _on_texels(self, samples: Samples, forces: FloatArray) -> FloatArray:
        texel = self.grid.texel(samples.row, samples.column)
        return np.bincount(texel + 1, forces, self._count + 1)[1:].astype(np.float64)


def _highest(samples: Samples, forces: FloatArray, bodies: int) -> FloatArray:
    """Height of the highest touching cell over each body's lowest, shape (bodies,) [m]."""
    lowest, highest = np.full(bodies, np.inf), np.full(bodies, -np.inf)
    np.minimum.at(lowest, samples.body, samples.gap)
    pressed = forces > 0
    np.maximum.at(highest, samples.body[pressed], samples.gap[pressed])
    return np.asarray(np.maximum(highest - lowest, 0.0))


class _FoundationReader(_SurfaceReader):
    def __init__(
        self,
        plate: Plate,
        model: Any,  # noqa: ANN401 -- MjModel
        array: TexelArray,
        name: str,
        *,
        modulus: float,
        per_texel: int,
    ) -> None:
        super().__init__(plate, model, array, name, per_texel=per_texel, first=_FIRST * min(array.pitch))
        self._stiffness = modulus * self.grid.edge[0] * self.grid.edge[1]

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        self._reach.clear()
        return Reading(contact_forces=contact_forces, texel_forces=None, carried=float(contact_forces.sum()))

    def _lay_out(self, samples: Samples, loads: Sequence[Any]) -> tuple[FloatArray, Reading]:
        forces = foundation_forces(samples, loads, self._stiffness * samples.coverage)
        contact = self._on_texels(samples, forces)
        return forces, Reading(contact_forces=contact, texel_forces=None, carried=float(forces.sum()))


class _CoverReader(_SurfaceReader):
    def __init__(self, method: CoverContact, model: Any, array: TexelArray, name: str, cells: CoverCells) -> None:  # noqa: ANN401
        cells.check_pitch(array)
        super().__init__(method.plate, model, array, name, per_texel=cells.per_texel, first=_FIRST * cells.thickness)
        settings = Settings(tolerance=method.tolerance, steps=method.steps)
        self._solver = CoverSolver(cells, self.grid, settings)
        self._base = BaseForces(cells, self.grid, array)

    def at_rest(self, contact_forces: FloatArray) -> Reading:
        self._reach.clear()
        self._solver.reset()
        return Reading(
            contact_forces=contact_forces,
            texel_forces=self._base.of_texels(contact_forces),
            carried=float(contact_forces.sum()),
        )

    def _lay_out(self, samples: Samples, loads: Sequence[Any]) -> tuple[FloatArray, Reading]:
        solution = self._solver.solve(samples, loads)
        return solution.forces, Reading(
            contact_forces=self._on_texels(samples, solution.forces),
            texel_forces=self._base.of_window(solution.on_cells, solution.origin),
            carried=float(solution.forces.sum()),
            approach=solution.approach,
        )
