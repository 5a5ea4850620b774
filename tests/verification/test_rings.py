"""Ring elements with Coulomb friction, against the exact contacts without friction and without slip."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.special import j0, jv

from fem_reference.closed_form import indent
from meshes import Cylinder, Sphere, TexelArray
from tests.exact.active_set import solve_active_set
from tests.exact.no_slip import stuck_punch, stuck_shape
from tests.exact.rings import _find_slip, _transform_rings, press_with_friction

ARRAY = TexelArray.grid(3, 3, 3.4e-3)
PUNCH, BALL = Cylinder(radius=3e-3), Sphere(radius=5e-3)


def middle(contact):
    return contact.texel_forces(ARRAY)[4]


@pytest.mark.parametrize("nu", [0.3, pytest.param(0.49, marks=pytest.mark.slow)])
def test_a_punch_has_both_limits(bonded, nu):
    cover = bonded(nu)
    limits = ((1e-9, indent(cover, PUNCH, depth=1e-4)), (1e3, stuck_punch(cover, 3e-3).press(1e-4)))
    for friction, exact in limits:
        found = press_with_friction(cover, PUNCH, 1e-4, friction, rings=12)
        assert found.force == pytest.approx(exact.force, rel=4e-3)
        assert middle(found) == pytest.approx(middle(exact), rel=2e-3)


def test_a_ball_without_friction(bonded):
    exact = indent(bonded(0.3), BALL, depth=2e-4)
    found = press_with_friction(bonded(0.3), BALL, 2e-4, 1e-9, rings=64)
    assert found.force == pytest.approx(exact.force, rel=1e-4)
    assert middle(found) == pytest.approx(middle(exact), rel=1e-4)
    assert found.contact_radius == pytest.approx(exact.contact_radius, rel=3e-3)


@pytest.mark.slow
def test_a_ball_without_slip(bonded):
    exact = stuck_shape(bonded(0.49), lambda r: BALL.gap(r, np.zeros_like(r)), 1.5e-3, steps=16)
    found = press_with_friction(bonded(0.49), BALL, exact.depth, 1e3, rings=64)
    assert found.force == pytest.approx(exact.force, rel=2e-3)
    assert middle(found) == pytest.approx(middle(exact), rel=3e-3)


@pytest.mark.slow
def test_shear_obeys_coulombs_law_and_slip_reaches_the_edge(bonded):
    found = press_with_friction(bonded(0.3), BALL, 2e-4, 0.2, rings=48)
    touching = found.pressure > 0
    share = np.abs(found.shear[touching]) / (0.2 * found.pressure[touching])
    assert share.max() <= 1 + 1e-9
    assert share[-3:] == pytest.approx(1)
    assert share[0] < 0.5
    low, high = (press_with_friction(bonded(0.3), BALL, 2e-4, mu, rings=48).force for mu in (0.05, 1.0))
    assert low < found.force < high


@pytest.mark.parametrize("seed", range(20))
def test_rings_stick_or_slip_against_their_shear_whatever_the_way_there(seed):
    """Of every ring: its shear is below the limit and it does not slip, or at the limit and it slips the other way."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(12, 12))
    matrix = root @ root.T + 0.1 * np.eye(12)
    wanted, limit = random.normal(size=12), np.maximum(random.uniform(-0.2, 1, 12), 0)
    shear = _find_slip(matrix, wanted, limit)
    slip = matrix @ shear - wanted
    stuck = np.abs(slip) < 1e-9
    assert (np.abs(shear) <= limit * (1 + 1e-9)).all()
    assert np.abs(shear[~stuck]) == pytest.approx(limit[~stuck])
    assert (slip * shear <= 1e-9).all()


def test_pressures_push_and_no_ring_overlaps():
    for seed in range(20):
        random = np.random.default_rng(seed)
        root = random.normal(size=(12, 12))
        matrix, wanted = root @ root.T + 0.1 * np.eye(12), random.normal(size=12)
        pressure = solve_active_set(matrix, wanted, rounding=1e-12)
        apart = matrix @ pressure - wanted
        assert (pressure >= 0).all()
        assert (apart > -1e-9).all()
        assert pressure @ np.abs(apart) == pytest.approx(0, abs=1e-9)


def test_transforms_of_tractions_on_rings_are_their_hankel_integrals():
    """Pressure 1 by J0, and the shear r / rho, with rho in the middle of the ring, by J1."""
    edges, k = np.array([0.0, 1e-3, 1.7e-3, 3e-3]), np.array([1.0, 300.0, 2000.0])
    pressure, shear = _transform_rings(edges, k)
    x, w = np.polynomial.legendre.leggauss(30)
    for ring, (low, high) in enumerate(itertools.pairwise(edges)):
        r, weight = (low + high) / 2 + (high - low) / 2 * x, (high - low) / 2 * w
        assert pressure[:, ring] == pytest.approx(j0(np.outer(k, r)) @ (r * weight), rel=1e-9)
        assert shear[:, ring] == pytest.approx(jv(1, np.outer(k, r)) @ (r**2 / r.mean() * weight), rel=1e-6)
