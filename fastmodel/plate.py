"""One rigid plate for the dynamics: what each touching body presses it with, and what that body looks like from below.

The plate carries forces exactly and costs little, but says nothing about where on a face the force lands.  That comes
from the shapes themselves, sampled over the cells of the array.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.errors import FastModelError, LifeCycleError, StateError
from fastmodel.joints import Joints
from fastmodel.lower_surface import solid
from fastmodel.native import choose_kernel
from fastmodel.plate_forces import plate_loops, plate_numpy
from fastmodel.pose import Pose, rotate
from fastmodel.sampling import CellGrid, Load, Shape, Standing
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Plate:
    """The plate's geom.

    Attributes:
        height: Height of the plate, inward from the cover's top [m].
        margin: Pitches by which plate and cover reach beyond the outermost texels on each side; force there is
            outside [-].
        contact_bit: The plate's own collision bit, 0..30 [-].
    """

    height: float = 2e-3
    margin: int = 1
    contact_bit: int = 30

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the height is not positive, the margin negative or the bit not 0..30.
        """
        if not 0 < self.height < np.inf:
            raise ValueError(f"height must be positive, not {self.height} m")
        if self.margin < 0 or self.margin != int(self.margin):
            raise ValueError(f"margin must be a whole number of pitches from 0 on, not {self.margin}")
        if not 0 <= self.contact_bit <= 30:  # noqa: PLR2004 -- MuJoCo's collision masks are signed 32-bit
            raise ValueError(f"contact_bit must lie in 0..30, not {self.contact_bit}")

    def attach(self, body: Any, array: TexelArray, pose: Pose, name: str) -> None:  # noqa: ANN401 -- mjsBody
        """Add the plate to a body of a spec.

        Raises:
            FastModelError: If the array is not a flat, even grid.
        """
        require_grid(array)
        middle = array.centres.mean(axis=0) - [0, 0, self.height / 2]
        bit = 1 << self.contact_bit
        half = (np.array([array.columns, array.rows]) / 2 + self.margin) * array.pitch
        body.add_geom(
            name=plate_name(name),
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[*half, self.height / 2],
            pos=pose.position + rotate(pose.quaternion, middle[None])[0],
            quat=pose.quaternion,
            mass=0.0,
            contype=bit,
            conaffinity=0x7FFFFFFF & ~bit,
            rgba=[0.25, 0.27, 0.3, 1.0],
        )


def plate_name(name: str) -> str:
    """Name of a sensor's plate."""
    return f"{name}/plate"


def require_grid(array: TexelArray) -> None:
    """Check that cells can divide the array.

    Raises:
        FastModelError: If it is not a flat, even grid.
    """
    grid = TexelArray.grid(array.rows, array.columns, array.pitch)
    offset = array.centres - grid.centres
    if not array.planar or np.ptp(offset, axis=0).max() > 1e-6 * min(array.pitch):
        raise FastModelError(
            f"array {array.name!r} is not a flat, even grid; the contact methods 'foundation' and 'cover' need one; "
            f"'boxes' and 'area' take any layout"
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Touching:
    """Bodies that press on the plate: their ids, loads, and where they stand."""

    bodies: tuple[int, ...]
    loads: tuple[Load, ...]
    standing: tuple[Standing, ...]

    @property
    def force(self) -> float:
        """All force together [N]."""
        return sum(load.force for load in self.loads)

    def only(self, kept: Sequence[int]) -> Touching:
        """Some of the bodies."""
        return Touching(
            bodies=tuple(self.bodies[k] for k in kept),
            loads=tuple(self.loads[k] for k in kept),
            standing=tuple(self.standing[k] for k in kept),
        )


class PlateReader:
    """Finds in one step's data what presses on the plate."""

    def __init__(
        self,
        plate: Plate,
        model: Any,  # noqa: ANN401 -- MjModel
        array: TexelArray,
        name: str,
        *,
        edge: float,
        native: bool | None = None,
    ) -> None:
        """Find the plate in the compiled model.

        Args:
            plate: Its settings.
            model: The compiled model.
            array: The array that was attached.
            name: The sensor's name.
            edge: Distance by which sharp edges stand out [m].
            native: True for the numba kernel, False for numpy, None for whichever is there.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        self._geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, plate_name(name))
        if self._geom < 0:
            raise LifeCycleError(
                f"geom {plate_name(name)!r} is not in this model; bind a model compiled from the spec that sensor "
                f"{name!r} was attached to"
            )
        self._model, self._edge, self._name = model, edge, plate_name(name)
        self._middle = array.centres.mean(axis=0) - [0, 0, plate.height / 2]
        self._pyramidal = bool(model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL)
        self._group = model.body_weldid[model.geom_bodyid].astype(np.int64)
        self._shapes: dict[int, tuple[IntArray, Shape]] = {}
        self._joints = Joints(model, int(model.geom_bodyid[self._geom]))
        self._press = choose_kernel(plate_loops, plate_numpy, native=native)

    def touching(self, data: Any) -> Touching | None:  # noqa: ANN401 -- MjData
        """What presses on the plate now; None where nothing does."""
        if not data.nefc:
            return None
        axes = data.geom_xmat[self._geom].reshape(3, 3)
        origin = data.geom_xpos[self._geom] - axes @ self._middle
        contact = data.contact
        bodies, sums = np.empty(data.ncon, dtype=np.int64), np.empty((data.ncon, 3))
        count = self._press(
            contact.geom,
            contact.efc_address,
            contact.dim,
            contact.frame,
            contact.friction,
            contact.pos,
            data.efc_force,
            self._pyramidal,
            self._geom,
            self._group,
            axes,
            origin,
            bodies,
            sums,
        )
        if not np.isfinite(sums[:count]).all():
            raise StateError(f"contact forces on geom {self._name!r} are not finite at t = {data.time:g} s")
        pressing = [k for k in range(count) if sums[k, 0] > 0]
        if not pressing:
            return None
        return Touching(
            bodies=tuple(int(bodies[k]) for k in pressing),
            loads=tuple(
                Load(
                    force=float(sums[k, 0]),
                    moment=sums[k, 1:],
                    tilts=self._joints.tilts(data, int(bodies[k]), axes[:, 2]),
                )
                for k in pressing
            ),
            standing=tuple(self._stand(data, int(bodies[k]), axes, origin) for k in pressing),
        )

    def _stand(self, data: Any, body: int, axes: FloatArray, origin: FloatArray) -> Standing:  # noqa: ANN401
        """A body's solids in the array's frame."""
        geoms, shape = self._shape(body)
        return Standing(
            shape=shape,
            rotation=axes.T @ data.geom_xmat[geoms].reshape(-1, 3, 3),
            position=(data.geom_xpos[geoms] - origin) @ axes,
        )

    def _shape(self, body: int) -> tuple[IntArray, Shape]:
        """Geoms of a body that can touch the plate, and their solids."""
        if body not in self._shapes:
            model, plate = self._model, self._geom
            types, affinities = model.geom_contype, model.geom_conaffinity
            touches = (types & affinities[plate]) | (affinities & types[plate])
            geoms = ((self._group == body) & (touches != 0) & (np.arange(model.ngeom) != plate)).nonzero()[0]
            solids = tuple(solid(model, int(geom), self._edge) for geom in geoms)
            self._shapes[body] = (geoms, Shape(solids=solids, edge=self._edge))
        return self._shapes[body]


def grid_of(array: TexelArray, per_texel: int, plate: Plate) -> CellGrid:
    """The cells over an array and its plate's margin."""
    return CellGrid.over(array, per_texel, plate.margin)
