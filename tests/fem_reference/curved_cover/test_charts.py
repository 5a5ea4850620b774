"""Charts of curved tops, contacts in them before they are solved, and the compliance that a layer does not have."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
import pytest

from fem_reference.curved_cover import local_contact as module
from fem_reference.curved_cover.local_contact import CellPress, Chart, ChartedContact, Remainder
from fem_reference.curved_cover.rays import find_touch
from fem_reference.curved_cover.responses import build_solid, find_top
from fem_reference.errors import ConvergenceError, PiercedError
from fem_reference.linear_response.surface_compliance import surface_compliance
from fem_reference.linear_response.vector_compliance import VectorCompliance
from fem_reference.small_strain_contact.constrained_solver import ComplianceOperator
from fem_reference.small_strain_contact.friction_cells import VectorOperator
from meshes import Box, Cover, Cylinder, Layer, Sphere
from meshes.pose import Pose
from meshes.solids import flat_pad, sweep
from meshes.solids.swept import join_grids
from tests.support.rubber import make_rubber

R = 8e-3
DOWN = np.array([0.0, 0.0, -1.0])


def make_cap():
    """A cover of 2 mm on a part of a sphere of 6 mm around z."""
    turn = np.linspace(-0.9, 0.9, 15)
    first, second = np.meshgrid(np.tan(turn), np.tan(turn))
    out = np.stack([first, second, np.ones_like(first)], axis=-1)
    out /= np.linalg.norm(out, axis=-1, keepdims=True)
    return sweep(join_grids([(6e-3 * out, out)], "cap"), 2e-3, layers=2)


CAP = find_top(make_cap())
#: x along y of the array, to tell the axes apart.
AXES = np.array([[0, 1.0, 0], [-1.0, 0, 0], [0, 0, 1.0]])
CHART = Chart(top=CAP, origin=np.array([0, 0, R]), axes=AXES, half=5e-3)
PAD = flat_pad(size=(6e-3, 5e-3), rows=1, pitch=4e-3)
FLAT = Chart(top=find_top(PAD.mesh(1e-3, layers=3)), origin=np.array([0, 0, 2e-3]), axes=np.eye(3), half=4e-3)


def polar(x, y):
    """Point of the sphere at the chart's (x, y): at the distance 2 R sin(angle / 2) from the pole (Lambert)."""
    along = np.hypot(x, y)
    angle = 2 * np.arcsin(along / (2 * R))
    out = np.stack([np.sin(angle) * x / along, np.sin(angle) * y / along, np.cos(angle)], axis=-1) @ AXES
    return R * out, out, angle


X, Y = np.array([0.1e-3, 2e-3, -1.5e-3, 3.1e-3]), np.array([0.4e-3, 1e-3, -2.5e-3, 0.0])


def test_a_chart_of_a_sphere_keeps_distances_from_its_origin():
    points, normals, _ = polar(X, Y)
    weights, beside = CHART.locate(X, Y)
    np.testing.assert_allclose(weights @ CAP.nodes, points, atol=6e-6)
    np.testing.assert_allclose(beside, 0, atol=1e-9)
    placed, outward, inside = CHART.place(X, Y)
    np.testing.assert_allclose(placed, points, atol=6e-6)
    np.testing.assert_allclose(outward, normals, atol=6e-3)
    assert inside.all()
    # the normal falls below a cosine of 0.4 at 2 R sin(33.2 degrees) = 9.1 mm, beyond the chart; its half is 5 mm
    assert CHART.place(np.array([4.9e-3, 5.1e-3]), np.zeros(2))[2].tolist() == [True, False]
    assert CHART.place(np.zeros(2), np.array([-4.9e-3, -5.1e-3]))[2].tolist() == [True, False]
    assert CHART.size == pytest.approx(np.sqrt(CAP.areas.sum() / len(CAP.facets)), rel=0.05)
    nodal = CHART.normals
    seen = np.linalg.norm(nodal, axis=1) > 0
    np.testing.assert_allclose(nodal[seen][:40], CAP.nodes[seen][:40] / R, atol=0.03)


def test_a_chart_of_a_flat_top_is_its_plane_and_ends_at_its_border():
    x, y = np.array([0.3e-3, -2.9e-3, 2e-3]), np.array([0.2e-3, 1e-3, -2.4e-3])
    points, normals, inside = FLAT.place(x, y)
    np.testing.assert_allclose(points, np.stack([x, y, np.full(3, 2e-3)], axis=-1), atol=2e-5)  # splines at the border
    np.testing.assert_allclose(normals, np.tile([0, 0, 1.0], (3, 1)), atol=1e-9)
    assert inside.all()
    # beyond the border by more than half a step of the samples, of 8 mm / 31
    assert FLAT.place(np.array([3.05e-3, 3.2e-3]), np.zeros(2))[2].tolist() == [True, False]
    assert FLAT.place(np.zeros(2), np.array([-2.55e-3, -2.7e-3]))[2].tolist() == [True, False]
    np.testing.assert_allclose(FLAT.locate(np.array([3.7e-3]), np.array([0.0]))[1], 0.7e-3, atol=1e-9)


