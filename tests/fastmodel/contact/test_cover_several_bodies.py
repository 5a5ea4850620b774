"""The fast model under polygon prisms and bodies of triangles: as under the built-in shapes."""

import numpy as np
import pytest
import trimesh

from fastmodel import indent
from meshes import Box, LetterH, Prism, Sphere, TriangleMesh
from tests.support.cover_data import parameters
from tests.support.outlines import LETTER, RECTANGLE

METHODS = ("boxes", "foundation", "cover")

PARAMETERS = parameters()
POSE = {"load": 2.0, "at": (0.7e-3, -1.1e-3), "yaw": 0.4}
#: Methods that look at the underside; the others go by MuJoCo's contact points, which differ from geom to geom.
SAMPLED = {"cover", "foundation"}
H, SQUARE = Prism(points=LETTER), Prism(points=RECTANGLE)


def standing(mesh):
    """A mesh in mm as a body whose lowest point is at its axis' foot."""
    return TriangleMesh(triangles=1e-3 * (mesh.triangles - [0, 0, mesh.bounds[0, 2]]))


BALL = standing(trimesh.creation.icosphere(3, 5.0))


def misplaced(found, wanted):
    return np.abs(found.texel_forces - wanted.texel_forces).sum() / (2 * POSE["load"])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("prism", "shape"), [(H, LetterH(size=(12e-3, 16e-3), bar=4e-3)), (SQUARE, Box(size=(10e-3, 6e-3, 5e-3)))]
)
def test_a_prism_presses_as_the_shape_it_outlines(prism, shape, method):
    found, wanted = (indent(PARAMETERS, each, contact=method, **POSE) for each in (prism, shape))
    assert found.total_force == pytest.approx(2.0, rel=1e-3)
    assert misplaced(found, wanted) < (1e-3 if method in SAMPLED else 0.2)


@pytest.mark.parametrize("method", METHODS)
def test_a_ball_of_facets_presses_as_a_ball(method):
    found, wanted = (indent(PARAMETERS, each, contact=method, **POSE) for each in (BALL, Sphere(radius=5e-3)))
    assert found.total_force == pytest.approx(2.0, rel=1e-3)
    assert misplaced(found, wanted) < (0.005 if method in SAMPLED else 0.25)


def test_both_balls_of_one_body_press():
    """Between them the hull of both would press; its parts do not."""
    balls = [trimesh.creation.icosphere(2, 3.0).apply_translation([x, 0, 0]) for x in (-2.6, 2.6)]
    body = standing(trimesh.boolean.union(balls, engine="manifold"))
    found = indent(PARAMETERS, body, load=0.5, at=(1.7e-3, 1.7e-3))
    hull = standing(trimesh.boolean.union(balls, engine="manifold").convex_hull)
    whole = indent(PARAMETERS, hull, load=0.5, at=(1.7e-3, 1.7e-3))
    assert found.total_force == pytest.approx(0.5, rel=1e-3)
    assert len(body.primitives()) > 1
    assert np.abs(found.contact_forces - whole.contact_forces).sum() > 0.05
