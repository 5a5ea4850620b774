"""What a sensor says about the model it is in: each fault is told with its cure, and the cure ends the sentence."""

import dataclasses
import re

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import WTS_0614_34, Gaussian, OptionWarning, Parameters, Plate
from fastmodel.errors import LifeCycleError
from meshes import TexelArray
from tests.support.cover_data import parameters
from tests.support.scenes import add_body, make_spec, run, simulate

SMALL = Parameters(
    array=TexelArray.grid(4, 3, 3e-3), spread=Gaussian.from_sigma(0.5), electronics=WTS_0614_34, filter=None
)
KINDS = mujoco.mjtGeom
ENABLE, DISABLE = mujoco.mjtEnableBit, mujoco.mjtDisableBit


def scene(*, pad=None, finger="finger", array=SMALL, ball=True, **settings):
    """A finger on a slide, whose array may have a pad below its top, and a free ball."""
    spec = make_spec()
    body = spec.worldbody.add_body(name="finger")
    body.add_joint(name="hold", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    body.add_geom(name="bone", type=KINDS.mjGEOM_SPHERE, size=[5e-3, 0, 0], pos=[0, 0, -0.02], mass=0.1)
    if pad is not None:
        body.add_geom(name="pad", type=KINDS.mjGEOM_BOX, size=[3e-3, 0.01, 3e-3], pos=[0, 0, -3e-3 - pad])
    if ball:
        free = add_body(spec, "sphere", [5e-3], [0, 0, 0.1], free=True, name="ball", mass=0.1)
        free.geoms[0].name = "round"
    return spec, fastmodel.attach(spec, finger, array, contact=settings.pop("contact", "boxes"), **settings)


def press_on_pad(below):
    """Share of 16 N under a guided box that the array carries next to a pad, and what the sensor says."""
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", parameters(filter=None), every=1)
    spec.worldbody.add_geom(name="pad", type=KINDS.mjGEOM_BOX, size=[9e-3, 9e-3, 4e-3], pos=[0, 0, -4e-3 - below])
    add_body(spec, "box", [4e-3] * 3, [0, 0, 4e-3], slides="z", mass=0.1)

    def push(data):
        data.qfrc_applied[0] = 0.1 * 9.81 - 16

    model, _ = simulate(spec, sensor, 200, push)
    return sensor.carried() / 16, sensor.check(model)


@pytest.mark.parametrize(
    ("below", "share", "where"),
    [(-0.5e-3, 0.16, "0.50 mm above"), (0.0, 0.5, "flush with"), (0.5e-3, 0.84, "0.50 mm below"), (1e-3, 1.0, None)],
)
def test_a_pad_that_takes_force_from_the_array_is_told(below, share, where):
    carried, said = press_on_pad(below)
    assert carried == pytest.approx(share, abs=0.01)
    if where is None:
        assert said == ()
    else:
        (sentence,) = said
        assert f"geom 'pad' of body 'world' lies {where} the top of array 'sensor' at 30 % of it" in sentence
        assert f"replaces='pad', or move the array outwards by {1 - 1e3 * below:.2f} mm" in sentence


def test_a_replaced_pad_is_silent_and_the_array_carries_all():
    spec, sensor = scene(pad=0.0)
    with pytest.warns(OptionWarning, match="'pad' of body 'finger' lies flush with the top of array 'sensor' at 67 %"):
        sensor.bind(spec.compile())
    spec, sensor = scene(pad=0.0, replaces="pad")
    assert sensor.check(spec.compile()) == ()


@pytest.mark.parametrize("kind", [mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE])
def test_a_pad_on_a_body_that_is_welded_to_the_finger_is_told(kind):
    spec, sensor = scene()
    holder = add_body(spec, "box", [3e-3, 0.01, 3e-3], [0, 0, -0.003], free=True, name="holder", mass=0.01)
    holder.geoms[0].name = "cap"
    spec.worldbody.add_site(name="elsewhere")
    for body in ("finger", "holder"):
        spec.body(body).add_site(name=body)
    spec.add_exclude(bodyname1="finger", bodyname2="holder")
    before = sensor.check(spec.compile())
    weld = spec.add_equality(type=mujoco.mjtEq.mjEQ_WELD, objtype=kind, name1="holder", name2="finger", active=False)
    inactive = sensor.check(spec.compile())
    weld.active = True
    after = sensor.check(spec.compile())
    assert not any("flush" in each for each in before + inactive)
    (said,) = (each for each in after if "flush" in each)
    assert "geom 'cap' of body 'holder' lies flush" in said
    assert "set its contype and conaffinity to 0" in said


def test_links_of_the_robot_that_press_on_the_array_are_told():
    spec, sensor = scene()
    link = spec.body("finger").add_body(name="knuckle").add_body(name="link")
    for body in (link.parent, link):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE)
        body.add_geom(type=KINDS.mjGEOM_SPHERE, size=[5e-3, 0, 0], pos=[0, 0, 4e-3], mass=0.1)
    spec.body("ball").pos = [0, 0, 4e-3]  # objects may begin in contact
    (said,) = sensor.check(spec.compile())
    assert "of body 'link' presses on array 'sensor' in the initial pose" in said
    assert "spec.add_exclude(bodyname1='finger', bodyname2='link')" in said
    spec.add_exclude(bodyname1="finger", bodyname2="link")
    assert sensor.check(spec.compile()) == ()


