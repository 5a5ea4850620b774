"""Readings of MuJoCo's contacts after places, normals and forces of the contacts were changed to known ones."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fastmodel
from fastmodel import BoxTexels, Foundation
from fastmodel.pressure.cell_grid import CellGrid, divide_into_panels
from meshes import TexelArray
from tests.support.bent_array import bent_array
from tests.support.cover_data import WTS, cells
from tests.support.hats import share_by_hats
from tests.support.scenes import add_body, make_spec

OBLONG = TexelArray.grid(3, 4, (2e-3, 3e-3))


def touch(method, array, kinds, *, steps=3, condim=3):
    """Bodies on slides that press on an array, given by kind, half edges and place; model and data."""
    spec = make_spec(gravity=[0, 0, -50])
    method.attach(spec.worldbody.add_frame(), array, "pad")
    for kind, size, place in kinds:
        add_body(spec, kind, size, place, slides="z", mass=0.05, condim=condim)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, steps)
    return model, data


def set_contact(data, geoms, place, axes, forces):
    """Make the first contact the only one, between two geoms, with axes as rows and a force along each."""
    data.efc_force[:] = 0
    data.contact.geom[0], data.contact.pos[0], data.contact.frame[0] = geoms, place, np.ravel(axes)
    data.efc_force[data.contact.efc_address[0] + np.arange(3)] = forces


@pytest.mark.parametrize("texel", [0, 3, 5, 8, 11])
def test_a_push_at_the_side_of_a_box_counts_for_its_front_where_a_box_stands_beside_it(texel):
    model, data = touch(BoxTexels(), OBLONG, [("sphere", [3e-3], [0.5e-3, 0.4e-3, 2.99e-3])])
    reader, ball = BoxTexels().bind(model, OBLONG, "pad"), model.ngeom - 1
    row, column = divmod(texel, 4)
    for x, y, beside in ((-1, 0, column > 0), (1, 0, column < 3), (0, -1, row > 0), (0, 1, row < 2)):
        normal = np.array([x, y, 0.05]) / np.hypot(1, 0.05)
        axes = -np.stack([normal, np.cross([0, 0, 1.0], normal), [0, 0, 1]])
        box = model.geom(f"pad/texel{texel}").id
        set_contact(data, [ball, box], OBLONG.centres[texel], axes, [2.0, 0, 0])
        reading = reader.read(data)
        expected = np.zeros(12)
        expected[texel] = 2.0 * normal[2] * beside
        np.testing.assert_allclose(reading.contact_forces, expected, atol=1e-12)
        assert reading.carried == pytest.approx(2.0 * normal[2])
        np.testing.assert_allclose(reading.wrench[:3], -2.0 * normal, atol=1e-12)
        np.testing.assert_allclose(reading.tangential[texel], -2.0 * normal[:2] * beside, atol=1e-12)


BLOCKS = [("box", [3e-3, 4e-3, 3e-3], [x, 1e-3, 2.99e-3]) for x in (-5e-3, 5e-3)]


def find_forces(model, data, geom):
    """Indices of the contact forces on a geom, and the contacts."""
    contacts = (data.contact.geom == geom).any(axis=1).nonzero()[0]
    return data.contact.efc_address[contacts], contacts


@pytest.mark.parametrize("pulling", [1, 2])
@pytest.mark.parametrize("known", [True, False])
def test_a_body_that_pulls_counts_in_the_total_force_alone(pulling, known):
    """Of known shape, or with contact points only; the other body presses as if it were alone."""
    method = Foundation(modulus=5e8)
    model, data = touch(method, WTS, BLOCKS, condim=1)
    if not known:
        model.geom_type[pulling] = mujoco.mjtGeom.mjGEOM_SDF
    rows, contacts = find_forces(model, data, pulling)
    forces = data.efc_force.copy()
    assert forces[rows].sum() > 0.1
    readings = []
    for factor in (0.0, -0.7, 1.3):
        data.efc_force[:] = forces
        data.efc_force[rows] *= factor
        readings.append(method.bind(model, WTS, "pad", surface=cells()).read(data))
    alone, pulled, pressed = readings
    assert alone.carried == pytest.approx(forces.sum() - forces[rows].sum())
    assert pulled.carried == pytest.approx(forces.sum() - 1.7 * forces[rows].sum())
    assert pressed.carried == pytest.approx(forces.sum() + 0.3 * forces[rows].sum())
    for name in ("contact_forces", "texel_forces", "torques"):
        np.testing.assert_allclose(getattr(pulled, name), getattr(alone, name), atol=1e-12)
    assert pressed.contact_forces.sum() == pytest.approx(pressed.carried)
    if not known:
        grid = CellGrid.over(WTS, 4, 1)
        points = share_by_hats(grid, np.column_stack([data.contact.pos[contacts, :2], 1.3 * forces[rows]]))
        added = grid.build_base_forces(cells(), WTS).from_window(points, (0, 0))
        np.testing.assert_allclose(pressed.texel_forces, alone.texel_forces + added, atol=1e-9)
    data.efc_force[:] = 0
    nothing = method.bind(model, WTS, "pad", surface=cells()).read(data)
    assert (nothing.carried, nothing.contact_forces.any(), nothing.texel_forces.any()) == (0, False, False)


@pytest.mark.parametrize(
    ("method", "apart"),
    [(Foundation(modulus=5e8), 1e-6), (fastmodel.CoverContact(), 0.01)],  # the cover divides the force among cells
    ids=["foundation", "cover"],
)
def test_a_ball_on_one_cell_acts_at_its_own_place(method, apart):
    grid = CellGrid.over(WTS, 4, 1)
    place = grid.low + (np.array([15, 33]) + 0.5 + [0.2, -0.1]) * grid.edge
    model, data = touch(method, WTS, [("sphere", [0.2e-3], [*place, 0.199e-3])], condim=1)
    reading = method.bind(model, WTS, "pad", surface=cells()).read(data)
    assert reading.fewest_cells == 1
    force = share_by_hats(grid, [[*place, reading.carried]])
    expected = grid.build_base_forces(cells(), WTS).from_window(force, (0, 0))
    assert reading.carried > 0.1
    np.testing.assert_allclose(reading.texel_forces, expected, atol=apart * reading.carried)


@pytest.mark.parametrize("first", [True, False], ids=["array first", "body first"])
@pytest.mark.parametrize(("texel", "panel"), [(1, 0), (3, 1), (8, 2)])
def test_a_point_force_on_a_panel_presses_by_its_part_along_the_normal(texel, panel, first):
    """Beside the plate it acts on the outermost cells; a force across the normal counts in the total force alone."""
    array, method = bent_array(), Foundation(modulus=5e8)
    model, data = touch(method, array, [("sphere", [3e-3], [0.3e-3, 0.2e-3, 2.99e-3])])
    assert len(divide_into_panels(array, 0)) == 3
    ball, plate = model.ngeom - 1, model.geom(f"pad/plate{panel}").id
    model.geom_type[ball] = mujoco.mjtGeom.mjGEOM_SDF
    up, forces = array.normals[texel], np.array([2.0, 0.3, -0.4])
    aside = np.sign(array.centres[texel, 0]) * np.array([2.5e-3, 0, 0])
    for lean, shift in ((0.0, 0), (0.6, 0), (-0.9, 1), (1.6, 0)):
        turn = Rotation.from_rotvec(0.5 * up + lean * up[[2, 0, 1]]).as_matrix()
        axes = np.stack([up, [1, 0, 0], np.cross(up, [1, 0, 0])]) @ turn
        sign = 1 if first else -1
        set_contact(
            data, [plate, ball] if first else [ball, plate], array.centres[texel] + shift * aside, sign * axes, forces
        )
        reading = method.bind(model, array, "pad", surface=None).read(data)
        along = (forces @ axes) @ up
        expected = np.zeros(9)
        expected[texel] = along * (axes[0] @ up >= 0.1) * (along > 0)
        np.testing.assert_allclose(reading.contact_forces, expected, atol=1e-12)
        assert reading.carried == pytest.approx(along)
        np.testing.assert_allclose(reading.wrench[:3], -(forces @ axes), atol=1e-12)


@pytest.mark.parametrize("side", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_a_block_at_any_side_of_the_plate_tells_the_share_of_the_outermost_cells(side):
    """It covers three and a half cells up to the end; a stated margin ends the cover."""
    method, array = Foundation(modulus=1e9), TexelArray.grid(3, 5, 3.4e-3)
    half = np.array([5, 3]) * 1.7e-3 + 3.4e-3
    cell = 0.85e-3
    size = np.where(side, 3.5 * cell / 2, 2e-3)
    place = np.array(side) * (half - 3.5 * cell / 2)
    model, data = touch(method, array, [("box", [*size, 1e-3], [*place, 0.999e-3])], condim=1)
    reading = method.bind(model, array, "pad").read(data)
    assert reading.at_end == pytest.approx(1 / 3.5, abs=0.02)
    assert reading.fewest_cells % 4 == 0  # four rows or columns, the innermost of which is half covered
