"""Texel forces of a touch of given place, force and radius, by the exact or finite-element response of a cover.

A touch of radius a has the pressure of Hertz, (3 / 2 pi a^2) sqrt(1 - r^2 / a^2) per unit force.  On wide flat covers
it is exact, elsewhere a sum of equal point forces.  A touch of radius 0 is a point force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial, singledispatch
from typing import Protocol

import numpy as np

from meshes import Cover, SolidCover
from meshes.array_types import FloatArray, IntArray
from meshes.solids.texels import tangent_axes
from validation.sensor_file import SensorDescription

Progress = Callable[[str], None]
#: Number of circles of point forces of a round touch, and of point forces on each [-].
_CIRCLES, _AROUND = 4, 8
#: Step of place and radius in difference quotients over the pitch [-].
_STEP = 1e-3


class Respond(Protocol):
    """Forces of a cover on its active texels."""

    def __call__(self, points: FloatArray, axes: FloatArray, radius: float, among: IntArray) -> FloatArray:
        """Compute the force on m texels per unit force of round touches at k points, shape (k, m) [-].

        Args:
            points: Middles of the touches, shape (k, 3) [m].
            axes: Axes along which the touches are round, shape (2, 3) [-].
            radius: Radius of the touches [m].
            among: Indices of the m texels among the active ones.
        """


@dataclass(frozen=True, kw_only=True, eq=False)
class Touches:
    """Texel forces of touches above the n active texels of a sensor.

    Attributes:
        origins: Points on the top above each active texel, shape (n, 3) [m].
        axes: Unit vectors along x and y of the place, tangential to each texel, shape (n, 2, 3) [-].
        pitch: Pitch of the texels along x and y [m].
        respond: Forces on the texels.
        project: Nearest points on the top to points, both of shape (k, 3) [m].
    """

    origins: FloatArray
    axes: FloatArray
    pitch: tuple[float, float]
    respond: Respond
    project: Callable[[FloatArray], FloatArray] = np.asarray

    @property
    def step(self) -> float:
        """Step in difference quotients [m]."""
        return _STEP * min(self.pitch)

    def forces(self, texel: int, places: FloatArray, radius: float = 0.0, among: IntArray | None = None) -> FloatArray:
        """Compute the force on m texels per unit force of touches around one of them, shape (k, m) [-].

        Args:
            texel: Index among the active texels.
            places: Places of the k touches from the point above the texel, along x and y, shape (k, 2) [m].
            radius: Radius of the touches [m].
            among: Indices of the m texels among the active ones; all if None.
        """
        axes = self.axes[texel]
        chosen = np.arange(len(self.origins)) if among is None else among
        return self.respond(self.origins[texel] + places @ axes, axes, radius, chosen)


def spread_points(radius: float, circles: int = _CIRCLES, around: int = _AROUND) -> FloatArray:
    """Return points of equal force under a pressure of Hertz, shape (k, 2) [m].

    The force within r is 1 - (1 - r^2 / a^2)^(3/2).
    """
    if radius == 0:
        return np.zeros((1, 2))
    within = (np.arange(circles) + 0.5) / circles
    r = radius * np.sqrt(1 - (1 - within) ** (2 / 3))
    turn = 2 * np.pi * (np.arange(around) + 0.5) / around
    return np.stack([np.outer(r, np.cos(turn)), np.outer(r, np.sin(turn))], axis=-1).reshape(-1, 2)


def _sum_points(at: Callable[[FloatArray], FloatArray]) -> Respond:
    """Return round touches as sums of point forces, from the forces on all active texels per point force (k, n)."""

    def respond(points: FloatArray, axes: FloatArray, radius: float, among: IntArray) -> FloatArray:
        spots = spread_points(radius) @ axes
        found = at((points[:, None] + spots).reshape(-1, 3))[:, among]
        return np.asarray(found.reshape(len(points), len(spots), -1).mean(axis=1))

    return respond


@singledispatch
def find_touches(cover: object, sensor: SensorDescription, progress: Progress | None = None) -> Touches:
    """Prepare the response of a cover; each kind of cover registers its own function.

    Args:
        cover: The cover, which may be another than that of the sensor.
        sensor: Array of the sensor.
        progress: Called with a line of text before each step.

    Raises:
        TypeError: If no function is registered for the cover.
        ConvergenceError: If finite elements are needed and did not converge.
    """
    del sensor, progress
    raise TypeError(f"no touches are registered for {type(cover).__name__}")


@find_touches.register(Cover)
def _(cover: Cover, sensor: SensorDescription, progress: Progress | None = None) -> Touches:
    array, active = sensor.array, sensor.array.active
    centres = array.centres[active, :2]
    if cover.size is None:
        from fem_reference.closed_form.layer import tabulate_texel_response

        tabulate = cache(partial(tabulate_texel_response, cover, array.texel_size))

        def respond(points: FloatArray, axes: FloatArray, radius: float, among: IntArray) -> FloatArray:
            del axes
            return tabulate(radius).between(points[:, :2], centres[among])
    else:
        from fem_reference.linear_response.finite_cover import solid_influence
        from validation.derivation.contact_range import linearise

        if progress:
            progress("response of the cover with its sides")
        influence, half = solid_influence(linearise(cover), array), np.array(cover.size) / 2

        respond = _sum_points(
            lambda points: influence.texel_influence(array, np.clip(points[:, :2], -half, half))[:, active]
        )

    return Touches(
        origins=array.centres[active] + [0.0, 0.0, cover.thickness],
        axes=np.broadcast_to(np.eye(3)[:2], (len(centres), 2, 3)),
        pitch=array.pitch,
        respond=respond,
    )


@find_touches.register(SolidCover)
def _(cover: SolidCover, sensor: SensorDescription, progress: Progress | None = None) -> Touches:
    from fem_reference.curved_cover import texel_responses
    from validation.cover_meshes import make_meshes

    array, active = sensor.array, sensor.array.active
    responses = texel_responses(make_meshes(sensor, progress), array, cover.layers, progress=progress)
    grid = responses.finest

    def project(points: FloatArray) -> FloatArray:
        return np.asarray(grid.top.locate(points)[0] @ grid.top.nodes)

    return Touches(
        origins=responses.above[active],
        axes=tangent_axes(array.normals)[active],
        pitch=array.pitch,
        respond=_sum_points(lambda points: grid.at(points, beside=True)[:, active]),
        project=project,
    )
