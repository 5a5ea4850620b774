"""The force of a flex is distributed by the depth of its surface, steadily and in full."""

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import CoverContact, Plate
from fastmodel.pressure.flexes import _divide, spread_depths
from meshes import TexelArray
from tests.support.cover_data import parameters

PARAMETERS = parameters(filter=None)
THICK = Plate(height=0.02)
#: A soft cube of 10 mm, a cloth of 12 x 8 mm and a cable of 12 mm.
CUBE = 'type="grid" dim="3" count="4 4 4" spacing="3.3333e-3 3.3333e-3 3.3333e-3"'
CLOTH = 'type="grid" dim="2" count="4 3 1" spacing="4e-3 4e-3 4e-3"'
CABLE = 'type="grid" dim="1" count="4 1 1" spacing="4e-3 4e-3 4e-3"'
SOFT = '<elasticity young="1e5" poisson="0.3" damping="2e-3"/>'
STIFF = '<edge equality="true"/>'


def build_flexes(flexes, inside, array=PARAMETERS.array):
    """Flexes, given by shape, position and mass, over an array under gravity; sensor, model and data."""
    parts = "\n".join(
        f'<flexcomp name="{number}" {shape} pos="{place}" mass="{mass}" radius="5e-4">'
        f'<contact selfcollide="none" condim="3"/>{inside}</flexcomp>'
        for number, (shape, place, mass) in enumerate(flexes)
    )
    integrator = "discrete" if inside == SOFT else "implicitfast"
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><option integrator="{integrator}"/><worldbody>{parts}</worldbody></mujoco>'
    )
    fastmodel.recommend_options(spec)
    spec.option.timestep = 1e-3
    sensor = fastmodel.attach(spec, "world", parameters(array, filter=None), contact=CoverContact(plate=THICK), every=1)
    model = spec.compile()
    return sensor.bind(model), model, mujoco.MjData(model)


def run(sensor, model, data, steps):
    images = []
    for _ in range(steps):
        mujoco.mj_step(model, data)
        sensor.step(data)
        images.append(sensor.contact_forces())
    return np.array(images)


@pytest.mark.slow
def test_the_image_of_a_soft_cube_at_rest_is_steady_and_its_force_exact():
    sensor, model, data = build_flexes([(CUBE, "1e-3 -2e-3 6e-3", 0.05)], SOFT)
    run(sensor, model, data, 500)
    images = run(sensor, model, data, 40)
    changes = 0.5 * np.abs(np.diff(images, axis=0)).sum(axis=1) / images[1:].sum(axis=1)
    assert changes.max() < 0.05
    assert sensor.carried() == pytest.approx(0.05 * 9.81, rel=0.05)
    force, total = np.zeros(6), 0.0
    for k in range(data.ncon):
        mujoco.mj_contactForce(model, data, k, force)
        total += force[0]
    assert sensor.carried() == pytest.approx(total, rel=1e-6)
    image = images[-1] / images[-1].sum()
    centres = PARAMETERS.array.centres
    middle = data.flexvert_xpos.mean(axis=0)
    np.testing.assert_allclose(image @ centres[:, :2], middle[:2], atol=0.5e-3)
    beyond = (np.abs(centres[:, :2] - [1e-3, -2e-3]) > 5e-3 + 0.5 * PARAMETERS.array.pitch[0] + 0.5e-3).any(axis=1)
    assert image[beyond].max() < 1e-6


@pytest.mark.parametrize(
    ("shape", "wide"),
    [pytest.param(CLOTH, (12e-3, 8e-3), marks=pytest.mark.slow), (CABLE, (12e-3, 0.0))],
    ids=["cloth", "cable"],
)
def test_cloths_and_cables_are_laid_out_along_their_length(shape, wide):
    sensor, model, data = build_flexes([(shape, "1e-3 -2e-3 0.6e-3", 0.05)], STIFF)
    run(sensor, model, data, 400)
    image = sensor.contact_forces()
    assert image.sum() == pytest.approx(0.05 * 9.81, rel=0.05)
    share, (x, y) = image / image.sum(), PARAMETERS.array.centres[:, :2].T
    assert share @ x == pytest.approx(1e-3, abs=1e-3)
    found = [np.sqrt(share @ (each - share @ each) ** 2) for each in (x, y)]
    np.testing.assert_allclose(found, np.array(wide) / np.sqrt(12), atol=0.3 * max(PARAMETERS.array.pitch))


def test_the_force_follows_the_depth():
    """Under a tilted rectangle whose depth rises from 0 to its other end, the centre lies at two thirds."""
    long, wide, deep = 12e-3, 4e-3, 0.1e-3
    outline = np.array([[0, 0, 0], [long, 0, -deep], [long, wide, -deep], [0, wide, 0]])
    corners, bounds = outline[[[0, 1, 2], [0, 2, 3]]], np.array([[-0.01, -0.01, -2e-3], [0.02, 0.02, 0.0]])
    sums = spread_depths(corners, _divide(3, 12.0), bounds, (0.0, 0.0, 1e-3))
    weight, x, y = sums.sum(axis=0)
    assert weight == pytest.approx(long * wide * deep / 2, rel=1e-3)
    assert x / weight == pytest.approx(2 / 3 * long, rel=0.01)
    assert y / weight == pytest.approx(wide / 2, rel=0.01)
    squares = np.floor((sums[:, 1:] / sums[:, :1] - bounds[0, :2]) / 1e-3)
    assert sorted(map(tuple, squares)) == [(10 + k, 10 + m) for k in range(12) for m in range(4)]  # one entry each
    moved = spread_depths(corners + np.array([0, 0, 0.5e-3]), _divide(3, 12.0), bounds, (0.2e-3, 0.3e-3, 1e-3))
    np.testing.assert_allclose(moved, sums, rtol=1e-9)  # distance, less radius and margin, is the same
    assert not len(spread_depths(corners + np.array([0, 0, 1e-3]), _divide(3, 12.0), bounds, (0.0, 0.0, 1e-3)))
    beside = spread_depths(corners, _divide(3, 12.0), bounds - [[0, 0, 0], [0.02 - long / 2, 0, 0]], (0.0, 0.0, 1e-3))
    assert (beside[:, 1] / beside[:, 0]).max() < long / 2


def test_each_of_two_flexes_presses_with_its_own_force():
    array, masses = TexelArray.grid(5, 12, 3e-3), {-1: 0.03, 1: 0.09}
    flexes = [(CABLE, f"{sign * 6e-3} 0 0.6e-3", mass) for sign, mass in masses.items()]
    sensor, model, data = build_flexes(flexes, STIFF, array)
    run(sensor, model, data, 300)
    forces, x = sensor.contact_forces(), array.centres[:, 0]
    assert data.ncon
    for sign, mass in masses.items():
        assert forces[sign * x > 0].sum() == pytest.approx(mass * 9.81, rel=0.05)
