"""Fill the closed surface of a cover with tetrahedra by fTetWild (Hu et al. 2020), and refine their meshes.

The mesher gives a different mesh at each call.  Callers therefore store the coarsest mesh and treat it as an input; the
spread of results over several meshes is the numerical noise of the results.  Finer meshes are its regular refinements:
the elements of one body at sizes of the ratio 2.  The mesher runs in a process and a folder of its own, because it
writes a file into its working folder and may crash on bad surfaces.

Each facet of a mesh has the label of the nearest triangle of the surface that was meshed: bonded, touchable or left
out.  Its corners and the middles of its edges are moved onto that part of the surface.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from meshes.array_types import FloatArray, IntArray
from meshes.solids.facets import facet_shape
from meshes.solids.shell import BONDED, LEFT_OUT, Shell
from meshes.solids.solid_mesh import (
    EDGES,
    LIMITS,
    TETRAHEDRON,
    Setting,
    SolidMesh,
    describe_size,
    scaled_jacobians,
)
from meshes.surfaces.triangles import check_closed, enclosed_volume, merge_corners, nearest_points, normal_vectors


@dataclass(frozen=True, kw_only=True)
class _Numbers:
    """Constants of meshes of tetrahedra."""

    #: Largest distance between the surfaces of the mesher's mesh and of the cover, over the cover's thickness [-];
    #: chosen by judgement.
    envelope: float = 1 / 25
    #: Smallest and largest element size over the size for the mean thickness [-]; chosen by judgement.  The first
    #: bounds the number of elements where the cover thins out, as at the edges of the bond.
    share: tuple[float, float] = (0.5, 1.5)
    #: Spacing of the points at which the mesher is given an element size, over the element size, and their largest
    #: number [-].
    sizes: tuple[float, int] = (0.7, 20_000)
    #: Largest time in which the mesher must finish a mesh [s]; chosen by judgement.
    seconds: int = 900


_NUMBERS = _Numbers()
#: Mean volume of the mesher's tetrahedra over the cube of the element size [-]; half of that of a regular one.
_VOLUME = 1 / (12 * np.sqrt(2))
#: Program of the mesher's process.  It reads the surface and writes the mesh in the current folder.
_PROGRAM = """
import numpy, pytetwild
given = numpy.load("surface.npz")
nodes, cells = pytetwild.tetrahedralize(given["points"], given["faces"].astype(numpy.int32), vtk_ordering=True,
    edge_length_abs=float(given["edge"]), epsilon=float(given["epsilon"]), num_threads=1,
    bg_vertices=given["places"], bg_tets=given["around"].astype(numpy.int32), bg_values=given["sizes"])
