"""Base forces under a pressure that is known in closed form: texels, outline, shear, widths and error estimates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.interpolate import CubicSpline
from scipy.special import erf

from fem_reference.grid_convergence import grid_convergence
from fem_reference.linear_response.point_spread import GRIDS, PointSpread, superpose
from fem_reference.linear_response.surface_compliance import SurfaceCompliance
from meshes import TexelArray
from meshes.pose import Pose

THICKNESS, WIDTH = 2e-3, 1.7e-3
OBLONG = TexelArray.grid(2, 3, (2.6e-3, 1.9e-3), texel_size=(2.1e-3, 1.2e-3))
MASKED = replace(OBLONG, active=np.arange(6) != 2)


def spread_bell(width=WIDTH, amount=1.0, **options):
    """The pressure exp(-(r / width)^2) / (pi width^2), whose integral over a rectangle is a product."""
    radius = np.linspace(0, 9 * width, 500)
    pressure = amount * np.exp(-((radius / width) ** 2)) / (np.pi * width**2)
    return PointSpread(radius=radius, pressure_per_force=pressure, reaction=amount, thickness=THICKNESS, **options)


def ends(array, axis, at, width=WIDTH):
    """Low and high edge of each texel, seen from a load, over the width."""
    half = array.texel_size[axis] / 2
    middle = array.centres[:, axis] - at
    return (middle - half) / width, (middle + half) / width


def share(array, at, width=WIDTH):
    """Part of a unit load that each texel gets."""
    out = np.ones(array.count)
    for axis in range(2):
        low, high = ends(array, axis, at[axis], width)
        out *= (erf(high) - erf(low)) / 2
    return np.where(array.active, out, 0.0)


def sheared_share(array, at, direction):
    """Derivative of the share with the position of the texel: the base pressure is the slope of the potential."""
    low, high = ends(array, direction, at[direction])
    slope = (np.exp(-(high**2)) - np.exp(-(low**2))) / (np.sqrt(np.pi) * WIDTH)
    low, high = ends(array, 1 - direction, at[1 - direction])
    return np.where(array.active, slope * (erf(high) - erf(low)) / 2, 0.0)


@pytest.fixture(scope="module")
def bell():
    return spread_bell(shear=spread_bell(amount=0.8e-3))


@pytest.mark.parametrize("array", [OBLONG, MASKED], ids=["whole", "masked"])
def test_texels_and_outline_bear_products_of_error_functions(bell, array):
    places = np.array([[0.0, 0.0], [1.4e-3, -2.2e-3], [-7e-3, 3e-3], [0.3, 0.2]])
    exact = np.array([share(array, place) for place in places])
    np.testing.assert_allclose(bell.texel_influence(array, places), exact, atol=2e-6)
    np.testing.assert_allclose(bell.outside(array, places), 1 - exact.sum(axis=1), atol=2e-5)


@pytest.mark.parametrize("array", [OBLONG, MASKED], ids=["whole", "masked"])
def test_loads_and_shear_on_a_grid_superpose(bell, array):
    x, y = np.array([-1e-3, 0.4e-3, 1.1e-3]), np.array([-0.5e-3, 0.9e-3])
    loads = np.random.default_rng(2).uniform(-1, 1, (3, 3, 2))
    exact = np.zeros(array.count)
    for i, j in np.ndindex(3, 2):
        at = (x[i], y[j])
        exact += loads[0, i, j] * share(array, at)
    pressed = bell.base_forces(array, x, y, loads[0])
    np.testing.assert_allclose(pressed, [*exact, loads[0].sum() - exact.sum()], atol=2e-5)
    for i, j in np.ndindex(3, 2):
        for direction in range(2):
            exact += 0.8e-3 * loads[1 + direction, i, j] * sheared_share(array, (x[i], y[j]), direction)
    rubbed = bell.base_forces(array, x, y, loads)
    np.testing.assert_allclose(rubbed[:-1], exact, atol=5e-5)
    assert rubbed.sum() == pytest.approx(loads[0].sum(), abs=5e-5)
    without = replace(bell, shear=None).base_forces(array, x, y, loads)
    np.testing.assert_allclose(without, pressed)


def test_contact_forces_in_a_turned_frame_superpose_with_their_shear(bell):
    pose, rng = Pose.planar(at=(0.7e-3, -0.4e-3), yaw=0.6), np.random.default_rng(4)
    contact = np.column_stack([rng.uniform(-0.6e-3, 0.6e-3, (9, 2)), rng.uniform(0, 1, 9), rng.uniform(-1, 1, (9, 2))])
    c, s = np.cos(0.6), np.sin(0.6)
    turn = np.array([[c, -s], [s, c]])
    exact = np.zeros(OBLONG.count)
    for row in contact:
        at, shear = turn @ row[:2] + pose.at, turn @ row[3:]
        exact += row[2] * share(OBLONG, at)
        exact += 0.8e-3 * sum(shear[k] * sheared_share(OBLONG, at, k) for k in range(2))
    found = superpose(contact, bell, OBLONG, pose)
    np.testing.assert_allclose(found[:-1], exact, atol=1e-4)
    normal = superpose(contact[:, :3], bell, OBLONG, pose)
    assert normal.sum() == pytest.approx(contact[:, 2].sum(), abs=1e-6)
    assert normal[:-1] == pytest.approx(
        sum(row[2] * share(OBLONG, turn @ row[:2] + pose.at) for row in contact), abs=1e-5
    )


@pytest.mark.parametrize(("load", "texel"), [("point", None), ("point", 1), ("uniform", 4), ("uniform", None)])
def test_the_response_to_a_load_above_a_texel_is_known(bell, load, texel):
    """An even load on a texel is the mean of points, by the integral of the error function."""
    centre = OBLONG.centres[OBLONG.middle if texel is None else texel, :2]
    exact = share(OBLONG, centre)
    if load == "uniform":
        exact = np.ones(OBLONG.count)
        for axis in range(2):
            half = OBLONG.texel_size[axis] / 2
            offset, weight = np.polynomial.legendre.leggauss(40)
            parts = [
                (erf(high) - erf(low)) / 2
                for low, high in (ends(OBLONG, axis, centre[axis] + half * t) for t in offset)
            ]
            exact *= weight @ np.array(parts) / 2
    np.testing.assert_allclose(bell.texel_response(OBLONG, load, texel), exact, atol=1e-5)


def test_the_width_is_where_the_pressure_falls_to_half_and_the_reach_where_it_does_not(bell):
    assert bell.half_width == pytest.approx(WIDTH * np.sqrt(np.log(2)), rel=1e-6)
    flat = replace(bell, pressure_per_force=np.full(500, 2.0))
    assert flat.half_width == flat.reach == 9 * WIDTH
    assert bell.pressure([0.0, 9 * WIDTH, 1.0]) == pytest.approx([1 / (np.pi * WIDTH**2), 0.0, 0.0])


def test_errors_follow_from_three_grids_of_which_the_last_one_counts():
    widths = [WIDTH * (1 + 0.3 / n**2) for n in GRIDS]
    coarse, middle, fine = (spread_bell(width) for width in widths)
    found = replace(fine, coarse=(coarse, middle))
    assert found.on_grids[:2] == (coarse, middle)
    assert found.on_grids[2] is found
    assert found.sizes == pytest.approx([1 / 8, 1 / 12, 1 / 18])
    patch = TexelArray.grid(1, 1, THICKNESS)
    peaks = [share(patch, (0, 0), width)[0] for width in widths]
    errors = found.error_estimate
    assert errors["peak_texel"] == pytest.approx(grid_convergence(peaks, found.sizes) / peaks[-1], rel=0.02)
    assert errors["sigma"] == pytest.approx(grid_convergence(widths, found.sizes) / widths[-1], rel=0.02)
    assert errors["total_force"] == pytest.approx(0.0, abs=1e-5)
    heavy = replace(found, pressure_per_force=1.02 * fine.pressure_per_force)
    assert heavy.error_estimate["total_force"] == pytest.approx(0.02, rel=1e-3)


def test_the_displacement_beside_a_loaded_rectangle_is_its_integral():
    """The half space over the distance, and a regular part that varies within the rectangle."""
    radius = np.linspace(0, 20e-3, 400)
    regular = CubicSpline(radius, 3e-5 * np.exp(-((radius / 3e-3) ** 2)))
    surface = SurfaceCompliance(
        half_space=2e-7, regular=regular, reach=20e-3, decayed=False, scale=1e-3, thickness=2e-3, bending=1e-3
    )
    width, height = 2.4e-3, 0.9e-3
    for x, y in ((3e-3, 0.2e-3), (-1.9e-3, 1.4e-3), (0.4e-3, -2e-3)):
        exact = dblquad(
            lambda v, u, x=x, y=y: 2e-7 / np.hypot(x - u, y - v) + 3e-5 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / 9e-6),
            -width / 2, width / 2, -height / 2, height / 2, epsabs=1e-14,
        )[0]  # fmt: skip
        assert surface.of_rectangle(np.array(x), np.array(y), width, height) == pytest.approx(exact, rel=1e-4)
    # Love 1929: the middle of a square of half side a is displaced by 8 a log(1 + sqrt 2) times the pressure.
    bare = replace(surface, regular=CubicSpline(radius, 0 * radius))
    for at, corner in (((0.0, 0.0), 8.0), ((1e-3, 1e-3), 4.0), ((-1e-3, 1e-3), 4.0)):
        found = bare.of_rectangle(np.array(at[0]), np.array(at[1]), 2e-3, 2e-3)
        assert found == pytest.approx(2e-7 * corner * 1e-3 * np.log(1 + np.sqrt(2)))
