"""Boundary elements on the exact compliance, checked by themselves and then used to check `press` without a formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import closed_form, press
from meshes import Box, Cover, Cylinder, Layer, Material, Roller, Sphere
from tests.exact import boundary
from tests.exact.boundary import pressed_shape

SQUARE, ROLLER = Box(size=(4e-3, 4e-3, 4e-3)), Roller(radius=4e-3, length=8e-3)
RATIOS = [0.3, 0.45, 0.49, 0.499, 0.5]
SHAPES = {"square punch": (SQUARE, 0.05e-3), "roller": (ROLLER, 0.2e-3)}

slow = pytest.mark.slow


class _Nothing:
    """A table of zeros."""

    x = np.zeros(2)

    def __call__(self, logarithm):
        return np.zeros_like(logarithm)


def foil_on_foam(base="bonded"):
    """A foil a tenth as thick as the cover, a hundred times as stiff as what is under it."""
    foil = Material(name="foil", model="linear-elastic", parameters={"youngs_modulus": 1e8}, poisson_ratio=0.35)
    soft = Material(name="soft", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.45)
    layers = (Layer(thickness=1.8e-3, material=soft), Layer(thickness=0.2e-3, material=foil))
    return Cover(layers=layers, base=base)


def differences(cover, array, shape, depth, cells=14):
    """Of force at the depth, and of any texel over the peak, between `press` and the boundary elements."""
    exact = pressed_shape(cover, shape, depth, cells=cells)
    found = press(cover, array, shape, depth=depth)
    forces = exact.texel_forces(array)
    return abs(found.total_force / exact.total_force - 1), np.abs(found.texel_forces - forces).max() / forces.max()


def test_boundary_elements_equal_the_sphere_on_a_layer(bonded):
    for cover in (bonded(0.5), bonded(0.3, base="sliding")):
        exact = closed_form.sphere(cover, 10e-3, cover.thickness)
        found = pressed_shape(cover, Sphere(radius=10e-3), exact.depth, cells=16)
        assert found.total_force == pytest.approx(exact.force, rel=3e-3)


def test_boundary_elements_equal_the_square_punch_on_a_half_space(bonded):
    """The potential of a charged square plate of capacity 0.3667874 sides (Read 1997): force = pi C E* depth."""
    found = pressed_shape(bonded(0.3, thickness=1.0), SQUARE, 1e-5, cells=16).total_force
    assert found == pytest.approx(np.pi * 0.3667874 * 4e-3 * 1e6 / (1 - 0.3**2) * 1e-5, rel=3e-3)


@slow
def test_a_long_roller_presses_its_middle_evenly(bonded):
    """Plane strain: far from its ends the load per length of a long roller does not depend on the length."""
    long, longer = (pressed_shape(bonded(0.3), Roller(radius=4e-3, length=n), 0.2e-3, cells=16) for n in (24e-3, 36e-3))
    more = (longer.total_force - long.total_force) / 12e-3
    width = 1e-3
    for found in (long, longer):
        y = np.abs(found.centres[:, 1])
        band = y < width
        reach = y[band].max()
        rows = np.unique(y[band].round(9))
        assert len(rows) >= 1
        assert found.force[band].sum() / (2 * (reach + rows[0])) == pytest.approx(more, rel=0.03)


def test_a_planted_defect_is_found(bonded, monkeypatch):
    """The layer taken for a half space: far too soft."""
    excess = boundary.tabulate_excess
    monkeypatch.setattr(boundary, "tabulate_excess", lambda cover: replace(excess(cover), table=_Nothing()))
    cover = bonded(0.49)
    exact = closed_form.sphere(cover, 10e-3, cover.thickness)
    assert pressed_shape(cover, Sphere(radius=10e-3), exact.depth, cells=12).total_force < 0.5 * exact.force


@pytest.mark.slow
@pytest.mark.parametrize(("nu", "shape"), [(0.3, "roller"), (0.499, "square punch"), (0.5, "roller")])
def test_press_equals_boundary_elements_on_a_bonded_layer(bonded, wts, nu, shape):
    assert max(differences(bonded(nu), wts, *SHAPES[shape])) < 0.01


@slow
@pytest.mark.parametrize(("nu", "shape"), [(0.3, "square punch"), (0.5, "roller")])
def test_press_equals_boundary_elements_on_a_sliding_layer(bonded, wts, nu, shape):
    cover = bonded(nu, base="sliding")
    assert max(differences(cover, wts, *SHAPES[shape])) < 0.01


@slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("base", ["bonded", "sliding"])
def test_press_equals_boundary_elements_under_a_stiff_foil(wts, base, shape):
    assert max(differences(foil_on_foam(base), wts, *SHAPES[shape])) < 0.01


@slow
@pytest.mark.parametrize(("cover", "shape"), [("layer", "roller"), ("foil", "square punch")])
def test_boundary_elements_are_converged_to_a_thousandth(bonded, cover, shape):
    made = bonded(0.5) if cover == "layer" else foil_on_foam()
    forces = [pressed_shape(made, *SHAPES[shape], cells=n).total_force for n in (16, 24, 36)]
    left = abs(forces[2] - forces[1]) / (1.5**2 - 1)  # second order
    assert left < 1e-3 * forces[2]
    assert abs(forces[2] - forces[1]) < abs(forces[2] - forces[0])


@slow
@pytest.mark.parametrize("nu", RATIOS)
def test_estimates_of_press_cover_the_error_of_a_punch_and_a_sphere(bonded, wts, nu):
    cover = bonded(nu)
    punch = closed_form.punch(cover, cover.thickness, 0.05e-3)
    sphere = closed_form.sphere(cover, 10e-3, cover.thickness)
    for exact, shape in ((punch, Cylinder(radius=cover.thickness)), (sphere, Sphere(radius=10e-3))):
        found = press(cover, wts, shape, depth=exact.depth)
        true = abs(found.total_force / exact.force - 1)
        # the compliance's own error, some 1e-5, is not in the spread of the grids
        assert true <= found.error_estimate["total_force"] + 5e-5 < 0.01


def test_a_masked_texel_carries_no_force(bonded, wts):
    found = pressed_shape(bonded(0.45), SQUARE, 0.05e-3, cells=6)
    active = np.ones(wts.count, dtype=bool)
    active[wts.middle] = False
    forces, masked = found.texel_forces(wts), found.texel_forces(replace(wts, active=active))
    assert masked[wts.middle] == 0
    assert np.delete(masked, wts.middle) == pytest.approx(np.delete(forces, wts.middle))
    assert forces.sum() == pytest.approx(found.total_force, rel=0.01)


@pytest.mark.parametrize(("cells", "largest"), [(8, 1.0), (8, 0.05), (3, 0.1)])
def test_cells_shrink_towards_the_edge_and_none_is_larger_than_allowed(cells, largest):
    nodes = boundary._grade_toward_edge(2.0, cells, largest)
    steps = np.diff(nodes)
    assert (nodes[0], nodes[-1]) == pytest.approx((0, 2))
    assert steps.max() <= largest
    assert (np.diff(steps) < 0).all()
    assert len(steps) == cells or steps.max() > 0.95 * largest
