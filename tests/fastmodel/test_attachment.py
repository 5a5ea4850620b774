"""Arrays on bodies and sites of other people's robots, in place of pads, and in specs that are attached to others."""

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import WTS_0614_34, FastModelError, Gaussian, Parameters
from fastmodel.errors import LifeCycleError
from meshes import TexelArray
from tests.support.quaternions import rotate
from tests.support.scenes import add_body, make_spec, simulate

PARAMETERS = Parameters(
    array=TexelArray.grid(3, 2, 3e-3), spread=Gaussian.from_sigma(0.5), electronics=WTS_0614_34, filter=None
)
#: A finger with sites that are given in different ways, and a pad of two geoms.
FINGER = """
<mujoco>
  <compiler angle="degree"/>
  <option timestep="0.001" cone="elliptic" impratio="10" gravity="0 0 0"/>
  <worldbody>
    <geom name="block" type="box" size="0.02 0.02 0.002" pos="0 0 0.0019" contype="0" conaffinity="0"/>
    <body name="finger" pos="0.01 0.02 0.03" euler="10 20 30">
      <joint type="slide"/>
      <frame pos="0 0 0.01" euler="0 90 0"><frame pos="0 0.01 0" zaxis="1 0 1">
        <site name="framed" pos="0.001 0 0" euler="0 0 90"/>
      </frame></frame>
      <site name="drawn" type="capsule" size="0.001" fromto="0 0 0 0 0.003 0.01"/>
      <site name="crossed" pos="0 0.01 0" xyaxes="0 1 0 -1 0 0"/>
      <site pos="0.01 0 0" zaxis="1 1 1"/>
      <geom name="pad" type="box" size="0.003 0.0045 0.001" mass="0.1"/>
      <geom type="box" size="0.003 0.0045 0.001" pos="0 0 0.002" mass="0.1"/>
    </body>
    <body name="link"><geom name="other" size="0.001" pos="0 0 0.1"/></body>
  </worldbody>
  <contact><pair geom1="block" geom2="pad" solref="0.01 2" friction="0.5 0.5 0.1 0.1 0.1"/></contact>
</mujoco>
"""


def finger():
    return mujoco.MjSpec.from_string(FINGER)


@pytest.mark.parametrize(
    ("number", "by_name"), [(0, True), (1, True), (2, True), (0, False), (1, False), (2, False), (3, False)]
)
def test_an_array_at_a_site_has_the_pose_that_mujoco_gives_the_site(number, by_name):
    spec = finger()
    site = spec.sites[number]
    turn = np.array([1.0, 2, 3, 4]) / np.sqrt(30)
    fastmodel.attach(
        spec, site.name if by_name else site, PARAMETERS, contact="boxes", position=(1, 2, 3), quaternion=turn
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    middles = rotate(turn, PARAMETERS.array.centres - [0, 0, 1e-3]) + np.array([1, 2, 3])
    expected = data.site_xpos[number] + middles @ data.site_xmat[number].reshape(3, 3).T
    found = [data.geom(f"sensor/texel{texel}").xpos for texel in range(6)]
    assert np.abs(expected - found).max() < 1e-14
    assert model.geom("sensor/texel0").bodyid == model.body("finger").id


@pytest.mark.parametrize("method", ["boxes", fastmodel.Foundation(modulus=1e9)])
def test_replaced_geoms_keep_their_mass_and_leave_contacts_and_pairs_to_the_array(method):
    spec = finger()
    pads = ["pad", next(geom for geom in spec.geoms if not geom.name)]
    sensor = fastmodel.attach(spec, "finger", PARAMETERS, position=(0, 0, 1e-3), contact=method, replaces=pads)
    model = spec.compile()
    pads = [geom for geom in range(model.ngeom) if model.geom(geom).name in {"pad", ""}]
    assert len(pads) == 2
    assert not (model.geom_contype[pads] | model.geom_conaffinity[pads]).any()
    assert model.body("finger").mass[0] == pytest.approx(0.2)
    array = [geom for geom in range(model.ngeom) if model.geom(geom).name.startswith("sensor/")]
    block = model.geom("block").id
    pairs = list(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))
    assert sorted(pairs) == sorted((block, geom) for geom in array)
    assert np.allclose(model.pair_solref, [0.01, 2])
    assert np.allclose(model.pair_friction[:, :3], [0.5, 0.5, 0.1])
    sensor.bind(model)


PALM = """
<mujoco>
  <option timestep="0.001" cone="elliptic" impratio="10"/>
  <worldbody>
    <geom name="pad" type="box" size="0.003 0.0045 0.001" pos="0 0 -0.001"/>
    <body name="block" pos="0 0 0.002">
      <joint type="slide"/>
      <geom name="block" type="box" size="0.002 0.002 0.002" mass="0.1" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <contact><pair geom1="block" geom2="pad"/></contact>
</mujoco>
"""


