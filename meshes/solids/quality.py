"""Quality of solid meshes, and limits below which a mesh is refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.array import TexelArray
from meshes.array_types import FloatArray
from meshes.solids.cracks import label_parts
from meshes.solids.facets import area_vectors, facet_shape, line_shape, line_slope
from meshes.solids.solid_mesh import SolidMesh

#: Smallest accepted scaled Jacobian of hexahedra and of tetrahedra: below it an element is a sliver [-].
_LEAST_JACOBIAN = {27: 0.05, 4: 0.01}
#: Smallest accepted number of quadratic elements through the thickness [-].
LEAST_THROUGH = 1.5
#: Accepted size of a cover, the largest edge of its bounding box: outside, the unit must be wrong [m].
SIZES = (1e-3, 0.3)
#: Largest accepted distance of a texel's centre from the base along its normal, and beside the base, over the mean
#: thickness of the cover [-].
_OFF_BASE = 0.1
#: Smallest accepted cosine of the angle between a texel's normal and that of the base: 30 degrees [-].
_LEAST_COSINE = float(np.cos(np.radians(30)))
#: Sample points along each side of a facet in the search for the nearest point of the base [-].
_SAMPLES = 6
#: Number of elements whose Jacobians are computed at once, to limit the memory [-].
_BLOCK = 5000
#: Product of edge lengths in place of zero, so that a collapsed element has the scaled Jacobian 0 [m3].
_TINY = 1e-300


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Quality of a solid mesh.

    Attributes:
        kind: Kind of the elements.
        elements: Number of elements [-].
        nodes: Number of nodes [-].
        volume: Volume of the cover [m3].
        thickness: Mean thickness: volume over the mean of the areas of base and top [m].
        scaled_jacobian: Smallest scaled Jacobian of all elements: 1 for a cube or a regular tetrahedron [-].
        inverted: Number of elements with a negative Jacobian [-].
        slivers: Number of elements that are not inverted and have a scaled Jacobian below the limit [-].
        base_deviation: Largest distance of a node of the base from the wanted base surface; nan if not known [m].
        through: Mean number of elements through the thickness [-].
        faults: One line for each limit that is exceeded; empty for a mesh that can be used.
    """

    kind: str
    elements: int
    nodes: int
    volume: float
    thickness: float
    scaled_jacobian: float
    inverted: int
    slivers: int
    base_deviation: float
    through: float
    faults: tuple[str, ...]

    def require(self) -> None:
        """Raise a ValueError with one line per fault if the mesh cannot be used."""
        if self.faults:
            raise ValueError("\n".join(self.faults))

    def lines(self) -> list[str]:
        """Describe the quality in lines of text."""
        deviation = "" if np.isnan(self.base_deviation) else f", base within {1e6 * self.base_deviation:.3g} um"
        thickness = f"{1e3 * self.thickness:.3g} mm{deviation}"
        return [
            f"{self.elements} {self.kind}, {self.nodes} nodes, {self.through:.3g} elements through {thickness}",
            f"scaled Jacobian at least {self.scaled_jacobian:.3g}, {self.inverted} inverted, {self.slivers} slivers",
            *self.faults,
        ]


def check_quality(mesh: SolidMesh, *, base_deviation: float = float("nan")) -> Quality:
    """Measure the quality of a mesh and compare it with the limits; `Quality.require` refuses.

    Args:
        mesh: The mesh.
        base_deviation: Largest distance of a node of the base from the wanted surface, if known [m].

    Raises:
        ValueError: If the base or the top has no area.
    """
    jacobian = scaled_jacobians(mesh)
    least = _LEAST_JACOBIAN[mesh.cells.shape[1]]
    inverted = int((jacobian <= 0).sum())
    slivers = int((jacobian < least).sum()) - inverted
    volume = compute_volume(mesh)
    areas = [measure_area(mesh, each) for each in ("base", "top")]
    if not min(areas) > 0:
        raise ValueError("the base or the top of the mesh has no area; mesh again")
    thickness = volume / float(np.mean(areas))
    if mesh.is_hexahedral:
        through = len(mesh.cells) / len(mesh.base)
    else:  # a regular tetrahedron of edge a has the volume a^3 / (6 sqrt 2)
        through = thickness / float(np.mean(np.cbrt(6 * np.sqrt(2) * np.abs(_tetrahedron_volumes(mesh)))))
    faults = _list_faults(mesh, inverted, slivers, through)
    return Quality(
        kind="hexahedra" if mesh.is_hexahedral else "tetrahedra",
        elements=len(mesh.cells),
        nodes=len(mesh.nodes),
        volume=volume,
        thickness=thickness,
        scaled_jacobian=float(jacobian.min()),
        inverted=inverted,
        slivers=slivers,
        base_deviation=base_deviation,
        through=through,
        faults=tuple(faults),
    )


