"""What presses on an array of several panels, and what it looks like from each of them.

How a rigid body's force divides among panels is, like its division among rigid boxes, a matter of contact points: the
engine knows the sum only.  So the force of each body is taken as a vector over all panels, with its moments where the
body is free, and one rigid motion of the body lays it out over the cells of all panels at once.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fastmodel.contact.panel_layout import Facet, Layout
from fastmodel.contact.plate import Plate, PlateReader, Touching
from fastmodel.contact.plate_forces import decode
from fastmodel.pressure.gap_sampling import Load, Samples, Standing, sample
from meshes import TexelArray

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: Cosine of the angle between a body's force and a panel's normal below which the panel bears nothing of it [-].
_STEEP = 0.2
#: Root mean square, over a panel's normal, below which a sum over cells says nothing that others do not say [-].
_WEAK = 0.02
#: Change of a force's direction that counts as none [-].
_TURNED = 1e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class FacetSamples(Samples):
    """Cells of several panels; row, column, x and y are those on the lattice.

    Attributes:
        place: Middle of the covered part in the array's frame, shape (m, 3) [m].
        normal: Outward normal there, shape (m, 3) [-].
    """

    place: FloatArray
    normal: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Wrench(Load):
    """What one body presses with on all panels.

    Attributes:
        force: Along the first direction [N].
        moment: About the array's origin, shape (3,) [Nm].
        tilts: Whether more than the approach along the first direction is free.
        push: Force of the array on the body, shape (3,) [N].
        directions: Unit vectors along which the body is free to move, the first along what it presses with, (k, 3) [-].
        turns: Whether it is free to tilt as well.
    """

    push: FloatArray
    directions: FloatArray
    turns: bool

    @classmethod
    def of(cls, push: FloatArray, moment: FloatArray, slides: FloatArray, *, turns: bool) -> Wrench:
        """Find the directions.

        Args:
            push: Force of the array on the body, shape (3,) [N].
            moment: Its moment about the array's origin, shape (3,) [Nm].
            slides: Axes of slides, shape (k, 3) [-].
            turns: Whether the body is free to tilt; then it is taken as free to move anywhere.
        """
        span = np.eye(3) if turns else np.linalg.svd(slides.T, full_matrices=False)[0] if len(slides) else push[:, None]
        along = span @ (span.T @ push) if turns or len(slides) else push
        if np.linalg.norm(along) < _STEEP * np.linalg.norm(push):
            span, along = push[:, None], push
        first = along / np.linalg.norm(along)
        rest = span - np.outer(first, first @ span)
        left, sizes, _ = np.linalg.svd(rest, full_matrices=False)
        others = left[:, sizes > 0.5].T  # noqa: PLR2004 -- one or zero
        return cls(
            force=float(push @ first),
            moment=moment,
            tilts=turns or len(others) > 0,
            push=push,
            directions=np.vstack([first, others]),
            turns=turns,
        )

    def upright(self) -> Wrench:
        """The same with the approach only."""
        return dataclasses.replace(self, tilts=False, turns=False, directions=self.directions[:1])

    def alike(self, other: Load, distance: float) -> bool:
        """Whether another wrench presses along the same line."""
        if not isinstance(other, Wrench):
            return False
        turned = np.abs(self.push / self.force - other.push / other.force).max()
        return bool(turned <= _TURNED) and (not self.turns or super().alike(other, distance))

    def constraints(self, samples: Samples, mine: IntArray) -> tuple[FloatArray, FloatArray]:
        """Forces along every direction and, where the body turns, both moments across the first one.

        Sums that differ little from others, as all lateral ones on a flat array, are left out.
        """
        if not isinstance(samples, FacetSamples):
            raise TypeError("a wrench is laid out over cells of panels")
        place, normal = samples.place[mine], samples.normal[mine]
        columns = [normal @ direction for direction in self.directions]
        wanted = [float(self.push @ direction) for direction in self.directions]
        if self.turns:
            middle = np.cross(self.push, self.moment) / (self.push @ self.push)
            lever = np.cross(place - middle, normal)
            size = max(float(np.abs(lever).max()), 1e-9)
            columns += [lever @ direction / size for direction in self.directions[1:]]
            wanted += [0.0] * (len(self.directions) - 1)
        first, rest = columns[0], np.array(columns[1:]).reshape(-1, len(mine))
        share = rest @ first / (first @ first)
        rest = rest - np.outer(share, first)
        aims = np.array(wanted[1:]) - share * wanted[0]
        values, vectors = np.linalg.eigh(rest @ rest.T / len(mine))
        kept = values > _WEAK**2
        scale = 1 / np.sqrt(values[kept])
        mixed = vectors[:, kept] * scale
        return np.ascontiguousarray(np.column_stack([first, rest.T @ mixed])), np.append(wanted[0], aims @ mixed)


class FacetReader(PlateReader):
    """Finds in one step's data what presses on the panels."""

    def __init__(
        self,
        plate: Plate,
        model: Any,  # noqa: ANN401 -- MjModel
        array: TexelArray,
        name: str,
        *,
        layout: Layout,
        edge: float,
        native: bool | None = None,
    ) -> None:
        """Find the plates in the compiled model; as for `PlateReader`, with panels and their cells for the grid."""
        super().__init__(plate, model, array, name, grid=layout.grid, edge=edge, native=native)
        self._facets, self._thickness, self._whole = layout.facets, plate.height, layout.grid
        self._panel_of = np.full(self._model.ngeom + 1, -1)
        self._panel_of[self._geoms] = np.arange(len(self._geoms))
        self._normals = np.array([facet.panel.axes[:, 2] for facet in self._facets])

    def _loads(self, data: Any, axes: FloatArray, origin: FloatArray) -> list[tuple[int, Load]]:  # noqa: ANN401
        contact = data.contact
        panels = self._panel_of[contact.geom]
        touches = ((panels >= 0).any(axis=1) & (contact.efc_address >= 0)).nonzero()[0]
        if not len(touches):
            return []
        second = panels[touches, 1] >= 0
        side = second.astype(np.int64)
        body = self._group[contact.geom[touches, 1 - side]]
        normal = self._normals[panels[touches, side]]
        forces = np.zeros((len(touches), 3))
        dimensions = contact.dim[touches]
        for size in set(dimensions.tolist()):
            mine = (dimensions == size).nonzero()[0]
            k = touches[mine]
            local = decode(data.efc_force, contact.efc_address[k], contact.friction[k], size, pyramidal=self._pyramidal)
            directions = contact.frame[k].reshape(-1, 3, 3)[:, : local.shape[1]] @ axes
            press, rub = local[:, :1] * directions[:, 0], np.einsum("ki,kij->kj", local[:, 1:], directions[:, 1:])
            # friction counts as far as it presses; what it pulls along the panel is no pressure
            forces[mine] = press + (rub * normal[mine]).sum(axis=1, keepdims=True) * normal[mine]
        forces[second] *= -1
        place = (contact.pos[touches] - origin) @ axes
        return [
            (int(each), load)
            for each in np.unique(body)
            if (load := self._wrench(data, int(each), axes, place[body == each], forces[body == each])) is not None
        ]

    def _wrench(
        self,
        data: Any,  # noqa: ANN401 -- MjData
        body: int,
        axes: FloatArray,
        place: FloatArray,
        forces: FloatArray,
    ) -> Load | None:
        push, moment = forces.sum(axis=0), np.cross(place, forces).sum(axis=0)
        if np.isfinite(push).all() and not (self._normals @ push).max() > 0:
            return None
        slides = self._joints.slides(data, body) @ axes
        if not np.isfinite(push).all():
            return Load(force=float("nan"), moment=push, tilts=False)
        return Wrench.of(push, moment, slides, turns=self._joints.tilts(data, body, axes[:, 2]))

    def look(self, touching: Touching, reach: Sequence[float]) -> Samples:
        """Look at every body from every panel that it may press on."""
        found: list[FloatArray] = []
        for body, (standing, load) in enumerate(zip(touching.standing, touching.loads, strict=True)):
            first = load.directions[0] if isinstance(load, Wrench) else np.array([0.0, 0.0, 1.0])
            cells = [
                self._from(facet, standing, reach[body])
                for facet, bears in zip(self._facets, self._normals @ first > _STEEP, strict=True)
                if bears and _near(facet, standing, reach[body])
            ]
            own = np.concatenate([np.zeros((12, 0)), *cells], axis=1)
            own = own[:, own[5] <= own[5].min(initial=np.inf) + reach[body]]
            found.append(np.vstack([np.full(own.shape[1], float(body)), own]))
        body_, row, column, coverage, x, y, gap, *rest = np.concatenate(found, axis=1)
        return FacetSamples(
            body=body_.astype(np.int64),
            row=row.astype(np.int64),
            column=column.astype(np.int64),
            coverage=coverage,
            x=x,
            y=y,
            gap=gap,
            place=np.array(rest[:3]).T,
            normal=np.array(rest[3:]).T,
        )

    def _from(self, facet: Facet, standing: Standing, reach: float) -> FloatArray:
        """Row, column, coverage, x, y, gap, place and normal of one panel's cells under a body, shape (12, m)."""
        axes, grid = facet.panel.axes, facet.grid
        local = Standing(
            shape=standing.shape,
            rotation=axes.T @ standing.rotation,
            position=(standing.position - facet.panel.origin) @ axes,
        )
        seen = sample(grid, [local], [reach], native=self._native)
        place = facet.panel.origin + np.outer(seen.x, axes[:, 0]) + np.outer(seen.y, axes[:, 1])
        shift = self._whole.low - grid.low + np.array([facet.column, facet.row]) * grid.edge
        cells = np.vstack(
            [
                seen.row + facet.row,
                seen.column + facet.column,
                seen.coverage,
                seen.x + shift[0],
                seen.y + shift[1],
                seen.gap,
                place.T,
                np.tile(axes[:, 2:], seen.count),
            ]
        )
        return cells[:, (seen.gap > -self._thickness) & facet.holds(seen.row, seen.column)]


def _near(facet: Facet, standing: Standing, reach: float) -> bool:
    """Whether balls about a body's solids come near a panel's cells."""
    shape = standing.shape
    middle = standing.position + np.einsum("pij,pj->pi", standing.rotation, shape.centres)
    distance = np.linalg.norm(middle - facet.panel.origin, axis=1) - np.linalg.norm(shape.halves, axis=1)
    return bool(np.any(~(distance > facet.radius + reach)))
