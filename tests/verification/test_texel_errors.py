"""The error of each texel force, against closed forms on seeded random covers."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import closed_form, press
from fem_reference.small_strain_contact.several_indenters import Body, press_together
from meshes import Cone, Cover, Cylinder, Layer, Material, Pose, Sphere, TexelArray

#: Texels with less of the load are not counted [-].
LEAST = 0.01


def draw_press(seed):
    """Draw one to three layers, a body of revolution, an array and a place."""
    rng = np.random.default_rng(seed)
    layers = tuple(
        Layer(
            thickness=float(rng.uniform(0.5e-3, 3e-3)),
            material=Material(
                name="random",
                model="linear-elastic",
                parameters={"youngs_modulus": float(10 ** rng.uniform(4.5, 6))},
                poisson_ratio=float(rng.uniform(0, 0.5)),
            ),
        )
        for _ in range(int(rng.integers(1, 4)))
    )
    cover = Cover(layers=layers, base=str(rng.choice(["bonded", "sliding"])))
    h = cover.thickness
    indenter = [Sphere(radius=3 * h), Cone(angle=2.6, radius=20 * h), Cylinder(radius=h)][int(rng.integers(3))]
    array = TexelArray.grid(8, 8, float(rng.uniform(0.4, 2) * h))
    at = tuple(float(each) for each in rng.uniform(-h, h, 2))
    return cover, array, indenter, at, float(rng.uniform(0.02, 0.15) * h)


def count_covered(found, exact, load):
    """Count the texels above `LEAST` of the load, and those of them whose interval holds the exact force."""
    counted = np.abs(exact) > LEAST * load
    return counted.sum(), (np.abs(found.texel_forces - exact) <= found.texel_errors)[counted].sum()


@pytest.mark.slow
@pytest.mark.parametrize("control", ["load", "depth"])
def test_the_intervals_of_texel_forces_hold_the_closed_form(control):
    counts, widths = [], []
    for seed in range(5):
        cover, array, indenter, at, depth = draw_press(seed)
        exact = closed_form.indent(cover, indenter, depth=depth)
        given = {"load": exact.force} if control == "load" else {"depth": depth}
        found = press(cover, array, indenter, Pose.planar(at=at), **given)
        counts.append(count_covered(found, exact.texel_forces(array, at), exact.force))
        widths.append(np.median(found.texel_errors) / exact.force)
        beside = exact.force - exact.texel_forces(array, at).sum()
        assert abs(found.outside - beside) <= found.outside_error + 1e-5 * exact.force
        peak = np.argmax(found.texel_forces)
        assert found.texel_errors[peak] >= found.error_estimate["peak_texel"] * found.texel_forces[peak] * (1 - 1e-9)
    total, covered = np.sum(counts, axis=0)
    assert total > 50
    assert covered >= 0.95 * total
    assert max(widths) < 3e-3


@pytest.mark.slow
def test_the_intervals_of_two_far_bodies_hold_the_sum_of_two_closed_forms(bonded, wts):
    cover = bonded(0.3)
    bodies = [Body(indenter=Cylinder(radius=2e-3), load=load, at=(x, 0.0)) for load, x in ((0.2, -12e-3), (0.3, 12e-3))]
    found = press_together(cover, wts, bodies)
    exact = sum(closed_form.indent(cover, each.indenter, load=each.load).texel_forces(wts, each.at) for each in bodies)
    total, covered = count_covered(found, exact, 0.5)
    assert total >= 4
    assert covered >= 0.95 * total


@pytest.mark.slow
def test_idle_texels_have_no_error(bonded):
    """A texel that is not active bears no force."""
    array = TexelArray.grid(3, 3, 3e-3, active=np.arange(9) != 4)
    found = press(bonded(0.3), array, Sphere(radius=5e-3), load=0.5)
    assert np.flatnonzero(found.texel_errors == 0).tolist() == [4]
    assert found.outside_error > 0
