"""Inputs of the published models from one press: MuJoCo's contacts on box texels, and the rigid indenter's geometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import mujoco
import numpy as np

from fastmodel import BoxTexels, FastIndentation, Gaussian, Parameters, indent
from fastmodel.contact.boxes import BoxReader
from fastmodel.contact.interface import Reading
from fastmodel.surface import Surface
from fem_reference.closed_form.layer import TexelResponse
from meshes import Cover, TexelArray
from meshes.array_types import FloatArray, IntArray
from validation.campaign.case import Case

#: Cells of the contact map per texel pitch [-].
CELLS_PER_PITCH = 12
#: Spacing of the grid on which contact points of several steps are merged if the indenter does not come to rest [m].
_MERGE = 1e-5


class Forces(NamedTuple):
    """Forces in one press that a published model predicts.

    Attributes:
        texels: Force on each texel, shape (n,) [N].
        outside: Force that no texel measures according to the model [N].
    """

    texels: FloatArray
    outside: float


class Contacts(NamedTuple):
    """MuJoCo's contact points of an indenter on the box texels.

    Attributes:
        points: Positions in the array's frame, shape (m, 3) [m].
        normals: Unit normals out of the array, shape (m, 3) [-].
        forces: Normal forces, shape (m,) [N].
        texels: Index of the box texel that is touched, shape (m,) [-].
        depths: Rigid penetration in MuJoCo, shape (m,) [m].
    """

    points: FloatArray
    normals: FloatArray
    forces: FloatArray
    texels: IntArray
    depths: FloatArray

    @property
    def pushes(self) -> FloatArray:
        """Component of the contact forces along the array's normal, shape (m,) [N]."""
        return self.forces * self.normals[:, 2]


class ContactMap(NamedTuple):
    """The rigid indenter over cells smaller than a texel, only those under its outline.

    Attributes:
        points: Positions (x, y) of the cells in the array's frame, shape (m, 2) [m].
        gaps: Height of the indenter over its lowest point, shape (m,) [m].
        area: Area of one cell [m2].
    """

    points: FloatArray
    gaps: FloatArray
    area: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """One press of a rigid indenter under a held load, with the inputs of the published models.

    Attributes:
        case: Indenter, pose and load.
        cover: The cover.
        array: The n texels, on a regular planar grid.
        boxes: The press on rigid box texels in MuJoCo, with the spread of the fast model's parameters.
        contacts: MuJoCo's contact points of the press on the box texels.
        plate: MuJoCo's contact points of the same press on one plate in the place of the texels.
        response: Share of a point load on the cover that a texel receives (exact layer solution).
        texel_gaps: Height of the indenter over each texel's centre, inf beside the indenter, shape (n,) [m].
        map: The indenter over a fine grid.
    """

    case: Case
    cover: Cover
    array: TexelArray
    boxes: FastIndentation
    contacts: Contacts
    plate: Contacts
    response: TexelResponse
    texel_gaps: FloatArray
    map: ContactMap

    @property
    def load(self) -> float:
        """Load on the indenter [N]."""
        return self.case.load

    @cached_property
    def layer_shares(self) -> FloatArray:
        """Share of a point load on each cell of the map that each texel receives, shape (n, m) [-]."""
        return np.array([self.response(*(self.map.points - at).T) for at in self.array.centres[:, :2]])


def make_scene(cover: Cover, parameters: Parameters, case: Case, response: TexelResponse) -> Scene:
    """Press the indenter of a case on box texels in MuJoCo, and sample its lower surface.

    Args:
        cover: The cover.
        parameters: The array and its cover's spread.
        case: Indenter, pose and load; not tilted.
        response: Response of the cover, `tabulate_texel_response` of cover and texel size.

    Raises:
        FastModelError: If the texels do not carry the load.
    """
    array, pose = parameters.array, case.pose

    def press(pressed: Parameters) -> tuple[FastIndentation, Contacts]:
        method = _RecordingBoxes()
        found = indent(pressed, case.indenter, load=case.load, at=pose.at, yaw=pose.yaw, contact=method)
        return found, method.contacts(chattering=found.chatter > 0)

    size = (array.pitch[0] * array.columns, array.pitch[1] * array.rows)
    plate = replace(TexelArray.grid(1, 1, size), centres=array.centres.mean(axis=0, keepdims=True))
    boxes, contacts = press(parameters)
    x, y = pose.to_indenter(array.centres[:, 0], array.centres[:, 1])
    return Scene(
        case=case,
        cover=cover,
        array=array,
        boxes=boxes,
        contacts=contacts,
        plate=press(replace(parameters, array=plate, surface=None, spread=Gaussian.from_sigma(1.0)))[1],
        response=response,
        texel_gaps=case.indenter.gap(x, y),
        map=_map_contact(array, case),
    )


def sink(gaps: FloatArray, law: Callable[[FloatArray], FloatArray], load: float) -> FloatArray:
    """Press a rigid indenter into an array of points until the forces at the points carry the load.

    Args:
        gaps: Height of the indenter over each point before contact, inf beside the indenter, shape (m,) [m].
        law: Function from depths of points inside the indenter [m] to forces [N], increasing without limit.
        load: Applied force [N].

    Returns:
        Depth of each point inside the indenter, shape (m,) [m]; all zero if no point is under the indenter.
    """
    from scipy.optimize import brentq

    under = gaps[np.isfinite(gaps)]
    if not under.size:
        return np.zeros_like(gaps)

    def miss(approach: float) -> float:
        return float(law(np.maximum(approach - under, 0.0)).sum()) - load

    high = 1e-6
    while miss(under.min() + high) < 0:
        high *= 4
    approach = float(brentq(miss, under.min(), under.min() + high, xtol=1e-12, rtol=1e-10))
    return np.asarray(np.maximum(approach - gaps, 0.0))


