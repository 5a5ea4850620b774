"""Young's modulus of a rubber, estimated from its hardness on the scale Shore A or Shore 00.

Shore A has two published relations.  Near 70 Shore A the moduli by the two relations differ by half of the modulus.
The estimate is the geometric mean of the two moduli: a band of +-50 % about this mean contains the two relations over
the whole range of hardness, and the measured moduli of natural rubber.  Soft castable silicones are 1.5 to 2.5 times
softer than either relation predicts; use a named material of `meshes.catalogue` for them.

Shore 00 has no accepted relation.  The estimate is the modulus of a half space into which the rounded tip of the
durometer of ASTM D2240 sinks to the depth that corresponds to the reading.  It agrees with the relations of Shore A
within 25 % at the hardnesses that makers' charts equate (70 Shore 00 and 20 Shore A).  The castable silicones of the
catalogue are 2.5 to 4 times softer; the band of +-80 % contains them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, kw_only=True)
class HardnessScale:
    """A scale of hardness and the estimate of Young's modulus from it.

    Attributes:
        name: Name for readers.
        range: Least and greatest hardness for which the estimate holds.
        spread: Half-width of the band about the estimated modulus, over the estimated modulus; coverage factor 2 [-].
        relations: Functions from hardness to Young's modulus [Pa], by the name of the published relation.
        source: Origin of the relations, for reports.
    """

    name: str
    range: tuple[float, float]
    spread: float
    relations: Mapping[str, Callable[[float], float]]
    source: str


@dataclass(frozen=True, kw_only=True)
class _Durometer:
    """Durometer of type 00 in ASTM D2240."""

    #: Radius of the tip [m].
    radius: float = 1.19e-3
    #: Depth of the tip at a reading of 0 [m].
    depth: float = 2.5e-3
    #: Force at a reading of 0 [N].
    force: float = 0.203
    #: Increase of the force per unit of the reading [N].
    force_per_unit: float = 0.00908


_DUROMETER = _Durometer()


@dataclass(frozen=True, kw_only=True)
class HardnessModulus:
    """Young's modulus of a rubber, estimated from its hardness.

    Attributes:
        hardness: Hardness on the scale.
        scale: Scale of the hardness, one of `SCALES`.
        youngs_modulus: Estimate of Young's modulus, the geometric mean of the moduli by all relations [Pa].
        spread: Half-width of the band about the estimate, over the estimate; coverage factor 2 [-].
        by_relation: Young's modulus by each relation, under the name of the relation [Pa].
        source: Origin of the relations, for reports.
    """

    hardness: float
    scale: str
    youngs_modulus: float
    spread: float
    by_relation: Mapping[str, float]
    source: str

    def __str__(self) -> str:
        """Return hardness and scale as text, for example "60 Shore A"."""
        return f"{self.hardness:g} {SCALES[self.scale].name}"

    @property
    def low(self) -> float:
        """Lower end of the band of Young's modulus [Pa]."""
        return self.youngs_modulus * (1 - self.spread)

    @property
    def high(self) -> float:
        """Upper end of the band of Young's modulus [Pa]."""
        return self.youngs_modulus * (1 + self.spread)


def modulus_from_hardness(hardness: float, scale: str = "a") -> HardnessModulus:
    """Estimate Young's modulus of a rubber, with a band, from its hardness.

    Args:
        hardness: Hardness, within the range of its scale.
        scale: Scale of the hardness: `a` or `00`.

    Raises:
        ValueError: If the scale is unknown, or the hardness lies outside the range of the relations.
    """
    if scale not in SCALES:
        raise ValueError(f"the scale must be one of {', '.join(SCALES)}, not {scale!r}")
    known = SCALES[scale]
    low, high = known.range
    if not low <= hardness <= high:
        raise ValueError(f"the relations hold for {low:g}..{high:g} {known.name}, not for {hardness:g}")
    moduli = {name: relation(hardness) for name, relation in known.relations.items()}
    return HardnessModulus(
        hardness=hardness,
        scale=scale,
        youngs_modulus=math.exp(sum(math.log(modulus) for modulus in moduli.values()) / len(moduli)),
        spread=known.spread,
        by_relation=MappingProxyType(moduli),
        source=known.source,
    )


def modulus_by_ball(shore_00: float) -> float:
    """Compute Young's modulus [Pa] from Shore 00 hardness by the contact of the durometer's ball.

    The rubber is an incompressible half space.

    A ball of radius R that touches over a radius a is pressed in by d = a/2 ln((R + a) / (R - a)) under the force
    F = 4/3 E [(R^2 + a^2)/2 ln((R + a) / (R - a)) - a R] (Sneddon 1965, Poisson ratio 0.5).

    Args:
        shore_00: Hardness [Shore 00].
    """
    depth = _DUROMETER.depth * (1 - shore_00 / 100) / _DUROMETER.radius
    low, high = 0.0, 1.0
    for _ in range(60):  # bisection for the ratio a / R, with which the depth increases
        ratio = (low + high) / 2
        low, high = (ratio, high) if ratio * math.atanh(ratio) < depth else (low, ratio)
    force = (1 + ratio**2) * math.atanh(ratio) - ratio
    return (_DUROMETER.force + _DUROMETER.force_per_unit * shore_00) / (4 / 3 * force * _DUROMETER.radius**2)


def modulus_by_gent(shore_a: float) -> float:
    """Compute Young's modulus [Pa] from Shore A hardness by Gent (1958).

    In MPa it is E = 0.0981 (56 + 7.62336 S) / (0.137505 (254 - 2.54 S)).

    Args:
        shore_a: Hardness S [Shore A].
    """
    return 1e6 * 0.0981 * (56 + 7.62336 * shore_a) / (0.137505 * (254 - 2.54 * shore_a))


def modulus_by_qi(shore_a: float) -> float:
    """Compute Young's modulus by Qi, Joyce and Boyce (2003): log10 E = 0.0235 S - 0.6403 with E in MPa [Pa].

    Args:
        shore_a: Hardness S [Shore A].
    """
    return float(1e6 * 10 ** (0.0235 * shore_a - 0.6403))


#: Scales by the name that is written in a sensor file.  The relations of Shore A were fitted for 20..80; ASTM D2240
#: counts readings of 20..90 as reliable.  The band of Shore A contains both relations and the measured moduli of
#: natural rubber.  The band of Shore 00 contains the castable silicones of the catalogue.
SCALES = {
    "a": HardnessScale(
        name="Shore A",
        range=(20.0, 80.0),
        spread=0.5,
        relations={"gent-1958": modulus_by_gent, "logarithmic": modulus_by_qi},
        source="from hardness: geometric mean of Gent 1958 and log10 E = 0.0235 S - 0.6403 (Qi, Joyce and Boyce 2003), "
        "+-50 % (k = 2); soft castable silicones are 1.5..2.5 times softer",
    ),
    "00": HardnessScale(
        name="Shore 00",
        range=(20.0, 90.0),
        spread=0.8,
        relations={"durometer-ball": modulus_by_ball},
        source="from hardness: ball of a Shore 00 durometer (ASTM D2240) on an incompressible half space, +-80 % "
        "(k = 2); castable silicones are 2.5..4 times softer",
    ),
}