@pytest.mark.parametrize("contact", ["boxes", fastmodel.Foundation(modulus=1e9)])
@pytest.mark.parametrize(
    ("kind", "size", "place", "found"),
    [
        (KINDS.mjGEOM_CYLINDER, [4e-3, 2e-3, 0], (0, 0, -2e-3), True),
        (KINDS.mjGEOM_CAPSULE, [2e-3, 4e-3, 0], (0, 0, -6.2e-3), True),
        (KINDS.mjGEOM_ELLIPSOID, [4e-3, 4e-3, 2e-3], (0, 0, -2e-3), True),
        (KINDS.mjGEOM_PLANE, [1, 1, 1], (0, 0, -0.9e-3), True),
        (KINDS.mjGEOM_MESH, [0, 0, 0], (0, 0, -2e-3), True),
        (KINDS.mjGEOM_HFIELD, [0, 0, 0], (0, 0, -0.9e-3), True),
        (KINDS.mjGEOM_MESH, [0, 0, 0], (0, 0, -3.1e-3), False),
        (KINDS.mjGEOM_HFIELD, [0, 0, 0], (0, 0, -1.1e-3), False),
        # a roof over the array, which leaves room below
        (KINDS.mjGEOM_BOX, [4e-3, 4e-3, 2e-3], (0, 0, 6e-3), False),
        # a frame around the texels, under the margin of the plate alone
        (KINDS.mjGEOM_BOX, [2e-3, 2e-3, 2e-3], (0, 8.2e-3, -2e-3), False),
    ],
)
def test_geoms_of_all_kinds_are_examined(kind, size, place, found, contact):
    spec, sensor = scene(finger="world", contact=contact)
    spec.add_hfield(name="field", nrow=2, ncol=2, size=[0.02, 0.02, 1e-3, 1e-3], userdata=[0, 0, 0, 0])
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    spec.add_mesh(name="cube", uservert=(2e-3 * np.array(corners, dtype=float)).ravel())
    names = {KINDS.mjGEOM_MESH: {"meshname": "cube"}, KINDS.mjGEOM_HFIELD: {"hfieldname": "field"}}
    spec.worldbody.add_geom(type=kind, size=size, pos=place, **names.get(kind, {}))
    said = sensor.check(spec.compile())
    assert len(said) == found
    if found:
        assert "a geom without a name" in said[0]
        assert ("replaces=" in said[0]) == (
            kind not in names or kind == KINDS.mjGEOM_MESH
        ) or kind == KINDS.mjGEOM_PLANE


def test_arrays_that_overlap_are_told():
    spec, sensor = scene()
    fastmodel.attach(spec, "finger", SMALL, name="second", position=(6e-3, 0, 0), contact="boxes")
    said = sensor.check(spec.compile())
    assert len(said) == 4
    assert all("geom 'second/texel" in each and "move that array aside" in each for each in said)


def exclude(spec):
    spec.add_exclude(bodyname1="finger", bodyname2="ball")


