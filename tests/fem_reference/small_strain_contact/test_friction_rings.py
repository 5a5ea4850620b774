"""Check contacts with friction on rings against closed forms and against the conditions of contact and slip."""

from functools import cache

import numpy as np
import pytest

from fem_reference.closed_form.contact import indent
from fem_reference.small_strain_contact.friction_rings import RingContact
from fem_reference.small_strain_contact.no_slip import press_stuck_disk
from meshes import Cone, Cylinder, RoundedTip, Sphere
from tests.exact.no_slip import stuck_punch, stuck_shape
from tests.exact.rings import press_with_friction
from tests.support.rubber import stack_layers

DEPTH = 0.2e-3


SOFT = stack_layers((2e-3, 1e6, 0.3))
STIFF_ON_SOFT = stack_layers((0.6e-3, 2e6, 0.1), (0.6e-3, 3e6, 0.4), (0.8e-3, 1e5, 0.45), base="sliding")


@cache
def smooth_and_rings(cover, indenter, count, **target):
    """Solve a contact without friction in closed form, and prepare rings for it."""
    smooth = indent(cover, indenter, **target)
    return smooth, RingContact(cover, indenter, contact_radius=smooth.contact_radius, count=count)


def solve(cover, indenter, friction, *, count=6, **target):
    """Press an indenter to a depth of `DEPTH`, or to the load in `target`."""
    smooth, rings = smooth_and_rings(cover, indenter, count, **(target or {"depth": DEPTH}))
    ((control, value),) = (target or {"depth": DEPTH}).items()
    return rings.press([value], control, friction=friction, depth=smooth.depth)[0]


@pytest.mark.parametrize("cover", [SOFT, STIFF_ON_SOFT], ids=["one-layer", "stiff-on-soft"])
@pytest.mark.parametrize("indenter", [Sphere(radius=5e-3), Cone(angle=2.4, radius=8e-3), Cylinder(radius=1.5e-3)])
def test_friction_agrees_with_boundary_elements(cover, indenter):
    expected = press_with_friction(cover, indenter, DEPTH, 0.4, rings=20 if indenter.is_flat else 32)
    found = solve(cover, indenter, 0.4)
    assert found.total_force == pytest.approx(expected.force, rel=4e-3)
    assert found.area == pytest.approx(np.pi * expected.contact_radius**2, rel=3e-2)


@pytest.mark.slow
@pytest.mark.parametrize(
    "indenter", [Sphere(radius=5e-3), pytest.param(RoundedTip(radius=12e-3), marks=pytest.mark.slow)]
)
def test_a_growing_contact_without_slip_agrees_with_integral_equations(indenter):
    found = solve(SOFT, indenter, np.inf, count=13)
    radius = np.sqrt(found.area / np.pi)
    expected = stuck_shape(SOFT, lambda r: indenter.gap(r, np.zeros_like(r)), radius, steps=16)
    # Force at a contact radius depends on the located edge; force at a depth does not.
    assert found.total_force == pytest.approx(expected.force * (found.depth / expected.depth) ** 1.5, rel=5e-3)


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.4, np.inf])
def test_the_conditions_of_contact_and_slip_hold(friction):
    found = solve(SOFT, Sphere(radius=5e-3), friction)
    normal, shear = found.contact[:, 2], np.zeros((len(found.contact), 2)) if found.shear is None else found.shear
    assert (normal > 0).all()
    assert (np.linalg.norm(shear, axis=1) <= min(friction, 1e9) * normal * (1 + 1e-6)).all()
    assert normal.sum() == pytest.approx(found.total_force, rel=1e-9)
    assert found.base.spread.reaction == pytest.approx(1, rel=1e-4)


def test_friction_stiffens_up_to_no_slip():
    loads = [solve(SOFT, Cylinder(radius=1.5e-3), friction).total_force for friction in (0.0, 0.1, 0.2, 0.5, np.inf)]
    assert np.all(np.diff(loads) > 0)
    assert loads[-1] == pytest.approx(stuck_punch(SOFT, 1.5e-3).stiffness * DEPTH, rel=5e-3)


def test_a_load_is_met_and_leads_back_to_its_depth():
    by_depth = solve(SOFT, Sphere(radius=5e-3), 0.3)
    by_load = solve(SOFT, Sphere(radius=5e-3), 0.3, load=by_depth.total_force)
    assert by_load.total_force == pytest.approx(by_depth.total_force, rel=1e-8)
    assert by_load.depth == pytest.approx(by_depth.depth, rel=2e-3)


def test_a_path_ends_where_a_single_press_does():
    indenter = Sphere(radius=5e-3)
    _, rings = smooth_and_rings(SOFT, indenter, 6, depth=DEPTH)
    path = rings.press([DEPTH / 3, DEPTH / 2, DEPTH], "depth", friction=0.3, depth=DEPTH)
    assert path[-1].total_force == pytest.approx(solve(SOFT, indenter, 0.3).total_force, rel=1e-4)
    assert [each.depth for each in path] == pytest.approx([DEPTH / 3, DEPTH / 2, DEPTH])


@pytest.mark.parametrize("ratio", [0.3, 0.5])
@pytest.mark.parametrize("radius", [1e-3, 8e-3])
def test_a_sliding_cover_is_meshed_far_enough_out(ratio, radius):
    cover = stack_layers((2e-3, 1e6, ratio), base="sliding")
    found, _ = press_stuck_disk(cover, radius, elements_per_thickness=6)
    assert found.total_force == pytest.approx(stuck_punch(cover, radius).stiffness, rel=1e-4)
