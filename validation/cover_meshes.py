"""Meshes of a sensor's solid cover: made and checked, described, and written to files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from validation.errors import at
from validation.json_values import json_text

if TYPE_CHECKING:
    from meshes.solids import SolidMesh
    from validation.sensor_file import SensorDescription

#: Name of the file with the finest mesh of a solid cover.
MESH_FILE = "mesh.npz"


def make_meshes(sensor: SensorDescription, progress: Callable[[str], None] | None = None) -> tuple[SolidMesh, ...]:
    """Make the meshes of a sensor's solid cover, coarsest first, and check them and the texels.

    Raises:
        InputError: If the cover is no solid or cannot be meshed, a mesh cannot be used, or a texel is not on the base.
    """
    from meshes.solids.solid_mesh import check_quality, check_texels

    with at(f"{sensor.source}: "):
        meshes = sensor.cover.meshes(progress)
        for mesh in meshes:
            check_quality(mesh).require()
        check_texels(meshes[-1], sensor.array)
    return meshes


def describe_mesh(mesh: SolidMesh) -> dict[str, Any]:
    """Describe a mesh of a solid cover, its origin and its quality, as a dictionary of JSON values."""
    from meshes.solids.solid_mesh import check_quality, measure_area

    quality = check_quality(mesh)
    return {
        "digest": mesh.digest,
        "source": mesh.source,
        "settings": dict(mesh.settings),
        "elements": quality.elements,
        "kind": quality.kind,
        "nodes": quality.nodes,
        "volume_m3": quality.volume,
        "thickness_m": quality.thickness,
        "scaled_jacobian": quality.scaled_jacobian,
        "inverted": quality.inverted,
        "slivers": quality.slivers,
        "through": quality.through,
        "bonded_m2": measure_area(mesh, "base"),
        "touchable_m2": measure_area(mesh, "top"),
        "left_out_m2": measure_area(mesh, "left_out"),
        "geometry_error_m": mesh.geometry_error,
    }


def write_meshes(sensor: SensorDescription, meshes: tuple[SolidMesh, ...], folder: Path) -> tuple[str, ...]:
    """Write the finest mesh as `mesh.npz`, the quality of all as `mesh.json`, and pictures where possible.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    from meshes.solids import write_mesh
    from validation.scene.cover_scene import show_mesh
    from validation.scene.draw import write_scene

    described = {"sensor": sensor.name, "meshes": [describe_mesh(mesh) for mesh in meshes]}
    (folder / "mesh.json").write_text(json_text(described), encoding="utf-8")
    write_mesh(folder / MESH_FILE, meshes[-1])
    return (MESH_FILE, "mesh.json", *write_scene(show_mesh(meshes[-1], sensor.array, title=sensor.name), folder))
