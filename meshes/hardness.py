"""From the hardness of a rubber to its Young's modulus: two published relations, and how far they can be trusted.

The relations differ by half near 70 Shore A.  Their geometric mean is taken, because a band of +-50 % about it holds
both over the whole range, and the measured moduli of natural rubber with them.  Soft castable silicones are 1.5 to 2.5
times softer than either says: take a named material for those.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

#: Shore A hardness over which both relations were fitted [-].
RANGE = (20.0, 80.0)
#: Relative half-width of the modulus, coverage factor 2 [-].
SPREAD = 0.5

SOURCE = (
    "from hardness: geometric mean of Gent 1958 and log10 E = 0.0235 S - 0.6403 (Qi, Joyce and Boyce 2003), "
    "+-50 % (k = 2); soft castable silicones are 1.5..2.5 times softer"
)


@dataclass(frozen=True, kw_only=True)
class HardnessModulus:
    """Young's modulus of a rubber of some hardness.

    Attributes:
        shore_a: Hardness [Shore A].
        youngs_modulus: Geometric mean of the relations [Pa].
        spread: Relative half-width, coverage factor 2 [-].
        by_relation: What each relation says [Pa].
        source: Where the number comes from.
    """

    shore_a: float
    youngs_modulus: float
    spread: float
    by_relation: Mapping[str, float]
    source: str = SOURCE

    @property
    def low(self) -> float:
        """Lower end of the band [Pa]."""
        return self.youngs_modulus * (1 - self.spread)

    @property
    def high(self) -> float:
        """Upper end of the band [Pa]."""
        return self.youngs_modulus * (1 + self.spread)


def modulus_from_hardness(shore_a: float) -> HardnessModulus:
    """Young's modulus of a rubber from its Shore A hardness, with its band.

    Args:
        shore_a: Hardness, within `RANGE` [Shore A].

    Raises:
        ValueError: If the hardness lies outside the range of the relations.
    """
    if not RANGE[0] <= shore_a <= RANGE[1]:
        raise ValueError(f"the relations hold for {RANGE[0]:g}..{RANGE[1]:g} Shore A, not for {shore_a:g}")
    each = {"gent-1958": gent(shore_a), "logarithmic": logarithmic(shore_a)}
    mean = math.exp(sum(math.log(value) for value in each.values()) / len(each))
    return HardnessModulus(shore_a=shore_a, youngs_modulus=mean, spread=SPREAD, by_relation=MappingProxyType(each))


def gent(shore_a: float) -> float:
    """E = 0.0981 (56 + 7.62336 S) / (0.137505 (254 - 2.54 S)) MPa (Gent 1958) [Pa].

    Args:
        shore_a: S [Shore A].
    """
    return 1e6 * 0.0981 * (56 + 7.62336 * shore_a) / (0.137505 * (254 - 2.54 * shore_a))


def logarithmic(shore_a: float) -> float:
    """log10 E = 0.0235 S - 0.6403, E in MPa (Qi, Joyce and Boyce 2003) [Pa].

    Args:
        shore_a: S [Shore A].
    """
    return float(1e6 * 10 ** (0.0235 * shore_a - 0.6403))
