"""Curved covers in MuJoCo against presses without a simulation."""

from __future__ import annotations

import dataclasses
import hashlib
import re

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

import fastmodel
import meshes
from fastmodel.contact.mesh import MeshReader, list_hulls
from fastmodel.contact.points import pose_indenter, press_points, solve_pressure
from fastmodel.errors import FastModelError, ParametersError
from fastmodel.pressure.solvers import Load
from meshes import Sphere
from meshes.bounded_file import pack_npz
from meshes.pose import Pose
from tests.support.contact_forces import sum_pushes
from tests.support.cover_data import dome_parameters, make_dome, make_half_space
from tests.support.quaternions import rotate
from tests.support.scenes import add_body, make_spec, run, simulate

LOAD = 0.5
UP = Pose.facing([0, 0, 0.1], [0, 0, -1])
QUATERNION = np.array([0.9, 0.1, 0.3, 0.2]) / np.linalg.norm([0.9, 0.1, 0.3, 0.2])
PLACE = np.array([0.1, 0, 0.2])


COVER = make_dome()


@pytest.fixture
def parameters():
    return dome_parameters(COVER)


def press_ball(parameters, direction, *, joint="slide", steps=800, **options):
    """A ball on a guide presses a turned array on a finger; returns the bound sensor, the model and its data."""
    spec = make_spec()
    finger = spec.worldbody.add_body(name="finger", pos=PLACE, quat=QUATERNION)
    finger.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[7e-3, 0, 0])
    sensor = fastmodel.attach(spec, "finger", parameters, **options)
    along = rotate(QUATERNION, direction[None])[0]
    ball = spec.worldbody.add_body(name="ball", pos=PLACE - 14.5e-3 * along)
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[4e-3, 0, 0], mass=0.05, condim=1)
    if joint == "slide":
        ball.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=along)
    else:  # an arm across the direction, 0.1 m long
        across = np.cross(along, [0.3, 0.5, -0.2])
        across /= np.linalg.norm(across)
        axis = np.cross(along, across)
        ball.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, pos=0.1 * across)
    spec.option.gravity[:] = along * LOAD / 0.05
    return sensor, *simulate(spec, sensor, steps)


def test_a_bench_test_equals_the_press_without_simulation(parameters):
    found = fastmodel.indent(parameters, Sphere(radius=4e-3), load=LOAD, at=(1e-3, 0.4e-3))
    known = press_points(COVER, Sphere(radius=4e-3), Pose.facing([1e-3, 0.4e-3, 0.1], [0, 0, -1]), load=LOAD)
    assert found.method == "curved"
    assert found.total_force == pytest.approx(LOAD, rel=1e-3)
    np.testing.assert_allclose(found.texel_forces, known.texel_forces, atol=1e-3 * LOAD)


def test_rounding_does_not_choose_where_a_flat_face_is_solved():
    """A face reaches all points of a plane at once; heights that differ by rounding must not move its cells."""
    x, y = (each.ravel() for each in np.meshgrid(*[np.linspace(-6e-3, 6e-3, 17)] * 2))
    up = np.tile([0.0, 0.0, 1.0], (len(x), 1))
    box, pose = meshes.Box(size=(5e-3, 7e-3, 3e-3)), Pose.facing([0.31e-3, -0.47e-3, 0.1], [0, 0, -1])
    found = []
    for seed in range(4):
        heights = seed * 1e-15 * np.random.default_rng(seed).standard_normal(len(x))
        points = np.stack([x, y, heights], axis=1)
        found.append(press_points(make_half_space(points, up), box, pose, load=LOAD).texel_forces)
    assert found[0].sum() == pytest.approx(0.8 * LOAD, rel=1e-3)
    np.testing.assert_allclose(found, np.tile(found[0], (4, 1)), atol=1e-9)


