"""Quadrature of mixed elements."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import skfem

from fem_reference.elements.taylor_hood import prepare_elements

EDGES = np.array([0.0, 0.4, 1.0])
BOX = [EDGES, EDGES, EDGES]


@pytest.mark.parametrize(
    ("mesh", "points"),
    [
        (skfem.MeshTri1.init_tensor(EDGES, EDGES), 6),
        (skfem.MeshQuad1.init_tensor(EDGES, EDGES), 9),
        (skfem.MeshTet1.init_tensor(*BOX), 11),
        (skfem.MeshHex1.init_tensor(*BOX), 27),
        (skfem.MeshHex2.from_mesh(skfem.MeshHex1.init_tensor(*BOX)), 27),
    ],
    ids=["triangles", "quadrilaterals", "tetrahedra", "hexahedra", "curved hexahedra"],
)
def test_polynomials_of_degree_four_are_integrated_exactly_by_few_points(mesh, points):
    """Over the unit cube, and over the cylinder of unit radius and height; memory grows with the number of points.

    A triangle has 6 points, a tetrahedron 11 (Keast 1986, https://doi.org/10.1016/0045-7825(86)90059-9), and other
    elements have 3 along each direction.
    """
    cylinder = mesh.dim() == 2
    elements = prepare_elements(mesh, axisymmetric=cylinder)
    assert elements.weight.shape == (mesh.nelements, points)
    place = np.asarray(elements.basis.global_coordinates())
    for powers in product(range(5), repeat=mesh.dim()):
        if sum(powers) + cylinder <= 4:
            value = np.prod([x**power for x, power in zip(place, powers, strict=True)], axis=0)
            exact = 2 * np.pi / (powers[0] + 2) / (powers[1] + 1) if cylinder else 1 / np.prod(np.add(powers, 1))
            assert (value * elements.weight).sum() == pytest.approx(exact, rel=1e-12)
