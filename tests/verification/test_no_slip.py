"""Contacts without slip: integral equations against closed forms, and presses against the integral equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import press
from fem_reference.closed_form import half_space_compliance, punch, sphere, transfer
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.loading_path import LoadingPath
from meshes import Box, Cover, Cylinder, Layer, Material, Sphere, TexelArray
from meshes.pose import Pose
from tests.exact import stuck_face
from tests.exact.no_slip import stuck_punch, stuck_shape
from tests.exact.stuck_face import FaceGrid, press_face
from tests.exact.tractions import traction_compliance
from tests.support.indentations import column_contact

THICKNESS = 2e-3
ARRAY = TexelArray.grid(9, 9, pitch=3.4e-3)


def cover(nu, *, thickness=THICKNESS):
    """A bonded layer with a Young's modulus of 1 MPa."""
    material = Material(name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=nu)
    return Cover(layers=(Layer(thickness=thickness, material=material),))


def dimensionless_stiffness(nu, ratio):
    """F (1 - nu) / (4 mu a d) of a flat punch of radius a without slip on a layer of thickness a / ratio [-]."""
    layer, radius = cover(nu), ratio * THICKNESS
    return stuck_punch(layer, radius).stiffness * (1 - nu) / (4 * layer.layers[0].material.shear_modulus * radius)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_tractions_on_short_waves_displace_a_half_space(nu):
    # Johnson 1985, section 2.5: c = (1 - nu) / mu k on the diagonal, -(1 - 2 nu) / 2 mu k off the diagonal.
    k = np.array([40.0, 80.0]) / THICKNESS
    found = traction_compliance(cover(nu), k) / half_space_compliance(cover(nu).layers[0], k)[:, None, None]
    mixed = -(1 - 2 * nu) / (2 * (1 - nu))
    assert found == pytest.approx(np.broadcast_to([[1, mixed], [mixed, 1]], (2, 2, 2)), abs=1e-9)


def test_the_response_to_tractions_is_reciprocal_and_contains_that_to_pressure():
    layers = cover(0.3).layers + cover(0.48, thickness=1e-3).layers
    k = np.geomspace(1e-3, 60, 30) / 3e-3
    found = traction_compliance(Cover(layers=layers), k)
    assert found[:, 0, 1] == pytest.approx(found[:, 1, 0], rel=1e-6)
    assert found[:, 0, 0] == pytest.approx(transfer(Cover(layers=layers), k).compliance, rel=1e-6)


@pytest.mark.parametrize(
    "nu",
    [
        pytest.param(0.0, marks=pytest.mark.slow),
        0.3,
        pytest.param(0.45, marks=pytest.mark.slow),
        pytest.param(0.5, marks=pytest.mark.slow),
    ],
)
def test_a_small_punch_without_slip_has_the_stiffness_of_mossakovskii(nu):
    # Johnson 1985, section 3.8: ln(3 - 4 nu) (1 - nu) / (1 - 2 nu) times the stiffness without friction.
    radius = 1e-3 * THICKNESS
    ratio = stuck_punch(cover(nu), radius).stiffness / punch(cover(nu), radius, 1.0).force
    exact = np.log(3 - 4 * nu) * (1 - nu) / (1 - 2 * nu) if nu < 0.5 else 1.0
    assert ratio == pytest.approx(exact, rel=2e-4)


@pytest.mark.parametrize(
    ("nu", "kappa"),
    [pytest.param(0.49, 3.71350, marks=pytest.mark.slow), pytest.param(0.5, 3.92912, marks=pytest.mark.slow)],
)
def test_a_punch_as_wide_as_the_layer_is_thick_has_an_independently_computed_stiffness(nu, kappa):
    assert dimensionless_stiffness(nu, 1.0) == pytest.approx(kappa, rel=5e-5)
    found = press(cover(nu), ARRAY, Cylinder(radius=THICKNESS), depth=1e-5, friction=np.inf)
    unit = 4 * cover(nu).layers[0].material.shear_modulus * THICKNESS * 1e-5
    assert found.total_force * (1 - nu) / unit == pytest.approx(kappa, rel=5e-5)


