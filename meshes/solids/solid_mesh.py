"""Solid mesh of a cover: its bonded base, touchable top and left-out faces, its file, its quality and limits on it."""

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
from meshes.array_types import BoolArray, FloatArray, IntArray
from meshes.atomic_file import replace
from meshes.bounded_file import FileLimitError, pack_npz, parse_json, read_bytes, unpack_npz
from meshes.layer import ONE_LAYER, Layers, scale_layers
from meshes.solids.facets import (
    QUADRATIC_TRIANGLE,
    QUADRILATERAL,
    area_vectors,
    facet_shape,
    line_shape,
    line_slope,
    split_facet,
    split_triangles,
)
from meshes.surfaces.triangles import label_parts, nearest_points, normal_vectors, unit_vectors

#: Number of nodes of a hexahedron [-].
HEXAHEDRON = 27
#: Number of nodes of a tetrahedron [-].
TETRAHEDRON = 10
#: Number of nodes of a facet of an element, by the number of nodes of the element [-].
_FACET_NODES = {HEXAHEDRON: QUADRILATERAL, TETRAHEDRON: QUADRATIC_TRIANGLE}
#: Names of the arrays of a mesh.
ARRAYS = ("nodes", "cells", "base", "top", "left_out")
#: Corners of a tetrahedron at the ends of its six edges, in the order of their middle nodes 4 to 9.
EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
#: Barycentric coordinates of the nodes of a tetrahedron, shape (10, 4).
_CORNERS_AND_MIDDLES = np.concatenate([np.eye(4), np.eye(4)[EDGES].mean(axis=1)])
#: Version of the file format.
_FORMAT = "softcover-mesh 2"
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
    #: Smallest number of quadratic elements through the thickness [-]; with fewer the error estimates do not hold.  Of
    #: a mesh that stands beside its refinement, half as many.
    through: float = 1.5
    #: Smallest and largest accepted length of a cover's largest edge [m].  Other lengths indicate a wrong unit.
    sizes: tuple[float, float] = (1e-3, 0.3)
    #: Largest distance of edges of elements from the interface between two layers, over the thickness [-].
    off_interface: float = 1e-3
    #: Smallest thickness of a layer over that of the cover [-]; foils of 2.5 % were compared with flat covers.
    thinnest: float = 0.024
    #: Largest distance of a texel's centre from the base, over the mean thickness [-]; chosen by judgement.
    off_base: float = 0.1
    #: Smallest cosine of the angle between a texel's normal and that of the base [-]; 30 degrees, chosen by judgement.
    cosine: float = float(np.cos(np.radians(30)))
    #: Largest number of texels that a message names [-].
    named: int = 20
    #: Number of elements whose Jacobians are computed at once [-]; limits the memory to some 100 MB.
    block: int = 5000
    #: Product of edge lengths in place of zero, so that a collapsed element has the scaled Jacobian 0 [m3].
    tiny: float = 1e-300


LIMITS = MeshLimits()


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidMesh:
    """Solid mesh of a cover.

    Elements have quadratic geometry: hexahedra of 27 nodes or tetrahedra of 10.  The nodes of a hexahedron are in
    lexicographic order: node i + 3 j + 9 k at (i, j, k) of 3 x 3 x 3, with k from base to top in swept meshes.  Nodes 4
    to 9 of a tetrahedron are the middles of its `EDGES`.  Facets are quadrilaterals of 9 nodes or triangles of 6.
    Every facet of the surface belongs to base, top or left_out.  The normals of top and left_out point out of the
    cover.  Those of the base point into it, as the normals of the texels do.

    Attributes:
        nodes: Positions of the n nodes, shape (n, 3) [m].
        cells: Indices of the nodes of each of e elements, shape (e, 27) or (e, 10).
        base: Facets that are bonded to the rigid base, shape (b, 9) or (b, 6).
        top: Facets that an indenter can touch: all that are not bonded or left out, shape (t, 9) or (t, 6).
        left_out: Free facets that no indenter touches, for example a mounting face, shape (s, 9) or (s, 6).
        source: Origin of the mesh, in words.
        settings: Settings of the mesh.
    """

    nodes: FloatArray
    cells: IntArray
    base: IntArray
    top: IntArray
    left_out: IntArray
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
            raise ValueError("a mesh needs hexahedra of 27 nodes or tetrahedra of 10 nodes")
        for name in ARRAYS[2:]:
            facets = getattr(self, name)
            if facets.ndim != 2 or facets.shape[1] != _FACET_NODES[self.cells.shape[1]]:  # noqa: PLR2004
                raise ValueError(f"the facets of the {name} do not fit the elements")
            if name != "left_out" and not len(facets):
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
        """The arrays of the mesh by their names: nodes, cells, base, top and left_out."""
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
    def geometry_error(self) -> float:
        """Distance of the surface from the body that it stands for, as estimated by the maker of the mesh [m]."""
        return float(self.settings.get("geometry_error", 0.0))

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
        if about["format"] != _FORMAT:
            raise ValueError(
                f"{path.name} is a mesh of another version: {str(about['format'])[:40]!r}; mesh the cover again"
            )
        for name in ARRAYS:
            if arrays[name].dtype.kind not in ("f" if name == "nodes" else "iu"):
                raise FileLimitError(f"has {name} of type {arrays[name].dtype}")  # noqa: TRY301 -- reported below
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
        thickness: Median height of the top above the base [m].
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


