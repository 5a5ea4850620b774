"""Fits to force and depth: known foundations are recovered, and loads that MuJoCo cannot match are reported."""

import numpy as np
import pytest

from fastmodel import CoverContact, Plate, indent
from fastmodel.fitting.contact_stiffness import fit_contact, fit_foundation
from meshes import Box, Cylinder, Sphere
from tests.support.cover_data import cells, parameters

BALL = Sphere(radius=5e-3)
DEPTH = np.array([0.02e-3, 0.05e-3, 0.1e-3, 0.3e-3])


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (Cylinder(radius=3e-3), np.pi * 9e-6 * DEPTH),
        (Box(size=(4e-3, 6e-3, 5e-3)), 24e-6 * DEPTH),
        (BALL, np.pi * DEPTH**2 * (5e-3 - DEPTH / 3)),
    ],
    ids=lambda value: type(value).__name__,
)
def test_the_modulus_of_a_synthetic_foundation_is_recovered(shape, volume):
    """Force = modulus times volume below the top, in closed form."""
    found = fit_foundation(shape, 3e8 * volume, DEPTH)
    assert found.modulus == pytest.approx(3e8, rel=2e-3)
    assert found.residual < 2e-3
    assert found.uncertainty < 2e-3 * found.modulus
    assert found.estimates[found.estimator] == found.modulus


def test_uncertainty_is_the_scatter_of_repeated_fits():
    volume, rng = np.pi * 9e-6 * DEPTH, np.random.default_rng(3)
    noise = 0.02 * 3e8 * volume.max()
    forces = np.abs(3e8 * volume + noise * rng.normal(size=(50, 4)))
    many = [fit_foundation(Cylinder(radius=3e-3), each, DEPTH) for each in forces]
    spread = np.std([each.modulus for each in many])
    assert np.sqrt(np.mean([each.uncertainty**2 for each in many])) == pytest.approx(spread, rel=0.3)


def test_a_cover_is_no_foundation():
    """A ball on a half space: force as depth to 3/2, so light touches ask for a stiffer foundation than heavy ones."""
    found = fit_foundation(BALL, 4 / 3 * 1.3e6 * np.sqrt(5e-3) * DEPTH**1.5, DEPTH)
    assert found.estimates["lightest"] > 2 * found.estimates["heaviest"]
    assert found.residual > 0.05


@pytest.mark.parametrize("matched", [0.2, 5.0])
def test_one_depth_is_matched_and_the_others_are_not(matched):
    load = np.array([0.2, 1.0, 5.0])
    depth = np.array([0.03e-3, 0.1e-3, 0.25e-3])
    found = fit_contact(load, depth, matched=matched)
    at = int(np.flatnonzero(load == matched)[0])
    assert found.misses[at] == pytest.approx(0, abs=1e-3)
    assert found.mass == pytest.approx(matched / 9.80665)
    # softness is divided by mass: every body sinks to the same depth
    np.testing.assert_allclose(found.sinks, found.depth, rtol=1e-3)
    np.testing.assert_allclose(found.misses, found.depth / depth - 1, atol=2e-3)


def test_a_plate_with_fitted_parameters_carries_the_same_weight():
    found = fit_contact([0.5, 1.0, 2.0], [0.02e-3, 0.04e-3, 0.06e-3])
    soft = CoverContact(plate=found.plate())
    stiff, soft = (indent(parameters(), BALL, load=1.0, contact=each) for each in (CoverContact(), soft))
    assert soft.total_force == pytest.approx(1.0, rel=1e-3)
    np.testing.assert_allclose(soft.texel_forces, stiff.texel_forces, atol=1e-3)


def test_depths_too_small_for_the_time_constant_are_matched_by_impedance():
    found = fit_contact([1.0, 2.0], [1e-6, 2e-6], timestep=2e-3)
    assert found.solref[0] == pytest.approx(5e-3)
    assert found.sinks[1] == pytest.approx(2e-6, rel=0.01)


@pytest.mark.parametrize(
    ("fit", "message"),
    [
        (lambda: fit_foundation(BALL, [1.0], [1e-3]), "two or more"),
        (lambda: fit_foundation(BALL, [1.0, 2.0], [1e-3]), "two or more"),
        (lambda: fit_foundation(BALL, [1.0, -2.0], [1e-3, 2e-3]), "load must be positive"),
        (lambda: fit_foundation(BALL, [1.0, 2.0], [1e-3, np.nan]), "depth must be positive"),
        (lambda: fit_contact([1.0, 2.0], [1e-3, 2e-3], matched=3.0), "matched must be one of the loads"),
        (lambda: Plate(solref=(0.02, 1.0)), "solref and solimp belong together"),
    ],
)
def test_bad_points_raise_an_error_that_names_the_fault(fit, message):
    with pytest.raises(ValueError, match=message):
        fit()


def test_the_foundation_of_cells_lies_among_those_of_contacts_of_its_width():
    """Cells and depth curve tell the same cover: an even patch of the width of a punch asks for about its modulus."""
    punch = Box(size=(8e-3, 8e-3, 5e-3))
    found = indent(parameters(), punch, load=2.0, contact="cover")
    again = fit_foundation(punch, [1.0, 2.0], [found.depth / 2, found.depth])
    assert again.modulus == pytest.approx(cells().foundation_modulus(8e-3), rel=0.1)
