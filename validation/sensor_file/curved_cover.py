"""Making of a solid cover from the table `[cover]` of a sensor file that names surfaces or a mesh."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path

import numpy as np

from meshes import SolidCover, TexelArray
from meshes.array_types import FloatArray
from meshes.solids import check_quality, read_mesh
from meshes.solids.covers import make_shell_cover, take_meshes
from meshes.solids.shell import Shell, join, point_normals, select_base, thicken
from meshes.solids.solid_mesh import LIMITS
from meshes.solids.tetrahedra import classify_boundary, list_boundary, orient_tetrahedra
from meshes.surfaces.files import read_tetrahedra, read_triangles
from meshes.surfaces.triangles import (
    check_closed,
    close_cracks,
    enclosed_volume,
    list_border,
    merge_corners,
    nearest_points,
)
from validation.errors import InputError, at
from validation.extras import require
from validation.schema.sensor import CurvedCoverTable

#: Element sizes of the coarse and the fine mesh of tetrahedra if the sensor file states none, over the thickness [-].
_SIZES = (0.6, 0.45)
#: Element size of the coarse mesh of tetrahedra, over that of the fine mesh, which a sensor file may state [-].
_COARSER = 1.33
#: Largest distance over which a texel is moved onto the base of a cover, over the cover's mean thickness [-].
_FARTHEST = 2.5
#: Tolerance for facets of tetrahedra on the bonded base and for their total volume, over the size or volume [-].
_SAME = 1e-6


def build_solid(table: CurvedCoverTable, folder: Path) -> SolidCover:
    """Make a solid cover from the table `[cover]` of a sensor file.

    Args:
        table: The table `[cover]`.
        folder: Folder of the sensor file; the paths in the table are relative to it.

    Raises:
        InputError: With one line per fault: keys that do not go together, a missing unit, files that cannot be read, or
            surfaces of which no body can be made.
    """
    with at("cover: "):
        if table.mesh is not None:
            return _take_mesh(table, folder)
        require("trimesh", useful=("skfem", "pytetwild"))
        shell, source = _build_shell(table, folder)
        check_closed(shell.surface, f"the body of {source}", crossings=not shell.is_folded)
    if table.element_size is None:
        sizes = tuple(factor * shell.thickness for factor in _SIZES)
    else:
        sizes = (_COARSER * table.element_size, table.element_size)
    from fem_reference import result_store

    return make_shell_cover(shell, table.material, source, sizes, partial(result_store.fetch, "cover-mesh"))


def project_texels(texels: TexelArray, cover: SolidCover) -> TexelArray:
    """Move texels to the nearest points of the base of a solid cover, and take their normals from the base.

    Raises:
        InputError: If a texel is far from the base.
    """
    base = cover.base_triangles
    if base is None:
        mesh = cover.meshes()[-1]
        base = mesh.nodes[mesh.base[:, :3]]
    points, faces = merge_corners(base)
    corners = points[faces]
    near, owner = nearest_points(texels.centres, corners)
    distance = np.linalg.norm(near - texels.centres, axis=1)
    worst = int(np.argmax(distance))
    if distance[worst] > _FARTHEST * cover.thickness:
        raise InputError(
            f"array.positions: {int((distance > _FARTHEST * cover.thickness).sum())} of {texels.count} texels are far "
            f"from the base: texel {worst} by {1e3 * distance[worst]:.4g} mm; check array.unit and the frame"
        )
    # The normals of the corners of the nearest triangle are weighted by the barycentric coordinates of the point.  With
    # these weights the corners sum to the point; the weights sum to one.
    size = np.full((len(near), 1), cover.thickness)
    system = np.concatenate([corners[owner], np.broadcast_to(size[:, None], (len(near), 3, 1))], axis=2)
    share = np.linalg.pinv(system.swapaxes(1, 2)) @ np.hstack([near, size])[:, :, None]
    normals = np.sum(np.maximum(share, 0.0) * point_normals(points, faces)[faces[owner]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return dataclasses.replace(texels, centres=near, normals=normals)


def _check_size(triangles: FloatArray, name: str) -> None:
    size = float(np.ptp(triangles, axis=(0, 1)).max())
    low, high = LIMITS.sizes
    if not low <= size <= high:
        raise ValueError(
            f"unit: {name} would be {1e3 * size:.4g} mm long, outside {1e3 * low:g}..{1e3 * high:g} mm "
            "(were millimetres taken for metres?)"
        )


def _build_shell(table: CurvedCoverTable, folder: Path) -> tuple[Shell, str]:
    """Make the closed surface of a solid cover, and describe in words from which files it is made."""
    unit = table.unit or 1.0  # The schema requires it.
    if table.thickness is not None:
        name, inward = (table.surface, True) if table.surface is not None else (table.base, False)
        triangles = close_cracks(read_triangles(folder / str(name), unit))
        _check_size(triangles, str(name))
        words = f"{name} and {1e3 * table.thickness:g} mm {'below' if inward else 'above'} it"
        return thicken(triangles, table.thickness, str(name), inward=inward), words
    outer, base = (close_cracks(read_triangles(folder / str(name), unit)) for name in (table.surface, table.base))
    _check_size(outer, str(table.surface))
    _check_size(base, str(table.base))
    return join(outer, base, distance=table.base_distance), f"{table.surface} over {table.base}"


def _take_mesh(table: CurvedCoverTable, folder: Path) -> SolidCover:
    """Make a solid cover from a file of tetrahedra, which are repaired where possible, or from a mesh of softcover."""
    path, notes = folder / str(table.mesh), []
    if path.suffix.lower() == ".npz":
        mesh = read_mesh(path)
    else:
        unit = table.unit or 1.0  # The schema requires it.
        nodes, cells = read_tetrahedra(path, unit)
        oriented = orient_tetrahedra(nodes, cells)
        turned = int((oriented != cells).any(axis=1).sum())
        corner = nodes[oriented]
        flat = np.linalg.det(corner[:, 1:] - corner[:, :1]) <= 0
        if turned or flat.any():
            notes.append(f"{turned} tetrahedra of {path.name} were turned, {int(flat.sum())} without volume left out")
        if flat.all():
            raise ValueError(f"no tetrahedron of {path.name} has a volume; export a solid")
        oriented = oriented[~flat]
        boundary = nodes[list_boundary(oriented)]
        _refuse_overlap(nodes[oriented], boundary, path.name)
        given = read_triangles(folder / str(table.base), unit)
        is_closed = not len(list_border(merge_corners(given)[1], str(table.base)))
        chosen = select_base(boundary, given, distance=table.base_distance, is_closed=is_closed)
        if not chosen.any():
            raise ValueError(
                f"no part of {path.name} lies on {table.base}; check frame and unit, or give base_distance"
            )
        mesh = classify_boundary(
            nodes,
            oriented,
            boundary[chosen],
            tolerance=_SAME * float(np.ptp(nodes, axis=0).max()),
            settings={"file": path.name},
            source=f"tetrahedra of {path.name}",
        )
    quality = check_quality(mesh)
    if (quality.slivers or quality.inverted) and path.suffix.lower() != ".npz":
        raise ValueError(
            "; ".join(quality.faults) + f': write surface = "{table.mesh}" instead of mesh, and its boundary is meshed'
        )
    source = f"{path.name}, {quality.elements} {quality.kind}"
    return take_meshes((mesh,), table.material, source, tuple(notes))


def _refuse_overlap(corners: FloatArray, boundary: FloatArray, name: str) -> None:
    """Refuse tetrahedra that overlap: the sum of their volumes is not the volume inside their boundary.

    Args:
        corners: Corners of e tetrahedra, shape (e, 4, 3) [m].
        boundary: Corners of the triangles of their boundary, shape (f, 3, 3) [m].
        name: Name of the file, for the error message.
    """
    total = float(np.linalg.det(corners[:, 1:] - corners[:, :1]).sum() / 6)
    inside = enclosed_volume(boundary)
    if abs(total - inside) > _SAME * total:
        raise ValueError(
            f"{name} has tetrahedra that overlap: their volumes sum to {100 * total / inside:.6g} % of that inside "
            "their boundary; write surface instead of mesh, and its boundary is meshed"
        )
