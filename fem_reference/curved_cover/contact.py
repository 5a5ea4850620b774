"""Solve the frictionless contact of a rigid indenter with a curved top at small strain.

The unknowns are the forces of the shapes of the contact pressure (hats; `pressure_shapes`), one for each node of the
top.  The gap is the distance to the indenter along the undeformed normals.  Hats in contact have no mean gap and a
positive force; all others have a mean gap and no force.  The set of hats in contact is found by block principal
pivoting (Judice and Pires 1994).  The compliance of a node is one solution of the factorised solid, so it is computed
when the node first bears a force, and kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_reference.curved_cover.compliance import NormalCompliance
from fem_reference.curved_cover.facet_surface import FacetSurface
from fem_reference.curved_cover.pressure_shapes import GapSampler, MeanGaps
from fem_reference.curved_cover.rays import measure_gaps
from fem_reference.errors import ConvergenceError
from meshes import Indenter
from meshes.array_types import BoolArray, FloatArray
from meshes.pose import Pose
from meshes.solids.facets import facet_shape, split_facet

#: Largest number of exchanges of hats, and of exchanges of all wrong hats at once without fewer wrong hats [-].
EXCHANGES, _PATIENCE = 200, 8
#: Overlap over the deepest overlap of the undeformed top below which a hat counts as free [-].
NEGLIGIBLE = 1e-9
#: Compliance that is added to that of each hat, over the sum of all: below an indenter smaller than a facet the hats
#: are linearly dependent [-].
SOFT = 1e-8
#: Gap over the deepest overlap below which a hat counts to the area of contact: near a sharp edge the pressure
#: oscillates, and hats beside large forces are lifted a little [-].
_CLOSED = 0.02
#: Search for the first touch: parts of a facet's side, number of facets searched further, points along a side of a
#: search, number of searches, and size of the next over the distance of the points [-].
_PARTS, _FACETS, _POINTS, _SEARCHES, _ZOOM = 6, 4, 9, 6, 1.5


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactForces:
    """Contact of an indenter in one position with the m nodes of a top.

    Attributes:
        forces: Force of the pressure of each hat, against the normals, never negative, shape (m,) [N].
        nodal: The same pressures, and the shear of hats that stick, as forces on the nodes, by the shape functions of
            the displacement, shape (m, 3) [N].
        area: Area of the hats in contact, those included that are lifted by less than 2 % of the depth [m2].
        spacing: Mean distance of the nodes in contact [m].
        half_width: Half the smaller width of the contact, by the second moments of its area; a disk's radius [m].
        has_edge: Whether an edge of the indenter ends the pressure.
        travel: Distance by which the indenter moved from its pose, along its direction [m].
        load: Force of the indenter on the cover along its direction [N].
        stiffness: Increase of the load per travel with the same hats in contact [N/m].
        shear: Force of the indenter on the cover across the normal of each hat, shape (m, 3) [N]; None if frictionless.
    """

    forces: FloatArray
    nodal: FloatArray
    area: float
    spacing: float
    half_width: float
    has_edge: bool
    travel: float
    load: float
    stiffness: float
    shear: FloatArray | None = None


def solve_contact(
    compliance: NormalCompliance, sampler: GapSampler, direction: FloatArray, travel: float
) -> ContactForces:
    """Solve the contact after the indenter moved without turning.

    Args:
        compliance: Compliance of the top.
        sampler: Points of the top, with indenter, pose and direction.
        direction: Unit direction of the motion, shape (3,).
        travel: Distance moved [m].

    Raises:
        ConvergenceError: If the hats in contact are not found.
    """
    gaps = sampler.at(travel)
    forces, change, remaining = _find_forces(compliance, gaps)
    top = compliance.top
    nodal, more = (-(gaps.spread @ each)[:, None] * top.normals for each in (forces, change))
    stiffness = float((more @ direction).sum())
    return describe_contact(
        top, gaps, travel, direction, forces=forces, nodal=nodal, stiffness=stiffness, remaining=remaining
    )


def describe_contact(
    top: FacetSurface,
    gaps: MeanGaps,
    travel: float,
    direction: FloatArray,
    *,
    forces: FloatArray,
    nodal: FloatArray,
    stiffness: float,
    remaining: FloatArray,
) -> ContactForces:
    """Measure the contact of m hats; `remaining` are their mean gaps, shape (m,) [m]; others as in `ContactForces`."""
    closed = remaining < -_CLOSED * gaps.gap.min(initial=0.0)
    spacing = float(np.sqrt(gaps.whole[closed].mean())) if closed.any() else 0.0
    places = (gaps.spread.T @ top.nodes)[closed]  # where the force of each hat acts
    return ContactForces(
        forces=forces,
        nodal=nodal,
        area=float(gaps.area[closed].sum()),
        spacing=spacing,
        half_width=_measure_half_width(places, gaps.area[closed], spacing),
        has_edge=bool((gaps.is_cut & (forces > 0)).any()),
        travel=travel,
        load=float((nodal @ direction).sum()),
        stiffness=stiffness,
    )


class Exchange:
    """Choice of the hats that enter or leave the contact in one step of the pivoting.

    Args:
        count: Number of hats.

    Attributes:
        is_single: Whether the last choice was one hat, because exchanges of all did not make the wrong hats fewer.
    """

    def __init__(self, count: int) -> None:
        self._fewest, self._patience, self.is_single = count + 1, _PATIENCE, False

    def choose(self, wrong: BoolArray) -> BoolArray:
        """Return all wrong hats; only the last of them where exchanges of all do not make them fewer."""
        count, self.is_single = int(wrong.sum()), False
        if count < self._fewest:
            self._fewest, self._patience = count, _PATIENCE
        elif self._patience > 0:
            self._patience -= 1
        else:
            self.is_single = True
            wrong[np.flatnonzero(wrong)[:-1]] = False  # exchanges of the last hat alone cannot cycle (Murty 1974)
        return wrong


def _measure_half_width(nodes: FloatArray, area: FloatArray, spacing: float) -> float:
    """Measure half the smaller width of a contact: twice the root of its smaller second moment, a disk's radius [m].

    Args:
        nodes: Places of the k hats in contact, shape (k, 3) [m].
        area: Area of each, shape (k,) [m2].
        spacing: Mean width of a hat [m].
    """
    if not area.sum() > 0:
        return 0.0
    moments = np.cov(nodes.T, aweights=area, ddof=0)
    across = float(np.linalg.eigvalsh(moments)[1])  # the smallest is that along the normal
    return 2 * float(np.sqrt(max(across, 0.0) + spacing**2 / 12))


def _find_forces(compliance: NormalCompliance, gaps: MeanGaps) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Find the forces of the hats, their increase per travel, and the mean gaps that remain, shape (m,) each."""
    touching = gaps.gap < 0
    deepest = -float(gaps.gap.min(initial=0.0))
    exchange = Exchange(len(touching))
    for _ in range(EXCHANGES):
        hats = np.flatnonzero(touching)
        forces, change = np.zeros((2, len(touching)))
        if not len(hats):
            return forces, change, gaps.gap
        loads = gaps.spread[:, hats]
        nodes = np.flatnonzero(np.diff(loads.tocsr().indptr))
        moved = loads[nodes].T @ compliance.rows(nodes)  # of all nodes, per unit force of each hat
        mean = np.asarray((gaps.spread.T @ moved.T).T)
        own = mean[:, hats]
        own[np.diag_indices(len(hats))] += np.broadcast_to(gaps.softness, len(touching))[hats] + SOFT * np.trace(own)
        solved = np.linalg.solve(own, np.stack([-gaps.gap[hats], gaps.rate[hats]], axis=1))
        forces[hats], change[hats] = solved.T
        remaining = gaps.gap + forces[hats] @ mean + gaps.softness * forces
        wrong = np.where(touching, forces < 0, remaining < -NEGLIGIBLE * deepest)
        if not wrong.any():
            return forces, change, remaining
        touching = touching ^ exchange.choose(wrong)
    raise ConvergenceError(f"the contact did not settle in {EXCHANGES} exchanges")


