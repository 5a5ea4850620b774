"""Presses with friction: the closed form of a punch without slip, monotony, and limits of small and finite strain."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fem_reference import press
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.block_path import lay_out_block, press_paired
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.linear_response.surface_compliance import decay_length
from meshes import Box, Cover, Cylinder, Layer, Material, Sphere, TexelArray
from tests.exact.no_slip import stuck_shape

pytestmark = pytest.mark.slow

#: Share of the heights that counts as small strain.
REST = 1e-3


def rubber(nu, model="neo-hookean"):
    """A bonded cover of 2 mm with a Young's modulus of 1 MPa."""
    parameters = {"shear_modulus": 1e6 / (2 * (1 + nu))} if model == "neo-hookean" else {"youngs_modulus": 1e6}
    material = Material(name="rubber", model=model, parameters=parameters, poisson_ratio=nu)
    return Cover(layers=(Layer(thickness=2e-3, material=material),))


@cache
def pressed(indenter, friction, *, nu=0.3, depth=2e-6, elements=4, fillet=None):
    """Small-strain force on an indenter around an axis, and its last contact state."""
    cover, radius = rubber(nu), indenter.radius
    states, solved = press_axisymmetric(
        LoadingPath(
            cover=cover, indenter=indenter, targets=(depth,), control="depth", friction=friction, load_scale=REST
        ),
        elements_per_thickness=elements,
        contact_radius=radius,
        fillet=fillet or min(radius, cover.thickness) / 20,
        reach=12 * decay_length(cover) + 1.5 * radius,
    )
    return states[-1].total_force, solved.equilibria[-1].contact


@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_a_punch_without_slip_has_the_stiffness_of_mossakovskii(nu):
    # Rigid flat punch on a half-space (Johnson 1985, section 3.8): ln(3 - 4 nu) (1 - nu) / (1 - 2 nu).
    small = Cylinder(radius=0.05e-3)  # against a layer of 2 mm
    ratio = pressed(small, np.inf, nu=nu, depth=1e-6)[0] / pressed(small, 0.0, nu=nu, depth=1e-6)[0]
    assert ratio == pytest.approx(np.log(3 - 4 * nu) * (1 - nu) / (1 - 2 * nu), rel=6e-3)


def test_the_force_grows_with_friction():
    punch = Cylinder(radius=2e-3)
    forces = [pressed(punch, friction, depth=20e-6)[0] for friction in (0.0, 0.2, np.inf)]
    assert forces[0] < forces[1] < forces[2]


def test_a_thin_incompressible_layer_is_nearly_four_times_stiffer_without_slip():
    # Squeezed between plates that hold both faces, the mean pressure is four times that with one face free (the
    # parabola of the flow has 12 / h^3 in place of 3 / h^3); the cover around the punch keeps the ratio below.
    wide, wider = (Cylinder(radius=radius) for radius in (10e-3, 40e-3))
    ratios = [pressed(punch, np.inf, nu=0.5)[0] / pressed(punch, 0.0, nu=0.5)[0] for punch in (wide, wider)]
    assert 1.5 < ratios[0] < ratios[1] < 4
    assert ratios[1] > 3.2


def test_friction_at_finite_strain_tends_to_the_solution_on_cells():
    """A loading path alone is up to 1.7 % off on stiff layers over soft ones; it corrects the solution on cells."""
    array, ball = TexelArray.grid(4, 4, pitch=3.4e-3), Sphere(radius=4e-3)
    soft = Material(name="foam", model="neo-hookean", parameters={"shear_modulus": 2e4}, poisson_ratio=0.3)
    cover = rubber(0.45)
    layered = replace(cover, layers=(Layer(thickness=1e-3, material=soft), *cover.layers))
    linear = replace(layered, layers=tuple(replace(each, material=linearise(each.material)) for each in layered.layers))
    small, finite = (press(each, array, ball, depth=5e-6, friction=0.5) for each in (linear, layered))
    assert finite.total_force == pytest.approx(small.total_force, rel=finite.error_estimate["total_force"])
    assert finite.texel_forces == pytest.approx(small.texel_forces, abs=3e-3 * small.total_force)
    assert finite.error_estimate["total_force"] < 0.01
    assert small.assumptions["friction"] == "Coulomb, coefficient 0.5"
    slipping = press(linear, array, ball, depth=5e-6)
    assert small.total_force > slipping.total_force


def linearise(material):
    """Return the linear elastic material with the moduli of another one."""
    parameters = {"youngs_modulus": material.youngs_modulus}
    return replace(material, model="linear-elastic", parameters=parameters)


def test_a_box_and_a_cylinder_without_slip_stiffen_alike():
    cover = rubber(0.49)
    half = np.sqrt(np.pi) / 2 * 3e-3
    box = Box(size=(2 * half, 2 * half, 5e-3))
    path = LoadingPath(cover=cover, indenter=box, targets=(20e-6,), control="depth", friction=np.inf)
    block = lay_out_block(
        path, elements_per_thickness=3, contact_half=box.footprint, fillet=0.4e-3, reach=7 * decay_length(cover)
    )
    slides, sticks, _ = press_paired(replace(path, load_scale=REST), block, [20e-6], elements_per_thickness=3)
    loads = [slides[0].total_force, sticks[0].total_force]
    round_one = [
        pressed(Cylinder(radius=3e-3), f, nu=0.49, depth=20e-6, elements=6, fillet=0.4e-3)[0] for f in (0.0, np.inf)
    ]
    assert loads[1] / loads[0] == pytest.approx(round_one[1] / round_one[0], rel=0.03)


def test_distant_sides_do_not_change_a_contact_with_friction():
    array, ball = TexelArray.grid(4, 4, pitch=3.4e-3), Sphere(radius=4e-3)
    wide = rubber(0.45, "linear-elastic")
    far = replace(wide, size=(30e-3, 30e-3))
    first, second = (press(cover, array, ball, depth=0.1e-3, friction=0.3) for cover in (wide, far))
    assert second.texel_forces == pytest.approx(first.texel_forces)
    assert "sides" in second.assumptions
    assert "sides" not in first.assumptions


def test_a_ball_pressed_almost_to_its_rim_without_slip(bonded):
    ball, array = Sphere(radius=1e-3), TexelArray.grid(3, 3, 3.4e-3)
    exact = stuck_shape(bonded(0.49), lambda r: ball.gap(r, np.zeros_like(r)), 0.9e-3, steps=32)
    found = press(bonded(0.49), array, ball, depth=exact.depth, friction=np.inf)
    assert found.total_force == pytest.approx(exact.force, rel=found.error_estimate["total_force"])
    assert found.texel_forces[4] == pytest.approx(exact.texel_forces(array)[4], rel=found.error_estimate["peak_texel"])
    assert found.contact_area == pytest.approx(np.pi * 0.9e-3**2, rel=found.error_estimate["contact_area"])


@pytest.mark.parametrize("friction", [0.5, pytest.param(np.inf)])
def test_cells_end_at_the_rim_of_a_ball(bonded, friction):
    ball, array = Sphere(radius=0.5e-3), TexelArray.grid(3, 3, 3.4e-3)
    found = press(bonded(0.49), array, ball, depth=1.8e-3, friction=friction)
    assert 0.98 < found.contact_area / (np.pi * 0.5e-3**2) < 1.001
    assert np.isfinite([*found.contact_forces.ravel(), *found.error_estimate.values()]).all()
    slides = np.hypot(*found.contact_forces[:, :2].T) <= -friction * found.contact_forces[:, 2] * (1 + 1e-6)
    assert slides.all()
