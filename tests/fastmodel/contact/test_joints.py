import mujoco
import numpy as np
import pytest

from fastmodel.contact.bodies import Joints

NORMAL = np.array([0.0, 0.0, 1.0])
SLIDE, HINGE, BALL, FREE = (getattr(mujoco.mjtJoint, f"mjJNT_{n}") for n in ("SLIDE", "HINGE", "BALL", "FREE"))


def build(joints, *, arm=()):
    """A body with some joints over an array on an arm with others; ids of both bodies."""
    spec = mujoco.MjSpec()
    holder = spec.worldbody.add_body(name="holder")
    tool = spec.worldbody.add_body(name="tool", pos=[0, 0, 1])
    for body, kinds in ((holder, arm), (tool, joints)):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0])
        for kind, axis in kinds:
            body.add_joint(type=kind, axis=axis)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return Joints(model, model.body("holder").id), data, model.body("tool").id


@pytest.mark.parametrize(
    ("joints", "arm", "tilts"),
    [
        ([], [], False),
        ([(SLIDE, [0, 0, 1])], [], False),
        ([(HINGE, [0, 0, 1])], [], False),
        ([(HINGE, [1, 0, 0])], [], True),
        ([(HINGE, [0, 0.6, 0.8])], [], True),
        ([(BALL, [0, 0, 1])], [], True),
        ([(FREE, [0, 0, 1])], [], True),
        ([], [(HINGE, [0, 1, 0])], True),
    ],
)
def test_a_body_tilts_unless_all_joints_up_to_the_array_keep_it_upright(joints, arm, tilts):
    found, data, tool = build(joints, arm=arm)
    assert found.let_tilt(data, tool, NORMAL) is tilts


def test_slides_are_those_between_body_and_array():
    found, data, tool = build([(SLIDE, [0, 0, 1]), (HINGE, [1, 0, 0])], arm=[(SLIDE, [0, 1, 0])])
    np.testing.assert_allclose(found.find_slides(data, tool), [[0, 1, 0], [0, 0, 1]], atol=1e-12)
