"""Draws covers with pyvista: three views in one PNG, and glTF for other programs.

The views are the deformed surface, a section through the contact, and the forces on the texels.
"""

# ruff: noqa: ANN401 -- types of pyvista differ between versions
from __future__ import annotations

import logging
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from meshes.array_types import FloatArray
from meshes.solids.texels import tangent_axes
from validation.extras import MissingExtraError
from validation.scene.cover_scene import PARTS, CoverScene
from validation.scene.rendering import RenderingError, open_plotter

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class _Style:
    """Sizes and colours of the pictures of covers; chosen for good visibility."""

    #: Width of one view [pixels].
    width: int = 800
    #: Height of the picture [pixels].
    height: int = 820
    #: Name of the colour map of the pressure on the surface of a cover.
    pressure_map: str = "YlGnBu"
    #: Colours of the left-out, touchable and bonded parts of a cover without load.
    part_colours: tuple[str, ...] = ("#f4a261", "#8ecae6", "#6d597a")
    #: Name of the colour map of the values in the section through a cover.
    stress_map: str = "YlOrRd"
    #: Name of the colour map of the forces on texels.
    force_map: str = "viridis"
    #: Colour of surfaces that have no values.
    plain: str = "#b9c4cf"
    #: Colour of an indenter, as in `validation.render.figure`.
    indenter: str = "#7d8794"
    #: Opacity of an indenter over the surface that it covers [-].
    glass: float = 0.35
    #: Distance by which an indenter is lifted off the surface, over the thickness of the cover [-].
    lift: float = 0.01
    #: Height up to which an indenter is drawn, over the smaller edge of the drawn cover [-].
    cut: float = 0.35
    #: Quantile of the values of a surface that has the last colour of the scale [-].  Larger values have the same
    #: colour, because stresses are infinite at sharp edges.
    highest: float = 0.999
    #: Smallest value on a logarithmic scale of colours, over the largest value [-].
    decades: float = 1e-4
    #: Largest number of intervals into which the marks on an edge of the ruled box divide the edge [-].
    intervals: int = 8
    #: Accepted distances of two marks on an edge of the ruled box, up to a factor of a power of ten [-].
    steps: tuple[float, ...] = (1.0, 2.0, 5.0, 10.0)
    #: Least span of an edge or of a scale of colours [mm, kPa or mN].
    least: float = 1e-9
    #: Least cosine of the angle between the camera and the normal of a section [-].
    facing: float = 0.7
    #: Largest length by which a cover may reach out of the ruled box, over the distance of two marks on its edge [-].
    slack: float = 0.1
    #: Fraction of ambient light [-], so large that colours on faces in the shade are readable.
    ambient: float = 0.5
    #: Height of the bar of the largest texel force, over the largest edge of the array [-].
    bar: float = 0.3
    #: Fraction of the height of a view within which the ruled box lies [-].  The rest is for title, labels and colours.
    tall: float = 0.7
    #: Share of the width of a view within which the ruled box lies [-].
    wide: float = 0.75
    #: Shift of the middle of the ruled box upwards, over half of the height [-].
    raised: float = 0.1
    #: Distance of the title of a colour bar from its labels [pixels].
    apart: int = 24
    #: Magnitude of a negative force, over the largest force, up to which the colour scale of forces begins at zero [-].
    hardly: float = 0.02


