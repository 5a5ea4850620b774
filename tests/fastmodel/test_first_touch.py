"""The first touch of an array compiles and imports nothing, and costs little."""

import pathlib
import subprocess
import sys
import time

import mujoco
import numpy as np
import pytest

import fastmodel
from tests.support.cover_data import parameters
from tests.support.scenes import add_body, make_spec

FIRST_TOUCHES = """
import gc, sys, mujoco, numpy, fastmodel, scipy.spatial
from meshes import TexelArray
from tests.support.bent_array import bent_array
from tests.support.cover_data import parameters
from tests.support.scenes import add_body, make_spec

find_hull = scipy.spatial.ConvexHull

def drop(kind, sensed):
    spec = make_spec()
    sensor = fastmodel.attach(spec, "world", sensed, contact=sys.argv[1], every=1)
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 0, 1)]
    spec.add_mesh(name="block", uservert=(4e-3 * numpy.array(corners, dtype=float)).ravel())
    mesh = {"meshname": "block"} if kind == "mesh" else {}
    add_body(spec, kind, [5e-3] * 3, [0, 0, 5.2e-3], free=True, mass=0.1, **mesh)
    model = spec.compile()
    return sensor.bind(model), model, mujoco.MjData(model)

def count():
    found = [value for value in gc.get_objects() if hasattr(type(value), "nopython_signatures")]
    return {each.py_func: len(each.signatures) for each in found if each.py_func.__module__.startswith("fastmodel")}

for sensed in (parameters(bent_array()), parameters(TexelArray.grid(3, 3, 3.4e-3))):
    for kind in ("sphere", "box", "mesh"):
        scipy.spatial.ConvexHull = find_hull
        sensor, model, data = drop(kind, sensed)
        kernels, modules, scipy.spatial.ConvexHull = count(), set(sys.modules), None
        touched = False
        for _ in range(30):
            mujoco.mj_step(model, data)
            sensor.step(data)
            touched |= sensor.carried() > 0.1
        assert kernels and touched
        assert count() == kernels, (kind, set(count().items()) - set(kernels.items()))
        assert set(sys.modules) == modules, set(sys.modules) - modules
"""


@pytest.mark.slow
@pytest.mark.parametrize("method", ["boxes", "cover", "foundation"])
def test_nothing_is_compiled_imported_or_prepared_after_binding(method):
    """A ball makes one contact and a block four, on a bent and a flat array; the hull of a mesh stands since bind."""
    command = [sys.executable, "-c", FIRST_TOUCHES, method]
    subprocess.run(command, check=True, cwd=pathlib.Path(__file__).parents[2])  # noqa: S603 -- ours


@pytest.mark.slow
@pytest.mark.parametrize("method", ["boxes", "foundation", "cover"])
def test_the_first_touch_costs_at_most_fifteen_usual_steps(method):
    """Without an earlier solution to start from a touch costs a few usual steps; the mesh has 400 corners."""
    ratios = []
    for start in range(3):
        spec = make_spec()
        sensor = fastmodel.attach(spec, "world", parameters(filter=None), contact=method, every=1)
        corners = np.random.default_rng(start).normal(size=(400, 3))
        spec.add_mesh(name="round", uservert=(5e-3 * corners / np.linalg.norm(corners, axis=1)[:, None]).ravel())
        add_body(spec, "mesh", [], [0, 0, 5.2e-3], free=True, meshname="round", mass=0.1)
        model = spec.compile()
        data = mujoco.MjData(model)
        sensor.bind(model)
        costs = []
        for _ in range(60):
            mujoco.mj_step(model, data)
            before = time.process_time()
            sensor.step(data)
            if sensor.carried():
                costs.append(time.process_time() - before)
        ratios.append(costs[0] / np.median(costs[1:]))
    assert min(ratios) < 15
