"""Bodies without a convex shape press at MuJoCo's contact points, each shared among the four cells around it."""

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel.pressure.cell_grid import CellGrid
from tests.support.cover_data import WTS, cells
from tests.support.hats import share_by_hats
from tests.support.scenes import add_body, make_spec

CELLS = cells()
GRID = CellGrid.over(WTS, 4, 1)
METHODS = [fastmodel.CoverContact(), fastmodel.Foundation(modulus=1e9)]


def press(method, *, block):
    """Hills of a height field under an array that looks down, and perhaps a block beside it; reading and contacts."""
    spec = make_spec()
    heights = np.zeros((21, 21))
    heights[[8, 10, 13], [10, 12, 9]] = 1.0
    spec.add_hfield(name="hills", nrow=21, ncol=21, size=[0.05, 0.05, 5e-3, 1e-3], userdata=heights.ravel())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="hills", condim=1)
    hand = add_body(spec, "box", [5e-3] * 3, [0, 0, 5.5e-3], slides="z", damping=2.0, mass=0.3)
    hand.geoms[0].pos = [0, 0, 20e-3]
    if block:
        add_body(spec, "box", [2e-3, 2e-3, 1e-3], [-4e-3, -12e-3, 4.0e-3])
    method.attach(hand.add_frame(quat=[0, 1, 0, 0]), WTS, "pad")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 150)
    rows, force, plate = [], np.zeros(6), model.geom("pad/plate").id
    axes = data.geom_xmat[plate].reshape(3, 3)
    for k, contact in enumerate(data.contact):
        mujoco.mj_contactForce(model, data, k, force)
        sign = -1 if contact.geom[1] == plate else 1
        other = contact.geom[0] if contact.geom[1] == plate else contact.geom[1]
        pressing = sign * (contact.frame.reshape(3, 3).T @ force[:3]) @ axes[:, 2]
        place = (contact.pos - data.geom_xpos[plate]) @ axes
        is_field = model.geom_type[other] == mujoco.mjtGeom.mjGEOM_HFIELD
        rows.append([*place[:2], pressing, is_field])
    return method.bind(model, WTS, "pad", surface=CELLS).read(data), np.array(rows)


@pytest.mark.parametrize("method", METHODS, ids=["cover", "foundation"])
def test_forces_at_points_reach_the_texels_as_those_on_their_cells(method):
    reading, rows = press(method, block=False)
    assert len(rows) >= 3
    assert rows[:, 3].all()
    forces = share_by_hats(GRID, rows[:, :3])
    row, column = np.indices(forces.shape).reshape(2, -1)
    np.testing.assert_allclose(reading.contact_forces, GRID.sum_on_texels(row, column, forces.ravel()), atol=1e-9)
    base = GRID.build_base_forces(CELLS, WTS)
    np.testing.assert_allclose(reading.texel_forces, base.from_window(forces, (0, 0)), atol=1e-9)
    assert reading.carried == pytest.approx(rows[:, 2].sum())
    x, y = rows[:, 2] @ rows[:, :2]
    np.testing.assert_allclose(reading.torques[:3], [-y, x, 0], atol=1e-12)
    np.testing.assert_allclose(reading.wrench[:3] @ [0, 0, 1], -reading.carried, rtol=1e-9)


@pytest.mark.parametrize("method", METHODS, ids=["cover", "foundation"])
def test_points_and_bodies_of_known_shape_press_together(method):
    reading, rows = press(method, block=True)
    field = rows[:, 3] > 0
    assert field.any()
    assert (~field).any()
    points = share_by_hats(GRID, rows[field, :3])
    row, column = np.indices(points.shape).reshape(2, -1)
    rest = reading.contact_forces - GRID.sum_on_texels(row, column, points.ravel())
    assert rest.min() > -1e-9
    assert rest.sum() == pytest.approx(rows[~field, 2].sum(), rel=1e-6)
    centre = rest @ WTS.centres[:, :2] / rest.sum()
    np.testing.assert_allclose(centre, [-4e-3, 12e-3], atol=1e-3)
    assert reading.carried == pytest.approx(rows[:, 2].sum(), rel=1e-6)
