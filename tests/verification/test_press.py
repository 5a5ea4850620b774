"""Pressing indenters into the bonded layer, against the exact integral equations."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import closed_form, press
from fem_reference.small_strain_contact import frictionless
from fem_reference.small_strain_contact.constrained_solver import find_pressures
from meshes import Box, Cylinder, Nut, Pose, Roller, Sphere, TexelArray
from tests.exact.hertz import hertz as press_half_space
from tests.support.indentations import column_contact

#: The ends by default, what lies between in the slow tier.
RATIOS = [0.0, *(pytest.param(nu, marks=pytest.mark.slow) for nu in (0.3, 0.45, 0.49)), 0.5]


@pytest.mark.parametrize("nu", [*RATIOS[1:4], pytest.param(0.0, marks=pytest.mark.slow), 0.5])
@pytest.mark.parametrize("ratio", [0.5, pytest.param(1.0, marks=pytest.mark.slow)])
def test_sphere_force_and_area(bonded, wts, nu, ratio):
    cover = bonded(nu)
    exact = closed_form.sphere(cover, 10e-3, ratio * cover.thickness)
    found = press(cover, wts, Sphere(radius=10e-3), depth=exact.depth)
    assert found.total_force == pytest.approx(exact.force, rel=1e-3)
    assert found.contact_area == pytest.approx(np.pi * exact.contact_radius**2, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49, 0.5])
def test_sphere_depth_under_a_load(bonded, wts, nu):
    cover = bonded(nu)
    exact = closed_form.sphere(cover, 10e-3, cover.thickness)
    found = press(cover, wts, Sphere(radius=10e-3), load=exact.force)
    assert found.depth == pytest.approx(exact.depth, rel=1e-3)


@pytest.mark.parametrize(
    ("nu", "ratio"),
    [
        pytest.param(0.0, 0.5, marks=pytest.mark.slow),
        pytest.param(0.3, 1.0, marks=pytest.mark.slow),
        pytest.param(0.49, 0.5, marks=pytest.mark.slow),
        pytest.param(0.5, 1.0, marks=pytest.mark.slow),
    ],
)
def test_flat_punch_force(bonded, wts, nu, ratio):
    cover = bonded(nu)
    exact = closed_form.punch(cover, ratio * cover.thickness, 0.05e-3)
    found = press(cover, wts, Cylinder(radius=exact.contact_radius), depth=exact.depth)
    assert found.total_force == pytest.approx(exact.force, rel=1e-3)
    assert abs(found.total_force / exact.force - 1) < 3 * found.error_estimate["total_force"] + 1e-4


@pytest.mark.slow
def test_small_contact_on_a_thick_layer_is_hertz(bonded, wts):
    cover = bonded(0.3, thickness=20e-3)
    hertz = press_half_space(cover.layers[0], 5e-3, 0.02)
    found = press(cover, wts, Sphere(radius=5e-3), load=0.02)
    assert found.depth == pytest.approx(hertz.depth, rel=0.03)
    assert found.contact_area == pytest.approx(np.pi * hertz.contact_radius**2, rel=0.02)


@pytest.mark.slow
def test_a_ball_that_barely_touches_is_hertz(bonded, wts):
    # A hundredth of a first cell: no cell's centre is below the approach until the cells have closed in.
    cover = bonded(0.3, thickness=20e-3)
    hertz = press_half_space(cover.layers[0], 5e-3, 1e-6)
    found = press(cover, wts, Sphere(radius=5e-3), depth=hertz.depth)
    assert found.total_force == pytest.approx(1e-6, rel=5e-3)


def test_balance_and_linearity(bonded, wts):
    cover = bonded(0.49)
    one = press(cover, wts, Box(size=(8e-3, 8e-3, 5e-3)), load=1.0)
    two = press(cover, wts, Box(size=(8e-3, 8e-3, 5e-3)), load=2.0)
    assert one.texel_forces.sum() + one.outside == pytest.approx(1.0, abs=2e-5)
    assert abs(one.outside) < 0.02
    assert two.texel_forces == pytest.approx(2 * one.texel_forces, rel=1e-5, abs=1e-7)
    assert two.depth == pytest.approx(2 * one.depth, rel=1e-5)


@pytest.mark.slow
def test_quarter_turn_of_a_square_changes_nothing(bonded, wts):
    shape = Box(size=(8e-3, 8e-3, 5e-3))
    straight = press(bonded(0.4), wts, shape, load=1.0)
    turned = press(bonded(0.4), wts, shape, load=1.0, pose=Pose.planar(yaw=np.pi / 2))
    assert turned.texel_forces == pytest.approx(straight.texel_forces, abs=1e-6)


@pytest.mark.slow
def test_mirrored_poses_mirror_the_image(bonded, wts):
    shape = Box(size=(9e-3, 4e-3, 5e-3))
    left = press(bonded(0.45), wts, shape, load=1.0, pose=Pose.planar(at=(-3e-3, 2e-3), yaw=0.4))
    right = press(bonded(0.45), wts, shape, load=1.0, pose=Pose.planar(at=(3e-3, 2e-3), yaw=-0.4))
    assert wts.image(right.texel_forces)[:, ::-1].ravel() == pytest.approx(left.texel_forces, abs=2e-6)


@pytest.mark.slow
def test_force_lands_under_the_indenter(bonded, wts):
    found = press(bonded(0.3), wts, Sphere(radius=4e-3), depth=0.2e-3, pose=Pose.planar(at=(2.1e-3, -5.3e-3)))
    centre = found.texel_forces @ wts.centres[:, :2] / found.texel_forces.sum()
    assert centre == pytest.approx([2.1e-3, -5.3e-3], abs=0.2e-3)


@pytest.mark.slow
def test_a_ball_far_larger_than_the_cover_is_thick(bonded, wts):
    """Its footprint is a thousand times the contact; what counts is where it is lower than the cover is thick."""
    cover = bonded(0.45)
    exact = closed_form.sphere(cover, 0.8, 4e-3)
    found = press(cover, wts, Sphere(radius=0.8), depth=exact.depth)
    assert found.total_force == pytest.approx(exact.force, rel=2e-3)


@pytest.mark.parametrize("target", [pytest.param({"load": 1.0}, marks=pytest.mark.slow), {"depth": 0.1e-3}])
def test_the_base_carries_the_load_on_arrays_of_narrow_texels_and_of_few(bonded, target):
    """The force on the texels and the force outside them are computed on their own; neither is a difference."""
    for array in (TexelArray.grid(5, 30, (1e-3, 7e-3), texel_size=(0.4e-3, 6e-3)), TexelArray.grid(1, 1, 2e-3)):
        found = press(
            bonded(0.49), array, Box(size=(9e-3, 3e-3, 5e-3)), pose=Pose.planar(at=(1e-3, -2e-3), yaw=0.3), **target
        )
        assert found.texel_forces.sum() + found.outside == pytest.approx(found.total_force, rel=2e-5)
        assert found.balance == pytest.approx(
            (found.texel_forces.sum() + found.outside) / found.total_force - 1, abs=1e-12
        )
        assert found.total_force == pytest.approx(target.get("load", found.total_force), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("nu", "share"),
    [
        (0.0, 0.1),
        (0.5, 3.0),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in ((0.0, 3.0), (0.49, 0.1), (0.49, 3.0), (0.5, 0.1))),
    ],
)
def test_area_and_depth_of_spheres_are_exact_and_covered(bonded, wts, nu, share):
    """Contact radii from a tenth to three times the thickness: no bias of whole cells."""
    cover = bonded(nu)
    radius = share * cover.thickness
    exact = closed_form.sphere(cover, 20 * radius, radius)
    found = press(cover, wts, Sphere(radius=20 * radius), load=exact.force)
    area = np.pi * radius**2
    assert found.contact_area == pytest.approx(area, rel=1e-3)
    assert abs(found.contact_area / area - 1) <= found.error_estimate["contact_area"]
    assert abs(found.depth / exact.depth - 1) <= found.error_estimate["depth"] < 1e-3
    assert found.error_estimate["total_force"] == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("radius", "load"),
    [(33e-3, 2.0), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((2e-3, 20.0), (0.2, 0.5)))],
)
def test_long_rollers_are_resolved_across(bonded, wts, radius, load):
    found = press(bonded(0.49), wts, Roller(radius=radius, length=0.12), load=load)
    assert found.error_estimate["contact_area"] < 0.02
    assert found.error_estimate["depth"] < 2e-3
    width = found.contact_area / 0.12
    assert np.abs(column_contact(found)[:, 0]).max() == pytest.approx(width / 2, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    "face", [Cylinder(radius=4e-3), pytest.param(Nut(across=13e-3, bore=11e-3), marks=pytest.mark.slow)]
)
def test_grids_are_added_until_the_wanted_accuracy_is_reached(bonded, wts, face):
    lines = []
    usual = press(bonded(0.49), wts, face, depth=0.1e-3)
    error = max(usual.error_estimate.values())
    better = press(bonded(0.49), wts, face, depth=0.1e-3, accuracy=0.7 * error, progress=lines.append)
    # the straight edges of a nut do not fit all grids alike, and its estimate need not fall
    assert max(better.error_estimate.values()) <= (error if isinstance(face, Nut) else 0.7 * error)
    assert any("a finer grid is added" in line for line in lines)
    assert bool(better.warnings) == (max(better.error_estimate.values()) > 0.7 * error)
    missed = press(bonded(0.49), wts, face, depth=0.1e-3, accuracy=1.01e-4)
    assert "the feasible grids reach" in missed.warnings[-1]
    with pytest.raises(ValueError, match=r"no grid reaches it: the smallest error that is stated here is 0\.01%"):
        press(bonded(0.49), wts, face, depth=0.1e-3, accuracy=0.9e-4)
    with pytest.raises(ValueError, match="relative error between 0 and 1"):
        press(bonded(0.49), wts, face, depth=0.1e-3, accuracy=1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "shape", [pytest.param(Box(size=(8e-3, 2e-3, 5e-3)), marks=pytest.mark.slow), Sphere(radius=5e-3)]
)
def test_a_contact_solver_that_misses_the_load_shows_in_the_balance(bonded, wts, shape, monkeypatch, tmp_path):
    """Pressures 2 % too large: planted in the solver, found in the result."""
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path))
    good = press(bonded(0.45), wts, shape, load=1.25)
    assert abs(good.balance) < 1e-4
    assert not good.warnings

    def miss(*arguments, **options):
        pressure, motion = find_pressures(*arguments, **options)
        return 1.02 * pressure, motion

    monkeypatch.setattr(frictionless, "find_pressures", miss)
    monkeypatch.setenv("SOFTCOVER_STORE", str(tmp_path / "other"))
    # a flat face is scaled to its load, whatever the solver says
    wrong = press(bonded(0.45), wts, shape, load=1.25)
    if not shape.is_flat:
        assert wrong.balance == pytest.approx(0.02, rel=1e-2)
        assert "differ from the load by +2.00%" in wrong.warnings[0]
    assert wrong.depth < 0.99 * good.depth or wrong.balance > 0.01
