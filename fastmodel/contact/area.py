"""Box texels whose forces are shared by area: what each body presses with, laid out as a linear pressure.

MuJoCo gives every contact point of a flat face about the same force, however large the part of a box it stands for.
Here the force of each touching body is shared anew: on every box the body's contact points span a polygon, and a
pressure that is linear in place acts on all its polygons such that force and both moments are the engine's (uniform for
a guided body, whose moments are the guide's).  Boxes that a body touches in points or edges only keep their share.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from fastmodel.contact.box_forces import decode
from fastmodel.contact.boxes import BoxReader, BoxTexels, find_boxes
from fastmodel.contact.joints import Joints
from fastmodel.pose import Pose
from fastmodel.pressure.cover_kernels import CoverCells
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Area of a polygon, over that of a texel, below which it counts as an edge or a point [-].
_FLAT = 1e-6


@dataclass(frozen=True, kw_only=True)
class AreaTexels:
    """Rigid boxes, their forces shared by the area of contact polygons.

    Attributes:
        boxes: The boxes.
    """

    boxes: BoxTexels = field(default_factory=BoxTexels)

    costly: ClassVar[bool] = True
    honours: ClassVar[tuple[str, ...]] = ("Fz", "Mx", "My")

    def attach(self, body: Any, array: TexelArray, pose: Pose, name: str) -> None:  # noqa: ANN401 -- mjsBody
        """Add one box geom per texel to a body of the spec."""
        self.boxes.attach(body, array, pose, name)

    def bind(
        self,
        model: Any,  # noqa: ANN401 -- MjModel
        array: TexelArray,
        name: str,
        *,
        cells: CoverCells | None = None,  # noqa: ARG002 -- boxes know no cover
        native: bool | None = None,
    ) -> AreaReader:
        """Find the boxes in the compiled model.

        Raises:
            LifeCycleError: If the model was not compiled from the spec that the array was attached to.
        """
        return AreaReader(model, find_boxes(model, array, name), array, native=native)


class AreaReader(BoxReader):
    """Shares each body's force by area."""

    def __init__(self, model: Any, geoms: IntArray, array: TexelArray, *, native: bool | None = None) -> None:  # noqa: ANN401
        """Remember which geom is which texel."""
        super().__init__(model, geoms, native=native)
        self._first = int(geoms[0])
        self._joints = Joints(model, int(model.geom_bodyid[self._first]))
        self._group = model.body_weldid[model.geom_bodyid]
        self._smallest = _FLAT * array.pitch[0] * array.pitch[1]

    def sample(self, data: Any, signals: FloatArray) -> float:  # noqa: ANN401
        """Read the forces of the last step into what is filtered."""
        self._signals = signals
        return self.at_rest(self.forces(data)).fill(signals)

    def forces(self, data: Any) -> FloatArray:  # noqa: ANN401
        """Force on each texel, shape (n,) [N]."""
        total = super().forces(data)
        if np.count_nonzero(total) < 2:  # noqa: PLR2004 -- nothing to share
            return total
        texel, body, force, place = self._contacts(data)
        shared = np.zeros(self._count)
        rotation = data.geom_xmat[self._first].reshape(3, 3)
        origin = data.geom_xpos[self._first]
        for each in np.unique(body):
            mine = body == each
            local = (place[mine] - origin) @ rotation
            tilts = self._joints.tilts(data, int(each), rotation[:, 2])
            shared += self._share(texel[mine], force[mine], local[:, :2], tilts=tilts)
        shared = np.maximum(shared, 0.0)
        return shared * (total.sum() / shared.sum()) if shared.sum() > 0 else total

    def _share(self, texel: IntArray, force: FloatArray, place: FloatArray, *, tilts: bool) -> FloatArray:
        """Force of one body on each texel, shape (n,) [N]."""
        own = np.bincount(texel, force, self._count).astype(np.float64)
        touched = np.unique(texel)
        outlines = [_polygon(place[texel == each]) for each in touched]
        area = np.array([each[0] for each in outlines])
        wide = area > self._smallest
        if not wide.any():
            return own
        middle = np.array([each[1:] for each in outlines])[wide]
        inside = np.isin(texel, touched[wide])
        load = float(force[inside].sum())
        columns = area[wide][:, None] * np.column_stack([np.ones(len(middle)), middle])
        pressure = np.array([load / area[wide].sum(), 0.0, 0.0])
        if tilts and wide.sum() >= 3:  # noqa: PLR2004 -- a plane takes three points
            wanted = np.array([load, *(force[inside] @ place[inside])])
            basis = np.column_stack([np.ones(len(middle)), middle])
            pressure = np.linalg.lstsq(basis.T @ columns, wanted, rcond=1e-10)[0]
        own[touched[wide]] = columns @ pressure
        return own

    def _contacts(self, data: Any) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:  # noqa: ANN401
        """Texel, body, force against the box's normal [N] and position [m] of every contact with a box."""
        contact, found = data.contact, []
        for side in (0, 1):
            texel = self._texel_of[contact.geom[:, side]]
            both = ((texel >= 0) & (contact.efc_address >= 0)).nonzero()[0]
            other = self._group[contact.geom[both, 1 - side]]
            normal = data.geom_xmat[contact.geom[both, side]][:, 2::3]
            force = np.zeros(len(both))
            for dim in set(contact.dim[both].tolist()):
                mine = (contact.dim[both] == dim).nonzero()[0]
                k = both[mine]
                local = decode(
                    data.efc_force, contact.efc_address[k], contact.friction[k], dim, pyramidal=self._pyramidal
                )
                axes = contact.frame[k].reshape(-1, 3, 3)[:, : local.shape[1]]
                force[mine] = np.einsum("ki,kij,kj->k", local, axes, normal[mine])
            found.append((texel[both], other, force if side == 0 else -force, contact.pos[both]))
        texel, body, force, place = (np.concatenate(each) for each in zip(*found, strict=True))
        return texel, body, force, place


def _polygon(points: FloatArray) -> tuple[float, float, float]:
    """Area [m2] and centroid [m] of the convex hull of points, shape (k, 2)."""
    middle = points.mean(axis=0)
    if len(points) < 3:  # noqa: PLR2004 -- no area
        return 0.0, float(middle[0]), float(middle[1])
    hull = np.array(_hull(points.tolist())) - middle
    x, y = hull.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    area = 0.5 * float(cross.sum())
    if area <= 0:
        return 0.0, float(middle[0]), float(middle[1])
    centre = [float(((v + np.roll(v, -1)) * cross).sum() / (6 * area)) for v in (x, y)]
    return area, float(middle[0]) + centre[0], float(middle[1]) + centre[1]


def _hull(points: list[list[float]]) -> list[list[float]]:
    """Corners of the convex hull, counterclockwise (Andrew's monotone chain)."""
    ordered = sorted(points)
    corners: list[list[float]] = []
    for sweep in (ordered, ordered[::-1]):
        chain: list[list[float]] = []
        for p in sweep:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], p) <= 0:
                chain.pop()
            chain.append(p)
        corners += chain[:-1]
    return corners or ordered[:1]


def _turn(a: list[float], b: list[float], c: list[float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
