"""Arrays in scenes of other people: only what is in front of an array loads its texels, and every force is counted."""

import dataclasses
import functools
import pathlib

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel.errors import LifeCycleError
from meshes import TexelArray
from tests.support.contact_forces import measure_force
from tests.support.cover_data import parameters
from tests.support.scenes import add_body, make_spec, run, simulate

METHODS = ("boxes", "foundation", "cover")

#: The default contact method, and the others in the slow tier.
COVER_FIRST = [pytest.param(each, marks=() if each == "cover" else pytest.mark.slow) for each in METHODS]
PARAMETERS = parameters()
BOX, SPHERE, CAPSULE, PLANE = (
    getattr(mujoco.mjtGeom, f"mjGEOM_{name}") for name in ("BOX", "SPHERE", "CAPSULE", "PLANE")
)
#: Settings of a body of 3 N on a slide along the normal.
GUIDED = {"slides": "z", "damping": 2.0, "mass": 3 / 9.81}
#: Half lengths of the part that stands on the array [m].
PRESSED = [8e-3, 5e-3, 1e-3]


def tube(radius, count=24, half_length=30e-3, thickness=1.5e-3):
    """Walls of a tube along x whose lowest point touches z = 0; the first wall is the one on the array."""
    width = radius * np.tan(np.pi / count)
    for k in range(count):
        turn = 2 * np.pi * k / count
        middle = (radius + thickness) * np.array([0, np.sin(turn), np.cos(turn)]) - [0, 0, radius]
        yield {"type": BOX, "size": [half_length, width, thickness], "pos": middle, "euler": [-turn, 0, 0]}


def box(size, pos):
    return {"type": BOX, "size": size, "pos": pos}


def split(walls, front):
    """Divide the walls of a tube into those in front of the array and the others."""
    walls = list(walls)
    return [each for each in walls if each["pos"][2] > front], [each for each in walls if each["pos"][2] <= front]


#: Geoms of a body that stands on the array at z = 0: those in front of the array, and those that reach round it.
SCENES = {
    "mug": split(tube(40e-3), -10e-3),
    "ring": split(tube(30e-3, half_length=4e-3), -10e-3),
    "tube": split(tube(25e-3, half_length=60e-3), -10e-3),
    "pad in a mug": ([box(PRESSED, [0, 0, 1e-3])], list(tube(40e-3, half_length=40e-3))[3:-2]),
    "hook": (
        [box(PRESSED, [0, 0, 1e-3])],
        [box([1e-3, 5e-3, 20e-3], [20e-3, 0, -18e-3]), box([12e-3, 5e-3, 1e-3], [9e-3, 0, -39e-3])],
    ),
    "handle": (
        [box(PRESSED, [0, 0, 1e-3])],
        [
            {"type": CAPSULE, "size": [4e-3, 60e-3, 0], "pos": [0, 0, -30e-3], "euler": [0, np.pi / 2, 0]},
            box([2e-3, 4e-3, 16e-3], [50e-3, 0, -15e-3]),
        ],
    ),
    "rail": ([{"type": SPHERE, "size": [5e-3, 0, 0], "pos": [0, 0, 5e-3]}], [box([0.5, 5e-3, 5e-3], [0, 0, -50e-3])]),
    "wall beside": ([box(PRESSED, [0, 0, 1e-3])], [box([2e-3, 0.1, 0.1], [15.75e-3 - 0.7e-3, 0, 0])]),
}
#: A pad of 4 x 4 texels fits into tubes.
PAD = dataclasses.replace(PARAMETERS, array=TexelArray.grid(4, 4, PARAMETERS.array.pitch), tables={})


def press(method, geoms, load=3.0, steps=200):
    """Let a guided body of some geoms, of which the first has the mass, rest on the array."""
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", PAD, contact=method, every=1)
    body = spec.worldbody.add_body(name="object", pos=[0.7e-3, -1.1e-3, 0])
    body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1], damping=2.0)
    for k, geom in enumerate(geoms):
        body.add_geom(mass=0.0 if k else load / 9.81, **geom)
    model, data = simulate(spec, [sensor], steps)
    return sensor, model, data


