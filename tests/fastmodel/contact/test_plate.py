import mujoco
import numpy as np
import pytest

from fastmodel import FastModelError, Foundation, Plate
from tests.support.cover_data import WTS
from tests.support.scenes import add_body, make_spec

CONES = {"elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC, "pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL}


def build_blocks(cone, condim=3):
    """Two free blocks of 0.1 and 0.3 kg that slide over a tilted plate; reader, model and data."""
    spec = make_spec(timestep=2e-3, cone=cone, gravity=[1.0, 0.5, -9.0])
    Plate().attach(spec.worldbody.add_frame(pos=[0.1, 0.2, 0.3]), WTS, "pad")
    for x, mass in ((-5e-3, 0.1), (5e-3, 0.3)):
        add_body(spec, "box", [3e-3, 4e-3, 3e-3], [0.1 + x, 0.2, 0.303], free=True, mass=mass, condim=condim)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 200)
    return Foundation(modulus=1e9).bind(model, WTS, "pad"), model, data


@pytest.mark.parametrize("condim", [1, 3, 6])
@pytest.mark.parametrize("cone", CONES.values(), ids=CONES)
def test_loads_are_the_sums_of_mujocos_own_contact_forces(cone, condim):
    reader, model, data = build_blocks(cone, condim)
    expected = {}
    plate = model.geom("pad/plate").id
    for k, contact in enumerate(data.contact):
        if plate not in contact.geom:
            continue
        force = np.zeros(6)
        mujoco.mj_contactForce(model, data, k, force)
        world = contact.frame.reshape(3, 3).T @ force[:3] * (-1 if contact.geom[1] == plate else 1)
        other = contact.geom[1] if contact.geom[0] == plate else contact.geom[0]
        place = contact.pos - [0.1, 0.2, 0.3]
        sums = expected.setdefault(int(model.geom_bodyid[other]), np.zeros(3))
        sums += world[2] * np.array([1, place[0], place[1]])
    found, _ = reader.find_contact(data)
    assert len(expected) == 2
    assert set(found.bodies) == set(expected)
    for body, load in zip(found.bodies, found.loads, strict=True):
        np.testing.assert_allclose([load.force, *load.moment], expected[body], atol=1e-12)
        assert load.tilts


def test_a_contact_equals_itself_and_no_changed_contact():
    reader, _, data = build_blocks(CONES["elliptic"])
    first, _ = reader.find_contact(data)
    assert first.equals(reader.find_contact(data)[0], 1e-12, 1e-3)
    assert not first.equals(first.select([0]), 1e-5, 1e-3)
    data.geom_xpos[1, 0] += 1e-6
    assert not reader.find_contact(data)[0].equals(first, 1e-5, 1e-3)
    data.geom_xpos[1, 0] -= 1e-6
    data.efc_force[:] *= 1.001
    assert not reader.find_contact(data)[0].equals(first, 1e-5, 1e-3)


def test_contact_forces_that_are_not_finite_are_refused():
    reader, _, data = build_blocks(CONES["elliptic"])
    data.efc_force[:] = np.nan
    with pytest.raises(FastModelError, match="not finite"):
        reader.find_contact(data)
