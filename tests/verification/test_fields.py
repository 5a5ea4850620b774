"""Displacement and stress in the cover: Hertz below the surface, the indenter's shape, and balance with the texels."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator

from fem_reference import press
from meshes import Box, Cover, Cylinder, Pose, Sphere, TexelArray
from tests.exact.hertz import hertz as press_half_space
from tests.exact.point_response import point_response_spline
from tests.support.indentations import column_contact
from tests.support.rubber import make_cover

pytestmark = pytest.mark.slow

ARRAY = TexelArray.grid(3, 3, pitch=3.4e-3)
BALL = Sphere(radius=5e-3)


def read_axis(fields, cover):
    """Depths below the surface on the axis, ascending [m], and the stresses there."""
    on_axis = np.flatnonzero(fields.position[:, 0] < 1e-12)
    depth = cover.thickness - fields.position[on_axis, 2]
    order = np.argsort(depth)
    return depth[order], fields.stress[on_axis[order]]


@pytest.fixture(scope="module")
def hertz():
    cover = make_cover(0.3, "linear-elastic", thickness=30e-3)
    exact = press_half_space(cover.layers[0], 5e-3, 0.05)
    return cover, exact, press(cover, ARRAY, BALL, load=0.05, fields=True)


def test_stress_below_a_ball_on_a_thick_cover_is_that_of_hertz(hertz):
    """Johnson 1985, section 3.4: within 1 % of the largest pressure, the surface itself apart."""
    cover, exact, found = hertz
    radius, peak = exact.contact_radius, 1.5 * 0.05 / (np.pi * exact.contact_radius**2)
    depth, stress = read_axis(found.fields, cover)
    z = depth / radius
    near = (z > 0.02) & (z < 4)
    normal = -1 / (1 + z**2)
    radial = -1.3 * (1 - z * np.arctan(1 / np.maximum(z, 1e-9))) + 0.5 / (1 + z**2)
    assert stress[near, 2, 2] / peak == pytest.approx(normal[near], abs=0.01)
    for axis in (0, 1):
        assert stress[near, axis, axis] / peak == pytest.approx(radial[near], abs=0.01)
    shear = (stress[:, 0, 0] - stress[:, 2, 2]) / 2 / peak
    assert shear.max() == pytest.approx(0.310, abs=0.005)
    assert z[shear.argmax()] == pytest.approx(0.48, abs=0.08)


def test_the_surface_follows_the_ball_in_the_contact(hertz):
    cover, exact, found = hertz
    top = found.fields.position[:, 2] > cover.thickness - 1e-9
    r = found.fields.position[top, 0]
    inside = r < 0.95 * exact.contact_radius
    shape = found.depth - r**2 / 10e-3
    assert -found.fields.displacement[top, 2][inside] == pytest.approx(shape[inside], abs=1.5e-3 * found.depth)


@pytest.mark.parametrize("friction", [0.0, 0.4, np.inf])
@pytest.mark.parametrize("radius", [5e-3, pytest.param(20e-3)])
def test_fields_state_how_far_the_surface_is_off_the_indenter(friction, radius):
    cover, ball = make_cover(0.49, "linear-elastic"), Sphere(radius=radius)
    found = press(cover, ARRAY, ball, Pose.planar(at=(1e-3, 0.0)), depth=0.2e-3, friction=friction, fields=True)
    top = found.fields.position[:, 2] > cover.thickness - 1e-9
    r = found.fields.position[top, 0] - 1e-3
    inside = r < 0.98 * np.sqrt(found.contact_area / np.pi)
    miss = found.fields.displacement[top, 2] + found.depth - ball.gap(r, 0 * r)
    # The contact with friction has 64 cells across, that without friction has more.
    assert (
        np.abs(miss[inside]).max() / found.depth <= found.fields.error < (3e-3 if friction and radius > 5e-3 else 1e-3)
    )
    assert f"{found.fields.error:.2%} of the depth off the indenter" in found.assumptions["fields"]


def test_a_sharp_edge_is_the_worst_point_of_fields():
    cover = make_cover(0.3, "linear-elastic")
    found, stuck = (
        press(cover, ARRAY, Cylinder(radius=3e-3), depth=0.1e-3, friction=friction, fields=True)
        for friction in (0.0, np.inf)
    )
    top = found.fields.position[:, 2] > cover.thickness - 1e-9
    under = top & (found.fields.position[:, 0] < 3e-3 + 1e-9)
    assert found.fields.error == pytest.approx(np.abs(found.fields.displacement[under, 2] / 0.1e-3 + 1).max())
    assert found.fields.error > 0.01
    assert stuck.fields.error < 1e-9  # there the displacement is prescribed


@pytest.mark.parametrize("accuracy", [None, pytest.param(0.004)])
def test_the_deformed_surface_follows_a_ball_at_finite_strain(accuracy):
    """Also where more accurate grids are solved than usual."""
    cover = make_cover(0.45)
    found = press(cover, ARRAY, BALL, depth=0.6e-3, fields=True, accuracy=accuracy)
    top = found.fields.position[:, 2] > cover.thickness - 1e-9
    moved = (found.fields.position + found.fields.displacement)[top]
    inside = moved[:, 0] < 0.9 * np.sqrt(found.contact_area / np.pi)
    shape = cover.thickness - found.depth + BALL.gap(moved[:, 0], np.zeros(top.sum()))
    assert moved[inside, 2] == pytest.approx(shape[inside], abs=0.02 * found.depth)
    assert inside.sum() > 5


def integrate_base(fields, array, at=(0.0, 0.0)):
    """Texel forces from the normal stress at the base nodes, by linear interpolation on 31 x 31 points a texel."""
    base = fields.position[:, 2] < 1e-12
    offset = ((np.arange(31) + 0.5) / 31 - 0.5) * array.texel_size[0]
    points = array.centres[:, None, :2] + np.stack(np.meshgrid(offset, offset), axis=-1).reshape(1, -1, 2)
    pressure = -fields.stress[base, 2, 2]
    if fields.axisymmetric:
        order = np.argsort(fields.position[base, 0])
        r = fields.position[base, 0][order] - at[0]
        value = np.interp(np.hypot(*(points - at).transpose(2, 0, 1)), r, pressure[order])
    else:
        value = LinearNDInterpolator(fields.position[base, :2], pressure)(points)
    return value.mean(axis=1) * np.prod(array.texel_size)


@pytest.mark.parametrize(
    ("model", "shape", "options", "tolerance"),
    [
        ("linear-elastic", BALL, {"load": 0.3}, 0.01),
        ("linear-elastic", Cylinder(radius=2e-3), {"load": 0.3}, 0.01),
        pytest.param(
            "linear-elastic",
            Box(size=(4e-3, 3e-3, 4e-3)),
            {"load": 0.3, "pose": Pose.planar((0.5e-3, -1e-3), np.pi / 2)},
            0.03,
            marks=pytest.mark.slow,
        ),
        pytest.param("neo-hookean", BALL, {"depth": 0.4e-3}, 0.02),
        pytest.param("linear-elastic", BALL, {"load": 0.3, "friction": 0.4}, 0.02),
        pytest.param("linear-elastic", Box(size=(4e-3, 3e-3, 4e-3)), {"load": 0.3, "friction": 0.4}, 0.1),
    ],
)
def test_normal_stress_on_the_base_gives_the_texel_forces(model, shape, options, tolerance):
    at = (0.5e-3, -1e-3)
    given = {"pose": Pose.planar(at)} | options
    found = press(make_cover(0.45, model), ARRAY, shape, fields=True, **given)
    forces = integrate_base(found.fields, ARRAY, at)
    assert forces == pytest.approx(found.texel_forces, abs=tolerance * found.texel_forces.max())
    if friction := options.get("friction"):
        size, normal = np.hypot(*found.contact_forces[:, :2].T), column_contact(found)[:, 2]
        assert (size <= friction * normal * (1 + 1e-2) + 1e-9).all()


def test_fields_of_a_cover_of_limited_size_are_in_the_frame_of_the_array():
    cover = make_cover(0.45, "linear-elastic", size=(12e-3, 12e-3))
    found = press(cover, ARRAY, Box(size=(4e-3, 3e-3, 4e-3)), load=0.3, pose=Pose.planar(at=(1e-3, 0.0)), fields=True)
    assert np.abs(found.fields.position[:, :2]).max(axis=0) == pytest.approx((6e-3, 6e-3))
    assert integrate_base(found.fields, ARRAY) == pytest.approx(found.texel_forces, abs=0.03 * found.texel_forces.max())
    lowest = found.fields.displacement[:, 2].argmin()
    assert np.abs(found.fields.position[lowest, :2] - (1e-3, 0.0)) == pytest.approx((0, 0), abs=2.1e-3)


@pytest.fixture(scope="module")
def two_layers(bonded):
    """A cover of a soft and a stiff layer, and a ball on it."""
    soft, stiff = bonded(0.49, 1.5e-3).layers[0], bonded(0.3, 0.5e-3, 5e6).layers[0]
    cover = Cover(layers=(soft, stiff))
    return cover, press(cover, ARRAY, BALL, load=0.2, fields=True)


def test_two_layers_have_stresses_of_their_own_and_the_same_traction(two_layers):
    fields = two_layers[1].fields
    interface = np.flatnonzero(np.abs(fields.position[:, 2] - 1.5e-3) < 1e-12)
    order = interface[np.lexsort((fields.position[interface, 0],))].reshape(-1, 2)
    first, second = order.T
    normal = fields.stress[first, 2, 2], fields.stress[second, 2, 2]
    assert normal[0] == pytest.approx(normal[1], abs=0.03 * np.abs(normal[0]).max())
    assert np.abs(fields.stress[first, 0, 0] - fields.stress[second, 0, 0]).max() > 0.3 * np.abs(normal[0]).max()
    assert fields.displacement[first] == pytest.approx(fields.displacement[second])


def test_base_stress_under_two_layers_is_the_exact_superposition(two_layers):
    """The response to a point load in the wave-number domain, summed over the contact forces."""
    cover, found = two_layers
    base = found.fields.position[:, 2] < 1e-12
    near = np.flatnonzero(base)[found.fields.position[base, 0] < 6e-3]
    r = found.fields.position[near, 0]
    response = point_response_spline(cover, 10e-3)
    x, y, force = column_contact(found).T
    exact = [float(force @ response(np.hypot(x - each, y))) for each in r]
    assert -found.fields.stress[near, 2, 2] == pytest.approx(np.array(exact), abs=0.01 * max(exact))


@pytest.mark.parametrize("model", ["linear-elastic", pytest.param("neo-hookean")])
def test_every_horizontal_plane_carries_the_load(model):
    """At small depth, where planes of the undeformed cover are nearly planes of the deformed cover."""
    found = press(make_cover(0.3, model), ARRAY, BALL, depth=0.02e-3, fields=True)
    fields = found.fields
    for height in np.unique(np.round(fields.position[:, 2], 9))[:-1]:
        plane = np.flatnonzero(np.abs(fields.position[:, 2] - height) < 1e-9)
        plane = plane[np.argsort(fields.position[plane, 0])]
        r, stress = fields.position[plane, 0], -fields.stress[plane, 2, 2]
        total = np.trapezoid(2 * np.pi * r * stress, r)
        assert total == pytest.approx(found.total_force, rel=0.05)
