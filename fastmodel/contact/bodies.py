"""The geoms of arrays and indenters in MuJoCo, and the bodies that can touch an array: their shapes and joints.

Geoms without a joint between them move together and count as one body.  Bodies that a `<weld>` constraint joins stay
separate, because the constraint is soft and MuJoCo computes a separate force for each of them.  A height field, a
signed distance field or a flex has no convex shape.  It is represented by its contact points or, for a flex, by the
depth of its surface, see `fastmodel.pressure.flexes`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Self

import mujoco
import numpy as np

from fastmodel.errors import LifeCycleError
from fastmodel.pressure.gap import BodyShape, describe_solid, find_vertices
from meshes import Indenter
from meshes.array_types import FloatArray, IntArray


class Bodies:
    """The bodies of a model that can touch an array, with their shapes.

    Attributes:
        of_geom: Id of the body that each geom moves with, shape (geoms + 1,); -1 for a geom whose shape is not a convex
            solid.  The last entry, which MuJoCo's geom id -1 selects, is for flexes.
    """

    def __init__(self, model: mujoco.MjModel, own: IntArray, name: str, edge: float = 0.0) -> None:
        """Find which geoms of a model move together as one body.

        Args:
            model: The compiled model.
            own: Ids of the geoms of the array.
            name: Name of the sensor, for error messages.
            edge: Distance by which solids with sharp edges are enlarged [m].
        """
        self._model, self._own, self._name, self._edge = model, own, name, edge
        self._size = model.geom_size[own].copy()
        self.of_geom = np.empty(0, dtype=np.int64)
        self._sizes = self._state = b""
        self._shapes: dict[int, tuple[IntArray, BodyShape]] = {}
        self._vertices: dict[int, FloatArray] = {}
        self.follow_changes()

    def check_size(self) -> None:
        """Check that the array's own geoms have the size with which they were attached.

        Raises:
            LifeCycleError: If their size has changed.
        """
        sizes = self._model.geom_size.tobytes()
        if sizes == self._sizes:
            return
        if not np.array_equal(self._model.geom_size[self._own], self._size):
            raise LifeCycleError(
                f"the geoms of sensor {self._name!r} have another size than when they were attached; the array's size "
                f"belongs to its parameters: attach it anew"
            )
        self._sizes = sizes

    def follow_changes(self) -> None:
        """Discard the stored shapes of bodies if the model's geoms or collision rules have changed.

        Raises:
            LifeCycleError: If the size of the array's own geoms has changed.
        """
        self.check_size()
        model = self._model
        shapes = (model.geom_type, model.geom_dataid)
        rules = (model.geom_contype, model.geom_conaffinity, model.exclude_signature)
        pairs = (model.pair_geom1, model.pair_geom2)
        state = b"".join([self._sizes, *(each.tobytes() for each in (*shapes, *rules, *pairs))])
        if state == self._state:
            return
        self._state = state
        self._shapes.clear()
        solid = ~np.isin(model.geom_type, [int(mujoco.mjtGeom.mjGEOM_HFIELD), int(mujoco.mjtGeom.mjGEOM_SDF)])
        weld = model.body_weldid[model.geom_bodyid]
        self.of_geom = np.append(np.where(solid, weld, -1), -1).astype(np.int64)

    def follow_meshes(self) -> None:
        """Discard the stored shapes of bodies if the vertices of a mesh have changed since the shapes were computed."""
        for geom, vertices in self._vertices.items():
            if not np.array_equal(find_vertices(self._model, geom), vertices):
                self._shapes.clear()

    def find_shapes(self) -> None:
        """Describe the shapes of all bodies that can touch the array, before their first contact."""
        for body in np.unique(self.of_geom[:-1][find_obstacles(self._model, self._own) == ""]).tolist():
            if body >= 0:
                self.find_shape(body)

    def find_shape(self, body: int) -> tuple[IntArray, BodyShape]:
        """Find the ids of the geoms of a body that can collide with the array, and the shape that they form."""
        if body not in self._shapes:
            touches = find_obstacles(self._model, self._own) == ""
            geoms = (touches & (self.of_geom[:-1] == body)).nonzero()[0]
            for geom in geoms[self._model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_MESH].tolist():
                self._vertices[geom] = find_vertices(self._model, geom)
            solids = tuple(describe_solid(self._model, int(geom), self._edge) for geom in geoms)
            self._shapes[body] = geoms, BodyShape.of(solids, self._edge)
        return self._shapes[body]


#: Colour of plates and of boxes of active texels: red, green, blue, opacity [-].
COLOUR = (0.25, 0.27, 0.3, 1.0)
#: MuJoCo's geom type for each kind of primitive of an indenter.
_GEOMS = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}
#: Array of texts, one for each geom of a model: reason why the geom never touches an array, "" if it can touch it.
Reasons = np.ndarray[Any, np.dtype[np.object_]]
#: Collision mask with all 31 usable bits set [-]; MuJoCo's masks are signed 32-bit numbers.
EVERY = 0x7FFFFFFF


def check_box(height: float, contype: int, conaffinity: int) -> None:
    """Check the height and the collision masks of a box geom.

    Args:
        height: Height of the box [m].
        contype: Collision mask of the box [-].
        conaffinity: Mask of the geoms that the box meets [-].

    Raises:
        ValueError: If the height is not positive or a mask is not 0..2^31 - 1.
    """
    if not 0 < height < np.inf:
        raise ValueError(f"height must be positive, not {height} m")
    for name, mask in (("contype", contype), ("conaffinity", conaffinity)):
        if not 0 <= mask <= EVERY or mask != int(mask):
            raise ValueError(f"{name} must be a whole number in 0..{EVERY} (31 bits), not {mask}")


def describe_box(half: Sequence[float], contype: int, conaffinity: int) -> dict[str, Any]:
    """Return MuJoCo's attributes of a massless box geom, by name.

    MuJoCo lets two geoms collide if the contype of one and the conaffinity of the other have a common bit.

    Args:
        half: Half edge lengths of the box, shape (3,) [m].
        contype: Collision mask of the box [-].
        conaffinity: Mask of the geoms that the box meets [-].
    """
    box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": half, "mass": 0.0, "rgba": COLOUR}
    return {**box, "contype": contype, "conaffinity": conaffinity}


class NameInModel(str):  # noqa: SLOT000 -- pickle restores the suffix through __dict__
    """Name of a sensor in a compiled model, together with the suffix of the names of its geoms.

    Attributes:
        suffix: Suffix that `mujoco.MjSpec.attach` appended to the names of the geoms.
    """

    suffix: str

    def __new__(cls, name: str, suffix: str = "") -> Self:
        """Make the name of a sensor from name and suffix.

        Args:
            name: Name of the sensor, with which the names of its geoms start.
            suffix: Suffix that `mujoco.MjSpec.attach` appended to the names of the geoms.
        """
        made = super().__new__(cls, name)
        made.suffix = suffix
        return made


def find_geoms(model: mujoco.MjModel, names: Sequence[str], sensor: str) -> IntArray:
    """Find the ids of n geoms in the compiled model, shape (n,).

    Args:
        model: The compiled model.
        names: Names of the n geoms, without a suffix.
        sensor: Name of the sensor, for its suffix and the error message.

    Raises:
        LifeCycleError: If one of the geoms is not in the model.
    """
    if isinstance(sensor, NameInModel):
        names = [name + sensor.suffix for name in names]
    ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) for name in names]
    if min(ids) < 0:
        raise LifeCycleError(
            f"geom {names[ids.index(-1)]!r} is not in this model; bind a model compiled from the spec "
            f"that sensor {sensor!r} was attached to"
        )
    return np.array(ids)


def number_geoms(model: mujoco.MjModel, geoms: IntArray) -> IntArray:
    """Return the index among some geoms of each geom of a model, -1 for all other geoms, shape (geoms + 1,).

    The last entry is for geom id -1, which MuJoCo writes for contacts of flexes, so that it belongs to no geom.

    Args:
        model: The compiled model.
        geoms: Ids of the geoms to number.
    """
    number = np.full(model.ngeom + 1, -1)
    number[geoms] = np.arange(len(geoms))
    return number


def find_obstacles(model: mujoco.MjModel, geoms: IntArray) -> Reasons:
    """State for each geom of a model why it can never touch an array, with a remedy; "" for geoms that can touch it.

    Source: MuJoCo documentation, Computation, section "Collision detection", selection of pairs.

    Args:
        model: The compiled model.
        geoms: Ids of the geoms of the array.

    Returns:
        Texts, shape (geoms of the model,).
    """
    first, body = geoms[0], model.geom_bodyid
    found = np.full(model.ngeom, "", dtype=object)
    types, affinities = model.geom_contype, model.geom_conaffinity
    common = (types & affinities[first]) | (affinities & types[first])
    found[common == 0] = (
        "no bit of contype and conaffinity is common; set one, or add a <pair> with each geom of the array"
    )
    pairs = np.sort(np.column_stack([body, np.full(model.ngeom, body[first])]), axis=1)
    # MuJoCo's signature of an excluded pair: the id of the first body, shifted by 16 bits, plus that of the second
    excluded = np.isin((pairs[:, 0] << 16) + pairs[:, 1], model.exclude_signature)
    found[excluded] = "an <exclude> names both bodies; remove it"
    weld = model.body_weldid[body]
    parent = model.body_weldid[model.body_parentid[weld]]
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        moving = (weld != 0) & (weld[first] != 0)
        found[moving & ((parent == weld[first]) | (parent[first] == weld))] = (
            "MuJoCo lets no parent and child collide; add a <pair> with each geom of the array, or "
            '<flag filterparent="disable"/>'
        )
    found[weld == weld[first]] = "no joint lies between; give the object or the array a joint"
    for one, other in ((model.pair_geom1, model.pair_geom2), (model.pair_geom2, model.pair_geom1)):
        found[one[np.isin(other, geoms)]] = ""
    return found


def add_geoms(spec: mujoco.MjSpec, body: mujoco.MjsBody, indenter: Indenter, *, name: str = "indenter") -> None:
    """Add the solids of an indenter to a body, as geoms without mass.

    Args:
        spec: The spec to edit.  Shapes that are no MuJoCo primitive become meshes of the spec.
        body: A body of the spec.
        indenter: The shape.
        name: Prefix of the meshes' names.
    """
    for number, primitive in enumerate(indenter.primitives()):
        mesh = ""
        if primitive.vertices:
            mesh = f"{name}/part{number}"
            spec.add_mesh(name=mesh, uservert=np.ravel(primitive.vertices).tolist())
        body.add_geom(
            type=_GEOMS[primitive.kind],
            size=[*primitive.size, 0.0, 0.0, 0.0][:3],
            pos=primitive.position,
            quat=primitive.quaternion,
            meshname=mesh,
            mass=0.0,
        )


class Joints:
    """The joints of a model between the body that carries the array and any other body."""

    def __init__(self, model: mujoco.MjModel, body: int) -> None:
        """Find the ancestors of the body that carries the array.

        Args:
            model: The compiled model.
            body: Id of the body that carries the array.
        """
        self._model = model
        self._own = self._find_ancestors(body)
        self._turning: dict[int, tuple[bool, IntArray]] = {}
        self._slides: dict[int, IntArray] = {}

    def let_tilt(self, data: mujoco.MjData, body: int, normal: FloatArray) -> bool:
        """Return whether any joint between a body and the array lets the body tilt relative to the array.

        Args:
            data: State of the simulation.
            body: Id of the body.
            normal: The array's normal in the world, shape (3,) [-].
        """
        if body not in self._turning:
            joints = self._find_between(body)
            kinds = self._model.jnt_type[joints]
            hinges = joints[kinds == mujoco.mjtJoint.mjJNT_HINGE]
            free = bool(np.isin(kinds, [int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)]).any())
            self._turning[body] = free, hinges
        always, hinges = self._turning[body]
        # Rotation about a hinge parallel to the normal, except for rounding, does not tilt a body.
        return always or bool((np.abs(data.xaxis[hinges] @ normal) < 1 - 1e-6).any())

    def find_slides(self, data: mujoco.MjData, body: int) -> FloatArray:
        """Find the axes, in the world, of the k slide joints between a body and the array, shape (k, 3) [-]."""
        if body not in self._slides:
            joints = self._find_between(body)
            self._slides[body] = joints[self._model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE]
        return np.asarray(data.xaxis[self._slides[body]])

    def _find_between(self, body: int) -> IntArray:
        """Find the ids of the k joints in the kinematic tree between a body and the array, shape (k,)."""
        path = self._own ^ self._find_ancestors(body)
        return np.isin(self._model.jnt_bodyid, list(path)).nonzero()[0]

    def _find_ancestors(self, body: int) -> set[int]:
        """Return the ids of a body and of all its ancestors in the kinematic tree except the world."""
        chain = set()
        while body:
            chain.add(body)
            body = int(self._model.body_parentid[body])
        return chain


def sample_boxes(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: IntArray, *, inset: float, spacing: float
) -> tuple[FloatArray, FloatArray]:
    """Place points on the outer faces of an array's boxes, at most 40 along each side of a box.

    If there would be more than 2000 points on several boxes, each box has one point.

    Args:
        model: The compiled model.
        data: A state with the poses of geoms.
        geoms: Ids of the array's geoms, which are boxes.
        inset: Distance from the sides of each box within which no points are placed [m].
        spacing: Distance between neighbouring points [m].

    Returns:
        The points in the world, shape (n, 3) [m], and the outward normals of their boxes, shape (n, 3) [-].
    """
    points, normals = [], []
    for geom in geoms.tolist():
        half = np.maximum(model.geom_size[geom, :2] - inset, 0.0)
        counts = [min(max(1, math.ceil(2 * side / spacing - 1e-9)), 40) for side in half]
        if len(geoms) * counts[0] * counts[1] > 2000:  # noqa: PLR2004
            counts = [1, 1] if len(geoms) > 1 else counts
        x, y = (side * ((2 * np.arange(count) + 1) / count - 1) for side, count in zip(half, counts, strict=True))
        local = np.stack(np.meshgrid(x, y, model.geom_size[geom, 2]), axis=-1).reshape(-1, 3)
        axes = data.geom_xmat[geom].reshape(3, 3)
        points.append(data.geom_xpos[geom] + local @ axes.T)
        normals.append(np.tile(axes[:, 2], (len(local), 1)))
    return np.concatenate(points), np.concatenate(normals)
