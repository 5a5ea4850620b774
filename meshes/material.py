"""Materials as names with numbers; the energies themselves live in `fem_reference`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

#: Parameters of each model: name -> unit ("Pa" or "-").  Lists of moduli are flat: mu1, alpha1, mu2, ...
MODELS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "linear-elastic": {"youngs_modulus": "Pa"},
        "neo-hookean": {"shear_modulus": "Pa"},
        "mooney-rivlin": {"c10": "Pa", "c01": "Pa"},
        "yeoh": {"c1": "Pa", "c2": "Pa", "c3": "Pa"},
        "ogden": {"mu": "Pa", "alpha": "-"},
    }
)


@dataclass(frozen=True, kw_only=True)
class Material:
    """An isotropic elastic material.

    Attributes:
        name: What to call it in reports.
        model: One of `MODELS`.
        parameters: The model's numbers in SI, as `MODELS` lists them.  Ogden: energy sum of
            2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3).
        poisson_ratio: Small-strain Poisson ratio, 0..0.5 [-].
        source: Where the numbers come from.
        spread: Relative half-width of the modulus between sources, 0.5 for +-50 % [-].
    """

    name: str
    model: str
    parameters: Mapping[str, float] = field(hash=False)
    poisson_ratio: float
    source: str = "given by the user"
    spread: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the model is unknown, a parameter is missing or the material would be unstable.
        """
        if self.model not in MODELS:
            raise ValueError(f"unknown material model {self.model!r}; known models: {', '.join(MODELS)}")
        wanted = set(MODELS[self.model])
        if wanted != set(self.parameters):
            raise ValueError(f"{self.model} takes {sorted(wanted)}, not {sorted(self.parameters)}")
        if not 0 <= self.poisson_ratio <= 0.5:  # noqa: PLR2004 -- the incompressible limit
            raise ValueError(f"poisson_ratio must lie in 0..0.5, not {self.poisson_ratio}")
        if self.shear_modulus <= 0:
            raise ValueError(f"the small-strain shear modulus must be positive, not {self.shear_modulus} Pa")

    @property
    def shear_modulus(self) -> float:
        """Small-strain shear modulus [Pa]."""
        p = self.parameters
        match self.model:
            case "linear-elastic":
                return p["youngs_modulus"] / (2 * (1 + self.poisson_ratio))
            case "neo-hookean":
                return p["shear_modulus"]
            case "mooney-rivlin":
                return 2 * (p["c10"] + p["c01"])
            case "yeoh":
                return 2 * p["c1"]
            case _:
                return p["mu"]

    @property
    def youngs_modulus(self) -> float:
        """Small-strain Young's modulus, 2 mu (1 + nu) [Pa]."""
        return 2 * self.shear_modulus * (1 + self.poisson_ratio)

    @property
    def small_strain_only(self) -> bool:
        """Whether the model is meant for small strain (`linear-elastic`)."""
        return self.model == "linear-elastic"
