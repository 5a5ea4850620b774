"""Bodies as STL files, made by other libraries."""

import manifold3d
import numpy as np
import pytest
import trimesh

from tests.support.outlines import HEXAGONS, LETTER


def _extrude(*polygons):
    section = manifold3d.CrossSection([np.array(polygon) * 1e3 for polygon in polygons], manifold3d.FillRule.EvenOdd)
    return _make_mesh(manifold3d.Manifold.extrude(section, 8))


def _make_mesh(solid):
    mesh = solid.to_mesh()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts)


def _make_two_balls():
    ball = manifold3d.Manifold.sphere(3, 20)
    return _make_mesh(ball.translate([-2, 0, 0]) + ball.translate([2, 0.5, 0.3]))


def _make_cup():
    return _make_mesh(
        manifold3d.Manifold.cylinder(5, 6, 6, 24) - manifold3d.Manifold.cylinder(5, 4, 4, 24).translate([0, 0, -2])
    )


#: Bodies by name, as meshes in mm.
BODIES = {
    "sphere": lambda: trimesh.creation.icosphere(3, 5.0),
    "box": lambda: trimesh.creation.box((10, 6, 5)),
    "cylinder": lambda: trimesh.creation.cylinder(4, 8, sections=96),
    "nut": lambda: _extrude(*HEXAGONS),
    "h": lambda: _extrude(LETTER),
    "two-balls": _make_two_balls,
    "cup": _make_cup,
    "pyramid": lambda: trimesh.convex.convex_hull(
        np.array([[0, 0, 0], [5, 5, 4], [-5, 5, 4], [-5, -5, 4], [5, -5, 4.0]])
    ),
}


@pytest.fixture(scope="session")
def body():
    """A body of `BODIES` as a mesh in mm, moved off the origin."""

    def make(name):
        mesh = BODIES[name]()
        mesh.apply_translation([31, -17, 12])
        return mesh

    return make


@pytest.fixture
def write_stl(tmp_path, body):
    """Write a body as an STL file: its path."""

    def write(name, file_type="stl"):
        path = tmp_path / f"{name}.stl"
        path.write_bytes(_export(body(name), file_type))
        return path

    return write


def _export(mesh, file_type):
    content = mesh.export(file_type=file_type)
    return content.encode() if isinstance(content, str) else content
