"""Free side edges: columns cut from a cover, whose compression and bending are known, and mirror images with shear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference.linear_response.surface_compliance import surface_compliance
from fem_reference.linear_response.vector_compliance import VectorCompliance
from fem_reference.small_strain_contact import free_edges
from fem_reference.small_strain_contact.free_edges import SideEdges, find_mirror_planes
from fem_reference.small_strain_contact.friction_cells import VectorOperator
from meshes import Box, Sphere
from meshes.pose import Pose
from tests.support.rubber import stack_layers

H, YOUNG = 2e-3, 1e6
#: A pose that is not at the middle of the cover, so that no symmetry is used, but displaces nothing.
BESIDE = (1e-9, -1e-9)


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Meshes that do not divide the elements of their pattern, exact for states that vary linearly."""
    monkeypatch.setattr(free_edges, "_SETTINGS", replace(free_edges.SideSettings(), parts=1))


def cut(cover, size, pose, cells, components=1):
    """Sides of a column under a face as wide as its top, and the cells of the top, in the frame of the face."""
    turned = np.array(size[::-1] if abs(pose.yaw) > 1 else size)
    sides = SideEdges(
        cover=replace(cover, size=size), indenter=Box(size=(*turned, 1e-3)), pose=pose, half=turned / 2,
        components=components,
    )  # fmt: skip
    axes = [(np.arange(n) + 0.5) / n * edge - edge / 2 for n, edge in zip(cells, turned, strict=True)]
    return sides, *np.meshgrid(*axes, indexing="ij"), tuple(turned / cells)


@pytest.mark.parametrize(
    ("pose", "base", "layers", "ratio"),
    [
        (Pose.planar(at=BESIDE), "sliding", ((H, 1e6, 0.3),), 0.6),
        (Pose.planar(at=BESIDE, yaw=np.pi / 2), "bonded", ((0.7 * H, 1e6, 0.0), (0.3 * H, 2e6, 0.0)), 0.6),
    ],
)
def test_a_column_under_linear_pressure_is_shortened_and_bent_as_a_bar(pose, base, layers, ratio):
    """Without transverse strain at the base each point of the top sinks by the pressure times sum of thickness / E."""
    cover = stack_layers(*layers, base=base)
    sides, x, y, cell = cut(cover, (ratio * H, 1.3 * ratio * H), pose, (10, 12))
    operator = sides.compliance(surface_compliance(cover, 8 * H), x, y, cell)
    exact = sum(thickness / young for thickness, young, _ in layers)
    assert operator.displace(np.ones_like(x)) == pytest.approx(exact, rel=0.05)
    for lean in (x / x.max(), y / y.max()):
        moved = operator.displace(lean)
        assert (moved * lean).sum() / (lean**2).sum() == pytest.approx(exact, rel=0.03)
        assert abs(moved.mean()) < 0.01 * exact


def test_a_slender_column_bends_under_shear_like_a_beam():
    """Timoshenko's cantilever: deflection F h^3 / 3 E I + 6 F h / 5 G A, slope F h^2 / 2 E I, on both axes."""
    width, depth, nu = 0.4 * H, 0.5 * H, 0.0
    parts = stack_layers(*[(H / 3, YOUNG, nu)] * 3)
    sides, x, y, cell = cut(parts, (width, depth), Pose.planar(at=BESIDE), (6, 8), 3)
    layer = VectorCompliance.tabulate(stack_layers((H, YOUNG, nu)), 2 * H)
    operator = VectorOperator(layer, x.shape, cell, sides.add_compliance(x.ravel(), y.ravel()))
    area, shear = width * depth, YOUNG / 2
    for component, (edge, across, place) in enumerate(((width, depth, x), (depth, width, y)), start=1):
        second = across * edge**3 / 12
        traction = np.zeros((3, *x.shape))
        traction[component] = 1 / area
        moved = operator.displace(traction)
        deflection = H**3 / (3 * YOUNG * second) + 1.2 * H / (shear * area)
        slope = H**2 / (2 * YOUNG * second)
        assert moved[component].mean() == pytest.approx(deflection, rel=0.05)
        # A force along +x tips the top over, so that its points at larger x go down.
        assert (moved[0] * place).sum() / (place**2).sum() == pytest.approx(slope, rel=0.05)
        assert np.abs(moved[3 - component]).max() < 0.02 * deflection
        # A couple of pressures, larger at +x, moves the top along x by the reciprocal amount.
        couple = np.zeros((3, *x.shape))
        couple[0] = place / second
        assert operator.displace(couple)[component].mean() == pytest.approx(slope, rel=0.05)


