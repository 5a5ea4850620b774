"""Plates in MuJoCo: their geoms, margins that hold bodies, and contacts at their ends."""

import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fastmodel
from fastmodel import BoxTexels, CoverContact, Foundation, Plate
from fastmodel.contact.plate import CellReader, PanelReader
from fastmodel.errors import FastModelError
from fastmodel.pressure.cell_grid import divide_into_panels
from meshes import TexelArray
from tests.support.bent_array import bent_array
from tests.support.cover_data import WTS, cells, parameters
from tests.support.scenes import add_body, make_spec, simulate

ARRAY = TexelArray.grid(4, 3, (2e-3, 3e-3), active=np.arange(12) != 5)


def compile_geoms(method, array, **frame):
    spec = mujoco.MjSpec()
    method.attach(spec.worldbody.add_frame(**frame), array, "pad")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


@pytest.mark.parametrize("soft", [False, True])
def test_each_flat_panel_has_a_plate_below_its_top(soft):
    """A bent array has three panels, the middle ones of which are turned; softness belongs to the plate alone."""
    settings = {"solref": (0.013, 0.8), "solimp": (0.7, 0.9, 2e-3, 0.4, 3.0)} if soft else {}
    plate = Plate(height=1.5e-3, contype=6, conaffinity=9, **settings)
    array = bent_array()
    model, data = compile_geoms(plate, array)
    panels = divide_into_panels(array, 1)
    assert [model.geom(geom).name for geom in range(model.ngeom)] == [f"pad/plate{k}" for k in range(len(panels))]
    assert model.ngeom == 3
    for geom, panel in enumerate(panels):
        axes = data.geom_xmat[geom].reshape(3, 3)
        np.testing.assert_allclose(axes, panel.axes, atol=1e-9)
        np.testing.assert_allclose(data.geom_xpos[geom] + 0.75e-3 * axes[:, 2], panel.origin, atol=1e-9)
        np.testing.assert_allclose(model.geom_size[geom], [*panel.half, 0.75e-3])
        assert (model.geom_contype[geom], model.geom_conaffinity[geom]) == (6, 9)
        assert model.geom_priority[geom] == soft
        if soft:
            np.testing.assert_allclose(model.geom_solref[geom], (0.013, 0.8))
            np.testing.assert_allclose(model.geom_solimp[geom], (0.7, 0.9, 2e-3, 0.4, 3.0))
    assert model.body_mass.sum() == 0


def test_each_texel_has_a_box_below_its_face():
    turn = Rotation.from_rotvec([0.3, 0.2, -0.5])
    frame = {"pos": [0.1, 0.2, 0.3], "quat": turn.as_quat(scalar_first=True).tolist()}
    model, data = compile_geoms(BoxTexels(height=1e-3, contype=5, conaffinity=2), ARRAY, **frame)
    assert model.ngeom == 12
    for geom in range(12):
        middle = np.add(turn.apply(ARRAY.centres[geom] - [0, 0, 0.5e-3]), [0.1, 0.2, 0.3])
        np.testing.assert_allclose(data.geom_xpos[geom], middle, atol=1e-9)
        np.testing.assert_allclose(model.geom_size[geom], [1e-3, 1.5e-3, 0.5e-3])
        assert (model.geom_contype[geom], model.geom_conaffinity[geom]) == (5, 2)
    shown = {tuple(row) for row in np.delete(model.geom_rgba, 5, axis=0)}
    assert len(shown) == 1
    assert tuple(model.geom_rgba[5]) not in shown  # the masked texel is drawn in another colour


@pytest.mark.parametrize(
    ("margin", "array", "pitches"),
    [
        (None, ARRAY, (1, 1)),
        (1e-3, ARRAY, (0.5, 1 / 3)),
        ((3e-3, 0.0), ARRAY, (1.5, 0)),
        (None, dataclasses.replace(ARRAY, margin=(4e-3, 1.5e-3)), (2, 0.5)),
        (2e-3, dataclasses.replace(ARRAY, margin=(4e-3, 1.5e-3)), (1, 2 / 3)),
    ],
)
def test_the_margin_is_that_of_the_plate_or_the_array_or_one_pitch(margin, array, pitches):
    plate = Plate(margin=margin)
    np.testing.assert_allclose(plate.count_pitches(array), pitches)
    model, data = compile_geoms(plate, array)
    half = np.array([3 * 2e-3, 4 * 3e-3]) / 2 + np.array(pitches) * [2e-3, 3e-3]
    np.testing.assert_allclose(model.geom_size[0, :2], half)
    points, normals = CoverContact(plate=plate).sample_top(model, data, np.array([0]), array)
    inside = half - max(np.array(pitches) * [2e-3, 3e-3])
    assert (np.abs(points[:, :2]).max(axis=0) < inside).all()
    assert (np.abs(points[:, :2]).max(axis=0) > inside - 1e-3).all()
    np.testing.assert_allclose(normals, np.tile([0, 0, 1], (len(points), 1)))


