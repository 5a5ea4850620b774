"""Files of one indentation: results, forces, fields in the cover, pictures, and curves of load over depth."""

from __future__ import annotations

import csv
import logging
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from meshes.bounded_file import pack_npz
from meshes.solids import write_mesh
from validation.cover_meshes import MESH_FILE
from validation.extras import MissingExtraError
from validation.json_values import json_text
from validation.press_picture import write_picture
from validation.render.figure import COLOURS, COLUMN, open_figure, save_figure
from validation.text.indenter import describe_indenter

if TYPE_CHECKING:
    from fem_reference.fields.cover_fields import CoverFields
    from fem_reference.indentation.result import Indentation
    from validation.campaign.comparison import Comparison

_LOG = logging.getLogger(__name__)

#: Pattern of a number in a warning.
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def write_press(comparison: Comparison, folder: Path) -> tuple[str, ...]:
    """Write the result of one indentation by finite elements to files, with pictures where this machine can draw.

    The files are `press.json`, `texels.csv` and `contact.csv`; for solid covers also `mesh.npz`; for fields in the
    cover also `fields.npz` and, with pyvista, `fields.vtu`.

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
    write_rows(folder / "texels.csv", ("x_m", "y_m", "z_m", "nx", "ny", "nz", "force_N"), texels.tolist())
    touched = found.contact_forces.any(axis=1)
    contact = np.column_stack([found.contact_points, found.contact_forces])[touched]
    write_rows(folder / "contact.csv", ("x_m", "y_m", "z_m", "force_x_N", "force_y_N", "force_z_N"), contact.tolist())
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
    title = f"{describe_indenter(case.shape)}, on {array.name}, {found.total_force:.4f} N"
    cover = getattr(comparison.sensor, "cover", None)
    scene = show_indentation(found, array, case.indenter, case.pose, cover=cover, title=title)
    return (*files, *write_picture(comparison, folder), *write_scene(scene, folder))


def write_rows(path: Path, names: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a CSV file: the names of its columns, and its rows."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(rows)


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

    kind = pyvista.CellType.QUAD if fields.cells.shape[1] == 4 else pyvista.CellType.HEXAHEDRON  # noqa: PLR2004
    grid = pyvista.UnstructuredGrid({kind: fields.cells}, fields.position)
    grid.point_data["displacement"] = fields.displacement
    grid.point_data["stress"] = fields.stress.reshape(-1, 9)
    grid.point_data["von_mises"] = fields.von_mises
    grid.cell_data["layer"] = fields.layer
    grid.save(path)


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadCurve:
    """Curve of load over depth: indentations at ascending loads or depths of one loading path.

    Attributes:
        indentations: Results of the presses, one for each point of the curve, in ascending order of load.
        wanted: Requested number of points [-].
        stopped: Reason why the path ended before the last target; empty if it reached the target.
        note: Number of reached points if the path ended early, and a model that is not computed; else empty.
    """

    indentations: Sequence[Indentation]
    wanted: int
    stopped: str = ""
    note: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return the curve under the names that the command line prints as JSON."""
        return {"curve": self.rows(), "wanted": self.wanted, "stopped": self.stopped or None}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of all points of the curve, each once, with the range of loads and of the numbers in it."""
        found: dict[str, list[tuple[float, list[str]]]] = {}
        for each in self.indentations:
            for sentence in each.warnings:
                found.setdefault(_NUMBER.sub("#", sentence), []).append((each.total_force, _NUMBER.findall(sentence)))
        return tuple(self._join_warnings(form, *zip(*points, strict=True)) for form, points in found.items())

    def _join_warnings(self, form: str, loads: Sequence[float], numbers: Sequence[Sequence[str]]) -> str:
        """Join warnings that differ in their numbers, which `#` replaces in `form`, to one with their ranges."""
        spans = iter(dict.fromkeys((min(each, key=float), max(each, key=float))) for each in zip(*numbers, strict=True))
        where = " to ".join(dict.fromkeys((f"{loads[0]:.4g} N", f"{loads[-1]:.4g} N")))
        count = f" ({len(loads)} of {len(self.indentations)} points)" if len(loads) > 1 else ""
        return f"at {where}{count}: " + re.sub("#", lambda _: "..".join(next(spans)), form)

    def rows(self) -> list[dict[str, Any]]:
        """Return one row for each point of the curve, as names with values in SI units.

        A row holds load, depth, contact area, energy, forces, balance, error estimates and warnings.
        """
        return [
            {
                "load_N": each.total_force,
                "depth_m": each.depth,
                "contact_area_m2": each.contact_area,
                "energy_J": each.energy,
                "peak_texel_N": float(np.abs(each.texel_forces).max()),
                "outside_N": each.outside,
                "balance": each.balance,
                **{f"error_{name}": value for name, value in each.error_estimate.items()},
                "warnings": list(each.warnings),
            }
            for each in self.indentations
        ]

    def write(self, folder: Path) -> tuple[str, ...]:
        """Write `curve.csv` and, if matplotlib is installed, the picture `curve.png`.

        The picture shows load and largest texel force over depth, with error bars from the error estimates.

        Args:
            folder: An existing folder to write to.

        Returns:
            The names of the written files.

        Raises:
            OSError: If the folder cannot be written.
        """
        rows = [row | {"warnings": "; ".join(row["warnings"])} for row in self.rows()]
        write_rows(folder / "curve.csv", rows[0], (row.values() for row in rows))
        return ("curve.csv", *save_figure(folder / "curve.png", self._draw))

    def _draw(self, path: Path) -> None:
        """Draw load and largest texel force over depth, with error bars from the error estimates."""
        rows = self.rows()
        values = {name: np.array([row[name] for row in rows]) for name in rows[0] if name != "warnings"}
        with open_figure(path, width=COLUMN, height=2.8) as figure:
            axes = figure.subplots()
            for name, label, kind in (("load_N", "load", "fem"), ("peak_texel_N", "largest texel force", "fit")):
                error = values[f"error_{'total_force' if name == 'load_N' else 'peak_texel'}"] * values[name]
                depth_error = 1e3 * values["error_depth"] * values["depth_m"]
                x, y = np.append(0, 1e3 * values["depth_m"]), np.append(0, values[name])
                axes.errorbar(
                    x, y, yerr=np.append(0, error), xerr=np.append(0, depth_error), fmt=".-", capsize=2,
                    label=label, color=COLOURS[kind],
                )  # fmt: skip
            axes.set(xlabel="depth [mm]", ylabel="force [N]", xlim=(0, None), ylim=(0, None))
            stopped = "; the path stopped" if self.stopped else ""
            axes.set_title(f"loading by finite elements, with estimated errors{stopped}")
            axes.legend()
