"""Fill a closed surface of triangles with tetrahedra by fTetWild (Hu et al. 2020), for covers that cannot be swept.

The mesher gives a different mesh at each call.  Callers therefore store a mesh and treat it as an input; the spread of
results over several meshes is the numerical noise of the results.  The mesher runs in a process and a folder of its
own, because it writes a file into its working folder and may crash on bad surfaces.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from meshes.array_types import FloatArray, IntArray
from meshes.solids.solid_mesh import LIMITS, Setting, SolidMesh
from meshes.surfaces.triangles import (
    check_closed,
    enclosed_volume,
    merge_corners,
    nearest_points,
    normal_vectors,
    unit_vectors,
)


@dataclass(frozen=True, kw_only=True)
class _Numbers:
    """Constants of meshes of tetrahedra."""

    #: Largest distance between the surfaces of the mesh and of the cover, over the cover's thickness [-]; chosen by
    #: judgement.
    envelope: float = 1 / 50
    #: Largest distance of a facet of the base from the given base, over the largest distance between the surfaces of
    #: mesh and cover [-]; chosen by judgement.
    near_base: float = 3.0
    #: Smallest cosine between the normals of the base and of a facet of the base [-]; 45 degrees, chosen by judgement.
    on_base: float = 0.7
    #: Smallest cosine between the normals of a facet of the top and of the nearest point of the base [-]; 60 degrees,
    #: chosen by judgement.  Facets below this value belong to the sides.
    on_top: float = 0.5
    #: Largest time in which the mesher must finish a mesh [s]; chosen by judgement.
    seconds: int = 900


_NUMBERS = _Numbers()
#: Program of the mesher's process.  It reads the surface and writes the mesh in the current folder.
_PROGRAM = """
import numpy, pytetwild
given = numpy.load("surface.npz")
nodes, cells = pytetwild.tetrahedralize(given["points"], given["faces"].astype(numpy.int32), vtk_ordering=True,
    edge_length_abs=float(given["edge"]), epsilon=float(given["epsilon"]), num_threads=1)
