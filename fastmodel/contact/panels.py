"""Contacts of bodies with an array of several flat panels.

MuJoCo divides the force of a rigid body among panels by number of contact points, so that only the sum has a physical
meaning.  Therefore the force of each body is summed over all panels as a vector, together with its moment if the body
is free to tilt.  One rigid motion of the body then determines the pressure on the cells of all panels together.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from fastmodel.contact.force_kernels import FRONT, Contacts, Sums
from fastmodel.contact.panel_layout import PanelCells, PanelLayout
from fastmodel.contact.plate import Plate, PlateContact, PlateReader, press_ball
from fastmodel.pressure.conjugate_gradient import Load
from fastmodel.pressure.gap_sampling import GapSamples, PosedBody, sample_gap
from meshes import TexelArray
from meshes.array_types import FloatArray, IntArray

#: Cosine of the angle between a body's force and a panel's normal, up to which the body exerts no pressure on the
#: panel. Also the smallest share of a body's force along the directions in which its joints leave the body free; below
#: this share the direction of the force is used instead [-].
_STEEP = 0.2
#: Root mean square over a body's cells, up to which a column of the body's constraints, after subtraction of its
#: component along the first column, counts as linearly dependent on the other columns and is omitted [-].
_DEPENDENT = 0.02
#: Singular value above which a direction counts as independent of the first direction [-].  The singular value is 0 for
#: a direction along the first direction and 1 for a direction across it.
_NEW = 0.5
#: Number of rows of the table of cells that `PanelReader` builds for each panel, and index of the row with the gap.
#: The rows are: row, column, coverage, x, y, gap, position (3 rows) and normal (3 rows).
_FIELDS, _GAP = 12, 5


@dataclass(frozen=True, kw_only=True, eq=False)
class PanelSamples(GapSamples):
    """The m cells of several panels under bodies; row, column, x and y refer to the common grid of the panels.

    Attributes:
        place: Centroid of the covered part of each cell in the array's frame, shape (m, 3) [m].
        normal: Outward normal of each cell's panel in the array's frame, shape (m, 3) [-].
    """

    place: FloatArray
    normal: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Wrench(Load):
    """The force vector and moment with which one body presses on all panels.

    Attributes:
        force: Component of the body's force along the first of `directions` [N].
        moment: Moment of the body's contact forces about the array's origin, shape (3,) [N m].
        tilts: Whether the body is free to move in any way other than along the first direction.
        vector: Force of the body, with its sign such that a pressing force has a positive component along a panel's
            normal, shape (3,) [N].
        directions: k unit vectors along which the body is free to move, the first along the component of the force in
            these directions, shape (k, 3) [-].
        rotates: Whether the body is also free to rotate.
    """

    vector: FloatArray
    directions: FloatArray
    rotates: bool

    @classmethod
    def along_free_directions(
        cls, vector: FloatArray, moment: FloatArray, slides: FloatArray, *, rotates: bool
    ) -> Wrench:
        """Make a wrench from force and moment, and find the directions in which the body is free to move.

        Args:
            vector: Force of the body, shape (3,) [N].
            moment: Moment of the contact forces about the array's origin, shape (3,) [N m].
            slides: Axes of the k slide joints between body and array, shape (k, 3) [-].
            rotates: Whether the body is free to rotate; the body then counts as free to move in all directions.
        """
        if rotates:
            span = np.eye(3)
        elif len(slides):
            span = np.linalg.svd(slides.T, full_matrices=False)[0]
        else:
            span = vector[:, None]
        along = span @ (span.T @ vector) if rotates or len(slides) else vector
        if np.linalg.norm(along) < _STEEP * np.linalg.norm(vector):
            span, along = vector[:, None], vector
        first = along / np.linalg.norm(along)
        rest = span - np.outer(first, first @ span)
        left, sizes, _ = np.linalg.svd(rest, full_matrices=False)
        others = left[:, sizes > _NEW].T
        return cls(
            force=float(vector @ first),
            moment=moment,
            tilts=rotates or len(others) > 0,
            vector=vector,
            directions=np.vstack([first, others]),
            rotates=rotates,
        )

    def equals(self, other: Load, tolerance: float, length: float) -> bool:
        """Return whether another wrench is equal up to a tolerance; see `Load.equals`."""
        if not isinstance(other, Wrench) or not super().equals(other, tolerance, length):
            return False
        return bool(np.abs(self.vector - other.vector).max() <= tolerance * self.force)

    def without_moments(self) -> Wrench:
        """Return the same wrench with only the force along the first direction prescribed."""
        return dataclasses.replace(self, tilts=False, rotates=False, directions=self.directions[:1])

    def build_constraints(self, samples: GapSamples, own: IntArray | slice) -> tuple[FloatArray, FloatArray]:
        """Build the constraints on the force along every direction and, if the body rotates, on two moments.

        The moments are those about the axes perpendicular to the first direction.  Linearly dependent columns are
        omitted, such as those of lateral forces on a flat array.

        Args:
            samples: Cells under all bodies.
            own: Indices of the m cells under this body, shape (m,).

        Returns:
            Columns of the k constraints columns.T @ forces = target, shape (m, k), and target, shape (k,).
        """
        if not isinstance(samples, PanelSamples):
            raise TypeError("the constraints of a wrench need samples of panels")
        place, normal = samples.place[own], samples.normal[own]
        columns = [normal @ direction for direction in self.directions]
        wanted = [float(self.vector @ direction) for direction in self.directions]
        if self.rotates:
            centre = np.cross(self.vector, self.moment) / (self.vector @ self.vector)
            lever = np.cross(place - centre, normal)
            size = max(float(np.abs(lever).max()), 1e-9)
            columns += [lever @ direction / size for direction in self.directions[1:]]
            wanted += [0.0] * (len(self.directions) - 1)
        first, rest = columns[0], np.array(columns[1:]).reshape(-1, len(place))
        share = rest @ first / (first @ first)
        rest = rest - np.outer(share, first)
        aims = np.array(wanted[1:]) - share * wanted[0]
        values, vectors = np.linalg.eigh(rest @ rest.T / len(place))
        kept = values > _DEPENDENT**2
        scale = 1 / np.sqrt(values[kept])
        mixed = vectors[:, kept] * scale
        return np.ascontiguousarray(np.column_stack([first, rest.T @ mixed])), np.append(wanted[0], aims @ mixed)


class PanelReader(PlateReader):
    """Reader that finds the bodies that press on several panels, and samples the gap under these bodies."""

    def __init__(
        self, plate: Plate, model: mujoco.MjModel, array: TexelArray, name: str, *, layout: PanelLayout, edge: float
    ) -> None:
        """Find the plates of all panels in the compiled model; see `PlateReader`.  `layout` replaces the grid."""
        super().__init__(plate, model, array, name, grid=layout.grid, edge=edge)
        self._panels = layout.panels
        self._normals = np.array([part.panel.axes[:, 2] for part in self._panels])

    def _find_loads(self, data: mujoco.MjData, contacts: Contacts) -> tuple[PlateContact, Sums]:
        """Find the bodies that press on the panels and their loads and poses; see `PlateReader.find_contact`."""
        # dot instead of @, because @ takes twice as long for arrays this small
        axes = data.geom_xmat[self._geom].reshape(3, 3).dot(self._turn)
        origin = data.geom_xpos[self._geom] - axes.dot(self._middle)
        contact = data.contact
        panels = self.net_force.parts[0][contact.geom]
        touching = ((panels >= 0).any(axis=1) & (contact.efc_address >= 0)).nonzero()[0]
        second = panels[touching, 1] >= 0
        side = second.astype(np.int64)
        body = self._bodies.of_geom[contact.geom[touching, 1 - side]]
        panel = panels[touching, side]
        normal = self._normals[panel]
        local = np.zeros((len(touching), 6))  # force and torque
        for number, force in zip(touching.tolist(), local, strict=True):
            mujoco.mj_contactForce(self._model, data, number, force)
        directions = contact.frame[touching].reshape(-1, 3, 3) @ axes
        directions[second] *= -1
        pressure = local[:, :1] * directions[:, 0]
        friction = np.einsum("ki,kij->kj", local[:, 1:3], directions[:, 1:])
        # only the component of friction along the panel's normal is used, because the other components are not pressure
        forces = pressure + (friction * normal).sum(axis=1, keepdims=True) * normal
        along = (forces * normal).sum(axis=1)
        front = (directions[:, 0] * normal).sum(axis=1) >= FRONT
        place = (contact.pos[touching] - origin) @ axes
        loads = {}
        for each in np.unique(body[front & (body >= 0)]).tolist():
            mine = front & (body == each)
            load = self._sum_wrench(data, each, axes, place[mine], forces[mine])
            if load is not None:
                loads[each] = load
        bodies = tuple(loads)
        known = np.isin(body, bodies) & (body >= 0)
        owner = np.full(len(body), -1)
        owner[known] = np.searchsorted(bodies, body[known])
        scattered = front & (body < 0) & (along > 0)
        known &= front
        touches = np.column_stack([self._place_on_grid(panel, place), along])
        found = PlateContact(
            bodies=bodies,
            loads=tuple(loads.values()),
            poses=tuple(
                self._find_pose(
                    data, each, np.vstack([axes, origin]), float(-contact.dist[touching[body == each]].min())
                )
                for each in bodies
            ),
            owner=owner[known],
            touches=touches[known],
            points=touches[scattered],
            beside=float(along[~known & ~scattered].sum()),
        )
        return found, self.net_force.sum_contacts(contacts, data)

    def _place_on_grid(self, panel: IntArray, place: FloatArray) -> FloatArray:
        """Compute x, y on the common grid of k points on given panels, limited to these panels, shape (k, 2) [m].

        Args:
            panel: Index of the panel of each point, shape (k,).
            place: The points in the array's frame, shape (k, 3) [m].
        """
        out = np.zeros((len(panel), 2))
        for k, (number, point) in enumerate(zip(panel.tolist(), place, strict=True)):
            part = self._panels[number]
            local = ((point - part.panel.origin) @ part.panel.axes)[:2]
            half = np.array(part.panel.half) - np.array(part.grid.edge) / 2
            out[k] = np.clip(local, -half, half) + self._shift(part)
        return out

    def _shift(self, part: PanelCells) -> FloatArray:
        """Return the position of a panel's origin on the common grid, shape (2,) [m]."""
        return np.asarray(self._grid.low - part.grid.low + np.array([part.column, part.row]) * part.grid.edge)

    def _sum_wrench(
        self, data: mujoco.MjData, body: int, axes: FloatArray, place: FloatArray, forces: FloatArray
    ) -> Load | None:
        """Sum the contact forces of one body to its load; return None if the body presses on no panel.

        If a contact force is not finite, the force of the load is nan.
        """
        vector, moment = forces.sum(axis=0), np.cross(place, forces).sum(axis=0)
        if not np.isfinite(vector).all():
            return Load(force=float("nan"), moment=vector, tilts=False)
        if not (self._normals @ vector).max() > 0:
            return None
        slides = self._joints.find_slides(data, body) @ axes
        rotates = self._joints.let_tilt(data, body, axes[:, 2])
        return Wrench.along_free_directions(vector, moment, slides, rotates=rotates)

    def imitate_ball(self, radius: float) -> PlateContact:
        """Make the contact of a ball with the first panel; see `PlateReader.imitate_ball`."""
        panel = self._panels[0].panel
        normal = panel.axes[:, 2]
        centre = panel.origin + radius * normal
        wrench = Wrench.along_free_directions(normal, np.cross(centre, normal), np.zeros((0, 3)), rotates=True)
        return press_ball(radius, centre, wrench)

    def sample_gap(self, contact: PlateContact, reach: Sequence[float]) -> GapSamples:
        """Sample the gap under every body, on the cells of every panel on which the body's force may press."""
        found: list[FloatArray] = []
        for body, (pose, load) in enumerate(zip(contact.poses, contact.loads, strict=True)):
            first = load.directions[0] if isinstance(load, Wrench) else np.array([0.0, 0.0, 1.0])
            tables = [
                self._sample_panel(part, pose, reach[body])
                for part, pressed in zip(self._panels, self._normals @ first > _STEEP, strict=True)
                if pressed and _is_near(part, pose, reach[body])
            ]
            own = np.concatenate([np.zeros((_FIELDS, 0)), *tables], axis=1)
            own = own[:, own[_GAP] <= own[_GAP].min(initial=np.inf) + reach[body]]
            found.append(np.vstack([np.full(own.shape[1], float(body)), own]))
        number, row, column, coverage, x, y, gap, *rest = np.concatenate(found, axis=1)
        return PanelSamples(
            body=number.astype(np.int64),
            row=row.astype(np.int64),
            column=column.astype(np.int64),
            coverage=coverage,
            x=x,
            y=y,
            gap=gap,
            place=np.array(rest[:3]).T,
            normal=np.array(rest[3:]).T,
        )

    def _sample_panel(self, part: PanelCells, pose: PosedBody, reach: float) -> FloatArray:
        """Sample the gap between a body and one panel; return a table of the m cells, shape (`_FIELDS`, m)."""
        axes, grid = part.panel.axes, part.grid
        local = PosedBody(
            shape=pose.shape,
            rotation=axes.T @ pose.rotation,
            position=(pose.position - part.panel.origin) @ axes,
            back=pose.back,
        )
        samples = sample_gap(grid, [local], [reach])
        place = part.panel.origin + np.outer(samples.x, axes[:, 0]) + np.outer(samples.y, axes[:, 1])
        shift = self._shift(part)
        table = np.vstack(
            [
                samples.row + part.row,
                samples.column + part.column,
                samples.coverage,
                samples.x + shift[0],
                samples.y + shift[1],
                samples.gap,
                place.T,
                np.tile(axes[:, 2:], samples.count),
            ]
        )
        return table[:, part.holds(samples.row, samples.column)]


def _is_near(part: PanelCells, pose: PosedBody, reach: float) -> bool:
    """Return whether the bounding sphere of any solid of a body lies within `reach` [m] of a panel's cells."""
    shape = pose.shape
    centre = pose.position + np.einsum("pij,pj->pi", pose.rotation, shape.centres)
    distance = np.linalg.norm(centre - part.panel.origin, axis=1) - np.linalg.norm(shape.halves, axis=1)
    return bool((distance <= part.radius + reach).any())