def _list_faults(mesh: SolidMesh, inverted: int, slivers: int, through: float) -> list[str]:
    """List why a mesh cannot be used, from its numbers of bad elements and of elements through the thickness."""
    count, least = len(mesh.cells), _LEAST_JACOBIAN[mesh.cells.shape[1]]
    faults = []
    if not SIZES[0] <= mesh.size <= SIZES[1]:
        faults.append(
            f"the cover would be {1e3 * mesh.size:.4g} mm long, outside {1e3 * SIZES[0]:g}..{1e3 * SIZES[1]:g} mm; "
            "state the unit of the surface (were millimetres taken for metres?)"
        )
    if inverted:
        faults.append(
            f"{inverted} of {count} elements are inverted; make the cover thinner than the radius of a concave "
            "base, let the normals point out of the base, or mesh again"
        )
    if slivers:
        faults.append(f"{slivers} of {count} elements are slivers, with a scaled Jacobian below {least:g}; mesh again")
    loose = 0 if mesh.is_hexahedral else _count_loose(mesh)
    if loose:
        faults.append(
            f"{loose} of {count} elements are not connected with the base; remove loose bodies from the "
            "surface, or give a base below each"
        )
    if not through >= LEAST_THROUGH:
        faults.append(
            f"only {np.floor(100 * through) / 100:.3g} elements through the thickness, at least {LEAST_THROUGH:g} "
            "needed; take a smaller element size"
        )
    return faults


def check_texels(mesh: SolidMesh, texels: TexelArray) -> None:
    """Check that every texel lies on the base of a mesh and looks out of it.

    Raises:
        ValueError: With one line per fault: texels beside or off the base, or normals that point elsewhere.
    """
    thickness = compute_volume(mesh) / measure_area(mesh, "base")
    along = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    u, v = np.meshgrid(along, along)
    place = np.column_stack([u.ravel(), v.ravel()])
    place = 2 * place - 1 if mesh.is_hexahedral else place[place.sum(axis=1) <= 1]
    vectors = area_vectors(mesh.nodes, mesh.base, place).reshape(-1, 3)
    points = np.einsum("qa,fac->fqc", facet_shape(mesh.base.shape[1], place), mesh.nodes[mesh.base]).reshape(-1, 3)
    area = np.linalg.norm(vectors, axis=1)
    spacing = 2 * np.sqrt(area.max()) / _SAMPLES
    off, turned = [], []
    for number, (centre, normal) in enumerate(zip(texels.centres, texels.normals, strict=True)):
        nearest = int(np.argmin(((points - centre) ** 2).sum(axis=1)))
        unit = vectors[nearest] / area[nearest]
        away = centre - points[nearest]
        height = away @ unit
        beside = np.linalg.norm(away - height * unit)
        if abs(height) > _OFF_BASE * thickness or beside > _OFF_BASE * thickness + spacing:
            off.append((number, max(abs(float(height)), float(beside))))
        elif unit @ normal < _LEAST_COSINE:
            turned.append(number)
    faults = []
    if off:
        worst = max(off, key=lambda each: each[1])
        faults.append(
            f"{len(off)} of {texels.count} texels are off the base: texel {worst[0]} by {1e3 * worst[1]:.3g} mm; check "
            "their positions, their unit and the frame, or project them onto the base"
        )
    if turned:
        faults.append(
            f"the normals of {len(turned)} of {texels.count} texels do not point out of the base there: texel "
            f"{turned[0]}; reverse or recompute them"
        )
    if faults:
        raise ValueError("\n".join(faults))