def test_a_press_along_a_direction_is_the_same_verb(parameters):
    direction = np.array([-0.25, 0.1, -1.0])
    pose = Pose.facing(-20e-3 * direction, direction)
    found = fastmodel.indent(parameters, Sphere(radius=4e-3), load=LOAD, pose=pose)
    known = press_points(COVER, Sphere(radius=4e-3), pose, load=LOAD)
    np.testing.assert_array_equal(found.texel_forces, known.texel_forces)
    np.testing.assert_allclose(found.force @ direction / np.linalg.norm(direction), LOAD, rtol=1e-6)
    assert found.contact_forces.sum() == pytest.approx(known.pressure.forces.sum())
    assert found.depth > 0
    with pytest.raises(FastModelError, match="does not suit this cover; accepted: curved"):
        fastmodel.indent(parameters, Sphere(radius=4e-3), load=LOAD, pose=pose, contact="boxes")
    flat = dataclasses.replace(parameters, surface=None)
    with pytest.raises(FastModelError, match="along the normal"):
        fastmodel.indent(flat, Sphere(radius=4e-3), load=LOAD, pose=pose, contact="boxes")


@pytest.mark.parametrize("joint", [pytest.param("slide", marks=pytest.mark.slow), "hinge"])
def test_an_array_on_a_turned_finger_feels_the_press_of_its_own_frame(parameters, joint):
    direction = np.array([-0.25, 0.1, -1.0])
    direction /= np.linalg.norm(direction)
    sensor, *_ = press_ball(parameters, direction, joint=joint)
    pose = Pose.facing(-20e-3 * direction, direction)
    known = press_points(COVER, Sphere(radius=4e-3), pose, load=LOAD)
    # A guide gives the direction of the force; without one, it is the normal of a facet of the hull, some degrees off.
    atol = {"slide": 5e-3, "hinge": 4e-2}[joint] * LOAD
    np.testing.assert_allclose(sensor.frame().texel_forces, known.texel_forces, atol=atol)
    assert sensor.carried() == pytest.approx(LOAD, rel=5e-3)
    assert sensor.contact_forces().sum() == pytest.approx(known.pressure.forces.sum(), rel=5e-3)


def test_a_stored_state_continues_bit_for_bit(parameters):
    sensor, model, data = press_ball(parameters, np.array([0, 0, -1.0]), steps=60)
    state = sensor.get_state()
    other = sensor.twin().bind(model)
    copied = mujoco.MjData(model)
    mujoco.mj_copyData(copied, model, data)
    other.step(copied)
    other.set_state(state)
    for each, own in ((sensor, data), (other, copied)):
        run(each, model, own, 40)
    np.testing.assert_array_equal(other.frame().texel_forces, sensor.frame().texel_forces)
    assert sensor.frame().texel_forces.sum() > 0.1 * LOAD


def test_a_finger_that_stands_on_the_floor_feels_its_weight(parameters):
    """A plane has no end."""
    spec = make_spec()
    finger = spec.worldbody.add_body(name="finger", pos=[0, 0, 10.2e-3], quat=[0, 1, 0, 0])
    finger.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[7e-3, 0, 0], mass=0.05, contype=0, conaffinity=0)
    finger.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], condim=1)
    sensor = fastmodel.attach(spec, "finger", parameters)
    simulate(spec, sensor, 600)
    assert sensor.carried() == pytest.approx(0.05 * 9.81, rel=1e-2)
    assert sensor.frame().texel_forces.sum() == pytest.approx(0.8 * sensor.carried(), rel=0.02)


def test_a_body_without_a_convex_shape_presses_with_its_contact_points(parameters):
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", parameters)
    plate = spec.worldbody.add_body(name="plate", pos=[0, 0, 12.2e-3], quat=[0, 1, 0, 0])
    spec.add_hfield(name="field", nrow=2, ncol=2, size=[10e-3, 10e-3, 1e-3, 1e-3], userdata=[1.0] * 4)
    plate.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="field", mass=0.05, condim=1)
    plate.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    plate.mass, plate.explicitinertial = LOAD / 9.81, True
    plate.inertia[:] = 1e-6
    simulate(spec, sensor, 600)
    assert sensor.carried() == pytest.approx(LOAD, rel=0.02)
    assert sensor.frame().texel_forces.sum() == pytest.approx(0.8 * LOAD, rel=0.03)