def lift_masks(spec):
    geom = spec.geom("round")
    geom.contype = geom.conaffinity = 0
    spec.add_pair(geomname1="round", geomname2="bone")


@pytest.mark.parametrize(
    ("fault", "settings", "reason"),
    [
        (exclude, {}, "<exclude> names both bodies; remove it"),
        (lift_masks, {}, "no bit of contype and conaffinity is common"),
        (lambda _: None, {"contact": fastmodel.BoxTexels(contype=2, conaffinity=2)}, "no bit of contype"),
    ],
)
def test_objects_that_never_touch_the_array_are_told(fault, settings, reason):
    spec, sensor = scene(**settings)
    spec.worldbody.add_geom(name="floor", type=KINDS.mjGEOM_PLANE, size=[1, 1, 1], pos=[0, 0, -1], contype=3)
    fault(spec)
    model = spec.compile()
    (said,) = sensor.check(model)
    assert said.startswith("array 'sensor' never touches geom 'round' of body 'ball': ")
    assert reason in said
    for geom in range(model.ngeom):  # a pair with every geom of the array is one of the cures
        if model.geom(geom).name.startswith("sensor/"):
            spec.add_pair(geomname1="round", geomname2=model.geom(geom).name)
    assert sensor.check(spec.compile()) == ()


def test_an_array_that_nothing_can_touch_is_told():
    spec, sensor = scene(ball=False)
    assert sensor.check(spec.compile()) == ()  # there is nothing else
    child = spec.body("finger").add_body(name="tip")
    child.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE)
    child.add_geom(name="nail", type=KINDS.mjGEOM_SPHERE, size=[5e-3, 0, 0], pos=[0, 0, 0.02], mass=0.1)
    (said,) = sensor.check(spec.compile())
    assert said.startswith("nothing in this model can touch array 'sensor' (geom 'nail' of body 'tip': MuJoCo lets no")
    assert 'filterparent="disable"' in said
    spec.option.disableflags = DISABLE.mjDSBL_FILTERPARENT
    assert sensor.check(spec.compile()) == ()


def gripper(**settings):
    """Two fingers whose arrays face one another."""
    spec, left = scene(**settings)
    other = add_body(spec, "sphere", [5e-3], [0, 0, 0.02], slides="z", name="other", quat=[0, 1, 0, 0], mass=0.1)
    other.geoms[0].pos = [0, 0, -0.02]
    return spec, left, fastmodel.attach(spec, "other", SMALL, name="right", **settings)


def test_facing_arrays_are_told_only_if_they_pass_through_one_another():
    spec, left, right = gripper(contact="boxes")
    assert left.check(spec.compile()) == right.check(spec.compile()) == ()
    spec.add_exclude(bodyname1="finger", bodyname2="other")
    model = spec.compile()
    assert any("arrays 'sensor' and 'right' face one another but never touch" in each for each in left.check(model))
    assert any("arrays 'right' and 'sensor' face one another but never touch" in each for each in right.check(model))
    masked = fastmodel.Foundation(modulus=1e9, plate=Plate(contype=1, conaffinity=2))
    spec, left, _ = gripper(contact=masked)
    assert any("face one another but never touch: no bit" in each for each in left.check(spec.compile()))


def run_asleep(**sleep):
    """Force of a ball at rest on an array of the world after half a second and after three, with sleeping enabled."""
    spec, sensor = scene(finger="world")
    spec.body("ball").pos = [0, 0, 5e-3]
    spec.option.enableflags = ENABLE.mjENBL_SLEEP
    for name, policy in sleep.items():
        spec.body(name).sleep = policy
    model, data = simulate(spec, sensor, 0)
    forces = []
    for _ in range(500):
        run(sensor, model, data, 1)
        forces.append(sensor.carried())
    return forces, sensor.check(model)


