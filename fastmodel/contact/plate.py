"""A rigid plate in place of the texels of an array, and a reader that finds the bodies that press on the plate.

MuJoCo's contacts with the plate give the total force of each body exactly and at little cost, but not the distribution
of this force over the texels.  The distribution is computed from the shapes of the bodies, see `fastmodel.pressure`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from fastmodel.compiled import compile_kernel
from fastmodel.contact.bodies import Bodies
from fastmodel.contact.force_kernels import Contacts, Sums, has_pyramids, imitate_contacts, press_plate, read_contacts
from fastmodel.contact.geoms import EVERY, check_box, describe_box, find_geoms
from fastmodel.contact.joints import Joints
from fastmodel.contact.net_force import NetForceReader
from fastmodel.contact.panel_layout import Panel, divide_into_panels
from fastmodel.errors import FastModelError
from fastmodel.pose import Mount, make_quaternions, multiply, rotate
from fastmodel.pressure.cell_grid import CellGrid
from fastmodel.pressure.conjugate_gradient import Load
from fastmodel.pressure.flexes import FlexSurfaces
from fastmodel.pressure.gap import ELLIPSOID, Solid
from fastmodel.pressure.gap_sampling import BodyShape, GapSamples, PosedBody, sample_gap
from meshes import TexelArray
from meshes.array_types import FloatArray, IntArray

#: No point forces.
_NO_POINTS = np.zeros((0, 3))


@dataclass(frozen=True, kw_only=True)
class Plate:
    """Settings of the rigid plate that replaces the texels of an array in MuJoCo.

    Attributes:
        height: Thickness of the plate, inwards from the cover's top [m].
        margin: Number of pitches by which plate and cover extend beyond the outermost texels on each side.  Force on
            the margin counts as `outside`, the force that no texel measures [-].
        contype: Collision mask of the plate, 31 bits.  With all bits, the default, the plate meets every geom that
            collides with anything, other arrays included [-].
        conaffinity: Mask of the geoms that the plate meets, 31 bits [-].
        solref: Time constant and damping ratio of the plate's contacts, see `fit_contact` [s, -].  By default MuJoCo
            combines its default values with those of the touching geom.
        solimp: MuJoCo's five impedance parameters of the plate's contacts, given together with `solref`: impedance at
            zero depth and at full width, width, midpoint, power [-, -, m, -, -].
    """

    height: float = 2e-3
    margin: int = 1
    contype: int = EVERY
    conaffinity: int = EVERY
    solref: tuple[float, float] | None = None
    solimp: tuple[float, float, float, float, float] | None = None

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the height is not positive, the margin negative, a mask not of 31 bits, or only one of solref
                and solimp given.
        """
        check_box(self.height, self.contype, self.conaffinity)
        if self.margin < 0 or self.margin != int(self.margin):
            raise ValueError(f"margin must be a whole number of pitches from 0 on, not {self.margin}")
        if (self.solref is None) != (self.solimp is None):
            raise ValueError("solref and solimp belong together; give both or neither")

    def attach(self, body: mujoco.MjsBody, array: TexelArray, pose: Mount, name: str) -> None:
        """Add the plate to a body of a spec: one box geom for each flat panel of the array.

        Args:
            body: The body of a `mujoco.MjSpec` that carries the array.
            array: The array, in its own frame.
            pose: Mount of the array's frame in the frame of the body.
            name: Name of the sensor, which is the prefix of the names of the geoms.
        """
        # with a higher priority, MuJoCo uses the softness of the plate alone and not that of the touching geom
        soft: dict[str, Any] = (
            {} if self.solref is None else {"solref": self.solref, "solimp": self.solimp, "priority": 1}
        )
        for panel, geom in zip(*self.divide(array, name), strict=True):
            middle = panel.origin - 0.5 * self.height * panel.axes[:, 2]
            body.add_geom(
                name=geom,
                pos=pose.position + rotate(pose.quaternion, middle[None])[0],
                quat=multiply(pose.quaternion, make_quaternions(panel.axes[None])[0]).tolist(),
                **describe_box((*panel.half, self.height / 2), self.contype, self.conaffinity),
                **soft,
            )

    def divide(self, array: TexelArray, name: str) -> tuple[tuple[Panel, ...], list[str]]:
        """Divide an array into flat panels; return them and the names of their geoms, numbered if there are several."""
        panels = divide_into_panels(array, self.margin)
        numbers = [""] if len(panels) == 1 else range(len(panels))
        return panels, [f"{name}/plate{number}" for number in numbers]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlateContact:
    """The bodies that press on the plate, with their loads and poses, and the contacts that are no body's pressure.

    Attributes:
        bodies: Id of each body of known shape that presses on the front of the plate.
        loads: Force and moments of each body.
        poses: Shape of each body and its pose in the array's frame.
        owner: Index in `bodies` of the body of each of m contacts, shape (m,).
        touches: Position x, y on the contact grid [m] and force [N] of these contacts, shape (m, 3).
        points: The same of the k contacts whose bodies have no known shape; they act as point forces, shape (k, 3).
        beside: Force at the sides and on the back of the plate, with its sign [N].
    """

    bodies: tuple[int, ...]
    loads: tuple[Load, ...]
    poses: tuple[PosedBody, ...]
    owner: IntArray
    touches: FloatArray
    points: FloatArray
    beside: float

    def equals(self, other: PlateContact, tolerance: float, length: float) -> bool:
        """Return whether bodies, loads and poses of another contact are equal up to a tolerance.

        Args:
            other: The other contact.
            tolerance: Largest accepted difference of forces over the force, of positions over `length`, and of entries
                of rotations [-].
            length: Length by which differences of positions and of lever arms are divided [m].
        """
        return (
            self.bodies == other.bodies
            and all(a.equals(b, tolerance, length) for a, b in zip(self.poses, other.poses, strict=True))
            and all(a.equals(b, tolerance, length) for a, b in zip(self.loads, other.loads, strict=True))
            and abs(self.beside - other.beside) <= tolerance * abs(self.beside)
            and _are_equal(self.points, other.points, tolerance, length)
        )

    def select(self, kept: Sequence[int]) -> PlateContact:
        """Return the contact with the contacts of the other bodies as point forces.

        Args:
            kept: Indices in `bodies` of the bodies that keep their shapes.
        """
        number = np.full(len(self.bodies), -1)
        number[list(kept)] = np.arange(len(kept))
        owner = number[self.owner]
        return replace(
            self,
            bodies=tuple(self.bodies[k] for k in kept),
            loads=tuple(self.loads[k] for k in kept),
            poses=tuple(self.poses[k] for k in kept),
            owner=owner[owner >= 0],
            touches=self.touches[owner >= 0],
            points=np.concatenate([self.points, self.touches[owner < 0]]),
        )


