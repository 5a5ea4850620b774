"""Quantities that the finite-element model cannot determine, as text for tables, JSON and the parameter folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshes import Cover
from validation.text.friction import describe_friction

if TYPE_CHECKING:
    from fastmodel.fitting.gaussian import Fit
    from validation.derivation.depth_fits import DepthFits

#: Standard deviation (sigma) of the Gaussian spread kernel, below which the forces on texels hardly depend on sigma
#: [pitches].
_NARROW_SIGMA = 0.27


def list_undetermined(cover: Cover, fit: Fit, depth: DepthFits | None, *, friction: float = 0.0) -> tuple[str, ...]:
    """List the quantities that the derivation of the fast model's parameters cannot determine, one line of text each.

    Args:
        cover: The cover.
        fit: The fitted spread kernel.
        depth: Contact stiffnesses fitted to the depth of a sphere; None for a cover with free side edges.
        friction: Friction coefficient between indenter and cover in the sensor file, inf for no slip [-].
    """
    ratio = "" if len(cover.layers) == 1 else "; between layers the ratio of moduli does matter"
    lines = [
        f"Young's modulus: no effect on the point spread or on how force is shared, only on depths{ratio}",
        "filter, noise, hysteresis, temperature gain, characteristic, gains: need a recording (`softcover calibrate`)",
        "shear, friction, rate and relaxation: the reference is one slow press along the normal",
    ]
    if friction:
        lines.append(
            f"friction {describe_friction(friction)} of the sensor file: not used, since every indenter here is "
            "frictionless; `press` and `validate` use it in the finite elements"
        )
    if cover.assumed:
        lines.append("thickness and material of this cover: assumed, nobody measured them")
    if min(fit.gaussian.sigma_x, fit.gaussian.sigma_y) < _NARROW_SIGMA:
        lines.append("sigma: the kernel is narrower than the texels resolve; any sigma below 0.26 pitches fits alike")
    if depth is None:
        lines.append("foundation modulus and contact parameters: near free side edges depth depends on the position")
        return tuple(lines)
    foundation, contact = depth.foundation, depth.contact
    lightest, heaviest = (foundation.estimates[name] / foundation.modulus for name in ("lightest", "heaviest"))
    lines.append(
        f"one foundation modulus for all loads: the lightest load alone gives {lightest:.2g} of the fitted one, the "
        f"heaviest {heaviest:.2g}"
    )
    lines.append(
        f"MuJoCo's depth under other loads: fitted to a free body of {1e3 * contact.mass:.3g} g only; in MuJoCo bodies "
        f"of all masses sink equally deep, here {contact.misses.max():+.0%} to {contact.misses.min():+.0%} off over "
        f"{depth.load.min():.2g}..{depth.load.max():.2g} N"
    )
    return tuple(lines)
