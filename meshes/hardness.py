"""Young's modulus of a rubber, estimated from its hardness by two published relations.

Near 70 Shore A the moduli by the two relations differ by half of the modulus.  The estimate is the geometric mean of
the two moduli: a band of +-50 % about this mean contains the two relations over the whole range of hardness, and the
measured moduli of natural rubber.  Soft castable silicones are 1.5 to 2.5 times softer than either relation predicts;
use a named material of `meshes.catalogue` for them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

#: Least and greatest hardness for which the two relations were fitted [Shore A].
RANGE = (20.0, 80.0)
#: Half-width of the band about the estimated Young's modulus, over that modulus; coverage factor 2.  The band contains
#: the two relations and the measured moduli of natural rubber [-].
SPREAD = 0.5

SOURCE = (
    "from hardness: geometric mean of Gent 1958 and log10 E = 0.0235 S - 0.6403 (Qi, Joyce and Boyce 2003), "
    "+-50 % (k = 2); soft castable silicones are 1.5..2.5 times softer"
)


@dataclass(frozen=True, kw_only=True)
class HardnessModulus:
    """Young's modulus of a rubber, estimated from its hardness.

    Attributes:
        shore_a: Hardness [Shore A].
        youngs_modulus: Estimate of Young's modulus, the geometric mean of the moduli by the two relations [Pa].
        spread: Half-width of the band about the estimate, over the estimate; coverage factor 2 [-].
        by_relation: Young's modulus by each relation, under the name of the relation [Pa].
        source: Origin of the relations, for reports.
    """

    shore_a: float
    youngs_modulus: float
    spread: float
    by_relation: Mapping[str, float]
    source: str = SOURCE

    @property
    def low(self) -> float:
        """Lower end of the band of Young's modulus [Pa]."""
        return self.youngs_modulus * (1 - self.spread)

    @property
    def high(self) -> float:
        """Upper end of the band of Young's modulus [Pa]."""
        return self.youngs_modulus * (1 + self.spread)


def modulus_from_hardness(shore_a: float) -> HardnessModulus:
    """Estimate Young's modulus of a rubber, with a band, from its Shore A hardness.

    Args:
        shore_a: Hardness, within `RANGE` [Shore A].

    Raises:
        ValueError: If the hardness lies outside the range of the relations.
    """
    if not RANGE[0] <= shore_a <= RANGE[1]:
        raise ValueError(f"the relations hold for {RANGE[0]:g}..{RANGE[1]:g} Shore A, not for {shore_a:g}")
    moduli = {"gent-1958": modulus_by_gent(shore_a), "logarithmic": modulus_by_qi(shore_a)}
    mean = math.exp(sum(math.log(modulus) for modulus in moduli.values()) / len(moduli))
    return HardnessModulus(shore_a=shore_a, youngs_modulus=mean, spread=SPREAD, by_relation=MappingProxyType(moduli))


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
