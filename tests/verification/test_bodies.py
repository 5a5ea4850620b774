"""Bodies of triangles and polygon prisms give the results of the shapes that they approximate."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from fem_reference import press
from fem_reference.linear_response.surface_compliance import surface_compliance
from fem_reference.small_strain_contact.frictionless import solve_contact
from meshes import Cover, Layer, LetterH, Material, Pose, Prism, Sphere, TriangleMesh
from meshes.catalogue import MATERIALS

HALF = [(6, 8), (2, 8), (2, 2), (-2, 2), (-2, 8), (-6, 8)]
H = Prism(points=tuple((1e-3 * x, 1e-3 * y) for x, y in [*HALF, *((-x, -y) for x, y in HALF)]))


def ball(divisions):
    mesh = trimesh.creation.icosphere(divisions, 5e-3)
    return TriangleMesh(triangles=mesh.triangles - [0, 0, mesh.bounds[0, 2]])


def test_a_ball_of_facets_is_as_stiff_as_a_ball(bonded):
    """It reaches less low between its corners, so it takes less force, the less the finer it is."""
    surface = surface_compliance(bonded(0.49), 30e-3)
    patches = [
        solve_contact(surface, shape, cells=40, depth=0.3e-3) for shape in (Sphere(radius=5e-3), ball(3), ball(4))
    ]
    exact, coarse, fine = (patch.total_force for patch in patches)
    assert coarse < fine < exact
    assert fine == pytest.approx(exact, rel=0.03)
    assert (exact - coarse) / (exact - fine) == pytest.approx(4, rel=0.5)


@pytest.mark.slow
def test_a_prism_presses_like_the_letter_of_the_same_outline(bonded):
    surface = surface_compliance(bonded(0.49), 60e-3)
    found, wanted = (
        solve_contact(surface, shape, cells=40, load=5.0) for shape in (H, LetterH(size=(12e-3, 16e-3), bar=4e-3))
    )
    assert found.depth == pytest.approx(wanted.depth, rel=1e-9)
    np.testing.assert_allclose(found.force, wanted.force, rtol=1e-6)


@pytest.mark.slow
def test_a_ball_of_facets_at_finite_strain(wts):
    """In three dimensions and smoothed, beside the ball around its axis."""
    cover = Cover(layers=(Layer(thickness=2e-3, material=MATERIALS["dragon-skin-30"]),))
    found, wanted = (
        press(cover, wts, shape, load=5.0, pose=Pose.planar(at=(0.7e-3, -1.1e-3)))
        for shape in (ball(4), Sphere(radius=5e-3))
    )
    assert "facets and edges rounded over" in found.assumptions["surface"]
    assert np.abs(found.texel_forces - wanted.texel_forces).sum() / 10.0 < 0.002
    assert found.depth == pytest.approx(wanted.depth, rel=0.015)


def rubber(model, parameters):
    material = Material(name="rubber", model=model, parameters=parameters, poisson_ratio=0.45)
    return Cover(layers=(Layer(thickness=2e-3, material=material),))


@pytest.mark.slow
@pytest.mark.bench  # the slow tests have a ball of facets at finite strain
def test_a_frame_of_thin_walls_at_finite_strain(wts):
    """Edges are rounded by less than the walls are wide, on every grid; finite strain changes a little."""
    ring = [tuple((s * a, t * a) for s, t in ((1, 1), (-1, 1), (-1, -1), (1, -1))) for a in (2.5e-3, 1.7e-3)]
    frame = Prism(points=ring[0], holes=(ring[1],))
    found = press(rubber("neo-hookean", {"shear_modulus": 1e6 / 2.9}), wts, frame, load=1.0)
    small = press(rubber("linear-elastic", {"youngs_modulus": 1e6}), wts, frame, load=1.0)
    assert found.texel_forces.sum() + found.outside == pytest.approx(1.0, rel=1e-4)
    assert found.depth == pytest.approx(small.depth, rel=0.03)
    assert found.depth != pytest.approx(small.depth, rel=1e-3)
    assert found.error_estimate["peak_texel"] < 0.03
    assert np.abs(found.texel_forces - small.texel_forces).max() < 0.02
