import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastmodel.signal.point_spread import Gaussian, Tabulated, build_operator, find_smallest_kernel, find_tangents
from meshes import TexelArray
from meshes.catalogue import ARRAYS

WTS = ARRAYS["wts-0614-34"]


def test_kernel_is_the_sample_gaussian_of_unit_sum():
    kernel = Gaussian(sigma_x=0.8, sigma_y=1.2, ksize_x=5, ksize_y=7).kernel()
    assert kernel.shape == (7, 5)
    assert kernel.sum() == pytest.approx(1, abs=1e-15)
    assert kernel[3, 2] / kernel[3, 3] == pytest.approx(np.exp(0.5 / 0.8**2))
    assert kernel[3, 2] / kernel[5, 2] == pytest.approx(np.exp(0.5 * 4 / 1.2**2))


@given(st.floats(0.1, 20))
def test_ksize_is_the_smallest_odd_width_that_contains_the_mass(sigma):
    ksize = find_smallest_kernel(sigma)
    i = np.arange(-400, 401)
    weights = np.exp(-0.5 * (i / sigma) ** 2)
    held = weights[np.abs(i) <= ksize // 2].sum() / weights.sum()
    narrower = weights[np.abs(i) <= ksize // 2 - 1].sum() / weights.sum()
    assert ksize % 2 == 1
    assert held >= 0.999 - 1e-12
    assert ksize == 1 or narrower < 0.999 + 1e-12


def test_force_that_leaves_the_array_is_counted_once_at_edges_and_corners():
    gaussian = Gaussian.from_sigma(0.7)
    lost = WTS.image(1 - gaussian.operator(WTS).sum(axis=0))
    axis = gaussian.kernel().sum(axis=0)
    beyond = axis[: len(axis) // 2].sum()
    assert lost[7, 2:4] == pytest.approx(0, abs=1e-15)
    assert lost[7, 0] == pytest.approx(beyond, rel=1e-12)
    assert lost[0, 0] == pytest.approx(1 - (1 - beyond) ** 2, rel=1e-12)


def test_masked_texels_measure_nothing_but_pass_force_on():
    array = ARRAYS["sdh2-distal"]
    operator = Gaussian.from_sigma(0.8).operator(array)
    dead = ~array.active
    assert np.all(operator[dead] == 0)
    assert operator[:, dead].sum() > 0
    assert np.all(1 - operator[:, dead].sum(axis=0) > 0.3)


def test_rotating_the_array_leaves_the_operator_unchanged():
    gaussian = Gaussian.from_sigma(0.9, 0.6)
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # x -> -z, z -> x
    tilt = np.array([[np.cos(0.3), 0, np.sin(0.3)], [0, 1, 0], [-np.sin(0.3), 0, np.cos(0.3)]])
    for rotation in (tilt, tilt @ tilt, turn @ tilt):
        turned = dataclasses.replace(WTS, centres=WTS.centres @ rotation.T, normals=WTS.normals @ rotation.T)
        assert np.allclose(gaussian.operator(turned), gaussian.operator(WTS), atol=1e-12)


GAUSSIAN = {"sigma_x": 1.0, "sigma_y": 1.0, "ksize_x": 5, "ksize_y": 5}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Tabulated(matrix=np.eye(83)).operator(WTS), r"84 texels.*\(84, 84\)"),
        (lambda: Tabulated(matrix=np.ones((84, 83))), r"\(n, n\)"),
        (lambda: Tabulated(matrix=np.full((2, 2), np.nan)), "finite"),
        (lambda: Gaussian(**GAUSSIAN | {"sigma_x": 0.0}), "sigma"),
        (lambda: Gaussian(**GAUSSIAN | {"sigma_y": np.nan}), "sigma"),
        (lambda: Gaussian(**GAUSSIAN | {"ksize_x": 4}), "ksize"),
        (lambda: Gaussian(**GAUSSIAN | {"ksize_y": 0}), "ksize"),
    ],
)
def test_impossible_tables_and_kernels_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_the_sparse_operator_of_large_arrays_equals_the_dense_one():
    mask = np.ones((30, 25), dtype=bool)
    mask[3:5, 7:20] = False
    array = TexelArray.grid(30, 25, (2e-3, 3e-3), active=mask)
    spread = Gaussian(sigma_x=0.7, sigma_y=1.1, ksize_x=5, ksize_y=7)
    sparse = build_operator(spread, array)
    assert sparse.nnz < 0.06 * array.count**2
    np.testing.assert_allclose(sparse.toarray(), spread.operator(array), atol=1e-15)
    table = Tabulated(matrix=np.random.default_rng(1).normal(size=(WTS.count, WTS.count)))
    np.testing.assert_array_equal(table.operator(WTS), table.matrix)
    table = Tabulated(matrix=spread.operator(array))
    np.testing.assert_allclose(build_operator(table, array).toarray(), table.operator(array))
    small = TexelArray.grid(3, 3, 2e-3)
    np.testing.assert_array_equal(build_operator(spread, small), spread.operator(small))


