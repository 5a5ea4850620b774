"""Texel forces from MuJoCo Warp: balls press on one array in many worlds, on the processor or on a graphics card.

    python -m pip install mujoco-warp
    python examples/warp_worlds.py --worlds 8

MuJoCo Warp lists the contacts of all worlds together.  The script turns them into the array's frame, makes a gap image
of the ball in each world, and computes texel forces and images of all worlds at once.  It prints load, largest texel
force and largest grey level of every world.
"""

from __future__ import annotations

import argparse

import mujoco
import mujoco_warp
import numpy as np
import warp

import fastmodel
from fastmodel.pressure.cell_grid import CellGrid

#: Radius of the ball [m] and the largest force that pushes it down [N].
RADIUS, PUSH = 8e-3, 6.0
TIMESTEP = 1e-3


def build() -> tuple[mujoco.MjModel, fastmodel.Parameters, int, int]:
    """Build the model of one world; return it, the parameters, and the ids of the plate and of the ball."""
    parameters = fastmodel.load("wts-0614-34")
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    spec.option.timestep = TIMESTEP
    sensor = fastmodel.attach(spec, "world", parameters)
    body = spec.worldbody.add_body(pos=[0, 0, RADIUS])
    body.add_freejoint()
    ball = body.add_geom(name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], mass=0.1)
    model = spec.compile()
    plate = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{sensor.name}/plate")
    return model, parameters, plate, model.geom(ball.name).id


def list_contacts(model: mujoco_warp.Model, data: mujoco_warp.Data, plate: int) -> tuple[np.ndarray, ...]:
    """List world, point and force on the plate of every contact with it, in the frame of the world [-, m, N]."""
    count = int(data.nacon.numpy()[0])
    wrench = warp.zeros(data.naconmax, dtype=warp.spatial_vector)
    every = warp.array(np.arange(data.naconmax), dtype=int)
    mujoco_warp.contact_force(model, data, every, True, wrench)  # noqa: FBT003 -- in the frame of the world
    geoms, force = data.contact.geom.numpy()[:count], wrench.numpy()[:count, :3].astype(float)
    force[geoms[:, 0] == plate] *= -1  # it acts on the second geom
    mine = (geoms == plate).any(axis=1)
    world, point = data.contact.worldid.numpy()[:count], data.contact.pos.numpy()[:count].astype(float)
    return world[mine], point[mine], force[mine]


def measure_gaps(grid: CellGrid, centres: np.ndarray) -> np.ndarray:
    """Measure the gap below a ball at each cell, from centres in the array's frame (worlds, 3) [m]."""
    x, y = (
        low + (np.arange(n) + 0.5) * edge
        for low, n, edge in zip(grid.low, (grid.columns, grid.rows), grid.edge, strict=True)
    )
    away = (x - centres[:, 0, None, None]) ** 2 + (y[:, None] - centres[:, 1, None, None]) ** 2
    depth = np.sqrt(np.maximum(RADIUS**2 - away, 0))
    return np.where(away < RADIUS**2, centres[:, 2, None, None] - depth, np.inf)


def run(worlds: int, steps: int) -> tuple[fastmodel.ContactForces, np.ndarray]:
    """Press the ball with another force in every world; return the forces and the images of all worlds."""
    model, parameters, plate, ball = build()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    warp_model = mujoco_warp.put_model(model)
    warp_data = mujoco_warp.put_data(model, data, nworld=worlds, nconmax=8, njmax=64)
    push = np.zeros((worlds, model.nbody, 6))
    push[:, -1, 2] = -np.linspace(1, PUSH, worlds)
    warp_data.xfrc_applied = warp.array(push, dtype=warp.spatial_vector)
    contact = fastmodel.ContactFunctions(parameters)
    chain = fastmodel.ChainFunctions(parameters, 1 / TIMESTEP, spreads=False)
    state = None
    for _ in range(steps):
        mujoco_warp.step(warp_model, warp_data)
        world, points, forces = list_contacts(warp_model, warp_data, plate)
        # the array's frame lies in the top of the plate, with z outwards
        axes = warp_data.geom_xmat.numpy()[:, plate].astype(float)
        top = warp_data.geom_xpos.numpy()[:, plate] + model.geom_size[plate, 2] * axes[..., 2]
        points = np.einsum("ki,kij->kj", points - top[world], axes[world])
        forces = np.einsum("ki,kij->kj", forces, axes[world])
        centres = np.einsum("ki,kij->kj", warp_data.geom_xpos.numpy()[:, ball] - top, axes)
        found = contact.from_contacts(world, points, forces, worlds, measure_gaps(contact.grid, centres))
        state = chain.settle(found.texel_forces) if state is None else chain.take(state, found.texel_forces, found.load)
    return found, chain.frame(state)[1].image


def main() -> None:
    """Run and print one line per world."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--worlds", type=int, default=8, help="number of worlds")
    parser.add_argument("--steps", type=int, default=200, help="physics steps of 1 ms")
    options = parser.parse_args()
    found, images = run(options.worlds, options.steps)
    for k, (load, forces, image) in enumerate(zip(found.load, found.texel_forces, images, strict=True)):
        print(f"world {k}: load {load:.3f} N, largest texel force {forces.max():.3f} N, grey level {image.max()}")


if __name__ == "__main__":
    main()