@pytest.mark.slow
def test_an_incompressible_half_space_under_a_sphere_needs_no_friction():
    radius, contact = 1.0, 1e-3
    found = stuck_shape(cover(0.5, thickness=1.0), lambda r: r**2 / (2 * radius), contact, steps=32)
    free = sphere(cover(0.5, thickness=1.0), radius, contact)
    assert found.force == pytest.approx(free.force, rel=5e-4)
    assert found.depth == pytest.approx(free.depth, rel=5e-4)


@pytest.mark.slow
def test_texels_carry_the_force_of_contacts_without_slip():
    array = TexelArray.grid(21, 21, 3.4e-3)
    stuck = stuck_punch(cover(0.3), 3e-3).press(1e-4)
    grown = stuck_shape(cover(0.3), lambda r: r**2 / 10e-3, 1.5e-3, steps=8)
    for contact in (stuck, grown):
        assert contact.texel_forces(array).sum() == pytest.approx(contact.force, rel=2e-5)
    smooth = punch(cover(0.3), 3e-3, 1e-4)
    ratio = stuck.texel_forces(array).max() / smooth.texel_forces(array).max()
    assert ratio == pytest.approx(stuck.force / smooth.force, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("nu", "ratio"), [(0.49, 1.0), (0.5, 1.0), (0.0, 4.0), (0.3, 0.25), (0.45, 2.0), (0.49, 0.5), (0.5, 4.0)]
)
def test_a_pressed_cylinder_without_slip_has_the_exact_stiffness_within_its_estimate(nu, ratio):
    radius, depth = ratio * THICKNESS, 1e-5
    found = press(cover(nu), ARRAY, Cylinder(radius=radius), depth=depth, friction=np.inf)
    exact = stuck_punch(cover(nu), radius).stiffness * depth
    error = abs(found.total_force / exact - 1)
    assert error < found.error_estimate["total_force"] < 1e-3
    assert found.texel_forces.sum() + found.outside == pytest.approx(found.total_force, rel=3e-4)
    assert column_contact(found)[:, 2].sum() == pytest.approx(found.total_force)


@pytest.mark.slow
def test_a_load_without_slip_reaches_the_depth_of_the_exact_stiffness():
    stiffness = stuck_punch(cover(0.45), THICKNESS).stiffness
    found = press(cover(0.45), ARRAY, Cylinder(radius=THICKNESS), load=0.1, friction=np.inf)
    assert found.depth == pytest.approx(0.1 / stiffness, rel=found.error_estimate["depth"])


@pytest.mark.slow
def test_a_cylinder_in_three_dimensions_stiffens_like_the_integral_equations():
    grid = FaceGrid(through=2, edge=0.08, growth=1.2, across=8)
    (slides, _), (sticks, _) = press_face(cover(0.49), Cylinder(radius=THICKNESS), Pose(), grid)
    exact = stuck_punch(cover(0.49), THICKNESS).stiffness / punch(cover(0.49), THICKNESS, 1.0).force
    assert sticks.total_force / slides.total_force == pytest.approx(exact, rel=5e-3)


@pytest.fixture
def reactions(monkeypatch):
    """The reactions on the base of every block that is solved, as they come."""
    seen, real = [], stuck_face.BlockReactions

    def keep(**values):
        seen.append(real(**values))
        return seen[-1]

    monkeypatch.setattr(stuck_face, "BlockReactions", keep)
    return seen


@pytest.mark.slow
def test_a_face_that_would_pull_a_stiff_foil_separates_from_it():
    silicone, film = cover(0.49).layers[0], cover(0.38, thickness=1e-4).layers[0]
    foil = replace(film, material=replace(film.material, parameters={"youngs_modulus": 3e9}))
    face, array = Cylinder(radius=2 * THICKNESS), TexelArray.grid(5, 5, 3.4e-3)
    found, free = (
        press(Cover(layers=(silicone, foil)), array, face, depth=1e-5, friction=friction) for friction in (np.inf, 0.0)
    )
    assert found.contact_area < 0.9 * np.pi * face.radius**2
    assert (found.contact_forces[:, 2] < 0).all()
    assert found.total_force > free.total_force


