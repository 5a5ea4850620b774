"""Contact with friction on cells: shear of a half space, reciprocity, and contacts on rings of exact compliance."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference.linear_response.vector_compliance import VectorCompliance
from fem_reference.small_strain_contact.friction_cells import RubbingContact, VectorOperator
from meshes import Box, Cover, Layer, Sphere
from tests.exact.rings import press_with_friction
from tests.support.rubber import make_rubber

BALL, BOX = Sphere(radius=5e-3), Box(size=(3e-3, 3e-3, 2e-3))


def make_cover(ratio, thickness=2e-3):
    return Cover(layers=(Layer(thickness=thickness, material=make_rubber(ratio, "linear-elastic")),))


def solve(indenter, ratio, depth, half, *, friction, cells=48, steps=16, motion=(1.0, 0.0, 0.0)):
    """The contact on a wide flat cover, and its state at a depth; motion downwards, along x and along y."""
    cell = 2 * half / cells
    axis = (np.arange(cells) - (cells - 1) / 2) * cell
    x, y = np.meshgrid(axis, axis, indexing="ij")
    height, towards = indenter.gap(x, y), np.zeros((3, *x.shape))
    towards[:] = np.array(motion)[:, None, None]
    layer = VectorCompliance.tabulate(make_cover(ratio), 12 * half)
    contact = RubbingContact(
        gap=lambda travel: height - travel * motion[0],
        motion=towards,
        compliance=VectorOperator(layer, x.shape, (cell, cell)),
        area=cell**2,
        friction=friction,
    )
    return contact, contact.follow(0.0, depth, steps)


def test_a_thick_cover_responds_to_shear_as_a_half_space():
    """Point forces far apart over the size of the cells (Johnson, Contact Mechanics, 1985, section 3.6)."""
    ratio, thickness = 0.3, 1.0
    layer = VectorCompliance.tabulate(make_cover(ratio, thickness), 0.1)
    x, y, cell = np.array([1e-3]), np.array([0.6e-3]), 1e-5
    found = layer.average_over_cells(x, y, cell, cell)[..., 0] / cell**2
    r, mu = np.hypot(x, y)[0], make_rubber(ratio).shear_modulus
    c, s = x[0] / r, y[0] / r
    exact = np.array([
        [1 - ratio, (1 - 2 * ratio) / 2 * c, (1 - 2 * ratio) / 2 * s],
        [-(1 - 2 * ratio) / 2 * c, 1 - ratio + ratio * c**2, ratio * c * s],
        [-(1 - 2 * ratio) / 2 * s, ratio * c * s, 1 - ratio + ratio * s**2],
    ]) / (2 * np.pi * mu * r)  # fmt: skip
    np.testing.assert_allclose(found, exact, atol=3e-3 * exact.max())


def test_an_even_shear_moves_a_layer_by_its_thickness_over_the_shear_modulus():
    layer = VectorCompliance.tabulate(make_cover(0.45), 60e-3)
    operator = VectorOperator(layer, (64, 64), (1e-3, 1e-3))
    traction = np.zeros((3, 64, 64))
    traction[1] = 1.0
    moved = operator.displace(traction)[:, 32, 32]
    np.testing.assert_allclose(moved * make_rubber(0.45).shear_modulus / 2e-3, [0, 1, 0], atol=1e-3)


def test_displacements_are_reciprocal():
    operator = VectorOperator(VectorCompliance.tabulate(make_cover(0.2), 20e-3), (9, 7), (0.3e-3, 0.4e-3))
    one, other = np.random.default_rng(0).random((2, 3, 9, 7))
    assert (one * operator.displace(other)).sum() == pytest.approx((other * operator.displace(one)).sum(), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.0, 0.3, 0.49])
@pytest.mark.parametrize("friction", [0.0, 0.05, 0.2, np.inf])
def test_a_ball_on_cells_bears_the_force_on_rings(ratio, friction):
    known = press_with_friction(make_cover(ratio), BALL, 0.2e-3, min(friction or 1e-9, 1e3), rings=48)
    half = 1.1 * known.contact_radius
    contact, state = solve(BALL, ratio, 0.2e-3, half, friction=friction)
    assert contact.measure_load(state) == pytest.approx(known.force, rel=5e-3)
    assert state.touching.sum() * contact.area == pytest.approx(np.pi * known.contact_radius**2, rel=0.03)
    pressure, shear = state.traction[0], np.hypot(*state.traction[1:])
    assert (pressure[state.touching] >= 0).all()
    assert not shear[~state.touching].any()
    if friction < np.inf:
        assert (shear <= friction * (pressure + 1e-3 * pressure.max()) + 1e-9)[state.touching].all()
    rubbed = np.pi * np.diff(known.edges**2) @ np.abs(known.shear)
    assert shear.sum() * contact.area == pytest.approx(rubbed, rel=0.06, abs=1e-6 * known.force)


@pytest.mark.slow
def test_twice_the_steps_change_the_force_little():
    loads = []
    for steps in (8, 16, 32):
        contact, state = solve(BALL, 0.0, 0.2e-3, 1e-3, friction=np.inf, cells=32, steps=steps)
        loads.append(contact.measure_load(state))
    assert abs(loads[1] / loads[2] - 1) < abs(loads[0] / loads[2] - 1) < 0.01


def test_cells_below_a_face_move_with_it():
    motion = (0.8, 0.6, 0.0)
    contact, state = solve(BOX, 0.3, 0.1e-3, 1.5e-3, friction=np.inf, cells=24, steps=2, motion=motion)
    assert state.touching.all()
    np.testing.assert_allclose(state.moved, 0.1e-3 * contact.motion, atol=1e-5 * 0.1e-3)