def _are_equal(one: FloatArray, other: FloatArray, tolerance: float, length: float) -> bool:
    """Return whether positions and forces of points are equal up to a tolerance; see `PlateContact.equals`."""
    if not len(one) or len(one) != len(other):
        return len(one) == len(other)
    apart, size = np.abs(one - other), np.abs(one[:, 2]).sum()
    return bool(apart[:, :2].max() <= tolerance * length and apart[:, 2].max() <= tolerance * size)


def press_ball(radius: float, centre: FloatArray, load: Load) -> PlateContact:
    """Make the contact of a ball.

    Args:
        radius: Radius of the ball [m].
        centre: Centre of the ball in the array's frame, shape (3,) [m].
        load: Load of the ball.
    """
    half = np.full(3, radius)
    ball = Solid(kind=ELLIPSOID, size=half, planes=np.zeros((0, 4)), centre=np.zeros(3), half=half)
    pose = PosedBody(shape=BodyShape(solids=(ball,)), rotation=np.eye(3)[None], position=centre[None])
    return PlateContact(
        bodies=(0,),
        loads=(load,),
        poses=(pose,),
        owner=np.zeros(0, dtype=np.int64),
        touches=_NO_POINTS,
        points=_NO_POINTS,
        beside=0.0,
    )


class PlateReader:
    """Reader that finds the bodies that press on the plate, and samples the gap under these bodies.

    Attributes:
        net_force: Reader of net force and torque, and of the shear on the plate.
    """

    def __init__(
        self, plate: Plate, model: mujoco.MjModel, array: TexelArray, name: str, *, grid: CellGrid, edge: float
    ) -> None:
        """Find the plate in the compiled model.

        Args:
            plate: Settings of the plate.
            model: The compiled model.
            array: The array that was attached.
            name: Name of the sensor, as given to `Plate.attach`.
            grid: The contact grid of the array.
            edge: Distance by which solids with sharp edges are enlarged [m].

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        panels, names = plate.divide(array, name)
        self._geoms = find_geoms(model, names, name)
        self._geom = int(self._geoms[0])
        self._model, self._name, self._grid, self._height = model, names[0], grid, plate.height
        self._turn = panels[0].axes.T
        self._middle = panels[0].origin - 0.5 * plate.height * panels[0].axes[:, 2]
        self._bodies = Bodies(model, self._geoms, name, edge)
        self._joints = Joints(model, int(model.geom_bodyid[self._geom]))
        self._flexes = FlexSurfaces(model, 0.5 * min(array.pitch))
        self._press_plate, self._transform_poses = compile_kernel(press_plate), compile_kernel(transform_poses)
        self.net_force = NetForceReader(model, array, self._geoms, axes=panels[0].axes, middle=self._middle)

    def reset(self) -> None:
        """Follow changes of meshes since the last reset; other changes are followed at every contact."""
        self._bodies.follow_meshes()

    def find_contact(self, data: mujoco.MjData) -> tuple[PlateContact, Sums] | None:
        """Find the bodies that press on the plate in a simulation state, and sum all contact forces on it.

        Returns:
            The bodies, and what `sum_contacts` returns; None if nothing touches the plate.

        Raises:
            LifeCycleError: If the size of the plate has changed.
            FastModelError: If a contact force is not finite.
        """
        if not data.nefc:
            return None
        self._bodies.follow_changes()
        contact, sums = self._find_loads(data, read_contacts(data, pyramidal=has_pyramids(self._model)))
        if not np.count_nonzero(sums[2]):
            return None
        force = contact.beside + sum([load.force for load in contact.loads]) + contact.points[:, 2].sum()
        if not math.isfinite(force):
            raise FastModelError(f"contact forces on geom {self._name!r} are not finite at t = {data.time:g} s")
        return contact, sums

    def sample_gap(self, contact: PlateContact, reach: Sequence[float]) -> GapSamples:
        """Sample the gap under every body.

        Args:
            contact: The bodies.
            reach: For each body, gap above the body's smallest gap up to which cells are kept [m].
        """
        return sample_gap(self._grid, contact.poses, reach)

    def compile_kernels(self, data: mujoco.MjData) -> None:
        """Compile the kernels by calling each of them on a state without contacts."""
        for contacts in imitate_contacts(data, pyramidal=has_pyramids(self._model)):
            self._press_plate(contacts, data.geom_xmat, data.geom_xpos, self.net_force.parts, self._bodies.of_geom)
        self._transform_poses(self._geoms, data.geom_xmat, data.geom_xpos, np.zeros((4, 3)))
        self.net_force.compile_kernels(data)
        self._flexes.compile_kernels(data.flexvert_xpos.copy())
        self._bodies.find_shapes()

    def imitate_ball(self, radius: float) -> PlateContact:
        """Make the contact of a ball with the middle of the array under a load of 1 N; see `compile_kernels`.

        Args:
            radius: Radius of the ball [m].
        """
        size, low, edge = self._grid.arrays
        return press_ball(
            radius, np.array([*(low + 0.5 * size * edge), radius]), Load(force=1.0, moment=np.zeros(2), tilts=False)
        )

    def _find_loads(self, data: mujoco.MjData, contacts: Contacts) -> tuple[PlateContact, Sums]:
        """Find the bodies that press, their loads and poses; a force that is not finite makes the loads so."""
        bodies, sums, owner, touches, place, totals = self._press_plate(
            contacts, data.geom_xmat, data.geom_xpos, self.net_force.parts, self._bodies.of_geom
        )
        pressed, _, _, beside = totals
        if self._model.nflex and (owner < 0).any():
            size, low, edge = self._grid.arrays
            bounds = np.array([[*low, -self._height], [*(low + size * edge), 0.0]])
            owner, touches = self._flexes.replace_points(
                data, pressed.sum(axis=1), owner, touches, place=place, bounds=bounds
            )
        found, poses, loads, pulls, scattered = [], [], [], [], len(owner)
        for k, (body, (force, x, y, depth, count)) in enumerate(zip(bodies.tolist(), sums.tolist(), strict=True)):
            scattered -= int(count)
            if force <= 0:  # false for nan, which `find_contact` reports
                pulls.append(k)
                continue
            tilts = self._joints.let_tilt(data, body, place[:3, 2])
            loads.append(Load(force=force + 0 * (x + y), moment=np.array([x, y]), tilts=tilts))
            found.append(body)
            poses.append(self._find_pose(data, body, place, depth))
        points = _NO_POINTS
        if scattered or pulls:
            owner, touches, points, pulled = _sort_touches(owner, touches, pulls)
            beside += pulled
        contact = PlateContact(
            bodies=tuple(found),
            loads=tuple(loads),
            poses=tuple(poses),
            owner=owner,
            touches=touches,
            points=points,
            beside=beside,
        )
        return contact, totals

    def _find_pose(self, data: mujoco.MjData, body: int, place: FloatArray, depth: float) -> PosedBody:
        """Compute the poses of a body's solids in the array's frame, for its deepest penetration into the plate [m]."""
        geoms, shape = self._bodies.find_shape(body)
        rotation, position = self._transform_poses(geoms, data.geom_xmat, data.geom_xpos, place)
        return PosedBody(shape=shape, rotation=rotation, position=position, back=-self._height - depth)


def _sort_touches(
    owner: IntArray, touches: FloatArray, pulls: Sequence[int]
) -> tuple[IntArray, FloatArray, FloatArray, float]:
    """Sort m contacts into those of bodies of known shape, point forces and pulls.

    Friction can pull at the front of an array where the contact's normal is inclined.  No texel measures a pull.

    Args:
        owner: Index of the body of each contact, -1 for a body of unknown shape, shape (m,).
        touches: Position x, y [m] and force [N] of each contact, shape (m, 3).
        pulls: Indices of the bodies that pull.

    Returns:
        Index of the body, counted without bodies that pull, and the row of `touches` of every contact of a body that
        presses; rows of `touches` of the point forces; and the sum of the pulls [N].
    """
    gone = np.isin(owner, pulls)
    scattered = owner < 0
    lost = gone | (scattered & (touches[:, 2] <= 0))
    kept = ~gone & ~scattered
    _, number = np.unique(owner[kept], return_inverse=True)
    return number, touches[kept], touches[scattered & ~lost], float(touches[lost, 2].sum())


def transform_poses(
    geoms: IntArray, xmat: FloatArray, xpos: FloatArray, place: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Kernel: transform the poses of p geoms from the world to the array's frame.

    Args:
        geoms: Ids of the p geoms, shape (p,).
        xmat: Axes of all geoms in the world, shape (geoms, 9) [-].
        xpos: Origins of all geoms in the world, shape (geoms, 3) [m].
        place: Axes of the array in the world, as columns, and its origin, shape (4, 3) [-, m].

    Returns:
        Axes of the p geoms in the array's frame, as columns, shape (p, 3, 3) [-], and their origins, shape (p, 3) [m].
    """
    rotation, position = np.zeros((len(geoms), 3, 3)), np.zeros((len(geoms), 3))
    for p in range(len(geoms)):
        g = geoms[p]
        for i in range(3):
            for j in range(3):
                position[p, i] += place[j, i] * (xpos[g, j] - place[3, j])
                for k in range(3):
                    rotation[p, i, k] += place[j, i] * xmat[g, 3 * j + k]
    return rotation, position
