"""Texel forces under an indenter in a given pose, by a contact method of the fast model or by finite elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

import meshes
from fastmodel import Parameters, indent
from fastmodel.attachment import DEFAULT, choose_method
from fastmodel.errors import MissedArrayError
from meshes import Cover, Indenter, TexelArray, tilt_indenter
from meshes.array_types import FloatArray
from validation.calibration.observations import Pose

if TYPE_CHECKING:
    from fem_reference import PointSpread

#: Name of the contact method by finite elements.
REFERENCE = "reference"
#: Edge of the squares in which the contact forces of finite elements are summed to one force at their centroid, as a
#: share of the pitch [-].  Fewer points make a fit of the pose faster; the squares are far smaller than a texel.
_BIN = 0.1
#: Number of loads at which the contact of an indenter that is not flat is solved; texel forces between them are
#: interpolated [-].
_LOADS = 7


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactMethod:
    """A method that computes texel forces, with the forces that it has computed.

    Attributes:
        name: Name of the method in tables.
        about: What the method assumes, in a few words.
        array: The n texels.
        solve: Function from indenter, load [N] and pose to the force on each texel, shape (n,) [N].
        gain_error: Largest known error of a texel's share of the load by the method, which passes into the gain of that
            texel; 0 for finite elements [-].
    """

    name: str
    about: str
    array: TexelArray
    solve: Callable[[Indenter, float, Pose], FloatArray]
    gain_error: float = 0.0
    _known: dict[tuple[Indenter, float, Pose], FloatArray] = field(default_factory=dict)

    def texel_forces(self, indenter: Indenter, loads: FloatArray, pose: Pose) -> FloatArray:
        """Compute the force on each of n texels under each of m loads; zero where the indenter misses the array.

        Under the face of a flat, level indenter, forces are proportional to the load.  For other indenters the contact
        is solved at up to seven loads, and the share of each texel is interpolated linearly in the logarithm of the
        load.

        Args:
            indenter: The indenter.
            loads: Loads, shape (m,) [N].
            pose: Pose of the indenter.

        Returns:
            Forces, shape (m, n) [N].
        """
        positive = loads[loads > 0]
        if not positive.size:
            return np.zeros((len(loads), self.array.count))
        if indenter.is_flat and not pose.tilt_x and not pose.tilt_y:
            return np.outer(loads, self._share(indenter, 1.0, pose))
        low, high = float(positive.min()), float(positive.max())
        grid = np.unique(positive) if len(np.unique(positive)) <= _LOADS else np.geomspace(low, high, _LOADS)
        shares = np.array([self._share(indenter, float(load), pose) for load in grid])
        place = np.interp(np.log(np.maximum(loads, low)), np.log(grid), np.arange(len(grid)))
        below = np.minimum(place.astype(int), max(len(grid) - 2, 0))
        part = (place - below)[:, None]
        above = np.minimum(below + 1, len(grid) - 1)
        return np.asarray(loads[:, None] * ((1 - part) * shares[below] + part * shares[above]))

    def _share(self, indenter: Indenter, load: float, pose: Pose) -> FloatArray:
        key = indenter, load, pose
        if key not in self._known:
            self._known[key] = self.solve(indenter, load, pose) / load
        return self._known[key]


def make_fast_method(parameters: Parameters, method: str = DEFAULT, *, name: str = "") -> ContactMethod:
    """Make the contact method of a fast model.

    Args:
        parameters: Array and cover of the fast model.
        method: Name of its contact method (`fastmodel.METHODS`), or `default`.
        name: Name of the method in tables; that of the contact method when not given.
    """

    def solve(indenter: Indenter, load: float, pose: Pose) -> FloatArray:
        tilted = tilt_indenter(indenter, (pose.tilt_x, pose.tilt_y))
        try:
            found = indent(parameters, tilted, load=load, at=(pose.x, pose.y), yaw=pose.yaw, method=method)
        except MissedArrayError:
            return np.zeros(parameters.array.count)
        return found.texel_forces

    chosen = choose_method(method, parameters)[0]
    return ContactMethod(
        name=name or f"fast model, {chosen}",
        about=_ABOUT.get(chosen, chosen),
        array=parameters.array,
        solve=solve,
        gain_error=_COVER_ERROR if chosen == "cover" else _SPREAD_ERROR,
    )


#: Largest errors of a gain by the contact methods of the fast model against finite elements, on made-up recordings of
#: a box of 16 mm x 12 mm on 8 x 10 texels: by the cover's cells, and by a Gaussian spread narrower than a texel [-].
_COVER_ERROR, _SPREAD_ERROR = 0.033, 0.34
#: What each contact method assumes.
_ABOUT = {
    "cover": "contact pressure on the layered cover, solved cell by cell",
    "boxes": "MuJoCo boxes share the load by contact points; Gaussian spread",
    "area": "the load shared by overlapped area; Gaussian spread",
    "foundation": "springs under the cover's surface; Gaussian spread",
    REFERENCE: "rigid frictionless indenter on the cover by finite elements at small strain",
}


def make_reference_method(cover: Cover, array: TexelArray) -> ContactMethod:
    """Make the contact method by finite elements at small strain.

    On a wide cover the contact is the same at every position and yaw, so it is solved once for each load and tilt.

    Args:
        cover: Cover; its materials are linearised and its sides are taken as far away.
        array: The texels.
    """
    from fem_reference import point_spread, press
    from validation.derivation.contact_range import linearise

    linear = linearise(cover)
    contacts: dict[tuple[Indenter, float, float, float], tuple[FloatArray, FloatArray]] = {}
    spread: list[PointSpread] = []

    def solve(indenter: Indenter, load: float, pose: Pose) -> FloatArray:
        key = indenter, load, pose.tilt_x, pose.tilt_y
        if not spread:
            spread.append(point_spread(linear))
        if key not in contacts:
            pressed = press(
                linear, array, indenter, load=load, pose=meshes.Pose.planar(tilt=(pose.tilt_x, pose.tilt_y))
            )
            contacts[key] = _bin_forces(pressed.contact, _BIN * min(array.pitch))
        points, forces = contacts[key]
        c, s = np.cos(pose.yaw), np.sin(pose.yaw)
        places = points @ np.array([[c, s], [-s, c]]) + (pose.x, pose.y)
        return np.asarray(load * (forces @ spread[0].texel_influence(array, places)) / forces.sum())

    return ContactMethod(name=REFERENCE, about=_ABOUT[REFERENCE], array=array, solve=solve)


def _bin_forces(contact: FloatArray, edge: float) -> tuple[FloatArray, FloatArray]:
    """Sum point forces in squares of a given edge.

    Args:
        contact: Columns x, y [m] and force [N], shape (m, 3).
        edge: Edge of the squares [m].

    Returns:
        Centroids of the forces in k squares, shape (k, 2) [m], and the forces, shape (k,) [N].
    """
    pressed = contact[contact[:, 2] > 0]
    squares = np.floor(pressed[:, :2] / edge).astype(np.int64)
    _, index = np.unique(squares, axis=0, return_inverse=True)
    index = index.ravel()
    forces = np.asarray(np.bincount(index, pressed[:, 2]), dtype=np.float64)
    centres = [np.bincount(index, pressed[:, 2] * pressed[:, axis]) / forces for axis in (0, 1)]
    return np.column_stack(centres), forces