def displace(pose, forces, at, size=(1.1 * H, 1.4 * H), indenter=None):
    """Additional displacements of points in the frame of an indenter, under forces there."""
    indenter = indenter or Sphere(radius=1e-3)
    sides = SideEdges(
        cover=stack_layers((H, YOUNG, 0.4), size=size), indenter=indenter, pose=pose, half=np.array([0.5, 0.3]) * H,
        components=3,
    )  # fmt: skip
    return sides.add_compliance(*at)(forces)


def test_additional_displacements_are_reciprocal_and_turn_with_the_frame():
    rng = np.random.default_rng(5)
    at = rng.uniform(-1, 1, (2, 7)) * np.array([[0.5], [0.3]]) * H
    one, other = rng.uniform(-1, 1, (2, 3, 7))
    pose = Pose.planar(at=(0.05 * H, -0.1 * H))
    moved, back = displace(pose, one, at), displace(pose, other, at)
    assert (moved * other).sum() == pytest.approx((back * one).sum())
    # Free sides make a cover more compliant under any forces.
    assert (moved * one).sum() > 0
    # The cover, turned by a quarter, under the same forces in the frame of the indenter.
    turned = displace(Pose.planar(at=(0.1 * H, 0.05 * H), yaw=np.pi / 2), one, at, size=(1.4 * H, 1.1 * H))
    np.testing.assert_allclose(turned, moved, atol=1e-6 * np.abs(moved).max())


@pytest.mark.parametrize(
    ("at", "yaw", "planes"),
    [
        ((0.0, 0.0), 0.0, (True, True)),
        ((1e-3, 0.0), 0.0, (False, True)),
        ((0.0, 1e-3), np.pi, (True, False)),
        ((0.0, 0.0), np.pi / 2, (True, True)),
        ((0.0, 0.0), 0.3, (False, False)),
    ],
)
def test_mirror_planes_of_a_box_follow_its_place(at, yaw, planes):
    assert find_mirror_planes(Box(size=(1e-3, 2e-3, 1e-3)), Pose.planar(at=at, yaw=yaw)) == planes


def test_points_beside_the_cover_are_moved_onto_its_sides_and_touch_nothing():
    pose = Pose.planar(at=(1e-3, 0.0), yaw=np.pi / 2)
    sides = SideEdges(
        cover=stack_layers((H, YOUNG, 0.4), size=(4e-3, 6e-3)), indenter=Sphere(radius=9e-3), pose=pose,
        half=np.array([1e-3, 1e-3]),
    )  # fmt: skip
    # The indenter's x is the array's y; the cover reaches from -3 to 1 mm against the indenter's y.
    x, y = np.array([0.0, 3.5e-3, -1e-3, 2.9e-3]), np.array([0.5e-3, 0.0, -1.2e-3, 2.9e-3])
    np.testing.assert_allclose(sides.clip_to_cover(x, y), ([0.0, 3e-3, -1e-3, 2.9e-3], [0.5e-3, 0.0, -1e-3, 2.9e-3]))
    assert sides.contain(x, y).tolist() == [True, False, False, True]
    assert np.isinf(sides.gap(x, y)).tolist() == [False, True, True, False]
    assert sides.gap(x, y)[0] == pytest.approx(9e-3 - np.sqrt(81e-6 - 0.25e-6))
    assert (sides.rate(x, y) == 1).all()


@pytest.mark.parametrize(("base", "far"), [("bonded", 6.0), ("sliding", 15.0)])
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_side_is_near_within_a_multiple_of_the_decay_length(base, far, share):
    half, at = np.array([1e-3, 0.5e-3]), (0.4e-3, -0.7e-3)
    room = share * far * H
    for size in ((2 * (1.4e-3 + room), 1.0), (1.0, 2 * (1.2e-3 + room))):
        cover = stack_layers((H, YOUNG, 0.4), size=size, base=base)
        sides = SideEdges(cover=cover, indenter=Sphere(radius=9e-3), pose=Pose.planar(at=at), half=half)
        assert sides.near is (share < 1)