def describe_size(length: float, name: str) -> str:
    """Return what is wrong with the length of a body [m], in words; empty if it lies within the limits."""
    low, high = LIMITS.sizes
    if low <= length <= high:
        return ""
    return (
        f"{name} would be {1e3 * length:.4g} mm long, outside {1e3 * low:g}..{1e3 * high:g} mm; state the unit of the "
        "surface (were millimetres taken for metres?)"
    )


def assign_layers(mesh: SolidMesh, layers: Layers) -> IntArray:
    """Return the index of the layer in which each element lies, or of the first layer of its material, shape (e,).

    Args:
        mesh: Mesh of the cover.
        layers: Material of the cover, or its layers.

    Raises:
        ValueError: If there are several layers and one is too thin, or the mesh is not swept or has no edges of
            elements between them.
    """
    given = scale_layers(layers, 1.0)
    ends = np.cumsum([each.thickness for each in given])
    if len(ends) == 1:
        return np.zeros(len(mesh.cells), dtype=np.int64)
    if min(each.thickness for each in given) < LIMITS.thinnest:
        raise ValueError(
            f"{mesh.source}: a layer is thinner than {100 * LIMITS.thinnest:g} % of the cover, below which elements "
            "are not tested; make it thicker, or leave it out"
        )
    rows = len(mesh.cells) // len(mesh.base)
    if not mesh.is_hexahedral or rows * len(mesh.base) != len(mesh.cells):
        raise ValueError(f"{mesh.source}: it has one layer, not {len(ends)}: {ONE_LAYER}")
    below, above = (mesh.nodes[mesh.cells[:, node]].reshape(rows, -1, 3) for node in (4, 22))
    height = np.cumsum(np.linalg.norm(above - below, axis=2), axis=0)
    height /= height[-1]
    for end in ends:
        if np.abs(height - end).min(axis=0).max() > LIMITS.off_interface:
            raise ValueError(
                f"{mesh.source}: no edges of elements lie at {100 * end:.4g} % of the thickness, between two layers; "
                "sweep the mesh with these interfaces"
            )
    materials = [each.material for each in given]
    first = np.array([materials.index(each) for each in materials])
    return np.repeat(first[np.searchsorted(ends, height.mean(axis=1) - LIMITS.off_interface)], len(mesh.base))


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
    if not min(measure_area(mesh, each) for each in ("base", "top")) > 0:
        raise ValueError("the base or the top of the mesh has no area; mesh again")
    thickness = measure_height(mesh)
    if mesh.is_hexahedral:
        through = len(mesh.cells) / len(mesh.base)
    else:  # a regular tetrahedron of edge a has the volume a^3 / (6 sqrt 2)
        corner = mesh.nodes[mesh.cells[:, :4]]
        each = np.abs(np.linalg.det(corner[:, 1:] - corner[:, :1]))
        through = thickness / float(np.mean(np.cbrt(np.sqrt(2) * each)))
    faults = [fault] if (fault := describe_size(mesh.size, "the cover")) else []
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
    needed = LIMITS.through / (2 if mesh.settings.get("refined") == 0 else 1)
    if not through >= needed:
        faults.append(
            f"only {np.floor(100 * through) / 100:.3g} elements through the thickness, at least {needed:g} "
            "needed; take a smaller element size"
        )
    return Quality(
        kind="hexahedra" if mesh.is_hexahedral else "tetrahedra",
        elements=len(mesh.cells),
        nodes=len(mesh.nodes),
        volume=compute_volume(mesh),
        thickness=thickness,
        scaled_jacobian=float(jacobian.min()),
        inverted=inverted,
        slivers=slivers,
        through=through,
        faults=tuple(faults),
    )


