"""Names of arrays, bodies, sites and geoms in a spec: which are found or refused, and what messages list."""

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import WTS_0614_34, FastModelError, Gaussian, Parameters
from fastmodel.attachment import DEFAULT, METHODS, refuse_overlaps
from meshes import TexelArray

ARRAY = TexelArray.grid(1, 3, 3e-3)
PARAMETERS = Parameters(array=ARRAY, spread=Gaussian.from_sigma(0.5), electronics=WTS_0614_34)


def build(pads=1, *, named=True, site=False):
    """A finger with some pads, each in a pair with a block, and a link with one geom."""
    spec = mujoco.MjSpec()
    finger, link = (spec.worldbody.add_body(name=name) for name in ("finger", "link"))
    for k in range(pads):
        finger.add_geom(name=f"pad{k}" if named else "", size=[1e-3, 0, 0])
    link.add_geom(name="block", size=[1e-3, 0, 0])
    if site:
        link.add_site(name="tip", pos=[0, 0, 0.1])
    if named:
        for k in range(pads):
            spec.add_pair(geomname1="block", geomname2=f"pad{k}", condim=3 + k)
    return spec


def attach(spec, body="finger", **changes):
    return fastmodel.attach(spec, body, PARAMETERS, contact="boxes", **changes)


def test_a_name_may_begin_as_another_one_does_but_not_equal_it():
    spec = build()
    assert attach(spec).name == "sensor"
    attach(spec, name="sensor2")
    attach(spec, name="sens")
    with pytest.raises(FastModelError, match="a sensor named 'sensor2' is on this spec already"):
        attach(spec, "link", name="sensor2")
    model = spec.compile()
    sites = [model.site(each).name for each in range(model.nsite)]
    assert sites == ["sensor/origin", "sensor2/origin", "sens/origin"]
    assert model.site_group.tolist() == [5, 5, 5]


def test_pairs_pass_to_the_geoms_of_the_replacing_array_alone():
    """Of two pads one is replaced, by an array whose name begins as that of one on the same body does."""
    spec = build(pads=2)
    attach(spec, name="ab")
    attach(spec, name="a", replaces="pad1")
    model = spec.compile()
    block = model.geom("block").id
    pairs = {
        (model.geom(a if b == block else b).name, int(dim))
        for a, b, dim in zip(model.pair_geom1, model.pair_geom2, model.pair_dim, strict=True)
    }
    assert pairs == {("pad0", 3), *((f"a/texel{k}", 4) for k in range(3))}
    assert [model.geom(each).contype[0] for each in ("pad0", "pad1")] == [1, 0]
    assert [model.geom(each).conaffinity[0] for each in ("pad0", "pad1")] == [1, 0]


@pytest.mark.parametrize(
    ("given", "changes", "message"),
    [
        ({}, {"body": "figner"}, "^no body named 'figner'; valid names: finger, link, world$"),
        ({"site": True}, {"body": "tpi"}, "^no body or site named 'tpi'; valid names: finger, link, tip, world$"),
        ({}, {"body": "pad0"}, "^no body named 'pad0'; .*; 'pad0' is a geom of body 'finger': name the body$"),
        ({}, {"body": 3}, "body must be a mujoco.MjsBody, a mujoco.MjsSite, or the name of a body or site, not int"),
        ({"pads": 2}, {"replaces": "pda"}, "^no geom of body 'finger' named 'pda'; valid names: pad0, pad1$"),
        (
            {"pads": 2, "named": False},
            {"replaces": "pda"},
            r"valid names: \(none\); it has 2 geoms without a name, which are given as mujoco.MjsGeom$",
        ),
        (
            {"named": False},
            {"replaces": "block"},
            r"'block' is on body 'link'; an array on body 'finger' replaces .* alone: \(none with a name\)$",
        ),
        ({}, {"every": 0}, "^every must be a whole number of physics steps from 1 on, not 0$"),
        ({}, {"name": 7}, "name must be a str, not int"),
        ({}, {"position": (1, 2)}, r"not shapes \(2,\) and \(4,\)"),
        ({}, {"position": "up"}, r"takes 3 and 4 numbers, \[m\] and \[-\], not 'up' and \(1.0, 0.0, 0.0, 0.0\)"),
    ],
)
def test_what_is_not_found_or_wrong_is_named(given, changes, message):
    spec = build(**given)
    before = spec.to_xml()
    with pytest.raises(FastModelError, match=message):
        attach(spec, **{"body": "finger", **changes})
    assert spec.to_xml() == before


def test_bodies_of_another_spec_are_refused_and_own_ones_are_taken():
    spec, other = build(site=True), build(site=True)
    for kind, wanted in (("body", other.body("finger")), ("site", other.site("tip"))):
        with pytest.raises(FastModelError, match=f"^{kind} '.*' belongs to another spec than the one to attach to$"):
            attach(spec, wanted)
    attach(spec, spec.body("link"), name="one", every=1)
    attach(spec, spec.site("tip"), name="two")
    model = spec.compile()
    assert {int(model.geom(f"{name}/texel0").bodyid[0]) for name in ("one", "two")} == {model.body("link").id}


def test_an_array_lies_at_the_origin_of_its_body_unless_a_pose_is_given():
    spec = build()
    attach(spec)
    spec.body("finger").pos = [0.1, 0.2, 0.3]
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(data.site("sensor/origin").xpos, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(data.site("sensor/origin").xmat.reshape(3, 3), np.eye(3), atol=1e-15)
    assert model.geom("pad0").contype[0] == 1  # nothing is replaced
    assert (DEFAULT, sorted(METHODS)) == ("default", ["boxes", "cover", "curved", "foundation"])


@pytest.mark.parametrize(("apart", "pairs"), [(2.9e-3, 2), (1.4e-3, 3)])
def test_the_first_of_all_overlapping_pairs_is_named_with_the_size(apart, pairs):
    """Three texels of 3 mm x 4 mm in a row along x."""
    array = TexelArray.grid(1, 3, (apart, 4e-3), texel_size=(3e-3, 4e-3), name="dense")
    with pytest.raises(FastModelError) as raised:
        refuse_overlaps(array)
    message = str(raised.value)
    assert message.startswith("array 'dense': texels ")
    assert f"overlap ({pairs} pairs in all); centres must lie at least a texel's size of (0.003, 0.004) m" in message