@pytest.mark.parametrize(
    ("name", "method"),
    [
        pytest.param(name, method, marks=pytest.mark.slow if method in rare and name not in few else ())
        for few, rare in [(("pad in a mug", "rail"), ("foundation",))]
        for name in SCENES
        for method in METHODS
    ],
)
def test_what_reaches_round_the_array_loads_no_texel(name, method):
    near, far = SCENES[name]
    whole, model, data = press(method, near + far)
    part, _, _ = press(method, near)
    np.testing.assert_allclose(whole.contact_forces(), part.contact_forces(), atol=2e-3 * 3.0)
    assert ((whole.contact_forces() > 0.02) == (part.contact_forces() > 0.02)).all()
    assert whole.carried() == pytest.approx(measure_force(model, data), rel=1e-5)
    assert whole.carried() == pytest.approx(3.0, rel=2e-2)


BEHIND = {
    "nothing": None,
    "rail": box([0.5, 20e-3, 5e-3], [0, 0, -55e-3]),
    "table": box([0.5, 0.5, 20e-3], [0, 0, -70e-3]),
    "floor": {"type": PLANE, "size": [1, 1, 1], "pos": [0, 0, -50e-3], "quat": [1, 0.02, 0, 0]},
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("behind", BEHIND.values(), ids=BEHIND)
def test_fixed_geoms_behind_a_hand_load_no_texel(behind, method):
    """The hand presses upwards on a fixed bar; all fixed geoms are one body."""
    spec = make_spec(gravity=[0, 0, 0])
    hand = add_body(spec, "box", [5e-3] * 3, slides="z", damping=2.0, mass=0.3)
    hand.geoms[0].pos = [0, 0, -20e-3]
    sensor = fastmodel.attach(spec, hand, PAD, contact=method, every=1)
    spec.worldbody.add_geom(**box([5.5e-3, 3.0e-3, 2e-3], [0, 0, 2e-3]))
    if behind is not None:
        spec.worldbody.add_geom(**behind)

    def push(data):
        data.qfrc_applied[0] = 5.0

    model, data = simulate(spec, [sensor], 200, push)
    image = PAD.array.image(sensor.contact_forces())
    assert image[1:3].sum() == pytest.approx(5.0, rel=1e-2)
    assert image[[0, 3]].max() < 0.02
    assert sensor.carried() == pytest.approx(measure_force(model, data), rel=1e-5)


def build_flex(count=4, edge=8e-3):
    """A soft cube above the pad, from MuJoCo's own generator."""
    return mujoco.MjSpec.from_string(f"""
    <mujoco><option timestep="1e-3" cone="elliptic" solver="Newton" impratio="10"/>
      <worldbody>
        <body name="pad"/>
        <flexcomp name="soft" type="grid" count="{count} {count} {count}" dim="3" pos="0.7e-3 -1.1e-3 {edge / 2 + 1e-3}"
          spacing="{edge / (count - 1)} {edge / (count - 1)} {edge / (count - 1)}" radius="0.5e-3" mass="0.3">
          <contact selfcollide="none"/>
          <edge equality="true"/>
        </flexcomp>
        <geom name="far away" type="sphere" size="0.01" pos="0 0 1"/>
      </worldbody></mujoco>""")


@pytest.mark.slow
@pytest.mark.parametrize("method", COVER_FIRST)
def test_a_soft_body_is_laid_out_at_its_contact_points(method):
    spec = build_flex()
    sensor = fastmodel.attach(spec, "pad", PARAMETERS, contact=method, every=1)
    model, data = simulate(spec, [sensor], 300)
    force = measure_force(model, data)
    assert force == pytest.approx(0.3 * 9.81, rel=0.1)
    assert sensor.carried() == pytest.approx(force, rel=1e-5)
    # MuJoCo finds some contacts with the edges between boxes
    assert sensor.contact_forces().sum() == pytest.approx(force, rel=1e-2 if method == "boxes" else 1e-9)
    centre = sensor.contact_forces() @ PARAMETERS.array.centres[:, :2] / force
    points, weights = list_points(model, data)
    np.testing.assert_allclose(centre, weights @ points[:, :2] / weights.sum(), atol=2e-3)
    beside = np.abs(PARAMETERS.array.centres[:, :2] - [0.7e-3, -1.1e-3]).max(axis=1) > 8e-3 + 3.4e-3
    assert sensor.contact_forces()[beside].max() == 0


@pytest.mark.parametrize(("height", "warned"), [(2e-3, True), (10e-3, False)])
def test_a_thin_plate_under_a_soft_body_is_warned_of(height, warned):
    spec = build_flex()
    sensor = fastmodel.attach(spec, "pad", PARAMETERS, contact=fastmodel.BoxTexels(height=height))
    said = sensor.check(spec.compile())
    assert any("soft bodies (flexes) may pass through" in each for each in said) == warned


def list_points(model, data):
    """Positions of all contacts with the array, and their forces along z."""
    force, points, weights = np.zeros(6), [], []
    for k, contact in enumerate(data.contact):
        mujoco.mj_contactForce(model, data, k, force)
        points.append(contact.pos.copy())
        weights.append(abs((contact.frame.reshape(3, 3).T @ force[:3])[2]))
    return np.array(points), np.array(weights)


@pytest.mark.parametrize("method", METHODS)
def test_a_height_field_is_laid_out_at_its_contact_points(method):
    """A hand lies face down on hills."""
    spec = make_spec()
    heights = np.zeros((21, 21))
    heights[10, 10] = 1.0
    spec.add_hfield(name="hills", nrow=21, ncol=21, size=[0.05, 0.05, 5e-3, 1e-3], userdata=heights.ravel())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="hills")
    hand = add_body(spec, "box", [5e-3] * 3, [0, 0, 6e-3], slides="z", damping=2.0, mass=0.3)
    hand.geoms[0].pos = [0, 0, 20e-3]
    sensor = fastmodel.attach(spec, hand, PAD, contact=method, every=1, quaternion=[0, 1, 0, 0])
    model, data = simulate(spec, [sensor], 300)
    assert sensor.carried() == pytest.approx(-measure_force(model, data), rel=1e-5)
    assert sensor.carried() == pytest.approx(0.3 * 9.81, rel=1e-2)
    image = PAD.array.image(sensor.contact_forces())
    assert image[1:3, 1:3].sum() == pytest.approx(sensor.contact_forces().sum())
    assert image.sum() == pytest.approx(0.3 * 9.81, rel=1e-2)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("contype", "conaffinity"), [(1, 1), (0, 1), (1, 0), (4, 0), (0, 8), (1 << 30, 0)])