_STYLE = _Style()
#: Direction from the middle of a cover with texels on one side to the camera, of any length, shape (3,) [-].
_VIEW = np.array([0.35, -0.75, 0.55])
#: Direction from the middle of a cover with texels on all sides to the camera, of any length, shape (3,) [-].
_VIEW_ROUND = np.array([0.75, 0.6, 0.5])
#: Faces of a bar, as indices of its 8 corners.
_FACES = ((3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
#: Length in the pictures per length in the scene: pictures are in millimetres, glTF is in metres [-].
_MILLIMETRES = 1e3


def write_picture(scene: CoverScene, path: Path) -> None:
    """Draw a scene to a PNG file.

    Args:
        scene: Scene to draw.
        path: File to write; its name ends in `.png`.

    Raises:
        ImportError: If pyvista is not installed.
        RenderingError: If this machine can draw no picture.
        OSError: If the file cannot be written.
    """
    views = [_draw_surface, _draw_section]
    if scene.texels is not None:
        views.append(_draw_texels)
    size = (_STYLE.width * len(views), _STYLE.height)
    with open_plotter(shape=(1, len(views)), window_size=size, border=False) as plotter:
        plotter.set_background("white", all_renderers=True)
        plotter.enable_anti_aliasing("ssaa", all_renderers=True)
        for column, draw in enumerate(views):
            plotter.subplot(0, column)
            draw(plotter, scene)
            plotter.add_axes(color="black", line_width=2, viewport=(0.0, 0.0, 0.16, 0.16))
        plotter.screenshot(str(path))


def write_gltf(scene: CoverScene, path: Path) -> None:
    """Write the deformed cover, with its colours, and the texel forces to one glTF file in metres.

    Args:
        scene: Scene to write.
        path: File to write; its name ends in `.gltf`.

    Raises:
        ImportError: If pyvista is not installed.
        RenderingError: If this machine can draw no picture.
        OSError: If the file cannot be written.
    """
    with open_plotter() as plotter:
        surface = _crop(make_grid(scene), scene, 1.0).warp_by_vector("displacement")
        surface = surface.extract_surface(algorithm="dataset_surface")
        # Viewers of glTF support colours of points, not values with a colour scale.
        if scene.surface is None:
            plotter.add_mesh(surface, color=_STYLE.plain)
        else:
            plotter.add_mesh(
                surface, scalars="surface", cmap=_STYLE.pressure_map, clim=_find_limits(scene, "surface")[:2]
            )
        if scene.texel_forces is not None:
            bars = make_bars(scene, 1.0)
            plotter.add_mesh(bars, scalars="force", cmap=_STYLE.force_map, clim=_find_force_limits(scene)[:2])
        plotter.export_gltf(str(path), inline_data=True)


def make_grid(scene: CoverScene, length: float = 1.0) -> Any:
    """Make the undeformed cover with its values as a grid of VTK.

    Args:
        scene: The scene.
        length: Length in the grid per metre [1/m].
    """
    import pyvista

    kind = pyvista.CellType.HEXAHEDRON if scene.cells.shape[1] == 8 else pyvista.CellType.TETRA  # noqa: PLR2004
    grid = pyvista.UnstructuredGrid({kind: scene.cells}, length * scene.position)
    grid.point_data["displacement"] = length * scene.displacement
    for name in ("surface", "inside"):
        if (values := getattr(scene, name)) is not None:
            grid.point_data[name] = values
    if scene.layer is not None:
        grid.cell_data["layer"] = scene.layer
    return grid


def make_bars(scene: CoverScene, length: float) -> Any:
    """Make one bar for each active texel: its base is the texel, its height the force on it along the texel's normal.

    Args:
        scene: A scene with texels and forces on them.
        length: Length in the grid per metre [1/m].
    """
    import pyvista

    texels = scene.texels
    assert texels is not None  # noqa: S101 -- stated above
    shown = np.flatnonzero(texels.active)
    values = np.zeros(texels.count) if scene.texel_forces is None else scene.texel_forces
    highest = _STYLE.bar * float(np.ptp(texels.centres, axis=0).max())
    scale = highest / max(float(np.abs(values).max()), np.finfo(float).tiny)
    heights = np.maximum(scale * values, 0.01 * _STYLE.bar * highest)[shown, None, None]
    axes = tangent_axes(texels.normals) * (0.5 * np.array(texels.texel_size))[:, None] * 0.94
    flat = texels.centres[shown, None] + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ axes[shown]
    points = np.concatenate([flat, flat + heights * texels.normals[shown, None]], axis=1)
    faces: Any = np.array(_FACES) + 8 * np.arange(len(shown))[:, None, None]
    bars = pyvista.PolyData.from_regular_faces(length * points.reshape(-1, 3), faces.reshape(-1, 4))
    bars.cell_data["force"] = np.repeat(1e3 * values[shown], len(_FACES))
    return bars


def _draw_surface(plotter: Any, scene: CoverScene) -> None:
    """Draw the first view of a cover: its deformed surface, with an arrow along the load."""
    grid = _crop(make_grid(scene, _MILLIMETRES), scene, _MILLIMETRES)
    surface = _add_coloured(plotter, grid, scene, "surface", _STYLE.pressure_map)
    if scene.indenter is not None:
        plotter.add_mesh(make_indenter(scene, surface), color=_STYLE.indenter, opacity=_STYLE.glass)
    scale = "; to scale" if scene.displacement.any() else ""
    _finish(plotter, scene, surface, f"{scene.title}\ncover{scale}")


def make_indenter(scene: CoverScene, surface: Any) -> Any:
    """Make the surface of the pressed indenter in millimetres, cut off above the drawn cover.

    Args:
        scene: A scene with an indenter.
        surface: The drawn surface of the cover in millimetres.
    """
    import pyvista

    assert scene.indenter is not None  # noqa: S101 -- stated above
    pose, bodies = scene.pose, []
    # Lifted a little, so that no face of it lies in the surface that it touches.
    place = pose.position - _STYLE.lift * scene.thickness * pose.towards
    for part in scene.indenter.primitives():
        if part.kind == "hull":
            points = np.array(part.vertices)
            body = pyvista.PolyData.from_regular_faces(points, ConvexHull(points).simplices.astype(int))
        elif part.kind == "box":
            body = pyvista.Box(bounds=np.outer(part.size, (-1, 1)).ravel())
        elif part.kind == "sphere":
            body = pyvista.Sphere(radius=part.size[0], theta_resolution=96, phi_resolution=96)
        elif part.kind == "cylinder":
            body = pyvista.Cylinder(direction=(0, 0, 1), radius=part.size[0], height=2 * part.size[1])
        else:
            body = pyvista.Capsule(direction=(0, 0, 1), radius=part.size[0], cylinder_length=2 * part.size[1])
        turn = Rotation.from_quat(part.quaternion, scalar_first=True).as_matrix()
        local = np.asarray(body.points) @ turn.T + part.position
        body.points = _MILLIMETRES * (place + local @ pose.rotation.T)
        bodies.append(body)
    extents = np.ptp(np.reshape(surface.bounds, (3, 2)), axis=1)
    end = _MILLIMETRES * pose.position - _STYLE.cut * float(np.sort(extents)[1]) * pose.towards
    return pyvista.merge(bodies).extract_surface(algorithm="dataset_surface").clip(normal=-pose.towards, origin=end)


def _draw_section(plotter: Any, scene: CoverScene) -> None:
    """Draw the second view of a cover: the half of the deformed body behind a plane through the contact."""
    origin, normal = _find_section(scene)
    grid = _crop(make_grid(scene, _MILLIMETRES), scene, _MILLIMETRES)
    half = grid.clip(normal=normal, origin=_MILLIMETRES * origin)
    surface = _add_coloured(plotter, half, scene, "inside", _STYLE.stress_map)
    if scene.indenter is not None:
        body = make_indenter(scene, surface).clip(normal=normal, origin=_MILLIMETRES * origin)
        plotter.add_mesh(body, color=_STYLE.indenter, ambient=_STYLE.ambient)
    _outline_layers(plotter, grid, scene, normal, _MILLIMETRES * origin)
    place = ", ".join(f"{round(1e3 * each, 2) + 0.0:g}" for each in origin)
    layers = "".join(f"\n{name}" for name in scene.layers[::-1])
    text = f"\nsection through ({place}) mm{'; from the top:' * bool(layers)}{layers}"
    view = _find_view(scene)
    if scene.touched is not None and view @ normal < _STYLE.facing:  # The plane would be seen from its edge.
        across = view - (view @ normal) * normal
        view = _STYLE.facing * normal + np.sqrt(1 - _STYLE.facing**2) * across / np.linalg.norm(across)
    _finish(plotter, scene, surface, text, view=view)


def _outline_layers(plotter: Any, grid: Any, scene: CoverScene, normal: FloatArray, origin: FloatArray) -> None:
    """Draw the borders of the layers on the plane of a section."""
    plane = origin - _MILLIMETRES * 1e-3 * scene.thickness * normal  # Just behind the plane every element is cut.
    cut = grid.warp_by_vector("displacement").slice(normal=normal, origin=plane)
    for index in range(len(scene.layers)):
        part = cut.threshold((index, index), scalars="layer").extract_surface(algorithm="dataset_surface").clean()
        part.points -= 2 * (plane - origin)  # in front of the plane, where nothing hides it
        edges = part.extract_feature_edges(feature_edges=False, manifold_edges=False, non_manifold_edges=False)
        plotter.add_mesh(edges, color="#303030", line_width=2)


def _draw_texels(plotter: Any, scene: CoverScene) -> None:
    """Draw the third view of a cover: the forces on its texels as bars."""
    bars = make_bars(scene, _MILLIMETRES)
    if scene.texel_forces is None:
        plotter.add_mesh(bars, color="#3a7ca5", show_edges=True)
        text = "\ntexels on the base"
    else:
        *limits, marks = _find_force_limits(scene)
        plotter.add_mesh(
            bars, scalars="force", cmap=_STYLE.force_map, clim=limits, show_edges=True,
            scalar_bar_args=_bar("force on the texel [mN]", marks), edge_color="#808080", line_width=1,
            ambient=_STYLE.ambient, diffuse=1 - _STYLE.ambient,
        )  # fmt: skip
        text = f"\n{int(scene.texels.active.sum())} texels, {scene.texel_forces.sum():.4f} N on them"  # type: ignore[union-attr]
    if _is_round(scene):
        base = make_grid(scene, 0.999 * _MILLIMETRES).extract_surface(algorithm="dataset_surface")
        plotter.add_mesh(base, color=_STYLE.plain, opacity=0.12)
    _finish(plotter, scene, bars, text, height=_is_round(scene))


def _add_coloured(plotter: Any, grid: Any, scene: CoverScene, name: str, colours: str | list[str]) -> Any:
    """Add the deformed surface of a grid in the colours of its values, or with its edges if it has none; return it."""
    deformed = grid.warp_by_vector("displacement")
    surface = deformed.extract_surface(algorithm="dataset_surface")
    if getattr(scene, name) is None:
        plotter.add_mesh(surface, color=_STYLE.plain, smooth_shading=False)
        plotter.add_mesh(surface.extract_all_edges(), color="#51606e", line_width=1)
        return surface
    *limits, marks = _find_limits(scene, name)
    bar, words = _bar(getattr(scene, f"{name}_label"), marks), None
    if not scene.displacement.any():  # parts of an unloaded cover, with their names at the middles of their colours
        plotter.add_mesh(surface.extract_all_edges(), color="#51606e", line_width=1)
        colours, limits, bar["n_labels"] = list(_STYLE.part_colours), [0.5, len(PARTS) + 0.5], 0
        bar["position_y"] = 0.06  # the names stand below the colours
        words = {float(number): word for number, word in enumerate(PARTS, 1)}
    plotter.add_mesh(
        surface, scalars=name, cmap=colours, clim=limits, log_scale=name == "inside" and scene.logarithmic,
        scalar_bar_args=bar, annotations=words, ambient=_STYLE.ambient, diffuse=1 - _STYLE.ambient,
    )  # fmt: skip
    return surface


def _finish(
    plotter: Any, scene: CoverScene, shown: Any, text: str, *, height: bool = True, view: FloatArray | None = None
) -> None:
    """Add title and ruled edges to a view and place its camera.

    Args:
        plotter: The plotter, at its view.
        scene: The scene.
        shown: The drawn body.
        text: Title of the view.
        height: Whether the edge along z is ruled.
        view: Unit vector from the middle of the scene to the camera, shape (3,) [-]; that of the scene if None.
    """
    title = plotter.add_text(text, position=(0.01, 0.985), viewport=True, font_size=11, color="black")
    title.prop.justification_vertical = "top"
    bounds, counts = [], []
    for axis in range(3):
        low, high, count = _round_edge(float(shown.bounds[2 * axis]), float(shown.bounds[2 * axis + 1]))
        bounds += [low, high]
        counts.append(count)
    longest = float(np.diff(np.reshape(bounds, (3, 2))).max())
    if (bounds[5] - bounds[4]) / longest * _STYLE.intervals < (counts[2] - 1) / 2:
        counts[2] = 2  # The edge is too short for more than the marks at its ends.
    ruled = plotter.show_bounds(
        bounds=bounds, location="outer", ticks="outside",
        xtitle="x [mm]", ytitle="y [mm]", ztitle="z [mm]" if height else " ",
        color="#404040", font_size=12, n_xlabels=counts[0], n_ylabels=counts[1], n_zlabels=counts[2],
        minor_ticks=False, fmt="%.4g", show_zlabels=height,
    )  # fmt: skip
    ruled.SetZAxisVisibility(height)  # pyvista 0.49 shows the axis although its option `show_zaxis` is off.
    for bar in plotter.scalar_bars.values():
        bar.SetVerticalTitleSeparation(_STYLE.apart)
    corners = np.array(list(product(*np.reshape(bounds, (3, 2)))))
    view = _find_view(scene) if view is None else view
    up = np.array([0.0, 0.0, 1.0])
    upward = up - (up @ view) * view
    upward /= np.linalg.norm(upward)
    tall, wide = (float(np.ptp(corners @ along)) / 2 for along in (upward, np.cross(upward, view)))
    half = max(tall / _STYLE.tall, wide / _STYLE.wide * _STYLE.height / _STYLE.width)
    middle = corners.mean(axis=0) - _STYLE.raised * half * upward
    plotter.camera_position = [middle + 2.5 * np.linalg.norm(np.ptp(corners, axis=0)) * view, middle, up]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = half


def _round_edge(low: float, high: float) -> tuple[float, float, int]:
    """Round the ends of an edge outwards to multiples of a round interval; return them and the number of marks."""
    least = max(high - low, _STYLE.least) / _STYLE.intervals
    power = 10.0 ** np.floor(np.log10(least))
    step = power * min(each for each in _STYLE.steps if each * power >= least * (1 - 1e-9))
    first, last = np.floor(low / step + _STYLE.slack), np.ceil(high / step - _STYLE.slack)
    return float(first * step), float(last * step), int(last - first) + 1


def _find_view(scene: CoverScene) -> FloatArray:
    """Return the unit vector from the middle of the scene to the camera, shape (3,) [-]."""
    if not _is_round(scene):
        return np.asarray(_VIEW / np.linalg.norm(_VIEW))
    view = _VIEW_ROUND / np.linalg.norm(_VIEW_ROUND)
    if scene.touched is not None:
        view = view - 1.2 * scene.pose.towards
    return np.asarray(view / np.linalg.norm(view))


def _is_round(scene: CoverScene) -> bool:
    """Return whether the texels of a scene face in several directions."""
    return scene.texels is not None and not scene.texels.planar


def _find_section(scene: CoverScene) -> tuple[FloatArray, FloatArray]:
    """Return a point of the cutting plane of the section [m], and its unit normal towards the half cut away [-]."""
    up = np.array([0.0, 0.0, 1.0]) if scene.touched is None else -scene.pose.towards
    middle = (scene.position.min(axis=0) + scene.position.max(axis=0)) / 2
    view = _find_view(scene)
    level = view - (view @ up) * up
    axis = int(np.argmax(np.abs(level)))
    normal = np.sign(level[axis]) * np.eye(3)[axis]
    normal = normal - (normal @ up) * up
    return np.asarray(middle if scene.touched is None else scene.touched), normal / np.linalg.norm(normal)


def _crop(grid: Any, scene: CoverScene, length: float) -> Any:
    """Cut off a wide cover at the distance `limits` of the scene from the contact."""
    if scene.touched is None or not np.isfinite(scene.limits):
        return grid
    for axis, sign in product((0, 1), (1.0, -1.0)):
        edge, along = length * (scene.touched[axis] + sign * scene.limits), np.eye(3)[axis]
        if (sign * (grid.points[:, axis] - edge) > 0).any():
            grid = grid.clip(normal=sign * along, origin=edge * along)
    return grid


def _find_limits(scene: CoverScene, name: str) -> tuple[float, float, int]:
    """Find the round values that have the first and the last colour of the scale of values `name`, and its marks."""
    values = getattr(scene, name)
    # No displacement is cut off by the quantile, because displacements are finite everywhere.
    share = 1.0 if getattr(scene, f"{name}_label").startswith("displacement") else _STYLE.highest
    high = float(np.quantile(values[np.abs(values) > 0], share)) if values.any() else 1.0
    high = max(high, _STYLE.least)
    if name == "inside" and scene.logarithmic:
        power = 10.0 ** np.floor(np.log10(high))
        high = power * min(each for each in _STYLE.steps if each * power >= high)
        return _STYLE.decades * high, high, round(-np.log10(_STYLE.decades)) + 1
    return _round_edge(0.0, high)


def _find_force_limits(scene: CoverScene) -> tuple[float, float, int]:
    """Find the round texel forces that have the first and the last colour of the scale [mN], and its marks."""
    forces = np.zeros(1) if scene.texel_forces is None else 1e3 * scene.texel_forces
    low, high = float(forces.min()), float(forces.max())
    return _round_edge(0.0 if low > -_STYLE.hardly * high else low, max(high, _STYLE.least))


def _bar(title: str, marks: int) -> dict[str, Any]:
    """Return the settings of the colour bar at the bottom of a view, and its marks, as options of pyvista."""
    return {
        "title": title, "color": "black", "vertical": False, "position_x": 0.22, "position_y": 0.01, "width": 0.7,
        "height": 0.11, "n_labels": marks, "fmt": "%.4g", "title_font_size": 22, "label_font_size": 18,
    }  # fmt: skip


def write_scene(scene: CoverScene | None, folder: Path) -> tuple[str, ...]:
    """Write `cover.png`, `cover.gltf` and, for ParaView, `cover.vtu`.

    Without pyvista no file is written, without a renderer no picture.  One line of warning states this.

    Args:
        scene: Scene to draw; None for nothing.
        folder: An existing folder to write to.

    Returns:
        The names of the written files.

    Raises:
        OSError: If the folder cannot be written.
    """
    if scene is None:
        return ()
    try:
        make_grid(scene).save(folder / "cover.vtu")
        write_picture(scene, folder / "cover.png")
        write_gltf(scene, folder / "cover.gltf")
    except ImportError:
        _LOG.warning("no cover.png: %s", MissingExtraError("pyvista"))
        return ()
    except RenderingError as error:
        _LOG.warning("no cover.png: %s", error)
        return ("cover.vtu",)
    return ("cover.png", "cover.gltf", "cover.vtu")


def lacks_picture(files: tuple[str, ...]) -> bool:
    """Return whether a picture is missing among the files of a cover because this machine cannot draw."""
    return "cover.vtu" in files and "cover.png" not in files
