"""Friction: its law at every point, its derivative, and the closed form of a punch that does not slip."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import skfem

from fem_reference import press
from fem_reference.elements.taylor_hood import prepare_elements
from fem_reference.finite_strain import contact as surface_contact
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.block_path import lay_out_block
from fem_reference.finite_strain.contact import SurfaceContact
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.finite_strain.paired_path import press_paired
from fem_reference.linear_response.surface_compliance import decay_length
from meshes import Box, Cover, Cylinder, Layer, Material, Sphere, TexelArray

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
    return states[-1].load / REST, solved.equilibria[-1].contact


def block(friction):
    """The top of a small block under a flat face that is wider than it."""
    elements = prepare_elements(skfem.MeshHex().refined(1))
    surface = IndenterSurface(indenter=Box(size=(10.0, 10.0, 1.0)), fillet=0.1)
    return elements, SurfaceContact(elements, 1.0, surface, penalty=50.0, friction=friction)


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_a_punch_that_does_not_slip_is_stiffer_as_mossakovskii_found(nu):
    # Rigid flat punch on a half-space (Johnson 1985, section 3.8): ln(3 - 4 nu) (1 - nu) / (1 - 2 nu).
    small = Cylinder(radius=0.05e-3)  # against a layer of 2 mm
    ratio = pressed(small, np.inf, nu=nu, depth=1e-6)[0] / pressed(small, 0.0, nu=nu, depth=1e-6)[0]
    assert ratio == pytest.approx(np.log(3 - 4 * nu) * (1 - nu) / (1 - 2 * nu), rel=6e-3)


def test_without_slip_the_tangent_is_the_derivative_of_the_force():
    elements, contact = block(np.inf)
    rng = np.random.default_rng(1)
    size = elements.displacements + elements.pressures
    state, way = 1e-2 * rng.standard_normal(size), rng.standard_normal(size)
    depth, step = 0.2, 1e-6
    found = contact.evaluate(state, depth)
    ahead, behind = (contact.evaluate(state + sign * step * way, depth) for sign in (1, -1))
    change = (ahead.force - behind.force) / (2 * step)
    assert change == pytest.approx(found.tangent @ way, abs=1e-6 * np.abs(change).max())
    deeper, higher = (contact.evaluate(state, depth + sign * step) for sign in (1, -1))
    assert (deeper.force - higher.force) / (2 * step) == pytest.approx(
        found.depth_force, abs=1e-6 * np.abs(found.depth_force).max()
    )
    assert (deeper.total - higher.total) / (2 * step) == pytest.approx(found.stiffness, rel=1e-6)


@pytest.mark.parametrize("friction", [0.05, 0.4])
def test_no_traction_leaves_the_cone_and_sliding_points_lie_on_it(friction):
    elements, contact = block(friction)
    state = np.zeros(elements.displacements + elements.pressures)
    moved = state[: elements.displacements].reshape(-1, 3)
    moved[:, 0] = 12 * elements.nodes[:, 0]  # stretched along x: points far from x = 0 slide
    assert contact.update_cone(contact.evaluate(state, 0.2)) == pytest.approx(1)
    touch = contact.evaluate(state, 0.2)
    assert contact.update_cone(touch) == 0
    drag, limit = np.linalg.norm(touch.traction, axis=-1), friction * touch.pressure
    assert (drag <= limit * (1 + 1e-12)).all()
    slid = surface_contact.TANGENTIAL_PENALTY * touch.position[..., 0] * 12 / 13 > friction * 0.2
    assert (slid == ~touch.sticking).all()
    assert slid.any()
    assert drag[slid] == pytest.approx(limit[slid])
    assert (touch.traction[..., 0] >= 0).all(), "friction must hold back: the residual pulls against the slip"
    assert np.abs(touch.traction[..., 1:]).max() == 0


def test_a_point_that_sticks_is_pulled_back_to_where_it_stuck():
    elements, contact = block(np.inf)
    state = np.zeros(elements.displacements + elements.pressures)
    state[: elements.displacements].reshape(-1, 3)[:, 0] = 0.1
    first = contact.evaluate(state, 0.2)
    contact.record_slip(first)
    again = contact.evaluate(state, 0.2)
    assert again.traction == pytest.approx(2 * first.traction)  # held where it stuck: pulled back to there
    moved = state[: elements.displacements].reshape(-1, 3)
    moved[:, 0] = 0
    assert contact.evaluate(state, 0.2).traction == pytest.approx(first.traction)


def test_more_friction_never_softens_and_none_changes_nothing():
    punch = Cylinder(radius=2e-3)
    forces = [pressed(punch, friction, depth=20e-6)[0] for friction in (0.0, 0.2, np.inf)]
    assert forces[0] < forces[1] < forces[2]


def test_a_wrong_sign_of_friction_is_seen(monkeypatch):
    right = SurfaceContact._return_to_cone

    def wrong(self, position, normal, pressure):
        traction, *rest = right(self, position, normal, pressure)
        return -traction, *rest

    monkeypatch.setattr(SurfaceContact, "_return_to_cone", wrong)
    with pytest.raises(AssertionError, match="hold back"):
        test_no_traction_leaves_the_cone_and_sliding_points_lie_on_it(0.4)


@pytest.mark.parametrize("friction", [-0.1, np.nan])
def test_a_coefficient_that_is_none_is_refused(friction):
    array = TexelArray.grid(2, 2, pitch=3.4e-3)
    with pytest.raises(ValueError, match="friction coefficient"):
        press(rubber(0.45), array, Sphere(radius=5e-3), load=1.0, friction=friction)


@pytest.mark.slow
def test_a_thin_incompressible_layer_is_nearly_four_times_stiffer_without_slip():
    # Squeezed between plates that hold both faces, the mean pressure is four times that with one face free (the
    # parabola of the flow has 12 / h^3 in place of 3 / h^3); the cover around the punch keeps the ratio below.
    wide, wider = (Cylinder(radius=radius) for radius in (10e-3, 40e-3))
    ratios = [pressed(punch, np.inf, nu=0.5)[0] / pressed(punch, 0.0, nu=0.5)[0] for punch in (wide, wider)]
    assert 1.5 < ratios[0] < ratios[1] < 4
    assert ratios[1] > 3.2


@pytest.mark.slow
def test_a_sphere_with_friction_has_the_same_answer_for_small_and_finite_strain_of_a_small_load():
    array = TexelArray.grid(4, 4, pitch=3.4e-3)
    ball = Sphere(radius=4e-3)
    small, finite = (
        press(rubber(0.45, m), array, ball, load=0.02, friction=0.5) for m in ("linear-elastic", "neo-hookean")
    )
    assert finite.depth == pytest.approx(small.depth, rel=5e-3)
    assert finite.texel_forces == pytest.approx(small.texel_forces, abs=2e-3 * 0.02)
    assert small.assumptions["friction"] == "Coulomb, coefficient 0.5"
    slipping = press(rubber(0.45, "linear-elastic"), array, ball, load=0.02)
    assert small.depth < slipping.depth


@pytest.mark.slow
def test_a_box_and_a_cylinder_without_slip_stiffen_alike():
    cover = rubber(0.49)
    half = np.sqrt(np.pi) / 2 * 3e-3
    box = Box(size=(2 * half, 2 * half, 5e-3))
    path = LoadingPath(cover=cover, indenter=box, targets=(20e-6,), control="depth", friction=np.inf)
    block = lay_out_block(
        path, elements_per_thickness=3, contact_half=box.footprint, fillet=0.4e-3, reach=7 * decay_length(cover)
    )
    slides, sticks, _ = press_paired(replace(path, load_scale=REST), block, [20e-6], elements_per_thickness=3)
    loads = [slides[0].load, sticks[0].load]
    round_one = [
        pressed(Cylinder(radius=3e-3), f, nu=0.49, depth=20e-6, elements=6, fillet=0.4e-3)[0] for f in (0.0, np.inf)
    ]
    assert loads[1] / loads[0] == pytest.approx(round_one[1] / round_one[0], rel=0.03)
