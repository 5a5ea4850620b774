"""Random primitives in random poses: the array measures the force with which the engine pushes back."""

import warnings

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import METHODS
from tests.support.cover_data import parameters

PARAMETERS = parameters()
KINDS = [getattr(mujoco.mjtGeom, f"mjGEOM_{name}") for name in ("BOX", "SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER")]
#: Poses of one body.
POSES = 250


def reach(kind, size, axis):
    """Distance from a primitive's middle to its lowest point; `axis` is the world's up in its frame."""
    return {
        mujoco.mjtGeom.mjGEOM_BOX: np.abs(axis) @ size,
        mujoco.mjtGeom.mjGEOM_SPHERE: size[0],
        mujoco.mjtGeom.mjGEOM_CAPSULE: size[0] + abs(axis[2]) * size[1],
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: np.linalg.norm(axis * size),
        mujoco.mjtGeom.mjGEOM_CYLINDER: size[0] * np.hypot(axis[0], axis[1]) + abs(axis[2]) * size[1],
    }[kind]


def world(method, kind, size):
    """A free body of one primitive and a sensor that reads at every step."""
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    spec.option.timestep = 1e-3
    sensor = fastmodel.attach(spec, "world", PARAMETERS, contact=method, every=1)
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.add_geom(type=kind, size=size, density=4000)
    model = spec.compile()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fastmodel.OptionWarning)
        sensor.bind(model)
    return sensor, model, mujoco.MjData(model)


def press_at_random(method, count, seed=0):
    """Poses that were felt, after a check of each."""
    rng = np.random.default_rng(seed)
    felt = 0
    for number in range(count):
        if number % POSES == 0:
            kind = KINDS[number // POSES % len(KINDS)]
            size = 10 ** rng.uniform(-3.2, -2.2, 3)
            sensor, model, data = world(method, kind, size)
        turn = rng.normal(size=4)
        data.qpos[3:] = turn / np.linalg.norm(turn)
        axis = np.empty(9)
        mujoco.mju_quat2Mat(axis, data.qpos[3:])
        depth = 10 ** rng.uniform(-6, -3.7)
        data.qpos[:3] = [*rng.uniform([-9e-3, -22e-3], [9e-3, 22e-3]), reach(kind, size, axis[6:]) - depth]
        data.qvel[:] = 0
        mujoco.mj_forward(model, data)
        data.time += model.opt.timestep
        sensor.step(data)
        forces, carried, frame = sensor.contact_forces(), sensor.carried(), sensor.frame()
        where = (method, kind.name, size, data.qpos)
        assert np.all(np.isfinite(forces) & (forces >= 0)), where
        assert np.isfinite(frame.texel_forces).all(), where
        assert frame.counts.min() >= 0, where
        assert carried == pytest.approx(data.qfrc_constraint[2], rel=1e-6, abs=1e-9), where
        assert forces.sum() <= carried * (1 + 1e-9), where
        felt += carried > 0
    return felt


@pytest.mark.parametrize("method", METHODS)
def test_random_primitives_in_random_poses_never_break(method):
    assert press_at_random(method, 100) > 95


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 11))
def test_ten_thousand_random_poses_each_never_break(seed):
    # each method in turn, the costly ones on fewer poses
    for method, share in (("cover", 6000), ("foundation", 2000), ("boxes", 1800), ("area", 200)):
        # Shallow bodies may stand between two texels' boxes, or beside the array, and touch nothing.
        assert press_at_random(method, share, seed) > 0.8 * share
