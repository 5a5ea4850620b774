"""Press the cases in Genesis, and read its sensor KinematicTaxel.

    python benchmarks/tactilebench/adapters/genesis_press.py --variant fitted
    python benchmarks/tactilebench/adapters/genesis_press.py --variant shipped

`fitted` has 4 x 4 points per texel, the force 3.9 E A (d / h)^1.04 of a point with the area A, which `softcover export
wts-0614-34 --format genesis` fits to that sensor, and the kernel of the case's cover as crosstalk.  `shipped` has one
point per texel and the sensor's own force 1000 N/m d, without crosstalk.  The probes' radius is 1 nm in both, because
the sensor adds it to the depth, not the default of 10 mm.  The body sinks until the points bear its
load; the rigid solver of Genesis decides alone which bodies touch.  Runs on the CPU; needs
`pip install genesis-world torch mujoco scipy`, and compiles for minutes before the first case, once.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import genesis as gs
import mujoco
import numpy as np
from bodies import FloatArray, find_reach, make_parser, make_parts, run
from mujoco_press import add_body
from scipy.optimize import brentq

from cases_as_softcover import make_cover
from meshes import TexelArray
from tactilebench import Case
from validation.simulator_values.models import POINTS_PER_TEXEL, tabulate_kernel

#: Points along each side of a texel, by variant.
POINTS = {"fitted": POINTS_PER_TEXEL, "shipped": 1}
#: Pressure at the depth h over Young's modulus, and exponent of the depth, of `fitted` [-].
FACTOR, EXPONENT = 3.9, 1.04
#: Least radius of a probe [m]: the sensor's depth is the radius and the depth of the probe.
RADIUS = 1e-9
#: Height of the rigid pad, half its width, first and last depth of the search [m].
HEIGHT, WIDTH, FIRST, DEEPEST = 2e-2, 0.1, 1e-6, 1e-2
#: Time step, in which nothing moves [s].
STEP = 1e-6


def list_points(case: Case, points: int) -> list[FloatArray]:
    """Return the places of points along x and y, over the texels and all that the body may touch [m]."""
    body = case.bodies[0]
    reach = find_reach(make_parts(body)) + max(case.pitch)
    inside = (np.arange(points) + 0.5) / points - 0.5
    places = []
    for axis, pitch in enumerate(case.pitch):
        middles = np.unique(case.centres[:, axis].round(9))
        before, behind = (max(0, int(np.ceil(each / pitch))) for each in (
            middles[0] - body.at[axis] + reach, body.at[axis] + reach - middles[-1]))  # fmt: skip
        cells = middles[0] + pitch * np.arange(-before, len(middles) + behind)
        places.append((cells[:, None] + pitch * inside).ravel())
    return places


def add_on_texels(case: Case, places: list[FloatArray], forces: FloatArray, points: int) -> FloatArray:
    """Add forces of points, shape (l, k), to the texels by the share of a point's cell that lies on them, (n,) [N]."""
    shares = []
    for axis, (pitch, size) in enumerate(zip(case.pitch, case.texel_size, strict=True)):
        middles, cell = np.unique(case.centres[:, axis].round(9)), pitch / points
        inside = (size + cell) / 2 - np.abs(places[axis] - middles[:, None])
        shares.append(np.clip(inside / cell, 0.0, min(1.0, size / cell)))
    return np.asarray((shares[1] @ forces @ shares[0].T).ravel())


class Scene:
    """A case in Genesis: a rigid body on a slide over a rigid pad with probes on its upper side, the plane z = 0."""

    def __init__(self, case: Case, variant: str, *, crosstalk: bool) -> None:
        self.places, points = list_points(case, POINTS[variant]), POINTS[variant]
        self._scene = gs.Scene(
            sim_options=gs.options.SimOptions(dt=STEP, gravity=(0, 0, 0)), show_viewer=False,
            rigid_options=gs.options.RigidOptions(contact_pruning_tolerance=None),
        )  # fmt: skip
        pad = self._scene.add_entity(
            gs.morphs.Box(pos=(0, 0, -HEIGHT / 2), size=(2 * WIDTH, 2 * WIDTH, HEIGHT), fixed=True)
        )
        spec = mujoco.MjSpec()
        add_body(spec, case, fields=False)
        for mesh in spec.meshes:  # depth counts from the nearest face, which must not be the back of a flat hull
            corners = np.reshape(mesh.uservert, (-1, 3))
            mesh.uservert = np.vstack([corners, np.add(corners, (0, 0, HEIGHT))]).ravel()
        spec.compile()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "body.xml"
            path.write_text(spec.to_xml())
            self._body = self._scene.add_entity(gs.morphs.MJCF(file=str(path), convexify=True, decimate=False))
            options = {"normal_stiffness": 1000.0}
            if variant == "fitted":
                cell, cover = [pitch / points for pitch in case.pitch], make_cover(case)
                modulus = FACTOR * case.cover.layers[0].youngs_modulus
                options = {
                    "normal_stiffness": modulus * cell[0] * cell[1] / cover.thickness**EXPONENT,
                    "normal_exponent": EXPONENT,
                }
                if crosstalk:
                    options["crosstalk_kernel"] = tabulate_kernel(cover, TexelArray.grid(3, 3, tuple(cell)))
            x, y = np.meshgrid(*self.places)
            self._sensor = self._scene.add_sensor(gs.sensors.KinematicTaxel(
                entity_idx=pad.idx, probe_local_pos=np.stack([x, y, np.full_like(x, HEIGHT / 2)], axis=-1),
                probe_radius=RADIUS, normal_damping=0.0, shear_scalar=0.0, twist_scalar=0.0, **options))  # fmt: skip
            self._scene.build()

    def touch(self, depth: float) -> FloatArray:
        """Sink the body to a depth [m], and return the forces at the points, shape (l, k) [N]."""
        self._body.set_dofs_position([-depth])
        self._body.zero_all_dofs_velocity()
        self._scene.step()
        return -np.asarray(self._sensor.read().force, dtype=np.float64)[..., 2]


def press(case: Case, variant: str) -> FloatArray:
    """Return the forces on the texels of a case, shape (n,) [N]; none where the points never bear its load."""
    scene, load = Scene(case, variant, crosstalk=False), case.bodies[0].load

    def miss(depth: float) -> float:
        return float(scene.touch(depth).sum()) - load

    before, depth = 0.0, FIRST
    while miss(depth) < 0:
        before, depth = depth, 1.2 * depth
        if depth > DEEPEST:
            return np.zeros(len(case.centres))
    depth = brentq(miss, before, depth, xtol=1e-9, rtol=1e-6) if before else depth
    forces = Scene(case, variant, crosstalk=True).touch(depth)
    return add_on_texels(case, scene.places, forces, POINTS[variant])


def main() -> int:
    """Press the cases and score them."""
    parser = make_parser(__doc__)
    parser.add_argument("--variant", choices=POINTS, default="fitted", help="points, force and crosstalk")
    options = parser.parse_args()
    gs.init(backend=gs.cpu, precision="64", logging_level="error")
    words = {
        "fitted": "force fitted to one sensor, kernel of the layer",
        "shipped": "force as shipped, one point per texel",
    }[options.variant]
    name = f"genesis-{options.variant}"
    return run(
        options, name, f"Genesis, KinematicTaxel, {words}", lambda case: press(case, options.variant),
        package="genesis-world",
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