def test_every_geom_that_collides_meets_the_array(contype, conaffinity, method):
    geom = {"type": SPHERE, "size": [5e-3, 0, 0], "pos": [0, 0, 5e-3], "contype": contype, "conaffinity": conaffinity}
    sensor, _, _ = press(method, [geom])
    assert sensor.contact_forces().sum() == pytest.approx(3.0, rel=1e-2)


@pytest.mark.parametrize("method", METHODS)
def test_a_geom_that_never_collides_meets_the_array_as_an_explicit_pair(method):
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", PAD, contact=method, every=1)
    ball = add_body(spec, "sphere", [5e-3], [0, 0, 5e-3], **GUIDED, contype=0, conaffinity=0)
    ball.geoms[0].name = "ball"
    for geom in [each.name for each in spec.geoms if each.name.startswith("sensor/")]:
        spec.add_pair(geomname1="ball", geomname2=geom, condim=3)
    simulate(spec, [sensor], 250)
    assert sensor.contact_forces().sum() == pytest.approx(3.0, rel=1e-2)


def build_excluded_part(method):
    """An object with a lower part that is excluded from contact with the hand."""
    spec = make_spec()
    hand = spec.worldbody.add_body(name="hand")
    sensor = fastmodel.attach(spec, hand, PAD, contact=method, every=1)
    body = add_body(spec, "box", [3e-3, 3e-3, 5e-3], [0, 0, 5e-3], **GUIDED)
    body.geoms[0].pos = [3.4e-3, 0, 0]
    add_body(spec, "box", [3e-3, 3e-3, 5e-3], [-3.4e-3, 0, -1e-3], parent=body, name="ghost", mass=0)
    spec.add_exclude(bodyname1="ghost", bodyname2="hand")
    return spec, sensor


@pytest.mark.parametrize("method", METHODS)
def test_a_part_that_is_excluded_from_contact_loads_nothing_until_the_exclusion_ends(method):
    spec, sensor = build_excluded_part(method)
    model, data = simulate(spec, [sensor], 250)
    image = PAD.array.image(sensor.contact_forces())
    assert image[:, 2:].sum() == pytest.approx(3.0, rel=1e-2)
    assert image[:, :2].max() == 0
    model.exclude_signature[:] = 0
    run(sensor, model, data, 250)
    image = PAD.array.image(sensor.contact_forces())
    assert image[:, :2].sum() == pytest.approx(3.0, rel=1e-2)
    assert image[:, 2:].max() == 0