def find_touch(top: FacetSurface, indenter: Indenter, pose: Pose, direction: FloatArray) -> float:
    """Find how far an indenter moves along a direction until it touches the undeformed top.

    Only the part of the top that looks against the direction can be touched.

    Returns:
        Distance; negative if the indenter overlaps the top in its pose, inf if it never touches [m].
    """
    middle, area, _ = top.split(_PARTS)
    place = split_facet(top.facets.shape[1], _PARTS)[0]
    distance = _measure_travel(middle.reshape(-1, 3), area.reshape(-1, 3), indenter, pose, direction)
    each = distance.reshape(middle.shape[:2])
    if not np.isfinite(each).any():
        return float("inf")
    best = float(each.min())
    for facet in np.argsort(each.min(axis=1))[:_FACETS]:
        if np.isfinite(each[facet].min()):
            start = place[np.argmin(each[facet])]
            best = min(best, _search_facet(top, int(facet), start, (indenter, pose, direction)))
    return best


def explain_miss(top: FacetSurface, pose: Pose, direction: FloatArray) -> str:
    """Say why an indenter does not touch: it passes between the points of the top that are searched, or beside it."""
    facing = np.flatnonzero(top.normals @ direction < 0)
    beside = np.linalg.norm(np.cross(top.nodes[facing] - pose.position, direction), axis=1)
    spacing = float(np.sqrt(np.linalg.norm(top.split(1)[1], axis=2).mean()))
    if beside.min(initial=np.inf) <= spacing:
        return (
            "the indenter is too small for this mesh: it passes between points of the elements, "
            f"{1e3 * spacing:.2g} mm wide; use a wider indenter or smaller elements"
        )
    return "the indenter never touches the cover; check its position and direction"


