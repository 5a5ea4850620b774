"""The fast model of a sensor with a curved cover: its arrays by finite elements, and one indentation."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from validation.errors import InputError
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fastmodel.surface import CoverPoints
    from fem_reference import Indentation
    from meshes import Indenter, Pose
    from meshes.array_types import FloatArray
    from meshes.solids import SolidMesh

#: Largest number of nodes of the top, middles of edges included, on which the fast model is derived: it needs one
#: solution per node, and keeps the displacement of each under a force on each [-].
_MOST_NODES = 5000


@dataclass(frozen=True, kw_only=True, eq=False)
class FastPress:
    """One indentation of a curved cover by the fast model.

    Attributes:
        texel_forces: Force on each texel along its normal, shape (n,) [N].
        forces: Force on each of m points of the surface against its normal, shape (m,) [N].
        force: Force of the indenter on the cover, shape (3,) [N].
        load: Component of `force` along the direction of motion [N].
        misplaced: Half the sum of the differences from the finite elements over the load; None without them [-].
        seconds: Wall time, without the derivation of the model [s].
    """

    texel_forces: FloatArray
    forces: FloatArray
    force: FloatArray
    load: float
    misplaced: float | None
    seconds: float

    def as_json(self) -> dict[str, Any]:
        """Return the result as a dictionary."""
        return {
            "texel_forces": self.texel_forces,
            "contact_forces": None,  # they act on points of the surface, not on texels
            "outside": 0.0,
            "total_force": self.load,
            "method": "curved",
            "depth": None,
            "seconds": self.seconds,
            "force": self.force,
            "misplaced_force": self.misplaced,
            "warnings": [],
        }


def choose_mesh(meshes: tuple[SolidMesh, ...]) -> SolidMesh | None:
    """Choose the mesh on which the fast model is derived: the second of three, or a coarser one; None if all are large.

    Args:
        meshes: Meshes of the cover, coarsest first.
    """
    from fem_reference.curved_cover.responses import find_top

    for mesh in reversed(meshes[: 1 + len(meshes) // 2]):
        if len(find_top(mesh).nodes) <= _MOST_NODES:
            return mesh
    return None


def derive_fast_model(
    sensor: SensorDescription, meshes: tuple[SolidMesh, ...], progress: Callable[[str], None] | None = None
) -> CoverPoints | None:
    """Derive the arrays of the fast model; None if even the coarsest mesh has too many nodes on its top.

    Args:
        sensor: A sensor with a curved cover.
        meshes: Meshes of the cover, coarsest first.
        progress: Called with a line of text before the solution.
    """
    from validation.derivation.curved import derive_curved_cover

    mesh = choose_mesh(meshes)
    if mesh is None:
        return None
    if progress is not None:
        progress("fast model, compliance of the surface")
    return derive_curved_cover(mesh, sensor.array, sensor.cover.layers[0].material)


def press_fast(
    cover: CoverPoints, indenter: Indenter, pose: Pose, load: float, known: Indentation | None = None
) -> FastPress:
    """Press an indenter by the fast model.

    Args:
        cover: Arrays of the fast model.
        indenter: The indenter.
        pose: Place and direction.
        load: Force along the direction [N].
        known: Result of the finite elements under the same load, with which the texel forces are compared.

    Raises:
        InputError: If the indenter never touches, or the contact was not found.
    """
    from fastmodel.contact.points import press_points
    from fastmodel.errors import FastModelError

    started = time.perf_counter()
    try:
        found = press_points(cover, indenter, pose, load=load, direction=pose.towards)
    except FastModelError as error:
        raise InputError(f"fast model: {error}") from None
    seconds = time.perf_counter() - started
    misplaced = None
    if known is not None:
        misplaced = float(np.abs(found.texel_forces - known.texel_forces).sum() / (2 * load))
    return FastPress(
        texel_forces=found.texel_forces,
        forces=found.forces,
        force=found.force,
        load=load,
        misplaced=misplaced,
        seconds=seconds,
    )