@pytest.mark.parametrize("method", METHODS)
def test_friction_that_pulls_at_a_side_counts_with_its_sign(method):
    """A finger rubs upwards along the side of the array while a ball rests on it."""
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", PAD, contact=method, every=1)
    add_body(spec, "sphere", [5e-3], [0, 0, 5e-3], **GUIDED)
    edge = PAD.array.centres[:, 0].max() + PAD.array.pitch[0] * (1.5 if method in ("cover", "foundation") else 0.5)
    rough = {"mass": 0.2, "friction": [1.0, 0, 0], "damping": 2.0}
    add_body(spec, "sphere", [5e-3], [edge + 5e-3, 0, -1e-3], slides="xz", **rough).gravcomp = 1.0

    def push(data):
        data.qfrc_applied[1:] = [-4.0, 1.0]

    model, data = simulate(spec, [sensor], 250, push)
    force = measure_force(model, data)
    assert force == pytest.approx(2.0, rel=0.05)
    assert sensor.carried() == pytest.approx(force, rel=1e-5)
    assert sensor.contact_forces().sum() == pytest.approx(3.0, rel=1e-2)
    assert sensor.contact_forces().min() >= 0


@pytest.mark.parametrize("method", METHODS)
def test_changes_after_bind_are_followed(method):
    block = box([3e-3, 3e-3, 3e-3], [0, 0, 3e-3])
    sensor, model, data = press(method, [block])
    few = np.count_nonzero(sensor.contact_forces() > 1e-6)
    model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    number = next(g for g in range(model.ngeom) if not model.geom(g).name)
    model.geom_size[number, :2] = 5.5e-3
    model.geom_aabb[number, 3:5] = 5.5e-3
    model.geom_rbound[number] = 10e-3
    run(sensor, model, data, 250)
    assert sensor.carried() == pytest.approx(measure_force(model, data), rel=1e-5)
    assert sensor.contact_forces().sum() == pytest.approx(3.0, rel=1e-2)
    assert np.count_nonzero(sensor.contact_forces() > 1e-6) > few
    model.geom("sensor/texel0" if method == "boxes" else "sensor/plate").size[0] *= 2
    mujoco.mj_step(model, data)
    with pytest.raises(LifeCycleError, match="attach it anew"):
        sensor.step(data)


@functools.cache
def load_fields():
    """Load MuJoCo's plugin of signed distance fields, once in a process."""
    library = pathlib.Path(mujoco.__file__).parent / "plugin" / "libsdf_plugin.so"
    if not library.exists():
        pytest.skip(f"no {library.name} with this MuJoCo")
    mujoco.mj_loadPluginLibrary(str(library))


@pytest.mark.slow
@pytest.mark.parametrize("method", COVER_FIRST)
def test_a_signed_distance_field_is_laid_out_at_its_contact_points(method):
    """A torus from MuJoCo's own plugin lies on the array: a ring of texels, and nothing in its hole."""
    load_fields()
    spec = mujoco.MjSpec.from_string("""
    <mujoco><option timestep="1e-3" cone="elliptic" sdf_iterations="20" sdf_initpoints="40"/>
      <extension><plugin plugin="mujoco.sdf.torus"><instance name="torus">
        <config key="radius1" value="0.008"/><config key="radius2" value="0.002"/></instance></plugin></extension>
      <asset><mesh name="torus"><plugin instance="torus"/></mesh></asset>
      <worldbody><body name="pad"/><body name="ring" pos="0 0 0.0022"><joint type="slide" axis="0 0 1" damping="2"/>
        <geom type="sdf" mesh="torus" mass="0.3"><plugin instance="torus"/></geom></body></worldbody></mujoco>""")
    sensor = fastmodel.attach(spec, "pad", PARAMETERS, contact=method, every=1)
    model, data = simulate(spec, [sensor], 200)
    assert sensor.carried() == pytest.approx(measure_force(model, data), rel=1e-5)
    assert sensor.carried() == pytest.approx(0.3 * 9.81, rel=0.1)
    centres = PARAMETERS.array.centres[sensor.contact_forces() > 1e-3, :2]
    assert len(centres) > 3
    assert np.abs(np.hypot(*centres.T) - 8e-3).max() < 2e-3 + 1.5 * max(PARAMETERS.array.pitch)
