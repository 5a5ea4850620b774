"""A plate wider than a block of rubber that slides on its base: even compression, whose solution is exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_reference.finite_strain.block_path import add_change, lay_out_block, lay_out_cover, mesh_block, press_paired
from fem_reference.finite_strain.contact_problem import Guess
from fem_reference.finite_strain.indenter_surface import IndenterSurface
from fem_reference.finite_strain.loading_path import LoadingPath, Units
from meshes import Box, Cover, Cylinder, Layer, Material, Sphere, TexelArray
from meshes.pose import Pose

H, SIZE = 2e-3, (4e-3, 3e-3)
AREA = SIZE[0] * SIZE[1]
PLATE = Box(size=(9e-3, 8e-3, 1e-3))
DEPTHS = (0.1e-3, 0.4e-3)
SOFT = Material(name="soft", model="neo-hookean", parameters={"shear_modulus": 0.4e6}, poisson_ratio=0.4)
#: An edge of the contact at a corner of the plate.
CORNERS = np.array([[4.5e-3, 4e-3], [-4.5e-3, -4e-3]])


def press(*, pose=None, friction=0.0, coarser=None, progress=None, depths=DEPTHS):
    cover = Cover(layers=(Layer(thickness=H, material=SOFT),), size=SIZE, base="sliding")
    path = LoadingPath(cover=cover, indenter=PLATE, targets=depths, control="depth", fields=True, friction=friction)
    block = lay_out_cover(path, pose or Pose(), CORNERS, elements_per_thickness=1, fillet=0.6e-3)
    return press_paired(path, block, depths, elements_per_thickness=1, coarser=coarser, progress=progress)


def compress(depth):
    """Nominal stress, energy per volume and transverse stretch of neo-Hookean rubber with free sides.

    The energy is mu (I - 3) / 2 + K (J - 1)^2 / 2, where I is the first invariant times J^(-2/3).
    """
    shear, bulk, along = SOFT.shear_modulus, SOFT.bulk_modulus, 1 - depth / H

    def energy(across, along=along):
        volume = along * across**2
        return shear / 2 * (volume ** (-2 / 3) * (along**2 + 2 * across**2) - 3) + bulk / 2 * (volume - 1) ** 2

    step = 1e-6
    across = brentq(lambda t: energy(t + step) - energy(t - step), 0.9, 1.4)
    stress = (energy(across, along + step) - energy(across, along - step)) / (2 * step)
    return -stress, energy(across), across


@pytest.fixture(scope="module")
def pressed():
    told = []
    return *press(progress=told.append), told


def test_force_energy_and_area_are_those_of_even_compression(pressed):
    small, large, pair, told = pressed
    young = 2 * SOFT.shear_modulus * 1.4
    for depth, linear, full in zip(DEPTHS, small, large, strict=True):
        assert linear.total_force == pytest.approx(young * AREA * depth / H, rel=1e-4)
        assert linear.energy == pytest.approx(linear.total_force * depth / 2, rel=1e-3)
        stress, energy, _ = compress(depth)
        assert full.total_force == pytest.approx(stress * AREA, rel=1e-3)
        assert full.energy == pytest.approx(energy * AREA * H, rel=2e-3)
        for each in (linear, full):
            assert (each.area, each.depth) == (pytest.approx(AREA), pytest.approx(depth))
            assert each.contact[:, 2].sum() == pytest.approx(each.total_force, rel=1e-6)
            assert each.contact[:, 2] @ each.contact[:, :2] == pytest.approx([0, 0], abs=1e-12)
            assert 0 <= each.overlap < 2e-3
            assert each.shear is None
        assert np.abs(full.contact[:, 0]).max() <= compress(depth)[2] * SIZE[0] / 2
        assert np.abs(linear.contact[:, 0]).max() <= SIZE[0] / 2
    assert pair.ratio == pytest.approx(1e3)
    assert any(text.startswith("small strain, ") for text in told)
    assert f"{large[1].total_force:.3g} N at 0.4 mm" in told


def test_the_base_bears_the_pressure_evenly(pressed):
    halves = TexelArray.grid(1, 2, (2e-3, 3e-3))
    for each in (*pressed[0], *pressed[1]):
        assert each.base.forces(halves, Pose()) == pytest.approx(np.array([0.5, 0.5, 0.0]) * each.total_force, abs=1e-6)


def test_fields_are_those_of_even_compression_in_the_whole_cover(pressed):
    for depth, each in zip(DEPTHS, pressed[1], strict=True):
        stress, _, across = compress(depth)
        fields = each.fields
        assert not fields.axisymmetric
        assert len(fields.layer) == len(fields.cells)
        x, y, z = fields.position.T
        assert (x.min(), x.max(), y.min(), y.max()) == pytest.approx((-2e-3, 2e-3, -1.5e-3, 1.5e-3))
        moved = np.column_stack([(across - 1) * x, (across - 1) * y, -depth / H * z])
        np.testing.assert_allclose(fields.displacement, moved, atol=2e-3 * depth)
        exact = np.zeros((3, 3))
        exact[2, 2] = -stress / across**2
        np.testing.assert_allclose(fields.stress, np.broadcast_to(exact, fields.stress.shape), atol=5e-3 * stress)
    assert all(each.fields is None for each in pressed[0])


def test_no_use_of_symmetry_changes_nothing(pressed):
    beside = press(pose=Pose.planar(at=(1e-6, 1e-6)), depths=DEPTHS[:1])
    for one, other in zip((*pressed[0][:1], *pressed[1][:1]), (*beside[0], *beside[1]), strict=True):
        assert other.total_force == pytest.approx(one.total_force, rel=1e-5)
        assert (other.energy, other.area) == (pytest.approx(one.energy, rel=1e-5), pytest.approx(one.area))


def test_a_start_from_another_grid_changes_no_result(pressed):
    small, large, pair = press(coarser=pressed[2])
    for one, other in zip((*pressed[0], *pressed[1]), (*small, *large), strict=True):
        assert other.total_force == pytest.approx(one.total_force, rel=1e-5)
    changes = pressed[2].transfer_changes(pair.elements)
    for change, linear, full in zip(changes, pair.baseline, pair.full, strict=True):
        difference = full.penalty_solution.state - 1e3 * linear.penalty_solution.state
        np.testing.assert_allclose(change.state, difference, atol=0.05 * np.abs(difference).max())
        assert change.depth == pytest.approx(0.0, abs=1e-9)


def test_friction_holds_the_top_and_stiffens_the_block(pressed):
    _, (rough,), _ = press(friction=np.inf, depths=DEPTHS[:1])
    assert rough.total_force > 1.01 * pressed[1][0].total_force
    assert rough.shear.shape == (len(rough.contact), 2)
    # The top is pulled inwards, and the shear is odd about both middle planes.
    inwards = (rough.shear * rough.contact[:, :2]).sum(axis=1)
    assert inwards.sum() < 0
    assert np.abs(rough.shear.sum(axis=0)).max() < 1e-9 * np.abs(rough.shear).sum()
    assert rough.energy == pytest.approx(rough.total_force * DEPTHS[0] / 2, rel=0.05)


@pytest.mark.parametrize("indenter", [Sphere(radius=4e-3), Box(size=(1.5e-3, 1e-3, 1e-3))])
def test_a_change_leaves_the_gaps_of_the_nodes_in_contact(indenter):
    path = LoadingPath(
        cover=Cover(layers=(Layer(thickness=H, material=SOFT),)), indenter=indenter, targets=(1e-4,), control="depth"
    )
    block = lay_out_block(path, elements_per_thickness=1, contact_half=(1e-3, 1e-3), fillet=0.2e-3, reach=1e-3)
    elements = mesh_block(block, Units.of(path.cover).scale_cover(path.cover), 1)
    surface = IndenterSurface(indenter=indenter, fillet=0.1, unit=H)
    rng, size = np.random.default_rng(3), elements.displacements + elements.pressures
    rest, change = 1e-4 * rng.standard_normal(size), 1e-2 * rng.standard_normal(size)
    top = np.flatnonzero(elements.nodes[:, 2] > 1 - 1e-6)
    x, y = elements.nodes[top, :2].T
    # Nodes near the axis touch, the others are well below the indenter.
    height, depth = surface.height(x, y), 0.05
    near = height < 1.2 * depth
    rest[3 * top[near] + 2] = height[near] - depth
    found = add_change(Guess(state=rest, depth=depth), Guess(state=change, depth=0.02), elements, surface)
    assert found.depth == pytest.approx(0.07)
    expected = rest + change
    moved = elements.nodes[top] + expected[: elements.displacements].reshape(-1, 3)[top]
    expected[3 * top[near] + 2] = surface.height(moved[near, 0], moved[near, 1]) - 0.07
    np.testing.assert_allclose(found.state, expected, atol=1e-12)
    assert 0 < near.sum() < len(top)


@pytest.mark.parametrize(("fillet", "size"), [(0.1e-3, 0.13), (0.02e-3, 1 / 12), (2e-3, 0.5)])
def test_elements_under_a_round_face_are_equal_and_not_too_many(fillet, size):
    """1.3 radii of the rounded edge, at least the twelfth part of the radius, at most the regular size."""
    punch = Cylinder(radius=2e-3)
    path = LoadingPath(
        cover=Cover(layers=(Layer(thickness=H, material=SOFT),)), indenter=punch, targets=(1e-4,), control="depth"
    )
    block = lay_out_block(path, elements_per_thickness=2, contact_half=punch.footprint, fillet=fillet, reach=4e-3)
    assert block.size == 0.5
    for side in block.sides:
        under = np.diff(side[side <= 1 + 1e-9])
        assert under.max() <= size * (1 + 1e-6)
        assert under.min() > 0.6 * size
        assert 3.0 <= side[-1] < 4.0


def test_materials_of_layers_are_kept_apart():
    """Two layers in series bear the same nominal stress, and their compressions add up."""
    soft = replace(SOFT, poisson_ratio=0.0)
    stiff = replace(soft, parameters={"shear_modulus": 1.2e6})
    cover = Cover(
        layers=(Layer(thickness=0.8e-3, material=stiff), Layer(thickness=1.2e-3, material=soft)),
        size=SIZE,
        base="sliding",
    )
    path = LoadingPath(cover=cover, indenter=PLATE, targets=(0.05e-3,), control="depth")
    block = lay_out_cover(path, Pose(), CORNERS, elements_per_thickness=1, fillet=0.6e-3)
    (small,), _, _ = press_paired(path, block, (0.05e-3,), elements_per_thickness=1)
    exact = 0.05e-3 * AREA / (0.8e-3 / 2.4e6 + 1.2e-3 / 0.8e6)
    assert small.total_force == pytest.approx(exact, rel=1e-3)
