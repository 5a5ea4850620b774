"""Pieces of soft surfaces against sums over all of them, one by one."""

import mujoco
import numpy as np
import pytest

from fastmodel.pressure.flexes import FlexSurfaces, _divide, spread_depths

BOUNDS = np.array([[-4e-3, -3e-3, -1.5e-3], [5e-3, 3.5e-3, 0.0]])


@pytest.mark.parametrize(
    ("corners", "divisions", "pieces"),
    [(2, 0.0, 1), (2, 3.0, 3), (2, 3.1, 4), (2, 50.0, 12), (3, 0.4, 1), (3, 2.0, 4), (3, 4.2, 25), (3, 99.0, 144)],
)
def test_an_element_is_divided_into_equal_pieces(corners, divisions, pieces):
    """The weights of the corners are barycentric; the mean of a function is that of its pieces."""
    shares = _divide(corners, divisions)
    assert shares.shape == (pieces, corners)
    assert len(np.unique(shares.round(9), axis=0)) == pieces
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    np.testing.assert_allclose(shares.mean(axis=0), 1 / corners)
    assert shares.min() > 0
    n = round(pieces ** (1 / (corners - 1)))
    # mean square of a weight: 1/3 along a segment and 1/6 in a triangle, less what pieces of 1/n of the size hold
    whole = {2: 1 / 3, 3: 1 / 6}[corners]
    inner = {2: 1 / 12, 3: 1 / 18}[corners] / n**2
    np.testing.assert_allclose((shares**2).mean(axis=0), whole - inner)


@pytest.mark.parametrize("corners", [2, 3])
def test_depths_are_summed_over_the_squares_of_a_grid(corners):
    """Pieces that lie beside or behind the array, or above the margin, do not count."""
    random = np.random.default_rng(corners)
    radius, margin, edge = 0.2e-3, 0.3e-3, 1.5e-3
    elements = random.uniform([-6e-3, -5e-3, -2.6e-3], [7e-3, 5e-3, 1.2e-3], (40, corners, 3))
    shares = _divide(corners, 3.0)
    columns = int((BOUNDS[1, 0] - BOUNDS[0, 0]) / edge) + 1
    sums, left = {}, set()
    for element in elements:
        one, other = element[1, :2] - element[0, :2], element[-1, :2] - element[0, :2]
        size = np.linalg.norm(one) if corners == 2 else abs(np.linalg.det([one, other])) / 2
        for piece in shares @ element - [0, 0, radius]:
            inside = (piece[:2] >= BOUNDS[0, :2]).all() and (piece[:2] <= BOUNDS[1, :2]).all()
            known = (
                ("beside", not inside),
                ("behind", piece[2] < BOUNDS[0, 2] - 2 * margin),
                ("above", piece[2] >= margin),
            )
            left |= {name for name, holds in known if holds}
            if not any(holds for _, holds in known):
                column, row = np.floor((piece[:2] - BOUNDS[0, :2]) / edge).astype(int)
                weight = size / len(shares) * (margin - piece[2])
                sums[row * columns + column] = sums.get(row * columns + column, 0) + weight * np.array([1, *piece[:2]])
    assert left == {"beside", "behind", "above"}
    found = spread_depths(elements, shares, BOUNDS, (radius, margin, edge))
    np.testing.assert_allclose(found, [sums[square] for square in sorted(sums)], rtol=1e-12)


SHAPES = {
    1: 'dim="1" count="5 1 1" spacing="2e-3 2e-3 2e-3"',
    2: 'dim="2" count="4 3 1" spacing="2e-3 2e-3 2e-3"',
    3: 'dim="3" count="3 3 3" spacing="2e-3 2e-3 2e-3"',
}


def test_the_surface_of_every_kind_of_flex_bears_its_force():
    """A cable of 8 mm, a cloth of 6 mm x 4 mm, and the lower face of a cube of 4 mm, in one model."""
    parts = "".join(
        f'<flexcomp name="flex{dim}" type="grid" {shape} pos="{0.02 * dim} 0 0" mass="0.1" radius="1e-4">'
        f'<contact selfcollide="none"/><edge equality="true"/></flexcomp>'
        for dim, shape in SHAPES.items()
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{parts}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    surfaces, wide = FlexSurfaces(model, 0.5e-3), {1: (8e-3, 0), 2: (6e-3, 4e-3), 3: (4e-3, 4e-3)}
    vertices = data.flexvert_xpos.copy()
    for flex, dim in enumerate(SHAPES):
        own = vertices[model.flex_vertadr[flex] :][: model.flex_vertnum[flex]]
        low, high = own.min(axis=0), own.max(axis=0)
        bounds = np.array([[*(low[:2] - 1e-3), low[2] - 1e-3], [*(high[:2] + 1e-3), 0.0]])
        lowered = vertices - [0, 0, low[2] - 0.05e-3]  # its surface is 0.05 mm deep
        points = surfaces.spread(flex, 0.7, lowered, 0.02e-3, bounds)
        assert points[:, 2].sum() == pytest.approx(0.7)
        share = points[:, 2] / 0.7
        centre = share @ points[:, :2]
        np.testing.assert_allclose(centre, (low + high)[:2] / 2, atol=2e-5)
        spread = np.sqrt(share @ (points[:, :2] - centre) ** 2)
        np.testing.assert_allclose(spread, np.array(wide[dim]) / np.sqrt(12), atol=4e-5)
        assert surfaces.spread(flex, 0.7, np.add(lowered, [0, 0, 1e-3]), 0.02e-3, bounds) is None
