"""Files of one indentation: results, forces, fields in the cover, pictures, and curves of load over depth."""

from __future__ import annotations

import csv
import logging
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from meshes import TexelArray
from meshes.bounded_file import pack_npz
from meshes.solids import write_mesh
from validation.cover_meshes import MESH_FILE
from validation.extras import MissingExtraError
from validation.json_values import json_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fastmodel import FastIndentation
    from fem_reference.fields.cover_fields import CoverFields
    from fem_reference.indentation.result import Indentation
    from meshes.array_types import FloatArray
    from validation.campaign.comparison import Comparison

_LOG = logging.getLogger(__name__)

#: Tolerance with which nodes are found on the top of the cover and in the plane of the drawn depth profile, over the
#: thickness of the cover [-].
_IN_PLANE = 1e-6
#: Half the width of the drawn depth profile of the cover, over the radius of the contact area [-].
_EXTENT = 4.0


def describe_force(found: Indentation | FastIndentation) -> str:
    """Describe the force of a press [N]: its parts on a flat base, which add up to it, or its component on a solid."""
    total, outside = found.total_force, found.outside
    if getattr(found, "mesh", found.force) is not None:
        return f"{total:.4f} N along the motion"
    texels = float(found.texel_forces.sum())
    # Adding 0.0 removes the minus sign of a value that is rounded to negative zero.
    outside, rest = (round(each, 4) + 0.0 for each in (outside, total - texels - outside))
    text = f"{total:.4f} N: {texels:.4f} N on the texels, {outside:.4f} N outside the array"
    return f"{text}, {rest:+.4f} N not balanced" if rest else text


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
    _write_rows(folder / "texels.csv", ("x_m", "y_m", "z_m", "nx", "ny", "nz", "force_N"), texels.tolist())
    touched = found.contact_forces.any(axis=1)
    contact = np.column_stack([found.contact_points, found.contact_forces])[touched]
    _write_rows(folder / "contact.csv", ("x_m", "y_m", "z_m", "force_x_N", "force_y_N", "force_z_N"), contact.tolist())
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
    title = f"{case.shape} on {array.name}, {found.total_force:.4f} N"
    scene = show_indentation(found, array, direction=case.pose.towards, title=title)
    return (*files, *write_picture(comparison, folder), *write_scene(scene, folder))


