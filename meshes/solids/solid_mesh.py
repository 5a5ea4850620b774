"""Solid mesh of a cover: its base, touchable top and free sides, its file, its quality and the limits on it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from types import MappingProxyType

import numpy as np

from meshes.array import TexelArray
from meshes.array_types import FloatArray, IntArray
from meshes.atomic_file import replace
from meshes.bounded_file import FileLimitError, pack_npz, parse_json, read_bytes, unpack_npz
from meshes.solids.facets import QUADRILATERAL, TRIANGLE, area_vectors, facet_shape, line_shape, line_slope
from meshes.surfaces.triangles import label_parts

#: Number of nodes of a hexahedron [-].
HEXAHEDRON = 27
#: Number of nodes of a tetrahedron [-].
TETRAHEDRON = 4
#: Number of nodes of a facet of an element, by the number of nodes of the element [-].
_FACET_NODES = {HEXAHEDRON: QUADRILATERAL, TETRAHEDRON: TRIANGLE}
#: Names of the arrays of a mesh.
ARRAYS = ("nodes", "cells", "base", "top", "sides")
#: Version of the file format.
_FORMAT = "softcover-mesh 1"
#: Type of the value of a setting from which a mesh was made, for example the element size.
Setting = str | float | int | bool


@dataclass(frozen=True, kw_only=True)
class MeshLimits:
    """Limits on meshes, and numbers of the measures of their quality."""

    #: Largest mesh file [bytes]; far above a mesh that can be solved.
    file_bytes: int = 2**30
    #: Smallest accepted scaled Jacobian of a hexahedron [-].  Below it an element is a sliver, by the error of test
    #: meshes.
    hexahedron_jacobian: float = 0.05
    #: Smallest accepted scaled Jacobian of a tetrahedron [-].  Below it an element is a sliver, by the error of test
    #: meshes.
    tetrahedron_jacobian: float = 0.01
    #: Smallest number of quadratic elements through the thickness [-]; with fewer the error estimates do not hold.
    through: float = 1.5
    #: Smallest and largest accepted length of a cover's largest edge [m].  Other lengths indicate a wrong unit.
    sizes: tuple[float, float] = (1e-3, 0.3)
    #: Largest distance of a texel's centre from the nearest point of the base, along the normal and across it, over the
    #: mean thickness [-]; chosen by judgement.
    off_base: float = 0.1
    #: Smallest cosine of the angle between a texel's normal and that of the base [-]; 30 degrees, chosen by judgement.
    cosine: float = float(np.cos(np.radians(30)))
    #: Sample points along each side of a facet in the search for the nearest point of the base [-]; chosen by
    #: judgement.
    samples: int = 6
    #: Number of elements whose Jacobians are computed at once [-]; limits the memory to some 100 MB.
    block: int = 5000
    #: Product of edge lengths in place of zero, so that a collapsed element has the scaled Jacobian 0 [m3].
    tiny: float = 1e-300


LIMITS = MeshLimits()


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidMesh:
    """Solid mesh of a cover.

    Elements are hexahedra of 27 nodes with quadratic geometry, or tetrahedra of 4 nodes.  The nodes of a hexahedron are
    in lexicographic order: node i + 3 j + 9 k at (i, j, k) of 3 x 3 x 3, with k from base to top in swept meshes.
    Facets are quadrilaterals of 9 nodes or triangles of 3.  The normals of top and sides point out of the cover.  Those
    of the base point into it, as the normals of the texels do.

    Attributes:
        nodes: Positions of the n nodes, shape (n, 3) [m].
        cells: Indices of the nodes of each of e elements, shape (e, 27) or (e, 4).
        base: Facets that are bonded to the rigid base, shape (b, 9) or (b, 3).
        top: Facets that an indenter can touch, shape (t, 9) or (t, 3).
        sides: All other facets of the surface, shape (s, 9) or (s, 3).
        source: Origin of the mesh, in words.
        settings: Settings of the mesh.
    """

    nodes: FloatArray
    cells: IntArray
    base: IntArray
    top: IntArray
    sides: IntArray
    source: str
    settings: Mapping[str, Setting] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only.

        Raises:
            ValueError: If shapes disagree, an index is out of range, or base or top is empty.
        """
        if self.nodes.ndim != 2 or self.nodes.shape[1] != 3 or not np.isfinite(self.nodes).all():  # noqa: PLR2004
            raise ValueError("the nodes of a mesh must be finite and have the shape (n, 3)")
        if self.cells.ndim != 2 or self.cells.shape[1] not in _FACET_NODES or not len(self.cells):  # noqa: PLR2004
            raise ValueError("a mesh needs hexahedra of 27 nodes or tetrahedra of 4 nodes")
        for name in ("base", "top", "sides"):
            facets = getattr(self, name)
            if facets.ndim != 2 or facets.shape[1] != _FACET_NODES[self.cells.shape[1]]:  # noqa: PLR2004
                raise ValueError(f"the facets of the {name} do not fit the elements")
            if name != "sides" and not len(facets):
                raise ValueError(f"the mesh has no {name}")
        every = np.concatenate([getattr(self, name).ravel() for name in ARRAYS[1:]])
        if every.min() < 0 or every.max() >= len(self.nodes):
            raise ValueError("the mesh refers to a node that it does not have")
        for values in self.arrays.values():
            values.setflags(write=False)
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))

    @property
    def is_hexahedral(self) -> bool:
        """Whether the elements are hexahedra."""
        return bool(self.cells.shape[1] == HEXAHEDRON)

    @property
    def arrays(self) -> dict[str, FloatArray | IntArray]:
        """The arrays of the mesh by their names: nodes, cells, base, top and sides."""
        return {name: getattr(self, name) for name in ARRAYS}

    @cached_property
    def digest(self) -> str:
        """Hash of all arrays, the source and the settings: two meshes are equal if their hashes are."""
        hasher = hashlib.sha256(json.dumps([self.source, dict(self.settings)], sort_keys=True).encode())
        for values in self.arrays.values():
            hasher.update(str((values.shape, values.dtype.str)).encode())
            hasher.update(np.ascontiguousarray(values).tobytes())
        return hasher.hexdigest()

    @property
    def size(self) -> float:
        """Largest edge of the bounding box [m]."""
        return float(np.ptp(self.nodes, axis=0).max())


