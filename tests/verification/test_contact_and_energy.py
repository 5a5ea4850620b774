"""Contact tractions and energy of `press`: balance, moments, Coulomb's cone, and work along the path."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference import press, press_path
from meshes import Box, Pose, Roller, Sphere
from tests.support.indentations import column_contact
from tests.support.rubber import make_cover

pytestmark = pytest.mark.slow

BALL = Sphere(radius=4e-3)
BOX = Box(size=(5e-3, 3e-3, 4e-3))
ROLLER = Roller(radius=4e-3, length=5e-3)
SLOW = pytest.mark.slow


def find_centre(found):
    return column_contact(found)[:, 2] @ column_contact(found)[:, :2] / found.total_force


@pytest.mark.parametrize(
    ("model", "shape"),
    [
        ("linear-elastic", BALL),
        ("linear-elastic", BOX),
        pytest.param("neo-hookean", BALL, marks=SLOW),
        pytest.param("neo-hookean", BOX, marks=pytest.mark.bench),
        pytest.param("neo-hookean", ROLLER, marks=pytest.mark.bench),
    ],
)
def test_energy_is_the_work_of_the_load(wts, model, shape):
    """Simpson's rule over three depths, exact for cubic forces."""
    depths = np.array([0.2, 0.25, 0.3]) * 1e-3
    first, middle, last = press_path(make_cover(0.45, model), wts, shape, depths=list(depths))
    work = (first.total_force + 4 * middle.total_force + last.total_force) / 6 * (depths[2] - depths[0])
    assert last.energy - first.energy == pytest.approx(work, rel=2e-3 if shape is BALL else 1e-2)


@pytest.mark.parametrize("model", ["linear-elastic", pytest.param("neo-hookean", marks=SLOW)])
def test_contact_forces_add_up_around_the_axis_of_a_ball(wts, model):
    at = (1e-3, -2e-3)
    found = press(make_cover(0.45, model), wts, BALL, load=0.5, pose=Pose.planar(at=at))
    assert column_contact(found)[:, 2].sum() == pytest.approx(found.total_force, rel=1e-9)
    assert find_centre(found) == pytest.approx(at, abs=2e-6)
    assert not found.contact_forces[:, :2].any()
    away = np.hypot(*(column_contact(found)[:, :2] - at).T)
    assert np.pi * away.max() ** 2 == pytest.approx(found.contact_area, rel=0.08)


@SLOW
@pytest.mark.parametrize(
    ("shape", "friction"),
    [(BALL, 0.3), (BALL, np.inf), (BOX, np.inf), pytest.param(BOX, 0.3, marks=pytest.mark.bench)],
)
def test_friction_points_along_the_sliding_cover_and_stays_in_the_cone(wts, friction, shape):
    found = press(
        make_cover(0.3, "linear-elastic"),
        wts,
        shape,
        load=0.5,
        pose=Pose.planar(at=(1e-3, 0.0), yaw=0.3),
        friction=friction,
    )
    normal = column_contact(found)[:, 2]
    assert normal.sum() == pytest.approx(found.total_force, rel=1e-9)
    assert found.contact_forces[:, :2].sum(axis=0) == pytest.approx([0, 0], abs=1e-3 * found.total_force)
    # At nu = 0.3 the free surface under the load moves inwards, and friction holds it back: outwards.
    outwards = ((column_contact(found)[:, :2] - [1e-3, 0.0]) * found.contact_forces[:, :2]).sum()
    assert outwards > 0
    size = np.hypot(*found.contact_forces[:, :2].T)
    if np.isfinite(friction):
        assert (size <= friction * normal * (1 + 1e-2) + 1e-9).all()
        assert (size > 0.5 * friction * normal).any()  # the edge slides; friction is averaged over a facet
    assert (size > 0).any()


@SLOW
@pytest.mark.parametrize("model", ["linear-elastic", pytest.param("neo-hookean", marks=pytest.mark.bench)])
def test_the_contact_of_a_finite_cover_is_in_the_frame_of_the_array(model):
    from meshes import TexelArray

    cover = make_cover(0.45, model, size=(10e-3, 8e-3))
    at = (0.0, 1e-3)
    found = press(cover, TexelArray.grid(2, 2, pitch=3.4e-3), BOX, load=0.3, pose=Pose.planar(at=at, yaw=np.pi / 2))
    assert column_contact(found)[:, 2].sum() == pytest.approx(found.total_force, rel=1e-9)
    x, y = np.abs(column_contact(found)[:, :2] - at).max(axis=0)
    assert (x, y) == pytest.approx((1.5e-3, 2.5e-3), rel=0.12)
