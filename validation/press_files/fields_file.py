"""Writes the contact forces of an indentation, and displacement and stress in the cover, to files."""

from __future__ import annotations

import csv
import io
import logging
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshes.bounded_file import pack_npz
from validation.extras import MissingExtraError

if TYPE_CHECKING:
    from fem_reference.fields.cover_fields import CoverFields
    from fem_reference.indentation.result import Indentation

_LOG = logging.getLogger(__name__)


def write_indentation(found: Indentation, folder: Path) -> tuple[str, ...]:
    """Write `contact.csv` and, if the indentation has fields, `fields.npz` and, if pyvista is installed, `fields.vtu`.

    Args:
        found: Result of `press`.
        folder: An existing folder to write to.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    (folder / "contact.csv").write_text(format_contact(found), encoding="utf-8")
    files = ["contact.csv"]
    if found.fields is None:
        return tuple(files)
    arrays = {name: getattr(found.fields, name) for name in found.fields.__dataclass_fields__}
    (folder / "fields.npz").write_bytes(pack_npz(arrays))
    files.append("fields.npz")
    try:
        write_vtu(found.fields, folder / "fields.vtu")
    except ImportError:
        _LOG.warning("no fields.vtu: %s", MissingExtraError("pyvista"))
        return tuple(files)
    return (*files, "fields.vtu")


def format_contact(found: Indentation) -> str:
    """Return the contact points as CSV: position [m], and force of the indenter on the cover [N]."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("x_m", "y_m", "z_m", "force_x_N", "force_y_N", "force_z_N"))
    touched = found.contact_forces.any(axis=1)
    writer.writerows(np.column_stack([found.contact_points, found.contact_forces])[touched].tolist())
    return text.getvalue()


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
