"""Shape functions of facets and their division into parts."""

import numpy as np
import pytest

from meshes.solids.facets import facet_shape, facet_slope, node_places, split_facet


@pytest.mark.parametrize("nodes", [9, 6])
def test_shape_functions_are_one_at_their_node_and_their_slopes_are_their_derivatives(nodes):
    np.testing.assert_allclose(facet_shape(nodes, node_places(nodes)), np.eye(nodes), atol=1e-15)
    place, step = np.array([[0.21, 0.37]]), 1e-6
    slope = facet_slope(nodes, place)[0]
    for axis in (0, 1):
        move = step * np.eye(2)[axis]
        difference = (facet_shape(nodes, place + move) - facet_shape(nodes, place - move))[0] / (2 * step)
        np.testing.assert_allclose(slope[axis], difference, atol=1e-9)


@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize(("nodes", "square", "product"), [(9, 1 / 3, 0), (6, 1 / 18, -1 / 36)])
def test_points_of_a_part_have_the_mean_squares_and_products_of_the_part(nodes, square, product, parts):
    """The second moments about the middle are `square` and `product` over the whole facet, and grow with the area."""
    middle, points = split_facet(nodes, parts)
    assert middle.shape == (parts**2, 2)
    np.testing.assert_allclose(points.mean(axis=1), middle, atol=1e-15)
    moments = np.einsum("kqa,kqb->kab", points - middle[:, None], points - middle[:, None]) / points.shape[1]
    expected = np.array([[square, product], [product, square]])
    np.testing.assert_allclose(moments, np.tile(expected / parts**2, (parts**2, 1, 1)), atol=1e-15)
    whole = np.cov(points.reshape(-1, 2).T, bias=True)
    np.testing.assert_allclose(whole, expected, atol=1e-15)