def test_frames_are_turned_by_the_shortest_way():
    angle = np.radians([0, 20, 50])
    normals = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    frames = FLAT.frames(normals)
    expected = [[-n, [n[2], 0, -n[0]], [0, 1, 0]] for n in normals]
    np.testing.assert_allclose(frames, expected, atol=1e-12)
    oblique = CHART.frames(np.array([[2.0, 3.0, 6.0]]) / 7)[0]
    np.testing.assert_allclose(oblique @ oblique.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(oblique) == pytest.approx(-1)  # against the normal
    axis = np.cross(AXES[2], [2, 3, 6])  # stays
    for k in (0, 1):
        assert oblique[k + 1] @ axis == pytest.approx(AXES[k] @ axis)


def over(chart, indenter, touch, depth, *, at=(0.0, 0.0), height=20e-3, window=None, deepest=1e-3):
    return ChartedContact(
        chart=chart, indenter=indenter, pose=Pose.facing([*at, height], DOWN), touch=touch, deepest=deepest,
        travel=touch + depth, window=(np.zeros(2), np.full(2, chart.half)) if window is None else window,
    )  # fmt: skip


@pytest.mark.parametrize("depth", [-0.3e-3, 0.2e-3])
def test_gaps_of_a_ball_on_a_sphere_are_along_the_normals(depth):
    """The ball of radius r has its middle at D = R + r - depth: gap D cos a - sqrt(r^2 - D^2 sin^2 a) - R."""
    ball = Sphere(radius=4e-3)
    place = over(CHART, ball, 20e-3 - R, depth)
    _, _, angle = polar(X, Y)
    middle = R + 4e-3 - depth
    with np.errstate(invalid="ignore"):
        gap = middle * np.cos(angle) - np.sqrt(4e-3**2 - (middle * np.sin(angle)) ** 2) - R
    found = place.gap(X[:, None], Y[:, None])
    assert found.shape == (4, 1)
    np.testing.assert_allclose(found[:, 0], np.where(np.isfinite(gap), gap, np.inf), atol=8e-6)
    np.testing.assert_allclose(
        place.gap_after(X, Y, place.travel + 0.1e-3), over(CHART, ball, 12e-3, depth + 0.1e-3).gap(X, Y)
    )
    np.testing.assert_allclose(place.rate(X, Y), np.cos(angle), atol=5e-3)
    assert place.gap(np.array([5.2e-3]), np.array([0.0]))[0] == np.inf


def test_the_rectangle_of_a_ball_on_a_sphere_ends_where_their_surfaces_cross():
    ball, depth = Sphere(radius=4e-3), 0.3e-3
    middle = R + 4e-3 - depth
    angle = np.arccos((middle**2 + R**2 - 4e-3**2) / (2 * middle * R))
    place, half = over(CHART, ball, 20e-3 - R, depth).bound()
    np.testing.assert_allclose(place, 0, atol=20e-6)
    np.testing.assert_allclose(half, 2 * R * np.sin(angle / 2), atol=20e-6)


@pytest.mark.parametrize(
    ("at", "shape"), [((0.5e-3, -0.3e-3), Box(size=(3e-3, 2e-3, 4e-3))), ((2.2e-3, 1.9e-3), Cylinder(radius=1.5e-3))]
)
def test_the_rectangle_of_a_face_ends_at_its_edges_and_at_those_of_the_pad(at, shape):
    place, half = over(FLAT, shape, 18e-3, 0.4e-3, at=at).bound()
    reach = np.array(shape.footprint)
    low, high = np.maximum(at - reach, [-3e-3, -2.5e-3]), np.minimum(at + reach, [3e-3, 2.5e-3])
    # the chart ends half a step of its samples beyond the pad
    step = np.where(high - low < 2 * reach - 1e-6, 0.14e-3, 3e-6)
    assert (np.abs(place - half - low) < step).all()
    assert (np.abs(place + half - high) < step).all()
    with pytest.raises(ConvergenceError, match="too narrow for the contact to be found"):
        over(FLAT, shape, 18e-3, -0.1e-3, at=at).bound()


@pytest.mark.parametrize("x", [0.0, 1.1e-3])
def test_the_first_touch_of_a_ball_is_searched_in_the_chart(x):
    """The middles of ball and sphere are R + r apart."""
    travel = 24e-3 - np.sqrt(12e-3**2 - x**2)
    place = over(CHART, Sphere(radius=4e-3), travel, 0.05e-3, at=(x, 0.0))
    assert place.find_touch() == pytest.approx(travel, abs=2e-6)
    window = (np.array([2e-3, 0]), np.array([0.5e-3, 0.5e-3]))  # beside it: along y of the array
    beside = dataclasses.replace(place, window=window).find_touch()
    y = R * np.sin(2 * np.arcsin(1.5e-3 / (2 * R)))
    if x == 0:
        height = np.sqrt(R**2 - y**2) + np.sqrt(4e-3**2 - y**2)
        assert beside == pytest.approx(24e-3 - height, abs=4e-6)
    with pytest.raises(ConvergenceError, match="too narrow"):
        over(FLAT, Sphere(radius=1e-3), 18e-3, 0.0, at=(8e-3, 0)).find_touch()


@pytest.fixture
def few(monkeypatch):
    """A lattice without margin and few points per element."""
    changed = dataclasses.replace(module._SETTINGS, margin=0, parts=4)
    monkeypatch.setattr(module, "_SETTINGS", changed)


def solve_parts(count, shares, wide):
    """Displacements under a smooth pressure: by layer and remainder, and by the solid, shape (count, n, n) [m].

    The pressure is that of a square of some width beside the middle of a pad; `shares` are its shears.
    """
    mesh, material = WIDE.mesh(1e-3, layers=3), make_rubber(0.3, "linear-elastic")
    solid, top, layers = build_solid(mesh, material), find_top(mesh), (Layer(thickness=2e-3, material=material),)
    chart = Chart(top=top, origin=np.array([0, 0, 2e-3]), axes=np.eye(3), half=4e-3)
    middle = np.array([0.4e-3, 0.3e-3])
    if count == 1:
        layer = surface_compliance(Cover(layers=layers), 30e-3)
        make = partial(ComplianceOperator, layer)
    else:
        make = partial(VectorOperator, VectorCompliance.tabulate(Cover(layers=layers), 30e-3))
    remainder = Remainder.build(solid, chart, make, (middle, np.full(2, wide / 2)), count)
    np.testing.assert_array_equal(remainder.compliance, remainder.compliance.T)
    axis = (np.arange(24) + 0.5) / 24 * wide - wide / 2
    x, y = np.meshgrid(axis, axis, indexing="ij")
    pressure = 1e4 * (np.cos(np.pi * x / wide) * np.cos(np.pi * y / wide)) ** 2 * shares[:, None, None]
    x, y, forces = x.ravel() + middle[0], y.ravel() + middle[1], pressure.reshape(count, -1) * (wide / 24) ** 2
    near = make((24, 24), (wide / 24, wide / 24)).displace(pressure if count > 1 else pressure[0])
    added = remainder.on_points(x, y)(forces if count > 1 else forces[0])
    frames = np.array([DOWN, [1, 0, 0], [0, 1, 0]])[:count]
    nodal = np.zeros((1, len(solid.nodes), 3))
    weights = chart.locate(x, y)[0]
    nodal[0, top.index] = weights.T @ (forces.T @ frames)
    known = frames @ (weights @ solid.solve(top.index, forces=nodal)[0]).T
    return near.reshape(count, 24, 24) + added.reshape(count, 24, 24), known.reshape(count, 24, 24)


WIDE = flat_pad(size=(7e-3, 6e-3), rows=1, pitch=4e-3)


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize(
    ("shares", "limits"), [((1.0,), (0.03,)), ((1.0, 0.3, 0.2), (0.04, 0.06, 0.08))], ids=["pressure", "shear"]
)
def test_layer_and_remainder_sink_as_the_solid_does(shares, limits):
    found, known = solve_parts(len(shares), np.array(shares), 5e-3)
    assert (np.abs(found - known).max(axis=(1, 2)) < limits * np.abs(known).max(axis=(1, 2))).all()


def begin(target, control, *, deepest=1.2e-3, at=(0.4e-3, -0.3e-3)):
    """Press a ball of 5 mm into a small pad on few cells."""
    solid = build_solid(SMALL, make_rubber(0.3, "linear-elastic"))
    top, ball, pose = find_top(SMALL), Sphere(radius=5e-3), Pose.facing([*at, 9e-3], DOWN)
    few = dataclasses.replace(module._SETTINGS, first_cells=16, searched=41, sampled=21)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_SETTINGS", few)
        return CellPress.begin(
            solid, top, ball, pose, find_touch(top, ball, pose), target=target, control=control, cells=20,
            deepest=deepest,
        )  # fmt: skip


SMALL = PAD.mesh(1.5e-3, layers=3)


@pytest.fixture(scope="module")
def pressed():
    return begin(0.1e-3, "depth")


def test_a_contact_at_a_depth_has_the_load_that_gives_the_depth(pressed):
    deep = pressed.solve()
    assert (deep.depth, deep.touch) == pytest.approx((0.1e-3, 7e-3), abs=1e-8)
    np.testing.assert_allclose(deep.forces.sum(axis=0), [0, 0, -deep.load], atol=1e-9)
    np.testing.assert_allclose(deep.nodal.sum(axis=0), [0, 0, -deep.load], atol=1e-9)
    moments = (np.cross(find_top(SMALL).nodes, deep.nodal), np.cross(deep.points, deep.forces))
    np.testing.assert_allclose(*(each.sum(axis=0) for each in moments), atol=1e-9)
    np.testing.assert_allclose(deep.points[:, 2], 2e-3, atol=1e-9)
    np.testing.assert_allclose(deep.points.mean(axis=0)[:2], [0.4e-3, -0.3e-3], atol=20e-6)
    assert deep.area == pytest.approx(np.pi * (np.ptp(deep.points[:, 0]) / 2) ** 2, rel=0.15)
    assert np.pi * 5e-3 * 0.1e-3 < deep.area < 2 * np.pi * 5e-3 * 0.1e-3  # half space .. foundation
    assert (deep.is_cut, deep.at_border) == (False, 0)
    again = begin(deep.load, "load").solve()
    assert again.load == pytest.approx(deep.load, rel=1e-5)
    assert again.depth == pytest.approx(0.1e-3, rel=1e-4)


def test_too_deep_presses_and_loads_are_refused_with_what_is_possible(pressed):
    with pytest.raises(PiercedError, match=r"at a depth of 0.31 mm .* use at most 0.3 mm"):
        begin(0.31e-3, "depth", deepest=0.3e-3)
    with pytest.raises(PiercedError, match=r"^9 N would press .* use at most .* N, a wider") as caught:
        begin(9.0, "load", deepest=0.1e-3)
    assert float(str(caught.value).split("at most ")[1].split(" N")[0]) == pytest.approx(pressed.solve().load, rel=0.05)


def test_a_contact_at_the_border_of_the_top_says_so():
    """Its rectangle with a lattice spacing around reaches beyond the pad."""
    found = begin(0.05e-3, "depth", at=(2.3e-3, 0.0)).solve()
    assert found.at_border == pytest.approx(min(1.0, 1.5 * found.size / (np.ptp(found.points[:, 1]) / 2)), rel=0.1)


@pytest.mark.usefixtures("few")
def test_a_ball_that_rubs_bears_more_in_the_cone_of_friction_on_the_same_cells(pressed):
    plain = pressed.solve()
    (smooth, rough), (fewer, _) = pressed.rub(0.2, [(12, 3), (8, 1)])
    assert smooth.load == pytest.approx(plain.load, rel=0.03)
    assert fewer.load == pytest.approx(plain.load, rel=0.06)
    assert 1.001 < rough.load / smooth.load < 1.1
    assert smooth.depth == rough.depth == pytest.approx(0.1e-3)
    np.testing.assert_allclose(smooth.forces[:, :2], 0, atol=1e-9)
    out = rough.points[:, :2] - [0.4e-3, -0.3e-3]
    across, normal = rough.forces[:, :2], -rough.forces[:, 2]
    size = np.linalg.norm(across, axis=1)
    assert (size <= 0.2 * normal * (1 + 1e-6)).all()
    assert size.max() > 0.1 * normal.max()
    # pressure draws the surface of a compressible cover to the middle; the ball holds it
    assert (across * out).sum() > 0.95 * (size * np.linalg.norm(out, axis=1)).sum()
    np.testing.assert_allclose(across.sum(axis=0), 0, atol=0.02 * rough.load)
    np.testing.assert_allclose(rough.nodal.sum(axis=0), rough.forces.sum(axis=0), atol=1e-9)
    assert -rough.forces[:, 2].sum() == pytest.approx(rough.load)
    # twelve cells on 1.12 times the width of the cells in contact, and once more by 1.25 where they reach their edge
    steps = [np.diff(np.unique(plain.points[:, k].round(9))).min() for k in (0, 1)]
    cells = 1.12 * (np.ptp(plain.points[:, :2], axis=0) + steps) / 12
    for each in (smooth, rough):
        assert each.area == pytest.approx(plain.area, rel=0.12)
        found = [np.diff(np.unique(each.points[:, k].round(9))).min() for k in (0, 1)]
        assert (found > 0.999 * cells).all()
        assert (found < 1.251 * cells).all()


def test_a_first_contact_may_be_rough_and_the_search_for_its_extent_is_given_up(monkeypatch):
    """One solution does not find the depth under the load, which the first cells need not."""
    monkeypatch.setattr(module, "_SETTINGS", dataclasses.replace(module._SETTINGS, steps=1, windows=0))
    with pytest.raises(ConvergenceError, match="the extent of the contact was not found in 0 steps; use less load"):
        begin(0.03, "load")