numpy.savez("mesh.npz", nodes=nodes, cells=cells)
"""
#: Corners of the six tetrahedra of a cube, in the binary order of its corners (Kuhn).
_KUHN = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])
#: Nodes of the facets of a tetrahedron of 10 nodes, which face outwards: corners and middles of their sides.
_FACETS = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6]])
#: Nodes of a tetrahedron that are the corners of its parts: four at its corners, and four around each diagonal of the
#: octahedron between them.
_AT_CORNERS = [[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3]]
_AROUND = {
    (6, 8): [[6, 8, 4, 5], [6, 8, 5, 9], [6, 8, 9, 7], [6, 8, 7, 4]],
    (4, 9): [[4, 9, 5, 6], [4, 9, 6, 7], [4, 9, 7, 8], [4, 9, 8, 5]],
    (5, 7): [[5, 7, 4, 6], [5, 7, 6, 9], [5, 7, 9, 8], [5, 7, 8, 4]],
}


def fill_with_tetrahedra(shell: Shell, element_size: float, *, name: str = "the surface") -> SolidMesh:
    """Mesh the inside of the closed surface of a cover; element sizes follow the local thickness.

    Args:
        shell: Surface of the cover with its labels.
        element_size: Wanted edge length of the tetrahedra where the cover has its mean thickness [m].
        name: Name of the surface in messages.

    Raises:
        ValueError: If the surface is open, inside out or intersects itself, or the mesher fails.
        ModuleNotFoundError: If pytetwild is not installed.
    """
    surface = np.asarray(shell.surface, dtype=float)
    check_closed(surface, name, crossings=not shell.is_folded)
    if fault := describe_size(float(np.ptp(surface, axis=(0, 1)).max()), name):
        raise ValueError(fault)
    if find_spec("pytetwild") is None:
        raise ModuleNotFoundError(
            "tetrahedral meshes need pytetwild; run in a clone of softcover: python -m pip install -e '.[curved]'",
            name="pytetwild",
        )
    nodes, cells = _run_mesher(shell, element_size, _NUMBERS.envelope * shell.thickness, name)
    settings: dict[str, Setting] = {
        "element_size": float(element_size),
        "envelope": _NUMBERS.envelope * shell.thickness,
        "surface": _hash(surface),
        "labels": _hash(shell.label),
        "refined": 0,
    }
    used, place = np.unique(cells, return_inverse=True)
    cells = orient_tetrahedra(nodes[used], place.reshape(-1, 4).astype(np.int64))
    return _fit(nodes[used], cells, shell, settings)


def _fit(nodes: FloatArray, cells: IntArray, shell: Shell, settings: dict[str, Setting]) -> SolidMesh:
    """Move the surface of straight tetrahedra onto a shell, as far as no element inverts, and label its facets."""
    facets = list_boundary(cells)
    label = shell.label[nearest_points(nodes[facets].mean(axis=1), shell.surface)[1]]
    straight = label_mesh(nodes, cells, label, source="tetrahedra", settings=settings)
    wanted = np.array(straight.nodes)
    bonded = shell.label == BONDED
    for part, chosen in ((straight.top, ~bonded), (straight.left_out, ~bonded), (straight.base, bonded)):
        inner = np.unique(part)
        wanted[inner] = nearest_points(wanted[inner], shell.surface[chosen])[0]
    move = wanted - straight.nodes
    mesh = replace(straight, nodes=wanted)
    for step in (0.5, 0.5, 0.5, 0.0):
        bad = scaled_jacobians(mesh) < 2 * LIMITS.tetrahedron_jacobian
        if not bad.any():
            break
        move[np.unique(mesh.cells[bad])] *= step
        mesh = replace(straight, nodes=straight.nodes + move)
    place = np.array([[1, 1], [1, 0], [0, 1], [2, 1], [1, 2], [2, 2]]) / 4.0
    outer = np.concatenate([mesh.top, mesh.left_out])
    points = np.einsum("qa,fac->fqc", facet_shape(outer.shape[1], place), mesh.nodes[outer]).reshape(-1, 3)
    away = np.linalg.norm(nearest_points(points, shell.surface)[0] - points, axis=1)
    error = float(np.quantile(away, 0.99)) + shell.geometry_error
    return replace(mesh, settings={**settings, "geometry_error": error, "smooth": shell.is_smooth})


def label_mesh(
    nodes: FloatArray, cells: IntArray, label: IntArray, *, source: str, settings: Mapping[str, Setting]
) -> SolidMesh:
    """Make a mesh of straight tetrahedra whose boundary has labels.

    Args:
        nodes: Positions of the nodes, shape (n, 3) [m].
        cells: Indices of the corners of each tetrahedron, with positive volumes, shape (e, 4).
        label: Label of each facet of `list_boundary`, shape (f,).
        source: Source of the mesh.
        settings: Settings of the mesh.

    Raises:
        ValueError: If no facet is bonded, or none can be touched.
    """
    nodes, cells = _add_middles(nodes, cells, nodes[cells[:, EDGES]].mean(axis=2))
    facets = list_boundary(cells)
    base = facets[label == BONDED]
    top = facets[(label != BONDED) & (label != LEFT_OUT)]
    if not len(base) or not len(top):
        what = "lies on the base" if not len(base) else "can be touched: all is bonded or left out"
        raise ValueError(f"no part of the surface {what}; check base, left_out, frame and unit")
    return SolidMesh(
        nodes=nodes,
        cells=cells,
        base=base[:, [0, 2, 1, 5, 4, 3]],
        top=top,
        left_out=facets[label == LEFT_OUT],
        source=source,
        settings=settings,
    )


def refine(mesh: SolidMesh) -> SolidMesh:
    """Divide every tetrahedron of a mesh into eight of the same body (regular refinement), shape (8 e, 10)."""
    corner = mesh.nodes[mesh.cells]
    lengths = np.stack([np.linalg.norm(corner[:, a] - corner[:, b], axis=1) for a, b in _AROUND])
    inner = np.array(list(_AROUND.values()))[np.argmin(lengths, axis=0)]
    parts = np.concatenate([np.broadcast_to(_AT_CORNERS, (len(inner), 4, 4)), inner], axis=1)
    places = np.concatenate([np.eye(4), np.eye(4)[EDGES].mean(axis=1)])  # barycentric coordinates of the nodes
    middles = places[parts[:, :, EDGES]].mean(axis=3)
    value = middles[..., :, None] * middles[..., None, :]
    shape = np.concatenate(
        [
            middles * (2 * middles - 1),
            np.stack([4 * value[..., a, b] for a, b in EDGES], axis=-1),
        ],
        axis=-1,
    )
    cells = np.take_along_axis(mesh.cells, parts.reshape(-1, 32), axis=1).reshape(-1, 4)
    where = np.einsum("epma,eac->epmc", shape, corner, optimize=True).reshape(-1, 6, 3)
    turned = np.linalg.det(mesh.nodes[cells[:, 1:]] - mesh.nodes[cells[:, :1]]) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    where[turned] = where[turned][:, [2, 1, 0, 3, 5, 4]]
    nodes, cells = _add_middles(mesh.nodes, cells, where)
    ends = np.sort(cells[:, EDGES], axis=2) @ [len(nodes), 1]
    keys, first = np.unique(ends.ravel(), return_index=True)

    def split(facets: IntArray) -> IntArray:
        """Divide facets of 6 nodes into four each."""
        corners = facets[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]].reshape(-1, 3)
        sides = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]], axis=2) @ [len(nodes), 1]
        return np.hstack([corners, cells[:, 4:].ravel()[first[np.searchsorted(keys, sides)]]])

    return replace(
        mesh,
        nodes=nodes,
        cells=cells,
        base=split(mesh.base),
        top=split(mesh.top),
        left_out=split(mesh.left_out),
        settings={**mesh.settings, "refined": int(mesh.settings.get("refined", 0)) + 1},
    )


def _add_middles(nodes: FloatArray, cells: IntArray, middles: FloatArray) -> tuple[FloatArray, IntArray]:
    """Add the nodes in the middles of the edges of tetrahedra.

    Args:
        nodes: Positions of the n corners, shape (n, 3) [m].
        cells: Indices of the corners of each tetrahedron, shape (e, 4).
        middles: Position of the middle of each of the `EDGES` of each tetrahedron, shape (e, 6, 3) [m].

    Returns:
        Positions of all nodes [m], and the indices of the nodes of each tetrahedron, shape (e, 10).
    """
    ends = np.sort(cells[:, EDGES], axis=2) @ [len(nodes), 1]
    _, first, place = np.unique(ends.ravel(), return_index=True, return_inverse=True)
    added = middles.reshape(-1, 3)[first]
    return np.concatenate([nodes, added]), np.hstack([cells, len(nodes) + place.reshape(-1, 6)])


def orient_tetrahedra(nodes: FloatArray, cells: IntArray) -> IntArray:
    """Return tetrahedra of which all have a positive volume, shape (e, 4)."""
    corner = nodes[cells]
    turned = np.linalg.det(corner[:, 1:] - corner[:, :1]) < 0
    return np.where(turned[:, None], cells[:, [0, 2, 1, 3]], cells)


def list_boundary(cells: IntArray) -> IntArray:
    """List the facets that belong to one tetrahedron only, facing outwards, shape (f, 3) or (f, 6).

    Args:
        cells: Tetrahedra of 4 or 10 nodes, shape (e, 4) or (e, 10).
    """
    width = 6 if cells.shape[1] == TETRAHEDRON else 3
    every = cells[:, _FACETS[:, :width]].reshape(-1, width)
    _, place, count = np.unique(np.sort(every[:, :3], axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(every[count[place.ravel()] == 1])


def choose_sizes(shell: Shell, element_size: float) -> tuple[FloatArray, IntArray, FloatArray]:
    """Choose element sizes that are proportional to the local thickness, on a grid of tetrahedra around a cover.

    The thickness at a point is the sum of its distances from the bonded and from the other part of the surface.

    Args:
        shell: Surface of the cover.
        element_size: Element size where the cover has its mean thickness [m].

    Returns:
        Points, shape (p, 3) [m], tetrahedra between them, shape (e, 4), and the size at each point, shape (p,) [m].
    """
    low, high = shell.surface.min(axis=(0, 1)), shell.surface.max(axis=(0, 1))
    spacing = max(_NUMBERS.sizes[0] * element_size, float(np.cbrt((high - low).prod() / _NUMBERS.sizes[1])))
    counts = np.ceil((high - low) / spacing).astype(int) + 2
    axes = [start + spacing * (np.arange(count) - 0.5) for start, count in zip(low, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange(len(points)).reshape(counts)
    shifted = [
        index[a : counts[0] - 1 + a, b : counts[1] - 1 + b, c : counts[2] - 1 + c].ravel()
        for a in (0, 1) for b in (0, 1) for c in (0, 1)
    ]  # fmt: skip
    return points, np.stack(shifted, axis=1)[:, _KUHN].reshape(-1, 4), _find_sizes(shell, points, element_size)


def _find_sizes(shell: Shell, points: FloatArray, element_size: float) -> FloatArray:
    """Return the element size at points, proportional to the local thickness within limits, shape (p,) [m]."""
    bonded = shell.label == BONDED
    apart = [
        np.linalg.norm(nearest_points(points, shell.surface[each])[0] - points, axis=1) for each in (bonded, ~bonded)
    ]
    share = (apart[0] + apart[1]) / shell.thickness
    return np.asarray(element_size * np.clip(share, *_NUMBERS.share))


def count_elements(shell: Shell, element_size: float) -> float:
    """Estimate the number of tetrahedra of a mesh of `fill_with_tetrahedra` [-]."""
    outer, base = shell.surface[shell.label != BONDED], shell.surface[shell.label == BONDED]
    middle = outer.mean(axis=1)
    across = nearest_points(middle, base)[0] - middle
    weight = np.linalg.norm(normal_vectors(outer), axis=1) * np.linalg.norm(across, axis=1)
    sizes = _find_sizes(shell, middle + across / 2, element_size)
    volume = enclosed_volume(shell.surface)
    return float(volume * np.average(sizes**-3.0, weights=weight) / _VOLUME)


def _run_mesher(shell: Shell, edge: float, envelope: float, name: str) -> tuple[FloatArray, IntArray]:
    """Run fTetWild in a process and a temporary folder of its own; return nodes and tetrahedra."""
    points, faces = merge_corners(shell.surface)
    places, around, sizes = choose_sizes(shell, edge)
    scale = float(np.linalg.norm(np.ptp(points, axis=0)))  # Lengths for the mesher are scaled to be of order 1.
    with tempfile.TemporaryDirectory(prefix="softcover-mesh-") as folder:
        np.savez(
            Path(folder) / "surface.npz",
            points=points / scale,
            faces=faces,
            edge=edge / scale,
            epsilon=envelope / scale,
            places=places / scale,
            around=around,
            sizes=sizes / scale,
        )
        try:
            done = subprocess.run(  # noqa: S603 -- our own program
                [sys.executable, "-c", _PROGRAM], cwd=folder, capture_output=True, timeout=_NUMBERS.seconds, check=False
            )
        except subprocess.TimeoutExpired:
            raise ValueError(
                f"meshing {name} took more than {_NUMBERS.seconds} s; take larger elements, simplify the {len(faces)} "
                "triangles of the surface, or give tetrahedra of your own by mesh"
            ) from None
        result = Path(folder) / "mesh.npz"
        if done.returncode or not result.exists():
            last = (done.stderr.decode(errors="replace").strip().splitlines() or [f"exit {done.returncode}"])[-1]
            raise ValueError(f"the mesher failed on {name} ({last[:120]}); repair or remesh the surface")
        with np.load(result) as found:
            nodes, cells = found["nodes"] * scale, found["cells"].astype(np.int64)
    if not len(cells):
        raise ValueError(f"the mesher found no volume inside {name}; repair the surface")
    return nodes, cells


def _hash(values: FloatArray | IntArray) -> str:
    """Return a short hash of an array."""
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()[:16]