def check_texels(mesh: SolidMesh, texels: TexelArray) -> None:
    """Check that every texel lies on the base of a mesh and faces out of the base; see `check_on_base`."""
    check_on_base(mesh.nodes[split_triangles(mesh.base)], measure_thickness(mesh), texels)


def check_on_base(base: FloatArray, thickness: float, texels: TexelArray) -> None:
    """Check that every texel lies on a base and faces out of the base.

    Args:
        base: Triangles of the base, facing into the cover, shape (b, 3, 3) [m].
        thickness: Mean thickness of the cover [m].
        texels: The texels.

    Raises:
        ValueError: With one line per fault: texels off the base, or normals that point elsewhere.
    """
    nearest, owner = nearest_points(texels.centres, base)
    distance = np.linalg.norm(nearest - texels.centres, axis=1)
    off = distance > LIMITS.off_base * thickness
    units = unit_vectors(normal_vectors(base))[owner]
    turned = ~off & (np.einsum("nc,nc->n", units, texels.normals) < LIMITS.cosine)
    faults = []
    if off.any():
        worst = int(distance.argmax())
        faults.append(
            f"{off.sum()} of {texels.count} texels are off the base: {_list_texels(off)}, texel {worst} by "
            f"{1e3 * distance[worst]:.3g} mm; leave them out, check their positions, their unit and the frame, or "
            "project them onto the base (project = true)"
        )
    if turned.any():
        faults.append(
            f"the normals of {turned.sum()} of {texels.count} texels do not point out of the base there: "
            f"{_list_texels(turned)}; leave them out, move them away from the edge of the base, or reverse the normals"
        )
    if faults:
        raise ValueError("\n".join(faults))


def _list_texels(chosen: BoolArray) -> str:
    """List the numbers of chosen texels in words, at most twenty of them."""
    numbers = np.flatnonzero(chosen)
    more = f" and {len(numbers) - LIMITS.named} more" if len(numbers) > LIMITS.named else ""
    return f"{', '.join(map(str, numbers[: LIMITS.named]))}{more}"


