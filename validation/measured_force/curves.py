"""Forces of the finite elements at the measured depths, for the assumed inputs and for each varied input."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from meshes import Cover, Indenter, TexelArray
from validation.measured_force.case import FloatArray, Measurement

#: Names of the two bounds of friction, and their coefficients [-].
BOUNDS: Mapping[str, float] = {"frictionless": 0.0, "no slip": math.inf}
#: Half of a range that is as likely everywhere, over its standard uncertainty [-].
_UNIFORM = math.sqrt(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """Forces at n depths at the moduli of the file.

    Attributes:
        force: Forces, shape (n,) [N].
        error: Estimated relative errors of the finite elements, shape (n,) [-].
        varied: Forces with one uncertain input changed, by the name of the input, and the number of standard
            uncertainties by which each is changed, from one side of the input's range to the other.
    """

    force: FloatArray
    error: FloatArray
    varied: Mapping[str, tuple[FloatArray, FloatArray, float]]


def solve_curves(measurement: Measurement, progress: Callable[[str], None] | None = None) -> dict[str, Curve]:
    """Solve the indentation at every measured depth for both bounds of friction and for each varied input.

    The force on a wide, flat cover is multiplied by the effect of the free sides.  The effect is the ratio of the
    frictionless forces on the cover of limited size and on a wide one.  A domed top is replaced by a ball of the same
    gap.  Both are approximations, so the whole effect of each is one half-width of its range.

    Args:
        measurement: Indenter, cover and depths.
        progress: Called with a line of text before each solution.

    Raises:
        IncompletePathError: If the finite elements stop before the largest depth.
    """
    wide = replace(measurement.cover, size=None)
    domed, flat = measurement.domed_indenter, measurement.indenter
    depths = np.unique(measurement.depth)

    def solve(name: str, cover: Cover, indenter: Indenter, friction: float) -> tuple[FloatArray, FloatArray]:
        """Solve one curve, and return forces and relative errors at the depths of the measurement."""
        from fem_reference.indentation.press import press_path

        if progress is not None:
            progress(name)
        # The force does not depend on the texels.
        array = TexelArray.grid(1, 1, pitch=measurement.depth[0])
        path = press_path(cover, array, indenter, depths=depths.tolist(), friction=friction)
        at = np.searchsorted(depths, measurement.depth)
        force = np.array([each.total_force for each in path])[at]
        return force, np.array([each.error_estimate["total_force"] for each in path])[at]

    sides, sides_error = np.ones(len(measurement.depth)), np.zeros(len(measurement.depth))
    if measurement.cover.size is not None:
        bounded, sides_error = solve("free sides", measurement.cover, flat, 0.0)
        sides = bounded / solve("wide cover", wide, flat, 0.0)[0]
    curves = {}
    for bound, friction in BOUNDS.items():
        force, error = solve(bound, wide, domed, friction)
        varied = {}
        if ends := measurement.poisson_ends:
            low, high = (
                solve(f"{bound}, {end} Poisson ratio", replace(cover, size=None), domed, friction)[0]
                for end, cover in zip(("low", "high"), ends, strict=True)
            )
            varied["Poisson ratio"] = sides * low, sides * high, 2 * _UNIFORM
        if domed is not flat:
            varied["dome"] = sides * force, sides * solve(f"{bound}, flat top", wide, flat, friction)[0], _UNIFORM
        if measurement.cover.size is not None:
            varied["sides"] = sides * force, force, _UNIFORM
        curves[bound] = Curve(force=sides * force, error=np.hypot(error, sides_error), varied=varied)
    return curves
