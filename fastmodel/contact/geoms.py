"""Geoms of texels, plates and indenters in MuJoCo, and what can touch an array."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import mujoco
import numpy as np

from fastmodel.errors import LifeCycleError
from meshes import Indenter
from meshes.array_types import IntArray

#: Colour of plates and of boxes of active texels: red, green, blue, opacity [-].
_COLOUR = (0.25, 0.27, 0.3, 1.0)
#: Number of bits by which MuJoCo shifts the id of the first body in the signature of an excluded pair of bodies [-].
_SIGNATURE_BITS = 16
#: MuJoCo's geom type for each kind of primitive of an indenter.
_GEOMS = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}
#: For every geom of a model, why it never touches an array; "" for geoms that can.
Reasons = np.ndarray[Any, np.dtype[np.object_]]
#: Collision mask with every bit [-]; MuJoCo's masks are signed 32-bit numbers.
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
    box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": half, "mass": 0.0, "rgba": _COLOUR}
    return {**box, "contype": contype, "conaffinity": conaffinity}


class NameInModel(str):  # noqa: SLOT000 -- pickle restores the suffix through __dict__
    """Name of a sensor in a compiled model, whose geoms have names with a suffix.

    Attributes:
        suffix: What `mujoco.MjSpec.attach` appended to the names of the geoms.
    """

    suffix: str

    def __new__(cls, name: str, suffix: str = "") -> Self:
        """Make the name of a sensor, which names of geoms start with, and store the suffix."""
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


def find_obstacles(model: mujoco.MjModel, geoms: IntArray) -> Reasons:
    """Find why each geom of a model can never touch an array, and what to do about it; "" for geoms that can.

    Source: MuJoCo documentation, Computation, section "Collision detection", selection of pairs.

    Args:
        model: The compiled model.
        geoms: Ids of the geoms of the array.

    Returns:
        Sentences, shape (geoms of the model,).
    """
    first, body = geoms[0], model.geom_bodyid
    found = np.full(model.ngeom, "", dtype=object)
    types, affinities = model.geom_contype, model.geom_conaffinity
    common = (types & affinities[first]) | (affinities & types[first])
    found[common == 0] = (
        "no bit of contype and conaffinity is common; set one, or add a <pair> with each geom of the array"
    )
    pairs = np.sort(np.column_stack([body, np.full(model.ngeom, body[first])]), axis=1)
    excluded = np.isin((pairs[:, 0] << _SIGNATURE_BITS) + pairs[:, 1], model.exclude_signature)
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
