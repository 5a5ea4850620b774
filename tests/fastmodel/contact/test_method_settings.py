"""Settings of the contact methods, points on their tops, hulls of curved covers, joints, and shapes that change."""

import dataclasses

import mujoco
import numpy as np
import pytest

from fastmodel import BoxTexels, CoverContact, FastModelError, Foundation, Plate
from fastmodel.contact.bodies import Bodies, Joints, sample_boxes
from fastmodel.contact.forces import BY_GEOM, SHARED, NetForceReader
from fastmodel.contact.interface import Reading
from fastmodel.contact.mesh import MeshContact, list_hulls
from fastmodel.errors import ParametersError
from fastmodel.pressure.cell_grid import divide_into_panels
from meshes import TexelArray
from tests.support.bent_array import bent_array
from tests.support.cover_data import WTS, cells, dome_parameters, make_dome, make_half_space
from tests.support.scenes import add_body, make_spec

OBLONG = TexelArray.grid(2, 3, (2e-3, 5e-3))
DOME = make_dome()
DOME_ARRAY = dome_parameters(DOME).array


@pytest.mark.parametrize(
    ("method", "costly", "spreads", "overlaps"),
    [
        (BoxTexels(), False, False, False),
        (Foundation(), True, True, False),
        (CoverContact(), True, True, False),
        (MeshContact(), True, True, True),
    ],
)
def test_methods_state_what_they_cost_and_compute(method, costly, spreads, overlaps):
    assert (method.costly, method.computes_spread, method.takes_overlaps) == (costly, spreads, overlaps)
    assert method.hold(bent_array(), (9e-3, 9e-3)) is method
    if method.costly is False:
        assert method.adapt(cells()) is method
        assert method.hold(OBLONG, (1.0, 1.0)) is method
    assert method.pressed_points is None


def test_settings_that_nobody_gives_are_the_documented_ones():
    masks = {"contype": 2**31 - 1, "conaffinity": 2**31 - 1}
    assert BoxTexels() == BoxTexels(height=2e-3, **masks)
    assert Plate() == Plate(height=2e-3, margin=None, solref=None, solimp=None, widened=False, **masks)
    assert Foundation() == Foundation(plate=Plate(), modulus=None)
    assert CoverContact() == CoverContact(plate=Plate(), tolerance=2e-3, steps=100)
    assert (MeshContact().contype, MeshContact().conaffinity) == (2**31 - 1, 2**31 - 1)
    with pytest.raises(ValueError, match="contype"):
        MeshContact(contype=-1)
    for given in ({"solref": (0.02, 1.0)}, {"solimp": (0.9, 0.9, 1e-3, 0.5, 2.0)}):
        with pytest.raises(ValueError, match="solref and solimp belong together"):
            Plate(**given)


@pytest.mark.parametrize(
    ("method", "inset"), [(BoxTexels(), 0.0), (Foundation(plate=Plate(margin=(1e-3, 4e-3))), 4e-3)]
)
def test_points_on_a_top_are_half_the_smaller_pitch_apart(method, inset):
    """2 x 5 points on each box of 2 mm x 5 mm; on a plate none lies on its margin, the wider one of which counts."""
    spec = mujoco.MjSpec()
    method.attach(spec.worldbody.add_frame(pos=[0, 0, 0.3]), OBLONG, "pad")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points, normals = method.sample_top(model, data, np.arange(model.ngeom), OBLONG)
    half = np.array([3e-3, 5e-3]) if not inset else np.array([4e-3, 9e-3]) - inset
    counts = (6, 10) if not inset else (1, 10)
    assert len(points) == counts[0] * counts[1]
    for axis in range(2):
        expected = ((np.arange(counts[axis]) + 0.5) / counts[axis] * 2 - 1) * half[axis]
        np.testing.assert_allclose(np.unique(points[:, axis].round(9)), expected, atol=1e-8)
    np.testing.assert_allclose(points[:, 2], 0.3)
    np.testing.assert_allclose(normals, np.tile([0, 0, 1], (len(points), 1)))


