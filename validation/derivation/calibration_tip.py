"""Share of a calibration tip's force that the texel under the tip measures.

A characteristic that was calibrated through the cover gives counts as a function of the force that a small tip applies
to the cover over the centre of a texel.  The fast model computes the force on the texel, which is a share of the
applied force.  Finite elements press the tip, a rod with a hemispherical end, to several depths.  The contact grows
with the load and the share falls.  The share that is used is the slope of the least-squares line through zero of the
force on the texel over the applied force, from zero to the load at which the counts saturate.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fastmodel.signal.electronics import Electronics
from meshes import Cover, Material, Pose, RoundedTip, TexelArray
from validation.derivation.kernel_fit import Influence

if TYPE_CHECKING:
    from fem_reference.indentation.result import Indentation

FloatArray = npt.NDArray[np.float64]

#: Depths of the tip over the thickness of the cover [-].
_DEPTHS = (0.1, 0.2, 0.4)
#: Exponent of the load over which the share is nearly straight: the area of a ball's contact grows so [-].
_EXPONENT = 2 / 3
#: Number of loads at which the line is fitted [-].
_FITTED_LOADS = 200
#: Decimals of the share, fewer than what differs between machines [-].
_DECIMALS = 4


@dataclass(frozen=True, kw_only=True)
class TipShare:
    """Share of a calibration tip's force that the texel under the tip measures.

    Attributes:
        radius: Radius of the hemispherical end of the tip [m].
        share: Force on the texel over the applied force, fitted over the range of loads [-].
        largest_load: Largest load of the range: that of saturation, or of the deepest press that finite elements at
            small strain compute [N].
        saturation_load: Load at which the counts saturate; None for a characteristic that never does [N].
        lightest: Share under a point load, the limit for light loads [-].
        heaviest: Share under the largest load of the range [-].
    """

    radius: float
    share: float
    largest_load: float
    saturation_load: float | None
    lightest: float
    heaviest: float


def compute_tip_share(
    cover: Cover, array: TexelArray, influence: Influence, electronics: Electronics
) -> TipShare | None:
    """Press the calibration tip of a sensor over the centre of the middle active texel by finite elements.

    The materials are linearised, as everywhere in a derivation.  For a cover with free side edges, the pressure under
    the tip is that on a wide cover, and the force on the texel follows from the response of the cover itself.

    Args:
        cover: The cover.
        array: A flat array.
        influence: Finite-element response of the texels to loads on the cover.
        electronics: Electronics with the characteristic.

    Returns:
        The share; None if the characteristic was calibrated against the texel force.

    Raises:
        ConvergenceError: If the finite elements did not converge.
        ValueError: If finite elements cannot press the tip.
    """
    from fem_reference.indentation.press import press_path

    radius = electronics.tip_radius
    if radius is None:
        return None
    texel = find_middle(array)
    centre = array.centres[texel, :2]
    path = press_path(
        linearise(cover),
        array,
        RoundedTip(radius=radius),
        depths=[depth * cover.thickness for depth in _DEPTHS],
        pose=Pose.planar(at=(float(centre[0]), float(centre[1]))),
    )
    lightest = float(influence.texel_influence(array, centre)[0, texel])
    loads = np.array([0.0, *(each.total_force for each in path)])
    shares = [lightest, *(_measure(each, array, influence)[texel] / each.total_force for each in path)]
    saturation = find_saturation(electronics)
    largest = float(loads[-1]) if saturation is None else min(saturation, float(loads[-1]))
    applied = np.linspace(0, largest, _FITTED_LOADS)
    on_texel = applied * np.interp(applied**_EXPONENT, loads**_EXPONENT, shares)
    share = round(float(applied @ on_texel / (applied @ applied)), _DECIMALS)
    if not share > 0:
        raise ValueError(
            f"a cover of {1e3 * cover.thickness:g} mm puts too little of the tip's force on a texel; give the true "
            'thickness, or calibrated = "texel force"'
        )
    return TipShare(
        radius=radius,
        share=share,
        largest_load=largest,
        saturation_load=saturation,
        lightest=lightest,
        heaviest=float(on_texel[-1] / largest),
    )


def find_middle(array: TexelArray) -> int:
    """Return the index of the active texel whose centre is nearest to that of the middle texel."""
    distance = np.linalg.norm(array.centres - array.centres[array.middle], axis=1)
    return int(np.argmin(np.where(array.active, distance, np.inf)))


def find_saturation(electronics: Electronics) -> float | None:
    """Return the smallest force on a texel of gain one from which counts saturate, None if they never do [N].

    The force is that which the characteristic is a function of.
    """
    coefficients = np.array(electronics.characteristic or (electronics.offset, electronics.sensitivity))
    coefficients[0] -= electronics.output_max + electronics.threshold
    roots = np.polynomial.Polynomial(coefficients).roots()
    forces = roots.real[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(forces.min()) if len(forces) else None


def linearise(cover: Cover) -> Cover:
    """Return a wide cover of the same layers with linear elastic materials of the same moduli at small strain."""
    layers = [
        dataclasses.replace(
            layer,
            material=Material(
                name=layer.material.name,
                model="linear-elastic",
                parameters={"youngs_modulus": layer.material.youngs_modulus},
                poisson_ratio=layer.material.poisson_ratio,
            ),
        )
        for layer in cover.layers
    ]
    return dataclasses.replace(cover, layers=tuple(layers), size=None)


def _measure(press: Indentation, array: TexelArray, influence: Influence) -> FloatArray:
    """Compute the force on each of n texels under the contact forces of a press, shape (n,) [N]."""
    x, y, force = press.contact.T
    measured = force @ influence.texel_influence(array, np.column_stack([x, y]))
    return np.asarray(measured * press.total_force / force.sum())
