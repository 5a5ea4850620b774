"""Place and direction of a rigid indenter on a curved cover."""

from __future__ import annotations

import numpy as np

from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.responses import find_above, find_top, find_uncovered
from meshes import TexelArray
from meshes.array_types import BoolArray, FloatArray
from meshes.pose import Pose
from meshes.solids import SolidMesh
from meshes.solids.solid_mesh import measure_thickness
from validation.errors import InputError

#: Largest distance of a wanted place from the top, over the thickness of the cover [-].
_OFF_TOP = 1.0
#: Length of a direction below which it is none [-].
_TINY = 1e-9


def find_touch_place(
    mesh: SolidMesh,
    texels: TexelArray,
    *,
    at: tuple[float, ...] | None = None,
    direction: tuple[float, float, float] | None = None,
    yaw: float = 0.0,
) -> Pose:
    """Find place and direction of an indenter.

    Args:
        mesh: Mesh of the cover.
        texels: Texels on its base.
        at: Wanted place: the nearest point of the top is taken.  Two lengths x and y do for planar texels.  If None,
            the point above the texel that is nearest to the middle of all active texels, of those with a top above
            them [m].
        direction: Direction of motion, any length; against the normal of the top at the place if None.
        yaw: Rotation of the indenter about its axis [rad].

    Raises:
        InputError: If the place is not on the cover, or the direction is zero.
    """
    top = find_top(mesh)
    thickness = measure_thickness(mesh)
    if at is None:
        middle = _find_covered(top, texels, thickness)
        wanted = find_above(top, texels)[[middle]]
    else:
        wanted = np.array([_complete(at, texels, thickness)])
    weights, distance = top.locate(wanted)
    point = (weights @ top.nodes)[0]
    if distance[0] > _OFF_TOP * thickness:
        near = ",".join(f"{round(1e3 * each, 4) + 0.0:g}mm" for each in point)
        raise InputError(
            f"--at: the place is {1e3 * distance[0]:.4g} mm from the cover's surface; the nearest point is {near}"
        )
    if direction is None:
        # Above a texel, its own normal: that of the top turns from element to element on rough surfaces.
        towards = -texels.normals[middle] if at is None else -(weights @ top.normals)[0]
    else:
        towards = np.array(direction, dtype=float)
    length = float(np.linalg.norm(towards))
    if not length > _TINY:
        raise InputError("--direction: must not be zero; write for example --direction=0,0,-1")
    return Pose.facing(point, towards / length, spin=yaw)


def _find_covered(top: FacetSurface, texels: TexelArray, thickness: float) -> int:
    """Return the index of the texel nearest to the middle of all active ones that has a top above it."""
    covered = texels.active & ~find_uncovered(top, texels, thickness)
    if not covered.any():
        raise InputError(
            "--at: is needed: no texel has a surface of the cover above it along its normal; write for example "
            "--at=0mm,2mm,8mm"
        )
    return find_middle(texels, covered)


def find_middle(texels: TexelArray, among: BoolArray | None = None) -> int:
    """Return the index of the texel whose centre is nearest to the mean of all active centres.

    Args:
        texels: The texels.
        among: Which texels may be returned, shape (n,); the active ones if None.
    """
    allowed = np.flatnonzero(texels.active if among is None else among)
    middle = texels.centres[texels.active].mean(axis=0)
    return int(allowed[np.argmin(np.linalg.norm(texels.centres[allowed] - middle, axis=1))])


def _complete(at: tuple[float, ...], texels: TexelArray, thickness: float) -> FloatArray:
    if len(at) == 3:  # noqa: PLR2004 -- x, y and z
        return np.array(at)
    if texels.planar:
        return np.array([*at, thickness])
    raise InputError("--at: a curved cover needs three lengths x,y,z; write for example --at=0mm,2mm,8mm")
