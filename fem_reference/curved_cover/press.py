"""Press a rigid indenter into a solid cover from any direction: the solver of `SolidCover`."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from fem_reference import result_store
from fem_reference.curved_cover.finite_strain import press_finite
from fem_reference.curved_cover.small_strain import press_small
from fem_reference.errors import UnsupportedError
from fem_reference.indentation.problem import PressProblem
from fem_reference.indentation.result import Indentation
from meshes import Material, SolidCover
from meshes.solids.solid_mesh import SolidMesh


def press_solid(cover: SolidCover, problem: PressProblem) -> list[Indentation]:
    """Press an indenter into a solid at every target of a problem, or read the results from the store.

    The indenter moves from its pose along the direction until it touches, and on until load or depth are reached.

    Raises:
        ValueError: If the cover cannot be meshed, or the indenter never touches.
        UnsupportedError: If there is slip, or finite strain is asked for with friction or tilt, or finer meshes.
        PiercedError: If the indenter would go through most of the cover.
        ConvergenceError: If the contact or the load is not found.
    """
    finite = problem.strain == "finite"
    if problem.friction not in {0.0, np.inf}:
        raise UnsupportedError(
            f"{problem.friction:g} is not computed on curved covers; accepted: 0 and no-slip", "friction"
        )
    if problem.friction and finite:
        raise UnsupportedError(
            "on curved covers no slip is computed at small strain only; write --strain small", "friction"
        )
    if finite and any(problem.pose.tilt):
        raise UnsupportedError(
            "at finite strain the indenter moves along its own axis; turn it to look along the direction", "tilt"
        )
    if problem.accuracy is not None:
        raise UnsupportedError("the meshes of a curved cover are given; leave it out", "accuracy")
    meshes = cover.meshes(problem.progress)
    return [_press_stored(meshes, cover.material, problem, target) for target in problem.targets]


def _press_stored(
    meshes: tuple[SolidMesh, ...], material: Material, problem: PressProblem, target: float
) -> Indentation:
    """Press to one target, or read the result from the store."""
    started = time.perf_counter()

    def compute() -> dict[str, Any]:
        solve = press_finite if problem.strain == "finite" else press_small
        found = solve(meshes, material, problem, target)
        number = next(k for k, mesh in enumerate(meshes) if mesh is found.mesh)
        return found.pack() | {"number": np.array(number)}

    inputs = {
        "meshes": [mesh.digest for mesh in meshes], "material": material, "texels": problem.array,
        "indenter": problem.indenter, "pose": problem.pose, problem.control: target,
        "friction": problem.friction, "finite": problem.strain == "finite",
    }  # fmt: skip
    stored = dict(result_store.fetch("solid-press", inputs, compute))
    found = Indentation.unpack(stored, mesh=meshes[int(stored.pop("number"))])
    return replace(found, seconds=time.perf_counter() - started)
