"""One rigid plate for the dynamics: what each touching body presses it with, and what that body looks like from below.

The plate carries forces exactly and costs little, but says nothing about where on a face the force lands.  That comes
from the shapes themselves, sampled over the cells of the array.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from fastmodel.compiled import choose_kernel
from fastmodel.contact.joints import Joints
from fastmodel.contact.panel_layout import Panel, panels
from fastmodel.contact.plate_forces import plate_loops, plate_numpy, poses_loops, poses_numpy
from fastmodel.errors import LifeCycleError, StateError
from fastmodel.pose import Pose, multiply, quaternions, rotate
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.gap import solid
from fastmodel.pressure.gap_sampling import Load, Samples, Shape, Standing, sample
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
        solref: Time constant and damping ratio of its contacts, see `fit_contact`; MuJoCo's, shared with what touches,
            when not given [s, -].
        solimp: Impedance of its contacts, as MuJoCo takes it, given with `solref` [-, -, m, -, -].
    """

    height: float = 2e-3
    margin: int = 1
    contact_bit: int = 30
    solref: tuple[float, float] | None = None
    solimp: tuple[float, float, float, float, float] | None = None

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the height is not positive, the margin negative, the bit not 0..30, or only one of solref
                and solimp given.
        """
        if not 0 < self.height < np.inf:
            raise ValueError(f"height must be positive, not {self.height} m")
        if self.margin < 0 or self.margin != int(self.margin):
            raise ValueError(f"margin must be a whole number of pitches from 0 on, not {self.margin}")
        if not 0 <= self.contact_bit <= 30:  # noqa: PLR2004 -- MuJoCo's collision masks are signed 32-bit
            raise ValueError(f"contact_bit must lie in 0..30, not {self.contact_bit}")
        if (self.solref is None) != (self.solimp is None):
            raise ValueError("solref and solimp belong together; give both or neither")

    def attach(self, body: Any, array: TexelArray, pose: Pose, name: str) -> None:  # noqa: ANN401 -- mjsBody
        """Add the plate to a body of a spec: one for every flat panel of the array."""
        bit = 1 << self.contact_bit
        # with priority, what touches has no say in the contact's softness
        soft = {} if self.solref is None else {"solref": self.solref, "solimp": self.solimp, "priority": 1}
        for part, geom in zip(*self.panels(array, name), strict=True):
            middle = part.origin - 0.5 * self.height * part.axes[:, 2]
            body.add_geom(
                name=geom,
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[*part.half, self.height / 2],
                pos=pose.position + rotate(pose.quaternion, middle[None])[0],
                quat=multiply(pose.quaternion, quaternions(part.axes[None])[0]),
                mass=0.0,
                contype=bit,
                conaffinity=0x7FFFFFFF & ~bit,
                rgba=[0.25, 0.27, 0.3, 1.0],
                **soft,
            )

    def panels(self, array: TexelArray, name: str) -> tuple[tuple[Panel, ...], list[str]]:
        """The array's flat panels, and the names of their geoms."""
        parts = panels(array, self.margin)
        one = len(parts) == 1
        return parts, [plate_name(name) if one else f"{plate_name(name)}{k}" for k in range(len(parts))]


def plate_name(name: str) -> str:
    """Name of a sensor's plate; the plates of a curved array are numbered."""
    return f"{name}/plate"


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
        grid: CellGrid,
        edge: float,
        native: bool | None = None,
    ) -> None:
        """Find the plate in the compiled model.

        Args:
            plate: Its settings.
            model: The compiled model.
            array: The array that was attached.
            name: The sensor's name.
            grid: The cells.
            edge: Distance by which sharp edges stand out [m].
            native: True for the numba kernel, False for numpy, None for whichever is there.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        parts, names = plate.panels(array, name)
        self._geoms = np.array([mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, geom) for geom in names])
        if self._geoms.min() < 0:
            raise LifeCycleError(
                f"geom {names[int(self._geoms.argmin())]!r} is not in this model; bind a model compiled from the spec "
                f"that sensor {name!r} was attached to"
            )
        self._geom = int(self._geoms[0])
        self._model, self._edge, self._name, self._grid, self._native = model, edge, names[0], grid, native
        self._turn = parts[0].axes.T
        self._middle = parts[0].origin - 0.5 * plate.height * parts[0].axes[:, 2]
        self._pyramidal = bool(model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL)
        self._group = model.body_weldid[model.geom_bodyid].astype(np.int64)
        self._shapes: dict[int, tuple[IntArray, Shape]] = {}
        self._joints = Joints(model, int(model.geom_bodyid[self._geom]))
        self._press = choose_kernel(plate_loops, plate_numpy, native=native)
        self._poses = choose_kernel(poses_loops, poses_numpy, native=native)

    def touching(self, data: Any) -> Touching | None:  # noqa: ANN401 -- MjData
        """What presses on the plate now; None where nothing does."""
        if not data.nefc:
            return None
        # dot: between products this small, @ costs twice as much
        axes = data.geom_xmat[self._geom].reshape(3, 3).dot(self._turn)
        origin = data.geom_xpos[self._geom] - axes.dot(self._middle)
        pressing = self._loads(data, axes, origin)
        if not pressing:
            return None
        for _, load in pressing:
            if not math.isfinite(load.force):
                raise StateError(f"contact forces on geom {self._name!r} are not finite at t = {data.time:g} s")
        bodies, loads = zip(*pressing, strict=True)
        standing = tuple([self._stand(data, body, axes, origin) for body in bodies])
        return Touching(bodies=bodies, loads=loads, standing=standing)

    def look(self, touching: Touching, reach: Sequence[float]) -> Samples:
        """Look at every body from below.

        Args:
            touching: The bodies.
            reach: Height over each body's lowest point up to which it is looked at [m].
        """
        return sample(self._grid, touching.standing, reach, native=self._native)

    def _loads(self, data: Any, axes: FloatArray, origin: FloatArray) -> list[tuple[int, Load]]:  # noqa: ANN401
        """Bodies that press, and their loads; not finite where the state is not."""
        contact = data.contact
        geom = contact.geom
        bodies, sums = np.empty(len(geom), np.int64), np.empty((len(geom), 3))
        count = self._press(
            geom,
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
        pressing = []
        for body, (force, x, y) in zip(bodies[:count].tolist(), sums[:count].tolist(), strict=True):
            if not force <= 0:  # what is no number is told by who asked, moments included
                tilts = self._joints.tilts(data, body, axes[:, 2])
                pressing.append((body, Load(force=force + 0 * (x + y), moment=np.array([x, y]), tilts=tilts)))
        return pressing

    def _stand(self, data: Any, body: int, axes: FloatArray, origin: FloatArray) -> Standing:  # noqa: ANN401
        """A body's solids in the array's frame."""
        geoms, shape = self._shape(body)
        rotation, position = self._poses(geoms, data.geom_xmat, data.geom_xpos, axes, origin)
        return Standing(shape=shape, rotation=rotation, position=position)

    def _shape(self, body: int) -> tuple[IntArray, Shape]:
        """Geoms of a body that can touch the plate, and their solids."""
        if body not in self._shapes:
            model, plate = self._model, self._geom
            types, affinities = model.geom_contype, model.geom_conaffinity
            touches = (types & affinities[plate]) | (affinities & types[plate])
            geoms = ((self._group == body) & (touches != 0) & ~np.isin(np.arange(model.ngeom), self._geoms)).nonzero()[
                0
            ]
            solids = tuple(solid(model, int(geom), self._edge) for geom in geoms)
            self._shapes[body] = (geoms, Shape(solids=solids, edge=self._edge))
        return self._shapes[body]
