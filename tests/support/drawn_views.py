"""What the views of a scene hold without being drawn: meshes, captions, colours, ruled edges and cameras."""

from types import SimpleNamespace

import numpy as np

#: Point of contact and largest distance from it that is drawn [mm].
AT, AROUND = np.array([2.0, 1.0, 2.0]), 4.0
#: Corners of a hexahedron of edge 1 in the order of VTK, shape (8, 3).
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


def describe(renderer):
    """Copy what a renderer holds, as the plotter is closed after the picture."""
    import pyvista

    meshes, texts = [], []
    for actor in renderer.actors.values():
        if isinstance(actor, pyvista.Actor) and isinstance(actor.mapper.dataset, pyvista.DataSet):
            meshes.append(_describe_mesh(actor))
        elif isinstance(actor, pyvista.Text):
            texts.append(actor)
    edges, camera = renderer.cube_axes_actor, renderer.camera
    bars = [bar for bar in renderer.actors.values() if hasattr(bar, "title")]
    return SimpleNamespace(
        meshes=meshes, texts=[text.input for text in texts], ruled=None if edges is None else np.array(edges.bounds),
        titles=[
            SimpleNamespace(position=text.position, size=text.prop.font_size, colour=text.prop.color.hex_rgb,
                            below=text.prop.justification_vertical == "top")
            for text in texts
        ],
        marks=None if edges is None else (edges.n_xlabels, edges.n_ylabels),
        edges=None if edges is None else _describe_edges(edges),
        bars=[bar.title for bar in bars], scales=[_describe_bar(bar) for bar in bars],
        camera=SimpleNamespace(
            position=np.array(camera.position), middle=np.array(camera.focal_point), up=np.array(camera.up),
            half=camera.parallel_scale, parallel=camera.parallel_projection,
        ),
        ground=renderer.background_color.hex_rgb, arrows=_describe_arrows(renderer),
    )  # fmt: skip


def _describe_mesh(actor):
    mapper, prop = actor.mapper, actor.prop
    table, data = mapper.lookup_table, mapper.dataset
    return SimpleNamespace(
        bounds=np.array(data.bounds), points=np.array(data.points), limits=tuple(mapper.scalar_range),
        name=mapper.array_name, opacity=prop.opacity, colour=prop.color.hex_rgb, logarithmic=table.log_scale,
        coloured=mapper.scalar_visibility,
        colours=None if table.values is None else np.array(table.values)[:, :3].tolist(),
        words={float(value): word for value, word in table.annotations.items()},
        ambient=prop.ambient, diffuse=prop.diffuse, lines=prop.line_width, edged=prop.show_edges,
        edge_colour=prop.edge_color.hex_rgb, flat=prop.GetInterpolation() == 0, data=data.copy(),
    )  # fmt: skip


def _describe_bar(bar):
    title, label = bar.GetTitleTextProperty(), bar.GetLabelTextProperty()
    return SimpleNamespace(
        title=bar.title, place=bar.GetPosition(), size=(bar.GetWidth(), bar.GetHeight()), marks=bar.GetNumberOfLabels(),
        numbered=bar.GetDrawTickLabels(),
        level=bar.GetOrientation() == 0, form=bar.GetLabelFormat(), colours=(title.GetColor(), label.GetColor()),
        fonts=(title.GetFontSize(), label.GetFontSize()), apart=bar.GetVerticalTitleSeparation(),
    )  # fmt: skip


def _describe_edges(edges):
    return SimpleNamespace(
        titles=(edges.x_title, edges.y_title, edges.z_title), marks=(edges.n_xlabels, edges.n_ylabels, edges.n_zlabels),
        outwards=edges.GetTickLocation() == 1, outer=edges.GetFlyMode() == 0, form=edges.GetXLabelFormat(),
        minor=edges.GetXAxisMinorTickVisibility(), numbered=edges.z_label_visibility,
        shown=edges.GetZAxisVisibility(), colour=edges.GetXAxesLinesProperty().GetColor(),
        font=edges.GetLabelTextProperty(0).GetFontSize(),
    )  # fmt: skip


def _describe_arrows(renderer):
    widget = getattr(renderer, "axes_widget", None)
    return None if widget is None else tuple(widget.GetViewport())
