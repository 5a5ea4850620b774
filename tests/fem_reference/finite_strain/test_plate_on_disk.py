"""A plate wider than a disk of rubber that slides on its base, in the r-z plane, and the edge of a contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import closed_form
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.loading_path import LoadingPath
from meshes import Cover, Layer, Sphere
from tests.fem_reference.finite_strain.test_plate_on_block import SOFT, H, compress
from tests.support.rubber import stack_layers

#: Radius of the disk, whose outer boundary is free above a sliding base.
RADIUS = 1.5e-3
AREA = np.pi * RADIUS**2
DEPTHS = (0.1e-3, 0.4e-3)


def press(material, *, friction=0.0, scale=1.0, depths=DEPTHS):
    cover = Cover(layers=(Layer(thickness=H, material=material),), base="sliding")
    path = LoadingPath(
        cover=cover, indenter=Sphere(radius=1e4), targets=depths, control="depth", fields=True, friction=friction,
        load_scale=scale,
    )  # fmt: skip
    options = {"elements_per_thickness": 1, "contact_radius": RADIUS / 1.25, "fillet": 0.1e-3, "reach": RADIUS}
    return press_axisymmetric(path, **options)[0]


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_force_energy_and_base_are_those_of_even_compression(scale):
    """At finite strain those of a neo-Hookean bar, with a small scale those of Hooke's law."""
    for depth, found in zip(DEPTHS, press(SOFT, scale=scale), strict=True):
        stress, energy, across = compress(depth)
        if scale < 1:
            stress = 2 * SOFT.shear_modulus * (1 + SOFT.poisson_ratio) * depth / H
            energy, across = stress * depth / H / 2, 1 + SOFT.poisson_ratio * depth / H
        assert found.total_force == pytest.approx(stress * AREA, rel=1e-3)
        assert found.energy == pytest.approx(energy * AREA * H, rel=2e-3)
        assert (found.depth, found.area, found.area_spread) == (pytest.approx(depth), pytest.approx(AREA), 0.0)
        assert found.base.spread.reaction == pytest.approx(1, rel=1e-6)
        assert found.base.spread.pressure_per_force[:-1] == pytest.approx(1 / AREA, rel=1e-4)
        assert found.contact[:, 2].sum() == pytest.approx(found.total_force, rel=1e-6)
        # The mean square of the distance of an even pressure from the axis is half the square of the radius.
        spread = found.contact[:, 2] @ (found.contact[:, :2] ** 2).sum(axis=1) / found.total_force
        assert spread == pytest.approx((across if scale == 1 else 1.0) ** 2 * RADIUS**2 / 2, rel=2e-3)
        assert found.shear is None
        fields = found.fields
        assert fields.axisymmetric
        r, _, z = fields.position.T
        moved = np.column_stack([(across - 1) * r, 0 * r, -depth / H * z])
        np.testing.assert_allclose(fields.displacement, moved, atol=2e-3 * depth)
        exact = np.zeros((len(r), 3, 3))
        exact[:, 2, 2] = -stress / (across**2 if scale == 1 else 1.0)
        np.testing.assert_allclose(fields.stress, exact, atol=5e-3 * stress)


def test_friction_does_nothing_where_nothing_slides():
    """Without transverse strain at small strain the top does not move sideways."""
    still = replace(SOFT, poisson_ratio=0.0)
    (found,) = press(still, friction=0.3, scale=1e-3, depths=(0.2e-3,))
    stress = 2 * still.shear_modulus * 0.1
    assert found.total_force == pytest.approx(stress * AREA, rel=1e-3)
    assert np.abs(found.shear).sum() < 1e-3 * found.total_force
    assert found.shear.shape == (len(found.contact), 2)


def test_the_edge_of_a_contact_is_located_within_the_elements():
    """On three elements through the cover the edge lies within 1 % of that of the integral equation."""
    cover, ball, edges = stack_layers((H, 1e6, 0.45)), 5e-3, (1.1e-3,)
    known = [closed_form.sphere(cover, ball, edge) for edge in edges]
    path = LoadingPath(
        cover=cover, indenter=Sphere(radius=ball), targets=tuple(each.depth for each in known), control="depth",
        load_scale=1e-3,
    )  # fmt: skip
    options = {"elements_per_thickness": 3, "contact_radius": edges[-1], "fillet": 0.1e-3, "reach": 10e-3}
    for found, exact in zip(press_axisymmetric(path, **options)[0], known, strict=True):
        assert np.sqrt(found.area / np.pi) == pytest.approx(exact.contact_radius, rel=0.01)
        assert found.total_force == pytest.approx(exact.force, rel=0.02)
        # Six quadrature points lie on two elements across, each a fifth of the contact wide.
        assert 0.05 < found.area_spread < 0.4
