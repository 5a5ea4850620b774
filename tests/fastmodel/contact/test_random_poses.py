"""Random primitives and hollow bodies in random poses: the array measures the force with which it is pressed."""

import mujoco
import numpy as np
import pytest

import fastmodel
from tests.support.contact_forces import sum_pushes
from tests.support.cover_data import dome_parameters, make_dome, parameters
from tests.support.scenes import make_spec, simulate

METHODS = ("boxes", "foundation", "cover", "curved")

PARAMETERS, DOME = parameters(), dome_parameters(make_dome())
KINDS = [getattr(mujoco.mjtGeom, f"mjGEOM_{name}") for name in ("BOX", "SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER")]
#: Poses of one body.
POSES = 50


def reach(kind, size, axis):
    """Distance from a primitive's middle to its lowest point; `axis` is the world's up in its frame."""
    return {
        mujoco.mjtGeom.mjGEOM_BOX: np.abs(axis) @ size,
        mujoco.mjtGeom.mjGEOM_SPHERE: size[0],
        mujoco.mjtGeom.mjGEOM_CAPSULE: size[0] + abs(axis[2]) * size[1],
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: np.linalg.norm(axis * size),
        mujoco.mjtGeom.mjGEOM_CYLINDER: size[0] * np.hypot(axis[0], axis[1]) + abs(axis[2]) * size[1],
    }[kind]


def build_world(method, geoms):
    """A free body of some geoms and a sensor that reads at every step."""
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", DOME if method == "curved" else PARAMETERS, contact=method, every=1)
    body = spec.worldbody.add_body()
    body.add_freejoint()
    for geom in geoms:
        body.add_geom(density=4000, **geom)
    return sensor, *simulate(spec, sensor, 0)


def make_hollow(rng):
    """Boxes in a ring, as the wall of a mug, and a handle: a hollow, concave body."""
    count, radius, height = rng.integers(5, 12), rng.uniform(5e-3, 30e-3), rng.uniform(2e-3, 20e-3)
    for turn in 2 * np.pi * np.arange(count) / count:
        half = [0.5e-3, radius * np.tan(np.pi / count), height]
        middle = [radius * np.cos(turn), radius * np.sin(turn), 0.0]
        yield {"type": KINDS[0], "size": half, "pos": middle, "quat": [np.cos(turn / 2), 0, 0, np.sin(turn / 2)]}
    yield {"type": KINDS[2], "size": [2e-3, 5e-3, 0], "pos": [radius + 8e-3, 0, 0]}


def find_lowest(model, data):
    """Place of the lowest geom of the body, x and y of its middle and z of its lowest point [m]."""
    places = []
    for geom in np.flatnonzero(model.geom_bodyid == model.nbody - 1):
        kind, up = mujoco.mjtGeom(model.geom_type[geom]), data.geom_xmat[geom].reshape(3, 3)[2]
        places.append(data.geom_xpos[geom] - [0, 0, reach(kind, model.geom_size[geom], up)])
    return min(places, key=lambda place: place[2])


def press_at_random(method, count, seed=0):
    """Poses that were felt, after a check of each."""
    rng = np.random.default_rng(seed)
    felt = 0
    for number in range(count):
        if number % POSES == 0:
            kind = number // POSES % (len(KINDS) + 1)
            size = 10 ** rng.uniform(-3.2, -2.2, 3)
            geoms = [{"type": KINDS[kind], "size": size}] if kind < len(KINDS) else list(make_hollow(rng))
            sensor, model, data = build_world(method, geoms)
        turn = rng.normal(size=4)
        data.qpos[3:] = turn / np.linalg.norm(turn)
        depth = 10 ** rng.uniform(-6, -3.7)
        data.qpos[:3] = 0
        data.qvel[:] = 0
        mujoco.mj_kinematics(model, data)
        place = rng.uniform([-9e-3, -22e-3], [9e-3, 22e-3])
        height = -depth
        if method == "curved":
            place /= 5
            height += np.sqrt(1e-4 - place @ place) - 0.5e-3  # the lowest point is beside the middle
        data.qpos[:3] = [*place, height] - find_lowest(model, data)
        mujoco.mj_forward(model, data)
        data.time += model.opt.timestep
        sensor.step(data)
        forces, carried, frame = sensor.contact_forces(), sensor.carried(), sensor.frame()
        where = (method, geoms, data.qpos)
        assert np.all(np.isfinite(forces) & (forces >= 0)), where
        assert np.isfinite(frame.texel_forces).all(), where
        assert frame.counts.min() >= 0, where
        felt += carried > 0
        if method == "curved":
            assert carries_the_load(sensor._reader), where
            continue
        assert carried == pytest.approx(data.qfrc_constraint[2], rel=1e-6, abs=1e-9), where
        assert forces.sum() <= sum_pushes(model, data) * (1 + 1e-6), where
        assert is_within_reach(model, data, forces), where
    return felt


def carries_the_load(reader):
    """Whether the forces along the normals of a curved cover are enough for the loads of its bodies."""
    if reader._solved is None:
        return True
    contact, reading = reader._solved.contact, reader._solved.reading
    pressed = sum(load.force for load in contact.loads)
    # Forces along the normals sum to more than the load, at most by the steepest of the normals in contact.
    return len(contact.points) > 0 or pressed * (1 - 1e-6) <= reading.contact_forces.sum() <= 2.6 * pressed


def is_within_reach(model, data, forces):
    """Whether a geom of the body lies over, or within a pitch of, every texel with a force."""
    geoms = np.flatnonzero(model.geom_bodyid == model.nbody - 1)
    loaded = PARAMETERS.array.centres[forces > 1e-9, None, :2]
    apart = np.linalg.norm(loaded - data.geom_xpos[geoms, :2], axis=2) - model.geom_rbound[geoms]
    return bool((apart.min(axis=1, initial=np.inf) < 2 * max(PARAMETERS.array.pitch)).all())


@pytest.mark.parametrize("method", METHODS)
def test_random_bodies_in_random_poses_never_break(method):
    assert press_at_random(method, 20 if method == "curved" else 60) > 15


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("count", "seed"), [(400, 1), pytest.param(30_000, 2, marks=pytest.mark.bench)])
def test_thousands_of_random_poses_never_break(method, count, seed):
    # Shallow bodies may stand between two texels' boxes, or beside the array, and touch nothing.
    assert press_at_random(method, count, seed) > 0.7 * count
