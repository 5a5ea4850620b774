"""A path and its baseline on a block: their difference, and the starts that it gives on finer grids."""

from __future__ import annotations

import pytest

from fem_reference.finite_strain.block_path import (
    lay_out_block,
    press_paired,
)
from fem_reference.finite_strain.loading_path import LoadingPath
from meshes import Box, Cover, Layer, Material

FACE = Box(size=(3e-3, 2e-3, 5e-3))
RUBBER = Material(name="rubber", model="neo-hookean", parameters={"shear_modulus": 0.4e6}, poisson_ratio=0.45)
COVER = Cover(layers=(Layer(thickness=2e-3, material=RUBBER),))


def path(*depths):
    return LoadingPath(cover=COVER, indenter=FACE, targets=depths, control="depth")


def block(n):
    return lay_out_block(
        path(0.1e-3), elements_per_thickness=n, contact_half=FACE.footprint, fillet=0.8e-3 / n, reach=1e-3
    )


@pytest.fixture(scope="module")
def pressed():
    """A path of two depths on a coarse grid."""
    depths = (0.1e-3, 0.3e-3)
    return press_paired(path(*depths), block(2), depths, elements_per_thickness=2)


@pytest.mark.slow
def test_both_paths_reach_their_targets_and_differ_more_at_larger_depth(pressed):
    rest, deep, pair = pressed
    for small, large, depth in zip(rest, deep, (0.1e-3, 0.3e-3), strict=True):
        assert (small.depth, large.depth) == pytest.approx((depth, depth), rel=1e-9)
    added = [large.total_force / small.total_force - 1 for small, large in zip(rest, deep, strict=True)]
    assert abs(added[0]) < abs(added[1]) / 2
    assert pair.ratio == pytest.approx(1e3)


@pytest.mark.slow
def test_a_target_has_the_same_solution_alone_as_after_others(pressed):
    alone = press_paired(path(0.3e-3), block(2), [0.3e-3], elements_per_thickness=2)
    for together, single in zip(pressed[:2], alone[:2], strict=True):
        assert together[1].total_force == pytest.approx(single[0].total_force, rel=3e-4)
        pressure = single[0].base.pressure
        assert together[1].base.pressure == pytest.approx(pressure, abs=2e-3 * pressure.max())


@pytest.mark.slow
def test_a_start_from_a_coarser_grid_changes_no_result(pressed):
    depths = [0.1e-3, 0.3e-3]
    alone, after = (
        press_paired(path(*depths), block(3), depths, elements_per_thickness=3, coarser=b) for b in (None, pressed[2])
    )
    for one, other in zip(alone[1], after[1], strict=True):
        assert other.total_force == pytest.approx(one.total_force, rel=5e-4)