def compute_volume(mesh: SolidMesh) -> float:
    """Compute the volume of a mesh, negative if its elements are inverted [m3]."""
    if not mesh.is_hexahedral:
        return float(_tetrahedron_volumes(mesh).sum())
    points, weights = np.polynomial.legendre.leggauss(3)
    weight = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    blocks = np.array_split(mesh.cells, max(1, len(mesh.cells) // _BLOCK))
    return float(sum((np.linalg.det(_hexahedron_edges(mesh.nodes[block], points)) @ weight).sum() for block in blocks))


def measure_thickness(mesh: SolidMesh) -> float:
    """Compute the mean thickness of a cover: its volume over the area of its base [m]."""
    return compute_volume(mesh) / measure_area(mesh, "base")


def measure_area(mesh: SolidMesh, name: str) -> float:
    """Compute the area of `base`, `top` or `sides` of a mesh [m2]."""
    facets = getattr(mesh, name)
    if not mesh.is_hexahedral:
        return float(np.linalg.norm(area_vectors(mesh.nodes, facets, np.zeros((1, 2))), axis=2).sum() / 2)
    points, weights = np.polynomial.legendre.leggauss(3)
    u, v = np.meshgrid(points, points)
    lengths = np.linalg.norm(area_vectors(mesh.nodes, facets, np.column_stack([u.ravel(), v.ravel()])), axis=2)
    return float((lengths @ np.outer(weights, weights).ravel()).sum())


def scaled_jacobians(mesh: SolidMesh) -> FloatArray:
    """Compute the smallest scaled Jacobian of each element, over its nodes, shape (e,) [-].

    For hexahedra: the determinant over the product of the lengths of the edge vectors (Knupp 2000).  For tetrahedra:
    sqrt(2) times the determinant over the largest product of the three edges at a corner.
    """
    if mesh.is_hexahedral:
        out = []
        for block in np.array_split(mesh.cells, max(1, len(mesh.cells) // _BLOCK)):
            edges = _hexahedron_edges(mesh.nodes[block], np.array([-1.0, 0.0, 1.0]))
            lengths = np.maximum(np.linalg.norm(edges, axis=-1).prod(axis=-1), _TINY)
            out.append((np.linalg.det(edges) / lengths).min(axis=1))
        return np.concatenate(out)
    corner = mesh.nodes[mesh.cells]
    length = np.linalg.norm(corner[:, :, None] - corner[:, None], axis=-1)
    products = np.stack([np.delete(length[:, i], i, axis=1).prod(axis=1) for i in range(4)])
    return np.asarray(6 * np.sqrt(2) * _tetrahedron_volumes(mesh) / np.maximum(products.max(axis=0), _TINY))


def _count_loose(mesh: SolidMesh) -> int:
    """Count the elements of bodies that the base does not hold: they could move freely."""
    label = label_parts(len(mesh.nodes), mesh.cells)
    return int((~np.isin(label[mesh.cells[:, 0]], label[mesh.base])).sum())


def _tetrahedron_volumes(mesh: SolidMesh) -> FloatArray:
    """Compute the signed volume of each tetrahedron, shape (e,) [m3]."""
    corner = mesh.nodes[mesh.cells]
    edges = corner[:, 1:] - corner[:, :1]
    return np.asarray(np.linalg.det(edges) / 6)


def _hexahedron_edges(nodes: FloatArray, points: FloatArray) -> FloatArray:
    """Compute the derivatives of the position along the reference coordinates at p^3 points, shape (e, p^3, 3, 3) [m].

    Args:
        nodes: Nodes of e hexahedra, shape (e, 27, 3) [m].
        points: p points along each reference coordinate, shape (p,).
    """
    shape, slope = line_shape(points), line_slope(points)
    grid = nodes.reshape(len(nodes), 3, 3, 3, 3)  # element, k, j, i, component
    out = [
        np.einsum("zk,yj,xi,ekjic->ezyxc", *lines, grid, optimize=True)
        for lines in ((shape, shape, slope), (shape, slope, shape), (slope, shape, shape))
    ]
    return np.stack([each.reshape(len(nodes), -1, 3) for each in out], axis=2)
