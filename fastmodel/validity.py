"""The range of contacts in which the fast model agrees with the finite elements, and messages about contacts beyond it.

The range is stated for one reference contact: a ball of one pitch radius, over the centre of a texel and between
texels.  Another contact is compared with it by depth, because at equal depth the strains in the cover are similar.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from fastmodel.contact.interface import Reading

#: Share of the force on the outermost cells of a plate above which a contact may go on beyond it [-].
_AT_END = 1e-3
#: Number of cells of the contact grid under pressure below which the cells do not resolve a contact [-].
FEWEST_CELLS = 9
#: Names of the strain theories of the finite-element model with which the fast model may have been compared.
_STRAINS = ("finite", "small")


class RangeWarning(UserWarning):
    """Warn that a contact lies beyond the range in which the fast model agrees with the finite elements."""


@dataclass(frozen=True, kw_only=True)
class Validity:
    """Loads up to which the fast model places at most 2 and 5 % of the force under a ball on wrong texels.

    Smaller loads at which the contact covers fewer than `FEWEST_CELLS` cells are not counted, unless none covers more.

    Attributes:
        ball_radius: Radius of the ball, one pitch [m].
        load_2_percent: Load up to which at most 2 % of the force is on wrong texels [N].
        load_5_percent: Load up to which at most 5 % of the force is on wrong texels [N].
        depth_2_percent: Depth of the ball in the fast model at `load_2_percent` [m].
        depth_5_percent: Depth of the ball in the fast model at `load_5_percent` [m].
        largest_load: Largest load of the comparison [N].  If `load_2_percent` or `load_5_percent` equals it, the true
            limit is larger.
        strain: Strain of the finite elements: `finite` or `small`.
    """

    ball_radius: float
    load_2_percent: float
    load_5_percent: float
    depth_2_percent: float
    depth_5_percent: float
    largest_load: float
    strain: str

    def __post_init__(self) -> None:
        """Check the numbers of the range and the kind of strain.

        Raises:
            ValueError: If a number is not finite or is negative, if the radius or the largest load is zero, if the
                loads or depths descend, or if the kind of strain is unknown.
        """
        for name in (each.name for each in fields(self) if each.name != "strain"):
            value = getattr(self, name)
            if not isinstance(value, (int, float)) or isinstance(value, bool) or not 0 <= value < math.inf:
                raise ValueError(f"{name} must be a finite number that is not negative, not {value!r}")
        for name in ("ball_radius", "largest_load"):
            if not getattr(self, name):
                raise ValueError(f"{name} must be positive, not 0")
        if not self.load_2_percent <= self.load_5_percent <= self.largest_load:
            raise ValueError("load_2_percent, load_5_percent and largest_load must not descend")
        if self.depth_2_percent > self.depth_5_percent:
            raise ValueError("depth_2_percent must not exceed depth_5_percent")
        if self.strain not in _STRAINS:
            raise ValueError(f"strain must be {' or '.join(_STRAINS)}, not {self.strain!r}")

    def is_exceeded(self, reading: Reading) -> bool:
        """Return whether a contact lies beyond the range in which at most 5 % of the force is on wrong texels.

        The contact is compared by its depth, or by its force if its depth is unknown, as with the contact method
        `foundation`, to which the range of `cover` applies approximately.  Only readings with forces at the base of the
        cover are examined.
        """
        if reading.texel_forces is None:
            return False
        if reading.approach is None:
            return reading.carried > self.load_5_percent
        return bool(reading.approach.max(initial=0.0) > self.depth_5_percent)

    def describe_excess(self, reading: Reading) -> str:
        """Describe in one sentence a contact that lies beyond the range."""
        depth = "" if reading.approach is None else f", {1e3 * reading.approach.max(initial=0.0):.3g} mm deep"
        is_known = self.load_5_percent < self.largest_load
        known = "more than 5 % of the force is misplaced" if is_known else "the error is unknown"
        return (
            f"a contact ({reading.carried:.3g} N{depth}) lies beyond the range of the fast model: "
            f"under a ball of {1e3 * self.ball_radius:.3g} mm radius {known} above {self.load_5_percent:.3g} N, "
            f"{1e3 * self.depth_5_percent:.3g} mm deep"
        )


def goes_on(at_end: float) -> bool:
    """Return whether a contact reaches the end of a plate whose margin nobody states, and may go on beyond it."""
    return at_end > _AT_END


def describe_end(at_end: float) -> str:
    """Describe in one sentence a contact that reaches the end of the plate, with this share of its force on the rim."""
    return (
        f"a contact reaches the end of the plate, whose outermost cells bear {at_end:.2g} of the force: the "
        "cover beyond it bears nothing here, and the texels bear too much; state the width of the cover beyond the "
        "texels, margin in [array] of the sensor file or of meshes.TexelArray"
    )


def find_offset(reading: Reading) -> float:
    """Find the distance of the centre of pressure from that of MuJoCo's contacts, for bodies that may tilt [m]."""
    if reading.torques is None or not reading.carried > 0:
        return 0.0
    return math.hypot(*reading.torques[3:].tolist()) / reading.carried


def describe_offset(reading: Reading) -> str:
    """Describe in one sentence a centre of pressure that lies apart from that of MuJoCo's contacts."""
    return (
        f"the centre of pressure lies {1e3 * find_offset(reading):.2g} mm from that of MuJoCo's contacts, because no "
        f"pressure under the body's shape has their torque"
    )


def describe_limits(reading: Reading, validity: Validity | None) -> tuple[str, ...]:
    """Describe in sentences why the texel forces or the depth of a reading may be wrong; empty if nothing is known.

    Args:
        reading: The reading of a contact.
        validity: The range of the fast model; None if it is not stated.
    """
    messages: list[str] = []
    if reading.fewest_cells is not None and reading.fewest_cells < FEWEST_CELLS:
        messages.append(
            f"a contact covers only {reading.fewest_cells} of the fast model's cells: its depth is not resolved, and "
            f"its place is uncertain by the size of a cell"
        )
    if goes_on(reading.at_end):
        messages.append(describe_end(reading.at_end))
    if validity is not None and validity.is_exceeded(reading):
        messages.append(validity.describe_excess(reading))
    return tuple(messages)
