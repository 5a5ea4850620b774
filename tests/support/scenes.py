"""Scenes of MuJoCo with sensors."""

import warnings

import mujoco
import numpy as np

import fastmodel


def make_spec(timestep=1e-3, **options):
    """An empty spec with the recommended options and others; angles in radians."""
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    spec.compiler.degree = False
    for name, value in {"timestep": timestep, **options}.items():
        setattr(spec.option, name, value)
    return spec


def add_body(
    spec, kind, size, pos=(0, 0, 0), *, slides="", free=False, parent=None, name="", quat=(1, 0, 0, 0), **geom
):
    """Add a body of one geom to the world or another body: free, on slides along some of x, y and z, or fixed."""
    body = (parent or spec.worldbody).add_body(name=name, pos=pos, quat=quat)
    if free:
        body.add_freejoint()
    damping = geom.pop("damping", 0.0)
    for axis in slides:
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=np.eye(3)["xyz".index(axis)], damping=damping)
    body.add_geom(type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"), size=[*size, 0, 0][:3], **geom)
    return body


def bind(sensor, model):
    """Bind a sensor without the warnings about the model."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fastmodel.OptionWarning)
        return sensor.bind(model)


def run(sensors, model, data, steps, push=lambda data: None):
    """Step physics and sensors, one or several; `push` sets applied forces before each step.  Returns the frames."""
    sensors, frames = sensors if isinstance(sensors, list | tuple) else [sensors], []
    for _ in range(steps):
        push(data)
        mujoco.mj_step(model, data)
        frames += [sensor.frame() for sensor in sensors if sensor.step(data)]
    return frames


def simulate(spec, sensors, steps, push=lambda data: None):
    """Compile a spec, bind its sensors, and run both; returns model and data."""
    sensors, model = sensors if isinstance(sensors, list | tuple) else [sensors], spec.compile()
    data = mujoco.MjData(model)
    for sensor in sensors:
        bind(sensor, model)
    run(sensors, model, data, steps, push)
    return model, data
