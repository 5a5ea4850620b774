"""What the cover's depth under a ball says of the fast model's stiffnesses, and what no data of a cover can say."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from meshes import Cover, Sphere

if TYPE_CHECKING:
    from fastmodel.fitting.contact_stiffness import ContactFit, FoundationFit
    from fastmodel.fitting.gaussian import Fit
    from validation.sensor_file import SensorDescription

FloatArray = npt.NDArray[np.float64]

#: Contact radii over the cover's thickness at which depths are taken, and over the ball's radius at most.
_CONTACTS, _MOST = (0.25, 0.5, 0.75, 1.0, 1.5), 0.8
#: Radius of the ball [m].
_BALL = 5e-3
#: Width of a kernel below which texels cannot tell it [pitches].
_NARROW = 0.27


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthFits:
    """Force and depth of a ball on the cover, and what was fitted to them.

    Attributes:
        ball_radius: Radius of the ball [m].
        load: Forces, shape (k,) [N].
        depth: Approaches, by the exact bonded layers, shape (k,) [m].
        foundation: The elastic foundation.
        contact: MuJoCo's contact parameters.
    """

    ball_radius: float
    load: FloatArray
    depth: FloatArray
    foundation: FoundationFit
    contact: ContactFit

    def as_plain(self) -> dict[str, Any]:
        """Everything under the names that the command line prints."""
        return asdict(self)


def fit_depth(cover: Cover) -> DepthFits:
    """Press a ball into a wide cover and fit the foundation's modulus and the plate's contact parameters.

    Args:
        cover: A laterally wide cover, linearised at zero load.
    """
    from fastmodel.fitting.contact_stiffness import fit_contact, fit_foundation
    from fem_reference.closed_form.contact import sphere

    contacts = np.unique(np.minimum(np.array(_CONTACTS) * cover.thickness, _MOST * _BALL))
    # of a thick cover all sizes would be the largest one
    contacts = contacts if len(contacts) > 2 else _BALL * np.array([0.2, 0.4, _MOST])  # noqa: PLR2004 -- a curve
    pressed = [sphere(cover, _BALL, float(contact)) for contact in contacts]
    load, depth = (np.array([getattr(each, name) for each in pressed]) for name in ("force", "depth"))
    return DepthFits(
        ball_radius=_BALL,
        load=load,
        depth=depth,
        foundation=fit_foundation(Sphere(radius=_BALL), load, depth),
        contact=fit_contact(load, depth),
    )


def not_determined(sensor: SensorDescription, fit: Fit, depth: DepthFits | None) -> tuple[str, ...]:
    """What cover and reference leave open, a line each.

    Args:
        sensor: What was derived.
        fit: The kernel.
        depth: The fits to depth, where there are any.
    """
    stays = "" if len(sensor.cover.layers) == 1 else "; of several layers the ratio stays"
    recorded = "cut-off and order of the filter, noise, hysteresis, temperature gain, characteristic, gains"
    lines = [
        f"Young's modulus: it drops out of the point spread and of how force is shared, and sets depths only{stays}",
        f"{recorded}: a recording tells them (`softcover calibrate`)",
        "shear, friction, rate and relaxation: the reference presses along the normal, once and slowly",
    ]
    if sensor.cover.assumed:
        lines.append("thickness and material of this cover: assumed, nobody measured them")
    if min(fit.gaussian.sigma_x, fit.gaussian.sigma_y) < _NARROW:
        lines.append("sigma: the kernel is narrower than texels can tell; any width below 0.26 pitches fits alike")
    if depth is None:
        lines.append(
            "foundation modulus and contact parameters: depths beside free side edges differ from place to place"
        )
        return tuple(lines)
    ends = depth.foundation.estimates
    lines.append(
        f"one foundation modulus: the lightest touch asks for {ends['lightest'] / depth.foundation.modulus:.2g} of the "
        f"fitted one, the heaviest for {ends['heaviest'] / depth.foundation.modulus:.2g}"
    )
    misses = depth.contact.misses
    lines.append(
        f"MuJoCo's depth under other loads: matched for a free body of {1e3 * depth.contact.mass:.3g} g only; with any "
        f"parameters all masses sink alike, here {misses.max():+.0%} to {misses.min():+.0%} off over "
        f"{depth.load.min():.2g}..{depth.load.max():.2g} N"
    )
    return tuple(lines)
