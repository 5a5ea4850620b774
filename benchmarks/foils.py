"""Score the fast model under stiff foils on soft layers, and its cost of a reading, against finite strain.

Balls of 2, 4 and 8 mm radius on three covers and two positions, 0.2 to 2 N.  Takes about a minute with an empty store.

    python benchmarks/foils.py
"""

from __future__ import annotations

import dataclasses
import time

import mujoco
import numpy as np

import fastmodel
from fastmodel import WTS_0614_34, Gaussian, Parameters
from fastmodel.bench import TIMESTEP, add_indenter
from fem_reference import point_spread
from fem_reference.indentation.ball_path import press_ball
from meshes import Cover, Layer, Material, Sphere, TexelArray
from meshes.catalogue import MATERIALS
from validation.derivation.contact_range import measure_misplaced, press_ball_on_array, state_range
from validation.derivation.kernel import cover_cells

RADII = (2e-3, 4e-3, 8e-3)
LOADS = (0.2, 0.5, 1.0, 2.0)
PLACES = ((0.0, 0.0), (0.3, -0.1))


def linear(name: str, modulus: float, ratio: float) -> Material:
    """A stiff material."""
    return Material(name=name, model="linear-elastic", parameters={"youngs_modulus": modulus}, poisson_ratio=ratio)


def covers() -> dict[str, tuple[Cover, float]]:
    """Covers with a foil, from the soft layer up, and the pitch over them [m]."""
    foam = Material(name="foam", model="neo-hookean", parameters={"shear_modulus": 20e3}, poisson_ratio=0.2)
    stacks = {
        "3 GPa on Ecoflex 00-30": (1.5e-3, MATERIALS["ecoflex-00-30"], 0.1e-3, linear("foil", 3e9, 0.38), 2.5e-3),
        "PET on Dragon Skin 10": (2e-3, MATERIALS["dragon-skin-10"], 0.125e-3, linear("PET", 3.5e9, 0.38), 3.4e-3),
        "steel on foam": (3e-3, foam, 0.05e-3, linear("steel", 200e9, 0.3), 3.4e-3),
    }
    return {
        name: (Cover(layers=(Layer(thickness=a, material=soft), Layer(thickness=b, material=stiff))), pitch)
        for name, (a, soft, b, stiff, pitch) in stacks.items()
    }


def references(cover: Cover, radius: float):  # noqa: ANN201
    """Base pressures per force at `LOADS`, interpolated linearly between depths of a path."""
    path = press_ball(cover, radius, [share * cover.thickness for share in np.geomspace(0.01, 0.4, 16)])
    for load in LOADS:
        after = int(np.clip(np.searchsorted(path.load, load), 1, len(path.load) - 1))
        share = (load - path.load[after - 1]) / (path.load[after] - path.load[after - 1])
        before, later = path.base[after - 1], path.base[after]
        pressure = (1 - share) * before.pressure_per_force + share * later.pressure_per_force
        yield load, dataclasses.replace(before, pressure_per_force=pressure)


def cost(parameters: Parameters, steps: int = 400) -> float:
    """Processor time of a reading of a sliding ball [us]."""
    spec = mujoco.MjSpec()
    fastmodel.recommend_options(spec)
    spec.option.timestep = TIMESTEP
    sensor = fastmodel.attach(spec, "world", parameters, every=1)
    body = add_indenter(spec, Sphere(radius=4e-3), 1.0)
    body.add_joint(name="slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    sensor.bind(model)
    for _ in range(300):
        mujoco.mj_step(model, data)
        sensor.step(data)
    data.joint("slide").qvel[0] = 0.02
    total = 0.0
    for _ in range(steps):
        mujoco.mj_step(model, data)
        started = time.process_time()
        sensor.step(data)
        total += time.process_time() - started
    return 1e6 * total / steps


def main() -> None:
    """Print the tables."""
    for name, (cover, pitch) in covers().items():
        array = TexelArray.grid(8, 8, pitch)
        spread = point_spread(cover)
        plain = Parameters(
            array=array,
            spread=Gaussian(sigma_x=0.5, sigma_y=0.5, ksize_x=3, ksize_y=3),
            electronics=WTS_0614_34,
            surface=cover_cells(cover, array, spread),
        )
        stretched = state_range(plain, cover, spread, press_ball_on_array(cover, array, None))
        print(f"{name}: misplaced [%] without and with tables under load, worst of {len(PLACES)} positions")
        for radius in RADII:
            line = f"  ball of {1e3 * radius:.0f} mm"
            for load, base in references(cover, radius):
                worst = [0.0, 0.0]
                for place in PLACES:
                    at = (place[0] * pitch, place[1] * pitch)
                    texels = base.texel_influence(array, at)[0]
                    wanted = load * np.append(texels, 1 - texels.sum())
                    for k, each in enumerate((plain, stretched)):
                        found = fastmodel.indent(each, Sphere(radius=radius), load=load, at=at)
                        part = measure_misplaced(np.append(found.texel_forces, found.outside), wanted)
                        worst[k] = max(worst[k], 100 * part)
                line += f"   {load:g} N {worst[0]:5.1f} {worst[1]:4.1f}"
            print(line)
        before, after = (min(cost(each) for _ in range(3)) for each in (plain, stretched))
        print(f"  cost of a reading {before:.0f} and {after:.0f} us: x{after / before:.2f}")


if __name__ == "__main__":
    main()
