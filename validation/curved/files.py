"""Files of the meshes and of an indentation of a curved cover."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshes.solids import write_mesh
from validation.curved.press import describe_mesh
from validation.json_values import json_text
from validation.press_files.fields_file import format_contact
from validation.scene.cover_scene import show_curved, show_mesh
from validation.scene.draw import write_scene

if TYPE_CHECKING:
    from meshes.solids import SolidMesh
    from validation.curved.press import CurvedPress
    from validation.sensor_file import SensorDescription

#: Name of the file with the mesh that was solved.
MESH_FILE = "mesh.npz"


def write_mesh_report(sensor: SensorDescription, meshes: tuple[SolidMesh, ...], folder: Path) -> tuple[str, ...]:
    """Write the finest mesh as `mesh.npz`, the quality of all as `mesh.json`, and pictures where possible.

    Raises:
        OSError: If the folder cannot be written.
    """
    described = {"sensor": sensor.name, "meshes": [describe_mesh(mesh) for mesh in meshes]}
    (folder / "mesh.json").write_text(json_text(described), encoding="utf-8")
    write_mesh(folder / MESH_FILE, meshes[-1])
    return (MESH_FILE, "mesh.json", *write_scene(show_mesh(meshes[-1], sensor.array, title=sensor.name), folder))


def write_press(press: CurvedPress, folder: Path) -> tuple[str, ...]:
    """Write `press.json`, `texels.csv`, `contact.csv`, `mesh.npz`, and pictures where possible.

    Args:
        press: Result of one indentation.
        folder: An existing folder to write to.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    found, array = press.fem, press.sensor.array
    (folder / "press.json").write_text(json_text(press.as_json()), encoding="utf-8")
    texels = np.column_stack([array.centres, array.normals, found.texel_forces])
    _write_table(folder / "texels.csv", "x_m,y_m,z_m,nx,ny,nz,force_N", texels)
    (folder / "contact.csv").write_text(format_contact(found), encoding="utf-8")
    if found.mesh is not None:
        write_mesh(folder / MESH_FILE, found.mesh)
    title = f"{press.shape} on {press.sensor.name}, {found.total_force:.4g} N"
    scene = show_curved(found, array, direction=press.touch.towards, title=title)
    return ("press.json", "texels.csv", "contact.csv", MESH_FILE, *write_scene(scene, folder))


def _write_table(path: Path, header: str, rows: np.ndarray) -> None:
    lines = [header, *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