def test_an_array_keeps_its_last_reading_while_all_that_pressed_on_it_sleeps():
    forces, said = run_asleep()
    assert forces[-1] == pytest.approx(0.981, rel=5e-3)
    assert forces[-1] == forces[-50]  # asleep
    assert len(said) == 1
    assert "an object that sleeps beside one that is awake is not felt" in said[0]
    never = mujoco.mjtSleepPolicy.mjSLEEP_NEVER
    forces, said = run_asleep(ball=never, finger=never)
    assert forces[-1] == pytest.approx(0.981, rel=1e-3)
    assert said == ()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"cone": mujoco.mjtCone.mjCONE_PYRAMIDAL}, "recommend_options"),
        ({"solver": mujoco.mjtSolver.mjSOL_PGS}, "recommend_options"),
        ({"impratio": 0.5}, "creep with impratio 0.5"),
        ({"iterations": 5}, "after 5 iterations with 50 of the line search.*iterations = 100"),
        ({"ls_iterations": 5}, "after 100 iterations with 5 of the line search"),
        ({"timestep": 1e-2}, r"timestep of 0\.01 s"),
        ({"disableflags": DISABLE.mjDSBL_CONTACT}, 'measures nothing.*<flag contact="disable"/>'),
        ({"disableflags": DISABLE.mjDSBL_CONSTRAINT}, "measures nothing"),
        ({"enableflags": ENABLE.mjENBL_OVERRIDE}, 'o_solref.*remove <flag override="enable"/>'),
    ],
)
def test_options_that_cost_accuracy_are_told(options, sentence):
    spec, sensor = scene()
    assert sensor.check(spec.compile()) == ()
    for name, value in options.items():
        setattr(spec.option, name, value)
    with pytest.warns(OptionWarning) as given:
        sensor.bind(spec.compile())
    assert any(re.search(sentence, str(each.message)) for each in given)


@pytest.mark.parametrize("flag", [DISABLE.mjDSBL_MULTICCD, DISABLE.mjDSBL_NATIVECCD])
def test_collision_flags_are_told_only_where_meshes_can_touch(flag):
    spec, sensor = scene()
    spec.option.disableflags = flag
    assert sensor.check(spec.compile()) == ()
    spec.add_mesh(name="cube", uservert=[0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1])
    spec.body("ball").add_geom(type=KINDS.mjGEOM_MESH, meshname="cube")
    (said,) = sensor.check(spec.compile())
    assert 'multiccd="disable"' in said


def test_a_copy_with_a_prefix_is_checked_under_its_names():
    child, sensor = scene(ball=False, pad=0.0)
    parent = mujoco.MjSpec()
    fastmodel.recommend_options(parent)
    parent.option.timestep = 1e-3
    parent.attach(child, prefix="l_", suffix="_1", frame=parent.worldbody.add_frame())
    model = parent.compile()
    (said,) = sensor.twin(prefix="l_", suffix="_1").check(model)
    assert "geom 'l_pad_1' of body 'l_finger_1' lies flush with the top of array 'l_sensor_1'" in said
    with pytest.raises(LifeCycleError, match=r"'sensor' is not in this model.*bind\(model, prefix='l_', suffix='_1'\)"):
        sensor.check(model)


@pytest.mark.parametrize("method", ["boxes", "foundation", "cover"])
def test_a_gaussian_that_contradicts_the_calibration_is_told(method):
    """Under a force on one texel's centre the built-in Gaussian leaves 0.574 of it, the calibration tip 0.765."""
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    built_in = fastmodel.load("wts-0614-34")
    sensor = fastmodel.attach(spec, "world", built_in, name="given", contact=method)
    said = [each for each in sensor.check(spec.compile()) if "single texels" in each]
    if method != "boxes":
        assert said == []
        return
    assert said[0].startswith("forces on single texels are measured 25 % too low: ")
    with pytest.warns(OptionWarning, match="25 % too low"):
        sensor.bind(spec.compile())
    forces = np.where(np.arange(84) == 32, 1.0, 0.0)
    sensor.reset(forces)
    assert sensor.frame().texel_forces[32] / built_in.electronics.tip_share == pytest.approx(0.75, abs=0.005)
    sharp = dataclasses.replace(built_in, spread=fastmodel.Gaussian.from_sigma(0.43))
    other = fastmodel.attach(spec, "world", sharp, name="sharp", position=[1, 0, 0], contact=method)
    assert not any("single texels" in each for each in other.check(spec.compile()))
