"""A scene of a block under a ball, and what its views hold."""

import numpy as np
import pytest

from meshes import Pose, Sphere, TexelArray
from tests.support.drawn_views import AROUND, AT, describe
from validation.scene import draw, rendering
from validation.scene.cover_scene import CoverScene


@pytest.fixture(scope="module")
def scene():
    """A block of 16 x 16 x 2 mm of hexahedra of 1 mm, compressed by 0.05 mm, over 4 x 4 texels."""
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.ImageData(dimensions=(17, 17, 3), origin=(-8.0, -8.0, 0.0)).cast_to_unstructured_grid()
    cells = grid.cells.reshape(-1, 9)[:, 1:]
    cells = np.where(grid.celltypes[:, None] == pyvista.CellType.VOXEL, cells[:, [0, 1, 3, 2, 4, 5, 7, 6]], cells)
    position = 1e-3 * np.asarray(grid.points, dtype=float)
    forces = np.linspace(-0.001, 0.2, 16)
    return CoverScene(
        position=position, displacement=position * [0.0, 0.0, -0.025], cells=cells, thickness=2e-3,
        surface=np.linspace(0.0, 5.0, len(position)), surface_label="pressure [kPa]",
        inside=np.linspace(0.0, 7.0, len(position)), inside_label="displacement [mm]",
        texels=TexelArray.grid(4, 4, pitch=4e-3), texel_forces=forces,
        touched=1e-3 * AT, title="block", limits=1e-3 * AROUND, indenter=Sphere(radius=3e-3),
        pose=Pose(point=tuple(1e-3 * (AT - [0, 0, 0.05]))), layers=("soft, 1 mm", "stiff, 1 mm"),
        layer=(position[cells].mean(axis=1)[:, 2] > 1e-3).astype(int),
    )  # fmt: skip


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    """Return the views of a scene: meshes by their scalars or colour, texts, ruled edges, camera."""
    pyvista = pytest.importorskip("pyvista")
    drawn, path = [], tmp_path_factory.mktemp("views") / "cover.png"

    def screenshot(plotter, to):
        assert to == str(path)
        drawn.extend(map(describe, plotter.renderers))
        drawn.append(plotter.window_size)
        assert plotter.off_screen

    def show(scene):
        drawn.clear()
        draw.write_picture(scene, path)
        return list(drawn)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rendering, "find_window_without_display", lambda: "")
        patch.setattr(pyvista.Plotter, "screenshot", screenshot)
        yield show
