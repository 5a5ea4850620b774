"""A disk with a rounded edge deep in rubber, by FElupe: an independent value for tests.

    PYTHON_WITH_FELUPE benchmarks/disk_felupe.py

A disk of 1.696 mm radius with an edge of 0.0934 mm, rounded as `fem_reference.finite_strain.indenter_surface` does,
goes 36 % of the thickness deep into a bonded neo-Hookean layer of 1.297 mm, 2.423 MPa and Poisson ratio 0.4.  Prints
the force under two penalties and its extrapolation to a rigid contact: the error is proportional to 1 over the penalty.
"""

from __future__ import annotations

import numpy as np
from finite_strain_felupe import STEEPEST, Ball, body_of, follow, held_of

#: Lengths over the thickness [-], shear modulus [Pa] and thickness [m].
RADIUS, FILLET, DEPTH, SHEAR, THICKNESS = 1.696 / 1.297, 0.0934 / 1.297, 0.36, 2.423e6 / 2.8, 1.297e-3
#: Steps of the depth, elements through the layer, and penalties over the shear modulus per thickness.
STEPS, ELEMENTS, PENALTIES = 60, 10, (1000.0, 3000.0)


class Disk(Ball):
    """The contact of `Ball` under a flat face with a rounded edge, which goes on as a cone of slope `STEEPEST`."""

    def _at(self) -> tuple:
        u = np.einsum("qa,fai->fqi", self.shape, self.field[0].values[self.nodes])
        beyond = np.maximum(self.r + u[..., 1] - (RADIUS - FILLET), 0.0)
        ramp = FILLET / 2
        steep = ramp / 2 + STEEPEST * FILLET
        arc, bend = np.clip(beyond, ramp, steep) - ramp, np.minimum(beyond, ramp)
        height = bend**3 / (6 * FILLET * ramp) + (ramp * arc + arc**2) / (2 * FILLET)
        height += STEEPEST * np.maximum(beyond - steep, 0)
        slope = bend**2 / (2 * FILLET * ramp) + arc / FILLET
        curvature = np.where(beyond < ramp, beyond / (FILLET * ramp), (beyond < steep) / FILLET)
        pressed = self.penalty * (u[..., 0] + self.depth - height)
        touching = pressed > 0
        normal = np.stack([np.ones_like(slope), -slope], axis=-1)
        return np.where(touching, pressed, 0.0) * self.weight, touching * self.weight, normal, curvature


def press(penalty: float) -> float:
    """Press the disk in steps, and return its force [N]."""
    fine = 0.6 * FILLET
    radii = [
        *np.arange(0, RADIUS - 3 * FILLET, 0.6 / ELEMENTS),
        *np.arange(RADIUS - 3 * FILLET, RADIUS + 3 * FILLET, fine),
    ]
    size = fine
    while radii[-1] < 12:
        radii.append(radii[-1] + size)
        size = min(1.25 * size, 0.8)
    task = {
        "shape": "ball", "fields": "two", "radius": radii[-1], "through": ELEMENTS, "across": len(radii) - 1,
        "radii": radii, "bulk": 2.8 / (3 * 0.2), "travels": np.linspace(0, DEPTH, STEPS + 1)[1:].tolist(),
        "tolerance": 1e-8, "solver": "scipy",
    }  # fmt: skip
    field, body = body_of(task)
    disk = Disk(field, 1.0, penalty)
    for _ in follow(task, field, body, held_of(task, field[0]), disk):
        pass
    return float(disk.total) * SHEAR * THICKNESS**2


if __name__ == "__main__":
    soft, hard = (press(penalty) for penalty in PENALTIES)
    limit = hard + (hard - soft) * PENALTIES[0] / (PENALTIES[1] - PENALTIES[0])
    print(f"{soft:.3f} N, {hard:.3f} N; rigid contact {limit:.3f} N")
