"""Which texels overlap, which method is taken, and how pairs and poses are carried over."""

import dataclasses
import warnings

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import WTS_0614_34, FastModelError, Gaussian, OptionWarning, Parameters
from fastmodel.attachment import choose_method, refuse_overlaps
from fastmodel.contact.boxes import BoxTexels
from fastmodel.contact.mesh import MeshContact
from fastmodel.contact.plate import CoverContact, Foundation
from fastmodel.errors import ParametersError
from meshes import TexelArray
from tests.support.cover_data import dome_parameters, make_dome, parameters

ARRAY = TexelArray.grid(3, 2, 3e-3)
BARE = Parameters(array=ARRAY, spread=Gaussian.from_sigma(0.5), electronics=WTS_0614_34, filter=None)


def pair_of(apart, lean=0.0, size=(2e-3, 4e-3)):
    """Two texels, the second of which lies apart from the first and leans about y."""
    return TexelArray(
        centres=np.array([[1e-3, 2e-3, 3e-3], np.add([1e-3, 2e-3, 3e-3], apart)]),
        normals=np.array([[0, 0, 1.0], [np.sin(lean), 0, np.cos(lean)]]),
        texel_size=size,
        pitch=size,
        rows=1,
        columns=2,
        active=np.ones(2, dtype=bool),
    )


@pytest.mark.parametrize(
    ("apart", "lean", "overlap"),
    [
        ([1.95e-3, 0, 0], 0, True),
        ([1.97e-3, 0, 0], 0, False),  # up to 2 % of an edge may overlap
        ([0, 3.9e-3, 0], 0, True),
        ([0, 3.94e-3, 0], 0, False),
        ([1e-3, 3.9e-3, 0], 0, True),
        ([-1.95e-3, -3.9e-3, 0], 0, True),
        ([0, 0, 0.99e-3], 0, True),
        ([0, 0, -0.99e-3], 0, True),
        ([0, 0, 1.01e-3], 0, False),  # half the smaller edge
        ([1e-3, 0, 0], 1.55, True),
        ([1e-3, 0, 0], 1.58, False),  # normals more than 90 degrees apart
    ],
)
def test_texels_overlap_where_their_rectangles_do(apart, lean, overlap):
    array = pair_of(apart, lean)
    if overlap:
        with pytest.raises(FastModelError, match=r"texels 0 and 1 overlap \(1 pairs in all\)"):
            refuse_overlaps(array)
    else:
        refuse_overlaps(array)


def test_methods_are_chosen_by_name_or_by_what_the_cover_allows():
    flat, dome = parameters(), dome_parameters(make_dome())
    ended = parameters(surface=dataclasses.replace(flat.surface, table=np.zeros((84, 56, 24))))
    for method, given, name, kind in (
        ("default", BARE, "boxes", BoxTexels),
        ("default", flat, "cover", CoverContact),
        ("default", dome, "curved", MeshContact),
        ("foundation", BARE, "foundation", Foundation),
        ("boxes", flat, "boxes", BoxTexels),
    ):
        found = choose_method(method, given)
        assert found[0] == name
        assert type(found[1]) is kind
    assert choose_method("curved", dome)[1].surface is dome.surface
    assert choose_method("cover", flat)[1].plate.margin is None
    assert choose_method("cover", ended)[1].plate.margin == 0
    margin = dataclasses.replace(ended, array=dataclasses.replace(ended.array, margin=(1e-3, 1e-3)))
    assert choose_method("cover", margin)[1].plate.margin is None
    own = Foundation(modulus=3e8)
    assert choose_method(own, flat) == (repr(own), own)
    for wrong, given, message in (
        (BoxTexels, flat, "must be a name of fastmodel.METHODS or settings"),
        (3, flat, "not 3"),
        ("boxes", dome, "the contact method boxes does not suit this cover; accepted: curved"),
        ("curved", flat, "does not suit this cover; accepted: cover, foundation, boxes"),
    ):
        with pytest.raises(FastModelError, match=message):
            choose_method(wrong, given)
    with pytest.raises(ParametersError, match="needs a curved cover"):
        choose_method("curved", BARE)


PAIR = {
    "condim": 4,
    "friction": [0.5, 0.6, 0.01, 0.02, 0.03],
    "gap": 1e-4,
    "margin": 2e-4,
    "solref": [0.01, 2.0],
    "solreffriction": [0.02, 3.0],
    "solimp": [0.7, 0.8, 2e-3, 0.4, 3.0],
}


