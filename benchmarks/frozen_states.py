"""Score the contact methods in states of free bodies and turned grasps, drawn from the runs of `grippers.py`.

The finite elements press the body in the pose, with the force and at the centre of pressure that it has in MuJoCo; it
may tilt about this centre, as in `fastmodel_scores.tilting_block`.  Its surface is found by MuJoCo's rays, edges and
all, up to `REACH` above its lowest point and as far as the plate extends; contact with the plate's sides is left out.
The cover of the reference is laterally wide.  The readings of `cover` and `foundation` are those of the step.  The
other methods press the body in this pose on an array of their own, guided and free to tilt; the better result counts.

    python -m pip install --no-deps --target /tmp/robosuite robosuite
    PYTHONPATH=/tmp/robosuite python -W ignore benchmarks/frozen_states.py [--states 100] [--seed 0] [--json FILE]
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import itertools
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from fastmodel_scores import misplaced
from gripper_scenes import FREE, GRIPPERS, OBJECTS, FloatArray, FreeScene, Scene, find_package
from grippers import SECONDS, TIMESTEP, command, random_turn
from other_methods import METHODS, use_distance_fields
from scipy.spatial.transform import Rotation

import fastmodel
from fastmodel import Parameters, Placement
from fem_reference.small_strain_contact.several_indenters import Body, press_together
from meshes import Indenter
from meshes.indenters.shapes import Primitive
from meshes.tilt import MOST_TILT
from tests.support.rubber import make_cover

COVER = make_cover(model="linear-elastic")
#: Least force of a state [N]; draws from each run [-]; share of its time that a gripper runs [-].
LEAST, DRAWS, SHARE = 0.5, 3, 0.4
#: Height above its lowest point up to which a body is pressed; spacing of the points by which this part is found;
#: distance behind the front from which rays look for the body [m].
REACH, SPACING, BEHIND = 2e-3, 0.25e-3, 40e-3
#: Points of a ball, by which an ellipsoid becomes a hull.
BALL = np.random.default_rng(0).normal(size=(1000, 3))
#: Numbers that give the size of a geom, of kinds that `Primitive` knows.
SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3}


class FrozenBody(Indenter):
    """The lower surface of a body over a plate in one state, in the plate's frame moved to the middle of the surface.

    Attributes:
        footprint: See `Indenter` [m].
        reason: Why the state does not count; empty if it does.
        load: Force of the contacts with the front of the plate along its normal [N].
        at: Middle of the surface in the plate's frame, shape (2,) [m].
        centre: Centre of the force, from `at`, shape (2,) [m].
    """

    footprint = (0.0, 0.0)

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, name: str, settings: Parameters) -> None:
        """Find force and surface."""
        self._model, self._data, plate = model, data, model.geom(f"{name}/plate").id
        self._axes, half = data.geom_xmat[plate].reshape(3, 3), model.geom_size[plate]
        self._origin, front = data.geom_xpos[plate] + half[2] * self._axes[:, 2], np.zeros(3)
        found, sides = np.zeros(6), False
        for index, contact in enumerate(data.contact):
            if plate in contact.geom:
                mujoco.mj_contactForce(model, data, index, found)
                sign = 1.0 if contact.geom[1] == plate else -1.0
                force = -sign * self._axes[:, 2] @ contact.frame.reshape(3, 3).T @ found[:3]
                front += force * np.append((contact.pos - self._origin) @ self._axes[:, :2], 1.0)
                sides |= abs(self._axes[:, 2] @ contact.frame[:3]) < 0.7
        self.load, centre, array = float(front[2]), front[:2] / max(front[2], LEAST), settings.array
        off = (np.abs(centre) > np.array(array.pitch) * (array.columns, array.rows) / 2).any()
        tests = {"light": self.load < LEAST, "at a side of the plate": sides, "centre off the texels": off}
        self.reason = next((reason for reason, applies in tests.items() if applies), "")
        if self.reason:
            return
        thing, self._half, self._lowest, self.at = model.body("thing"), half[:2], 0.0, np.zeros(2)
        self._geoms = range(thing.geomadr[0], thing.geomadr[0] + thing.geomnum[0])
        grid = np.array(np.meshgrid(*(np.arange(-each, each, SPACING) for each in self._half)))
        heights = self.gap(*grid)
        self._lowest = heights.min()
        low = grid[:, heights <= self._lowest + REACH]
        ends = np.clip([low.min(axis=1) - SPACING, low.max(axis=1) + SPACING], -self._half, self._half)
        self.at, self.footprint = ends.mean(axis=0), tuple((np.ptp(ends, axis=0) / 2).tolist())
        self.centre = centre - self.at

    @property
    def settings(self) -> dict[str, Any]:
        """What `Body` and `Placement` have in common."""
        at, centre = tuple(self.at.tolist()), tuple(self.centre.tolist())
        return {"indenter": self, "load": self.load, "at": at, "centre": centre}

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height over the lowest point, by MuJoCo's rays; inf beside the body or the plate [m]."""
        places, up = np.column_stack([x.ravel(), y.ravel()]) + self.at, self._axes[:, 2]
        starts = self._origin + np.column_stack([places, np.full(x.size, -BEHIND)]) @ self._axes.T
        over, heights = (np.abs(places) <= self._half).all(axis=1), np.full(x.size, np.inf)
        for geom in self._geoms:
            place, turn = self._data.geom_xpos[geom], self._data.geom_xmat[geom]
            size, kind = self._model.geom_size[geom], self._model.geom_type[geom]
            away = np.linalg.norm(np.cross(starts - place, up), axis=1)
            for k in (over & (away <= self._model.geom_rbound[geom])).nonzero()[0]:
                if kind == mujoco.mjtGeom.mjGEOM_MESH:
                    distance = mujoco.mj_rayMesh(self._model, self._data, geom, starts[k], up)
                else:
                    distance = mujoco.mju_rayGeom(place, turn, size, starts[k], up, kind)
                if distance >= 0:
                    heights[k] = min(heights[k], distance - BEHIND - self._lowest)
        return heights.reshape(x.shape)

    def primitives(self) -> tuple[Primitive, ...]:
        """Return the geoms of the body, see `Indenter.primitives`; an ellipsoid becomes a hull."""
        out = []
        for geom in self._geoms:
            kind, size = mujoco.mjtGeom(self._model.geom_type[geom]).name[7:].lower(), self._model.geom_size[geom]
            place = (self._data.geom_xpos[geom] - self._origin) @ self._axes - [*self.at, self._lowest]
            turn = Rotation.from_matrix(self._axes.T @ self._data.geom_xmat[geom].reshape(3, 3))
            shape = {"kind": kind, "size": tuple(size[: SIZES.get(kind, 0)].tolist())}
            if kind not in SIZES:
                points = size * BALL / np.linalg.norm(BALL, axis=1, keepdims=True)
                if kind == "mesh":
                    mesh = self._model.mesh(self._model.geom_dataid[geom])
                    points = self._model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
                shape = {"kind": "hull", "vertices": tuple(map(tuple, points.tolist()))}
            out.append(Primitive(position=tuple(place), quaternion=tuple(turn.as_quat(scalar_first=True)), **shape))
        return tuple(out)