def _search_facet(top: FacetSurface, facet: int, start: FloatArray, motion: tuple[Indenter, Pose, FloatArray]) -> float:
    """Find the smallest travel on one facet by searches in smaller and smaller squares of reference coordinates."""
    count = top.facets.shape[1]
    low, high = (-1.0, 1.0) if count == 9 else (0.0, 1.0)  # noqa: PLR2004
    half, best = 2.0 / _PARTS, np.inf
    for _ in range(_SEARCHES):
        u, v = (np.clip(np.linspace(c - half, c + half, _POINTS), low, high) for c in start)
        place = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        if count != 9:  # noqa: PLR2004
            place = place[place.sum(axis=1) <= 1]
        points = facet_shape(count, place) @ top.nodes[top.facets[facet]]
        towards = np.broadcast_to(-motion[2], points.shape)
        found = _measure_travel(points, towards, *motion)
        if found.min() < best:
            best, start = float(found.min()), place[np.argmin(found)]
        half *= _ZOOM / ((_POINTS - 1) / 2)
    return best


def _measure_travel(
    points: FloatArray, normals: FloatArray, indenter: Indenter, pose: Pose, direction: FloatArray
) -> FloatArray:
    """Measure how far the indenter moves until it meets each of k points; inf where normals look away."""
    back = np.broadcast_to(pose.vectors_to_indenter(-direction), points.shape)
    # Start far behind the points, so that an indenter that has passed a point is found too.
    far = float(np.ptp(points, axis=0).max()) * 2 + float(np.linalg.norm(pose.position - points.mean(axis=0)))
    found = measure_gaps(indenter, pose.points_to_indenter(points) - far * back, back) - far
    return np.where(normals @ direction < 0, found, np.inf)
