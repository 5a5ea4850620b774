"""Boundary elements for flat faces, exact texel responses and exact contacts of bodies of revolution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import closed_form
from fem_reference.closed_form import indent
from meshes import (
    Box,
    Cone,
    Cover,
    Cylinder,
    Layer,
    LetterH,
    Material,
    Nut,
    Prism,
    Roller,
    RoundedTip,
    Sphere,
    TexelArray,
)
from meshes.pose import Pose
from tests.exact import boundary
from tests.exact.boundary import pressed_shape
from tests.exact.outline import press_face
from tests.exact.point_response import point_response_spline

MM = 1e-3
L_SHAPE = Prism(
    points=tuple((x * MM - 4e-3, y * MM - 4.5e-3) for x, y in ((0, 0), (8, 0), (8, 3), (2, 3), (2, 9), (0, 9)))
)


def material(youngs_modulus, poisson_ratio):
    parameters = {"youngs_modulus": youngs_modulus}
    return Material(name="test", model="linear-elastic", parameters=parameters, poisson_ratio=poisson_ratio)


def foil_on_foam():
    layers = (
        Layer(thickness=1.8e-3, material=material(1e5, 0.45)),
        Layer(thickness=0.2e-3, material=material(1e8, 0.35)),
    )
    return Cover(layers=layers)


def refine(cover, indenter, depth, cells=(8, 12)):
    """Force and middle texel's force, extrapolated with order 2 from two grids."""
    array = TexelArray.grid(1, 1, 3.4e-3)
    coarse, fine = (press_face(cover, indenter, depth, cells=n) for n in cells)
    values = [np.array([each.total_force, each.texel_forces(array)[0]]) for each in (coarse, fine)]
    return values[1] + (values[1] - values[0]) / ((cells[1] / cells[0]) ** 2 - 1)


def test_square_face_on_a_half_space(bonded):
    """The potential of a charged square plate of capacity 0.3667874 sides (Read 1997): force = pi C E* depth."""
    found = refine(bonded(0.3, thickness=30.0), Box(size=(4e-3, 4e-3, 4e-3)), 1e-5, cells=(10, 15))[0]
    assert found == pytest.approx(np.pi * 0.3667874 * 4e-3 * 1e6 / (1 - 0.3**2) * 1e-5, rel=1e-3)


@pytest.mark.slow
def test_faces_equal_the_older_boundary_elements(bonded):
    cover, box = bonded(0.49), Box(size=(4e-3, 3e-3, 4e-3))
    coarse, fine = (pressed_shape(cover, box, 1e-5, cells=n).total_force for n in (10, 15))
    assert refine(cover, box, 1e-5, cells=(14, 21))[0] == pytest.approx(fine + (fine - coarse) / 1.25, rel=1e-3)


def test_a_turned_face_turns_the_texel_forces(bonded):
    face = press_face(bonded(0.45), L_SHAPE, 1e-4, cells=4)
    array = TexelArray.grid(5, 5, 3.4e-3)
    straight, turned = face.texel_forces(array), face.texel_forces(array, Pose.planar(at=(0.0, 0.0), yaw=np.pi / 2))
    assert np.rot90(array.image(turned)) == pytest.approx(array.image(straight), abs=1e-9)


@pytest.mark.slow
def test_texels_carry_the_whole_force(bonded):
    array = TexelArray.grid(17, 17, 3.4e-3)
    for shape in (L_SHAPE, Nut(across=13e-3, bore=11e-3), LetterH(size=(10e-3, 10e-3), bar=2e-3)):
        face = press_face(bonded(0.49), shape, 1e-4, cells=3)
        assert face.texel_forces(array).sum() == pytest.approx(face.total_force, rel=5e-5)
        assert face.contact_area == pytest.approx(boundary.measure_areas(face.corners).sum())


def test_a_wide_face_separates_from_a_stiff_foil():
    """The middle of a face on a foil loses contact; `indent` refuses such a cylinder."""
    face = press_face(foil_on_foam(), Box(size=(8e-3, 8e-3, 1e-3)), 1e-4, cells=12)
    assert face.contact_area < 0.6 * 64e-6
    with pytest.raises(ValueError, match="pull"):
        indent(foil_on_foam(), Cylinder(radius=4e-3), load=1.0)


def test_faces_of_other_kinds_are_refused(bonded):
    triangle = Prism(points=((-1e-3, -1e-3), (1e-3, -1e-3), (0, 1e-3)))
    with pytest.raises(ValueError, match="no boundary elements"):
        press_face(bonded(0.3), triangle, 1e-4)
    with pytest.raises(TypeError, match="no boundary elements for the face of Cylinder"):
        press_face(bonded(0.3), Cylinder(radius=1e-3), 1e-4)


@pytest.mark.parametrize("base", ["bonded", "sliding"])
def test_excess_equals_its_integral(bonded, base):
    from scipy.special import j0

    cover = bonded(0.4, base=base)
    excess = boundary.tabulate_excess(cover)
    k, weight = closed_form.layer.hankel_nodes(cover, 8e-3)
    known = closed_form.transfer(cover, k).compliance - closed_form.half_space_compliance(cover.layers[-1], k)
    for r in (0.0, 1e-3, 8e-3):
        exact = (known * k * weight) @ j0(k * r) / (2 * np.pi)
        assert excess(np.array(r)) == pytest.approx(exact, rel=2e-6)


