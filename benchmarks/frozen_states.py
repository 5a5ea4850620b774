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
import copy
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

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
from tests.support.rubber import make_cover

COVER = make_cover(model="linear-elastic")
#: Least force of a state [N]; draws from each run [-]; share of its time that a gripper runs [-].
LEAST, DRAWS, SHARE = 0.5, 8, 0.4
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
                sides |= abs(self._axes[:, 2] @ contact.frame[:3]) < 0.7  # noqa: PLR2004 -- as in `grippers`
        self.load, centre, array = float(front[2]), front[:2] / max(front[2], LEAST), settings.array
        off = (np.abs(centre) > np.array(array.pitch) * (array.columns, array.rows) / 2).any()
        self.reason = "light" if self.load < LEAST else "side of the plate" if sides else "off the texels" if off else ""
        if self.reason:
            return
        thing, self._half = model.body("thing"), half[:2]
        self._geoms, self.at, self._lowest = range(thing.geomadr[0], thing.geomadr[0] + thing.geomnum[0]), 0.0, 0.0
        grid = np.meshgrid(*(np.arange(-each, each, SPACING) for each in half[:2]))
        self.at = np.zeros(2)
        heights = self.gap(*grid)
        self._lowest, low = heights.min(), heights <= heights.min() + REACH
        ends = [(max(each[low].min() - SPACING, -h), min(each[low].max() + SPACING, h)) for each, h in zip(grid, half)]
        self.at, self.footprint = np.mean(ends, axis=1), tuple((np.ptp(ends, axis=1) / 2).tolist())
        self.centre = centre - self.at

    def gap(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height over the lowest point, by MuJoCo's rays; inf beside the body or the plate [m]."""
        places, up = np.column_stack([x.ravel(), y.ravel()]) + self.at, self._axes[:, 2]
        starts = self._origin + np.column_stack([places, np.full(x.size, -BEHIND)]) @ self._axes.T
        over, heights = (np.abs(places) <= self._half).all(axis=1), np.full(x.size, np.inf)
        for geom in self._geoms:
            place, turn, size = (
                getattr(*each)[geom]
                for each in ((self._data, "geom_xpos"), (self._data, "geom_xmat"), (self._model, "geom_size"))
            )
            kind, away = self._model.geom_type[geom], np.linalg.norm(np.cross(starts - place, up), axis=1)
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


def score(frozen: FrozenBody, reference, found) -> dict:  # noqa: ANN001 -- any two results with texel forces
    """Misplaced force [%] and smallest contact force [N] of one result."""
    return {"misplaced": misplaced(reference, found, frozen.load), "least": float(found.contact_forces.min())}


def press_others(frozen: FrozenBody, reference, settings: Parameters) -> Iterator[tuple[str, dict]]:  # noqa: ANN001
    """Press the body with the methods that do not read MuJoCo's plate."""
    place = {"load": frozen.load, "at": tuple(frozen.at.tolist()), "centre": tuple(frozen.centre.tolist())}
    for method, contact in list(METHODS.items())[2:]:
        results = []
        for guided in (True, False):
            try:
                placement = Placement(indenter=frozen, guided=guided, **place)
                found = fastmodel.indent_together(settings, [placement], contact=contact)
            except fastmodel.FastModelError:
                continue
            results.append(score(frozen, reference, found))
        if results:
            yield method, min(results, key=lambda each: each["misplaced"])


def freeze(count: int, seed: int, *, others: bool = True) -> tuple[list[dict], Counter[str]]:
    """Score states until there are enough; return their rows, and how often a draw was left out for which reason."""
    random, rows, reasons, states = np.random.default_rng(seed), [], Counter(), 0
    for title, scene in run_scenes(random):
        for sensor in scene.sensors:
            model, settings = scene.model, sensor.parameters
            frozen = FrozenBody(model, copy.copy(scene.data), sensor.name, settings)
            if frozen.reason:
                reasons[frozen.reason] += 1
                continue
            body = {"load": frozen.load, "at": tuple(frozen.at.tolist()), "centre": tuple(frozen.centre.tolist())}
            try:
                reference = press_together(COVER, settings.array, [Body(indenter=frozen, guided=False, **body)])
            except (fastmodel.FastModelError, RuntimeError) as error:
                reasons[type(error).__name__] += 1
                continue
            frame, plain = sensor.frame(), fastmodel.METHODS["foundation"]
            reader = plain.bind(model, settings.array, sensor.name, surface=settings.surface)
            read = reader.read(scene.data)
            cover = SimpleNamespace(
                texel_forces=frame.texel_forces, outside=frame.outside, contact_forces=sensor.contact_forces()
            )
            simple = SimpleNamespace(**read._asdict(), outside=read.carried - read.texel_forces.sum())
            found = [("cover", score(frozen, reference, cover)), ("foundation", score(frozen, reference, simple))]
            state = {
                "state": title, "time": scene.data.time, "array": sensor.name, "load": frozen.load,
                "slope": float(np.abs(reference.slopes).max()),
                "error": 100 * reference.error_estimate["misplaced"],
                "missed": 1e3 * float(np.linalg.norm(frame.missed_torque)) / frozen.load,
            }
            print({**state, **dict(found)}, flush=True)
            rows += [{**state, "method": m, **f} for m, f in [*found, *(press_others(frozen, reference, settings) if others else [])]]
            states += 1
            if states == count:
                return rows, reasons
    return rows, reasons


def main() -> None:
    """Score and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--states", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    use_distance_fields()
    rows, reasons = freeze(options.states, options.seed)
    for method in METHODS:
        mine = [row for row in rows if row["method"] == method]
        values = np.array([row["misplaced"] for row in mine])
        print(
            f"{method:<20} states {len(mine):4d}   misplaced {np.median(values):6.2f} % in the median, at most "
            f"{values.max():6.2f} %   smallest contact force {min(row['least'] for row in mine):.1e} N"
        )
    print("left out:", ", ".join(f"{count} {reason}" for reason, count in reasons.items()))
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