@pytest.mark.parametrize(
    ("reach", "pitches"),
    [
        ((1e-3, 2e-3), None),  # one pitch suffices
        ((3e-3, 6e-3), None),
        ((3.1e-3, 6e-3), (2, 1)),
        ((5e-3, 9e-3), (2, 2)),
        ((5.1e-3, 9.1e-3), (3, 3)),
        ((1.0, 6e-3), (24, 1)),  # at most 24
    ],
)
def test_a_plate_without_a_stated_margin_is_widened_to_hold_bodies(reach, pitches):
    """A pitch more than the bodies reach beyond the texels, which end 3 mm and 6 mm from the middle."""
    method = CoverContact(tolerance=1e-5)
    found = method.hold(ARRAY, reach)
    if pitches is None:
        assert found is method
        return
    np.testing.assert_allclose(found.plate.margin, np.array(pitches) * [2e-3, 3e-3])
    assert found.plate.widened
    assert found.tolerance == 1e-5
    stated = dataclasses.replace(method, plate=Plate(margin=1e-3))
    assert stated.hold(ARRAY, reach) is stated
    assert method.hold(dataclasses.replace(ARRAY, margin=(0.0, 0.0)), reach) is method
    assert method.hold(bent_array(), reach) is method


def test_a_cover_that_ends_at_the_texels_has_a_plate_without_margin():
    method = Foundation(modulus=3e8)
    assert method.adapt(None) is method
    assert method.adapt(cells()) is method
    table = np.zeros((WTS.count, 14 * 4, 6 * 4))
    found = method.adapt(dataclasses.replace(cells(), table=table))
    assert (found.plate.margin, found.modulus) == (0, 3e8)


@pytest.mark.parametrize("modulus", [0.0, -1.0, np.inf, np.nan])
def test_a_modulus_must_be_positive(modulus):
    with pytest.raises(ValueError, match="modulus of a foundation must be positive"):
        Foundation(modulus=modulus)


@pytest.mark.parametrize(
    ("margin", "widened", "array", "told"),
    [
        (None, False, WTS, True),
        (3.4e-3, True, WTS, True),
        (3.4e-3, False, WTS, False),
        (None, False, dataclasses.replace(WTS, margin=(3.4e-3, 3.4e-3)), False),
    ],
)
def test_the_share_of_the_outermost_cells_is_reported_where_the_end_is_not_stated(margin, widened, array, told):
    """A block stands over the edge of a plate, 13.6 mm from the middle."""
    spec = make_spec()
    method = Foundation(modulus=1e9, plate=Plate(margin=margin, widened=widened))
    method.attach(spec.worldbody.add_frame(), array, "pad")
    add_body(spec, "box", [2.1e-3, 3e-3, 2e-3], [13.6e-3, 0, 2e-3], slides="z", mass=0.1, damping=1.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)
    reader = method.bind(model, array, "pad")
    assert isinstance(reader, CellReader)
    assert not isinstance(reader, PanelReader)
    reading = reader.read(data)
    assert reading.carried == pytest.approx(0.981, rel=1e-3)
    # of 2.1 mm on the plate, and an eighth of a cell by which edges are enlarged, 0.85 mm are the outermost cells
    assert reading.at_end == pytest.approx(0.85 / (2.1 + 0.85 / 8) if told else 0.0, abs=0.02)


def test_a_foundation_without_cells_has_four_along_a_pitch_and_spreads_nothing():
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", parameters(surface=None, filter=None), contact="foundation", every=1)
    add_body(spec, "box", [1.7e-3, 1.7e-3, 2e-3], [1.7e-3, 1.7e-3, 2e-3], slides="z", mass=0.1, damping=1.0)
    simulate(spec, sensor, 100)
    forces = WTS.image(sensor.contact_forces())
    assert forces[7, 3] == pytest.approx(0.981 / (1 + 0.85 / 8 / 1.7) ** 2, rel=0.06)  # its edges are enlarged
    assert sensor.frame().texel_forces == pytest.approx(parameters().spread.operator(WTS) @ sensor.contact_forces())


@pytest.mark.parametrize("modulus", [2e8, 1e9])
def test_texels_bear_the_pressure_of_springs_under_a_ball(modulus):
    """A softer bed has a wider contact: the pressure is k (d - r^2 / 2 R), and pi R k d^2 the force."""
    spec = make_spec()
    method = Foundation(modulus=modulus)
    method.attach(spec.worldbody.add_frame(), WTS, "pad")
    at, radius = np.array([0.3e-3, 0.2e-3]), 20e-3
    add_body(spec, "sphere", [radius], [*at, radius], slides="z", mass=0.2, damping=1.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)
    forces = method.bind(model, WTS, "pad").read(data).contact_forces
    depth = np.sqrt(0.2 * 9.81 / (np.pi * radius * modulus))
    fine = ((np.arange(20) + 0.5) / 20 - 0.5) * 3.4e-3
    x, y = (WTS.centres[:, axis, None] + fine - at[axis] for axis in range(2))
    pressure = modulus * np.maximum(depth - (x[:, None] ** 2 + y[:, :, None] ** 2) / (2 * radius), 0)
    expected = pressure.sum(axis=(1, 2)) * (3.4e-3 / 20) ** 2
    assert expected.sum() == pytest.approx(0.2 * 9.81, rel=0.01)
    assert np.abs(forces - expected).sum() / 2 < 0.02 * 0.2 * 9.81


def test_texels_that_touch_no_grid_of_the_cover_are_refused():
    spec = mujoco.MjSpec()
    Plate().attach(spec.worldbody.add_frame(), ARRAY, "pad")
    model = spec.compile()
    for method in (CoverContact(), Foundation()):
        with pytest.raises(FastModelError, match="pitch"):
            method.bind(model, ARRAY, "pad", surface=cells())