@pytest.mark.parametrize("first", [True, False])
def test_a_pair_with_a_replaced_geom_is_carried_over_with_all_its_settings(first):
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(name="pad", type=mujoco.mjtGeom.mjGEOM_BOX, size=[3e-3, 4e-3, 1e-3])
    block = spec.worldbody.add_body(name="block", pos=[0, 0, 5e-3])
    block.add_freejoint()
    block.add_geom(name="block", size=[2e-3, 0, 0], mass=0.1)
    ends = ("pad", "block") if first else ("block", "pad")
    spec.add_pair(geomname1=ends[0], geomname2=ends[1], **PAIR)
    fastmodel.attach(spec, "world", BARE, contact="boxes", replaces="pad")
    model = spec.compile()
    assert model.npair == 6
    block, texels = model.geom("block").id, {model.geom(f"sensor/texel{k}").id for k in range(6)}
    pairs = np.column_stack([model.pair_geom1, model.pair_geom2])
    assert (np.sort(pairs == block, axis=1) == [False, True]).all()
    assert set(pairs[pairs != block].tolist()) == texels
    assert model.pair_dim.tolist() == [4] * 6
    for name, stored in (
        ("friction", model.pair_friction),
        ("gap", model.pair_gap),
        ("margin", model.pair_margin),
        ("solref", model.pair_solref),
        ("solreffriction", model.pair_solreffriction),
        ("solimp", model.pair_solimp),
    ):
        np.testing.assert_allclose(stored, np.tile(PAIR[name], (6, 1)).reshape(stored.shape))


def test_default_settings_of_a_body_do_not_reach_the_array():
    spec = mujoco.MjSpec.from_string(
        '<mujoco><default><default class="soft"><geom friction="0.1 0.2 0.3" margin="0.01" group="4"/></default>'
        '</default><worldbody><body name="finger" childclass="soft"><geom size="0.01"/></body></worldbody></mujoco>'
    )
    fastmodel.attach(spec, "finger", BARE, contact="boxes", position=(0, 0, 0.02))
    spec.body("finger").add_geom(name="later", size=[0.001, 0, 0])
    model = spec.compile()
    texel = model.geom("sensor/texel0")
    np.testing.assert_allclose(texel.friction, [1, 0.005, 0.0001])
    assert (texel.margin[0], texel.group[0]) == (0, 0)
    assert model.geom(0).margin[0] == model.geom("later").margin[0] == 0.01


@pytest.mark.parametrize(
    ("position", "quaternion", "message"),
    [
        ((0, 0), (1, 0, 0, 0), "shapes"),
        ((0, 0, 0), (1, 0, 0), "shapes"),
        ((0, 0, np.nan), (1, 0, 0, 0), "finite"),
        ((0, 0, 0), (1, 0, np.inf, 0), "finite"),
        ((0, 0, 0), (0, 0, 0, 0), "other than zero"),
        ("here", (1, 0, 0, 0), "takes 3 and 4 numbers"),
        ((0, 0, 0), None, "shapes"),
    ],
)
def test_a_pose_of_wrong_shape_or_without_direction_is_refused(position, quaternion, message):
    with pytest.raises(FastModelError, match=message):
        fastmodel.attach(mujoco.MjSpec(), "world", BARE, position=position, quaternion=quaternion)


@pytest.mark.parametrize(
    ("quaternion", "warned"), [((0, 0, 0, 1), True), ((0, 0, 0, -1), False), ((0, 0, 1, 0), False)]
)
def test_half_a_turn_that_looks_like_no_rotation_is_warned_of(quaternion, warned):
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        fastmodel.attach(mujoco.MjSpec(), "world", BARE, quaternion=quaternion)
    assert [each.category for each in given] == [OptionWarning] * warned


def test_a_quaternion_of_any_length_is_an_orientation():
    spec = mujoco.MjSpec()
    fastmodel.attach(spec, "world", BARE, contact="boxes", quaternion=(0, 3, 0, 0), position=(0.1, 0.2, 0.3))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(data.site("sensor/origin").xpos, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(data.site("sensor/origin").xmat, [1, 0, 0, 0, -1, 0, 0, 0, -1], atol=1e-12)


@pytest.mark.parametrize("name", ["", "a/b"])
def test_a_name_without_text_or_with_a_slash_is_refused(name):
    with pytest.raises(FastModelError, match="at least one character and no '/'"):
        fastmodel.attach(mujoco.MjSpec(), "world", BARE, name=name)


def test_recommended_options_are_the_steadiest():
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    assert spec.option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert spec.option.solver == mujoco.mjtSolver.mjSOL_NEWTON
    assert spec.option.impratio == 10