numpy.savez("mesh.npz", nodes=nodes, cells=cells)
"""


def fill_with_tetrahedra(
    surface: FloatArray,
    base: FloatArray,
    element_size: float,
    *,
    name: str = "the surface",
    crossings: bool = True,
) -> SolidMesh:
    """Mesh the inside of a closed surface.

    Args:
        surface: Corners of the n triangles of the whole surface of the cover, counterclockwise as seen from outside,
            shape (n, 3, 3) [m].
        base: Corners of the triangles of the bonded part, in either orientation, shape (b, 3, 3) [m].
        element_size: Wanted edge length of the tetrahedra [m].
        name: Name of the surface in messages.
        crossings: Whether a surface that intersects itself is refused; the mesher smooths small folds.

    Raises:
        ValueError: If a surface is open, inside out or intersects itself, or the mesher fails.
        ModuleNotFoundError: If pytetwild is not installed.
    """
    surface, base = np.asarray(surface, dtype=float), np.asarray(base, dtype=float)
    check_closed(surface, name, crossings=crossings)
    size = float(np.ptp(surface, axis=(0, 1)).max())
    low, high = LIMITS.sizes
    if not low <= size <= high:
        raise ValueError(
            f"{name} would be {1e3 * size:.4g} mm long, outside {1e3 * low:g}..{1e3 * high:g} mm; state its "
            "unit (were millimetres taken for metres?)"
        )
    thickness = enclosed_volume(surface) / (np.linalg.norm(normal_vectors(base), axis=1).sum() / 2)
    settings: dict[str, Setting] = {
        "element_size": float(element_size),
        "envelope": _NUMBERS.envelope * float(thickness),
        "surface": _hash(surface),
        "base": _hash(base),
    }
    if find_spec("pytetwild") is None:
        raise ModuleNotFoundError(
            "tetrahedral meshes need pytetwild; run in a clone of softcover: python -m pip install -e '.[curved]'",
            name="pytetwild",
        )
    nodes, cells = _run_mesher(surface, element_size, _NUMBERS.envelope * thickness, name)
    return classify_boundary(
        nodes, cells, base, tolerance=_NUMBERS.near_base * _NUMBERS.envelope * thickness, settings=settings
    )


def classify_boundary(
    nodes: FloatArray,
    cells: IntArray,
    base: FloatArray,
    *,
    tolerance: float,
    settings: Mapping[str, Setting] | None = None,
    source: str = "tetrahedra",
) -> SolidMesh:
    """Find base, top and sides of a tetrahedral mesh, project the nodes of the base, and correct the orientation.

    Args:
        nodes: Positions of the nodes, shape (n, 3) [m].
        cells: Indices of the nodes of each tetrahedron, in either orientation, shape (e, 4).
        base: Corners of the triangles of the base, in either orientation, shape (b, 3, 3) [m].
        tolerance: Largest distance of a node of the base from these triangles [m].
        settings: Settings of the mesh.
        source: Source of the mesh.

    Raises:
        ValueError: If no facet lies on the base, or all facets do.
    """
    used, place = np.unique(cells, return_inverse=True)
    nodes = np.array(nodes[used], dtype=float)
    cells = orient_tetrahedra(nodes, place.reshape(-1, 4).astype(np.int64))
    facets = list_boundary(cells)
    outer = np.unique(facets)
    nearest = nearest_points(nodes[outer], base)[0]
    position = np.searchsorted(outer, facets)
    distance = np.linalg.norm(nearest - nodes[outer], axis=1)
    normals, given = unit_vectors(normal_vectors(nodes[facets])), unit_vectors(normal_vectors(base))
    middle_owner = nearest_points(nodes[facets].mean(axis=1), base)[1]
    cosine = np.einsum("fc,fc->f", normals, given[middle_owner])
    on_base = (distance[position] <= tolerance).all(axis=1) & (np.abs(cosine) > _NUMBERS.on_base)
    if not on_base.any() or on_base.all():
        raise ValueError("no part of the surface lies on the base; give the base in the same frame and unit")
    nodes[outer[position[on_base]]] = nearest[position[on_base]]
    # The normals of the base must point into the cover: against those of the mesh's facets on the base.
    inward = -np.sign(cosine[on_base].sum())
    on_top = ~on_base & (inward * cosine > _NUMBERS.on_top)
    return SolidMesh(
        nodes=nodes,
        cells=cells,
        base=facets[on_base][:, [0, 2, 1]],
        top=facets[on_top],
        sides=facets[~on_base & ~on_top],
        source=source,
        settings=settings or {},
    )


def orient_tetrahedra(nodes: FloatArray, cells: IntArray) -> IntArray:
    """Return tetrahedra of which all have a positive volume, shape (e, 4)."""
    corner = nodes[cells]
    turned = np.linalg.det(corner[:, 1:] - corner[:, :1]) < 0
    return np.where(turned[:, None], cells[:, [0, 2, 1, 3]], cells)


def list_boundary(cells: IntArray) -> IntArray:
    """List the facets that belong to one tetrahedron only, facing outwards, shape (f, 3)."""
    every = cells[:, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]].reshape(-1, 3)
    _, place, count = np.unique(np.sort(every, axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(every[count[place.ravel()] == 1])


def _run_mesher(surface: FloatArray, edge: float, envelope: float, name: str) -> tuple[FloatArray, IntArray]:
    """Run fTetWild in a process and a temporary folder of its own; return nodes and tetrahedra."""
    points, faces = merge_corners(surface)
    scale = float(np.linalg.norm(np.ptp(points, axis=0)))  # Lengths for the mesher are scaled to be of order 1.
    with tempfile.TemporaryDirectory(prefix="softcover-mesh-") as folder:
        np.savez(
            Path(folder) / "surface.npz",
            points=points / scale,
            faces=faces,
            edge=edge / scale,
            epsilon=envelope / scale,
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


def _hash(values: FloatArray) -> str:
    """Return a short hash of an array."""
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()[:16]