@pytest.mark.parametrize("size", [pytest.param((3.4e-3, 3.4e-3), marks=pytest.mark.slow), (1e-3, 2e-3)])
def test_texel_response_equals_its_integral(bonded, size):
    cover = bonded(0.5)
    response = closed_form.tabulate_texel_response(cover, size)
    pressure = point_response_spline(cover, 10e-3, 8001)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    for x, y in ((0.0, 0.0), (0.3e-3, 1.1e-3), (5e-3, 2e-3)):
        r = np.hypot(size[0] / 2 * nodes[:, None] - x, size[1] / 2 * nodes - y)
        exact = weights @ pressure(r) @ weights * size[0] * size[1] / 4
        assert response(np.array([x]), np.array([y]))[0] == pytest.approx(exact, abs=1e-6)


@pytest.mark.slow
def test_cone_on_a_thick_layer_follows_sneddon(bonded):
    """Sneddon 1948: depth = (pi / 2) a cot(angle / 2), force = a E* depth; the layer is 1e5 times as thick as a."""
    cone = Cone(angle=np.radians(140), radius=1.0)
    found = indent(bonded(0.3, thickness=10.0), cone, depth=1e-4)
    assert found.depth == pytest.approx(np.pi / 2 * found.contact_radius / np.tan(cone.angle / 2), rel=3e-4)
    assert found.force == pytest.approx(found.contact_radius * 1e6 / (1 - 0.09) * found.depth, rel=3e-4)


@pytest.mark.slow
def test_load_and_depth_of_a_body_of_revolution_agree(bonded):
    cover = bonded(0.5)
    for shape in (Sphere(radius=5e-3), RoundedTip(radius=1e-3), Cone(angle=2.0, radius=5e-3), Cylinder(radius=2e-3)):
        found = indent(cover, shape, load=0.1)
        assert indent(cover, shape, depth=found.depth).force == pytest.approx(0.1, rel=1e-8)
        rings = found.force_within(found.contact_radius * np.linspace(0, 1, 20))
        assert rings[[0, -1]] == pytest.approx([0, 0.1], abs=1e-6)
        assert (np.diff(rings) > 0).all()


@pytest.mark.slow
def test_texel_forces_of_a_body_of_revolution(bonded):
    """Superposed rings give the same texel forces as the transform of the pressure, and their sum is the force."""
    cover, array = bonded(0.49), TexelArray.grid(13, 13, 3.4e-3)
    found = indent(cover, Sphere(radius=5e-3), depth=2e-4)
    forces = found.texel_forces(array, (1e-3, 0.5e-3))
    assert forces.sum() == pytest.approx(found.force, rel=1e-3)
    edges = np.linspace(0, found.contact_radius, 121)
    ring, angle = np.diff(found.force_within(edges)), 2 * np.pi * np.arange(24) / 24
    r = (edges[1:] + edges[:-1])[:, None] / 2
    x, y = (1e-3 + r * np.cos(angle)).ravel(), (0.5e-3 + r * np.sin(angle)).ravel()
    superposed = boundary.superpose(cover, array, x, y, np.repeat(ring / 24, 24))
    assert superposed == pytest.approx(forces, abs=1e-4 * forces.max())
    masked = found.texel_forces(replace(array, active=np.arange(array.count) != array.middle))
    assert masked[array.middle] == 0


def test_contacts_beyond_the_closed_form_are_refused(bonded):
    with pytest.raises(ValueError, match="rim"):
        indent(bonded(0.3), RoundedTip(radius=1e-4), depth=1e-3)
    with pytest.raises(ValueError, match="either a load or a depth"):
        indent(bonded(0.3), Sphere(radius=1e-3))
    with pytest.raises(TypeError, match="no exact contact for Roller"):
        indent(bonded(0.3), Roller(radius=1e-3, length=1e-3), load=1.0)


@pytest.mark.parametrize("nu", [0.2, 0.5])
def test_long_waves_on_a_sliding_base(bonded, nu):
    """The layer extends freely: compliance h (1 - nu) / (2 mu) (plane strain), also for a cover cut in two."""
    cover = bonded(nu, base="sliding")
    layer = cover.layers[0]
    half = Layer(thickness=layer.thickness / 2, material=layer.material)
    exact = layer.thickness * (1 - nu) / (2 * layer.material.shear_modulus)
    for each in (cover, replace(cover, layers=(half, half))):
        assert closed_form.transfer(each, [1e-6, 1.0, 3.0]).compliance == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize(("shape", "radius"), [(Sphere, 1.0), pytest.param(RoundedTip, 3.0, marks=pytest.mark.slow)])
def test_wide_radii_approach_the_compression_of_a_bonded_layer(bonded, shape, radius):
    """F = pi R M depth^2 / h with the oedometric modulus M (Johnson 1985, sec. 5.8); the edge adds h / a at most."""
    cover, depth = bonded(0.3), 2e-4
    found = indent(cover, shape(radius=radius), depth=depth)
    modulus = 1e6 * 0.7 / (1.3 * 0.4)
    limit = np.pi * radius * modulus * depth**2 / cover.thickness
    assert found.force == pytest.approx(limit, rel=0.05 * cover.thickness / found.contact_radius)
    assert indent(cover, shape(radius=radius), load=found.force).depth == pytest.approx(depth, rel=1e-8)


@pytest.mark.slow
def test_contacts_wider_than_the_equation_resolves_are_refused(bonded):
    for press in (
        lambda: indent(bonded(0.49), Sphere(radius=1e3), depth=1e-3),
        lambda: indent(bonded(0.3), Cylinder(radius=1.0), load=1.0),
        lambda: closed_form.contact.punch(bonded(0.3), 1.0, 1e-4),
    ):
        with pytest.raises(ValueError, match="800 mm radius, 400 thicknesses of the top layer"):
            press()
    with pytest.raises(ValueError, match="96 nodes do not resolve a contact"):
        indent(bonded(0.49), Sphere(radius=1e3), depth=1e-3, nodes=96)
