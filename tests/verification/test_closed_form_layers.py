"""Exact layers beyond one bonded layer: stacks, sliding bases, oblong texels, round loads, cones, and refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.special import erf, j0

from fem_reference import closed_form
from fem_reference.closed_form.contact import integrate_texels
from fem_reference.closed_form.layer import hankel_nodes, hertz_transform, place_gauss_points, tabulate_texel_response
from meshes import Box, Cone, Cylinder, RoundedTip, Sphere, TexelArray
from tests.support.rubber import stack_layers

TWO = stack_layers((1.4e-3, 4e5, 0.45), (0.6e-3, 2e6, 0.3))
SLIDING = stack_layers((0.8e-3, 1e6, 0.5), (0.7e-3, 3e6, 0.2), base="sliding")
THICK = stack_layers((30e-3, 1e6, 0.3))
STIFF = 1e6 / (1 - 0.3**2)


@pytest.mark.parametrize("cover", [TWO, SLIDING], ids=["bonded", "sliding"])
def test_long_waves_press_stacks_as_sheets_in_series(cover):
    """Confined compression on a bonded base; on a sliding one the resultant in the plane vanishes."""
    confined = stretch = stiffness = 0.0
    for layer in cover.layers:
        young, nu, h = layer.material.youngs_modulus, layer.material.poisson_ratio, layer.thickness
        confined += h * (1 + nu) * (1 - 2 * nu) / (young * (1 - nu))
        stretch += h * nu / (1 - nu)
        stiffness += h * young / (1 - nu**2)
    exact = confined + (stretch**2 / stiffness if cover.base == "sliding" else 0.0)
    k = np.array([0.0, 1e-3, 1.9e-3, 2.1e-3, 1e-2]) / cover.thickness
    found = closed_form.transfer(cover, k)
    assert found.compliance[0] == pytest.approx(exact, rel=1e-12)
    assert found.compliance == pytest.approx(exact, rel=2e-3)
    assert found.base == pytest.approx(1.0, abs=1e-4)
    # The response is even in the wave number: below and above the join it leaves the limit with the square.
    left = (found.compliance[1:] - exact) / k[1:] ** 2
    assert left == pytest.approx(left[-1], rel=0.02)


def test_negative_wave_numbers_are_refused():
    with pytest.raises(ValueError, match="must not be negative"):
        closed_form.transfer(TWO, [1.0, -1e-9])


def test_panels_of_gauss_points_integrate_polynomials_of_twice_their_number():
    edges = np.array([-1.0, 0.5, 0.7, 3.0])
    points, weights = place_gauss_points(edges, 3)
    assert points.shape == weights.shape == (9,)
    for power in range(6):
        assert weights @ points**power == pytest.approx((3.0 ** (power + 1) - (-1.0) ** (power + 1)) / (power + 1))


@pytest.mark.parametrize("reach", [1e-3, 40e-3])
def test_nodes_of_a_transform_resolve_the_farthest_distance(reach):
    """int_0^inf exp(-k h) J0(k r) k dk = h / (h^2 + r^2)^(3/2), here with sixty wave lengths per thickness."""
    h = TWO.thickness
    k, weight = hankel_nodes(TWO, reach)
    assert k.max() < 60 / h < 1.02 * k.max()
    for r in (0.0, 0.3 * reach, reach):
        assert weight @ (k * np.exp(-k * h) * j0(k * r)) == pytest.approx(h / (h**2 + r**2) ** 1.5, abs=1e-9 / h**2)


def share_by_quadrature(cover, size, x, y):
    """Integral of the point response over a texel, from its distances alone."""
    radius = np.linspace(0, 7e-3, 300)
    table = CubicSpline(radius, closed_form.point_response(cover, radius))
    across, weight = np.polynomial.legendre.leggauss(60)
    u, v = (at + across * edge / 2 for at, edge in zip((x, y), size, strict=True))
    return weight @ table(np.hypot(u[:, None], v)) @ weight * size[0] * size[1] / 4


def test_an_oblong_texel_gets_the_integral_of_the_pressure_under_a_point():
    size = (3e-3, 1.2e-3)
    response = tabulate_texel_response(TWO, size)
    at = np.array([[0.0, 0.0], [1.5e-3, 0.0], [0.0, 0.7e-3], [2.2e-3, -1.1e-3], [-4.1e-3, 3.3e-3]])
    exact = [share_by_quadrature(TWO, size, *each) for each in at]
    np.testing.assert_allclose(response(*at.T), exact, atol=2e-7)
    assert response.half[0] - response.half[1] == pytest.approx((size[0] - size[1]) / 2, rel=1e-9)
    edge = np.array(response.half)
    assert response(edge[:1], np.zeros(1)) == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_array_equal(response(np.array([1.001 * edge[0], 0.0]), np.array([0.0, -1.001 * edge[1]])), 0.0)


def test_a_round_load_is_the_mean_of_points_under_the_pressure_of_hertz():
    size, radius = (2e-3, 1.5e-3), 0.9e-3
    point, circle = (tabulate_texel_response(TWO, size, each) for each in (0.0, radius))
    s, weight = np.polynomial.legendre.leggauss(24)
    # (1 - (r / a)^2)^(1/2) r dr with r = a (1 - t^2)^(1/2) is a^2 t^2 dt.
    t, part = (s + 1) / 2, weight / 2 * 3 * ((s + 1) / 2) ** 2
    angle = 2 * np.pi * np.arange(32) / 32
    r = radius * np.sqrt(1 - t**2)
    for x, y in ((0.0, 0.0), (1.4e-3, -0.8e-3), (-3e-3, 2e-3)):
        each = point(x + np.outer(r, np.cos(angle)), y + np.outer(r, np.sin(angle)))
        assert circle(np.array(x), np.array(y)) == pytest.approx(part @ each.mean(axis=1), abs=1e-6)
    assert circle.half[0] - point.half[0] == pytest.approx(radius)


def test_the_transform_of_the_pressure_of_hertz_is_its_integral():
    for product in (0.0, 0.4, 3.0, 11.0):
        exact = quad(lambda r, p=product: 3 * np.sqrt(1 - r**2) * r * j0(p * r), 0, 1)[0]
        assert hertz_transform(np.array([product])) == pytest.approx([exact], abs=1e-9)


@pytest.mark.parametrize("points", [12, 3])
def test_shares_between_many_points_and_texels_are_those_of_each_pair(points):
    response, rng = tabulate_texel_response(TWO, (2e-3, 1.5e-3)), np.random.default_rng(points)
    centres = TexelArray.grid(3, 5, (2.5e-3, 2e-3)).centres[:, :2]
    grid = np.stack(np.meshgrid(np.linspace(-30e-3, 4e-3, points), [-1e-3, 0.5e-3]), axis=-1).reshape(-1, 2)
    for places in (grid, rng.uniform(-8e-3, 8e-3, (40, 2))):
        each = [response(*(place - centres).T) for place in places]
        np.testing.assert_allclose(response.between(places, centres), each, atol=1e-12)


@pytest.mark.parametrize("thickness", [0.8e-3, 5e-3])
def test_a_bell_of_pressure_gives_each_texel_its_product_of_error_functions(thickness):
    """The pressure exp(-(r / s)^2) is a product of functions of x and y."""
    array = TexelArray.grid(2, 3, (3e-3, 2e-3), texel_size=(2.6e-3, 1.1e-3))
    array = replace(array, active=np.arange(6) != 4)
    at, s, reaches = (0.7e-3, -0.4e-3), 2e-3, []

    def tabulate(reach):
        reaches.append(reach)
        r = np.linspace(0, reach, 400)
        return CubicSpline(r, np.exp(-((r / s) ** 2)))

    found = integrate_texels(array, at, tabulate, thickness)
    exact = np.ones(6)
    for axis, half in enumerate((1.3e-3, 0.55e-3)):
        x = array.centres[:, axis] - at[axis]
        exact *= np.sqrt(np.pi) / 2 * s * (erf((x + half) / s) - erf((x - half) / s))
    exact[4] = 0.0
    assert found == pytest.approx(exact, rel=1e-6)
    far = np.abs(array.centres[:, :2] - at).max(axis=0) + np.array([1.3e-3, 0.55e-3])
    assert reaches == pytest.approx([np.hypot(*far)])


def test_the_force_within_a_radius_of_a_half_space_is_known():
    punch, ball = closed_form.punch(THICK, 1e-3, 1e-5, nodes=48), closed_form.sphere(THICK, 1.0, 1e-3)
    share = np.array([[0.0, 0.3, 0.8], [0.999, 1.0, 1.7]])
    rest = np.maximum(0.0, 1 - share**2)
    for contact, power in ((punch, 0.5), (ball, 1.5)):
        assert contact.force_within(share * 1e-3) / contact.force == pytest.approx(1 - rest**power, abs=1e-4)


def test_the_pressure_on_the_base_is_that_of_the_rings_of_the_contact():
    """Superposition: the force between two radii, spread over a ring, presses as points on that ring."""
    cover = SLIDING
    found = closed_form.indent(cover, Sphere(radius=4e-3), load=0.6, nodes=32)
    radius = found.contact_radius * np.sin(np.linspace(0, np.pi / 2, 41))
    ring, middle = np.diff(found.force_within(radius)), np.sqrt((radius[1:] ** 2 + radius[:-1] ** 2) / 2)
    angle = 2 * np.pi * (np.arange(24) + 0.5) / 24
    spline = found.base_pressure(6e-3)
    for r in (0.0, 0.6e-3, 2e-3, 5.5e-3):
        apart = np.hypot(r - np.outer(middle, np.cos(angle)), np.outer(middle, np.sin(angle)))
        exact = ring @ closed_form.point_response(cover, apart).mean(axis=1)
        assert spline(r) == pytest.approx(exact, abs=2e-3 * float(spline(0.0)))
    assert spline.x[[0, -1]] == pytest.approx([0, 6e-3])
    k = np.array([0.0, 300.0, 1500.0])
    waves = [ring @ j0(each * middle) / (2 * np.pi) * closed_form.transfer(cover, each).base[0] for each in k]
    assert found.base_waves(k) == pytest.approx(waves, rel=2e-3)
    array = TexelArray.grid(19, 15, (1.5e-3, 1.2e-3))
    forces = found.texel_forces(array, at=(0.4e-3, -0.3e-3))
    assert forces.sum() == pytest.approx(found.force, rel=0.01)
    moment = forces @ array.centres[:, :2] / forces.sum()
    assert moment == pytest.approx([0.4e-3, -0.3e-3], abs=0.05e-3)


def move_of_thick_layer(cover):
    """Displacement of the top of a thick layer under a force, less that of a half space, per force [m/N].

    It is the same everywhere in a contact that is small beside the thickness.
    """
    k, weight = place_gauss_points(np.linspace(1e-9, 25 / cover.thickness, 100), 4)
    less = closed_form.transfer(cover, k).compliance - closed_form.half_space_compliance(cover.layers[0], k)
    return weight @ (less * k) / (2 * np.pi)


def test_a_cone_on_a_thick_layer_presses_as_sneddon_says():
    """Sneddon 1965: force = pi E* a^2 / (2 tan(angle / 2)), depth = pi a / (2 tan(angle / 2))."""
    angle, radius = 0.95 * np.pi, 1e-3
    slope = np.tan(angle / 2)
    depth, force = np.pi / 2 * radius / slope, np.pi / 2 * STIFF * radius**2 / slope
    found = closed_form.indent(THICK, Cone(angle=angle, radius=3e-3), load=force, nodes=24)
    assert found.contact_radius == pytest.approx(radius, rel=1e-3)
    assert found.depth == pytest.approx(depth + force * move_of_thick_layer(THICK), rel=1e-3)


def test_a_tip_presses_like_the_ball_that_it_is_part_of():
    shape = RoundedTip(radius=3e-3)
    found = closed_form.indent(TWO, shape, load=0.4, nodes=32)
    ball = closed_form.sphere(TWO, 3e-3, found.contact_radius)
    assert (found.force, found.depth) == (pytest.approx(0.4), pytest.approx(ball.depth))
    assert ball.force == pytest.approx(0.4, rel=1e-6)
    assert closed_form.indent(TWO, shape, depth=found.depth, nodes=32).force == pytest.approx(0.4, rel=1e-9)


@pytest.mark.parametrize("nodes", [None, 60])
def test_a_cylinder_presses_in_proportion_to_its_depth(nodes):
    punch = Cylinder(radius=1.5e-3)
    one = closed_form.indent(TWO, punch, depth=2e-5, nodes=nodes)
    two = closed_form.indent(TWO, punch, load=3 * one.force, nodes=nodes)
    assert (two.depth, two.force) == (pytest.approx(6e-5), pytest.approx(3 * one.force))
    assert one.phi.shape == (3, nodes or 96)
    assert one.force == pytest.approx(closed_form.punch(TWO, 1.5e-3, 2e-5).force, rel=1e-6)


def test_lengths_and_moduli_scale_a_contact():
    """Twice all lengths and three times all moduli: 12 times the force at twice the depth."""
    large = stack_layers(*((2 * h, 3 * young, nu) for h, young, nu in ((1.4e-3, 4e5, 0.45), (0.6e-3, 2e6, 0.3))))
    one = closed_form.sphere(TWO, 4e-3, 0.9e-3)
    other = closed_form.sphere(large, 8e-3, 1.8e-3)
    assert (other.force, other.depth) == (pytest.approx(12 * one.force), pytest.approx(2 * one.depth))


def test_a_thick_layer_is_less_compliant_than_a_half_space_by_its_missing_depth():
    found = closed_form.sphere(THICK, 10e-3, 0.8e-3)
    left = found.depth - 0.8e-3 * np.arctanh(0.08)
    assert left == pytest.approx(found.force * move_of_thick_layer(THICK), rel=0.01)


STIFF_FOIL = stack_layers((2e-3, 1e5, 0.45), (0.05e-3, 5e9, 0.35))


@pytest.mark.parametrize(
    ("shape", "options", "kind", "words"),
    [
        (Sphere(radius=3e-3), {}, ValueError, "either a load or a depth"),
        (Sphere(radius=3e-3), {"load": 1.0, "depth": 1e-4}, ValueError, "either a load or a depth"),
        (Box(size=(1e-3,) * 3), {"load": 1.0}, TypeError, "no exact contact for Box"),
        (Sphere(radius=1e-3), {"load": 30.0}, ValueError, "reaches the rim of the Sphere"),
        (Cone(angle=2.8, radius=0.5e-3), {"depth": 0.5e-3}, ValueError, "reaches the rim of the Cone"),
        (Cylinder(radius=241e-3), {"depth": 1e-6}, ValueError, "too wide: 240 mm radius"),
    ],
)
def test_contacts_that_the_equation_does_not_hold_for_are_refused(shape, options, kind, words):
    with pytest.raises(kind, match=words):
        closed_form.indent(TWO, shape, **options)


@pytest.mark.parametrize(
    ("count", "words"),
    [(4, "^4 nodes do not resolve a contact of 0.0201 m radius$"), (16, "^16 nodes .* radius: the error is 1.3$")],
)
def test_nodes_that_do_not_resolve_a_contact_are_named(count, words):
    with pytest.raises(ValueError, match=words):
        closed_form.indent(stack_layers((1e-3, 1e6, 0.5)), Sphere(radius=1.0), load=100.0, nodes=count)


def test_a_wide_punch_would_have_to_pull_on_a_stiff_foil():
    with pytest.raises(ValueError, match="would have to pull"):
        closed_form.indent(STIFF_FOIL, Cylinder(radius=4e-3), depth=1e-5, nodes=96)


@pytest.mark.parametrize("radius", [-1e-3, 0.0, 2e-3, 3e-3])
def test_a_contact_as_wide_as_its_ball_is_refused(radius):
    with pytest.raises(ValueError, match=r"must lie in 0\.\.0\.002 m"):
        closed_form.sphere(TWO, 2e-3, radius)
    assert closed_form.sphere(TWO, 2e-3, 1.9e-3).contact_radius == 1.9e-3
