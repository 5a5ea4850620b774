"""Responses of the texels of a curved cover, and the numbers that describe them."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from meshes.array_types import FloatArray
from meshes.solids.texels import tangent_axes
from validation.curved.press import describe_mesh, make_meshes
from validation.results.derivation import CurvedResponses
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fastmodel import Parameters
    from fastmodel.fitting.gaussian import SurfaceGaussian
    from fem_reference.curved_cover import TexelResponses
    from meshes.solids import SolidMesh

#: Number of points along each edge of a texel at which a uniform load on the texel is sampled [-].
_POINTS = 3
#: Largest number of texels that a warning names [-].
_NAMED = 8


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class CurvedDerivation:
    """Responses of the n texels of a curved cover.

    Attributes:
        sensor: The sensor.
        responses: Force on each texel per unit force anywhere on the top.
        seconds: Wall time [s].
    """

    sensor: SensorDescription
    responses: TexelResponses
    seconds: float

    @property
    def mesh(self) -> SolidMesh:
        """Finest mesh."""
        return self.responses.finest.mesh

    @cached_property
    def uniform(self) -> FloatArray:
        """Force on each texel (column) per unit force spread evenly over the top above each texel (row), shape (n, n).

        The force acts against the normal of the loaded texel.
        """
        texels, grid = self.sensor.array, self.responses.finest
        points, weights = np.polynomial.legendre.leggauss(_POINTS)
        u, v = np.meshgrid(points / 2, points / 2)
        weight = np.outer(weights, weights).ravel() / 4
        edges = tangent_axes(texels.normals) * np.array(texels.texel_size)[:, None]
        offset = u.reshape(1, -1, 1) * edges[:, [0]] + v.reshape(1, -1, 1) * edges[:, [1]]
        wanted = self.responses.above[:, None] + offset
        onto = grid.top.locate(wanted.reshape(-1, 3))[0] @ grid.top.nodes
        towards = np.broadcast_to(-texels.normals[:, None], wanted.shape).reshape(-1, 3)
        found = grid.at(onto, towards).reshape(*wanted.shape[:2], -1)
        return np.asarray(np.einsum("q,lqn->ln", weight, found))

    @cached_property
    def own_shares(self) -> FloatArray:
        """Force on each texel under a unit point force on the top above it, shape (n,) [-]."""
        return np.diag(self.responses.matrix)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about responses that do not mean what they say."""
        lost = np.flatnonzero(self.responses.uncovered & self.sensor.array.active)
        if not len(lost):
            return ()
        named = ", ".join(map(str, lost[:_NAMED])) + (f" and {len(lost) - _NAMED} more" if len(lost) > _NAMED else "")
        sentence = (
            f"no surface of the cover lies above texel {named} along the normal: the response there is to a force on "
            "the nearest point; check normals and places, or switch such texels off"
        )
        return (sentence,)

    @cached_property
    def gaussian(self) -> SurfaceGaussian:
        """Gaussian in surface coordinates, fitted to the responses to uniform loads."""
        from fastmodel.fitting.gaussian import fit_surface_gaussian

        return fit_surface_gaussian(self.sensor.array, self.uniform)

    @cached_property
    def parameters(self) -> Parameters:
        """Parameters of the fast model: texels, compliance and influence of the surface, and the electronics.

        Without a mesh small enough for the compliance, the tabulated spread of loads on texels stands alone.
        """
        from importlib.metadata import version

        from fastmodel.parameters import Parameters
        from fastmodel.signal.point_spread import Tabulated
        from validation.curved.fast import derive_fast_model

        sensor = self.sensor
        return Parameters(
            array=sensor.array,
            spread=Tabulated(matrix=self.uniform.T.copy(), source="finite elements of the curved cover"),
            filter=sensor.filter,
            electronics=sensor.electronics,
            surface=derive_fast_model(sensor, tuple(grid.mesh for grid in self.responses.grids)),
            provenance={
                "softcover": version("softcover"),
                "sensor": sensor.name,
                "cover_assumed": sensor.cover.assumed,
                "electronics_assumed": sensor.assumed_electronics,
                "mesh": self.mesh.digest,
            },
        )

    @property
    def error_estimate(self) -> Mapping[str, float]:
        """Estimated errors of the responses over the largest texel force, by name [-]."""
        return self.responses.error_estimate

    @property
    def verification(self) -> Mapping[str, float]:
        """Differences from closed forms: none is known for the responses of a solid."""
        return {}

    @property
    def result(self) -> CurvedResponses:
        """What is written of the derivation."""
        sensor, array = self.sensor, self.sensor.array
        return CurvedResponses(
            sensor=sensor.name,
            cover=sensor.describe_cover(),
            texels={
                "centres_m": array.centres,
                "normals": array.normals,
                "size_m": array.texel_size,
                "active": array.active,
            },
            above_m=self.responses.above,
            texel_response=self.responses.matrix,
            texel_response_uniform=self.uniform,
            gaussian={"sigma_m": self.gaussian.sigma, "residual": self.gaussian.residual},
            error_estimate=self.responses.error_estimate,
            meshes=tuple(describe_mesh(grid.mesh) for grid in self.responses.grids),
            notes=sensor.cover.notes,
            warnings=self.warnings,
            assumed_electronics=sensor.assumed_electronics,
            seconds=self.seconds,
        )


def derive_curved(sensor: SensorDescription, *, progress: Callable[[str], None] | None = None) -> CurvedDerivation:
    """Compute the responses of all texels of a curved cover, or read them from the store.

    Args:
        sensor: A sensor with a curved cover.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If the mesh or a texel cannot be used, with one line per fault.
    """
    from fem_reference.curved_cover import texel_responses

    started = time.perf_counter()
    meshes = make_meshes(sensor, progress)
    responses = texel_responses(meshes, sensor.array, sensor.cover.layers[0].material, progress=progress)
    return CurvedDerivation(sensor=sensor, responses=responses, seconds=time.perf_counter() - started)