def sink_springs(gaps: FloatArray, stiffness: float, load: float) -> FloatArray:
    """Press a rigid indenter into equal linear springs, as `sink` does, without iteration.

    Args:
        gaps: Height of the indenter over each spring before contact, inf beside the indenter, shape (m,) [m].
        stiffness: Stiffness of each spring [N/m].
        load: Applied force [N].

    Returns:
        Depth of each spring, shape (m,) [m]; all zero if no spring is under the indenter.
    """
    under = np.sort(gaps[np.isfinite(gaps)])
    if not under.size:
        return np.zeros_like(gaps)
    # With the first m springs in contact the approach is (load / stiffness + sum of their gaps) / m.
    approaches = (load / stiffness + np.cumsum(under)) / np.arange(1, under.size + 1)
    beyond = np.append(under[1:], np.inf)
    return np.asarray(np.maximum(approaches[np.argmax(approaches <= beyond)] - gaps, 0.0))


def scale_to_load(forces: FloatArray, load: float) -> Forces:
    """Scale texel forces, shape (n,), so that their sum is the load [N]; without forces the load is outside."""
    total = float(forces.sum())
    return Forces(forces * load / total, 0.0) if total > 0 else Forces(forces, load)


def bin_on_texels(array: TexelArray, points: FloatArray, forces: FloatArray) -> FloatArray:
    """Sum forces at points (x, y) over the texels that contain the points, shape (n,) [N].

    Args:
        array: The n texels, on a regular grid; each has the area of its pitch.
        points: Positions, shape (m, 2) [m].
        forces: Forces, shape (m,) [N].
    """
    cell = np.floor((points - array.centres[0, :2]) / array.pitch + 0.5).astype(int)
    inside = ((cell >= 0) & (cell < (array.columns, array.rows))).all(axis=1)
    index = cell[inside, 1] * array.columns + cell[inside, 0]
    return np.bincount(index, forces[inside], array.count).astype(np.float64)


def convolve(array: TexelArray, texels: FloatArray, kernel: FloatArray) -> FloatArray:
    """Convolve the image of texel forces with a kernel, zero beyond the edges of the array, shape (n,) [N].

    Args:
        array: The n texels, on a regular grid.
        texels: Force on each texel, shape (n,) [N].
        kernel: Weights, odd numbers of rows and columns [-].
    """
    from scipy.ndimage import convolve as convolve_image

    image = texels.reshape(array.rows, array.columns)
    return np.asarray(convolve_image(image, kernel, mode="constant")).ravel()


def _map_contact(array: TexelArray, case: Case) -> ContactMap:
    reach = float(np.hypot(*case.indenter.footprint))
    spacing = np.array(array.pitch) / CELLS_PER_PITCH
    # Cells divide each texel evenly and lie around the indenter's axis.
    low = np.floor((np.array(case.pose.at) - reach) / spacing)
    count = (np.ceil((np.array(case.pose.at) + reach) / spacing) - low).astype(int)
    x, y = np.meshgrid(*((low[i] + np.arange(count[i]) + 0.5) * spacing[i] for i in (0, 1)))
    points = np.stack([x.ravel(), y.ravel()], axis=-1)
    gaps = case.indenter.gap(*case.pose.to_indenter(points[:, 0], points[:, 1]))
    under = np.isfinite(gaps)
    return ContactMap(points[under], gaps[under], float(spacing.prod()))


@dataclass(frozen=True, kw_only=True)
class _RecordingBoxes(BoxTexels):
    """Contact method `BoxTexels` that keeps MuJoCo's contact points of each reading."""

    recorded: list[Contacts] = field(default_factory=list)

    def bind(
        self,
        model: mujoco.MjModel,
        array: TexelArray,
        name: str,
        *,
        surface: Surface | None = None,  # noqa: ARG002
    ) -> _RecordingReader:
        """Find the boxes in the compiled model; see `TexelContact.bind`."""
        return _RecordingReader(model, array, name, self.recorded)

    def contacts(self, *, chattering: bool) -> Contacts:
        """Return the contacts at rest; if the indenter chatters, their mean over all readings, merged by position."""
        if not chattering:
            return self.recorded[-1]
        points, normals, forces, texels, depths = (np.concatenate(each) for each in zip(*self.recorded, strict=True))
        keys = np.column_stack([np.rint(points / _MERGE), texels])
        _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        mean = np.bincount(group.ravel(), forces) / len(self.recorded)
        return Contacts(points[first], normals[first], mean, texels[first], depths[first])


class _RecordingReader(BoxReader):
    """Reader of box texels that keeps the contacts of each reading."""

    def __init__(self, model: mujoco.MjModel, array: TexelArray, name: str, recorded: list[Contacts]) -> None:
        super().__init__(model, array, name)
        self._recorded = recorded
        self._texel_of = self._net_force.parts[0]

    def read(self, data: mujoco.MjData) -> Reading:
        """Compute the contact forces as `BoxReader.read` does, and keep the contacts."""
        self._recorded.append(self._read_points(data))
        return super().read(data)

    def _read_points(self, data: mujoco.MjData) -> Contacts:
        found = data.contact
        texels = self._texel_of[np.asarray(found.geom).reshape(-1, 2)]
        first = texels[:, 0] >= 0
        # MuJoCo's normal points from the first geom to the second.
        normals = np.asarray(found.frame).reshape(-1, 9)[:, :3] * np.where(first, 1.0, -1.0)[:, None]
        force, forces = np.zeros(6), np.zeros(len(texels))
        for k in range(len(texels)):
            mujoco.mj_contactForce(self._model, data, k, force)
            forces[k] = force[0]
        return Contacts(np.array(found.pos), normals, forces, texels.max(axis=1), -np.array(found.dist))