@pytest.mark.slow
@pytest.mark.parametrize(("nu", "contact_radius"), [(0.3, 2e-3), (0.49, 0.6e-3), (0.5, 4e-3)])
def test_a_ball_without_slip_has_the_force_of_the_integral_equations_within_its_estimate(nu, contact_radius):
    ball = Sphere(radius=10 * contact_radius)
    exact = stuck_shape(cover(nu), lambda r: ball.radius - np.sqrt(ball.radius**2 - r**2), contact_radius)
    found = press(cover(nu), ARRAY, ball, depth=exact.depth, friction=np.inf)
    assert found.total_force == pytest.approx(exact.force, rel=min(found.error_estimate["total_force"], 5e-3))


@pytest.mark.slow
def test_few_steps_suffice_where_points_stick_where_they_touch():
    # Held at their position before the step, points make the contact 4 % too stiff with as few steps.
    ball, contact_radius = Sphere(radius=40e-3), 2 * THICKNESS
    exact = stuck_shape(cover(0.5), lambda r: ball.radius - np.sqrt(ball.radius**2 - r**2), contact_radius, steps=16)
    path = LoadingPath(
        cover=cover(0.5),
        indenter=ball,
        targets=(exact.depth,),
        control="depth",
        friction=np.inf,
        load_scale=1e-3,
    )
    states, _ = press_axisymmetric(
        path, elements_per_thickness=6, contact_radius=contact_radius, fillet=1e-4, reach=16 * THICKNESS
    )
    assert states[0].total_force == pytest.approx(exact.force, rel=0.012)


@pytest.mark.bench  # the slow tests have a cylinder in three dimensions
@pytest.mark.slow
def test_solid_elements_of_order_three_stiffen_alike_without_slip():
    # A second discretisation, by finite elements of the whole cover, of the ratio of the forces with and without slip.
    box, layer, pose = Box(size=(4e-3, 4e-3, 5e-3)), replace(cover(0.3), size=(8e-3, 8e-3)), Pose()
    sticks, slides = (press(layer, ARRAY, box, pose, depth=1e-5, friction=friction) for friction in (np.inf, 0.0))
    cubic = FaceGrid(through=3, edge=0.008, growth=1.0, across=16, order=3)
    (free, _), (held, _) = press_face(layer, box, pose, cubic)
    assert sticks.total_force / slides.total_force == pytest.approx(
        held.total_force / free.total_force, rel=sticks.error_estimate["total_force"]
    )
    assert sticks.error_estimate["total_force"] < 0.01
    # On one coarse grid of elements, so that most of its error cancels in the change of the texels' shares.
    (free, _), (held, _) = press_face(layer, box, pose, stuck_face.FACE_GRIDS[0])
    ours = [each.texel_forces / each.total_force for each in (sticks, slides)]
    theirs = [each.base.forces(ARRAY, pose)[:-1] / each.total_force for each in (held, free)]
    limit = sticks.error_estimate["peak_texel"] * ours[0].max()
    np.testing.assert_allclose(ours[0] - ours[1], theirs[0] - theirs[1], atol=limit)


@pytest.mark.parametrize("nu", [pytest.param(0.3, marks=pytest.mark.slow), pytest.param(0.49, marks=pytest.mark.slow)])
def test_a_sliding_base_carries_the_load_of_a_face_without_slip(nu, reactions):
    """The outer boundary must not press a sliding cover onto its base."""
    rubber = Material(
        name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=nu, source="assumed"
    )
    cover = Cover(layers=(Layer(thickness=2e-3, material=rubber),), base="sliding")
    faces = press_face(cover, Box(size=(4e-3, 4e-3, 4e-3)), Pose(), stuck_face.FACE_GRIDS[0])
    for (face, _), block in zip(faces, reactions, strict=True):
        whole = block.forces.sum() * (1 + block.symmetric[0]) * (1 + block.symmetric[1])
        assert whole == pytest.approx(face.total_force, rel=1e-6)
        assert face.base.forces(ARRAY, Pose()).sum() == pytest.approx(face.total_force, rel=5e-3)