def run_scenes(random: np.random.Generator) -> Iterator[tuple[str, FreeScene | Scene]]:
    """Run scenes without end, one of each body and each gripper and object in turn; yield them at steps drawn."""
    grippers = [name for name in GRIPPERS if find_package(GRIPPERS[name].package)]
    pairs = [("free", thing) for thing in FREE] + [(name, thing) for name in grippers for thing in OBJECTS[:-1]]
    while True:
        for place, thing in random.permutation(pairs).tolist():
            if place == "free":
                scene, phases = FreeScene(thing, random), [("", round(1.0 / TIMESTEP))]
            else:
                scene = Scene(GRIPPERS[place], thing, Rotation.from_rotvec(random_turn(random)))
                phases = [(name, round(SHARE * seconds / TIMESTEP)) for name, seconds in SECONDS.items()]
            chance = DRAWS / sum(steps for _, steps in phases)
            for phase, steps in phases:
                for step in range(steps):
                    if phase:
                        command(scene, phase, (step + 1) / steps)
                    if phase == "lift" and not step:
                        scene.let_go()
                    scene.step()
                    if random.random() < chance:
                        yield f"{place} {thing}", scene


def press_others(frozen: FrozenBody, settings: Parameters, method: str) -> list[Any]:
    """Press the body by a method that does not read MuJoCo's plate, guided and free to tilt."""
    results = []
    for guided in (True, False):
        placement = Placement(guided=guided, **frozen.settings)
        with contextlib.suppress(fastmodel.FastModelError):  # it does not come to rest
            results.append(fastmodel.indent_together(settings, [placement], contact=METHODS[method]))
    return results