def write_mesh(path: Path, mesh: SolidMesh) -> None:
    """Write a mesh with its source, settings and hash to an npz file.

    Raises:
        OSError: If the file cannot be written.
    """
    about = {"format": _FORMAT, "digest": mesh.digest, "source": mesh.source, "settings": dict(mesh.settings)}
    replace(path, [pack_npz({**mesh.arrays, "about": np.array(json.dumps(about))})])


def read_mesh(path: Path) -> SolidMesh:
    """Read a mesh from a file of `write_mesh`, and compare it with its hash.

    Raises:
        ValueError: If the file cannot be read, is no mesh, or was changed after it was written.
    """
    try:
        arrays = unpack_npz(read_bytes(path, most=LIMITS.file_bytes), most=LIMITS.file_bytes)
        about = parse_json(str(arrays["about"]))
        for name in ARRAYS:
            if arrays[name].dtype.kind not in ("f" if name == "nodes" else "iu"):
                raise FileLimitError(f"has {name} of type {arrays[name].dtype}")  # noqa: TRY301 -- reported below
        if about["format"] != _FORMAT:
            raise ValueError(f"{path.name} is a mesh of another version: {str(about['format'])[:40]!r}")
        mesh = SolidMesh(
            nodes=arrays["nodes"].astype(np.float64),
            **{name: arrays[name].astype(np.int64) for name in ARRAYS[1:]},
            source=str(about["source"]),
            settings=about["settings"],
        )
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}; give the path of a mesh file") from None
    except FileLimitError as error:
        raise ValueError(f"{path.name} {error}; give a mesh file of softcover") from None
    except (KeyError, TypeError, AttributeError):
        raise ValueError(f"{path.name} is no mesh file of softcover") from None
    if mesh.digest != about.get("digest"):
        raise ValueError(f"{path.name} was changed after it was written: its content does not have the hash it states")
    return mesh


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
    through: float
    faults: tuple[str, ...]

    def require(self) -> None:
        """Raise a ValueError if the quality of the mesh exceeds a limit, with one line per fault."""
        if self.faults:
            raise ValueError("\n".join(self.faults))

    def lines(self) -> list[str]:
        """Describe the quality in lines of text."""
        thickness = f"{1e3 * self.thickness:.3g} mm"
        return [
            f"{self.elements} {self.kind}, {self.nodes} nodes, {self.through:.3g} elements through {thickness}",
            f"scaled Jacobian at least {self.scaled_jacobian:.3g}, {self.inverted} inverted, {self.slivers} slivers",
            *self.faults,
        ]


@lru_cache(maxsize=4)
def check_quality(mesh: SolidMesh) -> Quality:
    """Measure the quality of a mesh and compare it with the limits; `Quality.require` raises an error for faults.

    Raises:
        ValueError: If the base or the top has no area.
    """
    jacobian = scaled_jacobians(mesh)
    least = LIMITS.hexahedron_jacobian if mesh.is_hexahedral else LIMITS.tetrahedron_jacobian
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
    faults, (low, high) = [], LIMITS.sizes
    if not low <= mesh.size <= high:
        faults.append(
            f"the cover would be {1e3 * mesh.size:.4g} mm long, outside {1e3 * low:g}..{1e3 * high:g} mm; "
            "state the unit of the surface (were millimetres taken for metres?)"
        )
    if inverted:
        faults.append(
            f"{inverted} of {len(mesh.cells)} elements are inverted; make the cover thinner than the radius of a "
            "concave base, let the normals point out of the base, or mesh again"
        )
    if slivers:
        faults.append(
            f"{slivers} of {len(mesh.cells)} elements are slivers, with a scaled Jacobian below {least:g}; mesh again"
        )
    if loose := 0 if mesh.is_hexahedral else _count_loose(mesh):
        faults.append(
            f"{loose} of {len(mesh.cells)} elements are not connected with the base; remove loose bodies from the "
            "surface, or give a base below each"
        )
    if not through >= LIMITS.through:
        faults.append(
            f"only {np.floor(100 * through) / 100:.3g} elements through the thickness, at least {LIMITS.through:g} "
            "needed; take a smaller element size"
        )
    return Quality(
        kind="hexahedra" if mesh.is_hexahedral else "tetrahedra",
        elements=len(mesh.cells),
        nodes=len(mesh.nodes),
        volume=volume,
        thickness=thickness,
        scaled_jacobian=float(jacobian.min()),
        inverted=inverted,
        slivers=slivers,
        through=through,
        faults=tuple(faults),
    )


