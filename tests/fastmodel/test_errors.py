"""Arguments of a wrong type, through public names: the error says what would be accepted."""

import pathlib

import mujoco
import pytest

import fastmodel
from fastmodel import WTS_0614_34, Batch, Butterworth, FastModelError, Gaussian, Parameters, Placement, indent
from meshes import Sphere, TexelArray
from tests.support.scenes import make_spec

PARTS = {"array": TexelArray.grid(2, 2, 3e-3), "spread": Gaussian.from_sigma(0.5), "electronics": WTS_0614_34}
PARAMETERS = Parameters(**PARTS)
BALL = Sphere(radius=3e-3)


@pytest.fixture
def spec():
    return make_spec()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"spec": "robot.xml"}, r"spec must be a mujoco\.MjSpec.*not str"),
        ({"spec": mujoco.MjSpec().compile()}, r"spec must be .*not MjModel"),
        ({"body": 3}, r"body must be a mujoco\.MjsBody, a mujoco\.MjsSite, or the name .*not int"),
        ({"parameters": "wts"}, r"parameters must be .*fastmodel\.load.*not str"),
        ({"parameters": pathlib.Path("wts")}, r"parameters must be .*fastmodel\.load.*not \w*Path"),
        ({"replaces": 3}, r"replaces must be the name of a geom, a mujoco\.MjsGeom.*not int"),
        ({"replaces": [mujoco.MjSpec().worldbody]}, "replaces must be .*not MjsBody"),
        ({"position": "above"}, "a pose takes 3 and 4 numbers.*not 'above'"),
        ({"name": 3}, "name must be a str, not int"),
        ({"every": "2"}, "every must be a whole number.*not str"),
        ({"contact": 3}, "contact method must be .*not 3"),
        ({"contact": fastmodel.BoxTexels}, r"settings such as fastmodel\.BoxTexels\(\)"),
        ({"body": mujoco.MjSpec().worldbody}, "body 'world' belongs to another spec"),
    ],
)
def test_a_wrong_argument_of_attach_is_named_with_what_would_be_accepted(spec, change, message):
    with pytest.raises(FastModelError, match=message):
        fastmodel.attach(**{"spec": spec, "body": "world", "parameters": PARAMETERS, **change})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda sensor, model: sensor.bind(model, prefix=3), "prefix must be a str.*not int"),
        (lambda sensor, model: sensor.bind(mujoco.MjData(model)), r"model must be a mujoco\.MjModel.*not MjData"),
        (lambda sensor, _: sensor.bind(mujoco.MjSpec()), "model must be .*not MjSpec"),
        (lambda sensor, model: sensor.bind(model, suffix=3), r"suffix must be a str.*suffix='_left'.*not int"),
        (lambda sensor, _: sensor.check("robot.xml"), r"model must be a mujoco\.MjModel.*not str"),
        (lambda sensor, model: sensor.check(mujoco.MjData(model)), "model must be .*not MjData"),
        (lambda sensor, model: sensor.bind(model).set_state([]), r"state must be a dict.*get_state\(\).*not list"),
        (lambda sensor, model: sensor.bind(model).step(model), r"data must be the mujoco\.MjData.*not MjModel"),
        (lambda *_: fastmodel.recommend_options("robot.xml"), "spec must be .*not str"),
        (lambda *_: fastmodel.load(3), "sensor must be the name of a sensor or the path.*not int"),
        (lambda *_: fastmodel.load(PARAMETERS), "not Parameters"),
        (lambda *_: indent("wts", BALL, load=1.0), "parameters must be .*not str"),
        (lambda *_: indent(PARAMETERS, "ball", load=1.0), "indenter must be a shape.*not str"),
        (lambda *_: indent(PARAMETERS, BALL, load="1 N"), "must be a number.*not str"),
        (
            lambda *_: fastmodel.indent_together(PARAMETERS, [Placement(indenter=BALL, load=1.0, at=(0, "0"))]),
            "must be a number.*not str",
        ),
        (lambda *_: Batch(mujoco.MjSpec(), [], 2), "model must be .*not MjSpec"),
        (lambda sensor, model: Batch(model, sensor, 2), "must be a sequence"),
        (lambda _, model: Batch(model, [], "2"), "worlds must be a whole number, not str"),
        (lambda *_: Parameters(**PARTS | {"array": 3}), "array must .*not int"),
        (lambda *_: Parameters(**PARTS, filter=30.0), r"filter must be a fastmodel\.Butterworth or None, not float"),
        (lambda *_: Parameters(**PARTS | {"electronics": Butterworth(cutoff_hz=1.0)}), "must be .*not Butterworth"),
    ],
)
def test_a_wrong_type_is_named_with_what_would_be_accepted(spec, call, message):
    sensor = fastmodel.attach(spec, "world", PARAMETERS)
    with pytest.raises(FastModelError, match=message):
        call(sensor, spec.compile())
