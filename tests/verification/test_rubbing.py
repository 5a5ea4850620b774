"""Presses with friction at small strain: ring elements, integral equations, and conditions of contact and slip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_reference import press
from fem_reference.errors import UnsupportedError
from fem_reference.linear_response.surface_compliance import solve_waves
from fem_reference.small_strain_contact.free_edges import SideEdges
from meshes import Box, Cone, Cylinder, RoundedTip, Sphere, TexelArray
from meshes.pose import Pose
from tests.exact.no_slip import stuck_punch, stuck_shape
from tests.exact.rings import press_with_friction
from tests.exact.tractions import transfer_to_base
from tests.support.rubber import stack_layers

pytestmark = pytest.mark.slow

ARRAY, DEPTH, BALL = TexelArray.grid(5, 5, 3.4e-3), 0.2e-3, Sphere(radius=5e-3)
SOFT = stack_layers((2e-3, 1e6, 0.3))
STIFF_ON_SOFT = stack_layers((0.6e-3, 2e6, 0.1), (0.6e-3, 3e6, 0.4), (0.8e-3, 1e5, 0.45), base="sliding")
SKIN = stack_layers((2e-3, 2e5, 0.45), (0.1e-3, 20e6, 0.45))

_ROUND = [(SOFT, BALL), (SOFT, Cylinder(radius=1.5e-3)), (STIFF_ON_SOFT, Cone(angle=2.4, radius=8e-3)), (SKIN, BALL)]


@pytest.mark.parametrize(("cover", "indenter"), _ROUND)
def test_friction_agrees_with_boundary_elements(cover, indenter):
    # Under a skin the pressure falls slowly to the edge, whose place needs more rings.
    count = 128 if cover is SKIN else 48 if indenter.is_flat else 64
    expected = press_with_friction(cover, indenter, DEPTH, 0.4, rings=count)
    found = press(cover, ARRAY, indenter, depth=DEPTH, friction=0.4)
    rings = 1.5e-3  # the error of the boundary elements, their change from half as many
    assert found.total_force == pytest.approx(expected.force, rel=found.error_estimate["total_force"] + rings)
    texels = expected.texel_forces(ARRAY)
    np.testing.assert_allclose(
        found.texel_forces, texels, atol=texels.max() * (found.error_estimate["peak_texel"] + rings)
    )
    area = np.pi * expected.contact_radius**2
    assert found.contact_area == pytest.approx(area, rel=found.error_estimate["contact_area"] + 1e-3)


@pytest.mark.parametrize(("base", "indenter"), [("bonded", BALL), ("sliding", RoundedTip(radius=12e-3))])
def test_a_growing_contact_without_slip_agrees_with_integral_equations(indenter, base):
    cover = replace(SOFT, base=base)
    expected = stuck_shape(cover, lambda r: indenter.gap(r, np.zeros_like(r)), 1.2e-3, steps=24)
    found = press(cover, ARRAY, indenter, depth=expected.depth, friction=np.inf)
    assert found.total_force == pytest.approx(expected.force, rel=found.error_estimate["total_force"])
    assert found.contact_area == pytest.approx(np.pi * 1.2e-3**2, rel=found.error_estimate["contact_area"])
    texels = expected.texel_forces(ARRAY)
    np.testing.assert_allclose(found.texel_forces, texels, atol=texels.max() * found.error_estimate["peak_texel"])


@pytest.mark.parametrize("friction", [0.05, 0.4, np.inf])
def test_the_conditions_of_contact_and_slip_hold(friction):
    found = press(SOFT, ARRAY, BALL, depth=DEPTH, friction=friction)
    normal, shear = -found.contact_forces[:, 2], np.hypot(*found.contact_forces[:, :2].T)
    assert (normal > 0).all()
    # The shear follows the pressure to a thousandth of the largest one.
    assert (shear <= min(friction, 1e9) * (normal + 1e-3 * normal.max())).all()
    assert normal.sum() == pytest.approx(found.total_force, rel=1e-9)
    assert found.texel_forces.sum() + found.outside == pytest.approx(found.total_force, rel=1e-4)


def test_friction_stiffens_up_to_no_slip():
    frictions = (0.0, 0.05, 0.1, 0.2, np.inf)
    loads = [press(SOFT, ARRAY, Cylinder(radius=1.5e-3), depth=DEPTH, friction=each).total_force for each in frictions]
    assert np.all(np.diff(loads) > 0)
    assert loads[-1] == pytest.approx(stuck_punch(SOFT, 1.5e-3).stiffness * DEPTH, rel=1e-4)


@pytest.mark.bench
def test_a_face_on_a_stiff_foil_rubs_between_no_friction_and_no_slip():
    foil = stack_layers((2e-3, 2e5, 0.45), (0.1e-3, 2e9, 0.4))
    loads = [
        press(foil, ARRAY, Cylinder(radius=2e-3), depth=0.1e-3, friction=each).total_force for each in (0, 0.4, np.inf)
    ]
    assert loads == sorted(loads)


def test_a_load_is_met_and_leads_back_to_its_depth():
    by_depth = press(SOFT, ARRAY, BALL, depth=DEPTH, friction=0.3)
    by_load = press(SOFT, ARRAY, BALL, load=by_depth.total_force, friction=0.3)
    assert by_load.depth == pytest.approx(by_depth.depth, rel=by_load.error_estimate["depth"])
    assert by_load.texel_forces == pytest.approx(by_depth.texel_forces, rel=by_load.error_estimate["peak_texel"])


@pytest.mark.parametrize(("ratio", "radius"), [(0.3, 8e-3), (0.5, 1e-3)])
def test_a_face_without_slip_on_a_sliding_cover(ratio, radius):
    cover = stack_layers((2e-3, 1e6, ratio), base="sliding")
    exact = stuck_punch(cover, radius).press(1e-5)
    found = press(cover, ARRAY, Cylinder(radius=radius), depth=1e-5, friction=np.inf)
    assert found.total_force == pytest.approx(exact.force, rel=found.error_estimate["total_force"])
    assert found.error_estimate["total_force"] < 2e-3
    peak = exact.texel_forces(ARRAY)[12]
    assert found.texel_forces[12] == pytest.approx(peak, rel=found.error_estimate["peak_texel"])


@pytest.mark.parametrize("cover", [SOFT, STIFF_ON_SOFT], ids=["bonded", "sliding"])
def test_shear_waves_press_on_the_base_as_the_transfer_matrices_say(cover):
    k = np.geomspace(1e-2, 8, 12) / cover.thickness
    expected = transfer_to_base(cover, k)[1] / k
    np.testing.assert_allclose(solve_waves(cover, k).tilting, expected, atol=1e-5 * np.abs(expected).max())


def test_shear_near_free_sides_is_reciprocal_and_turns_with_the_indenter():
    rng, cover = np.random.default_rng(0), replace(SOFT, size=(7e-3, 5e-3))
    x, y = rng.uniform(-1e-3, 1e-3, (2, 6))
    one, other = rng.random((2, 3, 6))

    def place(yaw):
        pose = Pose.planar(at=(0.6e-3, -0.4e-3), yaw=yaw)
        turned = replace(pose, point=(0.0, 0.0, 0.0))
        sides = SideEdges(
            cover=cover, indenter=Box(size=(2e-3, 2e-3, 2e-3)), pose=pose, half=np.full(2, 1e-3), components=3
        )
        add = sides.add_compliance(*turned.to_indenter(x, y))

        def displace(force):
            moved = add(np.stack([force[0], *turned.to_indenter(*force[1:])]))
            return np.stack([moved[0], *turned.to_array(*moved[1:])])

        return displace

    displace, turned = place(0.0), place(np.pi / 2)
    assert (one * displace(other)).sum() == pytest.approx((other * displace(one)).sum(), rel=1e-9)
    np.testing.assert_allclose(turned(one), displace(one), rtol=1e-9)


def test_friction_on_a_wide_sliding_cover_does_not_depend_on_the_place():
    cover = replace(SOFT, base="sliding")
    poses = Pose(), Pose.planar(at=(2e-3, 1e-3))
    one, other = (press(cover, ARRAY, BALL, pose, load=0.1, friction=0.4) for pose in poses)
    assert other.depth == one.depth


@pytest.mark.parametrize(
    ("cover", "indenter", "at"),
    [
        (replace(SOFT, base="sliding"), Box(size=(3e-3, 4e-3, 3e-3)), None),
        (replace(SOFT, base="sliding", size=(20e-3, 20e-3)), BALL, (4e-3, 0.0)),
        (replace(stack_layers((2e-3, 1.5e5, 0.49), (50e-6, 3e9, 0.4)), size=(40e-3, 40e-3)), BALL, (0.0, 0.0)),
    ],
    ids=["tilted box that slides", "ball beside the middle of a sliding pad", "foil to the sides"],
)
def test_friction_whose_shear_is_not_resolved_is_refused(cover, indenter, at):
    pose = Pose(tilt=(0.05, 0.02)) if at is None else Pose.planar(at=at)
    with pytest.raises(UnsupportedError, match=r"slides on its base|so stiff") as refused:
        press(cover, ARRAY, indenter, pose, load=0.1, friction=0.4)
    assert refused.value.argument == "friction"