def _write_rows(path: Path, names: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
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


def write_picture(comparison: Comparison, folder: Path) -> tuple[str, ...]:
    """Write `press.png`, if matplotlib is installed: texel forces of the models, their difference, the depth profile.

    Args:
        comparison: Result of at least one of the models.
        folder: An existing folder to write to.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        _LOG.warning("no picture: %s", MissingExtraError("matplotlib"))
        return ()
    images = list(list_images(comparison))
    fields = None if comparison.fem is None else comparison.fem.fields
    panels = len(images) + (fields is not None)
    figure = Figure(figsize=(2.9 * panels + 1.5, 4.4), layout="constrained")
    ratios = [1.0] * len(images) + [1.7] * (fields is not None)
    axes = np.atleast_1d(np.asarray(figure.subplots(1, panels, width_ratios=ratios)))
    peak = max(float(np.max(np.abs(forces))) for _, forces in images) or 1.0
    for panel, (title, forces) in zip(axes, images, strict=False):
        _draw_image(panel, comparison.sensor.array, title, forces, peak=peak)
    if fields is not None:
        _draw_profile(axes[-1], comparison, fields)
    case, found = comparison.case, comparison.fem or comparison.fast
    title = f"{case.shape} on {comparison.sensor.array.name}"
    figure.suptitle(f"{title}\n{describe_force(found)}" if found else title, fontsize="medium")
    figure.savefig(folder / "press.png", dpi=150)
    return ("press.png",)


def list_images(comparison: Comparison) -> Iterator[tuple[str, FloatArray]]:
    """Yield title and texel forces of each computed model, shape (n,) [N].

    If both models are computed, the difference of the fast model from the finite elements follows.
    """
    fem = comparison.fem if "fem" in comparison.models else None
    if fem is not None:
        yield "finite elements", fem.texel_forces
    if comparison.fast is not None:
        yield "fast model", comparison.fast.texel_forces
    if fem is not None and comparison.fast is not None:
        yield "difference", comparison.fast.texel_forces - fem.texel_forces


def find_profile(fields: CoverFields, at: tuple[float, float], yaw: float) -> tuple[FloatArray, FloatArray]:
    """Find the depth profile: the surface of the deformed cover along the indenter's x axis.

    Args:
        fields: Displacement in the cover.
        at: Position of the indenter's axis in the frame of the array [m].
        yaw: Rotation of the indenter about its axis [rad].

    Returns:
        Distances from the axis after deformation, ascending, shape (k,) [m], and displacements along z at these points,
        shape (k,) [m].  Tangential displacements also move the points along the axis.
    """
    top = float(fields.position[:, 2].max())
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    if fields.axisymmetric:
        turn = np.eye(2)
    local = (fields.position[:, :2] - at) @ turn.T
    moved = (fields.position[:, :2] + fields.displacement[:, :2] - at) @ turn.T
    on_top = np.abs(fields.position[:, 2] - top) < _IN_PLANE * top
    nearest = float(np.abs(local[on_top, 1]).min())
    chosen = on_top & (np.abs(local[:, 1]) <= nearest + _IN_PLANE * top)
    distance, height = moved[chosen, 0], fields.displacement[chosen, 2]
    if fields.axisymmetric:
        distance, height = np.concatenate([-distance, distance]), np.concatenate([height, height])
    order = np.argsort(distance, kind="stable")
    return distance[order], height[order]


def _draw_image(axes: Axes, array: TexelArray, title: str, forces: FloatArray, *, peak: float) -> None:
    """Draw one image of texel forces in mN, row 0 at the bottom.

    Forces have the colours from zero to `peak` [N].  The difference of two models has a symmetric scale of its own.
    """
    image = np.where(array.image(array.active), 1e3 * np.asarray(array.image(forces), dtype=np.float64), np.nan)
    signed = title == "difference"
    top = float(np.nanmax(np.abs(image))) or 1.0 if signed else 1e3 * peak
    aspect, colours, least = array.pitch[1] / array.pitch[0], "RdBu_r" if signed else "viridis", -top if signed else 0.0
    drawn = axes.imshow(image, origin="lower", aspect=aspect, cmap=colours, vmin=least, vmax=top)
    axes.set(title="fast - finite elements" if signed else title, xlabel="column", ylabel="row")
    axes.figure.colorbar(drawn, ax=axes, label="mN", location="bottom", shrink=0.8)


def _draw_profile(axes: Axes, comparison: Comparison, fields: CoverFields) -> None:
    case, fem = comparison.case, comparison.fem
    distance, height = find_profile(fields, case.pose.at, case.pose.yaw)
    radius = math.sqrt(fem.contact_area / math.pi) if fem is not None else 0.0
    extent = max(_EXTENT * radius, 2 * float(fields.position[:, 2].max()))
    shown = np.abs(distance) <= extent
    axes.plot(1e3 * distance[shown], 1e3 * height[shown], label="surface of the cover")
    if fem is not None:
        axes.axhline(-1e3 * fem.depth, linestyle=":", color="grey", label=f"depth {1e3 * fem.depth:.3g} mm")
    axes.axhline(0.0, linewidth=0.6, color="grey")
    axes.set(xlabel="along the indenter's x axis [mm]", ylabel="height above rest [mm]", title="depth profile")
    axes.legend(frameon=False, loc="center left", fontsize="small")


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadCurve:
    """Curve of load over depth: indentations at ascending loads or depths of one loading path.

    Attributes:
        indentations: Results of the presses, one for each point of the curve, in ascending order of load.
        wanted: Requested number of points [-].
        stopped: Reason why the path ended before the last target; empty if it reached the target.
    """

    indentations: Sequence[Indentation]
    wanted: int
    stopped: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return the curve under the names that the command line prints as JSON."""
        return {"curve": self.rows(), "wanted": self.wanted, "stopped": self.stopped or None}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of all points of the curve, each once, with the load at which it first occurs."""
        first: dict[str, float] = {}
        for each in self.indentations:
            for sentence in each.warnings:
                first.setdefault(sentence, each.total_force)
        return tuple(f"at {load:.4g} N: {sentence}" for sentence, load in first.items())

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
        _write_rows(folder / "curve.csv", rows[0], (row.values() for row in rows))
        try:
            from matplotlib.figure import Figure
        except ImportError:
            _LOG.warning("no picture: %s", MissingExtraError("matplotlib"))
            return ("curve.csv",)
        values = {name: np.array([row[name] for row in rows]) for name in rows[0] if name != "warnings"}
        figure = Figure(figsize=(7, 4.5), layout="constrained")
        axes = figure.subplots()
        for name, label in (("load_N", "load"), ("peak_texel_N", "largest texel force")):
            error = values[f"error_{'total_force' if name == 'load_N' else 'peak_texel'}"] * values[name]
            depth_error = 1e3 * values["error_depth"] * values["depth_m"]
            x, y = np.append(0, 1e3 * values["depth_m"]), np.append(0, values[name])
            axes.errorbar(
                x, y, yerr=np.append(0, error), xerr=np.append(0, depth_error), fmt=".-", capsize=2, label=label
            )
        axes.set(xlabel="depth [mm]", ylabel="force [N]", xlim=(0, None), ylim=(0, None))
        axes.set_title("loading; error bars are the error estimates" + ("; the path stopped" if self.stopped else ""))
        axes.grid(alpha=0.3)
        axes.legend(frameon=False)
        figure.savefig(folder / "curve.png", dpi=150)
        return ("curve.csv", "curve.png")