@pytest.mark.parametrize("method", ["boxes", fastmodel.Foundation(modulus=1e9)])
def test_the_array_carries_what_rested_on_the_replaced_geom_as_a_pair(method):
    spec = mujoco.MjSpec.from_string(PALM)
    sensor = fastmodel.attach(spec, "world", PARAMETERS, contact=method, replaces="pad")
    simulate(spec, sensor, 300)
    assert sensor.carried() == pytest.approx(0.981, rel=1e-3)
    assert sensor.contact_forces().sum() == pytest.approx(0.981, rel=1e-3)


def test_a_pair_of_two_replaced_geoms_disappears_and_a_body_is_meant_where_a_site_has_the_same_name():
    spec = finger()
    spec.geoms[2].name = "second"
    spec.add_pair(geomname1="pad", geomname2="second")
    spec.body("link").add_site(name="finger", pos=[0, 0, 1])
    fastmodel.attach(spec, "finger", PARAMETERS, contact="boxes", replaces={"pad", "second"})
    assert len(spec.pairs) == 6
    model = spec.compile()
    assert model.geom("sensor/texel0").bodyid == model.body("finger").id


@pytest.mark.parametrize(
    ("replaces", "message"),
    [
        ("pda", r"no geom of body 'finger' named 'pda'; valid names: pad; it has 1 geoms? without a name.*MjsGeom"),
        ("other", "geom 'other' is on body 'link'.*'finger'.*: pad"),
        (["pad", "block"], "geom 'block' is on body 'world'"),
        (None, "replaces must be the name of a geom, a mujoco.MjsGeom, or several of them, not NoneType"),
        ({"pad", 3}, "replaces must be the name of a geom, .* not int"),
    ],
)
def test_a_geom_that_cannot_be_replaced_leaves_the_spec_as_it_was(replaces, message):
    spec = finger()
    before = spec.to_xml()
    with pytest.raises(FastModelError, match=message):
        fastmodel.attach(spec, "finger", PARAMETERS, replaces=replaces)
    assert spec.to_xml() == before


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda other: {"body": other.site("drawn")}, "site 'drawn' belongs to another spec"),
        (lambda other: {"replaces": other.geom("pad")}, "geom 'pad' belongs to another spec"),
        (lambda _: {"body": "pad"}, "no body or site named 'pad'; .*; 'pad' is a geom of body 'finger': name the body"),
        (lambda _: {"body": "figner"}, "no body or site named 'figner'; valid names: crossed, drawn, finger"),
    ],
)
def test_sites_and_geoms_of_another_spec_are_refused(change, message):
    spec, other = finger(), finger()
    with pytest.raises(FastModelError, match=message):
        fastmodel.attach(**{"spec": spec, "body": "finger", "parameters": PARAMETERS, **change(other)})


def hand_with_two_fingers(**second):
    """A hand to which one finger with an array is attached twice."""
    child = mujoco.MjSpec()
    tip = child.worldbody.add_body(name="tip")
    sensor = fastmodel.attach(child, tip, PARAMETERS, name="pad", contact="boxes")
    hand = make_spec()
    hand.attach(child.copy(), prefix="left_", frame=hand.worldbody.add_frame(pos=[0, 0, 0]))
    hand.attach(child.copy(), frame=hand.worldbody.add_frame(pos=[0.1, 0, 0]), **second)
    add_body(hand, "sphere", [5e-3], [0.1, 0, 5e-3], slides="z", mass=0.1)
    return sensor, hand.compile()


@pytest.mark.parametrize("names", [{"prefix": "right_"}, {"prefix": "r_", "suffix": "_2"}])
def test_copies_of_an_array_are_found_by_prefix_and_suffix(names):
    sensor, model = hand_with_two_fingers(**names)
    right = sensor.twin(**names)
    batch = fastmodel.Batch(model, [sensor.bind(model, prefix="left_"), right], worlds=1)
    batch.step(300)
    left_force, right_force = batch.visit(lambda number, data, sensors: [each.carried() for each in sensors])[0]
    assert left_force == 0
    assert right_force == pytest.approx(0.981, rel=1e-3)
    assert sensor.bind(model) is sensor  # keeps its prefix


def test_a_wrong_prefix_is_answered_with_those_of_the_model():
    sensor, model = hand_with_two_fingers(prefix="r_", suffix="_2")
    arrays = r"bind\(model, prefix='left_'\), bind\(model, prefix='r_', suffix='_2'\)"
    with pytest.raises(LifeCycleError, match=f"'pad/texel0' is not in this model.*Arrays of this name.*{arrays}"):
        sensor.bind(model)
    with pytest.raises(LifeCycleError, match=f"'lfet_pad/texel0'.*{arrays}"):
        sensor.bind(model, prefix="lfet_")
    with pytest.raises(LifeCycleError, match="not bound"):
        sensor.frame()
    assert sensor.bind(model, prefix="left_") is sensor