def test_of_a_clamp_that_holds_the_cover_only_the_jaw_on_its_front_presses(parameters):
    spec = make_spec(gravity=[0, 0, 0])
    sensor = fastmodel.attach(spec, "world", parameters)
    clamp = add_body(spec, "sphere", [4e-3], [0, 0, 13.9e-3], slides="z", mass=0.5)
    clamp.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[4e-3, 0, 0], pos=[0, 0, -12.6e-3])
    model, data = simulate(spec, sensor, 200)
    squeeze = sum_pushes(model, data) / 2
    assert squeeze > 0.1
    assert sensor.carried() == pytest.approx(squeeze, rel=1e-3)


def test_a_geom_at_the_top_is_named(parameters):
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(name="bone", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[9.8e-3, 0, 0])
    sensor = fastmodel.attach(spec, "world", parameters)
    model = spec.compile()
    assert any("'bone'" in each and "0.20 mm below" in each for each in sensor.check(model))


def test_parameters_keep_the_cover(parameters, tmp_path):
    parameters.save(tmp_path)
    found = fastmodel.load(tmp_path).surface
    for name in ("points", "normals", "facets", "shares", "influence", "remainder", "layer", "heights"):
        np.testing.assert_allclose(getattr(found, name), getattr(COVER, name), rtol=1e-6, atol=1e-12)


def test_parameters_of_another_version_are_derived_anew(parameters, tmp_path):
    parameters.save(tmp_path)
    packed, text = tmp_path / "cover.npz", (tmp_path / "parameters.toml").read_text()
    tables = dict(np.load(packed))
    del tables["curved_facets"], tables["curved_layer"]
    packed.write_bytes(pack_npz(tables))
    changed = re.sub('sha256 = "[0-9a-f]+"', f'sha256 = "{hashlib.sha256(packed.read_bytes()).hexdigest()}"', text)
    (tmp_path / "parameters.toml").write_text(changed)
    with pytest.raises(ParametersError, match=r"\[curved\] cover.npz holds no facets, layer; derive .* anew"):
        fastmodel.load(tmp_path)