def test_a_body_starts_a_pitch_above_the_texels_within_its_reach():
    """The larger pitch; a texel exactly at the reach counts."""
    lifted = dataclasses.replace(OBLONG, centres=OBLONG.centres + np.array([[0, 0, 1e-3 * k] for k in range(6)]))
    at = (0.0, -2.5e-3)
    for reach, height in ((1e-3, 1e-3), (2e-3, 2e-3), (1.9e-3, 1e-3), (5e-3, 4e-3), (0.1, 5e-3)):
        assert BoxTexels().find_start(lifted, at, reach) == pytest.approx(height + 5e-3)
    sunk = dataclasses.replace(lifted, centres=lifted.centres - [0, 0, 1e-2])
    assert BoxTexels().find_start(sunk, at, 0.1) == pytest.approx(5e-3)


def press_ball(method, surface):
    spec = make_spec()
    method.attach(spec.worldbody.add_frame(), WTS, "pad")
    add_body(spec, "sphere", [20e-3], [0.3e-3, 0.2e-3, 19.95e-3], slides="z", mass=0.2, damping=1.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 10)
    return method.bind(model, WTS, "pad", surface=surface).read(data)


@pytest.mark.parametrize("covered", [True, False])
def test_a_foundation_has_the_modulus_of_the_cover_or_of_rubber(covered):
    surface = cells() if covered else None
    modulus = cells().foundation_modulus() if covered else 1e9
    found, given, other = (press_ball(Foundation(modulus=each), surface) for each in (None, modulus, 1.1 * modulus))
    np.testing.assert_array_equal(found.contact_forces, given.contact_forces)
    assert np.abs(found.contact_forces - other.contact_forces).max() > 1e-4
    assert (found.texel_forces is not None) == covered


@pytest.mark.parametrize("plates", [True, False])
@pytest.mark.parametrize("masked", [True, False])
def test_net_force_and_shear_are_given_along_the_axes_of_bent_arrays(plates, masked):
    """Made-up forces on three plates or nine boxes, whose axes are those of the texels."""
    array = dataclasses.replace(bent_array(), active=np.arange(9) != 4) if masked else bent_array()
    spec, random = mujoco.MjSpec(), np.random.default_rng(3)
    method = Plate() if plates else BoxTexels()
    method.attach(spec.worldbody.add_frame(quat=[0.8, 0.4, -0.2, 0.4]), array, "pad")
    model, first = spec.compile(), np.array([1.0, 0, 0])
    axes = np.stack([np.tile(first, (9, 1)), np.cross(array.normals, first), array.normals], axis=2)
    turns = np.array([each.axes for each in divide_into_panels(array, 0)]) if plates else axes
    neighbours = None if plates else np.zeros((9, 4), dtype=bool)
    reader = NetForceReader(
        model, array, np.arange(model.ngeom), axes=turns[0], middle=np.zeros(3), neighbours=neighbours
    )
    fronts, wrench, pressing = random.normal(size=(model.ngeom, 3)), random.normal(size=6), random.uniform(0, 1, 9)
    fronts[:, 2] = -1.0
    given = fronts[:, :2].copy()
    found = reader.add(Reading(pressing, None, 3.0), (np.zeros((1, 2)), fronts, wrench, 0.0))
    shear = np.einsum("pij,pj->i", turns[:, :, :2], given)
    shared = (pressing / max(model.ngeom, pressing.sum()))[:, None] * np.einsum("tij,i->tj", axes[:, :, :2], shear)
    expected = (shared if plates else given) * array.active[:, None]
    np.testing.assert_allclose(found.tangential, expected, atol=1e-7)
    np.testing.assert_array_equal(found.wrench, wrench)
    assert found.tangential_source == (SHARED if plates else BY_GEOM)
    still = reader.add(Reading(pressing, None, 3.0), None)
    forces = -pressing[:, None] * array.normals
    np.testing.assert_allclose(
        still.wrench, np.append(forces.sum(axis=0), np.cross(array.centres, forces).sum(axis=0)), atol=1e-15
    )
    assert not still.tangential.any()
    assert (still.tangential.shape, still.tangential_source) == ((9, 2), found.tangential_source)


def test_the_hull_of_a_round_top_is_that_of_its_points_and_of_a_flat_one_holds_the_base():
    np.testing.assert_array_equal(list_hulls(DOME), [DOME.points])
    flat = make_half_space(DOME.points * [1, 1, 0] + [0, 0, 2e-3], np.tile([0.0, 0, 1], (len(DOME.points), 1)))
    (hull,) = list_hulls(flat)
    np.testing.assert_allclose(hull, np.concatenate([flat.points, flat.points - [0, 0, flat.thickness]]))


