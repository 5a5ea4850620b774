"""Making of a solid cover from the table `[cover]` of a sensor file that names surfaces or a mesh."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path

import numpy as np

from meshes import SolidCover, TexelArray
from meshes.array_types import BoolArray, FloatArray
from meshes.solids import check_quality, read_mesh
from meshes.solids.covers import make_shell_cover, take_meshes
from meshes.solids.shell import (
    BONDED,
    LEFT_OUT,
    TOUCHABLE,
    Shell,
    join,
    leave_out,
    point_normals,
    select_base,
    thicken,
)
from meshes.solids.solid_mesh import LIMITS, Setting, describe_size
from meshes.solids.tetrahedra import label_mesh, list_boundary, orient_tetrahedra
from meshes.surfaces.files import read_tetrahedra, read_triangles
from meshes.surfaces.smooth import measure_flat, smooth_surface
from meshes.surfaces.triangles import (
    check_closed,
    close_cracks,
    describe,
    enclosed_volume,
    list_border,
    merge_corners,
    nearest_points,
    normal_vectors,
    unit_vectors,
)
from validation.errors import InputError, at
from validation.extras import require
from validation.schema.sensor import CurvedCoverTable

#: Sag of the triangles of a surface above which they are divided at points of the smooth surface, over its size [-].
_SAG = 1 / 1000
#: Area of a flat face of a closed surface, over the whole area, from which a note asks whether it is a mounting face
#: [-].
_MOUNTING = 0.06
#: Largest distance of the plane of a flat face from an axis of the frame for which the note names a half-space [-].
_UPRIGHT = 0.02
#: Largest distance over which a texel is moved onto the base of a cover, over the cover's mean thickness [-].
_FARTHEST = 2.5
#: Tolerance of the thickness of layers against that of the mesh [-].
_SAME_HEIGHT = 0.02
#: Tolerance of the total volume of tetrahedra, over the volume [-].
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
        try:
            shell, source = _build_shell(table, folder, table.crease_angle)
        except ValueError:
            if not table.crease_angle:
                raise
            shell, source = _build_shell(table, folder, 0.0)
            note = "the facets of the surfaces were kept, because smooth ones fold or cross"
            shell = dataclasses.replace(shell, notes=(*shell.notes, note))
    from fem_reference import result_store

    keep = partial(result_store.fetch, "cover-mesh")
    return make_shell_cover(shell, table.layers, source, keep, element_size=table.element_size)


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
    # Near a sharp edge of the base the mean normal of its corners is not that of the triangle.
    flat = unit_vectors(normal_vectors(corners))[owner]
    normals = np.where(np.einsum("nc,nc->n", flat, normals)[:, None] < LIMITS.cosine, flat, normals)
    return dataclasses.replace(texels, centres=near, normals=normals)


def _build_shell(table: CurvedCoverTable, folder: Path, crease: float) -> tuple[Shell, str]:
    """Make the closed surface of a solid cover, and describe in words from which files it is made.

    Args:
        table: The table `[cover]`.
        folder: Folder of the sensor file.
        crease: Angle from which an edge of a surface stays sharp; 0 keeps all facets [deg].

    Raises:
        ValueError: If a file cannot be read, or its surfaces enclose no body.
    """
    unit = table.unit or 1.0  # The schema requires it.
    notes, errors, surfaces = [], [], []
    for name in filter(None, (table.surface, table.base)):
        given = close_cracks(read_triangles(folder / name, unit))
        if fault := describe_size(float(np.ptp(given, axis=(0, 1)).max()), f"unit: {name}"):
            raise ValueError(fault)
        list_border(merge_corners(given)[1], name)
        if table.thickness is not None and name == table.surface:
            notes += _note_mounting(given, table, name)
            given = given[~_lie_in(given, table)]
            if not len(given):
                raise ValueError(f"left_out: all of {name} lies in it; make it smaller")
        triangles, sag, error = smooth_surface(given, _SAG * float(np.ptp(given, axis=(0, 1)).max()), crease=crease)
        errors.append(error)
        surfaces.append(triangles)
        how = f"smoothed where they meet at less than {crease:g} degrees" if crease else "kept"
        if sag > _SAG * np.ptp(given, axis=(0, 1)).max():
            notes.append(
                f"the facets of {name} lie up to {1e3 * sag:.2g} mm off a smooth surface and were {how}: the error "
                f"of the shape is about {1e3 * error:.2g} mm"
            )
    if table.thickness is not None:
        inward = table.surface is not None
        words = f"{name} and {1e3 * table.thickness:g} mm {'below' if inward else 'above'} it"
        shell = thicken(surfaces[0], table.thickness, name, inward=inward)
    else:
        words = f"{table.surface} over {table.base}"
        shell = join(surfaces[0], surfaces[1], distance=table.base_distance)
    check_closed(shell.surface, f"the body of {words}", crossings=not shell.is_folded)
    shell = leave_out(shell, _lie_in(shell.surface, table))
    if not (shell.label == TOUCHABLE).any():
        raise ValueError("left_out: leaves no face that can be touched; make it smaller")
    shell = dataclasses.replace(shell, notes=(*notes, *shell.notes), geometry_error=max(errors), is_smooth=crease > 0)
    return shell, words


def _lie_in(triangles: FloatArray, table: CurvedCoverTable) -> BoolArray:
    """Return which triangles lie in a half-space that the table leaves out, shape (n,)."""
    out = np.zeros(len(triangles), dtype=bool)
    for axis, sign, value in table.left_out or ():
        out |= (sign * triangles[..., axis] < sign * value).all(axis=1)
    return out


def _note_mounting(triangles: FloatArray, table: CurvedCoverTable, name: str) -> list[str]:
    """Ask in a note whether the largest flat face of a closed surface is where the cover is mounted."""
    points, faces = merge_corners(triangles)
    flat = measure_flat(points, faces)
    vectors = unit_vectors(normal_vectors(triangles))
    chosen = flat >= (1 - _SAG) * flat.max()
    normal, middle = vectors[chosen].mean(axis=0), triangles[chosen].mean(axis=(0, 1))
    area = np.linalg.norm(normal_vectors(triangles), axis=1).sum() / 2
    if table.left_out or len(list_border(faces, name)) or flat.max() < _MOUNTING * area:
        return []
    axis = int(np.abs(normal).argmax())
    place = 1e3 * (middle[axis] - np.sign(normal[axis]) * _SAG * np.ptp(triangles[..., axis]))
    half = f'"{"xyz"[axis]} {"<" if normal[axis] < 0 else ">"} {place:.4g} mm"'
    remedy = f"left_out = [{half}]" if abs(normal[axis]) > 1 - _UPRIGHT else "left_out, or cut it off"
    note = (
        f"{name} is closed, and there is cover below its flat face of {1e6 * flat.max():.3g} mm2 around "
        f"({describe(middle)}) mm too; if it is the mounting face, write {remedy}"
    )
    return [note]


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
        label = np.where(chosen, BONDED, np.where(_lie_in(boundary, table), LEFT_OUT, TOUCHABLE))
        sag = smooth_surface(boundary[~chosen], 0.0, crease=0.0)[1]
        settings: dict[str, Setting] = {"file": path.name, "geometry_error": sag}
        mesh = label_mesh(nodes, oriented, label, settings=settings, source=f"tetrahedra of {path.name}")
    quality = check_quality(mesh)
    if (quality.slivers or quality.inverted) and path.suffix.lower() != ".npz":
        raise ValueError(
            "; ".join(quality.faults) + f': write surface = "{table.mesh}" instead of mesh, and its boundary is meshed'
        )
    source = f"{path.name}, {quality.elements} {quality.kind}"
    if table.layer and abs(sum(each.thickness for each in table.layer) / quality.thickness - 1) > _SAME_HEIGHT:
        raise ValueError(f"layer: the thicknesses do not sum to {1e3 * quality.thickness:.4g} mm, that of {path.name}")
    return take_meshes((mesh,), table.layers, source, tuple(notes))


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
