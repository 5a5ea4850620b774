import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import FastModelError, Foundation, Plate
from meshes import TexelArray
from tests.support.cover_data import WTS, parameters
from tests.support.scenes import add_body, make_spec, simulate

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


@pytest.mark.parametrize(
    ("plate", "margin", "half"),
    [(None, None, 10.2), (None, (1.2e-3, 1.8e-3), 8.0), (None, 0.0, 6.8), (1e-3, 2e-3, 7.8)],
)
def test_the_plate_ends_where_the_cover_does(plate, margin, half):
    """A pad of 16 mm x 24 mm over 6 x 4 texels of 3.4 mm collides with nothing beside it; by default it has a pitch."""
    pad = TexelArray.grid(6, 4, WTS.pitch, margin=margin)
    spec = mujoco.MjSpec()
    Plate(margin=plate).attach(spec.worldbody.add_frame(), pad, "pad")
    size = spec.compile().geom("pad/plate").size
    beyond = 1e-3 if plate else 3.4e-3 if margin is None else pad.margin[1]
    assert 1e3 * size == pytest.approx([half, 10.2 + 1e3 * beyond, 1])


@pytest.mark.parametrize(("x", "share"), [(7.2e-3, 1.0), (8.2e-3, 0.0)])
@pytest.mark.parametrize("contact", ["cover", "foundation"])
def test_a_force_on_the_margin_is_felt_by_the_cover_and_beside_it_by_nobody(x, share, contact):
    """The margin of 1.2 mm ends 8 mm from the middle; a ball stands on it, or falls past it."""
    spec = make_spec()
    array = TexelArray.grid(6, 4, WTS.pitch, margin=(1.2e-3, 1.8e-3))
    sensor = fastmodel.attach(spec, "world", parameters(array, filter=None), contact=contact)
    add_body(spec, "sphere", [0.3e-3], [x, 0, 0.3e-3], slides="z", mass=0.05, damping=1.0)
    simulate(spec, sensor, 300)
    assert sensor.carried() == pytest.approx(share * 0.05 * 9.81, rel=1e-3)
    assert sensor.contact_forces().sum() == 0
    assert sensor.frame().texel_forces.sum() <= 0.6 * sensor.carried()


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
        np.testing.assert_allclose([load.force, -load.moment[1], load.moment[0]], expected[body], atol=1e-12)
        assert len(load.turns) == 2


def test_a_reading_follows_slight_changes_of_the_contact():
    """A load that rises by 1 % scales the reading; a body that has moved by a tenth of its size is solved anew."""
    reader, _, data = build_blocks(CONES["elliptic"])
    first = reader.read(data)
    solved = reader._solved
    assert solved.compare(solved.contact, reader._length)[2] < 1e-12
    assert solved.compare(solved.contact.select([0]), reader._length)[2] == np.inf
    data.efc_force[:] *= 1.01
    found = reader.read(data)
    assert reader._solved is solved
    np.testing.assert_allclose(found.contact_forces, 1.01 * first.contact_forces, atol=1e-6)
    assert found.carried == pytest.approx(1.01 * first.carried, rel=1e-12)
    data.geom_xpos[1, 0] += 0.1 * max(solved.sizes)
    reader.read(data)
    assert reader._solved is not solved


def test_contact_forces_that_are_not_finite_are_refused():
    reader, _, data = build_blocks(CONES["elliptic"])
    data.efc_force[:] = np.nan
    with pytest.raises(FastModelError, match="not finite"):
        reader.find_contact(data)