def read_step(scene: FreeScene | Scene, sensor: fastmodel.Sensor) -> dict[str, Any]:
    """What the methods that read MuJoCo's plate read at this step."""
    frame, settings = sensor.frame(), sensor.parameters
    foundation = fastmodel.METHODS["foundation"]
    reader = foundation.bind(scene.model, settings.array, sensor.name, surface=settings.surface)
    reading = reader.read(scene.data)
    return {
        "cover": SimpleNamespace(
            texel_forces=frame.texel_forces, outside=frame.outside, contact_forces=sensor.contact_forces()
        ),
        "foundation": SimpleNamespace(
            texel_forces=reading.texel_forces,
            outside=reading.carried - reading.texel_forces.sum(),
            contact_forces=reading.contact_forces,
        ),
    }


def score_states(random: np.random.Generator, methods: Sequence[str], reasons: Counter[str]) -> Iterator[list[dict]]:
    """Score one state after the other without end, a row per method; count the draws that are left out."""
    for title, scene in run_scenes(random):
        for sensor in scene.sensors:
            frozen = FrozenBody(scene.model, copy.copy(scene.data), sensor.name, sensor.parameters)
            if frozen.reason:
                reasons[frozen.reason] += 1
                continue
            reference = press_together(COVER, sensor.parameters.array, [Body(guided=False, **frozen.settings)])
            state = {
                "state": title,
                "time": scene.data.time,
                "load": frozen.load,
                "slope": float(np.abs(reference.slopes).max()),
                "error": 100 * reference.error_estimate["misplaced"],
            }
            if state["slope"] > np.tan(MOST_TILT):
                reasons["tilts by more than 10 degrees in the reference"] += 1
                continue
            found, rows = read_step(scene, sensor), []
            for method in methods:
                results = [found[method]] if method in found else press_others(frozen, sensor.parameters, method)
                scores = [(misplaced(reference, each, frozen.load), each.contact_forces.min()) for each in results]
                if scores:
                    share, least = map(float, min(scores))
                    rows.append({**state, "method": method, "misplaced": share, "least": least})
            yield rows


def main() -> None:
    """Score and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--states", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--own", action="store_true", help="score the methods `cover` and `foundation` alone")
    options = parser.parse_args()
    use_distance_fields()
    methods, reasons, rows = list(METHODS)[: 2 if options.own else None], Counter[str](), []
    states = score_states(np.random.default_rng(options.seed), methods, reasons)
    for found in itertools.islice(states, options.states):
        rows += found
        first = found[0]
        print(
            f"{first['state']:<18} {first['time']:.3f} s {first['load']:5.2f} N   tilts by {first['slope']:.3f}   "
            f"error of the reference {first['error']:.2f} %   "
            + "   ".join(f"{row['method']} {row['misplaced']:.2f} %" for row in found),
            flush=True,
        )
        if options.json:
            options.json.write_text(json.dumps(rows, indent=1))
    for method in methods:
        mine = [row for row in rows if row["method"] == method]
        shares = [row["misplaced"] for row in mine]
        print(
            f"{method:<18} {len(mine):4d} states   misplaced {np.median(shares):6.2f} % in the median, at most "
            f"{max(shares):6.2f} %   smallest contact force {min(row['least'] for row in mine):.1e} N"
        )
    print("left out:", ", ".join(f"{count} {reason}" for reason, count in reasons.items()))


if __name__ == "__main__":
    main()
