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

from fastmodel.box_forces import decode
from fastmodel.errors import FastModelError, LifeCycleError
from fastmodel.joints import Joints
from fastmodel.lower_surface import Solid, solid
from fastmodel.pose import Pose, rotate
from fastmodel.sampling import CellGrid, Load, Placed
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
    """Bodies that press on the plate: their ids, loads and solids."""

    bodies: tuple[int, ...]
    loads: tuple[Load, ...]
    parts: tuple[tuple[Placed, ...], ...]

    def only(self, kept: Sequence[int]) -> Touching:
        """Some of the bodies."""
        return Touching(
            bodies=tuple(self.bodies[k] for k in kept),
            loads=tuple(self.loads[k] for k in kept),
            parts=tuple(self.parts[k] for k in kept),
        )


class PlateReader:
    """Finds in one step's data what presses on the plate."""

    def __init__(self, plate: Plate, model: Any, array: TexelArray, name: str, edge: float) -> None:  # noqa: ANN401
        """Find the plate in the compiled model.

        Args:
            plate: Its settings.
            model: The compiled model.
            array: The array that was attached.
            name: The sensor's name.
            edge: Distance by which sharp edges stand out [m].

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        self._geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, plate_name(name))
        if self._geom < 0:
            raise LifeCycleError(
                f"geom {plate_name(name)!r} is not in this model; bind a model compiled from the spec that sensor "
                f"{name!r} was attached to"
            )
        self._model, self._edge = model, edge
        self._middle = array.centres.mean(axis=0) - [0, 0, plate.height / 2]
        self._pyramidal = bool(model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL)
        self._group = model.body_weldid[model.geom_bodyid]
        self._parts: dict[int, list[tuple[int, Solid]]] = {}
        self._joints = Joints(model, int(model.geom_bodyid[self._geom]))

    def touching(self, data: Any) -> Touching | None:  # noqa: ANN401 -- MjData
        """What presses on the plate now; None where nothing does."""
        geom = data.contact.geom if data.nefc else np.zeros((0, 2), dtype=np.int32)
        second = (geom[:, 1] == self._geom).nonzero()[0]
        first = (geom[:, 0] == self._geom).nonzero()[0]
        if not len(first) + len(second):
            return None
        rotation = data.geom_xmat[self._geom].reshape(3, 3)
        origin = data.geom_xpos[self._geom] - rotation @ self._middle
        pressed, place, body = self._contacts(data, first, second, rotation[:, 2])
        x, y = (place - origin) @ rotation[:, 0], (place - origin) @ rotation[:, 1]
        bodies, loads, parts = [], [], []
        for each in np.unique(body):
            mine = body == each
            force = float(pressed[mine].sum())
            if force <= 0:
                continue
            moment = np.array([pressed[mine] @ x[mine], pressed[mine] @ y[mine]])
            bodies.append(int(each))
            loads.append(Load(force=force, moment=moment, tilts=self._joints.tilts(data, int(each), rotation[:, 2])))
            parts.append(self._place(data, int(each), rotation, origin))
        return Touching(bodies=tuple(bodies), loads=tuple(loads), parts=tuple(parts)) if bodies else None

    def _contacts(
        self,
        data: Any,  # noqa: ANN401 -- MjData
        first: IntArray,
        second: IntArray,
        normal: FloatArray,
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """Force against the normal [N], position [m] and body of each contact with the plate."""
        contact = data.contact
        both = np.concatenate([first, second])
        sign = np.repeat([1.0, -1.0], [len(first), len(second)])
        other = contact.geom[both, np.repeat([1, 0], [len(first), len(second)])]
        address = contact.efc_address[both]
        stands = address >= 0
        both, sign, other, address = both[stands], sign[stands], other[stands], address[stands]
        dims, pressed = contact.dim[both], np.zeros(len(both))
        for dim in set(dims.tolist()):
            mine = (dims == dim).nonzero()[0]
            friction = contact.friction[both[mine]]
            local = decode(data.efc_force, address[mine], friction, dim, pyramidal=self._pyramidal)
            axes = contact.frame[both[mine]].reshape(-1, 3, 3)[:, : local.shape[1]]
            pressed[mine] = sign[mine] * np.einsum("ki,kij,j->k", local, axes, normal)
        return pressed, contact.pos[both], self._group[other]

    def _place(self, data: Any, body: int, rotation: FloatArray, origin: FloatArray) -> tuple[Placed, ...]:  # noqa: ANN401
        """The solids of a body in the array's frame."""
        return tuple(
            Placed(
                solid=shape,
                rotation=rotation.T @ data.geom_xmat[geom].reshape(3, 3),
                position=rotation.T @ (data.geom_xpos[geom] - origin),
            )
            for geom, shape in self._solids(body)
        )

    def _solids(self, body: int) -> list[tuple[int, Solid]]:
        """Geoms of a body that can touch the plate."""
        if body not in self._parts:
            model, plate = self._model, self._geom
            mine = (self._group == body).nonzero()[0]
            touches = [
                geom
                for geom in mine.tolist()
                if geom != plate
                and (
                    model.geom_contype[geom] & model.geom_conaffinity[plate]
                    or model.geom_contype[plate] & model.geom_conaffinity[geom]
                )
            ]
            self._parts[body] = [(geom, solid(model, geom, self._edge)) for geom in touches]
        return self._parts[body]


def grid_of(array: TexelArray, per_texel: int, plate: Plate) -> CellGrid:
    """The cells over an array and its plate's margin."""
    return CellGrid.over(array, per_texel, plate.margin)