def check_texels(mesh: SolidMesh, texels: TexelArray) -> None:
    """Check that every texel lies on the base of a mesh and faces out of the base.

    Raises:
        ValueError: With one line per fault: texels beside or off the base, or normals that point elsewhere.
    """
    thickness = measure_thickness(mesh)
    along = (np.arange(LIMITS.samples) + 0.5) / LIMITS.samples
    u, v = np.meshgrid(along, along)
    place = np.column_stack([u.ravel(), v.ravel()])
    place = 2 * place - 1 if mesh.is_hexahedral else place[place.sum(axis=1) <= 1]
    vectors = area_vectors(mesh.nodes, mesh.base, place).reshape(-1, 3)
    points = np.einsum("qa,fac->fqc", facet_shape(mesh.base.shape[1], place), mesh.nodes[mesh.base]).reshape(-1, 3)
    area = np.linalg.norm(vectors, axis=1)
    spacing = 2 * np.sqrt(area.max()) / LIMITS.samples
    nearest = np.array([((points - centre) ** 2).sum(axis=1).argmin() for centre in texels.centres])
    units, away = vectors[nearest] / area[nearest, None], texels.centres - points[nearest]
    height = np.einsum("nc,nc->n", away, units)
    beside = np.linalg.norm(away - height[:, None] * units, axis=1)
    allowed = LIMITS.off_base * thickness
    off = (np.abs(height) > allowed) | (beside > allowed + spacing)
    turned = ~off & (np.einsum("nc,nc->n", units, texels.normals) < LIMITS.cosine)
    faults = []
    if off.any():
        distance = np.where(off, np.maximum(np.abs(height), beside), 0.0)
        worst = int(distance.argmax())
        faults.append(
            f"{off.sum()} of {texels.count} texels are off the base: texel {worst} by {1e3 * distance[worst]:.3g} mm; "
            "check their positions, their unit and the frame, or project them onto the base"
        )
    if turned.any():
        faults.append(
            f"the normals of {turned.sum()} of {texels.count} texels do not point out of the base there: texel "
            f"{turned.argmax()}; reverse or recompute them"
        )
    if faults:
        raise ValueError("\n".join(faults))


def compute_volume(mesh: SolidMesh) -> float:
    """Compute the volume of a mesh, negative if its elements are inverted [m3]."""
    if not mesh.is_hexahedral:
        return float(_tetrahedron_volumes(mesh).sum())
    points, weights = np.polynomial.legendre.leggauss(3)
    weight = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    blocks = np.array_split(mesh.cells, max(1, len(mesh.cells) // LIMITS.block))
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
        for block in np.array_split(mesh.cells, max(1, len(mesh.cells) // LIMITS.block)):
            edges = _hexahedron_edges(mesh.nodes[block], np.array([-1.0, 0.0, 1.0]))
            lengths = np.maximum(np.linalg.norm(edges, axis=-1).prod(axis=-1), LIMITS.tiny)
            out.append((np.linalg.det(edges) / lengths).min(axis=1))
        return np.concatenate(out)
    corner = mesh.nodes[mesh.cells]
    length = np.linalg.norm(corner[:, :, None] - corner[:, None], axis=-1)
    products = np.stack([np.delete(length[:, i], i, axis=1).prod(axis=1) for i in range(4)])
    return np.asarray(6 * np.sqrt(2) * _tetrahedron_volumes(mesh) / np.maximum(products.max(axis=0), LIMITS.tiny))


def _count_loose(mesh: SolidMesh) -> int:
    """Count the elements of bodies that have no facet on the base and could therefore move freely."""
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
    grid = nodes.reshape(len(nodes), 3, 3, 3, 3)  # indices: element, node along each of k, j and i, component
    out = [
        np.einsum("zk,yj,xi,ekjic->ezyxc", *lines, grid, optimize=True)
        for lines in ((shape, shape, slope), (shape, slope, shape), (slope, shape, shape))
    ]
    return np.stack([each.reshape(len(nodes), -1, 3) for each in out], axis=2)
