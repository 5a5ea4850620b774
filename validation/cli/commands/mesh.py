"""The command `softcover mesh`, which meshes a curved cover and reports the quality of the meshes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from validation.cli import options, output
from validation.cli.entry import DONE, OUTSIDE_FAILED

if TYPE_CHECKING:
    from meshes.solids import SolidMesh
    from validation.sensor_file import SensorDescription

#: Parts of the surface of a cover by what they are.
_PARTS = {"bonded": "base", "touchable": "top", "left out": "left_out"}


def mesh(
    sensor: options.SensorFile,
    *,
    thickness: options.Length | None = None,
    out: options.Folder | None = None,
    json: options.Json = False,
) -> int:
    """Mesh a curved cover, check meshes and texels, and report quality and areas: bonded, touchable, left out.

    The finest mesh is written as `mesh.npz` with its hash, source and settings.  A sensor file may name it:
    `[cover] mesh = "mesh.npz"`; if the file is changed, it is refused.

    Examples of use:

        softcover mesh fingertip
        softcover mesh sensor.toml --out meshed

    Args:
        thickness: Replaces the cover's thickness, e.g. 2mm.
        out: Folder for the finest mesh, its quality and pictures.
    """
    from validation.extras import require
    from validation.output_folder import optional_folder

    description = options.read_description(sensor, options.CoverChanges(thickness=thickness), any_cover=True)
    require("skfem", useful=("pyvista",) if out else ())
    from validation.cover_meshes import describe_mesh, make_meshes, write_meshes
    from validation.scene.draw import lacks_picture

    with optional_folder(out) as folder, output.Progress() as progress:
        meshes = make_meshes(description, progress)
        files = write_meshes(description, meshes, folder) if folder else ()
    if json:
        output.print_json({"sensor": description.name, "meshes": [describe_mesh(each) for each in meshes]})
    else:
        output.print_table((), _list_quality(description, meshes), title=f"Meshes of {description.name}")
    if files:
        output.say(f"wrote {', '.join(files)} to {out}")
    return OUTSIDE_FAILED if lacks_picture(files) else DONE


def _list_quality(sensor: SensorDescription, meshes: tuple[SolidMesh, ...]) -> Iterator[tuple[str, str]]:
    from meshes.solids import check_quality
    from meshes.solids.solid_mesh import measure_area

    yield "cover", f"{sensor.cover.source}; thickness {1e3 * sensor.cover.thickness:.3g} mm"
    for note in sensor.cover.notes:
        yield "note", note
    areas = {each: 1e6 * measure_area(meshes[-1], name) for each, name in _PARTS.items()}
    yield "surface", ", ".join(f"{name} {area:.4g} mm2" for name, area in areas.items())
    if meshes[-1].geometry_error:
        yield "shape", f"known to {1e3 * meshes[-1].geometry_error:.2g} mm"
    for number, mesh_of_size in enumerate(meshes, start=1):
        for index, line in enumerate(check_quality(mesh_of_size).lines()):
            yield "" if index else f"mesh {number}", line
        yield "", f"hash {mesh_of_size.digest}"
