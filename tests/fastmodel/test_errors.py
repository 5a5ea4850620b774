"""Arguments of a wrong type, through public names: the error says what would be accepted."""

import pathlib

import mujoco
import pytest

import fastmodel
from fastmodel import WTS_0614_34, Batch, Butterworth, FastModelError, Gaussian, Parameters, Placement
from meshes import Sphere, TexelArray
from tests.support.scenes import make_spec

ARRAY = TexelArray.grid(2, 2, 3e-3)
PARAMETERS = Parameters(array=ARRAY, spread=Gaussian.from_sigma(0.5), electronics=WTS_0614_34)
BALL = Sphere(radius=3e-3)


@pytest.fixture
def spec():
    return make_spec()


def bound(spec):
    return fastmodel.attach(spec, "world", PARAMETERS).bind(spec.compile())


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda _: fastmodel.attach("robot.xml", "world", PARAMETERS), r"spec must be a mujoco\.MjSpec.*not str"),
        (lambda spec: fastmodel.attach(spec.compile(), "world", PARAMETERS), r"spec must be .*not MjModel"),
        (
            lambda spec: fastmodel.attach(spec, 3, PARAMETERS),
            r"body must be a mujoco\.MjsBody, a mujoco\.MjsSite, or the name .*not int",
        ),
        (lambda spec: fastmodel.attach(spec, "world", "wts"), r"parameters must be .*fastmodel\.load.*not str"),
        (
            lambda spec: fastmodel.attach(spec, "world", pathlib.Path("wts")),
            r"parameters must be .*fastmodel\.load.*not \w*Path",
        ),
        (
            lambda spec: fastmodel.attach(spec, "world", PARAMETERS, replaces=3),
            r"replaces must be the name of a geom, a mujoco\.MjsGeom.*not int",
        ),
        (
            lambda spec: fastmodel.attach(spec, "world", PARAMETERS, replaces=[spec.worldbody]),
            "replaces must be .*not MjsBody",
        ),
        (
            lambda spec: fastmodel.attach(spec, "world", PARAMETERS, position="above"),
            "a pose takes 3 and 4 numbers.*not 'above'",
        ),
        (lambda spec: bound(spec).bind(spec.compile(), prefix=3), "prefix must be a str.*not int"),
        (lambda spec: fastmodel.attach(spec, "world", PARAMETERS, name=3), "name must be a str, not int"),
        (lambda spec: fastmodel.attach(spec, "world", PARAMETERS, every="2"), "every must be a whole number.*not str"),
        (
            lambda spec: fastmodel.attach(spec, "world", PARAMETERS, contact=3),
            "contact method must be .*not 3",
        ),
        (
            lambda spec: fastmodel.attach(spec, "world", PARAMETERS, contact=fastmodel.BoxTexels),
            r"settings such as fastmodel\.BoxTexels\(\)",
        ),
        (lambda spec: bound(spec).bind(mujoco.MjData(spec.compile())), r"model must be a mujoco\.MjModel.*not MjData"),
        (lambda spec: bound(spec).bind(spec), "model must be .*not MjSpec"),
        (lambda spec: bound(spec).step(spec.compile()), r"data must be the mujoco\.MjData.*not MjModel"),
        (lambda _: fastmodel.recommend_options("robot.xml"), "spec must be .*not str"),
        (lambda _: fastmodel.load(3), "sensor must be the name of a sensor or the path.*not int"),
        (lambda _: fastmodel.load(PARAMETERS), "not Parameters"),
        (lambda _: fastmodel.indent("wts", BALL, load=1.0), "parameters must be .*not str"),
        (lambda _: fastmodel.indent(PARAMETERS, "ball", load=1.0), "indenter must be a shape.*not str"),
        (lambda _: fastmodel.indent(PARAMETERS, BALL, load="1 N"), "must be a number.*not str"),
        (
            lambda _: fastmodel.indent_together(PARAMETERS, [Placement(indenter=BALL, load=1.0, at=(0, "0"))]),
            "must be a number.*not str",
        ),
        (lambda spec: Batch(spec, [], 2), "model must be .*not MjSpec"),
        (
            lambda spec: Batch(spec.compile(), fastmodel.attach(spec, "world", PARAMETERS), 2),
            "must be a sequence",
        ),
        (lambda spec: Batch(spec.compile(), [], "2"), "worlds must be a whole number, not str"),
        (
            lambda _: Parameters(array=3, spread=Gaussian.from_sigma(1), electronics=WTS_0614_34),
            "array must .*not int",
        ),
        (
            lambda _: Parameters(array=ARRAY, spread=Gaussian.from_sigma(1), electronics=WTS_0614_34, filter=30.0),
            r"filter must be a fastmodel\.Butterworth or None, not float",
        ),
        (
            lambda _: Parameters(array=ARRAY, spread=Gaussian.from_sigma(1), electronics=Butterworth(cutoff_hz=1.0)),
            "electronics must be .*not Butterworth",
        ),
    ],
)
def test_a_wrong_type_is_named_with_what_would_be_accepted(spec, call, message):
    with pytest.raises(FastModelError, match=message):
        call(spec)


def test_a_body_of_another_spec_is_refused(spec):
    other = mujoco.MjSpec()
    with pytest.raises(FastModelError, match="body 'palm' belongs to another spec"):
        fastmodel.attach(spec, other.worldbody.add_body(name="palm"), PARAMETERS)