def compute_volume(mesh: SolidMesh) -> float:
    """Compute the volume of a mesh, negative if its elements are inverted [m3]."""
    points, weights = np.polynomial.legendre.leggauss(3)
    weight = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    if not mesh.is_hexahedral:  # exact for cubic functions (Keast 1986)
        points = np.concatenate([np.full((1, 4), 1 / 4), np.full((4, 4), 1 / 6) + np.eye(4) / 3])
        weight = np.array([-4 / 5, *[9 / 20] * 4]) / 6
    blocks = np.array_split(mesh.cells, max(1, len(mesh.cells) // LIMITS.block))
    return float(sum((np.linalg.det(_edge_vectors(mesh.nodes[block], points)) @ weight).sum() for block in blocks))


def measure_thickness(mesh: SolidMesh) -> float:
    """Compute the mean thickness of a cover: its volume over the area of its base [m]."""
    return compute_volume(mesh) / measure_area(mesh, "base")


def measure_height(mesh: SolidMesh) -> float:
    """Compute the median distance of the top from the base, weighted by area [m]."""
    place = np.full((1, 2), 0.0 if mesh.is_hexahedral else 1 / 3)
    middle = np.einsum("a,fac->fc", facet_shape(mesh.top.shape[1], place)[0], mesh.nodes[mesh.top])
    area = np.linalg.norm(area_vectors(mesh.nodes, mesh.top, place)[:, 0], axis=1)
    nearest, _ = nearest_points(middle, mesh.nodes[split_triangles(mesh.base)])
    height = np.linalg.norm(middle - nearest, axis=1)
    order = np.argsort(height)
    share = np.cumsum(area[order])
    return float(height[order[np.searchsorted(share, share[-1] / 2)]])


def measure_area(mesh: SolidMesh, name: str) -> float:
    """Compute the area of `base`, `top` or `left_out` of a mesh [m2]."""
    facets = getattr(mesh, name)
    if not mesh.is_hexahedral:
        place = split_facet(QUADRATIC_TRIANGLE, 2)[1].reshape(-1, 2)
        return float(np.linalg.norm(area_vectors(mesh.nodes, facets, place), axis=2).mean(axis=1).sum() / 2)
    points, weights = np.polynomial.legendre.leggauss(3)
    u, v = np.meshgrid(points, points)
    lengths = np.linalg.norm(area_vectors(mesh.nodes, facets, np.column_stack([u.ravel(), v.ravel()])), axis=2)
    return float((lengths @ np.outer(weights, weights).ravel()).sum())


def scaled_jacobians(mesh: SolidMesh) -> FloatArray:
    """Compute the smallest scaled Jacobian of each element, over its nodes, shape (e,) [-].

    For hexahedra: the determinant over the product of the lengths of the edge vectors (Knupp 2000).  For tetrahedra:
    sqrt(2) times the determinant over the largest product of the three straight edges at a corner.
    """
    out = []
    for block in np.array_split(mesh.cells, max(1, len(mesh.cells) // LIMITS.block)):
        if mesh.is_hexahedral:
            edges = _edge_vectors(mesh.nodes[block], np.array([-1.0, 0.0, 1.0]))
            lengths = np.linalg.norm(edges, axis=-1).prod(axis=-1)
        else:
            edges = np.sqrt(2) ** (1 / 3) * _edge_vectors(mesh.nodes[block], _CORNERS_AND_MIDDLES)
            corner = mesh.nodes[block[:, :4]]
            length = np.linalg.norm(corner[:, :, None] - corner[:, None], axis=-1) + np.eye(4)
            lengths = length.prod(axis=-1).max(axis=1, keepdims=True)
        out.append((np.linalg.det(edges) / np.maximum(lengths, LIMITS.tiny)).min(axis=1))
    return np.concatenate(out)


def _count_loose(mesh: SolidMesh) -> int:
    """Count the elements of bodies that have no facet on the base and could therefore move freely."""
    label = label_parts(len(mesh.nodes), mesh.cells)
    return int((~np.isin(label[mesh.cells[:, 0]], label[mesh.base])).sum())


def _edge_vectors(nodes: FloatArray, points: FloatArray) -> FloatArray:
    """Compute the derivatives of the position along the reference coordinates at p points, shape (e, p, 3, 3) [m].

    Args:
        nodes: Nodes of e hexahedra, shape (e, 27, 3), or tetrahedra, shape (e, 10, 3) [m].
        points: Hexahedra: points along each reference coordinate, p^(1/3) of them.  Tetrahedra: barycentric
            coordinates, shape (p, 4).
    """
    if nodes.shape[1] == TETRAHEDRON:
        slope = np.zeros((len(points), 4, TETRAHEDRON))  # along the barycentric coordinates
        slope[:, np.arange(4), np.arange(4)] = 4 * points - 1
        for number, (one, other) in enumerate(EDGES, start=4):
            slope[:, one, number], slope[:, other, number] = 4 * points[:, other], 4 * points[:, one]
        return np.asarray(np.einsum("pra,eac->eprc", slope[:, 1:] - slope[:, :1], nodes, optimize=True))
    shape, slope = line_shape(points), line_slope(points)
    grid = nodes.reshape(len(nodes), 3, 3, 3, 3)  # indices: element, node along each of k, j and i, component
    out = [
        np.einsum("zk,yj,xi,ekjic->ezyxc", *lines, grid, optimize=True)
        for lines in ((shape, shape, slope), (shape, slope, shape), (slope, shape, shape))
    ]
    return np.stack([each.reshape(len(nodes), -1, 3) for each in out], axis=2)
