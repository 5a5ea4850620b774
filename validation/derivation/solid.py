"""Derivation for a solid cover: responses of its texels, and the numbers that describe them."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from meshes import SolidCover
from meshes.array_types import FloatArray
from meshes.solids.texels import tangent_axes
from validation.cover_meshes import describe_mesh, make_meshes
from validation.derivation.base import Progress, derive_cover, describe_provenance
from validation.derivation.kernel import gauss_points
from validation.places import find_middle
from validation.results.derivation import Responses, SurfaceKernel
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
class SolidDerivation:
    """Responses of the n texels of a solid cover, and the parameters of the sensor's fast model.

    Attributes:
        sensor: Description of the sensor.
        responses: Force on each texel per unit force anywhere on the top.
        seconds: Wall time of the responses [s].
    """

    sensor: SensorDescription
    responses: TexelResponses
    seconds: float

    @property
    def mesh(self) -> SolidMesh:
        """Finest mesh of the cover."""
        return self.responses.finest.mesh

    @cached_property
    def uniform(self) -> FloatArray:
        """Force on each texel (column) per unit force spread evenly over the top above each texel (row), shape (n, n).

        The force acts against the normal of the loaded texel.
        """
        texels, grid = self.sensor.array, self.responses.finest
        points, weight = gauss_points(texels.texel_size, _POINTS)
        wanted = self.responses.above[:, None] + points @ tangent_axes(texels.normals)
        onto = grid.top.locate(wanted.reshape(-1, 3))[0] @ grid.top.nodes
        towards = np.broadcast_to(-texels.normals[:, None], wanted.shape).reshape(-1, 3)
        found = grid.at(onto, towards).reshape(*wanted.shape[:2], -1)
        return np.asarray(np.einsum("q,lqn->ln", weight, found))

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """A sentence about texels without a surface above them."""
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

    @property
    def sigma(self) -> float:
        """Standard deviation of the fitted Gaussian along the first axis of the surface [m]."""
        return self.gaussian.sigma[0]

    @property
    def own_share(self) -> Mapping[str, float]:
        """Share of a load over the middle texel that this texel measures, by the load [-]."""
        middle = find_middle(self.sensor.array)
        return {
            "point": float(self.responses.matrix[middle, middle]),
            "uniform": float(self.uniform[middle, middle]),
        }

    @property
    def maps(self) -> Mapping[str, FloatArray]:
        """Forces under a uniform load on the middle texel, and those of the fitted Gaussian."""
        array = self.sensor.array
        loaded = find_middle(array)
        kernel = self.gaussian.spread(array, array.centres[[loaded]], array.normals[[loaded]])[0]
        return {f"uniform load over texel {loaded}": self.uniform[loaded], "Gaussian in surface coordinates": kernel}

    @cached_property
    def parameters(self) -> Parameters:
        """Parameters of the fast model: texels, compliance and influence of the surface, and the electronics.

        If no mesh is small enough for the compliance, the parameters have only the tabulated spread of loads on texels.
        """
        from fastmodel.parameters import Parameters
        from fastmodel.signal.point_spread import Tabulated
        from validation.derivation.cover_points import TOO_FINE, choose_mesh, derive_points

        sensor = self.sensor
        mesh = choose_mesh(tuple(grid.mesh for grid in self.responses.grids))
        surface = None if mesh is None else derive_points(mesh, sensor.array, sensor.cover.layers)
        provenance = describe_provenance(sensor) | {"mesh": self.mesh.digest}
        return Parameters(
            array=sensor.array,
            spread=Tabulated(matrix=self.uniform.T.copy(), source="finite elements of the curved cover"),
            filter=sensor.filter,
            electronics=sensor.electronics,
            surface=surface,
            provenance=provenance if surface else provenance | {"no_contact": TOO_FINE},
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
    def result(self) -> Responses:
        """Results of the derivation that are written to files."""
        sensor, array = self.sensor, self.sensor.array
        return Responses(
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
            gaussian=SurfaceKernel(sigma_m=self.gaussian.sigma, residual=self.gaussian.residual),
            calibration={"calibrated": sensor.electronics.calibrated, "tip": None},
            error_estimate=self.error_estimate,
            meshes=tuple(describe_mesh(grid.mesh) for grid in self.responses.grids),
            notes=sensor.cover.notes,
            warnings=self.warnings,
            assumed_electronics=sensor.assumed_electronics,
            seconds=self.seconds,
        )

    def explain(self) -> Iterator[str]:
        """Yield sentences about the forces on the texels, and about the mesh."""
        from meshes.solids import check_quality

        yield (
            "The force on a texel is the resultant on it along its own normal, shear included: on a curved base the "
            "forces of all texels need not sum to the load."
        )
        yield f"Finest mesh, hash {self.mesh.digest[:12]}: {'; '.join(check_quality(self.mesh).lines())}."


@derive_cover.register(SolidCover)
def _(cover: SolidCover, sensor: SensorDescription, progress: Progress | None = None) -> SolidDerivation:
    """Compute the responses of all texels of a solid cover, or read them from the store.

    Raises:
        InputError: If the mesh or a texel cannot be used, with one line per fault.
    """
    from fem_reference.curved_cover import texel_responses

    started = time.perf_counter()
    responses = texel_responses(make_meshes(sensor, progress), sensor.array, cover.layers, progress=progress)
    return SolidDerivation(sensor=sensor, responses=responses, seconds=time.perf_counter() - started)