@given(st.floats(0.1, 3), st.floats(0.1, 3))
def test_no_force_is_outside_where_the_kernel_ends_within_the_array(sigma_x, sigma_y):
    gaussian = Gaussian.from_sigma(sigma_x, sigma_y)
    operator = gaussian.operator(WTS)
    outside = 1 - operator.sum(axis=0)
    assert operator.min() >= 0
    assert outside.min() > -1e-12
    row, column = np.divmod(np.arange(WTS.count), WTS.columns)
    inside_x = np.minimum(column, WTS.columns - 1 - column) >= gaussian.ksize_x // 2
    inside_y = np.minimum(row, WTS.rows - 1 - row) >= gaussian.ksize_y // 2
    np.testing.assert_allclose(outside[inside_x & inside_y], 0, atol=1e-12)


@pytest.mark.parametrize(("rows", "columns", "dense"), [(20, 25, True), (3, 167, False)])
def test_up_to_500_texels_have_a_dense_operator(rows, columns, dense):
    found = build_operator(Gaussian.from_sigma(0.5), TexelArray.grid(rows, columns, 2e-3))
    assert isinstance(found, np.ndarray) == dense


def test_a_large_bent_array_has_the_operator_of_its_tangent_planes():
    flat, spread = TexelArray.grid(3, 167, 2e-3), Gaussian(sigma_x=0.6, sigma_y=0.9, ksize_x=3, ksize_y=5)
    angle = np.tile(0.4 * (np.arange(167) - 83), 3)  # neighbours are turned by 23 degrees
    normals = np.column_stack([np.sin(angle), 0 * angle, np.cos(angle)])
    centres = 5e-3 * normals + flat.centres * [0, 1, 0]
    bent = dataclasses.replace(flat, centres=centres, normals=normals)
    found = build_operator(spread, bent).toarray()
    np.testing.assert_allclose(found, spread.operator(bent), atol=1e-15)
    assert np.abs(found - build_operator(spread, flat).toarray()).max() > 0.05


@pytest.mark.parametrize(("angle", "along_y"), [(0.9e-6, True), (1.1e-6, False), (0.0, True), (0.3, False)])
def test_a_texel_that_faces_along_x_to_a_millionth_has_the_y_axis_as_its_tangent(angle, along_y):
    grid = TexelArray.grid(1, 1, 2e-3)
    normal = np.array([np.cos(angle), 0.0, np.sin(angle)])
    (first,), (second,) = find_tangents(dataclasses.replace(grid, normals=normal[None]))
    expected = [0, 1, 0] if along_y else [np.sin(angle), 0, -np.cos(angle)]
    np.testing.assert_allclose(first, expected, atol=1e-9)
    np.testing.assert_allclose(second, np.cross(normal, expected), atol=1e-9)


@pytest.mark.parametrize(("mass", "ksize"), [(0.39, 1), (0.41, 3), (0.88, 3), (0.89, 5), (0.99, 5), (0.995, 7)])
def test_a_kernel_holds_the_share_that_is_asked_for(mass, ksize):
    """Of exp(-i^2 / 2) over all i, 0.399 are at 0, 0.883 within 1, 0.991 within 2, and 0.9997 within 3."""
    assert find_smallest_kernel(1.0, mass) == ksize


def test_one_width_is_that_of_both_axes_and_a_table_names_its_origin():
    one, two = Gaussian.from_sigma(0.7), Gaussian.from_sigma(0.7, 1.4)
    assert (one.sigma_x, one.sigma_y, one.ksize_x) == (0.7, 0.7, one.ksize_y)
    assert (two.sigma_x, two.sigma_y, two.ksize_x) == (0.7, 1.4, one.ksize_x)
    assert two.ksize_y == find_smallest_kernel(1.4) > two.ksize_x
    assert Tabulated(matrix=np.eye(2)).source == "given by the user"
    for sigma in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match=f"sigma must be positive, not {sigma} pitches"):
            Gaussian.from_sigma(0.5, sigma)


def test_a_kernel_wider_than_a_large_array_is_cut_off_at_its_edges():
    array, spread = TexelArray.grid(3, 170, 2e-3), Gaussian(sigma_x=0.8, sigma_y=2.5, ksize_x=5, ksize_y=11)
    np.testing.assert_allclose(build_operator(spread, array).toarray(), spread.operator(array), atol=1e-15)
