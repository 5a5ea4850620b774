"""The lower surface for contact at finite strain is smooth and stays close to the shape."""

import numpy as np
import pytest
import trimesh

from fem_reference.finite_strain.indenter_surface import STEEPEST, IndenterSurface, SmoothedHeightmap
from meshes import Prism, Roller, Sphere, TriangleMesh

UNIT, CELL = 2e-3, 0.1
BALL = 2.5  # radius in units


@pytest.fixture(scope="module")
def ball():
    mesh = trimesh.creation.icosphere(4, BALL * UNIT)
    return TriangleMesh(triangles=mesh.triangles + np.array([0, 0, BALL * UNIT]))


def surface(indenter):
    return IndenterSurface(indenter=indenter, fillet=2 * CELL, unit=UNIT)


def test_a_ball_of_facets_is_a_ball(ball):
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 2000))
    smooth, exact = surface(ball).evaluate(x, y), surface(Sphere(radius=BALL * UNIT)).evaluate(x, y)
    assert np.abs(smooth.height - exact.height).max() < 1e-3 * BALL
    assert np.abs(smooth.slope - exact.slope).max() < 0.02
    assert np.sqrt(np.mean((smooth.curvature - exact.curvature) ** 2)) < 0.2 / BALL


def test_slope_and_curvature_are_those_of_the_height(ball):
    """Also across facets: nothing jumps, as the facets' own slope does."""
    along = np.linspace(-1.5, 1.5, 3001)
    found = surface(ball).evaluate(along, np.full_like(along, 0.137))
    step = along[1] - along[0]
    np.testing.assert_allclose(found.slope[1:-1, 0], np.diff(found.height)[1:] / step, atol=1.5 * step)
    np.testing.assert_allclose(np.diff(found.slope[:, 0]) / step, found.curvature[1:, 0, 0], atol=0.05)
    facets = ball.gap(along * UNIT, np.full_like(along, 0.137 * UNIT)) / UNIT
    jump = np.abs(np.diff(facets, 2) / step**2).max()
    assert np.abs(found.curvature).max() < 0.1 * jump


def test_across_a_roller_the_section_is_a_circle():
    roller = Roller(radius=2 * UNIT, length=6 * UNIT)
    across = np.linspace(-1.4, 1.4, 57)
    height = surface(roller).height(across, np.zeros_like(across))
    np.testing.assert_allclose(height, 2 - np.sqrt(4 - across**2), atol=2e-3)


def test_nothing_is_steeper_than_a_cover_can_follow(ball):
    for shape in (ball, Roller(radius=UNIT, length=2 * UNIT)):
        within, beyond = (
            surface(shape).evaluate(
                *(np.random.default_rng(1).uniform(-reach, reach, (4000, 2)) * shape.footprint / UNIT).T
            )
            for reach in (1.2, 3)
        )
        assert np.linalg.norm(within.slope, axis=-1).max() < 1.05 * STEEPEST
        assert np.linalg.norm(beyond.slope, axis=-1).max() < 1.05 * np.sqrt(2) * STEEPEST


def test_holes_are_walled():
    """Where there is no underside the height goes up from the rim, to the greatest height at most."""
    frame = Prism(
        points=((-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)),
        holes=(((-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)),),
    )
    heightmap = SmoothedHeightmap(frame, cell=0.05, steepest=STEEPEST, highest=2.0, unit=1.0)
    along = np.array([0.0, 1.5, 3.0, 5.0])
    np.testing.assert_allclose(heightmap.height(along, np.zeros(4)), [2, 0.5 * STEEPEST, 0, STEEPEST], atol=0.1)
