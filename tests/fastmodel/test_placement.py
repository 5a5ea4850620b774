"""Arrays at a wrong place of their finger, and concave objects: planted faults are told, right scenes are silent."""

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import OptionWarning, Plate
from meshes import TexelArray
from tests.support.cover_data import parameters
from tests.support.scenes import add_body, make_spec

KINDS = mujoco.mjtGeom
PITCH = 3.4e-3
#: Half a turn about x, and a quarter about x, which turns z to -y.
FLIPPED, SIDEWAYS = (0.0, 1.0, 0.0, 0.0), (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)


def tell(*, rows=6, columns=4, margin=(1.2e-3, 1.8e-3), contact="cover", bone=True, **pose):
    """What a sensor says on a finger with a pad of 16 mm x 24 mm x 5 mm in front of a bone of the same outline."""
    spec = make_spec()
    finger = spec.worldbody.add_body(name="finger", pos=[0.3, 0.2, 0.4], quat=[0.9, 0.1, 0.4, 0.1])
    finger.add_joint(name="hold", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    if bone:
        finger.add_geom(name="bone", type=KINDS.mjGEOM_BOX, size=[8e-3, 12e-3, 5e-3], pos=[0, 0, -10e-3], mass=0.1)
    finger.add_geom(name="pad", type=KINDS.mjGEOM_BOX, size=[8e-3, 12e-3, 2.5e-3], pos=[0, 0, -2.5e-3], mass=0.1)
    array = TexelArray.grid(rows, columns, PITCH, margin=margin)
    sensor = fastmodel.attach(spec, "finger", parameters(array), contact=contact, replaces="pad", **pose)
    return sensor.check(spec.compile())


@pytest.mark.parametrize("contact", ["cover", "foundation", "boxes"])
def test_an_array_in_the_place_of_its_pad_is_silent(contact):
    assert [each for each in tell(contact=contact) if "array" in each] == []


@pytest.mark.parametrize(
    "fault", [{"margin": None}, {"margin": 0, "contact": fastmodel.Foundation(plate=Plate(margin=PITCH))}]
)
def test_a_plate_beyond_the_finger_is_told_with_the_margin_that_fits(fault):
    """4 x 3.4 mm and a pitch on each side are 20.4 mm; the pad has 16 mm, so that 1.2 mm are left."""
    (said,) = tell(**fault)
    assert "the plate of array 'sensor' reaches 2.2 mm beyond the geoms of its body" in said
    assert "margin=(0.0012, 0.0018)" in said


@pytest.mark.parametrize("contact", ["cover", "boxes"])
def test_texels_beyond_the_finger_are_told(contact):
    found = [each for each in tell(rows=4, columns=6, contact=contact) if "stick out" in each]
    assert found == [
        "texels of array 'sensor' stick out 2.2 mm beyond the geoms of its body; rows and columns look exchanged"
    ]
    (said,) = tell(position=(0, 0.012, 0))
    assert "stick out 10.2 mm" in said
    assert "mend its position" in said


@pytest.mark.parametrize(
    ("away", "advice"), [((0, 0.05, 0), "mend its position"), ((0, 12, -3), "looks like millimetres")]
)
def test_an_array_far_from_its_finger_is_told(away, advice):
    (said,) = tell(position=away)
    assert f"{1e3 * away[1] - 12 - 12:.0f}" in said or advice == "looks like millimetres"
    assert "mm from every geom of its body 'finger'; " in said
    assert advice in said


@pytest.mark.parametrize(
    ("pose", "advice"),
    [
        ({"quaternion": (np.sqrt(0.5), 0, np.sqrt(0.5), 0), "position": (-8e-3, 0, -5e-3)}, "turn its z axis outwards"),
        ({"quaternion": FLIPPED}, "turn its z axis outwards"),
        ({"quaternion": (0, 0, 1.0, 0)}, "looks like x, y, z, w"),
    ],
)
def test_an_array_that_faces_its_own_finger_is_told(pose, advice):
    said = [each for each in tell(contact="boxes", **pose) if "front of array" in each]
    assert len(said) == 1
    assert "does not point away from its body 'finger'; " in said[0]
    assert advice in said[0]


def test_a_quaternion_with_w_last_is_told():
    """An array on the face with the normal -y, after a quarter turn about x, sticks out if w comes last."""
    place = (0, -13e-3, -7.5e-3)
    assert tell(margin=(0, 0), rows=4, quaternion=SIDEWAYS, position=place) == ()
    said = tell(margin=(0, 0), rows=4, quaternion=(*SIDEWAYS[1:], SIDEWAYS[0]), position=place)
    assert "its quaternion looks like x, y, z, w, attach takes w first" in said[-1]


def test_no_quaternion_is_blamed_for_an_array_that_is_too_large():
    """A turn about y by 90 degrees points the same way with w taken last, and the array sticks out as far."""
    turn = (np.sqrt(0.5), 0, np.sqrt(0.5), 0)
    (said,) = [each for each in tell(margin=(0, 0), rows=20, quaternion=turn, position=(8e-3, 0, 0)) if "stick" in each]
    assert said.endswith("mend its position, or its rows and columns")


def test_the_identity_with_w_last_is_told_and_a_half_turn_can_be_meant():
    with pytest.warns(OptionWarning, match=r"no rotation is \(1, 0, 0, 0\)"):
        tell(quaternion=(0, 0, 0, 1))
    assert tell(quaternion=(0, 0, 0, -1)) == ()


def profile(depth):
    """Outline of a U of 20 mm x 10 mm with a groove of a given depth, as a closed mesh of vertices and faces."""
    outline = (
        np.array([[-10, 0], [10, 0], [10, 10], [4, 10], [4, 10 - depth], [-4, 10 - depth], [-4, 10], [-10, 10]]) / 1e3
    )
    low, high = (np.column_stack([outline, np.full(8, y)]) for y in (-5e-3, 5e-3))
    cap = [[0, 1, 4], [1, 2, 3], [1, 3, 4], [0, 4, 5], [0, 5, 6], [0, 6, 7]]
    sides = [[k, (k + 1) % 8, 8 + k] for k in range(8)] + [[(k + 1) % 8, 8 + (k + 1) % 8, 8 + k] for k in range(8)]
    faces = [[a, c, b] for a, b, c in cap] + [[8 + a, 8 + b, 8 + c] for a, b, c in cap] + sides
    return np.concatenate([low, high]).ravel().tolist(), np.ravel(faces).tolist()


@pytest.mark.parametrize(("depth", "free", "told"), [(8, True, True), (0.0, True, False), (8, False, False)])
def test_a_concave_mesh_that_mujoco_fills_is_told(depth, free, told):
    """A groove of 8 mm of 20 mm x 10 mm: the hull has 200 / 136 of the area.  A fixed body is no object to grasp."""
    spec = make_spec()
    vertices, faces = profile(depth)
    spec.add_mesh(name="u", uservert=vertices, userface=faces)
    sensor = fastmodel.attach(spec, "world", parameters())
    add_body(spec, "mesh", [], [0, 0, 0.1], free=free, name="bracket", meshname="u", density=1000)
    said = [each for each in sensor.check(spec.compile()) if "MuJoCo fills" in each]
    assert len(said) == told
    assert all(
        "of body 'bracket' and collides with its convex hull; divide it into convex parts" in each for each in said
    )
