"""Writes the contact forces of an indentation, and displacement and stress in the cover, to files."""

from __future__ import annotations

import csv
import io
import logging
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshes.bounded_file import pack_npz
from meshes.solids import write_mesh
from validation.cover_meshes import MESH_FILE
from validation.extras import MissingExtraError
from validation.json_values import json_text
from validation.press_files.picture import write_picture

if TYPE_CHECKING:
    from fem_reference.fields.cover_fields import CoverFields
    from meshes.array_types import FloatArray
    from validation.campaign.comparison import Comparison

_LOG = logging.getLogger(__name__)


def write_press(comparison: Comparison, folder: Path) -> tuple[str, ...]:
    """Write the finite elements' result of one indentation, and pictures where possible.

    The files are `press.json`, `texels.csv`, `contact.csv`, of solid covers `mesh.npz`, of fields in the cover
    `fields.npz` and, with pyvista, `fields.vtu`.

    Args:
        comparison: Result of at least the finite elements.
        folder: An existing folder to write to.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    from validation.scene.cover_scene import show_indentation
    from validation.scene.draw import write_scene

    found, array, case = comparison.fem, comparison.sensor.array, comparison.case
    if found is None:
        return ()
    (folder / "press.json").write_text(json_text(comparison.as_json()), encoding="utf-8")
    texels = np.column_stack([array.centres, array.normals, found.texel_forces])
    _write_rows(folder / "texels.csv", ("x_m", "y_m", "z_m", "nx", "ny", "nz", "force_N"), texels)
    touched = found.contact_forces.any(axis=1)
    contact = np.column_stack([found.contact_points, found.contact_forces])[touched]
    _write_rows(folder / "contact.csv", ("x_m", "y_m", "z_m", "force_x_N", "force_y_N", "force_z_N"), contact)
    files = ["press.json", "texels.csv", "contact.csv"]
    if found.mesh is not None:
        write_mesh(folder / MESH_FILE, found.mesh)
        files.append(MESH_FILE)
    if found.fields is not None:
        arrays = {name: getattr(found.fields, name) for name in found.fields.__dataclass_fields__}
        (folder / "fields.npz").write_bytes(pack_npz(arrays))
        files.append("fields.npz")
        try:
            write_vtu(found.fields, folder / "fields.vtu")
            files.append("fields.vtu")
        except ImportError:
            _LOG.warning("no fields.vtu: %s", MissingExtraError("pyvista"))
    title = f"{case.shape} on {array.name}, {found.total_force:.4g} N"
    scene = show_indentation(found, array, direction=case.pose.towards, title=title)
    return (*files, *write_picture(comparison, folder), *write_scene(scene, folder))


def _write_rows(path: Path, names: tuple[str, ...], rows: FloatArray) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows.tolist())
    path.write_text(text.getvalue(), encoding="utf-8")


def write_vtu(fields: CoverFields, path: Path) -> None:
    """Write fields as a VTK file of the undeformed cover, with nodal data `displacement`, `stress` and `von_mises`.

    `stress` has the nine components of the tensor, row by row.  The layer of each element is cell data.

    Args:
        fields: Displacement and stress in the cover.
        path: File to write; its name ends in `.vtu`.

    Raises:
        ImportError: If pyvista is not installed.
        OSError: If the file cannot be written.
    """
    import pyvista

    corners = fields.cells.shape[1]
    kind = pyvista.CellType.QUAD if corners == 4 else pyvista.CellType.HEXAHEDRON  # noqa: PLR2004
    cells = np.column_stack([np.full(len(fields.cells), corners), fields.cells])
    grid = pyvista.UnstructuredGrid(cells.ravel(), np.full(len(cells), kind, dtype=np.uint8), fields.position)
    grid.point_data["displacement"] = fields.displacement
    grid.point_data["stress"] = fields.stress.reshape(-1, 9)
    grid.point_data["von_mises"] = fields.von_mises
    grid.cell_data["layer"] = fields.layer
    grid.save(path)