def make_waves(depth):
    """Grooves along y, 6 mm apart, with tops at 0; points lie on the tops and in the middle of the grooves."""
    x, y = DOME.points[:, 0], DOME.points[:, 1]
    number = 2 * np.pi / 6e-3
    slope = -depth / 2 * number * np.sin(number * x)
    normals = np.column_stack([-slope, 0 * x, np.ones(len(x))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return make_half_space(np.column_stack([x, y, depth / 2 * (np.cos(number * x) - 1)]), normals)


@pytest.mark.parametrize(("dent", "whole"), [(0.06e-3, True), (0.19e-3, True), (0.21e-3, False), (0.6e-3, False)])
def test_a_top_with_dents_deeper_than_a_tenth_of_its_thickness_is_divided(dent, whole):
    """The top is 2 mm thick; the parts stand in the model by number, and their texels are those of the whole."""
    cover = make_waves(dent)
    hulls = list_hulls(cover)
    assert (len(hulls) == 1) == whole
    spec = mujoco.MjSpec()
    MeshContact(surface=cover, contype=3, conaffinity=5).attach(spec.worldbody.add_frame(), DOME_ARRAY, "pad")
    names = [geom.name for geom in spec.geoms]
    assert names == ["pad/plate", *(f"pad/plate{k}" for k in range(1, len(hulls)))]
    assert {(geom.contype, geom.conaffinity) for geom in spec.geoms} == {(3, 5)}
    if not whole:
        lower = cover.points - cover.thickness * cover.normals
        for hull in hulls:
            top, base = np.split(hull, 2)
            number = np.array([np.linalg.norm(cover.points - each, axis=1).argmin() for each in top])
            np.testing.assert_array_equal(cover.points[number], top)
            np.testing.assert_allclose(base, lower[number])
        shared = np.unique(np.concatenate([hull[: len(hull) // 2] for hull in hulls]), axis=0, return_counts=True)
        assert len(shared[0]) == len(cover.points)
        assert (shared[1] > 1).any()  # the parts overlap


def test_a_curved_method_needs_points_for_its_number_of_texels():
    frame = mujoco.MjSpec().worldbody.add_frame()
    with pytest.raises(ParametersError, match="needs points"):
        MeshContact().attach(frame, DOME_ARRAY, "pad")
    with pytest.raises(FastModelError, match="4 texels; the array has 6"):
        MeshContact(surface=DOME).attach(frame, OBLONG, "pad")
    with pytest.raises(ParametersError, match="needs a curved cover"):
        MeshContact().adapt(cells())
    assert MeshContact(contype=6).adapt(DOME).surface is DOME
    assert MeshContact(contype=6).adapt(DOME).contype == 6
    assert MeshContact().find_start(DOME_ARRAY, (0, 0), 1.0) == pytest.approx(DOME_ARRAY.centres[:, 2].max() + 4e-3)


def build_tree():
    """An array on an arm on a turning base that also carries a tool on a slide; a lid on another slide."""
    spec = mujoco.MjSpec()
    base = spec.worldbody.add_body(name="base")
    arm = base.add_body(name="arm")
    tool = base.add_body(name="tool")
    lid = spec.worldbody.add_body(name="lid")
    joints = {
        "base": (base, "HINGE", [1, 0, 0]),
        "tool": (tool, "SLIDE", [0, 0.6, 0.8]),
        "lid": (lid, "SLIDE", [1, 0, 0]),
    }
    for body, kind, axis in joints.values():
        body.add_joint(type=getattr(mujoco.mjtJoint, f"mjJNT_{kind}"), axis=axis)
    for body in (base, arm, tool, lid):
        body.add_geom(size=[0.1, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return model, data, Joints(model, model.body("arm").id)


def test_a_joint_that_carries_array_and_body_moves_neither_against_the_other():
    model, data, joints = build_tree()
    tool, lid, up = model.body("tool").id, model.body("lid").id, np.array([0, 0, 1.0])
    for _ in range(2):  # the second time from memory
        assert not joints.let_tilt(data, tool, up)
        assert joints.let_tilt(data, lid, up)
        np.testing.assert_allclose(joints.find_slides(data, tool), [[0, 0.6, 0.8]])
        np.testing.assert_allclose(joints.find_slides(data, lid), [[1, 0, 0]])


@pytest.mark.parametrize(
    ("normal", "tilts"), [([-1, 0, 0], False), ([1, 1e-3, 0], False), ([1, 2e-3, 0], True), ([-1, 0, 2e-3], True)]
)
def test_a_hinge_that_is_parallel_to_the_normal_but_for_rounding_lets_nothing_tilt(normal, tilts):
    """A cosine less than 1e-6 below 1 counts as parallel, either way."""
    model, data, joints = build_tree()
    normal = np.array(normal) / np.linalg.norm(normal)
    assert joints.let_tilt(data, model.body("lid").id, normal) is tilts


#: Arrays of a model, and what is added to their last entry: a ball becomes an ellipsoid, and no exclusion applies.
CHANGES = {
    "geom_type": 2,
    "geom_contype": 1,
    "geom_conaffinity": 1,
    "exclude_signature": 7,
    "pair_geom1": 1,
    "pair_geom2": 1,
}


def build_tool():
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(name="plate", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.01, 0.01, 0.001])
    spec.add_mesh(name="tetra", uservert=[0, 0, 0, 1e-2, 0, 0, 0, 1e-2, 0, 0, 0, 1e-2])
    tool = spec.worldbody.add_body(name="tool")
    tool.add_freejoint()
    tool.add_geom(name="tip", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="tetra")
    tool.add_geom(name="ball", size=[1e-3, 2e-3, 3e-3])
    spec.add_pair(geomname1="ball", geomname2="tip")
    spec.add_exclude(bodyname1="world", bodyname2="world")
    return spec.compile()


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_of_geoms_or_rules_is_followed(name):
    model = build_tool()
    bodies, tool = Bodies(model, np.array([0]), "pad"), model.body("tool").id
    before = bodies.find_shape(tool)[1]
    bodies.follow_changes()
    assert bodies.find_shape(tool)[1] is before
    getattr(model, name)[-1] += CHANGES[name]
    bodies.follow_changes()
    assert bodies.find_shape(tool)[1] is not before


@pytest.mark.parametrize("kind", [mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF])
def test_geoms_without_a_convex_shape_belong_to_no_body(kind):
    model = build_tool()
    model.geom_type[2] = kind
    assert Bodies(model, np.array([0]), "pad").of_geom.tolist() == [0, 1, -1, -1]


def test_shapes_are_described_before_the_first_contact():
    """Vertices that change afterwards are not seen until they are looked for."""
    model = build_tool()
    bodies = Bodies(model, np.array([0]), "pad", edge=1e-4)
    bodies.find_shapes()
    whole = np.ptp(model.mesh_vert, axis=0) / 2
    model.mesh_vert[:] *= 3
    found = bodies.find_shape(1)[1]
    np.testing.assert_allclose(found.halves[0], whole + 1e-4, rtol=1e-6)
    bodies.follow_meshes()
    np.testing.assert_allclose(bodies.find_shape(1)[1].halves[0], 3 * whole + 1e-4, rtol=1e-6)


def test_a_ball_reaches_the_bottom_of_a_dish():
    """The hull of a dish ends at the plane of its rim, 0.7 mm above its bottom."""
    x, y = DOME.points[:, 0], DOME.points[:, 1]
    normals = np.column_stack([-x / 0.05, -y / 0.05, np.ones(len(x))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    dish = make_half_space(np.column_stack([x, y, (x**2 + y**2) / 0.1]), normals)
    spec = make_spec()
    MeshContact(surface=dish).attach(spec.worldbody.add_frame(), DOME_ARRAY, "pad")
    add_body(spec, "sphere", [5e-3], [0, 0, 5e-3], slides="z", mass=0.1)
    model = spec.compile()
    data, touching = mujoco.MjData(model), []
    for height in (0.1e-3, -0.1e-3):
        data.qpos[0] = height
        mujoco.mj_forward(model, data)
        touching.append(data.ncon > 0)
    assert touching == [False, True]


@pytest.mark.parametrize(("width", "count"), [(2.5e-3, 1000), (2.6e-3, 1)])
def test_two_thousand_points_on_several_boxes_are_not_too_many(width, count):
    """25 x 40 points on each of two boxes of 4 mm, whose points are 0.1 mm apart."""
    spec = mujoco.MjSpec()
    for _ in range(2):
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[width / 2, 2e-3, 1e-3])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points, normals = sample_boxes(model, data, np.arange(2), inset=0.0, spacing=1e-4)
    assert (len(points), len(normals)) == (2 * count, 2 * count)
