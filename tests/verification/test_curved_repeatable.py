"""The same input, mesh file and number of threads give the same results of curved covers bit by bit."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from meshes.solids import phalanx, write_mesh

PROGRAM = """
import hashlib, sys
from pathlib import Path
from fem_reference import press
from fem_reference.curved_cover import texel_responses
from meshes import Material, Sphere
from meshes.solids import phalanx, read_mesh
from meshes.pose import Pose
from meshes.solids.covers import take_meshes

meshes = [read_mesh(Path(name)) for name in sys.argv[2:]]
rubber = Material(name="neo", model="neo-hookean", parameters={"shear_modulus": 3e5}, poisson_ratio=0.49)
cover, ball = phalanx(length=10e-3, rows=3, columns=3), Sphere(radius=4e-3)
pose = Pose.facing([1e-3, 0.4e-3, 12e-3], [-0.2, 0, -1])
found = press(take_meshes(meshes, rubber), cover.texels, ball, pose, load=0.3, strain=sys.argv[1])
arrays = (
    texel_responses(meshes, cover.texels, rubber).matrix, found.texel_forces, found.contact_forces, found.displacement
)
digest = hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()
print(digest, found.depth.hex(), found.total_force.hex())
"""


@pytest.mark.slow
def test_two_processes_find_the_same_bits(tmp_path):
    cover = phalanx(length=10e-3, rows=3, columns=3)
    names = []
    for number, size in enumerate((3.6e-3, 3.0e-3)):
        names.append(str(tmp_path / f"{number}.npz"))
        write_mesh(tmp_path / f"{number}.npz", cover.mesh(size, layers=2))
    found = []
    for run in ("one", "other"):
        limits = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "2")
        place = {"SOFTCOVER_STORE": str(tmp_path / run)}
        done = subprocess.run(  # noqa: S603 -- our own program
            [sys.executable, "-c", PROGRAM, "finite", *names],
            env={**os.environ, **limits, **place}, capture_output=True, text=True, check=True,
        )  # fmt: skip
        found.append(done.stdout)
    assert found[0] == found[1]
    assert len(found[0].split()) == 3