def make_saddle(radius):
    """A half space over the points of the dome on a saddle z = (x^2 - y^2) / (2 radius)."""
    x, y = COVER.points[:, 0], COVER.points[:, 1]
    points = np.column_stack([x, y, 10e-3 + (x**2 - y**2) / (2 * radius)])
    normals = np.column_stack([-x / radius, y / radius, np.ones(len(x))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return make_half_space(points, normals)


def test_a_body_reaches_the_middle_of_a_saddle(parameters):
    """MuJoCo collides convex hulls; that of the whole saddle lies far above its middle."""
    saddle = make_saddle(8e-3)
    middle = np.linalg.norm(saddle.points[:, :2], axis=1).argmin()
    whole = ConvexHull(saddle.points).equations
    assert -(whole[:, :3] @ saddle.points[middle] + whole[:, 3]).max() > 0.5e-3
    hulls = list_hulls(saddle)
    assert len(hulls) > 1
    planes = [ConvexHull(hull).equations for hull in hulls]
    inside = np.array([-(saddle.points @ each[:, :3].T + each[:, 3]).max(axis=1) for each in planes])
    assert inside.max() < 0.2 * saddle.thickness  # no part reaches far above a point
    assert (inside > -1e-9).any(axis=0).all()  # every point belongs to a part
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", dataclasses.replace(parameters, surface=saddle))
    ball = spec.worldbody.add_body(name="ball", pos=[0, 0, 13.5e-3])
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[3e-3, 0, 0], mass=0.03)
    ball.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    model, data = simulate(spec, sensor, 600)
    assert sum(model.geom(each).name.startswith("sensor/plate") for each in range(model.ngeom)) >= len(hulls) - 1
    assert sensor.carried() == pytest.approx(0.03 * 9.81, rel=1e-2)
    assert 9.6e-3 < data.body("ball").xpos[2] - 3e-3 < 10.0e-3 + 0.1 * saddle.thickness


def test_few_contacts_are_read_before_the_first_touch_of_a_cover_of_several_hulls(parameters, monkeypatch):
    """Where hulls overlap, a body always has several contacts; each is solved for, which takes long."""
    saddle, read, counts = make_saddle(8e-3), MeshReader.read, []
    monkeypatch.setattr("fastmodel.contact.interface._COMPILED", set())
    monkeypatch.setattr(MeshReader, "read", lambda self, data: counts.append(data.ncon) or read(self, data))
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", dataclasses.replace(parameters, surface=saddle))
    sensor.bind(spec.compile())
    assert counts[-1] == 1 < counts[-2]
    assert np.count_nonzero(counts) < 10


def test_texels_of_a_curved_cover_may_share_corners(parameters):
    wide = dataclasses.replace(parameters.array, texel_size=(6e-3, 6e-3), pitch=(6e-3, 6e-3))
    spec = mujoco.MjSpec()
    fastmodel.attach(spec, "world", dataclasses.replace(parameters, array=wide))
    with pytest.raises(fastmodel.FastModelError):
        fastmodel.attach(mujoco.MjSpec(), "world", dataclasses.replace(parameters, array=wide), contact="boxes")


def test_a_free_plate_rests_with_its_weight(parameters):
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", parameters)
    add_body(spec, "box", [5e-3, 5e-3, 2e-3], [0, 0, 12.1e-3], free=True, mass=0.04)
    simulate(spec, sensor, 30)  # before it tips over the dome
    known = press_points(COVER, meshes.Box(size=(10e-3, 10e-3, 4e-3)), UP, load=sensor.carried())
    assert 0.1 < sensor.carried() < 1.0
    np.testing.assert_allclose(sensor.contact_forces().sum(), known.pressure.forces.sum(), rtol=1e-2)


def test_a_cover_with_a_flat_top_is_a_plate_of_its_thickness(parameters):
    cover = parameters.surface
    points = cover.points * [1, 1, 0] + [0, 0, 2e-3]
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    flat = make_half_space(points, normals)
    found = fastmodel.indent(dataclasses.replace(parameters, surface=flat), Sphere(radius=5e-3), load=0.2)
    pressed = press_points(flat, Sphere(radius=5e-3), Pose.facing([0, 0, 5e-3], [0, 0, -1]), load=0.2)
    np.testing.assert_allclose(found.texel_forces, pressed.texel_forces, atol=2e-3 * pressed.texel_forces.max())


def test_a_body_beside_the_cover_leaves_the_forces_of_another_one():
    def load(vector):
        return Load.along_free_directions(vector, np.zeros(3), np.zeros((0, 3)), rotates=False)

    ball = pose_indenter(Sphere(radius=5e-3), Pose.facing([0, 0, 10e-3], [0, 0, -1]))
    pin = pose_indenter(Sphere(radius=0.2e-3), Pose.facing([9e-3, 0, 8e-3], [0, 0, -1]))
    (alone,) = solve_pressure(COVER, [ball], [load(np.array([0, 0, LOAD]))])
    missed, both = solve_pressure(COVER, [pin, ball], [load(np.array([0, 0, 0.1])), load(np.array([0, 0, LOAD]))])
    assert missed is None
    assert both.settled
    np.testing.assert_allclose(both.footprint.middle, alone.footprint.middle, atol=2e-6)
